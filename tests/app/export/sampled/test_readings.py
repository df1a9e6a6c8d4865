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
from app.export.sampled.plan import SampledPlan
from app.export.sampled.sf2 import ZEROS_BEHIND
from app.instruments.instrument import Instrument
from tests.app.export.sampled.conftest import RATE_HZ, InstrumentOf, Render

ROWS = {"phdr": 38, "pbag": 4, "pmod": 10, "pgen": 4, "inst": 22, "ibag": 4, "imod": 10, "igen": 4, "shdr": 46}
KEY_RANGE, VEL_RANGE, SAMPLE_ID = 43, 44, 53
STEREO = {"points": (0.2, 0.4)}


def small(instrument: Instrument, **choices: object) -> SampledPlan:
    return SampledPlan(instrument, **{"keys": (58, 61), "layers": 3, "seconds": 0.17, **choices})


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
def test_sfzlint_accepts_it_and_every_sample_is_there(
    fields: dict, choices: dict, instrument_of: InstrumentOf, render: Render, tmp_path: Path
) -> None:
    out, plan = tmp_path / "An instrument (2).sfz", small(instrument_of(**fields), **choices)
    export_sampled(plan, out, render)
    assert lint(out) == ""
    text = out.read_text("utf-8")
    (folder,) = opcodes(text, "default_path")
    names = opcodes(text, "sample")
    assert len(names) == len(set(names)) == len(plan.zones)
    for name in names:
        with soundfile.SoundFile(out.parent / folder / name) as file:
            assert file.channels == len(plan.instrument.pickup.points)
    assert max(map(float, opcodes(text, "volume"))) <= 0
    if plan.instrument.damping.let_ring:  # a fault would be reported
        out.write_text(text.replace("note_selfmask=off", "note_selfmask=perhaps"))
        assert "note_selfmask" in lint(out)


HOSTILE = (
    "../../etc/passwd",
    "/etc/passwd",
    "C:\\Windows\\x",
    "a\n<region> sample=/etc/passwd",
    "..",
    "$x #define",
    "con\x00",
    "é漢字",
    "",
    "x" * 10_000,
    "a=b // c <global>",
)


def test_no_name_becomes_a_path_or_an_opcode(instrument: Instrument, render: Render, tmp_path: Path) -> None:
    for place, name in enumerate(HOSTILE):
        folder = tmp_path / str(place)
        folder.mkdir()
        assert re.fullmatch(r"[A-Za-z0-9+][A-Za-z0-9_.+-]{0,59}", plain_stem(name))
        hostile = instrument.model_copy(update={"name": name, "description": f"{name}\n#include"})
        plan = small(hostile, keys=(60, 60), layers=1)
        fits = name.isprintable() and re.fullmatch(r"[^/\\:<>]{1,50}", name)
        out = folder / (f"{name}.sfz" if fits else "a.sfz")
        export_sampled(plan, out, render)
        assert sorted(folder.iterdir()) == sorted([out, sample_folder(out)])
        text = out.read_text("utf-8")
        code = re.sub("//.*", "", text)
        assert opcodes(code, "sample") == [f"{plan.zones[0].stem}.flac"]
        assert re.findall(r"^<\w+>", text, re.M) == ["<control>", "<global>", "<group>", "<region>"]
        assert "#include" not in code
    assert plain_stem("a b=c$d<e>//f;g") == "a_b_c_d_e_f_g"
    assert sample_folder(Path("x") / "My song.v2.sfz") == Path("x") / "My_song.v2_samples"


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
        tables = chunks(lists["LISTpdta"][4:])
        assert list(tables) == list(ROWS)
        self.rows = {
            name: [table[at : at + ROWS[name]] for at in range(0, len(table), ROWS[name])]
            for name, table in tables.items()
        }
        self.samples = [struct.unpack("<20sIIIIIBbHH", row) for row in self.rows["shdr"]]

    def zones(self) -> list[list[tuple[int, int]]]:
        """Generators of each zone of the instrument, the global one first."""
        bags = [struct.unpack("<HH", row) for row in self.rows["ibag"]]
        generators = [struct.unpack("<HH", row) for row in self.rows["igen"]]
        return [generators[first:last] for (first, _), (last, _) in pairwise(bags)]


@pytest.mark.parametrize("points", [(0.2,), (0.2, 0.4)])
def test_the_tables_are_as_the_specification_has_them(
    points: tuple[float, ...], instrument_of: InstrumentOf, render: Render, tmp_path: Path
) -> None:
    plan = small(instrument_of(pickup={"points": points}, name="Häärp ñ 琴", description="Two lines."))
    export_sampled(plan, tmp_path / "a.sf2", render)
    font = SoundFont(tmp_path / "a.sf2")
    assert font.info["ifil"] == struct.pack("<HH", 2, 1)
    assert font.info["INAM"].rstrip(b"\0") == b"Haarp n _"
    assert {name: len(row) for name, rows in font.rows.items() for row in rows} == ROWS
    *samples, last = font.samples
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
    assert len(zones) == len(samples)
    for zone in zones:
        assert [zone[0][0], zone[1][0], zone[-1][0]] == [KEY_RANGE, VEL_RANGE, SAMPLE_ID]
    assert {zone[-1][1] for zone in zones} == set(range(len(samples)))
    sources = [struct.unpack("<HHhHH", row) for row in font.rows["imod"]]
    assert (0x0502, 48, 0, 0, 0) in sources  # the default of velocity, of no amount


@pytest.mark.parametrize("instrument_db", [-30.0, 20.0])
def test_the_whole_of_a_soundfont_is_at_full_level_and_a_hostile_name_is_a_name(
    instrument_db: float, instrument_of: InstrumentOf, render: Render, tmp_path: Path
) -> None:
    pluck, name = {"softest_mm": 1.0, "hardest_mm": 10.0}, "../\x00\n" + "é漢" * 5_000
    instrument = instrument_of(level_db=instrument_db, pluck=pluck).model_copy(
        update={"name": name, "description": name}
    )
    report = export_sampled(small(instrument), tmp_path / "a.sf2", render)
    assert report.gain_db == pytest.approx(-1 - instrument_db, abs=0.5)  # the peak is estimated from quiet plucks
    font = SoundFont(tmp_path / "a.sf2")
    assert 20 * np.log10(np.abs(font.frames.astype(int)).max() / 2**15) == pytest.approx(-1, abs=0.02)
    assert len(font.info["INAM"]) <= 256 and font.info["INAM"].isascii()
    assert font.rows["phdr"][0][19] == 0
    assert [path.name for path in tmp_path.iterdir()] == ["a.sf2"]


@pytest.mark.parametrize(
    ("name", "choices", "reported"),
    [
        ("a.sf2", {"rate_hz": 96_000}, "a SoundFont's rate must lie in 400 … 50000 Hz, not 96000; lower it"),
        ("a.sf2", {"keys": (0, 127), "layers": 16, "seconds": 60.0}, "GiB, and a SoundFont holds 4; take fewer"),
        ("a.wav", {}, r"a\.wav: must end with \.sfz or \.sf2"),
    ],
)
def test_plans_that_no_file_can_hold_are_reported_before(
    name: str, choices: dict, reported: str, instrument_of: InstrumentOf
) -> None:
    plan = small(instrument_of(range=(0, 127)), **choices)
    with pytest.raises(ValueError, match=reported):
        planned(plan, Path(name))
    assert planned(plan, Path("a.sfz")) == plan
    assert planned(small(instrument_of(range=(0, 127)), keys=(0, 127), layers=32), Path("a.sf2")).bits == "24"
