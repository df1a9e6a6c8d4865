"""How loud instruments are: keys, chords and drums; and the noise of contact, which is never compared."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from app.instruments.instrument import Fretted, Instrument, Noise
from app.instruments.library import SHIPPED, find_instrument, list_instruments
from app.player.events import KEYS, ControlChange, NoteOff, NoteOn, TimedEvent
from app.player.offline import render_events, render_note
from engine.contact import CONTACTS
from engine.kernels.constants import HIGHEST_PEAK_DB, PART_S, REFERENCE_VELOCITY, WANTED_DB
from engine.kernels.limiter import CEILING
from engine.kernels.loudness import k_weight
from engine.kernels.midi import LEGATO, SOUND_OFF, SUSTAIN
from tests.app.player.conftest import STEEL
from tests.app.player.stage import PRESET, RATE_HZ, Sound, Stage, Timed, changed, play

RELEASED_S, SECONDS = 0.3, 0.7
KEY = 52
ON, OFF = (0.0, NoteOn(KEY, 100)), (RELEASED_S, NoteOff(KEY))


def noise_of(
    instrument: Instrument, *events: Timed, seconds: float = SECONDS, source: str = "model", **levels: object
) -> Sound:
    """What an instrument with noise has more than the same without."""
    noisy = changed(instrument, noise=Noise.model_validate(levels))
    with_it, without = (play(each, seconds, *events, source=source) for each in (noisy, instrument))
    return with_it - without


def energy_db(sound: Sound) -> float:
    """Re a note of the wanted loudness."""
    return float(10 * np.log10(np.square(sound).sum() / RATE_HZ / PART_S) - WANTED_DB)


@pytest.mark.parametrize("kind", CONTACTS)
@pytest.mark.parametrize(("level", "begins_s"), [("onset_db", 0.0), ("release_db", RELEASED_S)])
def test_a_noise_has_its_energy_and_begins_with_its_contact(instrument, kind, level, begins_s):
    noise = noise_of(instrument, ON, OFF, kind=kind, **{level: -6.0})
    assert energy_db(noise) == pytest.approx(-6.0, abs=2.5)  # bursts are random
    begin = round(begins_s * RATE_HZ)
    assert not noise[:begin].any() and noise[begin : begin + 480].any()
    assert np.abs(noise[begin + round(0.35 * RATE_HZ) :]).max() < 1e-6


@pytest.mark.parametrize(("kind", "follows"), [("nail", 1.0), ("quill", 0.0)])
def test_a_harder_stroke_is_noisier_and_brighter_but_a_quill_is_not(instrument, kind, follows):
    ratio_db = 20 * np.log10(instrument.pluck.pluck(110).amplitude_mm / instrument.pluck.pluck(50).amplitude_mm)
    noises = [noise_of(instrument, (0.0, NoteOn(KEY, v)), kind=kind, onset_db=0.0) for v in (50, 110)]
    assert energy_db(noises[1]) - energy_db(noises[0]) == pytest.approx(follows * ratio_db, abs=1.0)
    soft, hard = (np.average(np.arange(2_401), weights=np.abs(np.fft.rfft(each[:4_800])) ** 2) for each in noises)
    assert hard > soft


LEGATO_ON, PEDAL = (0.0, ControlChange(LEGATO, 127)), (0.0, ControlChange(SUSTAIN, 127))


def struck(velocity: int, held_s: float) -> tuple[Timed, Timed]:
    return (0.0, NoteOn(KEY, velocity)), (held_s, NoteOff(KEY))


def moved(velocity: int) -> tuple[Timed, ...]:
    return LEGATO_ON, (0.0, NoteOn(KEY, velocity)), (0.2, NoteOn(KEY + 2, velocity))


@pytest.mark.parametrize(
    ("kind", "one", "other", "apart"),
    [
        ("quill", struck(10, 0.1), struck(127, 0.1), (-0.1, 0.1)),  # a mechanism falls alike on every string
        ("quill", struck(64, 1.0), struck(127, 0.1), (-0.1, 0.1)),
        ("finger", struck(30, 0.1), struck(127, 0.1), (-26.6, -22.6)),  # as their strings move
        ("nail", struck(30, 0.1), struck(127, 0.1), (-26.6, -22.6)),
        ("finger", (PEDAL, *struck(127, 0.1), (1.0, ControlChange(SUSTAIN, 0))), struck(127, 1.0), (-0.5, 0.5)),
        ("finger", moved(30), moved(110), (-22.0, -19.0)),
        ("finger", (ON, (0.2, NoteOn(KEY, 20)), OFF, OFF), ((0.2, NoteOn(KEY, 20)), OFF), (-0.5, 0.5)),
    ],
)
def test_a_release_is_as_loud_as_what_it_lands_on(instrument, kind, one, other, apart):
    found = [
        energy_db(noise_of(instrument, *each, seconds=each[-1][0] + 0.4, kind=kind, release_db=-6.0))
        for each in (one, other)
    ]
    assert apart[0] <= found[0] - found[1] <= apart[1]


def test_there_is_hardly_noise_on_a_string_at_rest_and_none_after_a_stop_or_of_strings_that_are_let_ring(instrument):
    string = replace(STEEL, damping_d1_kg_m_s=400 * STEEL.damping_d1_kg_m_s)
    dull, tick = changed(instrument, strings=Fretted(string=string)), {"kind": "finger", "release_db": 6.0}
    at_once, late = (energy_db(noise_of(dull, *struck(127, time_s), **tick)) for time_s in (0.01, 0.4))
    assert -36 < late - at_once < -28  # there is a floor
    assert not noise_of(changed(instrument, damping={"let_ring": True}), ON, OFF, **tick).any()
    stop = (0.002, ControlChange(SOUND_OFF, 0, KEYS))
    noise = noise_of(instrument, ON, stop, seconds=0.2, kind="hammer", onset_db=6.0)
    assert np.abs(noise[:400]).max() > 0.01 and not noise[round(0.04 * RATE_HZ) :].any()


def test_comparisons_are_without_noise(instrument):
    model, truth, difference = (
        noise_of(instrument, ON, OFF, source=source, kind="plectrum", onset_db=6.0, release_db=6.0)
        for source in ("model", "truth", "difference")
    )
    np.testing.assert_allclose(model, truth, atol=1e-6)
    assert np.abs(model).max() > 0.01 and not difference.any()


@pytest.mark.parametrize(("variation", "alike"), [(0.0, True), (1e-9, False)])
def test_the_same_strokes_have_the_same_noise_and_others_another(instrument, variation, alike):
    sounds, struck_twice = [], [(frame, NoteOn(KEY, 100)) for frame in (0, 4_800)]
    for onset_db in (0.0, -60.0):
        varied = changed(instrument, pluck={"variation": variation}, noise=Noise(kind="nail", onset_db=onset_db))
        sounds.append(Stage(varied).run(struck_twice, 7_040)[:, 0])
    noise = sounds[0] - sounds[1]
    first, second = noise[:2_000], noise[4_800:6_800]
    apart = np.square(first - second).sum() / np.square(first).sum()
    assert apart < 1e-6 if alike else apart > 0.3


E_MAJOR = (40, 47, 52, 56, 59, 64)
STRUM_S = 0.01  # from key to key
INSTRUMENTS = [entry.instrument for entry in list_instruments(SHIPPED)[0] if entry.instrument.strings.kind != "drums"]


def loudness_db(sound: NDArray[np.float32]) -> float:
    """The K-weighted level of its first part (frames, channels)."""
    part = sound[: round(PART_S * RATE_HZ)]
    power = 2 * np.abs(np.fft.rfft(part, axis=0)) ** 2 / len(part) ** 2
    weighted = power * k_weight(np.fft.rfftfreq(len(part), 1 / RATE_HZ))[:, None]
    return float(10 * np.log10(weighted.sum(0).mean()))


def peak_db(instrument: Instrument, keys: tuple[int, ...], apart_s: float) -> float:
    """The peak before the limiter, of the attacks of keys at the reference velocity, in dB relative to full scale."""
    events = [TimedEvent(n * apart_s, NoteOn(key, REFERENCE_VELOCITY, n)) for n, key in enumerate(keys)]
    blocks = render_events(instrument, PRESET, events, RATE_HZ, seconds=len(keys) * apart_s + 0.15, limited=False)
    return 20 * float(np.log10(max(np.abs(block).max() for block in blocks)))


def test_no_key_peaks_much_above_the_highest_peak_and_six_that_are_strummed_stay_below_the_limiter():
    """Peaks of five keys are estimated; at others, and through bodies, one may be 2.5 dB higher."""
    for instrument in INSTRUMENTS:
        low, high = instrument.range
        keys = tuple(low + step * (high - low) // 6 for step in range(1, 7))
        assert max(peak_db(instrument, (key,), 0.0) for key in keys[:5:2]) < HIGHEST_PEAK_DB + 2.5, instrument.name
        chord = tuple(key for key in E_MAJOR if low <= key <= high) if low <= 40 and high >= 64 else keys
        assert -20 < peak_db(instrument, chord, STRUM_S) < 20 * np.log10(CEILING), instrument.name


@pytest.mark.parametrize("name", ["Classical guitar", "Electric bass", "Cimbalom", "Falling nylon"])
def test_keys_are_equally_loud_as_they_sound(name):
    """Without what keys are not made equally loud by: body, room, amplifier and noise."""
    instrument = find_instrument(name).instrument.with_values(
        {"body.mix": 0.0, "room.mix": 0.0, "noise.onset_db": -60.0}
    )
    for each in (
        instrument,
        instrument.with_values({"pluck.position": 0.31, "knobs.gauge": 1.2, "pluck.curve": 0.4}),
    ):
        keys = np.linspace(*each.range, 7).astype(int).tolist()
        sounds = [render_note(each, PRESET, key, REFERENCE_VELOCITY, 1.0, PART_S, RATE_HZ) for key in keys]
        found = [loudness_db(sound) for sound in sounds]
        assert max(found) - min(found) < 1.5
