"""Noise of contact: its energy, when it sounds, and that it never sounds where model and truth are compared."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.instruments.instrument import Fretted, Instrument, Noise
from app.instruments.library import SHIPPED, list_instruments
from app.player.events import KEYS, ControlChange, NoteOff, NoteOn, TimedEvent
from app.player.offline import render_events, render_note
from engine.contact import CONTACTS
from engine.kernels import constants as of
from engine.kernels.constants import PART_S, WANTED_DB
from engine.kernels.midi import LEGATO, SOUND_OFF, SUSTAIN
from engine.presets import Preset
from engine.values.ear import Ear
from tests.app.player.conftest import STEEL
from tests.app.player.stage import RATE_HZ, Sound, Stage, Timed, changed

RELEASED_S, SECONDS = 0.3, 0.8
KEY = 52
ON, OFF = (0.0, NoteOn(KEY, 100)), (RELEASED_S, NoteOff(KEY))


def noise_of(
    instrument: Instrument,
    preset: Preset,
    *events: Timed,
    rate_hz: int = RATE_HZ,
    seconds: float = SECONDS,
    source: str = "model",
    **levels: object,
) -> Sound:
    """What an instrument with noise has more than the same without."""
    timed, sounds = [TimedEvent(*event) for event in events], []
    for each in (changed(instrument, noise=Noise.model_validate(levels)), instrument):
        blocks = list(render_events(each, preset, timed, rate_hz, source, seconds, limited=False))
        sounds.append(np.concatenate(blocks)[:, 0].astype(np.float64))
    return sounds[0] - sounds[1]


def energy_db(sound: Sound, rate_hz: int = RATE_HZ) -> float:
    """Re a note of the wanted loudness."""
    return float(10 * np.log10(np.square(sound).sum() / rate_hz / PART_S) - WANTED_DB)


def tick_db(instrument: Instrument, preset: Preset, kind: str, *events: Timed) -> float:
    """Energy of the noise of releases in these events."""
    return energy_db(noise_of(instrument, preset, *events, seconds=events[-1][0] + 0.4, kind=kind, release_db=-6.0))


@pytest.mark.parametrize("kind", CONTACTS)
@pytest.mark.parametrize(("level", "begins_s"), [("onset_db", 0.0), ("release_db", RELEASED_S)])
def test_a_noise_has_its_energy_and_begins_with_its_contact(
    instrument: Instrument, preset: Preset, kind: str, level: str, begins_s: float
) -> None:
    noise = noise_of(instrument, preset, ON, OFF, kind=kind, **{level: -6.0})
    assert energy_db(noise) == pytest.approx(-6.0, abs=2.5)  # bursts are random
    begin = round(begins_s * RATE_HZ)
    assert not noise[:begin].any() and noise[begin : begin + 480].any()
    assert np.abs(noise[begin + round(0.35 * RATE_HZ) :]).max() < 1e-6


def test_a_noise_is_as_loud_at_every_rate(instrument: Instrument, preset: Preset) -> None:
    rates_hz = (44_100, 96_000)
    noises = [noise_of(instrument, preset, ON, rate_hz=rate_hz, kind="hammer", onset_db=0.0) for rate_hz in rates_hz]
    one, other = (energy_db(noise, rate_hz) for noise, rate_hz in zip(noises, rates_hz, strict=True))
    assert one == pytest.approx(other, abs=2.0)


@pytest.mark.parametrize(("kind", "follows"), [("nail", 1.0), ("quill", 0.0)])
def test_a_harder_stroke_is_noisier_and_brighter_but_a_quill_is_not(
    instrument: Instrument, preset: Preset, kind: str, follows: float
) -> None:
    ratio_db = 20 * np.log10(instrument.pluck.pluck(110).amplitude_mm / instrument.pluck.pluck(50).amplitude_mm)
    noises = [noise_of(instrument, preset, (0.0, NoteOn(KEY, v)), kind=kind, onset_db=0.0) for v in (50, 110)]
    assert energy_db(noises[1]) - energy_db(noises[0]) == pytest.approx(follows * ratio_db, abs=1.0)
    powers = [np.abs(np.fft.rfft(each[:4_800])) ** 2 for each in noises]
    soft, hard = (np.average(np.arange(len(each)), weights=each) for each in powers)
    assert hard > soft


def test_comparisons_are_without_noise(instrument: Instrument, preset: Preset) -> None:
    """One source alone has it, whichever it is."""
    model, truth, difference = (
        noise_of(instrument, preset, ON, OFF, source=source, kind="plectrum", onset_db=6.0, release_db=6.0)
        for source in ("model", "truth", "difference")
    )
    np.testing.assert_allclose(model, truth, atol=1e-6)
    assert np.abs(model).max() > 0.01 and not difference.any()


@pytest.mark.parametrize(("variation", "alike"), [(0.0, True), (1e-9, False)])
def test_the_same_strokes_have_the_same_noise_and_others_another(
    instrument: Instrument, preset: Preset, variation: float, alike: bool
) -> None:
    varied = changed(instrument, pluck={"variation": variation})
    noise = noise_of(varied, preset, ON, (0.1, NoteOn(KEY, 100)), kind="nail", onset_db=0.0)
    first, second = noise[:2_000], noise[4_800:6_800]
    apart = np.square(first - second).sum() / np.square(first).sum()
    assert apart < 1e-6 if alike else apart > 0.3


def held_db(instrument: Instrument, preset: Preset, velocity: int, time_s: float) -> float:
    """The level of a key that is held, over 20 ms."""
    blocks = render_events(
        instrument, preset, [TimedEvent(0.0, NoteOn(KEY, velocity))], RATE_HZ, seconds=time_s + 0.02
    )
    part = np.concatenate(list(blocks))[round(time_s * RATE_HZ) :, 0].astype(np.float64)
    return float(10 * np.log10(np.square(part).mean()))


@pytest.mark.parametrize("kind", [kind for kind in CONTACTS if kind != "quill"])
def test_what_lands_on_a_string_is_as_loud_as_its_motion(instrument: Instrument, preset: Preset, kind: str) -> None:
    """By velocity, by time, and by a pedal that keeps the string ringing."""
    found = {}
    for velocity, time_s in ((127, 0.1), (127, 1.0), (30, 0.1), (10, 1.0)):
        found[velocity, time_s] = tick_db(
            instrument, preset, kind, (0.0, NoteOn(KEY, velocity)), (time_s, NoteOff(KEY))
        )
        expected = held_db(instrument, preset, velocity, time_s) - held_db(instrument, preset, 127, 0.1)
        assert found[velocity, time_s] - found[127, 0.1] == pytest.approx(expected, abs=2.0)
    down, up = (0.0, ControlChange(SUSTAIN, 127)), (1.0, ControlChange(SUSTAIN, 0))
    kept = tick_db(instrument, preset, kind, down, (0.0, NoteOn(KEY, 127)), (0.1, NoteOff(KEY)), up)
    assert kept == pytest.approx(found[127, 1.0], abs=0.5)


def test_a_mechanism_falls_alike_on_every_string(instrument: Instrument, preset: Preset) -> None:
    struck = ((10, 0.1), (127, 0.1), (64, 2.0))
    found = [tick_db(instrument, preset, "quill", (0.0, NoteOn(KEY, v)), (t, NoteOff(KEY))) for v, t in struck]
    assert max(found) - min(found) < 0.1


def test_what_lands_on_a_string_at_rest_is_hardly_heard(instrument: Instrument, preset: Preset) -> None:
    string = replace(STEEL, damping_d1_kg_m_s=400 * STEEL.damping_d1_kg_m_s)
    dull, on = changed(instrument, strings=Fretted(string=string)), (0.0, NoteOn(KEY, 127))
    at_once, late = (tick_db(dull, preset, "finger", on, (time_s, NoteOff(KEY))) for time_s in (0.01, 0.4))
    assert held_db(dull, preset, 127, 0.4) < held_db(dull, preset, 127, 0.01) - 50
    assert -36 < late - at_once < -28  # there is a floor


def test_a_finger_that_moves_along_a_string_lands_on_its_motion(instrument: Instrument, preset: Preset) -> None:
    legato, found = (0.0, ControlChange(LEGATO, 127)), []
    for velocity in (30, 110):
        moved = (0.0, NoteOn(KEY, velocity)), (0.2, NoteOn(KEY + 2, velocity))
        found.append(tick_db(instrument, preset, "finger", legato, *moved))
    quieter = instrument.pluck.pluck(30).amplitude_mm / instrument.pluck.pluck(110).amplitude_mm
    assert found[0] - found[1] == pytest.approx(20 * np.log10(quieter), abs=1.5)


def test_a_repeated_key_has_the_release_of_its_latest_stroke(instrument: Instrument, preset: Preset) -> None:
    hard, soft = (0.0, NoteOn(KEY, 110)), (0.2, NoteOn(KEY, 20))
    after = tick_db(instrument, preset, "finger", hard, soft, OFF, OFF)  # a release for each stroke
    assert after == pytest.approx(tick_db(instrument, preset, "finger", soft, OFF), abs=0.5)


RELEASED = [entry.instrument for entry in list_instruments(SHIPPED)[0] if entry.instrument.noise.release_db > -60]


@pytest.mark.parametrize("instrument", RELEASED, ids=lambda instrument: instrument.name)
def test_no_instrument_releases_louder_than_it_plays(instrument: Instrument, preset: Preset) -> None:
    """Soft or hard, the tick is well below its note."""
    dry, key, frames = instrument.with_value("room.mix", 0.0), sum(instrument.range) // 2, round(0.03 * RATE_HZ)
    for velocity in (10, 127):
        note, silent = (
            render_note(each, preset, key, velocity, 0.15, 0.25, RATE_HZ).astype(np.float64).mean(1)
            for each in (dry, dry.with_value("noise.release_db", -60.0))
        )
        loudest = [np.convolve(part**2, np.ones(frames)).max() for part in (note - silent, silent)]
        assert 10 * np.log10(loudest[0] / loudest[1]) < -5.0


def test_strings_that_are_let_ring_have_no_noise_of_release(instrument: Instrument, preset: Preset) -> None:
    rings = changed(instrument, damping={"let_ring": True})
    assert not noise_of(rings, preset, ON, OFF, kind="finger", release_db=6.0).any()


def test_a_stop_silences_noise(instrument: Instrument, preset: Preset) -> None:
    stop = (0.002, ControlChange(SOUND_OFF, 0, KEYS))
    noise = noise_of(instrument, preset, ON, stop, seconds=0.2, kind="hammer", onset_db=6.0)
    assert np.abs(noise[:400]).max() > 0.01 and not noise[round(0.04 * RATE_HZ) :].any()


def test_many_strokes_at_once_keep_within_the_places_of_noises(instrument: Instrument, preset: Preset) -> None:
    stage = Stage(changed(instrument, noise=Noise(onset_db=0.0)), preset, most=96)
    for key in range(30, 30 + of.MOST_NOISES + 8):
        stage.player.handle(NoteOn(key, 100))
    assert np.isfinite(stage.left(4_800)).all()
    assert np.all(stage.player.compiled.record["noises"]["left"] >= 0)


def test_a_solo_of_one_partial_is_without_noise(instrument: Instrument, preset: Preset) -> None:
    sounds = []
    for each in (changed(instrument, noise=Noise(onset_db=6.0)), instrument):
        stage = Stage(each, preset)
        stage.player.take(stage.player.keys_of(each, Ear((0.2,), solo=2)))
        stage.player.handle(NoteOn(KEY, 100))
        sounds.append(stage.left(4_800))
    np.testing.assert_array_equal(*sounds)
