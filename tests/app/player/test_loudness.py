"""How loud instruments are: a note, and chords, before the limiter."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from app.instruments.instrument import Instrument
from app.instruments.library import SHIPPED, find_instrument, list_instruments
from app.player.events import NoteOn, TimedEvent
from app.player.offline import render_events, render_note
from engine.kernels.constants import HIGHEST_PEAK_DB, PART_S, REFERENCE_VELOCITY, WANTED_DB
from engine.kernels.limiter import CEILING
from engine.kernels.loudness import k_weight
from engine.presets import Preset
from tests.app.player.stage import RATE_HZ

E_MAJOR = (40, 47, 52, 56, 59, 64)
STRUM_S = 0.01  # from key to key
INSTRUMENTS = [entry.instrument for entry in list_instruments(SHIPPED)[0] if entry.instrument.strings.kind != "drums"]


def loudness_db(sound: NDArray[np.float32]) -> float:
    """The K-weighted level of its first part (frames, channels)."""
    part = sound[: round(PART_S * RATE_HZ)]
    power = 2 * np.abs(np.fft.rfft(part, axis=0)) ** 2 / len(part) ** 2
    weighted = power * k_weight(np.fft.rfftfreq(len(part), 1 / RATE_HZ))[:, None]
    return float(10 * np.log10(weighted.sum(0).mean()))


def peak_db(instrument: Instrument, preset: Preset, keys: tuple[int, ...], apart_s: float) -> float:
    """The peak before the limiter, of the attacks of keys at the reference velocity, in dB relative to full scale."""
    events = [TimedEvent(n * apart_s, NoteOn(key, REFERENCE_VELOCITY, n)) for n, key in enumerate(keys)]
    blocks = render_events(instrument, preset, events, RATE_HZ, seconds=len(keys) * apart_s + 0.15, limited=False)
    return 20 * float(np.log10(max(np.abs(block).max() for block in blocks)))


def test_six_strummed_keys_of_a_guitar_peak_at_nine_db(preset: Preset) -> None:
    guitar = find_instrument("Classical guitar").instrument
    strummed = [peak_db(guitar, preset, E_MAJOR, apart_s) for apart_s in (0.005, 0.01, 0.02, 0.04)]
    assert np.mean(strummed) == pytest.approx(-9, abs=1) and max(strummed) < -6.5
    assert np.mean([peak_db(guitar, preset, (key,), STRUM_S) for key in E_MAJOR]) == pytest.approx(-18, abs=1)


def test_no_key_peaks_much_above_the_highest_peak_and_six_that_are_strummed_stay_below_the_limiter(
    preset: Preset,
) -> None:
    """Peaks of five keys are estimated; at others, and through bodies, one may be 2.5 dB higher."""
    for instrument in INSTRUMENTS:
        low, high = instrument.range
        keys = tuple(low + step * (high - low) // 6 for step in range(1, 7))
        assert max(peak_db(instrument, preset, (key,), 0.0) for key in keys[:5:2]) < HIGHEST_PEAK_DB + 2.5, (
            instrument.name
        )
        chord = tuple(key for key in E_MAJOR if low <= key <= high) if low <= 40 and high >= 64 else keys
        assert -20 < peak_db(instrument, preset, chord, STRUM_S) < 20 * np.log10(CEILING), instrument.name


@pytest.mark.parametrize("name", ["Classical guitar", "Electric bass", "Cimbalom", "Falling nylon"])
def test_keys_are_equally_loud_as_they_sound(name: str, preset: Preset) -> None:
    """Without what keys are not made equally loud by: body, room, amplifier and noise."""
    instrument = find_instrument(name).instrument.with_values(
        {"body.mix": 0.0, "room.mix": 0.0, "noise.onset_db": -60.0}
    )
    for each in (
        instrument,
        instrument.with_values({"pluck.position": 0.31, "knobs.gauge": 1.2, "pluck.curve": 0.4}),
    ):
        keys = np.linspace(*each.range, 7).astype(int).tolist()
        sounds = [render_note(each, preset, key, REFERENCE_VELOCITY, 1.0, PART_S, RATE_HZ) for key in keys]
        found = [loudness_db(sound) for sound in sounds]
        assert max(found) - min(found) < 1.5


@pytest.mark.parametrize("name", ["Timpani", "Thin bars"])
def test_drums_are_as_loud_as_strings_unless_they_would_peak_too_high(name: str, preset: Preset) -> None:
    instrument = find_instrument(name).instrument
    low, high = instrument.range
    for key in (low + 2, (low + high) // 2, high - 2):
        sound = render_note(instrument, preset, key, REFERENCE_VELOCITY, 0.5, 0.5, RATE_HZ, "truth")
        over = loudness_db(sound) - WANTED_DB
        peak_over = 20 * np.log10(np.abs(sound).max()) - HIGHEST_PEAK_DB
        assert -1.5 < max(over, peak_over) < 1.5
