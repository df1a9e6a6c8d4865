from __future__ import annotations

import io
import struct
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from app.export.sampled.job import export_sampled, planned
from app.export.sampled.plan import SampledPlan
from app.export.sampled.sf2 import ZEROS_BEHIND, release_timecents
from app.patches.patch import Patch

Render = Callable[..., NDArray[np.float32]]
PatchOf = Callable[..., Patch]
RATE_HZ = 48_000
ROWS = {"phdr": 38, "pbag": 4, "pmod": 10, "pgen": 4, "inst": 22, "ibag": 4, "imod": 10, "igen": 4, "shdr": 46}
KEY_RANGE, VEL_RANGE, SAMPLE_ID = 43, 44, 53


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


def small(patch: Patch, **choices: object) -> SampledPlan:
    return SampledPlan(patch, **{"keys": (58, 61), "layers": 3, "seconds": 1.0, **choices})


@pytest.mark.parametrize("points", [(0.2,), (0.2, 0.4)])
def test_the_tables_are_as_the_specification_has_them(
    points: tuple[float, ...], patch_of: PatchOf, render: Render, tmp_path: Path
) -> None:
    plan = small(patch_of(pickup={"points": points}, name="Häärp", description="Two lines."))
    export_sampled(plan, tmp_path / "a.sf2", render)
    font = SoundFont(tmp_path / "a.sf2")
    assert font.info["ifil"] == struct.pack("<HH", 2, 1)
    assert font.info["INAM"].rstrip(b"\0") == b"Haarp"
    assert {name: len(row) for name, rows in font.rows.items() for row in rows} == ROWS
    *samples, last = font.samples
    assert last[0].rstrip(b"\0") == b"EOS"
    assert len(samples) == len(plan.zones) * len(points)
    for number, (_, start, end, loop, loop_end, rate_hz, key, cents, link, kind) in enumerate(samples):
        assert start < loop < loop_end < end <= len(font.frames) - ZEROS_BEHIND
        assert not font.frames[end : end + ZEROS_BEHIND].any()
        assert font.frames[start:end].any()
        assert (rate_hz, cents) == (RATE_HZ, 0)
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


@pytest.mark.parametrize(
    ("points", "pan_db", "curve"), [((0.2,), -3.01, 0.0), ((0.2, 0.4), 0.0, 0.0), ((0.2,), -3.01, 0.2)]
)
def test_it_sounds_as_the_patch_in_pitch_and_level(
    points: tuple[float, ...],
    pan_db: float,
    curve: float,
    patch_of: PatchOf,
    render: Render,
    play: Callable,
    tmp_path: Path,
    pitch_cents: Callable[..., float],
    level_db: Callable[..., float],
) -> None:
    patch = patch_of(pickup={"points": points}, pluck={"curve": curve})
    out = tmp_path / "a.sf2"
    gain_db = export_sampled(small(patch), out, render).gain_db
    offsets = []
    for key, velocity in [(58, 127), (58, 1), (59, 20), (60, 42), (60, 43), (61, 84), (61, 100)]:
        heard, direct = play(out, [(0, key, velocity)], 0.5), render(patch, key, velocity, 1, 1, RATE_HZ)
        part = slice(2_400, 20_000)
        for side, own in zip(heard, (direct[:, 0], direct[:, -1]), strict=True):
            assert abs(pitch_cents(side[part], RATE_HZ, key)) < 0.05
            offsets.append(level_db(side[part]) - level_db(own[part]) - gain_db)
    assert np.ptp(offsets) < (3.0 if curve else 0.4)  # in a layer, dB over velocity are a straight line
    assert np.mean(offsets) - pan_db == pytest.approx(1.4, abs=0.3)  # the player's own gain


def test_a_key_let_go_falls_by_60_db_in_the_damping_time(
    patch_of: PatchOf, render: Render, play: Callable, tmp_path: Path, level_db: Callable[..., float]
) -> None:
    export_sampled(small(patch_of(damping={"release_t60_s": 0.4})), tmp_path / "a.sf2", render)
    heard = play(tmp_path / "a.sf2", [(0, 60, 127), (0.2, 60, 0)], 0.8)[0]
    before, after = (level_db(heard[round(at * RATE_HZ) :][:960]) for at in (0.17, 0.37))
    assert before - after == pytest.approx(60 * (0.18 / 0.4) + 30 * 0.2, abs=2)
    timecents = release_timecents(patch_of(damping={"release_t60_s": 0.6}))
    assert timecents == 0  # 100 dB in a second


def test_strings_that_ring_on_end_where_they_are_plucked_again(
    patch_of: PatchOf, render: Render, play: Callable, tmp_path: Path, level_db: Callable[..., float]
) -> None:
    patch = patch_of(damping={"let_ring": True})
    export_sampled(small(patch, seconds=2.0), tmp_path / "a.sf2", render)
    heard = play(tmp_path / "a.sf2", [(0, 60, 127), (0.1, 60, 0), (0.8, 60, 1)], 1.6)[0]
    level = {at: level_db(heard[round(at * RATE_HZ) :][:4_800]) for at in (0.05, 0.65, 1.45)}
    assert level[0.05] - level[0.65] == pytest.approx(30 * 0.6, abs=1.5)
    direct = render(patch, 60, 1, 2, 2, RATE_HZ)[:, 0]
    alone = play(tmp_path / "a.sf2", [(0.8, 60, 1)], 1.6)[0]
    assert level[1.45] - level_db(alone[round(1.45 * RATE_HZ) :][:4_800]) == pytest.approx(0, abs=1)
    assert level_db(direct) < level[0.65]


@pytest.mark.parametrize("patch_db", [-30.0, 20.0])
def test_the_whole_is_at_full_level(patch_db: float, patch_of: PatchOf, render: Render, tmp_path: Path) -> None:
    patch = patch_of(level_db=patch_db, pluck={"softest_mm": 1.0, "hardest_mm": 10.0})
    report = export_sampled(small(patch), tmp_path / "a.sf2", render)
    assert report.gain_db == pytest.approx(-1 - patch_db, abs=0.5)  # the peak is estimated from quiet plucks
    loudest = np.abs(SoundFont(tmp_path / "a.sf2").frames.astype(int)).max()
    assert 20 * np.log10(loudest / 2**15) == pytest.approx(-1, abs=0.02)


def test_another_player_reads_it(
    patch: Patch, render: Render, tmp_path: Path, pitch_cents: Callable[..., float]
) -> None:
    player = pytest.importorskip("tinysoundfont", reason="its wheels and those of PyAudio are not for every Python")
    export_sampled(small(patch), tmp_path / "a.sf2", render)
    synth = player.Synth(gain=0, samplerate=RATE_HZ)
    synth.program_select(0, synth.sfload(str(tmp_path / "a.sf2")), 0, 0)
    for key in (58, 61):
        synth.noteon(0, key, 127)
        heard = np.frombuffer(bytes(synth.generate(RATE_HZ // 2)), np.float32).reshape(-1, 2)
        synth.noteoff(0, key)
        synth.generate(RATE_HZ)
        assert abs(pitch_cents(heard[2_400:, 0], RATE_HZ, key)) < 0.05


@pytest.mark.parametrize(
    ("choices", "reported"),
    [
        ({"rate_hz": 96_000}, "a SoundFont's rate must lie in 400 … 50000 Hz, not 96000; lower it"),
        ({"keys": (0, 127), "layers": 16, "seconds": 60.0}, "GiB, and a SoundFont holds 4; take fewer"),
        ({"keys": (0, 127), "layers": 32, "seconds": 0.1}, ""),
    ],
)
def test_what_no_soundfont_holds_is_reported_before(choices: dict, reported: str, patch_of: PatchOf) -> None:
    plan = small(patch_of(range=(0, 127)), **choices)
    if not reported:
        assert planned(plan, Path("a.sf2")).bits == "24"
        return
    with pytest.raises(ValueError, match=reported):
        planned(plan, Path("a.sf2"))
    assert planned(plan, Path("a.sfz")) == plan


def test_other_files_are_refused(patch: Patch) -> None:
    with pytest.raises(ValueError, match=r"a\.wav: must end with \.sfz or \.sf2"):
        planned(small(patch), Path("a.wav"))


def test_accents_go_and_other_letters_are_underscores(patch: Patch, render: Render, tmp_path: Path) -> None:
    export_sampled(small(patch.model_copy(update={"name": "Café ñ 琴"})), tmp_path / "a.sf2", render)
    assert SoundFont(tmp_path / "a.sf2").info["INAM"].rstrip(b"\0") == b"Cafe n _"


def test_a_hostile_name_is_a_name(patch: Patch, render: Render, tmp_path: Path) -> None:
    name = "../\x00\n" + "é漢" * 5_000
    export_sampled(small(patch.model_copy(update={"name": name, "description": name})), tmp_path / "a.sf2", render)
    font = SoundFont(tmp_path / "a.sf2")
    assert len(font.info["INAM"]) <= 256
    assert font.info["INAM"].isascii()
    assert font.rows["phdr"][0][19] == 0
    assert [path.name for path in tmp_path.iterdir()] == ["a.sf2"]
