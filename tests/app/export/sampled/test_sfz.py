from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import soundfile
from numpy.typing import NDArray

from app.export.sampled.job import export_sampled, plain_stem, sample_folder
from app.export.sampled.plan import SampledPlan
from app.export.sampled.sfz import release_s
from app.patches.patch import Patch
from app.shared.parameters import OF_PATCHES

Render = Callable[..., NDArray[np.float32]]
PatchOf = Callable[..., Patch]
RATE_HZ = 48_000


def lint(path: Path) -> str:
    """What sfzlint has to say, in a process of its own: it warns of its age."""
    words = [sys.executable, "-W", "ignore", "-m", "sfzlint.lint", "--no-pickle", path]
    found = subprocess.run(words, capture_output=True, text=True)
    assert found.returncode == 0, found.stderr
    return found.stdout


def opcodes(text: str, name: str) -> list[str]:
    return re.findall(rf"(?:^|\s){name}=(\S+)", text)


def short(patch: Patch, **choices: object) -> SampledPlan:
    """Samples of which the player has all in memory at once."""
    return SampledPlan(patch, **{"keys": (58, 61), "layers": 3, "seconds": 0.17, **choices})


CHOICES = pytest.mark.parametrize(
    ("fields", "choices"),
    [
        ({}, {}),
        ({"damping": {"let_ring": True}}, {"format": "wav", "bits": "16"}),
        ({"pickup": {"points": (0.2, 0.4)}, "bend_semitones": 12.0}, {"every": 3, "layers": 1}),
        ({"level_db": 20.0, "damping": {"release_t60_s": 60.0}, "description": "Loud."}, {"layers": 32}),
    ],
)


@CHOICES
def test_sfzlint_accepts_it_and_every_sample_is_there(
    fields: dict, choices: dict, patch_of: PatchOf, render: Render, tmp_path: Path
) -> None:
    out, plan = tmp_path / "An instrument (2).sfz", short(patch_of(**fields), **choices)
    export_sampled(plan, out, render)
    assert lint(out) == ""
    text = out.read_text("utf-8")
    (folder,) = opcodes(text, "default_path")
    names = opcodes(text, "sample")
    assert len(names) == len(set(names)) == len(plan.zones)
    for name in names:
        with soundfile.SoundFile(out.parent / folder / name) as file:
            assert file.channels == len(plan.patch.pickup.points)
    assert max(map(float, opcodes(text, "volume"))) <= 0


def test_sfzlint_would_report(patch: Patch, render: Render, tmp_path: Path) -> None:
    out = tmp_path / "a.sfz"
    export_sampled(short(patch), out, render)
    out.write_text(out.read_text("utf-8").replace("note_selfmask=off", "note_selfmask=perhaps"))
    assert "note_selfmask" in lint(out)


def test_it_sounds_as_the_patch_in_pitch_and_level(
    patch_of: PatchOf,
    render: Render,
    tmp_path: Path,
    sfizz: Callable,
    pitch_cents: Callable[..., float],
    level_db: Callable[..., float],
) -> None:
    patch = patch_of(pickup={"points": (0.2, 0.4)}, pluck={"curve": 0.4}, level_db=-6.0)
    out = tmp_path / "a.sfz"
    export_sampled(short(patch), out, render)
    offsets = []
    for key, velocity in [(58, 127), (58, 1), (59, 20), (60, 42), (60, 43), (61, 84), (61, 100)]:
        player = sfizz(out)
        player.press(key, velocity)
        heard, direct = player.play(0.12), render(patch, key, velocity, 0.17, 0.17, RATE_HZ)[: round(0.12 * RATE_HZ)]
        assert abs(pitch_cents(heard[0], RATE_HZ, key)) < 0.1 + abs(pitch_cents(direct[:, 0], RATE_HZ, key))
        offsets += [level_db(side) - level_db(own) for side, own in zip(heard, direct.T, strict=True)]
    assert np.ptp(offsets) < 0.4  # of one level for all: the player's own


@pytest.mark.parametrize(("patch_db", "gain_db"), [(-30.0, 0.0), (20.0, -21.0)])
def test_a_loud_patch_is_lowered_as_a_whole(
    patch_db: float,
    gain_db: float,
    patch_of: PatchOf,
    render: Render,
    tmp_path: Path,
    sfizz: Callable,
    level_db: Callable[..., float],
) -> None:
    pluck = {"softest_mm": 1.0, "hardest_mm": 10.0}
    levels = []
    for name, level in (("a", 0.0), ("b", patch_db)):
        report = export_sampled(short(patch_of(level_db=level, pluck=pluck)), tmp_path / f"{name}.sfz", render)
        player = sfizz(tmp_path / f"{name}.sfz")
        player.press(60, 30)
        levels.append(level_db(player.play(0.1)[0]) - report.gain_db)
    assert report.gain_db == pytest.approx(gain_db, abs=0.1)
    assert levels[1] - levels[0] == pytest.approx(patch_db, abs=0.02)


def test_neighbours_of_a_sampled_key_are_transposed(
    patch: Patch, render: Render, tmp_path: Path, sfizz: Callable, pitch_cents: Callable[..., float]
) -> None:
    out = tmp_path / "a.sfz"
    export_sampled(short(patch, every=3), out, render)
    assert "// A sample for every 3 keys" in out.read_text("utf-8")
    for key in (58, 59, 60):
        player = sfizz(out)
        player.press(key, 100)
        assert abs(pitch_cents(player.play(0.15)[0], RATE_HZ, key)) < 1


def test_a_key_let_go_falls_by_60_db_in_the_damping_time(
    patch_of: PatchOf, render: Render, tmp_path: Path, sfizz: Callable, level_db: Callable[..., float]
) -> None:
    out = tmp_path / "a.sfz"
    export_sampled(short(patch_of(damping={"release_t60_s": 0.1})), out, render)
    player = sfizz(out)
    player.press(60, 127)
    before = level_db(player.play(0.04)[0, -960:])
    player.release(60)
    player.play(0.04)
    after = level_db(player.play(0.02)[0])  # about 50 ms after the key, 60 ms after what was measured before
    assert before - after == pytest.approx(30 + 0.06 * 30, abs=1.5)
    player.play(0.2)
    assert player.voices() == 0


def test_strings_that_ring_on_end_where_they_are_plucked_again(
    patch_of: PatchOf, render: Render, tmp_path: Path, sfizz: Callable
) -> None:
    out = tmp_path / "a.sfz"
    patch = patch_of(damping={"let_ring": True, "release_t60_s": 0.01})
    export_sampled(short(patch), out, render)
    player = sfizz(out)
    player.press(60, 127)
    player.press(61, 127)
    player.play(0.02)
    player.release(60)
    player.release(61)
    player.play(0.03)
    assert player.voices() == 2
    player.press(60, 10)  # softer, in another layer
    assert player.voices() == 3
    player.play(0.09)
    assert player.voices() == 2


@pytest.mark.parametrize(
    "name",
    [
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
    ],
)
def test_no_name_becomes_a_path_or_an_opcode(name: str, patch: Patch, render: Render, tmp_path: Path) -> None:
    assert re.fullmatch(r"[A-Za-z0-9+][A-Za-z0-9_.+-]{0,59}", plain_stem(name))
    hostile = patch.model_copy(update={"name": name, "description": f"{name}\n#include"})
    plan = short(hostile, keys=(60, 60), layers=1)
    out = (
        tmp_path / f"{name}.sfz"
        if name.isprintable() and re.fullmatch(r"[^/\\:<>]{1,50}", name)
        else tmp_path / "a.sfz"
    )
    export_sampled(plan, out, render)
    assert sorted(tmp_path.iterdir()) == sorted([out, sample_folder(out)])
    assert lint(out) == ""
    text = out.read_text("utf-8")
    assert opcodes(re.sub("//.*", "", text), "sample") == [f"{plan.zones[0].stem}.flac"]
    assert re.findall(r"^<\w+>", text, re.M) == ["<control>", "<global>", "<group>", "<region>"]
    assert "#include" not in re.sub("//.*", "", text)


def test_a_folder_name_has_no_sign_that_sfz_reads() -> None:
    assert plain_stem("a b=c$d<e>//f;g") == "a_b_c_d_e_f_g"
    assert sample_folder(Path("x") / "My song.v2.sfz") == Path("x") / "My_song.v2_samples"


def test_the_longest_release_of_an_instrument_is_within_the_formats(patch_of: PatchOf) -> None:
    longest = OF_PATCHES["damping.release_t60_s"].limits[1]
    assert release_s(patch_of(damping={"release_t60_s": longest})) < 100
