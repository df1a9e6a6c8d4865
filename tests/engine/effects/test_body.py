"""The body: its modes are where the model has them, whatever the rate; how loud it is; what it refuses."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from engine.effects import Body, Impulse
from engine.effects.body import GUITAR, _response, modes_of


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
    frequency_hz, decay, _ = modes_of(GUITAR, 1.0, 0.45 * rate_hz)
    np.testing.assert_allclose(frequency_hz[:6], [mode.frequency_hz for mode in GUITAR.lowest])
    response = Body().response(rate_hz)[:2000, 0]
    time_s = np.arange(len(response)) / rate_hz
    rings = np.exp(np.multiply.outer(time_s, -decay + 2j * np.pi * frequency_hz))
    subsonic = np.exp(np.multiply.outer(time_s, [2 * np.pi * 55 * np.exp(0.75j * np.pi)]))
    basis = np.concatenate([rings.real, rings.imag, subsonic.real, subsonic.imag], 1)
    fitted = basis @ np.linalg.lstsq(basis, response, rcond=None)[0]
    assert np.linalg.norm(fitted - response) < 0.02 * np.linalg.norm(response)


def test_the_higher_modes_are_as_dense_as_the_plates() -> None:
    frequency_hz, _, _ = modes_of(GUITAR, 1.0, 10_000.0)
    higher = frequency_hz[len(GUITAR.lowest) :]
    assert len(higher) / (10_000 - 460) == pytest.approx(GUITAR.plate.modes_a_hertz, rel=0.05)
    assert 1 / GUITAR.plate.modes_a_hertz == pytest.approx(39, abs=1)  # Hz


def test_it_is_the_same_body_each_time_and_at_each_rate() -> None:
    once = Body().response(48_000)
    _response.cache_clear()
    np.testing.assert_array_equal(once, Body().response(48_000))
    (low_hz, low), (high_hz, high) = spectrum(Body(), 48_000), spectrum(Body(), 96_000)
    heard = (low_hz > 90) & (low_hz < 5_000)
    other = high[: len(low)]
    np.testing.assert_array_equal(low_hz, high_hz[: len(low_hz)])
    assert np.linalg.norm((other - low)[heard]) < 0.05 * np.linalg.norm(low[heard])


def test_it_is_short_and_ends_softly() -> None:
    found = Body().response(48_000)[:, 0]
    assert len(found) / 48_000 == pytest.approx(0.35, abs=0.005)
    assert np.abs(found[-480:]).max() < 1e-3 * np.abs(found).max()


def test_an_impulse_of_ones_own_sounds_in_its_place_and_at_its_size() -> None:
    time_s = np.arange(22_050) / 44_100
    rung = np.exp(-20 * time_s) * np.sin(2 * np.pi * 300 * time_s)
    own = Impulse(np.stack([rung, rung], 1), 44_100)
    for size in (1.0, 1.5):
        frequency_hz, found = spectrum(Body(size=size, impulse=own), 48_000)
        assert frequency_hz[found.argmax()] == pytest.approx(300 / size, abs=1)
        assert Body(size=size, impulse=own).response(48_000).shape == (round(24_000 * size), 2)


def test_one_that_is_stretched_too_long_is_faded_out() -> None:
    own = Impulse(np.random.default_rng(0).standard_normal((2 * 48_000, 1)), 48_000)
    found = Body(size=2.0, impulse=own).response(48_000)
    assert len(found) == 3 * 48_000 and abs(found[-1, 0]) < 1e-12


@pytest.mark.parametrize(
    ("values", "told"),
    [({"mix": 1.1}, "mix"), ({"mix": float("nan")}, "mix"), ({"size": 0.1}, "size"), ({"name": "lute"}, "guitar")],
)
def test_what_is_out_of_range_is_told(values: dict[str, object], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        Body(**values)  # type: ignore[arg-type]
