"""What all voices share: blocks, gains, listening points, velocity, the beginning and the end."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from engine.kernels.constants import QUANTUM
from engine.kernels.fields import record_of
from engine.kernels.voice_records import BANK_PROGRAM
from engine.levels import FULL_SCALE_M, FULL_SCALE_M_S
from engine.models.integrated_phase import IntegratedPhase
from engine.pluck import Pluck
from engine.resonators.string import resonator_of
from engine.values.ear import Ear
from engine.values.string import StringParameters
from engine.voices import Mixer, Voice, model_program, truth_program
from engine.voices.ear import REACH_FRAMES
from engine.voices.programs import solver_program
from engine.voices.voice import FADE_S
from tests.engine.sounds import (
    RATE_HZ,
    Info,
    Initial,
    Rung,
    Shipped,
    Signal,
    Strike,
    faded,
    mixer_of,
    voice_of,
)

FADE = round(FADE_S * RATE_HZ)
KNOWING, STEEL = "nylon_nonlinear_gaussian_4k_koopman_integrated", "studio_steel_e4"
HINTED = "nylon_nonlinear_gaussian_4k_koopman_integrated_hinted"
EAR = Ear((0.37,))


@pytest.fixture
def struck(strike: Strike, small_info: Info, initial_m: Initial) -> Strike:
    """A voice of either kind at 48 kHz: struck(kind, ear, gain)."""

    def made(kind: str, ear: Ear = EAR, gain: float = 1.0) -> Voice:
        if kind == "bank":
            return strike(KNOWING, ear=ear, gain=gain)
        info = small_info(True)
        return Voice(truth_program(info, RATE_HZ), initial_m(info, Pluck(0.3)), ear, gain)

    return made


def constant(frames: int = 48_000, level: float = 0.5) -> Voice:
    """It shows every change of gain."""
    return voice_of(np.full((frames, 1), level, np.float32))


KINDS = pytest.mark.parametrize("kind", ["bank", "truth"])


@KINDS
@pytest.mark.parametrize("pickup", ["displacement", "velocity"])
def test_any_splitting_into_blocks_is_the_same(kind: str, pickup: str, struck: Strike) -> None:
    ear = Ear((0.3, 0.6), pickup)

    def rendered(sizes: list[int]) -> Signal:
        voice, mixer, parts = struck(kind, ear), Mixer(RATE_HZ), []
        mixer.add(voice)
        for size in sizes:
            parts.append(mixer.render(size))
        return np.concatenate(parts)

    sizes = [int(size) for size in np.random.default_rng(0).integers(1, 400, 40)]
    whole = rendered([sum(sizes)])
    np.testing.assert_array_equal(rendered(sizes), whole)
    np.testing.assert_array_equal(rendered([1] * 200), whole[:200])


@KINDS
@pytest.mark.parametrize("solo", [0, 3])
def test_velocity_is_the_derivative_of_displacement(
    kind: str, solo: int, struck: Strike, rung: Rung, derivative: Callable[..., Signal]
) -> None:
    points = (0.3, 0.6)
    displacement = rung(9600, struck(kind, Ear(points, solo=solo)), attack=False)
    found = rung(9600, struck(kind, Ear(points, "velocity", solo)), attack=False)
    expected = derivative(displacement * FULL_SCALE_M, RATE_HZ) / FULL_SCALE_M_S
    inner = slice(0, 9600 - REACH_FRAMES)
    np.testing.assert_allclose(found[inner], expected[inner], atol=3e-5 * np.abs(expected).max())


@pytest.mark.parametrize("amplitude_mm", [0.1, 20.0])
def test_no_pluck_as_velocity_is_taken_for_a_runaway(
    amplitude_mm: float, shipped: Shipped, initial_m: Initial, rung: Rung
) -> None:
    info, pluck = shipped(STEEL).info, Pluck(0.02, amplitude_mm, "triangular")
    voice = Voice(truth_program(info, RATE_HZ), initial_m(info, pluck), Ear((0.05,), "velocity"))
    assert rung(4800, voice).any()
    assert not voice.ran_away


@KINDS
@pytest.mark.parametrize("pickup", ["displacement", "velocity"])
@pytest.mark.parametrize("skipped", [False, True])
def test_what_was_not_heard_is_where_it_would_have_been(
    kind: str, pickup: str, skipped: bool, struck: Strike, rung: Rung
) -> None:
    """It fades in, without anything of what sounded meanwhile; what is skipped is not even waited for."""
    ear, frames, arrived = Ear((0.37,), pickup), 150 * QUANTUM, FADE + 4 * QUANTUM
    expected = rung(frames + 12_000, struck(kind, ear))[frames:]
    voice, mixer = struck(kind, ear, 1.0 if skipped else 0.0), Mixer(RATE_HZ, limited=False)
    if skipped:
        voice.skip(frames / RATE_HZ, Mixer(RATE_HZ))
        voice.begin_at(640)
        mixer.add(voice)
        assert not mixer.render(640).any()
    else:
        mixer.add(constant(frames - 1000, 9.0), voice)
        mixer.render(frames - 1000)
        assert not mixer.render(1000)[-30:].any()
        voice.set_gain(1.0)
    found = mixer.render(12_000)
    assert voice.began_frame == (640 if skipped else 0)
    np.testing.assert_allclose(found[arrived:], expected[arrived:], atol=1e-5)
    assert (np.abs(found[:arrived]) <= np.abs(expected).max()).all()
    assert np.abs(found[: FADE // 4]).max() < 0.6 * np.abs(expected).max()


@KINDS
@pytest.mark.parametrize("solo", [0, 2])
def test_another_listening_point_is_faded_to_and_then_exact(kind: str, solo: int, struck: Strike, rung: Rung) -> None:
    here, there = Ear((0.3, 0.6)), Ear((0.45, 0.2), solo=solo)
    moved = struck(kind, here)
    mixer = mixer_of(moved)
    mixer.render(1920)
    assert moved.listen(there)
    assert not moved.listen(here), "a fade is under way"
    found = mixer.render(4800).astype(np.float64)
    before, after = rung(6720, struck(kind, here))[1920:], rung(6720, struck(kind, there))[1920:]
    frames = FADE
    share = np.minimum(np.arange(1, 4801) / frames, 1.0)[:, None]
    np.testing.assert_allclose(found, before + share * (after - before), atol=1e-6)
    if kind == "truth":
        np.testing.assert_array_equal(found[frames:], after[frames:])
    assert moved.listen(here)


@pytest.mark.parametrize("gain", [0.0, 1.0])
@KINDS
def test_what_has_become_silent_ends_by_itself(kind: str, gain: float, struck: Strike, small_info: Info) -> None:
    voice = struck(kind, gain=gain)
    mixer = mixer_of(voice)
    level, found = np.inf, np.zeros((1, 2), np.float32)
    while not voice.over and voice.seconds < 40:
        level, found = float(np.abs(found).max()), mixer.render(9600)
    assert voice.over
    assert level < 1e-4
    assert voice.level_db < -100


@KINDS
@pytest.mark.parametrize("pickup", ["displacement", "velocity"])
@pytest.mark.parametrize("frame", [1, 700, 1023])
def test_one_that_begins_within_a_quantum_is_the_same_sound_to_its_end(
    kind: str, pickup: str, frame: int, struck: Strike, rung: Rung
) -> None:
    """All of it, with a change of gain and the release, later by so many frames."""
    ear = Ear((0.3, 0.6), pickup)

    def rendered(begins: int) -> Signal:
        voice, mixer = struck(kind, ear), Mixer(RATE_HZ, limited=False)
        voice.begin_at(begins)
        mixer.add(voice)
        first = -(-(begins + 1) // QUANTUM) * QUANTUM + 1280 if begins else 1280 + QUANTUM
        parts = [mixer.render(first)]
        voice.set_gain(0.5)
        parts.append(mixer.render(640))
        voice.release(0.003)  # it ends within a quantum
        parts.append(mixer.render(640))
        assert voice.over
        return np.concatenate(parts)

    at_once, later = rendered(0), rendered(frame)
    assert not later[:frame].any()
    np.testing.assert_array_equal(later[frame : frame + len(at_once) - 64], at_once[:-64])
    assert np.abs(later[frame + len(at_once) - 64 :]).max() == 0


def test_the_attack_is_short_and_smooth(struck: Strike, rung: Rung) -> None:
    whole, found = rung(960, struck("truth"), attack=False)[:, 0], rung(960, struck("truth"))[:, 0]
    np.testing.assert_array_equal(found[96:], whole[96:])
    window = 0.5 - 0.5 * np.cos(np.pi * (np.arange(96) + 0.5) / 96)
    np.testing.assert_allclose(found[:96], window * whole[:96], atol=1e-7)


@pytest.mark.parametrize("value", [float("nan"), 1e30, 50.0])
def test_a_runaway_never_reaches_the_mix(
    value: float, shipped: Shipped, initial_m: Initial, strike: Strike, rung: Rung
) -> None:
    """A number of the model is spoilt: what nobody believes is found out before it is heard."""
    preset = shipped(KNOWING)
    assert isinstance(preset.model, IntegratedPhase)
    program = model_program(preset, RATE_HZ)
    if value == 50.0:  # one latent grows
        program.memory[record_of(program.memory, BANK_PROGRAM)["sigma"] + 2] = -value / RATE_HZ
    else:
        program.memory[record_of(program.memory, BANK_PROGRAM)["omega"] + 3] = value
    initial = initial_m(preset.info, Pluck(0.3))
    wild, mixer, parts = Voice(program, initial, EAR), Mixer(RATE_HZ, limited=False), []
    mixer.add(wild, strike(STEEL))
    while not wild.over and mixer.seconds < 3:
        parts.append(mixer.render(64))
    assert wild.ran_away
    assert [gap.cause for gap in mixer.new_gaps()] == ["runaway"]
    largest = 20 * float(np.abs(initial).max()) / FULL_SCALE_M + 1
    assert np.abs(np.concatenate(parts)).max() <= largest
    expected = rung(len(parts) * 64 + 640, strike(STEEL))
    np.testing.assert_allclose(mixer.render(640), expected[-640:], atol=1e-6)  # the other voice continues
    np.testing.assert_allclose(parts[-1], expected[-704:-640], atol=1e-6)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_whatever_is_asked_of_voices_each_minds_its_own_business(
    seed: int, strike: Strike, small_info: Info, initial_m: Initial
) -> None:
    """The mix is the sum of what each voice is alone, when the same is asked of it at the same frames."""

    def chosen(number: int) -> Voice:
        choice = np.random.default_rng([seed, number])
        pickup = "velocity" if choice.random() < 0.4 else "displacement"
        ear = Ear((choice.uniform(0.1, 0.9),) * choice.integers(1, 3), pickup, int(choice.choice([0, 0, 5])))
        pluck, gain = Pluck(choice.uniform(0.1, 0.9), choice.uniform(1, 12)), float(choice.choice([0.0, 0.5, 1.0]))
        kind = choice.choice(["knowing", "hinted", "steel", "truth", "samples"])
        if kind == "samples":
            voice = voice_of(choice.uniform(-1, 1, (6000, 1)).astype(np.float32))
            voice.start_with_gain(gain)
        elif kind == "truth":
            info = small_info(True)
            voice = Voice(truth_program(info, RATE_HZ), initial_m(info, pluck), ear, gain)
        else:
            name = {"knowing": KNOWING, "hinted": HINTED, "steel": STEEL}[str(kind)]
            voice = strike(name, pluck, ear=ear, gain=gain)
        voice.begin_at(int(choice.integers(0, 4000)))
        if choice.random() < 0.3:
            voice.skip(choice.uniform(0.1, 0.5), Mixer(RATE_HZ))
        return voice

    def rendered(numbers: list[int]) -> Signal:
        mixer, voices = Mixer(RATE_HZ, limited=False), {number: chosen(number) for number in numbers}
        mixer.add(*voices.values())
        parts = []
        for step in range(24):
            for number, voice in voices.items():
                choice = np.random.default_rng([seed, number, step])
                what = choice.integers(0, 12)
                if what < 3:
                    voice.set_gain(float(choice.choice([0.0, 0.3, 1.0])))
                elif what == 3:
                    points = tuple(choice.uniform(0, 1, len(voice.ear.points)))
                    voice.listen(Ear(points, voice.ear.pickup, int(choice.choice([0, 0, 3]))))
                elif what == 4:
                    voice.release(0.02)
            parts.append(mixer.render(1024))
        assert mixer.new_gaps() == []
        return np.concatenate(parts).astype(np.float64)

    everyone = list(range(8))
    alone = sum(rendered([number]) for number in everyone)
    np.testing.assert_allclose(rendered(everyone), alone, atol=2e-6)


def test_a_gain_is_reached_by_a_fade_without_corners_and_changes_on_its_way_without_steps() -> None:
    """Where a loud string is stopped within 6 ms, a corner would be a click."""
    voice = constant()
    mixer = mixer_of(voice)
    mixer.render(1000)
    voice.set_gain(0.25)
    found = mixer.render(2000)[:, 0]
    first = int(np.argmax(found != 0.5))
    assert first < QUANTUM and voice.sounding
    np.testing.assert_allclose(found[first : first + FADE], 0.5 * (1 - 0.75 * faded(FADE)), atol=1e-7)
    np.testing.assert_array_equal(found[first + FADE :], np.float32(0.125))
    assert np.abs(np.diff(found.astype(np.float64), 2)).max() < 0.375 * 6 / FADE**2 * 1.05
    parts = []
    for gain in (0.0, 1.0, 0.3, 0.3, 2.0):
        voice.set_gain(gain)
        parts.append(mixer.render(300)[:, 0])
    parts.append(mixer.render(2000)[:, 0])
    assert np.abs(np.diff(np.concatenate(parts))).max() < 0.5 * 2.0 * 1.5 / FADE * 1.01
    assert parts[-1][-1] == 1.0


@pytest.mark.parametrize("frame", [0, 1, 63, 64, 641])
def test_it_begins_at_its_frame_and_is_released_at_its_quantum(frame: int) -> None:
    voice = constant()
    voice.begin_at(frame)
    voice.release_at(1000)
    assert not voice.sounding
    found = mixer_of(voice).render(2048 + FADE)[:, 0]
    assert int(np.argmax(found != 0)) == frame == voice.began_frame
    end = (1000 - frame + QUANTUM - 1) // QUANTUM * QUANTUM + frame
    np.testing.assert_array_equal(found[frame : min(end, 1000)], 0.5)
    assert voice.over and not found[1024 + QUANTUM + FADE :].any()


def test_a_release_fades_for_its_time_and_one_before_the_beginning_is_silence(strike: Strike, rung: Rung) -> None:
    voice, waiting, unheard = constant(), constant(), strike(KNOWING, gain=0.0)
    waiting.begin_at(10_000)
    mixer = mixer_of(voice, waiting)
    mixer.render(640)
    voice.release(0.01)
    voice.release(1.0)  # the one under way continues
    waiting.release(0.1)
    unheard.release(1.0)
    found = mixer.render(20_000)[:, 0]
    np.testing.assert_allclose(found[:480], 0.5 * (1 - faded(480)), atol=1e-7)
    assert not found[480:].any()
    rung(64, unheard)
    assert voice.over and waiting.over and unheard.over and mixer.voices == []


@pytest.mark.parametrize("rate_hz", [44_100, 192_000])
@pytest.mark.parametrize("what", ["another place", "silence"])
def test_fades_last_as_long_at_any_rate(what: str, rate_hz: int) -> None:
    """Of a string that all but stands still meanwhile, so that every change of gain can be seen."""
    slow = StringParameters(
        length_m=2.0, density_kg_m3=20_000.0, tension_n=1e-3, youngs_modulus_pa=1e6, damping_d1_kg_m_s=0.0
    )
    program = solver_program(resonator_of(slow, 1, tension_modulated=False), rate_hz)
    voice = Voice(program, Pluck(0.5).displacement(program.grid_points), Ear((0.5,)))
    voice.begin_at_once()
    mixer, frames, first = mixer_of(voice, rate_hz=rate_hz), round(0.02 * rate_hz), 0
    if what == "silence":
        voice.record["silent"], first = 0.0, QUANTUM  # louder than it is
    else:
        mixer.render(4 * QUANTUM)
        assert voice.listen(Ear((0.0,)))
    found = mixer.render(frames + 8 * QUANTUM)[:, 0]
    expected = 1 - (faded(frames) if what == "silence" else np.arange(frames) / frames)
    np.testing.assert_allclose(found[first : first + frames] / found[0], expected, atol=2e-3)
    assert np.abs(found[first + frames :]).max() < 1e-6
    assert voice.over == (what == "silence")
