"""A way through the bytes of a MIDI file before a library makes an object of each of its messages.

Source: Standard MIDI Files 1.0. The library reads a number of any length, in a time that grows with its square, and
counts nothing; and it refuses a file for a key or a text that it cannot read, which do not matter here.
"""

from __future__ import annotations

LONGEST_NUMBER = 4  # bytes of a number of variable length, by the standard
TEMPO, END_OF_TRACK, ANY = 0x51, 0x2F, 0x7F  # kinds of meta messages; "any" is what each program puts there
META, SYSTEM_EXCLUSIVE = 0xFF, (0xF0, 0xF7)
_DATA_BYTES = {
    0x8: 2,
    0x9: 2,
    0xA: 2,
    0xB: 2,
    0xC: 1,
    0xD: 1,
    0xE: 2,
    0xF1: 1,
    0xF2: 2,
    0xF3: 1,
}  # by kind, or status


def checked_chunks(file: bytes, most: int) -> bytes:
    """Goes through the messages of all tracks, as the library would; the file without the kinds that do not matter.

    Raises:
        ValueError: the bytes are no MIDI file, or one with more than `most` messages.
    """
    raw = bytearray(file)
    if raw[:4] != b"MThd" or len(raw) < 14:
        raise ValueError("is no MIDI file: it does not begin with MThd")
    place, left = 8 + int.from_bytes(raw[4:8], "big"), most
    for _ in range(int.from_bytes(raw[10:12], "big")):
        kind, length = raw[place : place + 4], int.from_bytes(raw[place + 4 : place + 8], "big")
        place += 8
        if kind != b"MTrk" or place + length > len(raw):
            raise ValueError("is no MIDI file, or not a whole one: a track is missing, or ends too soon")
        left = _walk(raw, place, place + length, left)
        place += length
    return bytes(raw)


def _walk(raw: bytearray, place: int, end: int, left: int) -> int:
    """Goes through the messages of one track, and renames meta messages except tempo and end.

    Returns how many of the messages that are allowed are left.
    """
    running = 0
    while place < end:
        left -= 1
        if left < 0:
            raise ValueError("has too many messages")
        place = _number(raw, place, end)[1]
        if place >= end:
            raise ValueError("is no MIDI file, or not a whole one: a track ends within a message")
        status = raw[place]
        if status < 0x80:  # of the kind of the message before
            status = running
            if not 0x80 <= status < 0xF0:
                raise ValueError("is no MIDI file: it does not tell the kind of a message")
        else:
            place += 1
            running = status if status != META else running
        if status == META:  # a kind, a length, as many bytes
            kind = place
            length, place = _number(raw, kind + 1, end)
            if raw[kind] not in (TEMPO, END_OF_TRACK):
                raw[kind] = ANY
            place += length
        elif status in SYSTEM_EXCLUSIVE:
            length, place = _number(raw, place, end)
            place += length
        else:
            place += _DATA_BYTES.get(status) or _DATA_BYTES.get(status >> 4, 0)
    if place > end:
        raise ValueError("is no MIDI file, or not a whole one: a track ends within a message")
    return left


def _number(raw: bytearray, place: int, end: int) -> tuple[int, int]:
    """A number of variable length, and the place after it."""
    value = 0
    for here in range(place, min(place + LONGEST_NUMBER, end)):
        value = value << 7 | raw[here] & 0x7F
        if raw[here] < 0x80:
            return value, here + 1
    raise ValueError("is no MIDI file: a number in it has no end")
