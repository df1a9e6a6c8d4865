"""The reader of all sound files: WAV, FLAC, AIFF and Ogg, known by their first bytes; libsndfile sees no others.

Of a WAV file libsndfile is given a header of our own, and the samples where its chunks say they are. So files are
read whose sizes were never written (streams), whose odd chunks lack their padding byte, in any order of chunks.
A FLAC stream, which states no length, is given the counted one.
Sources: Microsoft, "Multimedia Programming Interface and Data Specifications 1.0"; EBU Tech 3306 (RF64);
RFC 9639 (FLAC).
"""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

import soundfile

KINDS = "WAV, FLAC, AIFF or Ogg"
_PCM = 1
_FLOAT = 3
_EXTENSIBLE = 0xFFFE
_COMPRESSED = (2, 6, 7, 0x11, 0x31, 0x38, 0x40, 0x55)  # ADPCM, A-law, µ-law, GSM and MP3, which libsndfile reads
_MOST_CHUNKS = 10_000
_KEPT, _LARGEST_TEXT = (b"fmt ", b"fact"), 2**16  # chunks that are kept besides a list of texts; bytes of each
_LARGEST_DATA = 2**32 - 2**20  # bytes that a header can state
_UNKNOWN = 2**32 - 2**12  # sizes from here on are those of streams
_FLAC_HEAD = 42  # bytes up to the end of its first block, which states its length
_FLAC_FRAMES = 2**36 - 1
_LARGEST_FLAC_BLOCK = 2**22  # bytes
_FLAC_BITS = (8, 16, 24)  # that libsndfile reads
_KNOWN = frozenset(
    b"fmt |data|LIST|fact|bext|JUNK|junk|FLLR|PAD |ds64|id3 |ID3 |cue |smpl|inst|iXML|axml|chna|PEAK|acid".split(b"|")
)


class UnreadableSound(Exception):
    """A file that is no sound file, or a damaged one. The message is the reason, to be put in brackets."""


@contextmanager
def open_sound(path: Path, largest_bytes: int | None = None) -> Iterator[soundfile.SoundFile]:
    """The sound in a file, to be read within the context.

    Raises:
        UnreadableSound: it cannot be opened, is of another kind or larger than `largest_bytes`, or reading it fails.
    """
    try:
        if not path.is_file():  # opening a pipe would block
            raise UnreadableSound(
                "a folder or a device, no file" if path.exists() else "there is no file of this name"
            )
        with path.open("rb") as file:
            size = file.seek(0, io.SEEK_END)
            if largest_bytes is not None and size > largest_bytes:
                raise UnreadableSound(f"larger than the {largest_bytes // 2**20} MiB that it may have")
            with soundfile.SoundFile(_splice(file, size)) as sound:
                yield sound
    except soundfile.SoundFileError as error:
        raise UnreadableSound(str(error).rpartition(":")[2].strip(" .")) from error
    except OSError as error:
        raise UnreadableSound(error.strerror or str(error)) from error


class _Spliced:
    """A file for libsndfile: bytes of our own (`head`), then `length` bytes of another file, from `start` on."""

    def __init__(self, head: bytes, file: BinaryIO, start: int, length: int) -> None:
        self._head = head
        self._file = file
        self._start = start
        self._length, self._at = len(head) + length, 0  # bytes in all, and where the next are read

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        base = {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self._length}[whence]
        self._at = max(0, base + offset)
        return self._at

    def tell(self) -> int:
        return self._at

    def read(self, count: int) -> bytes:
        head_part = self._head[self._at : self._at + count]
        left = min(count, self._length - self._at) - len(head_part)
        data = head_part + _bytes_at(self._file, self._start + max(0, self._at - len(self._head)), max(0, left))
        self._at += len(data)
        return data


def _splice(file: BinaryIO, end: int) -> _Spliced:
    """The file as libsndfile is to read it; `end`: its size in bytes.

    Raises:
        UnreadableSound: it is of another kind, or damaged.
    """
    start = 0  # of the sound file, behind tags
    head = _bytes_at(file, 0, 12)
    if head[:3] == b"ID3" and len(head) >= 10:  # tags that players of MP3 put before any file
        start = 10 + sum((byte & 127) << shift for byte, shift in zip(head[6:10], (21, 14, 7, 0), strict=True))
        head = _bytes_at(file, start, 12)
    kind, form = head[:4], head[8:12]
    if kind in (b"RIFF", b"RIFX", b"RF64", b"BW64") and form == b"WAVE":
        return _Spliced(*_wave_parts(file, start, end))
    if kind == b"fLaC":
        head = _bytes_at(file, start, _FLAC_HEAD)
        bits = (int.from_bytes(head[20:22]) >> 4) % 32 + 1
        if len(head) == _FLAC_HEAD and bits not in _FLAC_BITS:
            raise UnreadableSound(f"it is FLAC of {bits} bits, not of 8, 16 or 24")
        if not int.from_bytes(head[21:26]) & _FLAC_FRAMES:  # it states no length, as where it was written to a pipe
            return _Spliced(
                _with_frame_count(head, file, start, end), file, start + len(head), end - start - len(head)
            )
    if kind == b"OggS" and _bytes_at(file, start + 28, 5) == b"\x7fFLAC":
        raise UnreadableSound("it is FLAC within Ogg")
    if kind in (b"fLaC", b"OggS") or (kind == b"FORM" and form in (b"AIFF", b"AIFC")):
        return _Spliced(b"", file, start, end - start)
    raise UnreadableSound(f"it is no {KINDS} file" if end else "it is empty")


def _with_frame_count(head: bytes, file: BinaryIO, start: int, end: int) -> bytes:
    """The beginning of a FLAC file that states no length, with the number of frames that it has."""
    at = start + 4
    for _ in range(_MOST_CHUNKS):  # what stands before the sound
        block = _bytes_at(file, at, 4)
        at += 4 + int.from_bytes(block[1:])
        if not block or block[0] >= 128:
            break
    block_head = _bytes_at(file, at, 4)
    tail_at = max(at, end - _LARGEST_FLAC_BLOCK)
    tail = _bytes_at(file, tail_at, max(0, end - tail_at)) + bytes(16)
    block_at, length = len(tail) - 16, 0
    for _ in range(_MOST_CHUNKS):
        block_at = tail.rfind(block_head[:2], 0, max(block_at, 0)) if len(block_head) == 4 else -1
        if block_at < 0 or length:
            break
        if all(_codes_agree(tail[block_at + byte] & 15, block_head[byte] & 15) for byte in (2, 3)):  # rate and bits
            length = _end_of_flac_block(tail[block_at : block_at + 16], int.from_bytes(head[8:10]))
    if length == 0:
        raise UnreadableSound("it has no samples, or is cut off")
    return head[:21] + (int.from_bytes(head[21:26]) | min(length, _FLAC_FRAMES)).to_bytes(5) + head[26:]


def _codes_agree(one: int, other: int) -> bool:
    """Return True if two codes of rates or bits may mean the same; 0 is what the file's first block states."""
    return one == other or not (one and other)


def _end_of_flac_block(data: bytes, block_frames: int) -> int:
    """The number of frames from the file's beginning to the end of a FLAC block; 0: there is no block.

    Args:
        data: the bytes from the block's header on, 16 of them.
        block_frames: frames of each block, where all have as many.
    """
    more = 8 - (~data[4] & 255).bit_length()  # bytes of its number, written as those of UTF-8
    number = data[4] & (127 >> more)
    for byte in data[5 : 4 + max(more, 1)]:
        number = (number << 6) | (byte & 63)
    at, code = 4 + max(more, 1), data[2] >> 4
    field_bytes = {6: 1, 7: 2}.get(code, 0)
    if field_bytes:
        frames = int.from_bytes(data[at : at + field_bytes]) + 1
    else:
        frames = 192 if code <= 1 else 576 << (code - 2) if code < 6 else 256 << (code - 8)
    at += field_bytes + {12: 1, 13: 2, 14: 2}.get(data[2] & 15, 0)
    check = 0
    for byte in data[:at]:
        check ^= byte
        for _ in range(8):
            check = ((check << 1) ^ (7 if check & 128 else 0)) & 255
    if code == 0 or at >= len(data) or check != data[at]:
        return 0
    return (number if data[1] & 1 else number * block_frames) + frames


def _wave_parts(file: BinaryIO, start: int, end: int) -> tuple[bytes, BinaryIO, int, int]:
    """A header of our own for a WAV file, the file, and place and length of its samples in bytes.

    `start` and `end`: of the WAV file within `file`, in bytes.
    """
    byte_order = ">" if _bytes_at(file, start, 4) == b"RIFX" else "<"
    chunks: dict[bytes, bytes] = {}
    samples, ds64_length = (0, 0), 0  # place and length; the length that ds64 states
    at = start + 12
    for _ in range(_MOST_CHUNKS):
        header = _bytes_at(file, at, 8)
        if len(header) < 8:
            break
        name, size = struct.unpack(byte_order + "4sI", header)
        if samples[1] > 0 and not _is_name(name):  # behind the file's end, as zeros up to a block of a disk
            break
        at += 8
        if name == b"data":
            if size >= _UNKNOWN and ds64_length > 0:
                size = ds64_length
            if at + size > end or (size == 0 and not _chunks_follow(file, at, end, byte_order)):
                size = end - at
            if samples[1] == 0:
                samples = at, size
        elif name == b"ds64" and size >= 16:
            ds64_length = struct.unpack(byte_order + "Q", _bytes_at(file, at + 8, 8).ljust(8, b"\0"))[0]
        elif size <= _LARGEST_TEXT and (name in _KEPT or (name == b"LIST" and _bytes_at(file, at, 4) == b"INFO")):
            chunks.setdefault(name, _bytes_at(file, at, size))
        at = _next_chunk(file, at + size, size, byte_order)
    else:
        raise UnreadableSound(f"it has more than {_MOST_CHUNKS} chunks")
    if b"fmt " not in chunks or samples[0] == 0:
        raise UnreadableSound("it has no format" if b"fmt " not in chunks else "it has no samples")
    if b"LIST" in chunks:
        chunks[b"LIST"] = _whole_texts(chunks[b"LIST"], byte_order)
    chunks[b"fmt "], frame_bytes, compressed = _plain_format(chunks[b"fmt "], byte_order)
    length = min(samples[1], _LARGEST_DATA) // frame_bytes * frame_bytes
    body = b"".join(
        struct.pack(byte_order + "4sI", name, len(chunks[name])) + chunks[name] + b"\0" * (len(chunks[name]) % 2)
        for name in (b"fmt ", b"fact", b"LIST")
        if name in chunks and (compressed or name != b"fact")
    )
    kind = b"RIFX" if byte_order == ">" else b"RIFF"
    head = struct.pack(byte_order + "4sI4s", kind, 12 + len(body) + length, b"WAVE") + body
    return head + struct.pack(byte_order + "4sI", b"data", length), file, samples[0], length


def _plain_format(chunk: bytes, byte_order: str) -> tuple[bytes, int, bool]:
    """A format chunk as libsndfile reads it, how many bytes a frame has, and whether it is compressed."""
    if len(chunk) < 16:
        raise UnreadableSound("its format is cut off")
    kind, channels, rate_hz, _, frame_bytes, bits = struct.unpack(byte_order + "HHIIHH", chunk[:16])
    if kind == _EXTENSIBLE and len(chunk) >= 26:
        kind = struct.unpack(byte_order + "H", chunk[24:26])[0]
    if channels == 0 or rate_hz == 0:
        raise UnreadableSound(f"its format states {channels} channels at {rate_hz} Hz")
    if kind in _COMPRESSED:
        return struct.pack(byte_order + "H", kind) + chunk[2:], max(frame_bytes, 1), True
    if kind not in (_PCM, _FLOAT):
        raise UnreadableSound(f"its samples are compressed as kind {kind:#x}")
    sample_bytes = -(-bits // 8)
    if kind == _PCM and frame_bytes % channels == 0 and sample_bytes <= frame_bytes // channels <= 4:
        sample_bytes = frame_bytes // channels  # fewer bits lie at the upper end of such a sample
    if sample_bytes not in ((1, 2, 3, 4) if kind == _PCM else (4, 8)):
        raise UnreadableSound(f"its samples have {bits} bits")
    frame_bytes = channels * sample_bytes
    rest = (kind, channels, rate_hz, rate_hz * frame_bytes % 2**32, frame_bytes % 2**16, 8 * sample_bytes)
    return struct.pack(byte_order + "HHIIHH", *rest), frame_bytes, False


def _whole_texts(chunk: bytes, byte_order: str) -> bytes:
    """A list of texts up to the first that is cut off. From that one libsndfile would read on into the samples."""
    end = 4  # of "INFO"
    while len(chunk) >= end + 8:
        size = struct.unpack(byte_order + "I", chunk[end + 4 : end + 8])[0]
        if end + 8 + size > len(chunk):
            break
        end = min(end + 8 + size + size % 2, len(chunk))
    return chunk[:end]


def _next_chunk(file: BinaryIO, after: int, size: int, byte_order: str) -> int:
    """The place of the chunk behind one that ends at `after`. An odd one should have a padding byte, and may not."""
    places = (after + size % 2, after + 1 - size % 2)
    likely = [_chunk_likelihood(file, place, byte_order) for place in places]
    return places[1] if likely[1] > likely[0] else places[0]


def _chunk_likelihood(file: BinaryIO, place: int, byte_order: str) -> int:
    """The likelihood, 0 … 4, that a chunk begins at a place.

    It is 0 without a name, 4 with a known one, else by its size and what follows.
    """
    header = _bytes_at(file, place, 8)
    if len(header) < 8 or not _is_name(header[:4]):
        return 0
    if header[:4] in _KNOWN:
        return 4
    end = file.seek(0, io.SEEK_END)
    after = place + 8 + struct.unpack(byte_order + "I", header[4:])[0]
    if after > end:
        return 1
    return 3 if after == end or any(_is_name(_bytes_at(file, after + odd, 4)) for odd in (0, 1)) else 2


def _is_name(name: bytes) -> bool:
    return len(name) == 4 and all(0x20 <= byte < 0x7F for byte in name)


def _chunks_follow(file: BinaryIO, at: int, end: int, byte_order: str) -> bool:
    """Return True if the rest of a file is chunks, so that there are no samples."""
    for _ in range(_MOST_CHUNKS):
        header = _bytes_at(file, at, 8)
        if len(header) < 8 or not _is_name(header[:4]):
            break
        size = struct.unpack(byte_order + "I", header[4:])[0]
        at = _next_chunk(file, at + 8 + size, size, byte_order)
    return at in (end, end + 1)  # the last padding byte may be missing


def _bytes_at(file: BinaryIO, place: int, count: int) -> bytes:
    file.seek(place)
    return file.read(count)
