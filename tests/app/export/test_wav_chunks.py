from __future__ import annotations

import io
import struct

import numpy as np
import pytest
import soundfile

from app.export.wav_chunks import Marker, chunks, finish
from tests.app.export.markers import read_markers

MARKERS = [Marker(0, "start"), Marker(123, "end of training"), Marker(399, "№ 3")]


def wav(channels: int = 1, subtype: str = "PCM_16") -> bytes:
    buffer = io.BytesIO()
    soundfile.write(buffer, np.zeros((401, channels)), 8000, subtype, format="WAV")
    return buffer.getvalue()


def with_markers(data: bytes, markers: list[Marker]) -> bytes:
    file = io.BytesIO(data)
    finish(file, markers)
    return file.getvalue()


@pytest.mark.parametrize(("channels", "subtype"), [(1, "PCM_16"), (1, "PCM_24"), (2, "FLOAT")])
def test_markers_survive_and_the_sound_is_untouched(channels: int, subtype: str) -> None:
    marked = with_markers(wav(channels, subtype), MARKERS)
    assert read_markers(marked) == MARKERS
    assert struct.unpack_from("<I", marked, 4)[0] == len(marked) - 8
    assert soundfile.info(io.BytesIO(marked)).frames == 401


def test_every_chunk_lies_on_an_even_byte() -> None:
    marked = with_markers(wav(subtype="PCM_24"), MARKERS)  # 1203 bytes of samples
    names = [name for name, start, _ in chunks(marked) if start % 2 == 0]
    assert names[-2:] == [b"cue ", b"LIST"]
    assert b"data" in names


def test_no_marker_is_no_chunk() -> None:
    assert with_markers(wav(), []) == wav()
