"""An export for samplers is whole or not at all, replaces only its own, and is as loud and large as reported."""

import errno
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.export.sampled import job, sf2
from app.export.sampled.job import export_sampled, sample_folder
from app.export.sampled.words import instrument_bytes, needed_bytes
from app.export.wav import quantised
from app.shared.worker import Cancelled
from engine.whole_file import WriteError
from tests.app.export.sampled.conftest import STEREO, instrument_of, render
from tests.app.export.sampled.conftest import small as of_layers

KINDS = pytest.mark.parametrize("kind", ["sfz", "sf2"])
small = partial(of_layers, keys=(50, 54), layers=2, seconds=0.3)


def failing(error: BaseException) -> Callable[..., Any]:
    def fail(*_: object, **__: object) -> None:
        raise error

    return fail


def contents(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_an_instrument_is_replaced_whole_with_its_samples_and_those_of_others_stay(tmp_path, monkeypatch):
    out, folder = tmp_path / "a b.sfz", tmp_path / "a_b_samples"
    assert export_sampled(small(), out, render).samples == 10
    before = contents(tmp_path)
    export_sampled(small(), out, render)
    with monkeypatch.context() as full:
        full.setattr(job, "sfz_text", failing(OSError(errno.ENOSPC, "No space left on device")))
        with pytest.raises(WriteError, match="No space left"):
            export_sampled(small(instrument_of(level_db=-3.0)), out, render)
    with pytest.raises(WriteError, match=r"choose another name for a=b\.sfz"):  # which has the same folder
        export_sampled(small(), tmp_path / "a=b.sfz", render)
    assert contents(tmp_path) == before
    export_sampled(small(keys=(50, 51)), out, render)
    names = {path.name for path in sample_folder(out).iterdir()}
    assert names == {f"{zone.stem}.flac" for zone in small().zones if zone.key <= 51}
    (folder / "mine.flac").write_bytes(b"mine")
    with pytest.raises(WriteError, match=r"holds other files; remove it, or choose another name for a b\.sfz"):
        export_sampled(small(), out, render)
    assert (folder / "mine.flac").read_bytes() == b"mine"


@KINDS
def test_what_a_killed_export_left_goes_with_the_next(kind, tmp_path, monkeypatch):
    with monkeypatch.context() as killed:
        killed.setattr("engine.whole_file.os.getpid", lambda: 999_999_999)
        killed.setattr("engine.whole_file.shutil.rmtree", lambda *_, **__: None)
        with pytest.raises(KeyboardInterrupt):
            export_sampled(small(), tmp_path / f"a.{kind}", failing(KeyboardInterrupt()))
    (left,) = tmp_path.iterdir()
    export_sampled(small(), tmp_path / f"b.{kind}", render)
    assert not left.exists()


def test_cancelling_ends_within_a_note_or_while_a_soundfont_is_written_and_leaves_nothing(tmp_path, monkeypatch):
    reached_s, written, cancel = list[float](), list[int](), failing(Cancelled())

    def slow(*note: object, advanced: Callable[[float], None]) -> np.ndarray:
        for block in range(1, 31):
            reached_s.append(block / 100)
            advanced(block / 100)
        return render(*note)

    with pytest.raises(Cancelled):
        export_sampled(small(), tmp_path / "a.sfz", slow, progress=lambda *_: len(reached_s) == 35 and cancel())
    assert reached_s[-1] == 0.05  # of the second note
    monkeypatch.setattr(sf2, "quantised", lambda *words: written.append(1) or quantised(*words))
    with pytest.raises(Cancelled):
        export_sampled(small(), tmp_path / "a.sf2", render, progress=lambda *_: len(written) == 2 and cancel())
    assert list(tmp_path.iterdir()) == []


@KINDS
def test_a_place_that_cannot_be_written_is_reported_before_the_work(kind, tmp_path):
    (tmp_path / f"a.{kind}").mkdir()
    (tmp_path / "file").write_bytes(b"")
    (tmp_path / "b_samples").mkdir()
    (tmp_path / "b_samples" / "key050_vel063.flac").write_bytes(b"mine")
    before, places = sorted(tmp_path.rglob("*")), {f"a.{kind}": "not a file that", f"file/a.{kind}": "choose another"}
    for out, reported in {**places, "b.sfz": "holds other files"}.items():
        with pytest.raises(WriteError, match=reported):
            export_sampled(small(), tmp_path / out, lambda *_, advanced: pytest.fail("it was rendered"))
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("fields", [{}, {"pickup": STEREO}])
@pytest.mark.parametrize(
    ("kind", "form", "bits"),
    [("sfz", "wav", "16"), ("sfz", "wav", "24"), ("sfz", "flac", "16"), ("sfz", "flac", "24"), ("sf2", "flac", "24")],
)
def test_no_instrument_is_larger_than_reported(kind, form, bits, fields, tmp_path):
    plan, soundfont = small(instrument_of(**fields), format=form, bits=bits), kind == "sf2"

    def noise(instrument, key, velocity, held_s, seconds, rate_hz, *, advanced):
        shape = round(seconds * rate_hz), len(instrument.pickup.points)
        return np.random.default_rng(key).uniform(-0.1, 0.1, shape).astype(np.float32)

    reported = instrument_bytes(plan, soundfont)
    size = export_sampled(plan, tmp_path / f"a.{kind}", noise).size_bytes
    assert size <= reported
    assert size > (0.5 if form == "flac" and not soundfont else 0.97) * reported
    assert needed_bytes(plan, soundfont) == reported + (plan.largest_bytes if soundfont else 0)
