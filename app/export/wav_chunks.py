"""Chunks of a WAV file that soundfile cannot write: markers, and a PEAK chunk without the time of writing.

RIFF/WAVE: "Multimedia Programming Interface and Data Specifications 1.0" (IBM and Microsoft, 1991).
"""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import BinaryIO

HEAD_BYTES = 2**16  # of the file, in which all chunks before the samples lie


@dataclass(frozen=True)
class Marker:
    """A named place in a sound."""

    frame: int
    label: str


def finish(file: BinaryIO, markers: Sequence[Marker]) -> None:
    """Adds markers to a WAV file written by libsndfile and zeroes the time in its PEAK chunk.

    Without that time the same sound makes the same bytes.
    """
    file.seek(0)
    head = file.read(HEAD_BYTES)
    for name, start, _ in chunks(head):
        if name == b"PEAK":
            file.seek(start + 4)  # after the version
            file.write(bytes(4))
            break
    _append(file, markers)


def _append(file: BinaryIO, markers: Sequence[Marker]) -> None:
    if not markers:
        return
    points = b"".join(
        # identifier, position in the play order, chunk, start of the chunk, start of the block, frame
        struct.pack("<II4sIII", number, marker.frame, b"data", 0, 0, marker.frame)
        for number, marker in enumerate(markers, 1)
    )
    labels = b"".join(
        _chunk(b"labl", struct.pack("<I", number) + marker.label.encode() + b"\0")
        for number, marker in enumerate(markers, 1)
    )
    cue = _chunk(b"cue ", struct.pack("<I", len(markers)) + points)
    file.write(bytes(file.seek(0, io.SEEK_END) % 2))
    file.write(cue + _chunk(b"LIST", b"adtl" + labels))
    size = file.tell()
    file.seek(4)
    file.write(struct.pack("<I", size - 8))


def chunks(data: bytes, position: int = 12) -> Iterator[tuple[bytes, int, int]]:
    """Name, offset of the body and its size (cut off at the data's end) of each chunk from `position` on.

    By default after the 12 bytes "RIFF", size, "WAVE".
    """
    while position + 8 <= len(data):
        name, size = struct.unpack_from("<4sI", data, position)
        yield name, position + 8, min(size, len(data) - position - 8)
        position += 8 + size + size % 2


def _chunk(name: bytes, body: bytes) -> bytes:
    return _padded(name + struct.pack("<I", len(body)) + body)


def _padded(data: bytes) -> bytes:
    return data + bytes(len(data) % 2)
