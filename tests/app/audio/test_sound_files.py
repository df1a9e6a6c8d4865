"""Sound files as notes and bodies: valid ones of an independent writer, odd ones, and one line for refused ones."""

import os
import random
import struct
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
import soundfile
from numpy.typing import NDArray

from app.audio.impulse_file import ImpulseError, cut_words, read_impulse
from app.audio.note_file import NoteFileError, read_note
from engine import bounds

Writer = Callable[[NDArray[np.float64]], bytes]
FORMATS: dict[str, tuple[int, int, float, Writer]] = {  # tag, bytes, tolerance
    "u8": (1, 1, 0.013, lambda x: (np.round(x * 127) + 128).astype("u1").tobytes()),
    "i16": (1, 2, 1e-4, lambda x: np.round(x * 32767).astype("i2").tobytes()),
    "i24": (1, 3, 1e-6, lambda x: np.round(x * 8388607).astype("<i4").view("u1").reshape(-1, 4)[:, :3].tobytes()),
    "i32": (1, 4, 1e-8, lambda x: np.round(x * 2147483647).astype("i4").tobytes()),
    "f32": (3, 4, 1e-7, lambda x: x.astype("f4").tobytes()),
    "f64": (3, 8, 1e-16, lambda x: x.tobytes()),
}
GUID = bytes.fromhex("000000001000800000aa00389b71")
DECAYING = 0.5 * np.random.default_rng(0).uniform(-1, 1, (3000, 2)) * np.geomspace(1, 1e-3, 3000)[:, None]


def chunk(name: bytes, content: bytes, size: int | None = None, order: str = "<", padded: bool = True) -> bytes:
    odd = len(content) % 2 and padded
    return name + struct.pack(order + "I", len(content) if size is None else size) + content + b"\0" * odd


def format_of(bits: int = 16, tag: int = 1, rate_hz: int = 8_000) -> bytes:
    width = (bits + 7) // 8
    return chunk(b"fmt ", struct.pack("<HHIIHH", tag, 1, rate_hz, rate_hz * width, width, bits))


def riff(*chunks: bytes) -> bytes:
    return chunk(b"RIFF", b"WAVE" + b"".join(chunks))


DATA = chunk(b"data", struct.pack("<3h", 1, 2, 3))
TEXTS = b"INFO" + chunk(b"ISFT", b"five5")


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "a.wav"


def samples_of(path: Path, data: bytes) -> list[float]:
    """Of the first channel, in steps of 16 bits."""
    path.write_bytes(data)
    return list(read_note(path).samples[:, 0] * 32_768)


# Valid files


def made_wav(draw: random.Random) -> tuple[bytes, NDArray[np.float64], int, str]:
    """A valid file, or one that is wrong in a way that tools write; its samples, rate and format."""
    kind = draw.choice(list(FORMATS))
    tag, width, _, write = FORMATS[kind]
    channels, rate_hz = draw.choice((1, 1, 2, 2, 3, 5, 8)), draw.choice((8_000, 22_050, 44_100, 48_000, 96_000))
    frames = draw.randrange(1, 400)
    samples = np.random.default_rng(draw.randrange(2**32)).uniform(-1, 1, (frames, channels))
    data = write(samples.ravel())
    form = draw.choice((b"RIFF", b"RIFF", b"RIFF", b"RIFX", b"RF64", b"BW64"))
    order = ">" if form == b"RIFX" else "<"
    if order == ">":
        data = np.frombuffer(data, "u1").reshape(-1, width)[:, ::-1].tobytes()
    padded, extensible = draw.random() < 0.6, draw.random() < 0.3
    sizes = (channels, rate_hz, rate_hz * channels * width, channels * width, 8 * width)
    head = struct.pack(order + "HHIIHH", 0xFFFE if extensible else tag, *sizes)
    if extensible:
        head += struct.pack(order + "HHIH", 22, 8 * width, 0, tag) + GUID
    elif draw.random() < 0.3:
        head += struct.pack(order + "H", 0)
    names = draw.sample((b"JUNK", b"bext", b"ID3 ", b"id3 ", b"fact", b"PEAK", b"smpl", b"cue "), 3)
    others = [chunk(name, draw.randbytes(draw.randrange(60)), None, order, padded) for name in names]
    others.append(chunk(b"LIST", b"INFO" + chunk(b"ISFT", b"five5", None, order, padded), None, order, padded))
    draw.shuffle(others)
    parts = [chunk(b"fmt ", head, None, order), *others[:2]]
    draw.shuffle(parts)
    how, size = draw.choice(("right", "right", "zero", "unknown", "beyond")), len(data)
    stated = {"right": size, "zero": 0, "unknown": 2**32 - 1, "beyond": size + 100_000}[how]
    if form in (b"RF64", b"BW64"):
        stated, long = 2**32 - 1, draw.choice((size, 0)) if how == "zero" else size
        how = "zero" if long == 0 else how
        parts.insert(0, chunk(b"ds64", struct.pack("<QQQI", 0, long, frames, 0)))
    behind = others[2:] if how == "right" else []
    body = b"".join([b"WAVE", *parts, chunk(b"data", data, stated, order, padded and how == "right"), *behind])
    return form + struct.pack(order + "I", draw.choice((len(body), 0, 2**32 - 1))) + body, samples, rate_hz, kind


@pytest.mark.parametrize("seed", range(10))
def test_random_files_are_read_as_they_were_meant(seed, path):
    draw = random.Random(seed)
    for number in range(60):
        data, samples, rate_hz, kind = made_wav(draw)
        path.write_bytes(data)
        read = read_note(path)
        assert (read.rate_hz, read.samples.shape) == (rate_hz, samples.shape), (number, kind)
        np.testing.assert_allclose(read.samples, samples, rtol=0, atol=FORMATS[kind][2], err_msg=str(number))


WAV_FORMS = ("PCM_U8", "PCM_16", "PCM_24", "PCM_32", "FLOAT", "DOUBLE", "ULAW", "ALAW", "IMA_ADPCM", "MS_ADPCM")
OTHERS = ("flac PCM_24", "flac PCM_16", "aiff PCM_24", "aiff FLOAT")


@pytest.mark.parametrize("channels", [1, 2])
@pytest.mark.parametrize("name", [*(f"wav {form}" for form in WAV_FORMS), *OTHERS])
def test_what_libsndfile_writes_is_read_as_note_and_as_body(tmp_path, name, channels):
    ending, subtype = name.split()
    path = tmp_path / f"a.{ending}"
    soundfile.write(path, DECAYING[:, :channels], 44_100, subtype)
    whole = soundfile.read(path, always_2d=True)[0]
    for read in (read_note(path), read_impulse(path)):
        assert read.rate_hz == 44_100 and len(read.samples) == len(whole)
        np.testing.assert_allclose(read.samples[:3_000], whole[:3_000], atol=2e-7)  # behind are remains of a block


def test_odd_files_cost_no_samples(path):
    """Lists that are cut off, zeros of a recorder that fills its blocks, bits that fill no bytes."""
    cut_off = chunk(b"LIST", TEXTS + (b"ICMT\x20\0\0\0abcd")[:6])
    assert samples_of(path, riff(cut_off, format_of(), DATA)) == [1, 2, 3]
    assert samples_of(path, riff(format_of(), DATA) + bytes(100_000)) == [1, 2, 3]
    loud = chunk(b"data", struct.pack("<3h", 16384, -16384, 16))
    assert samples_of(path, riff(format_of(12), loud)) == [16384, -16384, 16]
    written(32_767 * SINE)(path)  # floating point that was meant for 16 bits
    read = read_note(path)
    assert np.abs(read.samples).max() == pytest.approx(32_767, rel=1e-3)
    assert read.digest == sha256(path.read_bytes()).hexdigest()


# FLAC


def about(bits: int = 16, frames: int = 0) -> bytes:
    """The description of a stream of one channel."""
    return struct.pack(">HH", 100, 100) + bytes(6) + (44_100 << 44 | bits - 1 << 36 | frames).to_bytes(8) + bytes(16)


def flac_block(samples: NDArray[np.int16], number: int, code: int) -> bytes:
    """A block of one channel as it is, after RFC 9639."""
    head = bytes([0xFF, 0xF8, 0x60, code << 1, number, len(samples) - 1])
    block = head + bytes([remainder(head, 0x07, 8)]) + b"\2" + samples.tobytes()
    return block + remainder(block, 0x8005, 16).to_bytes(2)


def remainder(data: bytes, polynomial: int, bits: int) -> int:
    found = int.from_bytes(data) << bits
    for place in range(8 * len(data) + bits - 1, bits - 1, -1):
        if found >> place & 1:
            found ^= (polynomial | 1 << bits) << (place - bits)
    return found


@pytest.mark.parametrize("code", [0, 4])
def test_the_last_block_of_a_flac_stream_may_name_its_bits_another_way(code, path):
    """Blocks may state 16 bits, or refer to the file's first block for them."""
    samples = np.arange(-90, 90, dtype=">i2")
    blocks = flac_block(samples[:100], 0, 4 - code) + flac_block(samples[100:], 1, code)
    assert samples_of(path, b"fLaC\x80\0\0\x22" + about() + blocks) == list(samples)


@pytest.mark.parametrize("frames", [1, 192, 4_096, 600_000])
def test_a_flac_stream_that_states_no_length_or_is_cut_off(frames, path):
    """Also behind a tag of MP3 players."""
    samples = np.random.default_rng(0).uniform(-0.5, 0.5, (frames, 2))
    soundfile.write(path, samples, 44_100, "PCM_24", format="FLAC")
    data = bytearray(path.read_bytes())
    data[21:26] = bytes([data[21] & 0xF0, 0, 0, 0, 0])
    for before in (b"", b"ID3\4\0\0\0\0\1\1" + bytes(129)):
        path.write_bytes(before + data)
        np.testing.assert_allclose(read_note(path).samples, samples, atol=1e-6)
    for length in (30, 42, 46, 60, len(data) - 1, len(data) - 3):
        path.write_bytes(data[:length])
        readable_or_named(path, frames)


def readable_or_named(path: Path, most_frames: int = 10**9) -> None:
    try:
        assert 0 < len(read_note(path).samples) <= most_frames
    except NoteFileError as error:
        assert str(error).startswith(f"{path}: ") and str(error).isprintable() and len(str(error)) < 400


@pytest.mark.parametrize("seed", range(5))
def test_damage_of_any_kind_is_read_or_named(seed, path):
    draw = random.Random(seed)
    for _ in range(100):
        data = bytearray(made_wav(draw)[0])
        for _ in range(draw.randrange(1, 8)):
            data[draw.randrange(len(data))] = draw.choice((0, 1, 127, 255, draw.randrange(256)))
        path.write_bytes(data[: draw.choice((len(data), draw.randrange(len(data))))])
        readable_or_named(path)


# Bodies


@pytest.mark.parametrize("seconds", [3.0, 3.0 + 1 / 48_000, 6.97])
def test_of_a_long_response_the_beginning_is_used_and_fades_out(path, seconds):
    frames, most = round(48_000 * seconds), 3 * 48_000
    samples = np.random.default_rng(0).uniform(-0.5, 0.5, (frames, 2))
    soundfile.write(path, samples, 48_000, "FLOAT")
    found = read_impulse(path).samples
    whole = most if frames == most else round(2.7 * 48_000)
    assert len(found) == most
    np.testing.assert_allclose(found[:whole], samples[:whole], atol=1e-7)
    assert frames == most or np.abs(found[-100:]).max() < 1e-4, "no click at its end"
    words = f"a.wav lasts {seconds:.2f} s: its first 3 s, faded out, are the body."
    assert cut_words(path) == ("" if frames == most else words)


@pytest.mark.parametrize("silent_s", [0.0, 0.05, 5.0])
def test_silence_before_a_body_is_left_out(silent_s, path):
    response = DECAYING.copy()
    response[0] = 0.5
    silence = np.random.default_rng(1).uniform(-1e-3, 1e-3, (round(silent_s * 48_000), 2))
    soundfile.write(path, np.concatenate([silence, response]), 48_000, "FLOAT")
    found, kept = read_impulse(path).samples, 48 if silent_s else 0
    assert len(found) == len(response) + kept
    np.testing.assert_allclose(found[kept:], response, atol=1e-7)
    cut_ms = f"a.wav is the body without {1000 * silent_s - 1:.0f} ms of silence before it."
    assert cut_words(path) == (cut_ms if silent_s else "")


# What is refused


def written(samples: NDArray[np.floating], rate_hz: int = 48_000, **form: str) -> Callable[[Path], object]:
    return lambda path: soundfile.write(path, samples, rate_hz, **{"subtype": "FLOAT", **form})


def raw(data: bytes, size: int | None = None) -> Callable[[Path], object]:
    """Of a size, which takes no place on the disk."""
    return lambda path: (path.write_bytes(data), size and os.truncate(path, size))


SINE = np.sin(np.arange(8_000) / 20)
NOT_FINITE = np.where(np.arange(6_000).reshape(-1, 2) == 200, np.nan, DECAYING)
UNREADABLE = [
    (raw(b""), "it is empty"),
    (raw(b"no sound at all"), "it is no WAV"),
    (raw(b"RIFF\0\0\0\0AVI "), "it is no WAV"),
    (raw(b"RIFF\0\0\0\0RMID" + chunk(b"data", b"MThd")), "it is no WAV"),
    (raw(b"RIFF\0\0\0\0WAVE"), "no format"),
    (raw(riff(chunk(b"fmt ", b"\1\0"))), "no samples|cut off"),
    (raw(riff(chunk(b"fmt ", bytes(16)), chunk(b"data", b"1234"))), "0 channels"),
    (raw(riff(chunk(b"JUNK", b"") * 20_000)), "chunks"),
    (raw(riff(format_of(tag=0x161), DATA)), "kind 0x161"),
    (raw(riff(format_of(40), DATA)), "40 bits"),
    (raw(b"OggS\0\2" + bytes(20) + b"\1\x33\x7fFLAC\1\0\0\2fLaC"), "it is FLAC within Ogg"),
    (raw(b"fLaC\x80\0\0\x22" + about(4, 100) + bytes(100)), "it is FLAC of 4 bits, not of 8,"),
    (raw(b"fLaC\x80\0\0\x22" + about(32, 100) + bytes(100)), "it is FLAC of 32 bits, not of 8,"),
    (raw(b"fLaC\0\0\0\x22" + about() + bytes(400_000)), "no samples, or is cut off"),  # empty blocks to its end
    *(
        (written(SINE, 8_000, format=form, subtype=None), "it is no WAV, FLAC")
        for form in ("AU", "CAF", "W64", "MP3")
    ),
]
UNUSABLE = [  # as a note, as a body
    (lambda path: None, "no file", "no file"),
    (Path.mkdir, "a folder or a device, no file", "no file"),
    (raw(b"", bounds.LARGEST_IMPULSE_BYTES + 1), "", "64 MiB"),
    (written(np.tile(DECAYING, (500, 1))), "", r"its length must lie in 0 … 30 s, not 31\.25\).*of up to 30 s"),
    (written(DECAYING[:, :1].repeat(3, 1)), "", "its channels"),
    (written(np.zeros((50, 33)), 8_000), "has 33 channels; export one or two", ""),
    (written(DECAYING, 4_000), "", "its rate"),
    (written(0 * DECAYING), "", "silent"),
    (raw(riff(format_of(), chunk(b"data", b""), chunk(b"LIST", TEXTS))), "holds no samples", "silent"),
    (written(NOT_FINITE), "", "no numbers"),
    (written(DECAYING, format="OGG", subtype="VORBIS"), "", "save it as WAV"),
    (written(np.zeros(600 * 8_000), 8_000, subtype="PCM_U8"), "lasts 600 s; cut out one note", ""),
    (written(2.0**31 * SINE), r"a\.wav: its largest sample is 2.15e\+09 times full scale; normalise it", ""),
    (written(2.0**31 * SINE, format="AIFF"), "its largest sample is 2.15e", ""),
]


@pytest.mark.parametrize(
    ("make", "as_note", "as_body"), [*((make, words, words) for make, words in UNREADABLE), *UNUSABLE]
)
def test_what_cannot_be_used_is_named(path, make, as_note, as_body):
    make(path)
    for read, error, reported in ((read_note, NoteFileError, as_note), (read_impulse, ImpulseError, as_body)):
        if reported:
            with pytest.raises(error, match=reported) as caught:
                read(path)
            assert str(caught.value).startswith(f"{path}: ") and str(caught.value).isprintable()
            assert len(str(caught.value)) < 400


def test_many_channels_are_refused_before_they_fill_memory(tmp_path, monkeypatch):
    """A minute of silence of eight channels at 384 kHz is a small FLAC, and 1.5 GB of samples."""
    with soundfile.SoundFile(tmp_path / "a.flac", "w", 384_000, 8, "PCM_16") as file:
        for _ in range(6):
            file.write(np.zeros((384_000 * 3, 8), np.int16))
    monkeypatch.setattr(soundfile.SoundFile, "read", lambda *_, **__: pytest.fail("it was read"))
    with pytest.raises(NoteFileError, match="has 8 channels of 384000 Hz for 18 s, which is too much; export one or"):
        read_note(tmp_path / "a.flac")
