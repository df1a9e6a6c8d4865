"""Which key means what, without any window."""

import pytest

from app.playing import keyboard
from app.playing.keyboard import HIGHEST_PLACE, LOWEST_C, LOWEST_PLACE, KeyPress, PluckRange
from engine.pluck import Pluck
from engine.presets import find_preset, read_info

REACH = PluckRange((0.3, 0.7), (1.0, 10.0))
EVERY_OCTAVE = range(keyboard.LOWEST_OCTAVE, keyboard.HIGHEST_OCTAVE + 1)


def test_digits_and_c_and_v_set_the_amplitude_and_others_nothing():
    levels = [REACH.turned(KeyPress(digit), 4.0) or 0.0 for digit in "123456789"]
    assert levels == sorted(levels) and (levels[0], levels[-1]) == pytest.approx((1.0, 10.0))
    softer, harder, hardest = (
        REACH.turned(KeyPress(key), mm) or 0.0 for key, mm in (("c", 4.0), ("V", 4.0), ("V", 10))
    )
    assert softer < 4 < harder and hardest == 10
    for letter in ("X", "0", " ", "", "É"):
        assert REACH.turned(KeyPress(letter), 4.0) is keyboard.place_of(KeyPress(letter), "darwin") is None


def test_keys_of_a_single_string_are_places_and_velocity_is_amplitude_in_equal_steps_of_level():
    wide = Pluck(0.5, 4.0, "raised_cosine", 0.2)
    low, high, beyond = (REACH.pluck(*key, wide) for key in ((LOWEST_PLACE, 1), (HIGHEST_PLACE, 127), (127, 127)))
    assert (low.position, low.amplitude_mm, low.shape, low.width) == pytest.approx((0.3, 1, "raised_cosine", 0.2))
    assert (high.position, high.amplitude_mm) == pytest.approx((0.7, 10)) and beyond == high
    for velocity in (1, 40, 64, 127):
        assert REACH.velocity_of(REACH.amplitude_of(velocity)) == velocity
    assert (REACH.amplitude_of(64), REACH.amplitude_of(999), REACH.velocity_of(0.0)) == (3.1623, 10, 1)


def test_reach_is_what_a_preset_was_trained_on(small_preset):
    assert PluckRange.of(read_info(small_preset)) == REACH
    assert PluckRange.of(None).position == (0.05, 0.95)
    nylon, harp = (read_info(find_preset(name)) for name in ("studio_any_string", "studio_any_harp_c6"))
    assert PluckRange.of(nylon) == PluckRange((0.06, 0.94), (0.5, 10.0))
    low_mm, high_mm = PluckRange.of(harp).amplitude_mm
    assert low_mm == 0.5 and harp.tension_rise(Pluck(amplitude_mm=high_mm)) == pytest.approx(0.5)


def test_octaves_are_those_in_which_a_key_sounds_and_the_nearest_has_most_keys():
    """Compared with every octave tried; a range that no key reaches has the nearest."""
    for low in range(0, 108, 7):
        for high in (min(low + keys, 107) for keys in (0, 1, 11, 40)):
            played = {octave: range(LOWEST_C + 12 * octave, LOWEST_C + 12 * octave + 12) for octave in EVERY_OCTAVE}
            sounding = [octave for octave, keys in played.items() if set(keys) & set(range(low, high + 1))]
            assert keyboard.octaves_of(low, high) == (sounding[0], sounding[-1]), (low, high)
    assert keyboard.octaves_of(120, 127) == (keyboard.HIGHEST_OCTAVE, keyboard.HIGHEST_OCTAVE)
    assert [keyboard.octave_near(octave, range(40, 87)) for octave in (-4, 0, 2, 4)] == [0, 0, 2, 2]  # E2 to D6
    assert keyboard.octave_near(0, (50, 51, 52)) == 0
    assert keyboard.octave_near(3, range(120, 128)) == 3  # no octave has any of them
