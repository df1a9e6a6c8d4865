"""Which key means what, without any window."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.playing.keyboard import (
    HIGHEST_OCTAVE,
    HIGHEST_PLACE,
    LOWEST_C,
    LOWEST_OCTAVE,
    LOWEST_PLACE,
    KeyPress,
    PluckRange,
    letters_of,
    octave_near,
    octaves_of,
    place_of,
    semitone_of,
    turn,
)
from engine.pluck import Pluck
from engine.presets import find_preset, read_info

REACH = PluckRange((0.3, 0.7), (1.0, 10.0))


def test_the_row_goes_from_end_to_end_of_what_is_trained() -> None:
    assert [place_of(KeyPress(letter), "darwin") for letter in "ASDFGHJKL;"] == list(range(10))
    assert REACH.row == pytest.approx([0.3 + 0.4 * i / 9 for i in range(10)], abs=5e-5)


def test_keys_of_a_single_string_are_places_and_velocity_is_amplitude() -> None:
    wide = Pluck(0.5, 4.0, "raised_cosine", 0.2)
    low, high, beyond = (REACH.pluck(*key, wide) for key in ((LOWEST_PLACE, 1), (HIGHEST_PLACE, 127), (127, 127)))
    assert (low.position, low.amplitude_mm) == pytest.approx((0.3, 1))
    assert (high.position, high.amplitude_mm) == pytest.approx((0.7, 10))
    assert (low.shape, low.width) == ("raised_cosine", 0.2)
    assert beyond == high


@pytest.mark.parametrize(
    ("platform", "press", "place"),
    [
        ("linux", KeyPress("Q", 38), 0),  # AZERTY: Q is where A is elsewhere
        ("linux", KeyPress("A", 24), None),
        ("linux", KeyPress("", 47), 9),  # ö
        ("win32", KeyPress("Q", 0x1E), 0),
        ("darwin", KeyPress("d", 2), 2),  # its codes are not reported: the letter counts
        ("linux", KeyPress("q"), None),
        ("linux", KeyPress(""), None),
    ],
)
def test_keys_are_known_by_their_place(platform: str, press: KeyPress, place: int | None) -> None:
    assert place_of(press, platform) == place


def test_digits_and_c_and_v_set_the_amplitude() -> None:
    levels = [REACH.turned(KeyPress(digit), 4.0) or 0.0 for digit in "123456789"]
    assert levels == sorted(levels)
    assert (levels[0], levels[-1]) == pytest.approx((1.0, 10.0))
    harder, softer = REACH.turned(KeyPress("V"), 4.0), REACH.turned(KeyPress("c"), 4.0)
    assert harder is not None and softer is not None
    assert softer < 4 < harder
    assert REACH.turned(KeyPress("V"), 10.0) == 10


@pytest.mark.parametrize("letter", ["X", "0", " ", "", "É"])
def test_other_keys_are_left_alone(letter: str) -> None:
    assert REACH.turned(KeyPress(letter), 4.0) is None
    assert place_of(KeyPress(letter), "darwin") is None


def test_velocity_and_amplitude_go_back_and_forth_in_equal_steps_of_level() -> None:
    for velocity in (1, 40, 64, 127):
        assert REACH.velocity_of(REACH.amplitude_of(velocity)) == velocity
    assert REACH.amplitude_of(64) == 3.1623
    assert REACH.amplitude_of(999) == 10
    assert REACH.velocity_of(0.0) == 1


def test_what_is_played_is_round_and_within_reach() -> None:
    assert PluckRange((0.05, 0.95)).place(2 / 9) == 0.25
    odd = PluckRange((1 / 3, 2 / 3), (1 / 3, 2 / 3))
    assert (odd.place(0), odd.place(1)) == odd.position
    assert (odd.amplitude_of(1), odd.amplitude_of(127)) == odd.amplitude_mm


def test_reach_is_what_a_preset_was_trained_on(small_preset: Path) -> None:
    assert PluckRange.of(read_info(small_preset)) == PluckRange((0.3, 0.7), (1.0, 10.0))
    assert PluckRange.of(None).position == (0.05, 0.95)


def test_keys_of_a_model_of_many_strings_reach_as_hard_as_it_was_trained() -> None:
    """Up to the rise of tension; a string that bears more than the loudest key is played as any other."""
    nylon, harp = (read_info(find_preset(name)) for name in ("studio_any_string", "studio_any_harp_c6"))
    assert PluckRange.of(nylon) == PluckRange((0.06, 0.94), (0.5, 10.0))
    low_mm, high_mm = PluckRange.of(harp).amplitude_mm
    assert low_mm == 0.5
    assert harp.tension_rise(Pluck(amplitude_mm=high_mm)) == pytest.approx(0.5)


def test_two_rows_are_a_piano() -> None:
    played = [semitone_of(KeyPress(letter), "darwin") for letter in "AWSEDFTGYHUJKOLP;'"]
    assert played == list(range(18))
    assert semitone_of(KeyPress("Q"), "darwin") is None
    assert semitone_of(KeyPress("Q", 38), "linux") == 0  # AZERTY: by its place
    assert semitone_of(KeyPress("z", 25), "linux") == 1
    assert semitone_of(KeyPress("", 48), "linux") == 17
    assert letters_of(1)[LOWEST_C + 12] == "A"


def test_octave_and_velocity_keys_stay_within_bounds() -> None:
    assert turn(KeyPress("z"), 0, 90) == (-1, 90)
    assert turn(KeyPress("X"), HIGHEST_OCTAVE, 90) == (HIGHEST_OCTAVE, 90)
    assert turn(KeyPress("Z"), LOWEST_OCTAVE, 90) == (LOWEST_OCTAVE, 90)
    assert turn(KeyPress("9"), 0, 90) == (0, 127)
    assert turn(KeyPress("1"), 0, 90) == (0, 1)
    assert turn(KeyPress("v"), 0, 120) == (0, 127)
    assert turn(KeyPress("c"), 0, 5) == (0, 1)
    assert turn(KeyPress("m"), 0, 5) is None


@pytest.mark.parametrize("low", range(0, 108, 7))
@pytest.mark.parametrize("keys", [0, 1, 11, 40])
def test_octaves_are_those_in_which_a_key_sounds(low: int, keys: int) -> None:
    """Compared with every octave tried."""
    high = min(low + keys, 107)  # the last key of the highest octave
    own = range(12)  # further keys of the row are those of the next octave
    sounding = [
        octave
        for octave in range(LOWEST_OCTAVE, HIGHEST_OCTAVE + 1)
        if any(low <= LOWEST_C + 12 * octave + semitone <= high for semitone in own)
    ]
    assert octaves_of(low, high) == (sounding[0], sounding[-1])


def test_the_octave_is_the_nearest_with_most_keys() -> None:
    guitar, toms, three_pads = range(40, 87), range(36, 52), (50, 51, 52)  # E2 to D6, C2 to D♯3
    assert [octave_near(octave, guitar) for octave in (-4, -1, 0, 2, 4)] == [0, 0, 0, 2, 2]
    assert [octave_near(octave, toms) for octave in (-4, 0, 4)] == [-1, -1, -1]
    assert octave_near(0, three_pads) == 0
    assert octave_near(3, range(120, 128)) == 3, "no octave has any of them"


def test_a_range_that_no_key_reaches_has_the_nearest_octave() -> None:
    assert octaves_of(120, 127) == (HIGHEST_OCTAVE, HIGHEST_OCTAVE)
