"""Recordings of every format are read, and what cannot be used is named with its remedy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import soundfile

from app.audio.note_file import NoteFileError, read_note


@pytest.mark.parametrize("subtype", ["PCM_U8", "PCM_16", "PCM_24", "PCM_32", "FLOAT", "DOUBLE"])
@pytest.mark.parametrize("rate_hz", [44_100, 192_000])
def test_formats(tmp_path: Path, subtype: str, rate_hz: int) -> None:
    sound = 0.5 * np.sin(np.arange(4_000) / 20)
    soundfile.write(tmp_path / "a.wav", np.stack([sound, sound], 1), rate_hz, subtype=subtype)
    read = read_note(tmp_path / "a.wav")
    assert (read.rate_hz, read.samples.shape) == (rate_hz, (4_000, 2))
    assert np.allclose(read.samples[:, 0], sound, atol=0.01)
    assert len(read.digest) == 64


def test_ten_minutes_are_too_long(tmp_path: Path) -> None:
    soundfile.write(tmp_path / "a.wav", np.zeros(600 * 8_000), 8_000, subtype="PCM_U8")
    with pytest.raises(NoteFileError, match=r"lasts 600 s; cut out one note"):
        read_note(tmp_path / "a.wav")


@pytest.mark.parametrize(("content", "words"), [(b"", "no sound file"), (b"no sound at all", "no sound file")])
def test_other_files_are_named(tmp_path: Path, content: bytes, words: str) -> None:
    path = tmp_path / "a.wav"
    path.write_bytes(content)
    with pytest.raises(NoteFileError, match=words):
        read_note(path)
    with pytest.raises(NoteFileError, match="no file"):
        read_note(tmp_path / "missing.wav")
