from __future__ import annotations

import errno
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from app.export.sampled import job, sf2
from app.export.sampled.job import export_sampled, sample_folder
from app.export.sampled.plan import SampledPlan
from app.export.wav import quantised
from app.instruments.instrument import Instrument
from app.shared.worker import Cancelled
from engine.whole_file import WriteError

Render = Callable[..., np.ndarray]
KINDS = pytest.mark.parametrize("kind", ["sfz", "sf2"])


def cancelled(when: Callable[[], bool]) -> Callable[..., None]:
    """Progress that cancels once `when` is so."""

    def progress(*_: object) -> None:
        if when():
            raise Cancelled

    return progress


def contents(folder: Path) -> dict[str, bytes]:
    """Of all files below."""
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def small(instrument: Instrument, **choices: object) -> SampledPlan:
    return SampledPlan(instrument, (50, 54), layers=2, seconds=0.3, **choices)


def test_an_instrument_is_replaced_with_its_samples(instrument: Instrument, render: Render, tmp_path: Path) -> None:
    out = tmp_path / "a.sfz"
    assert export_sampled(small(instrument), out, render).samples == 10
    before = contents(tmp_path)
    export_sampled(small(instrument), out, render)
    assert contents(tmp_path) == before
    export_sampled(SampledPlan(instrument, (50, 51), layers=2, seconds=0.3), out, render)
    names = {path.name for path in sample_folder(out).iterdir()}
    assert names == {f"{zone.stem}.flac" for zone in small(instrument).zones if zone.key <= 51}


@KINDS
def test_what_a_killed_export_left_goes_with_the_next(
    kind: str, instrument: Instrument, render: Render, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as killed:
        killed.setattr("engine.whole_file.os.getpid", lambda: 999_999_999)
        killed.setattr("engine.whole_file.shutil.rmtree", lambda *_, **__: None)

        def die(*_: object, **__: object) -> np.ndarray:
            raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            export_sampled(small(instrument), tmp_path / f"a.{kind}", die)
    (left,) = tmp_path.iterdir()
    export_sampled(small(instrument), tmp_path / f"b.{kind}", render)
    assert not left.exists()


def test_cancelling_ends_within_a_note_and_leaves_nothing(
    instrument: Instrument, render: Render, tmp_path: Path
) -> None:
    reached_s: list[float] = []

    def slow(*note: object, advanced: Callable[[float], None]) -> np.ndarray:
        for block in range(1, 31):
            reached_s.append(block / 100)
            advanced(block / 100)
        return render(*note)

    out = tmp_path / "a.sfz"
    with pytest.raises(Cancelled):
        export_sampled(small(instrument), out, slow, progress=cancelled(lambda: len(reached_s) == 35))
    assert reached_s[-1] == 0.05  # of the second note
    assert list(tmp_path.iterdir()) == []


def test_cancelling_ends_while_a_soundfont_is_written_and_leaves_nothing(
    instrument: Instrument, render: Render, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written: list[object] = []
    monkeypatch.setattr(sf2, "quantised", lambda *words: written.append(1) or quantised(*words))
    out = tmp_path / "a.sf2"
    with pytest.raises(Cancelled):
        export_sampled(small(instrument), out, render, progress=cancelled(lambda: len(written) == 2))
    assert list(tmp_path.iterdir()) == []


@KINDS
def test_peak_and_gain_are_those_of_the_notes(
    kind: str, instrument_of: Callable, render: Render, tmp_path: Path
) -> None:
    for level_db in (0.0, 12.0):
        # of one width, so that levels follow amplitudes up to the hardest velocity, which is not rendered
        instrument = instrument_of(level_db=level_db, pluck={"width": 0.1, "width_hard": 0.1})
        report = export_sampled(small(instrument), tmp_path / f"a{level_db:g}.{kind}", render)
        loudest = max(np.abs(render(instrument, key, 127, 0.3, 0.3, 48_000)).max() for key in range(50, 55))
        assert report.peak_db - report.gain_db == pytest.approx(20 * np.log10(loudest), abs=0.02)
        if kind == "sfz":
            assert report.peak_db <= -0.98


def test_a_folder_of_something_else_stays(instrument: Instrument, render: Render, tmp_path: Path) -> None:
    folder = tmp_path / "a_samples"
    folder.mkdir()
    (folder / "key050_vel063.flac").write_bytes(b"mine")
    refused = pytest.raises(WriteError, match=r"holds other files; remove it, or choose another name for a\.sfz")
    with refused:
        export_sampled(small(instrument), tmp_path / "a.sfz", render)
    assert contents(tmp_path) == {"a_samples/key050_vel063.flac": b"mine"}
    (tmp_path / "a.sfz").write_bytes(b"earlier")
    (folder / "mine.flac").write_bytes(b"mine")
    with refused:
        export_sampled(small(instrument), tmp_path / "a.sfz", render)
    assert (folder / "mine.flac").read_bytes() == b"mine"


def test_two_names_of_one_folder_do_not_mix(instrument: Instrument, render: Render, tmp_path: Path) -> None:
    export_sampled(small(instrument), tmp_path / "a b.sfz", render)
    with pytest.raises(WriteError, match=r"choose another name for a=b\.sfz"):
        export_sampled(small(instrument), tmp_path / "a=b.sfz", render)


def test_a_note_that_is_not_finite_is_reported(instrument: Instrument, tmp_path: Path) -> None:
    first = small(instrument).zones[0].stem
    with pytest.raises(WriteError, match=rf"{first}\.flac: the note holds values that are not finite"):
        export_sampled(small(instrument), tmp_path / "a.sfz", lambda *_, advanced: np.full((100, 1), np.inf))
    assert not (tmp_path / "a.sfz").exists()

    def none(*_: object, **more: object) -> np.ndarray:
        raise ValueError("key 50 has no string")

    with pytest.raises(WriteError, match="key 50 has no string"):
        export_sampled(small(instrument), tmp_path / "a.sfz", none)


@KINDS
def test_a_place_that_cannot_be_written_is_reported_before_the_work(
    kind: str, instrument: Instrument, tmp_path: Path
) -> None:
    (tmp_path / f"a.{kind}").mkdir()
    (tmp_path / "file").write_bytes(b"")
    for out, reported in ((f"a.{kind}", "not a file that can be replaced"), (f"file/a.{kind}", "choose another")):
        with pytest.raises(WriteError, match=reported):
            export_sampled(small(instrument), tmp_path / out, lambda *_, advanced: pytest.fail("it was rendered"))
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"a.{kind}", "file"]


def test_where_the_text_cannot_be_written_earlier_samples_stay(
    instrument: Instrument, render: Render, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    export_sampled(small(instrument), tmp_path / "a.sfz", render)
    before = contents(tmp_path)

    def full(*_: object) -> str:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(job, "sfz_text", full)
    with pytest.raises(WriteError, match="No space left"):
        export_sampled(small(instrument.with_value("level_db", -3.0)), tmp_path / "a.sfz", render)
    assert contents(tmp_path) == before
