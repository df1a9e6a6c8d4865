"""WAV files of an independent writer: orders of chunks, padding, sizes, formats; and what libsndfile never sees."""

from __future__ import annotations

import random
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import soundfile
from numpy.typing import NDArray

from app.audio import sound_file
from app.audio.impulse_file import ImpulseError, cut_words, read_impulse
from app.audio.note_file import NoteFileError, read_note
from app.audio.sound_file import UnreadableSound, open_sound

FORMATS: dict[str, tuple[int, int, Callable[[NDArray[np.float64]], bytes]]] = {  # tag, bytes a sample, and its writer
    "u8": (1, 1, lambda x: (np.round(x * 127) + 128).astype("u1").tobytes()),
    "i16": (1, 2, lambda x: np.round(x * 32767).astype("i2").tobytes()),
    "i24": (1, 3, lambda x: np.round(x * 8388607).astype("<i4").view("u1").reshape(-1, 4)[:, :3].tobytes()),
    "i32": (1, 4, lambda x: np.round(x * 2147483647).astype("i4").tobytes()),
    "f32": (3, 4, lambda x: x.astype("f4").tobytes()),
    "f64": (3, 8, lambda x: x.tobytes()),
}
TOLERANCES = {"u8": 0.013, "i16": 1e-4, "i24": 1e-6, "i32": 1e-8, "f32": 1e-7, "f64": 0.0}
ODD_FORMAT = struct.pack("<HHIIHH", 1, 1, 8_000, 0, 0, 40)
GUID = bytes.fromhex("000000001000800000aa00389b71")


def chunk(name: bytes, content: bytes, size: int | None = None, order: str = "<", padded: bool = True) -> bytes:
    odd = len(content) % 2 and padded
    return name + struct.pack(order + "I", len(content) if size is None else size) + content + b"\0" * odd


def swapped(data: bytes, width: int) -> bytes:
    return np.frombuffer(data, "u1").reshape(-1, width)[:, ::-1].tobytes()


def made_wav(draw: random.Random) -> tuple[bytes, NDArray[np.float64], int, str]:
    """A valid file, or one that is wrong in a way that tools write; its samples, rate and format."""
    kind = draw.choice(list(FORMATS))
    tag, width, write = FORMATS[kind]
    channels, rate_hz = draw.choice((1, 1, 2, 2, 3, 5, 8)), draw.choice((8_000, 22_050, 44_100, 48_000, 96_000))
    frames = draw.randrange(1, 400)
    samples = np.random.default_rng(draw.randrange(2**32)).uniform(-1, 1, (frames, channels))
    data = write(samples.ravel())
    form = draw.choice((b"RIFF", b"RIFF", b"RIFF", b"RIFX", b"RF64", b"BW64"))
    order = ">" if form == b"RIFX" else "<"
    if order == ">":
        data = swapped(data, width)
    padded = draw.random() < 0.6
    extensible = draw.random() < 0.3
    head = struct.pack(
        order + "HHIIHH",
        0xFFFE if extensible else tag, channels, rate_hz, rate_hz * channels * width, channels * width, 8 * width,
    )  # fmt: skip
    if extensible:
        head += struct.pack(order + "HHIH", 22, 8 * width, 0, tag) + GUID
    elif draw.random() < 0.3:
        head += struct.pack(order + "H", 0)
    others = [
        chunk(name, bytes(draw.randrange(256) for _ in range(draw.randrange(60))), None, order, padded)
        for name in draw.sample((b"JUNK", b"bext", b"ID3 ", b"id3 ", b"fact", b"PEAK", b"smpl", b"cue "), 3)
    ]
    text = chunk(b"ISFT", b"five5", None, order, padded)
    others.append(chunk(b"LIST", b"INFO" + text, None, order, padded))
    draw.shuffle(others)
    parts = [chunk(b"fmt ", head, None, order), *others[:2]]
    draw.shuffle(parts)
    size = len(data)
    how = draw.choice(("right", "right", "zero", "unknown", "beyond"))
    stated = {"right": size, "zero": 0, "unknown": 2**32 - 1, "beyond": size + 100_000}[how]
    if form in (b"RF64", b"BW64"):
        stated = 2**32 - 1
        long = draw.choice((size, 0)) if how == "zero" else size
        if long == 0:
            how = "zero"
        parts.insert(0, chunk(b"ds64", struct.pack("<QQQI", 0, long, frames, 0)))
    behind = others[2:] if how == "right" else []
    body = (
        b"WAVE" + b"".join(parts) + chunk(b"data", data, stated, order, padded and how == "right") + b"".join(behind)
    )
    riff = draw.choice((len(body), 0, 2**32 - 1))
    return form + struct.pack(order + "I", riff) + body, samples, rate_hz, kind


@pytest.mark.parametrize("seed", range(25))
def test_random_files(seed: int, tmp_path: Path) -> None:
    draw, path = random.Random(seed), tmp_path / "a.wav"
    for number in range(40):
        data, samples, rate_hz, kind = made_wav(draw)
        path.write_bytes(data)
        read = read_note(path)
        assert (read.rate_hz, read.samples.shape) == (rate_hz, samples.shape), (number, kind)
        np.testing.assert_allclose(read.samples, samples, rtol=0, atol=TOLERANCES[kind] + 1e-16, err_msg=str(number))


@pytest.mark.parametrize("name", [b"DISP", b"_PMX", b"umid", b"levl", b"LIST"])
@pytest.mark.parametrize("length", [1, 3, 17, 603])
@pytest.mark.parametrize("filled", [0, 33, 100])
def test_odd_chunks_without_padding_before_chunks_of_any_name(
    name: bytes, length: int, filled: int, tmp_path: Path
) -> None:
    """A name less its first letter, and a size of 100, look like a name too."""
    odd = chunk(b"strc", bytes([filled]) * length, padded=False)
    text = chunk(name, (b"INFO" if name == b"LIST" else b"") + bytes([filled]) * 100)
    samples = np.arange(-50, 50, dtype="<i2")
    head = chunk(b"fmt ", struct.pack("<HHIIHH", 1, 1, 8_000, 16_000, 2, 16))
    (tmp_path / "a.wav").write_bytes(chunk(b"RIFF", b"WAVE" + odd + text + head + chunk(b"data", samples.tobytes())))
    assert list(read_note(tmp_path / "a.wav").samples[:, 0] * 32768) == list(samples)


@pytest.mark.parametrize("rest", range(12))
def test_a_list_of_texts_that_is_cut_off_costs_no_samples(rest: int, tmp_path: Path) -> None:
    texts = b"INFO" + chunk(b"ISFT", b"five5") + (b"ICMT\x20\0\0\0" + b"abcd")[:rest]
    head = chunk(b"fmt ", struct.pack("<HHIIHH", 1, 1, 8_000, 16_000, 2, 16))
    data = chunk(b"data", struct.pack("<3h", 1, 2, 3))
    (tmp_path / "a.wav").write_bytes(chunk(b"RIFF", b"WAVE" + chunk(b"LIST", texts) + head + data))
    assert list(read_note(tmp_path / "a.wav").samples[:, 0] * 32768) == [1, 2, 3]


@pytest.mark.parametrize("subtype", ["ULAW", "ALAW", "IMA_ADPCM", "MS_ADPCM", "GSM610"])
def test_compressed_files_are_read_as_before(subtype: str, tmp_path: Path) -> None:
    sound = 0.5 * np.sin(np.arange(8_000) / 20)
    soundfile.write(tmp_path / "a.wav", sound, 8_000, subtype=subtype)
    whole = soundfile.read(tmp_path / "a.wav")[0]
    found = read_note(tmp_path / "a.wav").samples[:, 0]
    assert len(found) == len(whole)
    np.testing.assert_array_equal(found[:8_000], whole[:8_000])  # behind are remains of a block


@pytest.mark.parametrize(("subtype", "kind"), [("ULAW", 7), ("ALAW", 6)])
def test_a_compressed_body_with_an_extensible_header(subtype: str, kind: int, tmp_path: Path) -> None:
    sound = 0.9 * np.random.default_rng(0).uniform(-1, 1, 2_000) * np.geomspace(1, 1e-2, 2_000)
    soundfile.write(tmp_path / "a.raw", sound, 48_000, subtype=subtype, format="RAW")
    head = struct.pack("<HHIIHH", 0xFFFE, 1, 48_000, 48_000, 1, 8) + struct.pack("<HHIH", 22, 8, 0, kind) + GUID
    body = b"WAVE" + chunk(b"fmt ", head) + chunk(b"data", (tmp_path / "a.raw").read_bytes())
    (tmp_path / "a.wav").write_bytes(chunk(b"RIFF", body))
    whole = soundfile.read(tmp_path / "a.raw", channels=1, samplerate=48_000, subtype=subtype, format="RAW")[0]
    np.testing.assert_array_equal(read_impulse(tmp_path / "a.wav").samples[:, 0], whole)


@pytest.mark.parametrize("code", [0, 4])
def test_the_last_block_of_a_flac_stream_may_name_its_bits_another_way(code: int, tmp_path: Path) -> None:
    """Blocks may state 16 bits, or refer to the file's first block for them. A stream's last one was left out."""
    samples = np.arange(-90, 90, dtype=">i2")
    blocks = [flac_block(samples[:100], 0, 4 - code), flac_block(samples[100:], 1, code)]
    about = struct.pack(">HH", 100, 100) + bytes(6) + (44_100 << 44 | 15 << 36).to_bytes(8) + bytes(16)
    (tmp_path / "a.flac").write_bytes(b"fLaC\x80\0\0\x22" + about + b"".join(blocks))
    assert list(read_note(tmp_path / "a.flac").samples[:, 0] * 32_768) == list(samples)


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


def test_a_flac_stream_without_an_end_costs_no_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Empty blocks up to the end of the file: each was read, and the length was 2^63 frames."""
    about = struct.pack(">HH", 100, 100) + bytes(6) + (44_100 << 44 | 15 << 36).to_bytes(8) + bytes(16)
    (tmp_path / "a.flac").write_bytes(b"fLaC\0\0\0\x22" + about + bytes(400_000))
    reads = []
    plain = sound_file._bytes_at
    monkeypatch.setattr(sound_file, "_bytes_at", lambda *place: (reads.append(place), plain(*place))[1])
    with pytest.raises(NoteFileError, match="no samples, or is cut off"):
        read_note(tmp_path / "a.flac")
    assert len(reads) < 11_000


def test_zeros_behind_a_wav_are_no_chunks(tmp_path: Path) -> None:
    """As of a recorder that fills its blocks; the RIFF chunk ends before them."""
    head = chunk(b"fmt ", struct.pack("<HHIIHH", 1, 1, 8_000, 16_000, 2, 16))
    body = b"WAVE" + head + chunk(b"data", struct.pack("<3h", 1, 2, 3))
    (tmp_path / "a.wav").write_bytes(chunk(b"RIFF", body) + bytes(100_000))
    assert list(read_note(tmp_path / "a.wav").samples[:, 0] * 32768) == [1, 2, 3]


@pytest.mark.parametrize("bits", [4, 12, 20, 32])
def test_flac_of_other_bits_is_refused_in_words(bits: int, tmp_path: Path) -> None:
    about = struct.pack(">HH", 100, 100) + bytes(6) + (44_100 << 44 | bits - 1 << 36 | 100).to_bytes(8) + bytes(16)
    (tmp_path / "a.flac").write_bytes(b"fLaC\x80\0\0\x22" + about + bytes(100))
    with pytest.raises(NoteFileError, match=f"it is FLAC of {bits} bits, not of 8, 16 or 24"):
        read_note(tmp_path / "a.flac")


def test_a_sample_of_twelve_bits_lies_at_the_upper_end(tmp_path: Path) -> None:
    head = struct.pack("<HHIIHH", 1, 1, 8_000, 16_000, 2, 12)
    data = struct.pack("<3h", 16384, -16384, 16)
    body = b"WAVE" + chunk(b"fmt ", head) + chunk(b"data", data)
    (tmp_path / "a.wav").write_bytes(chunk(b"RIFF", body))
    assert list(read_note(tmp_path / "a.wav").samples[:, 0]) == [0.5, -0.5, 16 / 32768]


def test_no_samples_but_chunks_behind_are_no_stream(tmp_path: Path) -> None:
    head = struct.pack("<HHIIHH", 1, 1, 8_000, 16_000, 2, 16)
    body = b"WAVE" + chunk(b"fmt ", head) + chunk(b"data", b"") + chunk(b"LIST", b"INFO" + chunk(b"ISFT", b"five"))
    (tmp_path / "a.wav").write_bytes(chunk(b"RIFF", body))
    with pytest.raises(NoteFileError, match="holds no samples"):
        read_note(tmp_path / "a.wav")


def test_flac_behind_a_tag_of_mp3_players(tmp_path: Path) -> None:
    soundfile.write(tmp_path / "a.flac", np.linspace(-0.5, 0.5, 1_000), 44_100, "PCM_24")
    plain = (tmp_path / "a.flac").read_bytes()
    (tmp_path / "b.flac").write_bytes(b"ID3\4\0\0\0\0\1\1" + bytes(129) + plain)
    np.testing.assert_array_equal(read_note(tmp_path / "b.flac").samples, read_note(tmp_path / "a.flac").samples)


@pytest.mark.parametrize("frames", [1, 192, 4_096, 70_001, 600_000])
def test_a_flac_stream_that_states_no_length(frames: int, tmp_path: Path) -> None:
    path, samples = tmp_path / "a.flac", np.random.default_rng(0).uniform(-0.5, 0.5, (frames, 2))
    soundfile.write(path, samples, 44_100, "PCM_24")
    data = bytearray(path.read_bytes())
    data[21:26] = bytes([data[21] & 0xF0, 0, 0, 0, 0])
    path.write_bytes(data)
    np.testing.assert_allclose(read_note(path).samples, samples, atol=1e-6)
    for length in (30, 42, 46, 60, len(data) - 1, len(data) - 3):
        path.write_bytes(data[:length])
        try:
            assert len(read_note(path).samples) <= frames
        except NoteFileError as error:
            assert str(error).startswith(f"{path}: ") and len(str(error)) < 400


@pytest.mark.parametrize(
    "form", ["AU", "CAF", "W64", "VOC", "NIST", "MP3", "PAF", "SVX", "IRCAM", "MAT5", "SDS", "AVR"]
)
def test_other_kinds_are_named_and_not_opened(form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.wav"
    soundfile.write(path, np.zeros(8_000), 8_000, format=form)
    monkeypatch.setattr(soundfile, "SoundFile", lambda *_: pytest.fail("libsndfile was called"))
    with pytest.raises(NoteFileError, match="it is no WAV, FLAC, AIFF or Ogg file"):
        read_note(path)
    with pytest.raises(ImpulseError, match="it is no WAV, FLAC, AIFF or Ogg file"):
        read_impulse(path)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "it is empty"),
        (b"RIFF\0\0\0\0AVI ", "it is no WAV"),
        (b"RIFF\0\0\0\0RMID" + chunk(b"data", b"MThd"), "it is no WAV"),
        (b"RIFF\0\0\0\0WAVE", "no format"),
        (b"RIFF\0\0\0\0WAVE" + chunk(b"fmt ", b"\1\0"), "no samples|cut off"),
        (b"RIFF\0\0\0\0WAVE" + chunk(b"fmt ", bytes(16)) + chunk(b"data", b"1234"), "0 channels"),
        (b"RIFF\0\0\0\0WAVE" + chunk(b"JUNK", b"") * 20_000, "chunks"),
        (
            b"RIFF\0\0\0\0WAVE" + chunk(b"fmt ", b"\x61\1\2\0" + bytes([64, 31]) * 6) + chunk(b"data", b"12"),
            "kind 0x161",
        ),
        (b"OggS\0\2" + bytes(20) + b"\1\x33\x7fFLAC\1\0\0\2fLaC", "it is FLAC within Ogg"),
        (b"RIFF\0\0\0\0WAVE" + chunk(b"fmt ", ODD_FORMAT) + chunk(b"data", b"12"), "40 bits"),
    ],
)
def test_damaged_files_have_one_clear_error(data: bytes, words: str, tmp_path: Path) -> None:
    path = tmp_path / "a.wav"
    path.write_bytes(data)
    with pytest.raises(UnreadableSound, match=words), open_sound(path):
        pass
    with pytest.raises(NoteFileError, match=words) as caught:
        read_note(path)
    assert str(caught.value).startswith(f"{path}: no sound file") and str(caught.value).isprintable()


@pytest.mark.parametrize("seed", range(5))
def test_damage_of_any_kind(seed: int, tmp_path: Path) -> None:
    draw, path = random.Random(seed), tmp_path / "a.wav"
    for _ in range(100):
        data = bytearray(made_wav(draw)[0])
        for _ in range(draw.randrange(1, 8)):
            data[draw.randrange(len(data))] = draw.choice((0, 1, 127, 255, draw.randrange(256)))
        path.write_bytes(data[: draw.choice((len(data), draw.randrange(len(data))))])
        try:
            assert len(read_note(path).samples)
        except NoteFileError as error:
            assert str(error).startswith(f"{path}: ") and str(error).isprintable() and len(str(error)) < 400


@pytest.mark.parametrize("silent_s", [0.05, 0.5, 5.0])
def test_silence_before_a_body_is_left_out(silent_s: float, tmp_path: Path) -> None:
    path, rate_hz = tmp_path / "late.wav", 48_000
    response = np.random.default_rng(0).uniform(-0.5, 0.5, (4_800, 2)) * np.geomspace(1, 1e-3, 4_800)[:, None]
    response[0] = 0.5
    silence = np.random.default_rng(1).uniform(-1e-3, 1e-3, (round(silent_s * rate_hz), 2))
    soundfile.write(path, np.concatenate([silence, response]), rate_hz, "FLOAT")
    found = read_impulse(path).samples
    assert len(found) == 4_800 + 48
    np.testing.assert_allclose(found[48:], response, atol=1e-7)
    assert cut_words(path) == f"late.wav is the body without {1000 * silent_s - 1:.0f} ms of silence before it."
    soundfile.write(path, response, rate_hz, "FLOAT")
    assert len(read_impulse(path).samples) == 4_800 and cut_words(path) == ""
