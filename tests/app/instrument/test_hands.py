"""Where wheels and pedals stand, by the messages of MIDI; and what a patch then sounds like on each string."""

from __future__ import annotations

from dataclasses import replace
from math import log2

import pytest

from app.instrument.events import (
    FINE_OTHER,
    FINE_REGISTERED,
    FINE_VALUE,
    KEYS,
    MOD_WHEEL,
    NOTES_OFF,
    OTHER,
    REGISTERED,
    RESET,
    SLIDE,
    SUSTAIN,
    VALUE,
    Bend,
    Controller,
    Event,
    NoteOff,
    NoteOn,
    let_go,
)
from app.instrument.hands import WIDEST_SEMITONES
from app.instrument.player import Player, Struck
from app.instrument.strings import pitch_hz_of
from app.patches.patch import Knobs, OpenString, Patch, StringSet
from engine.presets import Preset
from tests.app.instrument.conftest import STEEL, physical

RATE_HZ = 48_000
OPEN = (40, 45, 50, 55, 59, 64)
HIGH_E, B, G, LOW_E = 0, 1, 2, 5  # channels of a guitar


def changed(patch: Patch, **parts: object) -> Patch:
    return Patch.model_validate({**dict(patch), **parts})


def range_of_bends(semitones: int, cents: int = 0, channel: int = 0) -> list[Event]:
    messages = ((REGISTERED, 0), (FINE_REGISTERED, 0), (VALUE, semitones), (FINE_VALUE, cents))
    return [Controller(number, value, channel) for number, value in messages]


class Hand:
    """Plays events; what was struck is seen, not heard."""

    def __init__(self, patch: Patch, preset: Preset) -> None:
        self.struck: list[Struck] = []
        self.player = Player(patch, preset, RATE_HZ, self.struck.append, ("model",))

    def play(self, *played: Event) -> Struck:
        """The last that was struck."""
        for event in played:
            self.player.handle(event)
        return self.struck[-1]

    @property
    def sounding(self) -> list[int]:
        return [each.event.key for each in self.player.sounding()]


def semitones(struck: Struck) -> float:
    """By how many its string is bent."""
    return 12 * log2(pitch_hz_of(struck.parameters) / struck.key.string.pitch_hz)


@pytest.fixture
def hand(patch: Patch, preset: Preset) -> Hand:
    return Hand(changed(patch, mod_wheel="knobs.decay"), preset)


@pytest.fixture
def strung(guitar: Patch) -> Patch:
    """Six strings that differ in thickness."""
    areas = [5e-7 * 1.1**number for number in range(6)]
    strings = [
        OpenString(note=note, string=physical(replace(STEEL, area_m2=area)))
        for note, area in zip(OPEN, areas, strict=True)
    ]
    return changed(guitar, strings=StringSet(strings=tuple(strings)))


def area_m2(patch: Patch, channel: int) -> float:
    assert isinstance(patch.strings, StringSet)
    return patch.strings.strings[-1 - channel].string.area_m2


# At rest


def test_reset_leaves_the_next_key_and_the_ringing_one_in_tune_and_lifts_the_pedal(hand: Hand) -> None:
    held = hand.play(Bend(1.0), Controller(SUSTAIN, 127), Controller(MOD_WHEEL, 127), NoteOn(57, 60))
    assert semitones(held) == pytest.approx(2)
    hand.play(NoteOff(57))
    assert held.kept
    hand.play(Controller(RESET, 0))
    assert not held.kept
    assert held.damped
    fresh = hand.play(NoteOn(52, 60))
    assert fresh.parameters == fresh.key.string.parameters


def test_what_a_file_leaves_behind_does_not_bend_the_keys_of_the_computer(hand: Hand) -> None:
    hand.play(NoteOn(45, 60), Bend(1.0))
    for event in let_go([0]):
        hand.player.handle(event)
    assert semitones(hand.play(NoteOn(57, 60, KEYS))) == pytest.approx(0, abs=1e-6)
    assert hand.struck[0].damped


def test_a_channels_reset_leaves_the_others(hand: Hand) -> None:
    one = hand.play(NoteOn(45, 60, 0), Bend(1.0, 0))
    other = hand.play(NoteOn(57, 60, 1), Bend(1.0, 1))
    hand.play(*let_go([0]))
    assert (one.damped, other.damped) == (True, False)
    assert (semitones(other), other.held) == (pytest.approx(2), True)


def test_the_first_channels_wheel_and_pedal_hold_for_the_keys_of_the_computer(hand: Hand) -> None:
    struck = hand.play(NoteOn(57, 60, KEYS), Bend(0.5), Controller(SUSTAIN, 127), NoteOff(57, KEYS))
    assert semitones(struck) == pytest.approx(1)
    assert struck.kept
    hand.play(Controller(NOTES_OFF, 0))
    assert struck.kept  # the input's keys, not these
    hand.play(Controller(SUSTAIN, 0))
    assert struck.damped


def test_another_patch_begins_with_wheels_at_rest_and_the_foot_on_the_pedal(hand: Hand) -> None:
    hand.play(NoteOn(40, 60), *range_of_bends(12), Bend(1.0), Controller(MOD_WHEEL, 127), Controller(SUSTAIN, 127))
    patch = hand.player.patch
    hand.player.set_patch(changed(patch, knobs=Knobs(decay=1.1)))
    hand.player.set_patch(changed(hand.player.patch, name="the same"))
    assert semitones(hand.play(NoteOn(45, 60))) == pytest.approx(12)
    hand.player.set_patch(changed(patch, name="another", damping={"release_t60_s": 0.2}))
    fresh = hand.play(NoteOn(57, 60), NoteOff(57))
    assert fresh.kept
    assert fresh.parameters == fresh.key.string.parameters
    assert semitones(hand.play(Bend(0.5), NoteOn(52, 60))) == pytest.approx(1)


def test_slide_is_forgotten(patch: Patch, preset: Preset) -> None:
    hand = Hand(changed(patch, mode="mpe"), preset)
    slid = hand.play(Controller(SLIDE, 127, 1), NoteOn(57, 60, 1)).pluck.position
    assert slid == pytest.approx(0.5)
    assert hand.play(Controller(RESET, 0, 1), NoteOn(57, 60, 1)).pluck.position == patch.pluck.position


# The range of bends


def test_messages_set_the_range_of_bends_of_their_channel(hand: Hand) -> None:
    assert semitones(hand.play(*range_of_bends(12), Bend(0.5), NoteOn(45, 60))) == pytest.approx(6)
    assert semitones(hand.play(Bend(0.5, 1), NoteOn(57, 60, 1))) == pytest.approx(1)
    assert semitones(hand.play(*range_of_bends(1, 50))) == pytest.approx(1)  # that of the string of channel 1
    assert semitones(hand.struck[0]) == pytest.approx(0.75)  # it follows while it rings
    assert semitones(hand.play(Controller(RESET, 0), Bend(0.5), NoteOn(52, 60))) == pytest.approx(1)


def test_another_parameter_sets_no_range_and_none_is_beyond_its_bound(hand: Hand) -> None:
    other = [Controller(OTHER, 0), Controller(FINE_OTHER, 0), Controller(VALUE, 24)]
    tuning = [Controller(REGISTERED, 0), Controller(FINE_REGISTERED, 2), Controller(VALUE, 24)]
    none = [Controller(REGISTERED, 127), Controller(FINE_REGISTERED, 127), Controller(VALUE, 24)]
    assert semitones(hand.play(Controller(VALUE, 24), Bend(1.0), NoteOn(45, 60))) == pytest.approx(2)
    for messages in (other, tuning, none):
        assert semitones(hand.play(*range_of_bends(3), *messages, Bend(1.0), NoteOn(45, 60))) == pytest.approx(3)
    hand.play(*range_of_bends(127, 127))
    assert hand.player._hands.of(0).range_semitones == WIDEST_SEMITONES


def test_in_mpe_members_bend_by_48_semitones_unless_messages_say_other(patch: Patch, preset: Preset) -> None:
    hand = Hand(changed(patch, mode="mpe"), preset)
    assert semitones(hand.play(Bend(1 / 8, 1), NoteOn(45, 60, 1))) == pytest.approx(6)
    assert semitones(hand.play(*range_of_bends(24, 0, 1))) == pytest.approx(3)
    assert semitones(hand.play(Bend(0.5, 0))) == pytest.approx(4)
    assert semitones(hand.play(*range_of_bends(4, 0, 0))) == pytest.approx(5)
    assert semitones(hand.play(NoteOn(57, 60, KEYS))) == pytest.approx(2)


# A guitar


def test_on_a_guitars_patch_the_computers_keys_sound_together_each_on_the_string_it_chooses(
    strung: Patch, preset: Preset
) -> None:
    hand = Hand(strung, preset)
    chord = (60, 62, 64, 67)  # all but one on two strings
    hand.play(*(NoteOn(key, 90, KEYS) for key in chord))
    assert hand.sounding == list(chord)
    assert [each.parameters.area_m2 for each in hand.struck] == [
        pytest.approx(area_m2(strung, channel)) for channel in (B, B, HIGH_E, HIGH_E)
    ]


def test_a_keyboard_on_the_first_channel_sounds_together_too(strung: Patch, preset: Preset) -> None:
    hand = Hand(strung, preset)
    hand.play(*(NoteOn(key, 90) for key in (48, 52, 55)), NoteOn(36, 90, 9))  # with drums beside it
    assert hand.sounding == [48, 52, 55, 36]


def test_a_guitars_channel_is_its_string_wherever_it_is_fretted(strung: Patch, preset: Preset) -> None:
    hand = Hand(strung, preset)
    for key, channel in ((64, B), (64, HIGH_E), (64, G), (52, LOW_E), (57, B)):
        struck = hand.play(NoteOn(key, 90, channel))
        assert struck.parameters.area_m2 == pytest.approx(area_m2(strung, channel)), channel
        assert pitch_hz_of(struck.parameters) == pytest.approx(440 * 2 ** ((key - 69) / 12), rel=1e-6)
    assert hand.sounding == [57, 64, 64, 52]  # of the string B the last, which is tuned lower and slackened
    bent = hand.play(Bend(1.0, B))
    assert bent.parameters.area_m2 == pytest.approx(area_m2(strung, B))


def test_far_below_a_string_and_beyond_the_set_the_key_chooses(strung: Patch, preset: Preset) -> None:
    hand = Hand(strung, preset)
    assert hand.play(NoteOn(47, 90, B)).parameters.area_m2 == pytest.approx(area_m2(strung, 4))
    assert hand.play(NoteOn(65, 90, 6)).parameters.area_m2 == pytest.approx(area_m2(strung, HIGH_E))
    assert hand.play(NoteOn(66, 90, 6)).place != hand.struck[-2].place


def test_with_its_input_at_rest_a_guitar_is_forgotten(strung: Patch, preset: Preset) -> None:
    hand = Hand(strung, preset)
    hand.play(NoteOn(64, 90, HIGH_E), NoteOn(59, 90, B))
    hand.play(NoteOn(65, 90, HIGH_E), NoteOn(67, 90, HIGH_E))
    assert hand.sounding.count(65) == 0
    hand.play(*let_go([HIGH_E, B]), NoteOn(72, 90), NoteOn(76, 90))
    assert {72, 76} <= set(hand.sounding)


def test_what_a_guitar_may_fret_is_prepared(strung: Patch, preset: Preset) -> None:
    hand = Hand(strung, preset)
    hand.player.prepare([64])
    misses = hand.player._key.cache_info().misses  # type: ignore[attr-defined]
    hand.play(NoteOn(64, 90, KEYS), *(NoteOn(64, 90, channel) for channel in (B, G, LOW_E, HIGH_E)))
    assert hand.player._key.cache_info().misses == misses  # type: ignore[attr-defined]
