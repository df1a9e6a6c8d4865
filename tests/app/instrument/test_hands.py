"""Where wheels and pedals stand, by the messages of MIDI; and what a patch then sounds like on each string."""

from __future__ import annotations

from dataclasses import replace
from math import log2

import numpy as np
import pytest

from app.instrument.compiled import InstrumentPlayer
from app.instrument.events import (
    COARSE_TUNING,
    DECREMENT,
    EXPRESSION,
    FINE_OTHER,
    FINE_REGISTERED,
    FINE_TUNING,
    FINE_VALUE,
    INCREMENT,
    KEYS,
    LEGATO,
    MOD_WHEEL,
    NOTES_OFF,
    OTHER,
    REGISTERED,
    RESET,
    SLIDE,
    SUSTAIN,
    VALUE,
    VOLUME,
    Bend,
    Controller,
    Event,
    NoteOff,
    NoteOn,
    TimedEvent,
    parameter_set,
    release_all,
)
from app.instrument.offline import render_events
from app.patches.patch import Knobs, OpenString, Patch, StringSet
from engine.kernels.constants import BEGAN, PART_S, REFERENCE_VELOCITY
from engine.kernels.playing.channels import WIDEST_SEMITONES
from engine.presets import Preset
from engine.voices import Mixer
from engine.voices.player import Report
from tests.app.instrument.conftest import STEEL
from tests.app.instrument.seen import Seen, seen, sounding, taken_up
from tests.app.instrument.test_loudness import loudness_db

RATE_HZ = 48_000
OPEN = (40, 45, 50, 55, 59, 64)
HIGH_E, B, G, LOW_E = 0, 1, 2, 5  # channels of a guitar


def changed(patch: Patch, **parts: object) -> Patch:
    return Patch.model_validate({**dict(patch), **parts})


def range_of_bends(semitones: int, cents: int = 0, channel: int = 0) -> list[Event]:
    messages = ((REGISTERED, 0), (FINE_REGISTERED, 0), (VALUE, semitones), (FINE_VALUE, cents))
    return [Controller(number, value, channel) for number, value in messages]


class Note:
    """A note that was struck, as it is now, or was when it rang last."""

    def __init__(self, hand: Hand, seen: Seen) -> None:
        self._hand, self._seen = hand, seen

    @property
    def now(self) -> Seen:
        self._seen = next((each for each in seen(self._hand.player) if each.id == self._seen.id), self._seen)
        return self._seen

    @property
    def semitones(self) -> float:
        """By how many its string is bent."""
        return 12 * log2(self.now.now.pitch_hz / self.now.own.pitch_hz)

    @property
    def area_m2(self) -> float:
        return self.now.now.area_m2


class Hand:
    """Plays events; what was struck is seen, not heard."""

    def __init__(self, patch: Patch, preset: Preset) -> None:
        self.mixer = Mixer(RATE_HZ)
        self.player = InstrumentPlayer(patch, preset, RATE_HZ, {"model": 1.0})
        self.struck: list[Note] = []
        self.reports: list[Report] = []

    def play(self, *played: Event) -> Note:
        """The last that was struck."""
        for event in played:
            number = self.player.handle(event)
            found = taken_up(self.player, self.mixer)
            self.struck += [Note(self, each) for each in found if each.id == number and isinstance(event, NoteOn)]
        self.reports += self.player.reports()
        return self.struck[-1]

    def take(self, patch: Patch) -> None:
        """Another patch, or the same with a knob turned."""
        self.player.take(self.player.tabled(self.player.keys_of(patch)))

    @property
    def sounding(self) -> list[int]:
        return [each.key for each in sounding(self.player)]


@pytest.fixture
def hand(patch: Patch, preset: Preset) -> Hand:
    return Hand(changed(patch, mod_wheel="knobs.decay"), preset)


@pytest.fixture
def strung(guitar: Patch) -> Patch:
    """Six strings that differ in thickness."""
    areas = [5e-7 * 1.1**number for number in range(6)]
    strings = [
        OpenString(note=note, string=replace(STEEL, area_m2=area)) for note, area in zip(OPEN, areas, strict=True)
    ]
    return changed(guitar, strings=StringSet(strings=tuple(strings)))


def area_m2(patch: Patch, channel: int) -> float:
    assert isinstance(patch.strings, StringSet)
    return patch.strings.strings[-1 - channel].string.area_m2


# At rest


def test_reset_leaves_the_next_key_and_the_ringing_one_in_tune_and_lifts_the_pedal(hand: Hand) -> None:
    held = hand.play(Bend(1.0), Controller(SUSTAIN, 127), Controller(MOD_WHEEL, 127), NoteOn(57, 60))
    assert held.semitones == pytest.approx(2)
    hand.play(NoteOff(57))
    assert held.now.kept
    hand.play(Controller(RESET, 0))
    assert not held.now.kept
    assert held.now.damped
    fresh = hand.play(NoteOn(52, 60))
    assert fresh.now.now == fresh.now.own


def test_what_a_file_leaves_behind_does_not_bend_the_keys_of_the_computer(hand: Hand) -> None:
    hand.play(NoteOn(45, 60), Bend(1.0))
    hand.play(*release_all([0]))
    assert hand.play(NoteOn(57, 60, KEYS)).semitones == pytest.approx(0, abs=1e-6)
    assert hand.struck[0].now.damped


def test_a_channels_reset_leaves_the_others(hand: Hand) -> None:
    one = hand.play(NoteOn(45, 60, 0), Bend(1.0, 0))
    other = hand.play(NoteOn(57, 60, 1), Bend(1.0, 1))
    hand.play(*release_all([0]))
    assert (one.now.damped, other.now.damped) == (True, False)
    assert (other.semitones, other.now.held) == (pytest.approx(2), True)


def test_the_first_channels_wheel_and_pedal_hold_for_the_keys_of_the_computer(hand: Hand) -> None:
    struck = hand.play(NoteOn(57, 60, KEYS), Bend(0.5), Controller(SUSTAIN, 127), NoteOff(57, KEYS))
    assert struck.semitones == pytest.approx(1)
    assert struck.now.kept
    hand.play(Controller(NOTES_OFF, 0))
    assert struck.now.kept  # the input's keys, not these
    hand.play(Controller(SUSTAIN, 0))
    assert struck.now.damped


def test_another_patch_begins_with_wheels_at_rest_and_the_foot_on_the_pedal(hand: Hand) -> None:
    hand.play(NoteOn(40, 60), *range_of_bends(12), Bend(1.0), Controller(MOD_WHEEL, 127), Controller(SUSTAIN, 127))
    patch = hand.player.patch
    hand.take(changed(patch, knobs=Knobs(decay=1.1)))
    hand.take(changed(hand.player.patch, name="the same"))
    assert hand.play(NoteOn(45, 60)).semitones == pytest.approx(12)
    hand.take(changed(patch, name="another", damping={"release_t60_s": 0.2}))
    fresh = hand.play(NoteOn(57, 60), NoteOff(57))
    assert fresh.now.kept
    assert fresh.now.now == fresh.now.own
    assert hand.play(Bend(0.5), NoteOn(52, 60)).semitones == pytest.approx(1)


def test_slide_is_forgotten(patch: Patch, preset: Preset) -> None:
    hand = Hand(changed(patch, mode="mpe"), preset)
    hand.play(Controller(SLIDE, 127, 1), NoteOn(57, 60, 1))
    assert hand.reports[-1].position == pytest.approx(0.5)
    hand.play(Controller(RESET, 0, 1), NoteOn(57, 60, 1))
    assert hand.reports[-1].position == pytest.approx(0.5)  # RP-015: it is a sound controller
    hand.play(*release_all([1]), NoteOn(57, 60, 1))
    positions = [each.position for each in hand.reports if each.kind == BEGAN]
    assert positions[-1] == patch.pluck.position


# Releases


@pytest.mark.parametrize("mode", ["poly", "guitar", "mpe"])
@pytest.mark.parametrize("channel", [1, KEYS])
def test_a_release_belongs_to_the_stroke_before_it(strung: Patch, preset: Preset, mode: str, channel: int) -> None:
    hand = Hand(changed(strung, mode=mode), preset)
    on, off = NoteOn(64, 90, channel), NoteOff(64, channel)
    again = hand.play(on, on, off)  # of the first
    assert (again.now.held, again.now.damped) == (True, False)
    hand.play(off)
    assert (again.now.held, again.now.damped) == (False, True)
    third = hand.play(on, off, off, on)  # one that came too often counts for nothing
    assert third.now.held
    hand.play(off)
    assert third.now.damped
    assert hand.play(on, on, *release_all([channel]), on, off).now.damped


def test_the_pedal_keeps_the_latest_stroke_of_a_key(hand: Hand) -> None:
    again = hand.play(Controller(SUSTAIN, 127), NoteOn(57, 90), NoteOn(57, 90), NoteOff(57))
    assert (again.now.held, again.now.kept) == (True, False)
    hand.play(NoteOff(57))
    assert (again.now.held, again.now.kept) == (False, True)
    hand.play(Controller(SUSTAIN, 0))
    assert again.now.damped


def test_channels_release_their_own_strokes(hand: Hand) -> None:
    first = hand.play(NoteOn(57, 90, 0))
    other = hand.play(NoteOn(57, 90, 1), NoteOff(57, 0))  # its string is the same
    assert (first.now.has_place, other.now.held) == (False, True)
    hand.play(NoteOff(57, 1))
    assert other.now.damped


def test_a_key_struck_twice_under_legato_is_pulled_off_after_its_last_release(hand: Hand) -> None:
    moved = hand.play(Controller(LEGATO, 127), NoteOn(57, 90), NoteOn(60, 90), NoteOn(57, 90), NoteOff(57))
    assert (hand.sounding, moved.now.held) == ([57], True)
    hand.play(NoteOff(57))  # back to the key that is still down
    assert (hand.sounding, moved.now.held) == ([60], True)
    hand.play(NoteOff(60))
    assert moved.now.damped


@pytest.mark.parametrize("number", range(NOTES_OFF, 128))
def test_messages_of_modes_release_all_keys(hand: Hand, number: int) -> None:
    struck = hand.play(NoteOn(57, 90), NoteOn(57, 90), Controller(number, 0))
    assert struck.now.damped
    assert hand.play(NoteOn(57, 90), NoteOff(57)).now.damped


# The range of bends


def test_messages_set_the_range_of_bends_of_their_channel(hand: Hand) -> None:
    assert hand.play(*range_of_bends(12), Bend(0.5), NoteOn(45, 60)).semitones == pytest.approx(6)
    assert hand.play(Bend(0.5, 1), NoteOn(57, 60, 1)).semitones == pytest.approx(1)
    assert hand.play(*range_of_bends(1, 50)).semitones == pytest.approx(1)  # that of the string of channel 1
    assert hand.struck[0].semitones == pytest.approx(0.75)  # it follows while it rings
    assert hand.play(Controller(RESET, 0), Bend(0.5), NoteOn(52, 60)).semitones == pytest.approx(0.75)
    assert hand.play(*release_all([0]), Bend(0.5), NoteOn(55, 60)).semitones == pytest.approx(1)


def test_another_parameter_sets_no_range_and_none_is_beyond_its_bound(hand: Hand) -> None:
    other = [Controller(OTHER, 0), Controller(FINE_OTHER, 0), Controller(VALUE, 24)]
    program = [Controller(REGISTERED, 0), Controller(FINE_REGISTERED, 3), Controller(VALUE, 24)]
    none = [Controller(REGISTERED, 127), Controller(FINE_REGISTERED, 127), Controller(VALUE, 24)]
    assert hand.play(Controller(VALUE, 24), Bend(1.0), NoteOn(45, 60)).semitones == pytest.approx(2)
    for messages in (other, program, none):
        assert hand.play(*range_of_bends(3), *messages, Bend(1.0), NoteOn(45, 60)).semitones == pytest.approx(3)
    hand.play(*range_of_bends(127, 127))
    assert hand.player.compiled.channel(0).range_semitones == WIDEST_SEMITONES


def test_in_mpe_members_bend_by_48_semitones_unless_messages_say_other(patch: Patch, preset: Preset) -> None:
    hand = Hand(changed(patch, mode="mpe"), preset)
    assert hand.play(Bend(1 / 8, 1), NoteOn(45, 60, 1)).semitones == pytest.approx(6)
    assert hand.play(*range_of_bends(24, 0, 1)).semitones == pytest.approx(3)
    assert hand.play(Bend(0.5, 0)).semitones == pytest.approx(4)
    assert hand.play(*range_of_bends(4, 0, 0)).semitones == pytest.approx(5)
    assert hand.play(NoteOn(57, 60, KEYS)).semitones == pytest.approx(2)


def test_a_members_range_of_bends_is_that_of_all_members(patch: Patch, preset: Preset) -> None:
    hand = Hand(changed(patch, mode="mpe"), preset)
    assert hand.play(*range_of_bends(12, 0, 1), Bend(1.0, 2), NoteOn(45, 60, 2)).semitones == pytest.approx(12)
    assert hand.play(Bend(1.0, 0)).semitones == pytest.approx(14)  # the master's is its own


def test_the_range_of_bends_is_set_in_cents_and_by_steps(hand: Hand) -> None:
    chosen = [Controller(REGISTERED, 0), Controller(FINE_REGISTERED, 0)]
    bent = hand.play(*chosen, Controller(FINE_VALUE, 50), Bend(1.0), NoteOn(45, 60))
    assert bent.semitones == pytest.approx(2.5)  # the instrument's 2, and 50 cents
    hand.play(Controller(INCREMENT, 0))
    assert bent.semitones == pytest.approx(2.51)
    hand.play(*[Controller(DECREMENT, 0)] * 2)
    assert bent.semitones == pytest.approx(2.49)
    hand.play(Controller(RESET, 0), Bend(1.0), Controller(INCREMENT, 0), Controller(VALUE, 9))  # none is chosen
    assert bent.semitones == pytest.approx(2.49)


def test_registered_parameters_tune_a_channel(hand: Hand) -> None:
    one, other = hand.play(NoteOn(45, 60, 1)), hand.play(NoteOn(52, 60, 2))
    hand.play(*parameter_set(FINE_TUNING, 96, 0, 1))
    assert one.semitones == pytest.approx(0.5)
    hand.play(*parameter_set(COARSE_TUNING, 61, 0, 1))
    assert (one.semitones, other.semitones) == (pytest.approx(-2.5), 0.0)
    hand.play(Controller(RESET, 0, 1))
    assert hand.play(NoteOn(57, 60, 1)).semitones == pytest.approx(-2.5)
    hand.play(*release_all([1]))
    assert hand.play(NoteOn(55, 60, 1)).semitones == 0.0


# Volume and expression


def test_volume_and_expression_are_squares_of_which_a_reset_leaves_the_volume(patch: Patch, preset: Preset) -> None:
    def level(*events: Event, channel: int = 1) -> float:
        timed = [TimedEvent(0.0, event) for event in (*events, NoteOn(57, 90, channel))]
        return float(np.abs(np.concatenate(list(render_events(patch, preset, timed, RATE_HZ, seconds=0.2)))).max())

    volume, expression = Controller(VOLUME, 50, 1), Controller(EXPRESSION, 64, 1)
    plain = level()
    assert level(Controller(VOLUME, 100, 1), Controller(EXPRESSION, 127, 1)) == plain
    assert level(volume) == pytest.approx(plain / 4, rel=1e-3)
    assert level(expression) == pytest.approx(plain * (64 / 127) ** 2, rel=1e-3)
    assert level(volume, expression, Controller(RESET, 0, 1)) == pytest.approx(plain / 4, rel=1e-3)
    assert level(volume, expression, *release_all([1])) == plain
    assert level(volume, channel=2) == plain
    assert level(Controller(VOLUME, 0, 1)) == 0.0


def test_a_crescendo_of_expression_is_heard_while_a_string_rings(patch: Patch, preset: Preset) -> None:
    timed = [TimedEvent(0.0, NoteOn(45, 90)), TimedEvent(0.5, Controller(EXPRESSION, 40))]
    sound = np.concatenate(list(render_events(patch, preset, timed, RATE_HZ, seconds=0.7)))
    plain = np.concatenate(list(render_events(patch, preset, timed[:1], RATE_HZ, seconds=0.7)))
    ratio = np.abs(sound[28_000:]).max() / np.abs(plain[28_000:]).max()
    assert ratio == pytest.approx((40 / 127) ** 2, rel=0.01)


# A guitar


def test_on_a_guitars_patch_the_computers_keys_sound_together_each_on_the_string_it_chooses(
    strung: Patch, preset: Preset
) -> None:
    hand = Hand(strung, preset)
    chord = (60, 62, 64, 67)  # all but one on two strings
    hand.play(*(NoteOn(key, 90, KEYS) for key in chord))
    assert hand.sounding == list(chord)
    assert [each.area_m2 for each in hand.struck] == [
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
        assert struck.area_m2 == pytest.approx(area_m2(strung, channel)), channel
        assert struck.now.now.pitch_hz == pytest.approx(440 * 2 ** ((key - 69) / 12), rel=1e-6)
    assert hand.sounding == [64, 64, 52, 57]  # of the string B the last, which is tuned lower and slackened
    bent = hand.play(Bend(1.0, B))
    assert bent.area_m2 == pytest.approx(area_m2(strung, B))


def test_far_below_a_string_and_beyond_the_set_the_key_chooses(strung: Patch, preset: Preset) -> None:
    hand = Hand(strung, preset)
    assert hand.play(NoteOn(47, 90, B)).area_m2 == pytest.approx(area_m2(strung, 4))
    assert hand.play(NoteOn(65, 90, 6)).area_m2 == pytest.approx(area_m2(strung, HIGH_E))
    assert hand.play(NoteOn(66, 90, 6)).now.place != hand.struck[-2].now.place


@pytest.mark.parametrize("mode", ["poly", "guitar", "mpe"])
def test_a_note_that_gives_its_string_sounds_there_and_two_strings_sound_one_pitch(
    strung: Patch, preset: Preset, mode: str
) -> None:
    strung = changed(strung, mode=mode)
    hand = Hand(strung, preset)
    for string, key in ((B, 64), (HIGH_E, 64), (LOW_E, 45)):
        assert hand.play(NoteOn(key, 90, KEYS, string=string)).area_m2 == pytest.approx(area_m2(strung, string))
    assert hand.sounding == [64, 64, 45]
    hand.play(NoteOff(64, KEYS, HIGH_E))
    assert [note.now.held for note in hand.struck] == [True, False, True]
    hand.play(NoteOn(66, 90, KEYS, string=B))  # the next fret of a string that rings
    assert [note.now.has_place for note in hand.struck] == [False, True, True, True]
    chosen = hand.play(NoteOn(64, 90, KEYS, string=6))  # the set has no such string
    assert chosen.area_m2 == pytest.approx(area_m2(strung, HIGH_E))


def test_a_slide_stays_on_its_string_while_another_is_held(strung: Patch, preset: Preset) -> None:
    hand = Hand(changed(strung, mode="poly"), preset)
    hand.play(Controller(LEGATO, 127, KEYS), NoteOn(52, 90, KEYS, string=LOW_E), NoteOn(57, 90, KEYS, string=G))
    hand.play(NoteOn(64, 90, KEYS, string=LOW_E), NoteOff(52, KEYS, LOW_E))
    low, other = sounding(hand.player)
    assert (low.key, other.key) == (64, 57)
    assert low.now.area_m2 == pytest.approx(area_m2(strung, LOW_E))
    assert low.now.pitch_hz == pytest.approx(440 * 2 ** ((64 - 69) / 12), rel=1e-6)


def test_with_its_input_at_rest_a_guitar_is_forgotten(strung: Patch, preset: Preset) -> None:
    hand = Hand(strung, preset)
    hand.play(NoteOn(64, 90, HIGH_E), NoteOn(59, 90, B))
    hand.play(NoteOn(65, 90, HIGH_E), NoteOn(67, 90, HIGH_E))
    assert hand.sounding.count(65) == 0
    hand.play(*release_all([HIGH_E, B]), NoteOn(72, 90), NoteOn(76, 90))
    assert {72, 76} <= set(hand.sounding)


def test_a_key_is_as_loud_on_every_string_of_a_guitar(strung: Patch, preset: Preset) -> None:
    hand, channels = Hand(strung, preset), (B, G, LOW_E, HIGH_E)
    hand.play(*(NoteOn(64, 90, channel) for channel in channels))
    gains = [report.gain for report in hand.reports if report.kind == BEGAN]
    assert len(set(np.round(gains, 9))) == len(channels)
    played = [[TimedEvent(0.0, NoteOn(64, REFERENCE_VELOCITY, channel))] for channel in channels]
    sounds = [render_events(strung, preset, each, RATE_HZ, seconds=PART_S, limited=False) for each in played]
    levels = [loudness_db(np.concatenate(list(blocks))) for blocks in sounds]
    assert max(levels) - min(levels) < 0.5
