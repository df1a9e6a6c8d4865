"""Body and room: their modes and bands at any rate, how long they ring, and that they are wide."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from engine.effects import Body, Impulse
from engine.effects.body import modes_of
from engine.effects.body_table import BODIES
from engine.effects.room import room_response

GUITAR = BODIES["guitar"]


def spectrum(body: Body, rate_hz: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Frequencies in Hz, and how strongly the body alone answers."""
    size = 2 * rate_hz
    found = np.abs(np.fft.rfft(body.response(rate_hz)[:, 0], size))
    return np.fft.rfftfreq(size, 1 / rate_hz), found


@pytest.mark.parametrize("rate_hz", [44_100, 48_000, 96_000])
@pytest.mark.parametrize("size", [0.5, 1.0, 1.6])
def test_the_lowest_modes_are_at_their_frequencies(size: float, rate_hz: int) -> None:
    frequency_hz, found = spectrum(Body(size=size), rate_hz)
    for mode in GUITAR.lowest[:2]:  # the strong ones, alone in their range
        expected_hz = mode.frequency_hz / size
        near = (frequency_hz > 0.85 * expected_hz) & (frequency_hz < 1.15 * expected_hz)
        assert frequency_hz[near][found[near].argmax()] == pytest.approx(expected_hz, rel=0.01)


def test_every_low_mode_rings_with_its_decay() -> None:
    """Each is taken out of the response with its neighbours by least squares."""
    rate_hz = 8_000
    modes = modes_of(GUITAR)
    frequency_hz, decay = modes[:2, modes[0] < 0.45 * rate_hz]
    np.testing.assert_allclose(frequency_hz[:6], [mode.frequency_hz for mode in GUITAR.lowest])
    response = Body().response(rate_hz)[:2000, 0]
    time_s = np.arange(len(response)) / rate_hz
    rings = np.exp(np.multiply.outer(time_s, -decay + 2j * np.pi * frequency_hz))
    subsonic = np.exp(np.multiply.outer(time_s, [2 * np.pi * 55 * np.exp(0.75j * np.pi)]))
    basis = np.concatenate([rings.real, rings.imag, subsonic.real, subsonic.imag], 1)
    fitted = basis @ np.linalg.lstsq(basis, response, rcond=None)[0]
    assert np.linalg.norm(fitted - response) < 0.02 * np.linalg.norm(response)


@pytest.mark.parametrize("name", BODIES)
def test_each_body_has_its_modes_rings_out_and_names_its_sources(name: str) -> None:
    wood = BODIES[name]
    lowest_hz = [mode.frequency_hz for mode in wood.lowest]
    assert lowest_hz == sorted(lowest_hz) and len(lowest_hz) >= 4
    assert len(wood.sources) > 40 and wood.title
    modes = modes_of(wood)
    frequency_hz, decay = modes[:2, modes[0] < 20_000.0]
    assert (np.diff(frequency_hz) >= 0).all() and 0.5 < frequency_hz[-1] / 20_000 <= 1
    assert len(frequency_hz) < 1_500
    found = Body(name=name).response(48_000)
    assert found.shape[1] == 2 and np.isfinite(found).all()
    assert np.abs(found[-480:]).max() < 3e-3 * np.abs(found).max()
    assert np.exp(-decay[: len(lowest_hz)] * wood.seconds).max() < 0.05  # what is cut is faint


def test_left_and_right_part_where_the_body_is_larger_than_a_wave() -> None:
    found = np.fft.rfft(Body().response(48_000), 1 << 16, axis=0)
    frequency_hz = np.fft.rfftfreq(1 << 16, 1 / 48_000)

    def alike(low_hz: float, high_hz: float) -> float:
        left, right = found[(frequency_hz > low_hz) & (frequency_hz < high_hz)].T
        return float(abs(np.vdot(left, right)) / (np.linalg.norm(left) * np.linalg.norm(right)))

    assert alike(60, 250) > 0.9
    assert alike(3_000, 10_000) < 0.5


def test_an_impulse_of_ones_own_sounds_in_its_place_and_at_its_size() -> None:
    time_s = np.arange(22_050) / 44_100
    rung = np.exp(-20 * time_s) * np.sin(2 * np.pi * 300 * time_s)
    own = Impulse(np.stack([rung, rung], 1), 44_100)
    for size in (1.0, 1.5):
        frequency_hz, found = spectrum(Body(size=size, impulse=own), 48_000)
        assert frequency_hz[found.argmax()] == pytest.approx(300 / size, abs=1)
        assert Body(size=size, impulse=own).response(48_000).shape == (round(24_000 * size), 2)
    long = Impulse(np.random.default_rng(0).standard_normal((2 * 48_000, 1)), 48_000)
    found = Body(size=2.0, impulse=long).response(48_000)  # it is stretched too long, and faded out
    assert len(found) == 3 * 48_000 and abs(found[-1, 0]) < 1e-12


def t60_s(response: NDArray[np.float64], band_hz: tuple[float, float], rate_hz: int) -> float:
    """Schroeder's backward integral, from -5 to -35 dB."""
    heard = sosfiltfilt(butter(4, band_hz, "bandpass", fs=rate_hz, output="sos"), response)
    left = np.cumsum(heard[::-1] ** 2)[::-1]
    level_db = 10 * np.log10(left / left[0])
    first, last = (int(np.argmax(level_db < level)) for level in (-5, -35))
    return 2 * (last - first) / rate_hz


@pytest.mark.parametrize("wanted_s", [0.3, 0.8, 1.5, 3.0])
def test_it_rings_as_long_as_asked_and_shorter_where_it_is_high(wanted_s: float) -> None:
    for side in room_response(wanted_s, 48_000).T:
        middle_s = t60_s(side, (400.0, 630.0), 48_000)
        assert middle_s == pytest.approx(wanted_s, rel=0.12)
        assert t60_s(side, (7_000.0, 9_000.0), 48_000) == pytest.approx(0.4 * wanted_s, rel=0.2)
        assert t60_s(side, (1_700.0, 2_300.0), 48_000) < middle_s


def test_reflections_come_after_the_direct_sound_that_is_not_in_it() -> None:
    found = np.abs(room_response(0.8, 48_000))
    assert found[: round(0.002 * 48_000)].max() < 0.02 * found.max()
    assert found[: round(0.02 * 48_000)].max() > 0.5 * found.max()
    left, right = room_response(1.0, 48_000)[2_400:].T
    assert abs(np.corrcoef(left, right)[0, 1]) < 0.1  # it is wide
