"""A patch as a Faust program: compiled and played, it sounds as our quiet pluck does."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from app.export.faust import faust_program, key_tables, write_faust
from app.instrument.facts import bright_mode
from app.instrument.loud_keys import LoudKeys
from app.instrument.offline import render_note
from app.patches.library import SHIPPED as PATCHES
from app.patches.library import read_patch
from app.patches.patch import Body, Damping, Noise, Patch, Pickup, PluckChoices, Polarisations, Room
from app.patches.tuning import TuningChoice
from engine.presets import SHIPPED, Preset, load_preset
from engine.voices import Ear

RATE_HZ = 48_000
SECONDS, HELD_S = 1.2, 0.8
VELOCITY = 100
QUIET: dict[str, Any] = {"softest_mm": 0.01, "hardest_mm": 0.02}
PLAIN: dict[str, Any] = {"release_ms": 0.0, "release_hard_ms": 0.0, "variation": 0.0}
ALONE: dict[str, Any] = {
    **{"body": Body(), "room": Room(), "noise": Noise()},
    **{"polarisations": None, "sympathy_s_kg": 0.0, "mode": "poly"},
}
DRIVER = Path(__file__).with_name("faust_driver.cpp")
needs_faust = pytest.mark.skipif(
    shutil.which("faust") is None or shutil.which("g++") is None, reason="needs faust and g++"
)


def quiet(name: str, **changes: object) -> Patch:
    patch = read_patch(PATCHES / f"{name}.json")
    pluck = PluckChoices.model_validate({**dict(patch.pluck), **QUIET, **PLAIN})
    return Patch.model_validate({**dict(patch), **ALONE, "pluck": pluck, **changes})


@pytest.fixture(scope="module")
def preset() -> Preset:
    return load_preset(SHIPPED / "studio_any_string.safetensors")


def compiled(patch: Patch, preset: Preset, folder: Path) -> Path:
    source, cpp, program = (folder / f"string.{ending}" for ending in ("dsp", "cpp", "out"))
    write_faust(source, patch, preset.info)
    subprocess.run(["faust", "-lang", "cpp", "-a", str(DRIVER), str(source), "-o", str(cpp)], check=True)
    subprocess.run(["g++", "-w", str(cpp), "-o", str(program)], check=True)
    return program


def played(program: Path, freq_hz: float, channels: int) -> NDArray[np.float64]:
    numbers = (freq_hz, VELOCITY / 127, round(HELD_S * RATE_HZ), round(SECONDS * RATE_HZ), RATE_HZ)
    done = subprocess.run([str(program), *map(str, numbers)], check=True, capture_output=True)
    return np.frombuffer(done.stdout, np.float32).reshape(-1, channels).astype(np.float64)


def test_its_tables_are_the_strings_modes(preset: Preset) -> None:
    patch = quiet("oud")
    keys = LoudKeys(patch, Ear(tuple(patch.pickup.points)), preset.info)
    key = keys.of_key(60)
    assert key is not None
    t, b, c, d, loud = (np.array(column) for column in key_tables([key, None]))
    mu2 = np.arange(1, key.resonator.modes + 1) ** 2
    np.testing.assert_allclose(mu2 * (t[0] + b[0] * mu2), key.resonator.omega**2, rtol=1e-12)
    np.testing.assert_allclose(c[0] + d[0] * mu2, key.resonator.sigma, rtol=1e-12)
    assert (t[1], loud[1]) == (t[0], 0)  # a silent key has a neighbour's string
    at_bridge = key_tables([key], bridge=True)[4][0] * mu2 * (t[0] + b[0] * mu2) / np.sqrt(mu2)
    assert key.resonator.end_force is not None
    expected = key.gain * key.string.shortened * key.resonator.end_force
    np.testing.assert_allclose(at_bridge, expected, rtol=1e-12)


def test_losses_by_mode_are_right_for_the_first_partial_and_near_three_kilohertz(preset: Preset) -> None:
    patch = quiet("classical_guitar")
    assert patch.losses is not None
    key = LoudKeys(patch, Ear(tuple(patch.pickup.points)), preset.info).of_key(60)
    assert key is not None
    _, _, c, d, _ = (np.array(column) for column in key_tables([key], patch=patch))
    for mode in (1, bright_mode(key.string.parameters)):
        assert c[0] + d[0] * mode**2 == pytest.approx(key.resonator.sigma[mode - 1], rel=1e-9)


def test_its_decay_is_that_of_the_first_polarisation(preset: Preset) -> None:
    patch = quiet("oud", polarisations=Polarisations(conductance_s_kg=0.02))
    keys = LoudKeys(patch, Ear(tuple(patch.pickup.points)), preset.info)
    key = keys.of_key(60)
    assert key is not None
    _, _, c, d, _ = (np.array(column) for column in key_tables([key], False, patch.knobs.decay * 0.02))
    np.testing.assert_allclose(c[0] + d[0] * np.array([1, 4, 9]), key.resonator.sigma[[0, 2, 4]], rtol=1e-12)


def test_the_program_says_what_it_is(preset: Preset) -> None:
    text, modes = faust_program(quiet("classical_guitar", author='A "b" c'), preset.info, 12)
    assert modes == 12
    assert "its quiet string, 12 modes" in text.splitlines()[0]
    assert 'declare author "A b c";' in text
    for name in ("freq", "gain", "gate"):
        assert f"{name} = " in text


def test_a_patch_without_a_string_is_reported(preset: Preset) -> None:
    patch = quiet("classical_guitar", range=(127, 127), tuning=TuningChoice(transpose=48))
    with pytest.raises(ValueError, match="none of its keys"):
        faust_program(patch, preset.info)


@needs_faust
@pytest.mark.parametrize(
    ("keys", "changes"),
    [
        ((40, 57, 76), {}),
        (
            (52, 57),  # a triangle, a velocity pick-up, strings that ring on, another pitch
            {
                "pluck": PluckChoices(**QUIET),
                "pickup": Pickup(points=(0.2,), kind="velocity"),
                "damping": Damping(let_ring=True),
                "tuning": TuningChoice(a4_hz=415.0),
            },
        ),
        ((45, 69), {"pickup": Pickup(kind="bridge")}),
    ],
)
def test_it_sounds_as_our_quiet_pluck(
    keys: tuple[int, ...], changes: dict[str, object], preset: Preset, tmp_path: Path
) -> None:
    patch = quiet("oud", **changes)  # without losses by mode, which a program has nearly
    program = compiled(patch, preset, tmp_path)
    for key in keys:
        ours = render_note(patch, preset, key, VELOCITY, HELD_S, SECONDS, RATE_HZ).astype(np.float64)
        theirs = played(program, 440 * 2 ** ((key - 69) / 12), 2)[:, : ours.shape[1]]
        held = round(HELD_S * RATE_HZ)
        assert ((ours[:held] - theirs[:held]) ** 2).sum() < 1e-4 * (ours[:held] ** 2).sum()
    early, late = (theirs[held + start : held + start + RATE_HZ // 50] for start in (RATE_HZ // 50, RATE_HZ // 20))
    fell = np.sqrt((late**2).mean() / (early**2).mean())
    wanted = 1 if patch.damping.let_ring else 10 ** (-3 * 0.03 / patch.damping.release_t60_s)
    assert fell == pytest.approx(wanted, rel=0.1)
