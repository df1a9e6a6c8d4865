"""Chunks of a WAV file that libsndfile does not write through soundfile: markers, and PEAK without the time."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Marker:
    """A named place in a sound."""

    frame: int
    label: str


def with_markers(data: bytes, markers: Sequence[Marker]) -> bytes:
    """The WAV file with a "cue " chunk and the labels of its points (LIST adtl), as editors show them."""
    if not markers:
        return data
    points = b"".join(
        # number, place in the play order, chunk, start of the chunk, start of the block, sample
        struct.pack("<II4sIII", number, marker.frame, b"data", 0, 0, marker.frame)
        for number, marker in enumerate(markers, 1)
    )
    labels = b"".join(
        _chunk(b"labl", struct.pack("<I", number) + marker.label.encode() + b"\0")
        for number, marker in enumerate(markers, 1)
    )
    cue = _chunk(b"cue ", struct.pack("<I", len(markers)) + points)
    return _sized(_padded(data) + cue + _chunk(b"LIST", b"adtl" + labels))


def read_markers(data: bytes) -> list[Marker]:
    """The markers of a WAV file, in the order of their numbers; damaged ones are left out."""
    frames: dict[int, int] = {}
    labels: dict[int, str] = {}
    for name, start, size in chunks(data):
        body = data[start : start + size]
        if name == b"cue ":
            for place in range(4, len(body) - 23, 24):
                number, _, _, _, _, frame = struct.unpack_from("<II4sIII", body, place)
                frames[number] = frame
        elif name == b"LIST" and body[:4] == b"adtl":
            for kind, first, length in chunks(body, 4):
                if kind == b"labl" and length >= 4:
                    (number,) = struct.unpack_from("<I", body, first)
                    labels[number] = body[first + 4 : first + length].rstrip(b"\0").decode(errors="replace")
    return [Marker(frames[number], labels.get(number, "")) for number in sorted(frames)]


def without_time_stamp(data: bytes) -> bytes:
    """The same WAV with the time in its PEAK chunk, which libsndfile adds to floating point, set to zero."""
    for name, start, _ in chunks(data):
        if name == b"PEAK":
            return data[: start + 4] + bytes(4) + data[start + 8 :]  # after the version
    return data


def chunks(data: bytes, position: int = 12) -> Iterator[tuple[bytes, int, int]]:
    """Name, first byte and size (as far as it is there) of each chunk, first those after "RIFF", size, "WAVE"."""
    while position + 8 <= len(data):
        name, size = struct.unpack_from("<4sI", data, position)
        yield name, position + 8, min(size, len(data) - position - 8)
        position += 8 + size + size % 2


def _chunk(name: bytes, body: bytes) -> bytes:
    return _padded(name + struct.pack("<I", len(body)) + body)


def _padded(data: bytes) -> bytes:
    return data + bytes(len(data) % 2)


def _sized(data: bytes) -> bytes:
    return data[:4] + struct.pack("<I", len(data) - 8) + data[8:]
