"""Gestures measured on rendered sound, against closed forms: hammers, touches, mutes, vibrato, courses, clicks."""

import math
from typing import Any

import numpy as np
import pytest
import scipy.signal
from scipy.ndimage import uniform_filter1d

from app.instruments.instrument import Course, Instrument, Pickup
from app.player.events import ControlChange, NoteOff, NoteOn
from engine.excitation import blow_factor
from engine.kernels import constants as of
from engine.kernels.constants import QUANTUM
from engine.kernels.midi import MOD_WHEEL, SOFT
from engine.kernels.playing.notes import PLUCK_STOPS_S
from engine.kernels.pulses import spectrum
from engine.kernels.strings import MUTED_M, MUTED_SIGMA
from engine.levels import FULL_SCALE_M
from engine.resonators.string import resonator_of
from engine.values.ear import Ear
from engine.voices.ear import weights_of
from tests.app.player.conftest import STEEL
from tests.app.player.seen import seen
from tests.app.player.stage import KEY, PRESET, RATE_HZ, Sound, Stage, changed, hz_of, partial, play, string_of

SOURCES = pytest.mark.parametrize("source", ["model", "truth"])
HAMMER = {"shape": "raised_cosine", "width": 0.1, "width_hard": 0.1, "strikes": True, "stops": False}
LENGTH_M = STEEL.length_m * STEEL.pitch_hz / hz_of(KEY)  # of the key's string, about


def test_a_hammer_starts_the_string_from_rest_with_speeds(instrument):
    """Against modes in closed form, of a blow so soft that the string is linear."""
    blow = {**HAMMER, "softest_mm": 1e-3, "hardest_mm": 1e-3, "release_ms": 2.0, "release_hard_ms": 2.0}
    heard = changed(instrument, pluck=blow, pickup=Pickup(points=(0.37,)))
    found, stage = string_of(heard, 57), Stage(heard)
    stage.play(NoteOn(57, 64))
    modes = resonator_of(found.parameters, found.modes, grid_points=PRESET.info.grid_points)
    shape = heard.pluck.pluck(64).displacement(modes.points)
    amplitudes = modes.to_modes(shape) * found.shortened * blow_factor(modes.omega, shape / 1e-6)
    amplitudes *= spectrum(modes.omega * 1e-3 / np.pi) * (modes.shapes @ weights_of(Ear((0.37,)), modes.points))[:, 0]
    t = np.arange(9_600) / RATE_HZ
    motion = np.exp(np.outer(t, 1j * np.sqrt(modes.omega**2 - modes.sigma**2) - modes.sigma)).imag
    expected = stage.begun[0].gain / FULL_SCALE_M * motion @ amplitudes
    for source in ("model", "truth"):
        sound = play(heard, 0.2, (0.0, NoteOn(57, 64)), source=source)
        np.testing.assert_allclose(sound[200:], expected[200:], atol=1e-3 * np.abs(expected).max())


INAUDIBLE_DB = -95.0


def bursts_db(sound: Sound, begin_s: float) -> Sound:
    """The loudest millisecond of each high band within 15 ms, in dB of full scale."""
    begin, found = round(begin_s * RATE_HZ), []
    for band_hz in ((2_000, 5_000), (5_000, 10_000), (10_000, 20_000)):
        band = scipy.signal.butter(4, band_hz, "band", fs=RATE_HZ, output="sos")
        powers = uniform_filter1d(scipy.signal.sosfilt(band, sound)[begin : begin + 720] ** 2, 48)
        found.append(10 * np.log10(powers.max() + 1e-30))
    return np.array(found)


@SOURCES
@pytest.mark.parametrize("kind", ["displacement", "velocity"])
@pytest.mark.parametrize("second", [127, 30])
def test_a_string_that_is_stopped_by_the_next_pluck_makes_no_click(instrument, kind, second, source):
    heard = changed(instrument, pickup=Pickup(points=(0.3,), kind=kind))
    one, other = (0.0, NoteOn(45, 127)), (0.4, NoteOn(45, second))
    alone, fresh, both = (play(heard, 0.5, *each, source=source) for each in ((one,), (other,), (one, other)))
    stopped = both - fresh
    np.testing.assert_array_equal(stopped[:19_200], alone[:19_200])
    end = round((0.4 + PLUCK_STOPS_S) * RATE_HZ) + QUANTUM
    np.testing.assert_allclose(stopped[end:], 0, atol=1e-7)
    allowed = np.maximum(np.maximum(bursts_db(fresh, 0.4), bursts_db(alone, 0.38)), INAUDIBLE_DB)
    assert (bursts_db(stopped, 0.4) <= allowed).all()


@SOURCES
def test_a_palm_mute_adds_the_decay_of_a_hand_at_the_bridge(instrument, source):
    soft, pressed = (0.0, NoteOn(KEY, 10)), (0.0, ControlChange(SOFT, 64))
    plain, muted = (play(instrument, 0.6, *each, source=source) for each in ((soft,), (pressed, soft)))
    for number in (1, 2, 4):
        turn = 2 * math.pi * number * MUTED_M / LENGTH_M
        sigma = 64 / 127 * MUTED_SIGMA * (1 - math.sin(turn) / turn)
        ratios = [
            partial(muted, t, number * hz_of(KEY), 8_192) / partial(plain, t, number * hz_of(KEY), 8_192)
            for t in (0.02, 0.08)
        ]
        assert -math.log(ratios[1] / ratios[0]) / 0.06 == pytest.approx(sigma, rel=0.12), number


@SOURCES
@pytest.mark.parametrize("bend_by", ["tension", "length"])
def test_vibrato_is_as_wide_and_as_quick_as_it_says(instrument, bend_by, source):
    wheeled = changed(instrument, mod_wheel="technique.vibrato_cents", bend_by=bend_by)
    sound = play(wheeled, 2.0, (0.0, ControlChange(MOD_WHEEL, 127)), (0.0, NoteOn(KEY, 20)), source=source)
    near = scipy.signal.butter(2, [0.7 * hz_of(KEY), 1.4 * hz_of(KEY)], "bandpass", fs=RATE_HZ, output="sos")
    phase = np.unwrap(np.angle(scipy.signal.hilbert(scipy.signal.sosfiltfilt(near, sound))))
    slow = scipy.signal.butter(2, 30, fs=RATE_HZ, output="sos")
    hz = scipy.signal.sosfiltfilt(slow, np.gradient(phase) * RATE_HZ / math.tau)[RATE_HZ // 2 : 3 * RATE_HZ // 2]
    found = 1200 * np.log2(hz / hz_of(KEY))
    assert found.max() - found.min() == pytest.approx(70, rel=0.15)
    assert np.count_nonzero(np.diff(np.sign(found - found.mean())) > 0) == pytest.approx(5.5, abs=1)


def test_strings_of_a_course_sound_one_after_the_other_and_are_one_note(instrument):
    apart = changed(instrument, course=Course(strings=2, apart_ms=25))
    sound, one = (play(each, 0.3, (0.0, NoteOn(KEY, 90))) for each in (apart, instrument))
    late = round(0.025 * RATE_HZ)
    np.testing.assert_allclose(sound[: late - 1], one[: late - 1] / 2, atol=1e-6)
    np.testing.assert_allclose(sound[late:], (one[late:] + one[:-late]) / 2, atol=2e-3 * np.abs(one).max())
    stage = Stage(apart)
    stage.run([(0, NoteOn(KEY, 90)), (9_600, NoteOff(KEY))], 4 * RATE_HZ, 4_096)
    assert [each.kind for each in stage.reports] == [of.BEGAN, of.ENDED] and seen(stage.player) == []


def test_low_courses_of_a_set_have_octave_strings(guitar):
    stage = Stage(changed(guitar, course=Course(strings=2, octaves=4)))
    stage.play(NoteOn(41, 60), NoteOn(66, 60))
    notes = seen(stage.player)
    low, high = ([n.now.undamped_frequency(1) for n in notes if n.key == key] for key in (41, 66))
    assert max(low) / min(low) == pytest.approx(2, rel=1e-4)
    assert high[1] == pytest.approx(high[0], rel=1e-9)
    assert min(notes, key=lambda note: note.own.area_m2).key == 41


def picked_up(instrument: Instrument, point: float, velocity: int, source: str, **pickup: Any) -> Sound:
    heard = changed(instrument, pickup=Pickup(points=(point,), kind="velocity", **pickup))
    return play(heard, 0.8, (0.0, NoteOn(KEY, velocity)), source=source)


@SOURCES
def test_an_aperture_averages_over_its_length(instrument, source):
    narrow, wide = (picked_up(instrument, 0.13, 20, source, aperture_mm=each) for each in (0.0, 60.0))
    ratios = [partial(wide, 0.05, n * hz_of(KEY)) / partial(narrow, 0.05, n * hz_of(KEY)) for n in (1, 2, 3, 4)]
    expected = np.sinc(np.arange(1, 5) * 0.03 / string_of(instrument, KEY).parameters.length_m)
    np.testing.assert_allclose(np.array(ratios) / ratios[0], expected / expected[0], rtol=1e-4)


@SOURCES
def test_flux_that_grows_faster_near_the_pick_up_adds_harmonics(instrument, source):
    """A node of the second partial hears it by the curve alone: half of x/δ, as of exp(x/δ) differentiated."""
    linear, curved = (picked_up(instrument, 0.5, 60, source, flux_mm=each) for each in (0.0, 8.0))
    assert partial(curved, 0.2, 2 * hz_of(KEY)) > 20 * partial(linear, 0.2, 2 * hz_of(KEY))
    soft, softly = (picked_up(instrument, 0.5, 1, source, flux_mm=each) for each in (0.0, 100.0))
    assert np.abs(soft - softly).max() < 0.01 * np.abs(soft).max()
