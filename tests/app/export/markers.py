"""Reads the markers of a WAV file, by its own parse of the chunks' bodies."""

from __future__ import annotations

import struct

from app.export.wav_chunks import Marker, chunks


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
