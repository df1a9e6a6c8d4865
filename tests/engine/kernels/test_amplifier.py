"""The amplifier: harmonics as its shape gives them, without aliases; level; silence where it is off."""

from __future__ import annotations

import numpy as np
import pytest

from engine.kernels import amplifier
from engine.kernels.constants import QUANTUM
from engine.kernels.mixer_records import MIXER
from engine.values.effects import Amp
from tests.engine.sounds import RATE_HZ, Signal, amplified

SIZE = 2**15
FULL_DB = 36.0


def tone(hz: float, peak: float, frames: int = 2 * SIZE, rate_hz: int = RATE_HZ) -> tuple[int, Signal]:
    """A sine (frames, 2) with a whole and odd number of periods in SIZE frames, and that number."""
    periods = round(hz / rate_hz * SIZE) | 1
    wave = peak * np.sin(2 * np.pi * periods * np.arange(frames) / SIZE)
    return periods, np.repeat(wave[:, None], 2, 1)


def spectrum(sound: Signal) -> Signal:
    """Peaks of the last SIZE frames, by periods in these."""
    return np.abs(np.fft.rfft(sound[-SIZE:, 0])) * 2 / SIZE


@pytest.mark.parametrize("drive_db", [6.0, 20.0, FULL_DB])
def test_harmonics_are_those_of_its_shape(drive_db: float) -> None:
    """By a sum over one period of x/√(1 + x²), which knows neither filters nor rates."""
    periods, sound = tone(1_000, 0.1)
    found = spectrum(amplified(Amp(drive_db), sound, RATE_HZ))
    hz = periods * RATE_HZ / SIZE
    mixer = np.zeros(1, MIXER)[0]
    amplifier.drive(mixer, drive_db, 0.0, 0.0)
    drive, gain = mixer["amplifier"]["wanted_drive"], mixer["amplifier"]["wanted_gain"]
    low = amplifier.COUPLING_HZ / hz
    angle = 2 * np.pi * np.arange(4096) / 4096
    x = amplifier.BIAS + drive * 0.1 / np.sqrt(1 + low**2) * np.sin(angle)
    expected = np.abs(np.fft.rfft(gain * x / np.sqrt(1 + x * x))) * 2 / 4096
    for harmonic in (1, 2, 3, 5):
        assert 20 * np.log10(found[harmonic * periods] / expected[harmonic]) == pytest.approx(0, abs=0.25), harmonic


@pytest.mark.parametrize("rate_hz", [44_100, 48_000, 96_000])
def test_aliases_of_5_khz_at_full_drive_are_80_db_below(rate_hz: int) -> None:
    periods, sound = tone(5_000, 1.0, rate_hz=rate_hz)
    found = spectrum(amplified(Amp(FULL_DB), sound, rate_hz))
    harmonic = np.zeros(len(found), bool)
    harmonic[::periods] = True
    assert found[3 * periods] > 0.2 * found[periods]  # it is driven hard
    assert 20 * np.log10(found[~harmonic].max() / found[periods]) < -80


@pytest.mark.parametrize("drive_db", [1.0, 12.0, FULL_DB])
def test_a_tone_of_nominal_level_keeps_it_and_another_level_changes_no_drive(drive_db: float) -> None:
    _, sound = tone(1_000, amplifier.NOMINAL)
    found, gain = amplified(Amp(drive_db, 3.0), sound, RATE_HZ), 10 ** (6 / 20)
    plain = amplified(Amp(drive_db), sound, RATE_HZ)
    assert 20 * np.log10(plain[-SIZE:].std() / sound.std()) == pytest.approx(0, abs=3)
    louder = amplified(Amp(drive_db, 3.0), sound * gain, RATE_HZ, level_db=6.0)
    np.testing.assert_allclose(louder, found * gain, atol=1e-12)


def test_tone_raises_one_side_and_lowers_the_other() -> None:
    for hz, sign in ((100, -1), (6_000, 1)):
        _, sound = tone(hz, 0.01)
        plain, bright = (amplified(Amp(1.0, each), sound, RATE_HZ)[-SIZE:].std() for each in (0.0, 6.0))
        assert 20 * np.log10(bright / plain) == pytest.approx(sign * 6, abs=1.5)


def test_off_it_leaves_every_sample_and_is_switched_without_a_click() -> None:
    _, sound = tone(200, 0.1, 64 * QUANTUM)
    np.testing.assert_array_equal(amplified(Amp(), sound, RATE_HZ), sound)
    mixer = np.zeros(1, MIXER)[0]
    mixer["rate_hz"] = RATE_HZ
    mix, found = mixer["mix"], []
    for number, first in enumerate(range(0, len(sound), QUANTUM)):
        amplifier.drive(mixer, 6.0 if 10 <= number < 40 else 0.0, 0.0, 0.0)
        mix[:] = sound[first : first + QUANTUM]
        amplifier.amplify(mixer)
        mixer["frames"] += QUANTUM
        found.append(mix.copy())
    whole = np.concatenate(found)[:, 0]
    assert np.abs(np.diff(whole)).max() < 1.6 * np.abs(np.diff(sound[:, 0])).max()
    assert not np.array_equal(whole[30 * QUANTUM : 31 * QUANTUM], sound[30 * QUANTUM : 31 * QUANTUM, 0])
    np.testing.assert_array_equal(whole[60 * QUANTUM :], sound[60 * QUANTUM :, 0])


def test_silence_stays_silence_after_what_was_driven() -> None:
    sound = np.concatenate([tone(200, 1.0, 4_800)[1], np.zeros((RATE_HZ, 2))])
    found = amplified(Amp(FULL_DB), sound, RATE_HZ)
    assert np.abs(found[-2_400:]).max() < 1e-5
