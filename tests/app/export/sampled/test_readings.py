"""Files for samplers as others read them: sfzlint, and the tables of a SoundFont by its specification."""

from __future__ import annotations

import io
import re
import struct
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import soundfile

from app.export.sampled.job import export_sampled, plain_stem, planned, sample_folder
from app.export.sampled.sf2 import ZEROS_BEHIND
from tests.app.export.sampled.conftest import RATE_HZ, STEREO, instrument_of, render, small

ROWS = {"phdr": 38, "pbag": 4, "pmod": 10, "pgen": 4, "inst": 22, "ibag": 4, "imod": 10, "igen": 4, "shdr": 46}
KEY_RANGE, VEL_RANGE, SAMPLE_ID = 43, 44, 53


def lint(path: Path) -> str:
    """The complaints of sfzlint, in a process of its own: it warns of its age."""
    words = [sys.executable, "-W", "ignore", "-m", "sfzlint.lint", "--no-pickle", path]
    found = subprocess.run(words, capture_output=True, text=True)
    assert found.returncode == 0, found.stderr
    return found.stdout


def opcodes(text: str, name: str) -> list[str]:
    return re.findall(rf"(?:^|\s){name}=(\S+)", text)


@pytest.mark.parametrize(
    ("fields", "choices"),
    [
        ({"damping": {"let_ring": True}}, {"format": "wav", "bits": "16"}),
        ({"pickup": STEREO, "bend_semitones": 12.0}, {"every": 3, "layers": 1}),
        ({"level_db": 20.0, "damping": {"release_t60_s": 60.0}, "description": "Loud."}, {"layers": 32}),
    ],
)
def test_sfzlint_accepts_it_and_every_sample_is_there(fields: dict, choices: dict, tmp_path: Path) -> None:
    out, plan = tmp_path / "An instrument (2).sfz", small(instrument_of(**fields), **choices)
    export_sampled(plan, out, render)
    assert lint(out) == ""
    text = out.read_text("utf-8")
    assert ("// A sample for every 3 keys" in text) == (plan.every == 3)
    (folder,) = opcodes(text, "default_path")
    names = opcodes(text, "sample")
    assert len(names) == len(set(names)) == len(plan.zones)
    assert {soundfile.info(out.parent / folder / name).channels for name in names} == {plan.channels}
    assert max(map(float, opcodes(text, "volume"))) <= 0
    if plan.instrument.damping.let_ring:  # a fault would be reported
        out.write_text(text.replace("note_selfmask=off", "note_selfmask=perhaps"))
        assert "note_selfmask" in lint(out)


def chunks(data: bytes) -> dict[str, bytes]:
    """Name and content of each chunk, in its order; every size is looked at."""
    file, found = io.BytesIO(data), {}
    while head := file.read(8):
        name, size = struct.unpack("<4sI", head)
        assert size % 2 == 0
        body = file.read(size)
        assert len(body) == size
        found[name.decode() + (body[:4].decode() if name in (b"LIST", b"RIFF") else "")] = body
    return found


class SoundFont:
    """The tables of a file, as the specification lays them out: read here by another hand than wrote them."""

    def __init__(self, path: Path) -> None:
        (whole,) = chunks(path.read_bytes()).items()
        assert whole[0] == "RIFFsfbk"
        lists = chunks(whole[1][4:])
        assert list(lists) == ["LISTINFO", "LISTsdta", "LISTpdta"]
        self.info = chunks(lists["LISTINFO"][4:])
        self.frames = np.frombuffer(chunks(lists["LISTsdta"][4:])["smpl"], "<i2")
        self.tables = chunks(lists["LISTpdta"][4:])
        assert list(self.tables) == list(ROWS)
        assert not any(len(table) % ROWS[name] for name, table in self.tables.items())

    def rows(self, name: str, form: str) -> list[tuple]:
        assert struct.calcsize(form) == ROWS[name]
        return list(struct.iter_unpack(form, self.tables[name]))

    def zones(self) -> list[list[tuple[int, int]]]:
        """Generators of each zone of the instrument, the global one first."""
        generators = self.rows("igen", "<HH")
        return [generators[first:last] for (first, _), (last, _) in pairwise(self.rows("ibag", "<HH"))]


HOSTILE = (
    "../../etc/passwd",
    "/etc/passwd",
    "C:\\Windows\\x",
    "a\n<region> sample=/etc/passwd",
    "..",
    "$x #define",
    "con\x00",
    "é漢字" * 5_000,
    "",
    "x" * 10_000,
    "a=b // c <global>",
)


def test_no_name_becomes_a_path_or_an_opcode(tmp_path: Path) -> None:
    for place, name in enumerate(HOSTILE):
        folder = tmp_path / str(place)
        folder.mkdir()
        assert re.fullmatch(r"[A-Za-z0-9+][A-Za-z0-9_.+-]{0,59}", plain_stem(name))
        hostile = instrument_of().model_copy(update={"name": name, "description": f"{name}\n#include"})
        plan = small(hostile, keys=(60, 60), layers=1)
        fits = name.isprintable() and re.fullmatch(r"[^/\\:<>]{1,50}", name)
        out, font = folder / (f"{name}.sfz" if fits else "a.sfz"), folder / "a.sf2"
        export_sampled(plan, out, render)
        export_sampled(plan, font, render)
        assert sorted(folder.iterdir()) == sorted([out, sample_folder(out), font])
        text = out.read_text("utf-8")
        code = re.sub("//.*", "", text)
        assert opcodes(code, "sample") == [f"{plan.zones[0].stem}.flac"]
        assert re.findall(r"^<\w+>", text, re.M) == ["<control>", "<global>", "<group>", "<region>"]
        assert "#include" not in code
        told = SoundFont(font)
        assert len(told.info["INAM"]) <= 256 and told.info["INAM"].isascii()
        assert told.tables["phdr"][19] == 0
    assert plain_stem("a b=c$d<e>//f;g") == "a_b_c_d_e_f_g"
    assert sample_folder(Path("x") / "My song.v2.sfz") == Path("x") / "My_song.v2_samples"


@pytest.mark.parametrize(("points", "level_db"), [((0.2,), 20.0), ((0.2, 0.4), -30.0)])
def test_the_tables_are_as_the_specification_has_them_and_the_whole_is_at_full_level(
    points: tuple[float, ...], level_db: float, tmp_path: Path
) -> None:
    told = {"name": "Häärp ñ 琴", "description": "Two lines."}
    plan = small(instrument_of(pickup={"points": points}, level_db=level_db, **told))
    export_sampled(plan, tmp_path / "a.sf2", render)
    font = SoundFont(tmp_path / "a.sf2")
    assert font.info["ifil"] == struct.pack("<HH", 2, 1)
    assert font.info["INAM"].rstrip(b"\0") == b"Haarp n _"
    assert 20 * np.log10(np.abs(font.frames.astype(int)).max() / 2**15) == pytest.approx(-1, abs=0.02)
    *samples, last = font.rows("shdr", "<20sIIIIIBbHH")
    assert last[0].rstrip(b"\0") == b"EOS"
    assert len(samples) == len(plan.zones) * len(points)
    for number, (_, start, end, loop, loop_end, rate_hz, key, fine, link, kind) in enumerate(samples):
        assert start < loop < loop_end < end <= len(font.frames) - ZEROS_BEHIND
        assert not font.frames[end : end + ZEROS_BEHIND].any()
        assert font.frames[start:end].any()
        assert (rate_hz, fine) == (RATE_HZ, 0)
        assert 58 <= key <= 61
        if len(points) == 1:
            assert (kind, link) == (1, 0)
        else:
            assert samples[link][8] == number
            assert {kind, samples[link][9]} == {2, 4}
    assert [a[2] + ZEROS_BEHIND for a in samples] == [b[1] for b in samples[1:]] + [len(font.frames)]
    first, *zones = font.zones()
    assert not any(kind == SAMPLE_ID for kind, _ in first)
    for zone in zones:
        assert [zone[0][0], zone[1][0], zone[-1][0]] == [KEY_RANGE, VEL_RANGE, SAMPLE_ID]
    assert sorted(zone[-1][1] for zone in zones) == list(range(len(samples)))
    assert (0x0502, 48, 0, 0, 0) in font.rows("imod", "<HHhHH")  # the default of velocity, of no amount


@pytest.mark.parametrize(
    ("name", "choices", "reported"),
    [
        ("a.sf2", {"rate_hz": 96_000}, "a SoundFont's rate must lie in 400 … 50000 Hz, not 96000; lower it"),
        ("a.sf2", {"keys": (0, 127), "layers": 16, "seconds": 60.0}, "GiB, and a SoundFont holds 4; take fewer"),
        ("a.wav", {}, r"a\.wav: must end with \.sfz or \.sf2"),
    ],
)
def test_plans_that_no_file_can_hold_are_reported_before(name: str, choices: dict, reported: str) -> None:
    whole = instrument_of(range=(0, 127))
    plan = small(whole, **choices)
    with pytest.raises(ValueError, match=reported):
        planned(plan, Path(name))
    assert planned(plan, Path("a.sfz")) == plan
    assert planned(small(whole, keys=(0, 127), layers=32), Path("a.sf2")).bits == "24"
