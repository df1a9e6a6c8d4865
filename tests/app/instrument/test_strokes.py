"""Harmonics, strums and tremolo: measured on rendered sound of model and truth, and frame by frame."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
import scipy.signal
from numpy.typing import NDArray

from app.instrument.compiled import InstrumentPlayer
from app.instrument.events import (
    HARMONICS,
    KEYS,
    MOD_WHEEL,
    NOTES_OFF,
    RESET,
    SOUND_OFF,
    STRUM,
    TREMOLO,
    Controller,
    Event,
    NoteOff,
    NoteOn,
)
from app.patches.patch import Fretted, Patch, Pickup, Technique
from engine.kernels import constants as of
from engine.kernels.constants import QUANTUM
from engine.kernels.playing.chords import CHORD_S, USUAL_STRUM_MS
from engine.kernels.playing.hands import USUAL_TREMOLO_HZ
from engine.kernels.playing.keys import USUAL_HARMONIC
from engine.kernels.playing.notes import TOUCH_PERIODS
from engine.kernels.strings import TOUCH_RESISTANCE
from engine.presets import Preset
from engine.values.string import Polarisations, StringParameters
from engine.voices import Mixer
from engine.voices.player import Report
from tests.app.instrument.seen import sounding
from tests.app.instrument.test_techniques import KEY, RATE_HZ, first_hz, hz_of, play

CHORD = (40, 45, 50, 55, 59, 64)
LATER_S = 0.3  # after the finger has left


def with_technique(patch: Patch, **values: float) -> Patch:
    return Patch.model_validate({**dict(patch), "technique": Technique(**values)})


class Played:
    """A player, which is given events with their frames and reports which notes began when."""

    def __init__(self, patch: Patch, preset: Preset) -> None:
        self.mixer = Mixer(RATE_HZ, limited=False)
        self.player = InstrumentPlayer(patch, preset, RATE_HZ, {"model": 1.0})
        self.mixer.set_player(self.player.compiled)
        self.reports: list[Report] = []

    def run(self, events: Sequence[tuple[int, Event]], frames: int, block: int = QUANTUM) -> list[Report]:
        """What began, in order. Events of frame 0 come at once, the others with the block of their frames."""
        left = sorted(events, key=lambda each: each[0])
        for done in range(0, frames, block):
            while left and left[0][0] < done + block:
                frame, event = left.pop(0)
                self.player.handle(event, frame)
            self.mixer.render(block)
            self.reports += self.player.reports()
        return [each for each in self.reports if each.kind == of.BEGAN]


def frames_of(reports: Sequence[Report]) -> dict[int, int]:
    return {each.key: each.frame for each in reports}


def level(sound: NDArray[np.float64], at_s: float, hz: float, frames: int = 3 * 8_192) -> float:
    """The amplitude of a partial within 1 % of `hz`; others count by less than -90 dB."""
    first, size = round(at_s * RATE_HZ), 2**18
    found = np.abs(np.fft.rfft(sound[first : first + frames] * scipy.signal.windows.blackmanharris(frames), size))
    return float(found[round(0.99 * hz / RATE_HZ * size) : round(1.01 * hz / RATE_HZ * size) + 1].max())


# Harmonics


@pytest.mark.parametrize("source", ["model", "truth"])
@pytest.mark.parametrize("node", [2, 3, 4, 5])
def test_a_touch_leaves_the_partials_that_have_a_node_there(
    patch: Patch, preset: Preset, node: int, source: str
) -> None:
    nylon = {"strings": Fretted(string=StringParameters()), "pickup": Pickup(kind="bridge")}
    plucked = Patch.model_validate({**dict(patch), **nylon})
    touched = with_technique(plucked, harmonic=node)
    sound, plain = (play(each, preset, 1.2, (0.0, NoteOn(KEY, 60)), source=source) for each in (touched, plucked))
    at_s = TOUCH_PERIODS / hz_of(KEY) + LATER_S
    kept = level(sound, at_s, node * hz_of(KEY))
    assert kept > 0.3 * level(plain, at_s, node * hz_of(KEY))
    for number in range(1, 2 * node + 2):
        if number % node:
            assert level(sound, at_s, number * hz_of(KEY)) < 10 ** (-30 / 20) * kept, number
    assert level(sound, at_s, hz_of(KEY)) < 10 ** (-30 / 20) * level(plain, at_s, hz_of(KEY))
    open_hz, hz = (
        first_hz(each, at_s, 0.97 * number * hz_of(KEY), 1.03 * number * hz_of(KEY), 3 * 8_192)
        for each, number in ((plain, 1), (sound, node))
    )
    assert abs(1200 * math.log2(hz / (node * open_hz))) < 3


def test_during_the_touch_partials_decay_as_the_finger_damps_them(patch: Patch, preset: Preset) -> None:
    slow = Patch.model_validate({**dict(patch), "tuning": {"transpose": -24}})  # so that periods are long
    touched = with_technique(slow, harmonic=5)
    sound, plain = (play(each, preset, 0.6, (0.0, NoteOn(KEY, 30))) for each in (touched, slow))
    hz = hz_of(KEY - 24)
    for number in (1, 4, 6):
        falls = [
            math.log(level(each, 0.01, number * hz, 9_600) / level(each, 0.11, number * hz, 9_600)) / 0.1
            for each in (sound, plain)
        ]
        sigma = TOUCH_RESISTANCE * 2 * hz * math.sin(math.pi * number / 5) ** 2
        assert falls[0] - falls[1] == pytest.approx(sigma, rel=0.15), number


def test_model_and_truth_of_a_harmonic_agree(patch: Patch, preset: Preset) -> None:
    moving = Patch.model_validate({**dict(with_technique(patch, harmonic=3)), "polarisations": Polarisations()})
    model, truth = (play(moving, preset, 1.0, (0.0, NoteOn(KEY, 100)), source=each) for each in ("model", "truth"))
    assert np.mean((model - truth) ** 2) < 1e-6 * np.mean(truth**2)


def test_harmonics_by_footswitch_wheel_and_parameter_are_alike(patch: Patch, preset: Preset) -> None:
    turned = play(with_technique(patch, harmonic=USUAL_HARMONIC), preset, 0.3, (0.0, NoteOn(KEY, 60)))
    switched = play(patch, preset, 0.3, (0.0, Controller(HARMONICS, 127)), (0.0, NoteOn(KEY, 60)))
    np.testing.assert_array_equal(switched, turned)
    wheel = Patch.model_validate({**dict(patch), "mod_wheel": "technique.harmonic"})
    np.testing.assert_array_equal(
        play(wheel, preset, 0.3, (0.0, Controller(MOD_WHEEL, 127)), (0.0, NoteOn(KEY, 60))), turned
    )
    again = (0.0, Controller(HARMONICS, 127)), (0.0, Controller(HARMONICS, 0)), (0.0, NoteOn(KEY, 60))
    np.testing.assert_array_equal(play(patch, preset, 0.3, *again), play(patch, preset, 0.3, (0.0, NoteOn(KEY, 60))))


def test_a_harmonic_is_plucked_short_of_its_first_node(patch: Patch, preset: Preset) -> None:
    for node in (2, 5):
        began = Played(with_technique(patch, harmonic=node), preset).run([(0, NoteOn(KEY, 60))], QUANTUM)
        assert began[0].position == pytest.approx(min(patch.pluck.position, 0.4 / node))


# Strums


@pytest.mark.parametrize("block", [QUANTUM, 512, 4_096])
@pytest.mark.parametrize("frame", [0, 1_000])
def test_a_chord_is_spread_string_by_string(guitar: Patch, preset: Preset, frame: int, block: int) -> None:
    step = 480
    for strokes, order in ((0, CHORD), (1, CHORD[::-1])):
        strummed = with_technique(
            Patch.model_validate({**dict(guitar), "mode": "poly"}), strum_ms=10, strokes=strokes
        )
        events = [(frame, NoteOn(key, 20 + key)) for key in (50, 40, 64, 45, 59, 55)]
        began = Played(strummed, preset).run(events, 8_192, block)
        assert [each.key for each in began] == list(order)
        assert [each.frame - began[0].frame for each in began] == [step * number for number in range(6)]
        assert began[0].frame == frame  # no later than without a strum
        assert all(each.velocity == 20 + each.key for each in began)


def test_strings_of_channels_are_strummed_by_string(guitar: Patch, preset: Preset) -> None:
    """On the fifth string a key may be higher than that on the fourth."""
    events = [(1_000, NoteOn(key, 60, channel)) for channel, key in ((3, 50), (4, 57), (5, 45))]
    began = Played(with_technique(guitar, strum_ms=10), preset).run([(0, NoteOn(64, 1, 1)), *events], 4_096)
    assert [each.channel for each in began[1:]] == [5, 4, 3]


def test_strokes_alternate_from_chord_to_chord(patch: Patch, preset: Preset) -> None:
    events = [(1 + 9_600 * turn, NoteOn(key, 60)) for turn in range(3) for key in (45, 40, 50)]
    events.insert(0, (9_600 * 3, NoteOn(60, 60)))  # one note is no chord, and turns no stroke
    events += [(9_600 * 4, NoteOn(key, 60)) for key in (45, 40, 50)]
    began = Played(with_technique(patch, strum_ms=5, strokes=2), preset).run(events, 9_600 * 5)
    keys = [each.key for each in began]
    assert keys == [40, 45, 50, 50, 45, 40, 40, 45, 50, 60, 50, 45, 40]


def test_fingers_that_come_one_by_one_are_a_chord_too(patch: Patch, preset: Preset) -> None:
    """The first begins at once; those that wait take their turns by their heights."""
    strummed = with_technique(patch, strum_ms=20)
    late = round(CHORD_S * RATE_HZ) + 1
    events = [(100, NoteOn(50, 60)), (300, NoteOn(59, 60)), (420, NoteOn(45, 60)), (100 + late, NoteOn(70, 60))]
    began = Played(strummed, preset).run(events, 6_000)
    assert frames_of(began) == {50: 100, 45: 1_060, 59: 2_020, 70: 100 + late}


def test_a_short_key_of_a_chord_is_as_short_when_its_turn_comes(patch: Patch, preset: Preset) -> None:
    played = Played(with_technique(patch, strum_ms=40), preset)
    events = [(64, NoteOn(key, 60)) for key in (40, 45)] + [(640, NoteOff(key)) for key in (40, 45)]
    played.run(events, 64 + 1_920 + 512)
    assert [(each.key, each.held) for each in sounding(played.player)] == [(40, False), (45, True)]
    played.run([], QUANTUM * 2)
    assert [(each.key, each.held) for each in sounding(played.player)] == [(40, False), (45, False)]


@pytest.mark.parametrize("number", [NOTES_OFF, SOUND_OFF])
def test_a_stop_forgets_the_strings_to_come(patch: Patch, preset: Preset, number: int) -> None:
    played = Played(with_technique(patch, strum_ms=40), preset)
    began = played.run([*((64, NoteOn(key, 60)) for key in (40, 45, 50)), (640, Controller(number, 0))], 9_600)
    assert [each.key for each in began] == [40]
    assert [each.key for each in played.reports if each.kind == of.REFUSED] == [45, 50]
    assert not any(each.held for each in sounding(played.player))


def test_the_footswitch_of_strums_is_of_its_channel(patch: Patch, preset: Preset) -> None:
    for channel, spread in ((KEYS, True), (3, False)):
        chord = [(0, NoteOn(key, 60, channel)) for key in (40, 45)]
        began = Played(patch, preset).run([(0, Controller(STRUM, 127, KEYS)), *chord], 4_096)
        between = began[1].frame - began[0].frame
        assert between == (round(USUAL_STRUM_MS / 1000 * RATE_HZ) if spread else 0)


@pytest.mark.parametrize(("field", "most"), [("technique.strum_ms", 40.0), ("technique.tremolo_hz", 12.0)])
def test_the_wheel_turns_strums_and_tremolo(patch: Patch, preset: Preset, field: str, most: float) -> None:
    wheel = Patch.model_validate({**dict(patch), "mod_wheel": field})
    events = [(0, Controller(MOD_WHEEL, 127)), *((0, NoteOn(key, 60)) for key in (40, 45))]
    by_wheel, turned = (
        [(each.key, each.frame) for each in Played(each, preset).run(events, RATE_HZ // 4)]
        for each in (wheel, patch.with_value(field, most))
    )
    assert by_wheel == turned
    assert len({frame for _, frame in turned}) > 1


# Tremolo


def test_a_key_that_is_held_plucks_again_and_again(patch: Patch, preset: Preset) -> None:
    played = Played(with_technique(patch, tremolo_hz=12), preset)
    began = played.run([(1_000, NoteOn(KEY, 60)), (1_000 + 17_000, NoteOff(KEY))], RATE_HZ)
    assert [each.frame for each in began] == [1_000 + 4_000 * turn for turn in range(5)]
    assert len({each.id for each in began}) == 1
    assert all(each.velocity == 60 for each in began)
    ended = [each.id for each in played.reports if each.kind == of.ENDED]
    assert ended.count(began[0].id) == 1  # as long as its key is down it is one note
    assert ended[-1] == began[0].id


def test_strokes_of_a_tremolo_vary_as_strokes_do_and_repeat(patch: Patch, preset: Preset) -> None:
    pluck = patch.pluck.model_copy(update={"variation": 1.0})
    varied = Patch.model_validate({**dict(with_technique(patch, tremolo_hz=10)), "pluck": pluck})
    first, again = (Played(varied, preset).run([(0, NoteOn(KEY, 60))], RATE_HZ // 2) for _ in range(2))
    assert len({each.position for each in first}) == len(first) == 5
    assert [each.position for each in first] == [each.position for each in again]


def test_the_pedal_plucks_nothing_and_the_footswitch_does(patch: Patch, preset: Preset) -> None:
    events: list[tuple[int, Event]] = [(0, Controller(64, 127)), (0, NoteOn(KEY, 60)), (640, NoteOff(KEY))]
    assert len(Played(with_technique(patch, tremolo_hz=10), preset).run(events, RATE_HZ)) == 1
    switched = [(0, Controller(TREMOLO, 127)), (0, NoteOn(KEY, 60)), (RATE_HZ // 2, Controller(RESET, 0))]
    began = Played(patch, preset).run(switched, RATE_HZ)
    assert began[1].frame == round(RATE_HZ / USUAL_TREMOLO_HZ)
    assert len(began) == 5


def test_a_tremolo_sounds_in_model_and_truth(patch: Patch, preset: Preset) -> None:
    trembling = with_technique(patch, tremolo_hz=10)
    for source in ("model", "truth"):
        sound = play(trembling, preset, 1.0, (0.0, NoteOn(KEY, 60)), source=source)
        once = play(patch, preset, 1.0, (0.0, NoteOn(KEY, 60)), source=source)
        whole, last = (slice(round(at_s * RATE_HZ), round(0.98 * RATE_HZ)) for at_s in (0.0, 0.9))
        assert np.std(sound[last]) == pytest.approx(np.std(once[: round(0.08 * RATE_HZ)]), rel=0.1)
        assert np.abs(np.diff(sound[whole])).max() < 1.5 * np.abs(np.diff(once)).max()  # strokes do not click


def test_footswitches_are_taken_over_by_another_player(patch: Patch, preset: Preset) -> None:
    played = Played(patch, preset)
    switches = [Controller(number, 127, KEYS) for number in (HARMONICS, TREMOLO, STRUM)]
    played.run([(0, each) for each in switches], QUANTUM)
    assert played.player.at_hand == switches
