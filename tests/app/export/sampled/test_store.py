from __future__ import annotations

import json
import os
import subprocess
import sys
import textwrap
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from filelock import FileLock

from app.export.sampled import sf2
from app.export.sampled.job import export_sampled, kept_samples, sample_folder
from app.export.sampled.plan import MOST_LAYERS, SampledPlan
from app.export.sampled.store import INDEX, LOCK, SampleIndex, StoredSample, read_index
from app.export.wav import quantised
from app.patches.patch import Patch
from app.shared.worker import Cancelled
from engine.result_file import WriteError

Render = Callable[..., np.ndarray]
KINDS = pytest.mark.parametrize("kind", ["sfz", "sf2"])

# This script ends its process, as a kill does: before a note, or before the first line of the index about a sample.
KILLED = """
    import os, sys
    from pathlib import Path
    import numpy as np
    from app.export.sampled.job import export_sampled
    from app.export.sampled.plan import MOST_LAYERS, SampledPlan
    from app.patches.patch import Patch

    from app.export.sampled import store

    notes, last = 0, sys.argv[4]

    def render(patch, key, velocity, held_s, seconds, rate_hz, advanced):
        global notes
        notes += 1
        if str(notes) == last:
            os._exit(9)
        return np.load(Path(sys.argv[3]) / f"{key}_{velocity}.npy")

    if last == "index":
        store.StoredSample = lambda **_: os._exit(9)
    patch = Patch.model_validate_json(Path(sys.argv[1]).read_text())
    export_sampled(SampledPlan(patch, (50, 54), layers=2, seconds=0.3), Path(sys.argv[2]), render)
"""


def cancelled(when: Callable[[], bool]) -> Callable[..., None]:
    """Progress that cancels once `when` is so."""

    def progress(*_: object) -> None:
        if when():
            raise Cancelled

    return progress


def contents(folder: Path) -> dict[str, bytes]:
    """Of all files below, except for locks."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != LOCK
    }


def small(patch: Patch, **choices: object) -> SampledPlan:
    return SampledPlan(patch, (50, 54), layers=2, seconds=0.3, **choices)


@pytest.mark.parametrize(
    ("kind", "last", "left"), [("sfz", "6", 5), ("sf2", "6", 5), ("sfz", "1", 0), ("sfz", "index", 1)]
)
def test_after_a_kill_it_goes_on_to_the_same_bytes(
    kind: str, last: str, left: int, patch: Patch, render: Render, tmp_path: Path
) -> None:
    for name in ("whole", "killed", "notes"):
        (tmp_path / name).mkdir()
    out, plan = tmp_path / "whole" / f"a.{kind}", small(patch)
    export_sampled(plan, out, render)
    for zone in plan.zones:
        note = render(patch, zone.key, zone.velocity, 0.3, 0.3, 48_000)
        np.save(tmp_path / "notes" / f"{zone.key}_{zone.velocity}.npy", note)
    (tmp_path / "patch.json").write_text(patch.model_dump_json())

    killed = tmp_path / "killed" / f"a.{kind}"
    words = [sys.executable, "-c", textwrap.dedent(KILLED), tmp_path / "patch.json", killed, tmp_path / "notes", last]
    place = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    assert subprocess.run(words, env=place).returncode == 9
    assert not killed.exists()
    assert len(list(sample_folder(killed).glob("*.flac"))) == left
    report = export_sampled(plan, killed, render)
    assert (report.samples, report.rendered) == (10, 10 if last == "index" else 10 - left)
    assert contents(tmp_path / "killed") == contents(tmp_path / "whole")


def test_what_is_there_is_kept(patch: Patch, render: Render, tmp_path: Path) -> None:
    out = tmp_path / "a.sfz"
    assert export_sampled(small(patch), out, render).rendered == 10
    before = contents(tmp_path)
    assert export_sampled(small(patch), out, render).rendered == 0
    renamed = patch.model_copy(update={"name": "Another"})
    assert export_sampled(small(renamed), out, render).rendered == 0
    assert b"// Another" in out.read_bytes()
    assert {n: data for n, data in contents(tmp_path).items() if n != "a.sfz"} == {
        n: data for n, data in before.items() if n != "a.sfz"
    }


def test_a_changed_patch_reuses_nothing(patch: Patch, render: Render, tmp_path: Path) -> None:
    out = tmp_path / "a.sfz"
    export_sampled(small(patch), out, render)
    changed = patch.with_value("level_db", -12.0)
    assert export_sampled(small(changed), out, render).rendered == 10
    assert export_sampled(small(changed, preset_sha256="1" * 64), out, render).rendered == 10


def test_a_damaged_or_missing_sample_is_rendered_again(patch: Patch, render: Render, tmp_path: Path) -> None:
    out = tmp_path / "a.sfz"
    export_sampled(small(patch), out, render)
    before = contents(tmp_path)
    first, second, *_ = sorted(sample_folder(out).glob("*.flac"))
    first.write_bytes(first.read_bytes()[:-1] + b"?")
    second.unlink()
    assert export_sampled(small(patch), out, render).rendered == 2
    assert contents(tmp_path) == before


def test_samples_that_the_plan_lost_go(patch: Patch, render: Render, tmp_path: Path) -> None:
    out = tmp_path / "a.sfz"
    export_sampled(small(patch), out, render)
    (sample_folder(out) / "mine.flac").write_bytes(b"not of the export")
    assert export_sampled(SampledPlan(patch, (50, 51), layers=2, seconds=0.3), out, render).rendered == 0
    names = {path.name for path in sample_folder(out).glob("*.flac")}
    assert names == {"mine.flac", *(f"{zone.stem}.flac" for zone in small(patch).zones if zone.key <= 51)}


def test_a_soundfont_leaves_no_folder(patch: Patch, render: Render, tmp_path: Path) -> None:
    export_sampled(small(patch), tmp_path / "a.sf2", render)
    assert [path.name for path in tmp_path.iterdir()] == ["a.sf2"]


@KINDS
def test_cancelling_keeps_what_is_whole(kind: str, patch: Patch, render: Render, tmp_path: Path) -> None:
    reported: list[tuple[float, str, float | None]] = []

    def progress(share: float, text: str, left_s: float | None = None) -> None:
        if text == "checking samples":
            return
        if len(reported) > 3:
            raise Cancelled
        reported.append((share, text, left_s))

    out = tmp_path / f"a.{kind}"
    with pytest.raises(Cancelled):
        export_sampled(small(patch), out, render, progress=progress)
    assert not out.exists()
    assert [share for share, _, _ in reported] == [0.0, 0.1, 0.2, 0.3]
    assert reported[0][1:] == (f"key 50, velocity {small(patch).zones[0].velocity}", None)
    assert [left_s is None for _, _, left_s in reported] == [True, True, False, False]  # the first note also compiles
    assert kept_samples(small(patch), out) == 4
    assert kept_samples(SampledPlan(patch, (50, 53), layers=2, seconds=0.3), out) == 4
    assert kept_samples(small(patch, source="truth"), out) == 0
    assert kept_samples(small(patch), out.with_stem("b")) == 0
    assert export_sampled(small(patch), out, render).rendered == 6


@KINDS
def test_cancelled_before_a_whole_sample_nothing_is_left(
    kind: str, patch: Patch, render: Render, tmp_path: Path
) -> None:
    with pytest.raises(Cancelled):
        export_sampled(small(patch), tmp_path / f"a.{kind}", render, progress=cancelled(lambda: True))
    assert list(tmp_path.iterdir()) == []


def test_cancelling_ends_within_a_note(patch: Patch, render: Render, tmp_path: Path) -> None:
    reached_s: list[float] = []

    def slow(*note: object, advanced: Callable[[float], None]) -> np.ndarray:
        for block in range(1, 31):
            reached_s.append(block / 100)
            advanced(block / 100)
        return render(*note)

    out = tmp_path / "a.sfz"
    with pytest.raises(Cancelled):
        export_sampled(small(patch), out, slow, progress=cancelled(lambda: len(reached_s) == 35))
    assert reached_s[-1] == 0.05  # of the second note
    assert kept_samples(small(patch), out) == 1


def test_cancelling_ends_while_a_soundfont_is_written(
    patch: Patch, render: Render, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written: list[object] = []
    monkeypatch.setattr(sf2, "quantised", lambda *words: written.append(1) or quantised(*words))
    out = tmp_path / "a.sf2"
    with pytest.raises(Cancelled):
        export_sampled(small(patch), out, render, progress=cancelled(lambda: len(written) == 2))
    assert not out.exists()
    assert kept_samples(small(patch), out) == 10


@KINDS
def test_peak_and_gain_are_those_of_the_notes(kind: str, patch_of: Callable, render: Render, tmp_path: Path) -> None:
    for level_db in (0.0, 12.0):
        # of one width, so that levels follow amplitudes up to the hardest velocity, which is not rendered
        patch = patch_of(level_db=level_db, pluck={"width": 0.1, "width_hard": 0.1})
        report = export_sampled(small(patch), tmp_path / f"a{level_db:g}.{kind}", render)
        loudest = max(np.abs(render(patch, key, 127, 0.3, 0.3, 48_000)).max() for key in range(50, 55))
        assert report.peak_db - report.gain_db == pytest.approx(20 * np.log10(loudest), abs=0.02)
        if kind == "sfz":
            assert report.peak_db <= -0.98


def test_a_folder_of_something_else_stays(patch: Patch, render: Render, tmp_path: Path) -> None:
    folder = tmp_path / "a_samples"
    folder.mkdir()
    (folder / "key050_vel063.flac").write_bytes(b"mine")
    with pytest.raises(WriteError, match=r"holds other files; remove it, or choose another name for a\.sfz"):
        export_sampled(small(patch), tmp_path / "a.sfz", render)
    assert contents(tmp_path) == {f"a_samples{os.sep}key050_vel063.flac": b"mine"}


def test_two_names_of_one_folder_do_not_mix(patch: Patch, render: Render, tmp_path: Path) -> None:
    export_sampled(small(patch), tmp_path / "a b.sfz", render)
    with pytest.raises(WriteError, match=r"holds the samples of a b\.sfz"):
        export_sampled(small(patch), tmp_path / "a=b.sfz", render)


def test_one_export_at_a_time(patch: Patch, render: Render, tmp_path: Path) -> None:
    out = tmp_path / "a.sfz"
    export_sampled(small(patch), out, render)
    with FileLock(sample_folder(out) / LOCK), pytest.raises(WriteError, match="another export writes there"):
        export_sampled(small(patch), out, render)


def test_an_index_of_a_stranger_removes_nothing_else(patch: Patch, render: Render, tmp_path: Path) -> None:
    out, victim = tmp_path / "a.sfz", tmp_path / "victim.flac"
    export_sampled(small(patch), out, render)
    victim.write_bytes(b"mine")
    path = sample_folder(out) / INDEX
    index = json.loads(path.read_bytes())
    entry = next(iter(index["samples"].values()))
    index["samples"] |= {"../victim.flac": entry, str(victim): entry}
    path.write_text(json.dumps(index))
    export_sampled(small(patch), out, render)
    assert victim.read_bytes() == b"mine"


@pytest.mark.parametrize("text", ["", "{", "[1]", '{"format": 2, "instrument": "a.sfz", "samples": {}}', "\x00" * 99])
def test_a_broken_index_is_reported(text: str, patch: Patch, render: Render, tmp_path: Path) -> None:
    out = tmp_path / "a.sfz"
    export_sampled(small(patch), out, render)
    (sample_folder(out) / INDEX).write_text(text)
    with pytest.raises(WriteError, match=r"index\.json: no index of samples that this version reads; remove its"):
        export_sampled(small(patch), out, render)


def test_the_index_of_the_largest_instrument_is_read(patch_of: Callable[..., Patch], tmp_path: Path) -> None:
    plan = SampledPlan(patch_of(range=(0, 127)), layers=MOST_LAYERS)
    entry = StoredSample(
        made_from="0" * 64,
        sha256="1" * 64,
        frames=2_880_000,
        channels=2,
        gain_db=-100.25,
        level_db=-100.125,
        cut=True,
    )
    index = SampleIndex(instrument="a" * 250 + ".sfz", samples={plan.file_name(zone): entry for zone in plan.zones})
    (tmp_path / INDEX).write_text(index.model_dump_json(indent=1))
    assert read_index(tmp_path / INDEX) == index


def test_a_note_that_is_not_finite_is_reported(patch: Patch, tmp_path: Path) -> None:
    first = small(patch).zones[0].stem
    with pytest.raises(WriteError, match=rf"{first}\.flac: the note holds values that are not finite"):
        export_sampled(small(patch), tmp_path / "a.sfz", lambda *_, advanced: np.full((100, 1), np.inf))
    assert not (tmp_path / "a.sfz").exists()


def test_a_key_without_a_note_is_reported(patch: Patch, tmp_path: Path) -> None:
    def none(*_: object, **more: object) -> np.ndarray:
        raise ValueError("key 50 has no string")

    with pytest.raises(WriteError, match="key 50 has no string"):
        export_sampled(small(patch), tmp_path / "a.sfz", none)


def test_a_place_that_cannot_be_written_is_reported(patch: Patch, render: Render, tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(WriteError, match="choose another"):
        export_sampled(small(patch), tmp_path / "file" / "a.sfz", render)
