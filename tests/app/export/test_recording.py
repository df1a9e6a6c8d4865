"""Sounds of any length: memory holds a block of them, and blocks make the very same file."""

from __future__ import annotations

import io
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from app.export import recording, wav
from app.export.recording import Recording, blocks
from app.export.wav import WavSettings
from app.rendering.note_sound import NoteSound
from engine.pluck import Pluck
from engine.values.ear import Ear
from tests.app.sounds import export_sound


def test_a_recording_is_what_was_appended() -> None:
    samples = np.random.default_rng(0).normal(size=(1000, 2)).astype(np.float32)
    made = Recording(2)
    for part in np.split(samples, [1, 400, 401]):
        made.append(part)
    assert len(made) == 1000
    np.testing.assert_array_equal(made[:], samples)
    np.testing.assert_array_equal(made[399:403], samples[399:403])
    np.testing.assert_array_equal(np.concatenate([block for _, block in blocks(made, 64)]), samples)
    made.cut(10)
    assert len(made) == len(made[:]) == 10 and made[5:5].shape == (0, 2)


@pytest.mark.parametrize("bits", ["16", "24", "32f"])
@pytest.mark.parametrize("normalise", [False, True])
def test_any_blocks_make_the_same_bytes(bits: wav.Bits, normalise: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    sound = np.random.default_rng(0).normal(size=(1000, 2)) / 3
    settings = wav.WavSettings(bits, normalise=normalise)
    whole, again = io.BytesIO(), io.BytesIO()
    level = wav.write_wav(whole, sound, 8000, settings, {"title": "a"}, [2 * sound])
    monkeypatch.setattr(recording.blocks, "__defaults__", (7,))
    assert wav.write_wav(again, sound, 8000, settings, {"title": "a"}, [2 * sound]) == level
    assert again.getvalue() == whole.getvalue() and (level.clipped > 0) == (bits != "32f" and not normalise)


def test_a_disk_that_becomes_full_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    class Full(io.BytesIO):
        def write(self, data: object) -> int:  # type: ignore[override]
            if self.tell() > 1000:
                raise OSError(28, "No space left on device")
            return super().write(data)  # type: ignore[arg-type]

    with pytest.raises(OSError, match="No space left"):
        wav.write_wav(Full(), np.zeros(100_000), 8000, wav.WavSettings(), {})


def test_memory_does_not_grow_with_the_duration(small_preset: Path, tmp_path: Path) -> None:
    settings = WavSettings("16", 192_000, normalise=True)
    peaks = []
    for seconds in (0.5, 1.0, 4.0):  # the first also pays what is loaded once
        sound = NoteSound(small_preset, Pluck(), seconds, Ear((0.37, 0.6)))
        tracemalloc.start()
        report = export_sound(sound, tmp_path / "long.wav", "truth", settings)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert report.frames == seconds * 192_000
    assert peaks[2] < peaks[1] + 2**20
