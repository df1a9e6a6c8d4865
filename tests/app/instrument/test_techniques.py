"""Palm mute, hammer-on, pull-off and slide: measured on rendered sound, of model and truth."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from app.instrument.events import (
    LEGATO,
    MOD_WHEEL,
    PORTAMENTO,
    SLIDE_TIME,
    SOFT,
    Controller,
    Event,
    NoteOff,
    NoteOn,
    TimedEvent,
)
from app.instrument.offline import render_events
from app.patches.patch import Damping, Patch
from engine.kernels.playing.channels import SLIDE_S
from engine.kernels.strings import MUTED_M, MUTED_SIGMA
from engine.presets import Preset

RATE_HZ = 48_000
WINDOW = 8_192
KEY = 45  # an open string of the guitar


def play(
    patch: Patch, preset: Preset, seconds: float, *events: tuple[float, Event], source: str = "model"
) -> NDArray[np.float64]:
    timed = [TimedEvent(time_s, event) for time_s, event in events]
    blocks = list(render_events(patch, preset, timed, RATE_HZ, source, seconds, limited=False, varied=False))
    return np.concatenate(blocks)[:, 0].astype(np.float64)


def hz_of(key: float) -> float:
    return float(440 * 2 ** ((key - 69) / 12))


def partial(sound: NDArray[np.float64], at_s: float, hz: float) -> float:
    """The amplitude of a partial near `hz`, in a window that begins at `at_s`."""
    first = round(at_s * RATE_HZ)
    found = np.abs(np.fft.rfft(sound[first : first + WINDOW] * np.hanning(WINDOW), 4 * WINDOW))
    near = round(hz / RATE_HZ * 4 * WINDOW)
    return float(found[near - 12 : near + 13].max())


def first_hz(sound: NDArray[np.float64], at_s: float, low_hz: float, high_hz: float, frames: int = WINDOW) -> float:
    """The strongest frequency in a range."""
    first = round(at_s * RATE_HZ)
    part = sound[first : first + frames] * np.hanning(frames)
    found, hz = np.abs(np.fft.rfft(part, 2**18)), np.fft.rfftfreq(2**18, 1 / RATE_HZ)
    inside = (hz > low_hz) & (hz < high_hz)
    return float(hz[inside][found[inside].argmax()])


@pytest.mark.parametrize("source", ["model", "truth"])
def test_a_palm_mute_adds_the_decay_of_a_hand_at_the_bridge(patch: Patch, preset: Preset, source: str) -> None:
    soft = NoteOn(KEY, 10)
    plain = play(patch, preset, 0.6, (0.0, soft), source=source)
    muted = play(patch, preset, 0.6, (0.0, Controller(SOFT, 64)), (0.0, soft), source=source)
    length_m = patch.strings.string.length_m * hz_of(KEY) ** -1  # type: ignore[union-attr]
    length_m *= patch.strings.string.undamped_frequency(1) / math.tau  # type: ignore[union-attr]
    for number in (1, 2, 4):
        turn = 2 * math.pi * number * MUTED_M / length_m
        sigma = 64 / 127 * MUTED_SIGMA * (1 - math.sin(turn) / turn)
        ratios = [
            partial(muted, at_s, number * hz_of(KEY)) / partial(plain, at_s, number * hz_of(KEY))
            for at_s in (0.02, 0.08)
        ]
        assert -math.log(ratios[1] / ratios[0]) / 0.06 == pytest.approx(sigma, rel=0.12), number


def test_a_palm_mute_is_lifted_while_the_string_rings(patch: Patch, preset: Preset) -> None:
    events = (0.0, Controller(SOFT, 127)), (0.0, NoteOn(KEY, 60))
    kept, lifted = play(patch, preset, 1.2, *events), play(patch, preset, 1.2, *events, (0.2, Controller(SOFT, 0)))
    falls = [partial(each, 0.8, hz_of(KEY)) / partial(each, 0.3, hz_of(KEY)) for each in (kept, lifted)]
    assert falls[0] < 0.1 < 0.5 < falls[1]


def test_the_parameter_and_the_pedal_mute_alike(patch: Patch, preset: Preset) -> None:
    by_pedal = play(patch, preset, 0.3, (0.0, Controller(SOFT, 127)), (0.0, NoteOn(KEY, 60)))
    turned = Patch.model_validate({**dict(patch), "damping": Damping(release_t60_s=0.15, mute=1.0)})
    np.testing.assert_array_equal(play(turned, preset, 0.3, (0.0, NoteOn(KEY, 60))), by_pedal)
    wheel = Patch.model_validate({**dict(patch), "mod_wheel": "damping.mute"})
    by_wheel = play(wheel, preset, 0.3, (0.0, Controller(MOD_WHEEL, 127)), (0.0, NoteOn(KEY, 60)))
    np.testing.assert_array_equal(by_wheel, by_pedal)


@pytest.mark.parametrize("source", ["model", "truth"])
@pytest.mark.parametrize("mode", ["poly", "guitar"])
def test_a_hammer_on_moves_the_note_without_a_pluck_and_a_pull_off_moves_it_back(
    guitar: Patch, preset: Preset, mode: str, source: str
) -> None:
    played = Patch.model_validate({**dict(guitar), "mode": mode})
    sound = play(
        played,
        preset,
        1.6,
        (0.0, Controller(LEGATO, 127)),
        (0.0, NoteOn(KEY, 40)),
        (0.4, NoteOn(KEY + 3, 127)),
        (0.8, NoteOff(KEY + 3)),
        (1.2, NoteOff(KEY)),
        source=source,
    )
    for at_s, key in ((0.1, KEY), (0.5, KEY + 3), (0.9, KEY)):
        cents = 1200 * math.log2(first_hz(sound, at_s, 0.8 * hz_of(KEY), 1.4 * hz_of(KEY)) / hz_of(key))
        assert abs(cents) < 6, (at_s, key)
    loud = [float(np.abs(sound[round(at_s * RATE_HZ) :][:WINDOW]).max()) for at_s in (0.2, 0.45, 0.85, 1.4)]
    assert loud[1] < 1.1 * loud[0]  # the second key is hard, and plucks nothing
    assert loud[2] < 1.3 * loud[1]  # at a lower pitch the same energy is a larger motion
    assert loud[2] > 0.3 * loud[0]
    assert loud[3] < 0.05 * loud[2]  # no key is held


def test_without_the_footswitch_each_key_is_a_pluck(guitar: Patch, preset: Preset) -> None:
    played = Patch.model_validate({**dict(guitar), "mode": "poly"})
    sound = play(played, preset, 0.8, (0.0, NoteOn(KEY, 40)), (0.4, NoteOn(KEY + 3, 127)))
    assert np.abs(sound[round(0.4 * RATE_HZ) :]).max() > 2 * np.abs(sound[: round(0.4 * RATE_HZ)]).max()


def test_a_key_below_the_open_string_is_plucked(guitar: Patch, preset: Preset) -> None:
    played = Patch.model_validate({**dict(guitar), "mode": "poly"})
    lowered = (0.0, Controller(LEGATO, 127)), (0.0, NoteOn(KEY, 40)), (0.4, NoteOn(KEY - 3, 40))
    sound = play(played, preset, 0.8, *lowered)
    for key in (KEY, KEY - 3):  # both ring
        assert first_hz(sound, 0.5, 0.97 * hz_of(key), 1.03 * hz_of(key)) == pytest.approx(hz_of(key), rel=0.004)


def test_portamento_slides_there_in_its_time(guitar: Patch, preset: Preset) -> None:
    played = Patch.model_validate({**dict(guitar), "mode": "poly"})
    value = round(127 * math.log(0.5 / SLIDE_S[0]) / math.log(SLIDE_S[1] / SLIDE_S[0]))  # half a second
    sound = play(
        played,
        preset,
        1.4,
        (0.0, Controller(PORTAMENTO, 127)),
        (0.0, Controller(SLIDE_TIME, value)),
        (0.0, Controller(LEGATO, 127)),
        (0.0, NoteOn(KEY, 40)),
        (0.4, NoteOn(KEY + 5, 40)),
    )
    middle = first_hz(sound, 0.6, 0.9 * hz_of(KEY), 1.5 * hz_of(KEY), 4_800)
    assert hz_of(KEY + 1.5) < middle < hz_of(KEY + 3.8)
    assert first_hz(sound, 1.1, 0.9 * hz_of(KEY), 1.5 * hz_of(KEY)) == pytest.approx(hz_of(KEY + 5), rel=0.004)
