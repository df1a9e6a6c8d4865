"""What all voices share: blocks, gains, listening points, beginning and end; samples of others; files."""

import math
from dataclasses import replace

import numpy as np
import pytest
import soxr

from engine.kernels.constants import QUANTUM
from engine.kernels.fields import record_of
from engine.kernels.voice_records import BANK_PROGRAM
from engine.levels import FULL_SCALE_M, FULL_SCALE_M_S
from engine.pluck import Pluck
from engine.presets import load_preset
from engine.sources import ModelSource, Runaway
from engine.values.ear import Ear
from engine.voices import Mixer, Program, Voice, model_program, plain_program, render_voice
from engine.voices.ear import REACH_FRAMES, weights_of
from engine.voices.program import voice_ends_s
from engine.voices.programs import rendered_program, truth_program
from engine.voices.voice import END_FADE_S, FADE_S
from tests.engine import sounds
from tests.engine.sounds import EAR, KNOWING, RATE_HZ, initial_m, mixer_of, rung, shipped, small, strike, voice_of

FADE = round(FADE_S * RATE_HZ)
KINDS = pytest.mark.parametrize("kind", ["bank", "truth"])
PICKUPS = pytest.mark.parametrize("pickup", ["displacement", "velocity"])


def struck(kind: str, ear: Ear = EAR, gain: float = 1.0, rate_hz: int = RATE_HZ) -> Voice:
    if kind != "truth":
        return strike({"bank": KNOWING, "tension": "studio_any_string"}[kind], rate_hz=rate_hz, ear=ear, gain=gain)
    info = small(True)
    return Voice(truth_program(info, rate_hz), initial_m(info, Pluck(0.3)), ear, gain)


def constant(frames: int = 48_000, level: float = 0.5, rate_hz: int = RATE_HZ) -> Voice:
    """It shows every change of gain."""
    return voice_of(np.full((frames, 1), level, np.float32), rate_hz=rate_hz)


@KINDS
@PICKUPS
def test_any_splitting_into_blocks_is_the_same(kind, pickup):
    def rendered(sizes: list[int]) -> sounds.Signal:
        mixer = mixer_of(struck(kind, Ear((0.3, 0.6), pickup)), limited=True)
        return np.concatenate([mixer.render(size) for size in sizes])

    sizes = [int(size) for size in np.random.default_rng(0).integers(1, 400, 40)]
    whole = rendered([sum(sizes)])
    np.testing.assert_array_equal(rendered(sizes), whole)
    np.testing.assert_array_equal(rendered([1] * 200), whole[:200])


@KINDS
@pytest.mark.parametrize("solo", [0, 3])
def test_velocity_is_the_derivative_of_displacement(kind, solo, derivative):
    points = (0.3, 0.6)
    displacement = rung(9600, struck(kind, Ear(points, solo=solo)), attack=False)
    found = rung(9600, struck(kind, Ear(points, "velocity", solo)), attack=False)
    expected = derivative(displacement * FULL_SCALE_M, RATE_HZ) / FULL_SCALE_M_S
    inner = slice(0, 9600 - REACH_FRAMES)
    np.testing.assert_allclose(found[inner], expected[inner], atol=3e-5 * np.abs(expected).max())


@KINDS
@PICKUPS
@pytest.mark.parametrize("skipped", [False, True])
def test_what_was_not_heard_is_where_it_would_have_been(kind, pickup, skipped):
    """It fades in, without anything of what sounded meanwhile; what is skipped is not even waited for."""
    ear, frames, arrived = Ear((0.37,), pickup), 150 * QUANTUM, FADE + 4 * QUANTUM
    expected = rung(frames + 12_000, struck(kind, ear))[frames:]
    voice, mixer = struck(kind, ear, 1.0 if skipped else 0.0), Mixer(RATE_HZ, limited=False)
    if skipped:
        Mixer(RATE_HZ).skip(voice, frames / RATE_HZ)
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


@pytest.mark.parametrize(("kind", "rate_hz"), [("bank", 48_000), ("truth", 44_100), ("truth", 192_000)])
@pytest.mark.parametrize("solo", [0, 2])
def test_another_listening_point_is_faded_to_and_then_exact(kind, rate_hz, solo):
    here, there = Ear((0.3, 0.6)), Ear((0.45, 0.2), solo=solo)
    moved, frames = struck(kind, here, rate_hz=rate_hz), round(0.02 * rate_hz)
    mixer = mixer_of(moved, rate_hz=rate_hz)
    mixer.render(1920)
    assert moved.listen(there)
    assert not moved.listen(here), "a fade is under way"
    found = mixer.render(4800).astype(np.float64)
    before, after = (rung(6720, struck(kind, ear, rate_hz=rate_hz))[1920:] for ear in (here, there))
    share = np.minimum(np.arange(1, 4801) / frames, 1.0)[:, None]
    np.testing.assert_allclose(found, before + share * (after - before), atol=1e-6)
    if kind == "truth":
        np.testing.assert_array_equal(found[frames:], after[frames:])
    assert moved.listen(here)


@pytest.mark.parametrize("gain", [0.0, 1.0])
@pytest.mark.parametrize("kind", ["bank", "truth", "tension"])
def test_what_has_become_silent_ends_by_itself(kind, gain):
    voice = struck(kind, gain=gain)
    mixer, level, found = mixer_of(voice), np.inf, np.zeros((1, 2), np.float32)
    while not voice.over and voice.seconds < 40:
        level, found = float(np.abs(found).max()), mixer.render(9600)
    assert voice.over
    assert level < 1e-4
    assert voice.level_db < -100


@KINDS
@PICKUPS
@pytest.mark.parametrize("frame", [1, 700, 1023])
def test_one_that_begins_within_a_quantum_is_the_same_sound_to_its_end(kind, pickup, frame):
    """All of it, with a change of gain and the release, later by so many frames."""

    def rendered(begins: int) -> sounds.Signal:
        voice, mixer = struck(kind, Ear((0.3, 0.6), pickup)), Mixer(RATE_HZ, limited=False)
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


@pytest.mark.parametrize("value", [float("nan"), 1e30, 50.0])
def test_a_runaway_never_reaches_the_mix(value):
    """A number of the model is spoilt: what nobody believes is found out before it is heard."""
    preset = shipped(KNOWING)
    program = model_program(preset, RATE_HZ)
    own = record_of(program.memory, BANK_PROGRAM)
    if value == 50.0:  # one latent grows
        program.memory[own["sigma"] + 2] = -value / RATE_HZ
    else:
        program.memory[own["omega"] + 3] = value
    initial = initial_m(preset.info, Pluck(0.3))
    wild, parts = Voice(program, initial, EAR), []
    mixer = mixer_of(wild, strike(sounds.STEEL))
    while not wild.over and mixer.seconds < 3:
        parts.append(mixer.render(64))
    assert wild.ran_away
    assert [gap.cause for gap in mixer.new_gaps()] == ["runaway"]
    largest = 20 * float(np.abs(initial).max()) / FULL_SCALE_M + 1
    assert np.abs(np.concatenate(parts)).max() <= largest
    expected = rung(len(parts) * 64 + 640, strike(sounds.STEEL))
    np.testing.assert_allclose(mixer.render(640), expected[-640:], atol=1e-6)  # the other voice continues
    np.testing.assert_allclose(parts[-1], expected[-704:-640], atol=1e-6)


def test_a_gain_is_reached_by_a_fade_without_corners_and_changes_on_its_way_without_steps():
    """Where a loud string is stopped within 6 ms, a corner would be a click."""
    voice = constant()
    mixer = mixer_of(voice)
    mixer.render(1000)
    voice.set_gain(0.25)
    found = mixer.render(2000)[:, 0]
    first = int(np.argmax(found != 0.5))
    assert first < QUANTUM and voice.sounding
    np.testing.assert_allclose(found[first : first + FADE], 0.5 * (1 - 0.75 * sounds.faded(FADE)), atol=1e-7)
    np.testing.assert_array_equal(found[first + FADE :], np.float32(0.125))
    assert np.abs(np.diff(found.astype(np.float64), 2)).max() < 0.375 * 6 / FADE**2 * 1.05
    parts = []
    for gain, frames in ((0.0, 300), (1.0, 300), (0.3, 300), (0.3, 300), (2.0, 2300)):
        voice.set_gain(gain)
        parts.append(mixer.render(frames)[:, 0])
    assert np.abs(np.diff(np.concatenate(parts))).max() < 0.5 * 2.0 * 1.5 / FADE * 1.01
    assert parts[-1][-1] == 1.0


@pytest.mark.parametrize("rate_hz", [44_100, 48_000, 192_000])
def test_a_release_fades_for_its_time_and_one_before_the_beginning_is_silence(rate_hz):
    voice, waiting = (constant(rate_hz=rate_hz) for _ in range(2))
    waiting.begin_at(10_000)
    mixer, frames = mixer_of(voice, waiting, rate_hz=rate_hz), round(0.01 * rate_hz)
    mixer.render(640)
    voice.release(0.01)
    voice.release(1.0)  # the one under way continues
    waiting.release(0.1)
    found = mixer.render(20_000)[:, 0]
    np.testing.assert_allclose(found[:frames], 0.5 * (1 - sounds.faded(frames)), atol=1e-7)
    assert not found[frames:].any()
    assert voice.over and waiting.over and mixer.voices == []
    timed = constant()
    timed.begin_at(641)
    timed.release_at(1000)
    found = mixer_of(timed).render(2048 + FADE)[:, 0]
    assert int(np.argmax(found != 0)) == 641 == timed.began_frame
    np.testing.assert_array_equal(found[641:1000], 0.5)
    assert timed.over and not found[1024 + QUANTUM + FADE :].any()


def band_limited(rate_hz: int, seconds: float) -> sounds.Samples:
    """Cosines up to 0.7 of half the rate: even about the first sample, as a string at rest is."""
    time_s = np.arange(round(seconds * rate_hz)) / rate_hz
    rates_hz = np.linspace(0.01, 0.35, 12) * rate_hz
    return (0.05 * np.cos(2 * np.pi * rates_hz * time_s[:, None]).sum(1, keepdims=True)).astype(np.float32)


def empty(
    seconds: float, pickup: str = "displacement", program: Program | None = None, source_hz: int = RATE_HZ
) -> Voice:
    """A voice of samples of which there are none yet."""
    program, ear = program or plain_program(RATE_HZ), Ear((0.5,), pickup)
    voice = Voice(program, np.full(41, FULL_SCALE_M), ear, 1.0, seconds, source_hz)
    voice.never_ends()
    return voice


@pytest.mark.parametrize("points", [1, 2])
def test_equal_rates_leave_each_sample_as_it_is_and_a_loop_has_no_seam(points):
    samples = sounds.noise(5000, points)
    once, loop = (Voice.of_samples(plain_program(RATE_HZ), each) for each in (samples, samples[:1000]))
    found = rung(6000, once, attack=False)
    np.testing.assert_array_equal(found[:5000], np.broadcast_to(samples, (5000, 2)))
    assert not found[5100:].any() and once.listen(EAR)  # it stays as it is
    loop.loop()
    rounds = np.broadcast_to(np.tile(samples[:1000], (4, 1)), (4000, 2))
    np.testing.assert_array_equal(rung(3500, loop, attack=False), rounds[:3500])


@pytest.mark.parametrize(("source_hz", "rate_hz"), [(4_000, 48_000), (16_000, 44_100), (48_000, 44_100)])
def test_other_rates_are_what_soxr_makes_of_them(source_hz, rate_hz):
    info, samples = replace(small(True), rate_hz=source_hz), band_limited(source_hz, 0.5)
    voice = empty(0.5, program=rendered_program(info, rate_hz), source_hz=source_hz)
    voice.append(samples)
    voice.end_here()
    found = rung(rate_hz // 2, voice, attack=False)[:, 0]
    expected = soxr.resample(samples[:, 0].astype(np.float64), source_hz, rate_hz, "VHQ")
    inner = slice(rate_hz // 20, rate_hz * 9 // 20)  # both begin and end in their own way
    assert 20 * np.log10(sounds.relative(found[inner], expected[inner])) < -90


@PICKUPS
def test_what_starves_fades_stands_still_and_goes_on_where_it_was(pickup):
    samples = np.concatenate([band_limited(RATE_HZ, 0.1), np.zeros((100, 1), np.float32)])
    voice, whole = empty(0.1, pickup), empty(0.1, pickup)
    whole.append(samples)
    expected = mixer_of(whole).render(4096)[:, 0]
    voice.append(samples[:1500])
    mixer = mixer_of(voice)
    before = mixer.render(2048)[:, 0]
    assert voice.starved_s > 0
    assert [gap.cause for gap in mixer.new_gaps()] == ["rendering"]
    stood_at, reach = round(voice.seconds * RATE_HZ), 2 * QUANTUM  # a filter of velocities looks back and ahead
    voice.append(samples[1500:])
    after = mixer.render(2048)[:, 0]
    np.testing.assert_array_equal(before[: stood_at - reach], expected[: stood_at - reach])
    assert not before[stood_at + reach :].any()
    np.testing.assert_allclose(after[192:1024], expected[stood_at + 192 : stood_at + 1024], atol=1e-6)
    mixer.render(8192)
    assert mixer.new_gaps() == []  # its samples have come to their end


PRESET = shipped(KNOWING)
SECONDS, CD_HZ = 0.2, 44_100


def program_of(kind: str) -> Program:
    return truth_program(PRESET.info, CD_HZ) if kind == "truth" else model_program(PRESET, CD_HZ)


def test_a_model_that_is_no_bank_is_rendered_and_converted(small_preset):
    preset, ear = load_preset(small_preset), Ear((0.3, 0.6))
    info, source = preset.info, ModelSource(preset)
    assert model_program(preset, CD_HZ).rendered
    found = render_voice(rendered_program(info, info.rate_hz), source, info, sounds.PLUCK, ear, SECONDS)
    let_go_m, weights = initial_m(info, sounds.PLUCK), weights_of(ear, info.grid_points)
    frames_m, _ = source.advance(source.start(let_go_m[None]), len(found) - 1, weights)
    expected = np.concatenate([(let_go_m @ weights)[None], frames_m[0]]) / FULL_SCALE_M
    attack = round(0.002 * info.rate_hz)
    np.testing.assert_allclose(found[attack:], expected[attack:], atol=1e-6)  # its own rate: as it is
    higher = render_voice(rendered_program(info, 48_000), source, info, sounds.PLUCK, ear, SECONDS)
    np.testing.assert_allclose(higher[::12][attack:-4], found[attack:-4], atol=1e-5)


def test_progress_may_end_it_and_a_runaway_is_reported_with_its_time():
    shares: list[float] = []
    program, source = program_of("bank"), ModelSource(PRESET)
    render_voice(program, source, PRESET.info, sounds.PLUCK, EAR, SECONDS, shares.append)
    assert shares == sorted(shares)
    assert shares[-1] == 1.0

    def refuse(share: float) -> None:
        raise InterruptedError

    with pytest.raises(InterruptedError):
        render_voice(program, source, PRESET.info, sounds.PLUCK, EAR, SECONDS, refuse)
    program.memory[record_of(program.memory, BANK_PROGRAM)["sigma"]] = -5e-3  # an e-fold in 50 ms
    with pytest.raises(Runaway) as caught:
        render_voice(program, source, PRESET.info, sounds.PLUCK, EAR, 2.0)
    assert 0.05 < caught.value.time_s < 1.0


def undying() -> Program:
    """Of a model that does not decay, whose voice ends after 0.3 s."""
    program = program_of("bank")
    program.memory[record_of(program.memory, BANK_PROGRAM)["sigma"] :][: program.modes] = 1e-9
    return replace(program, ends_s=0.3)


@pytest.mark.parametrize("ear", [EAR, Ear((0.3, 0.6), "velocity", 2)])
def test_a_voice_ends_though_its_model_hums_on(ear):
    program, given = undying(), (ModelSource(PRESET), PRESET.info, sounds.PLUCK, ear)
    found = render_voice(program, *given, 1.0)
    endless = render_voice(replace(program, ends_s=math.inf), *given, 1.0)
    assert np.abs(endless[-CD_HZ // 10 :]).max() > 1e-3
    first, faded = -(-round(0.3 * CD_HZ) // QUANTUM) * QUANTUM, round(END_FADE_S * CD_HZ)
    done = (np.arange(len(found)) - first + 1).clip(0, faded)[:, None] / faded
    np.testing.assert_array_equal(found[:first], endless[:first])
    np.testing.assert_allclose(found, (1 - done**2 * (3 - 2 * done)) * endless, atol=1e-7)
    assert first + faded < len(render_voice(program, *given, 5.0, until_db=60.0)) < CD_HZ


def test_it_ends_where_its_string_is_silent_and_not_within_its_training():
    info = PRESET.info
    slowest = float(info.resonator.sigma.min())
    assert voice_ends_s(info) == pytest.approx(2 * math.log(1e3) / slowest)  # twice 60 dB
    for program in (program_of("bank"), rendered_program(info, CD_HZ)):
        assert program.ends_s == voice_ends_s(info)
    assert program_of("truth").ends_s == math.inf
    damped = replace(info, string=replace(info.string, damping_d1_kg_m_s=1e3 * info.string.damping_d1_kg_m_s))
    assert voice_ends_s(damped) == info.horizon_s
    endless = replace(info, string=replace(info.string, damping_d1_kg_m_s=0.0, damping_d3_kg_m_s=0.0))
    assert voice_ends_s(endless) == math.inf
