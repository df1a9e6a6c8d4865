"""The transforms without memory of their own against NumPy's."""

from __future__ import annotations

import numpy as np
import pytest

from engine.kernels import fourier

TURNS = 2 * np.pi * np.arange(2048) / 2048


@pytest.mark.parametrize("size", [2, 4, 8, 16, 128, 1024, 2048])
def test_it_is_numpys_and_with_its_parts_exchanged_the_inverse(size: int) -> None:
    re, im = np.random.default_rng(size).standard_normal((2, size))
    given = re + 1j * im
    room = np.empty((2, size))
    fourier.transform(re, im, *room, np.cos(TURNS), np.sin(TURNS))
    np.testing.assert_allclose(re + 1j * im, np.fft.fft(given), atol=1e-12 * size)
    fourier.transform(im, re, room[1], room[0], np.cos(TURNS), np.sin(TURNS))
    np.testing.assert_allclose((re + 1j * im) / size, given, atol=1e-13)


@pytest.mark.parametrize(("size", "period"), [(64, 21), (1024, 300), (1024, 331), (2048, 683), (2048, 7919)])
def test_any_period_is_the_sum_over_its_frequencies(size: int, period: int) -> None:
    """From places on both sides of 0 to places on both sides of it."""
    draw = np.random.default_rng(period)
    below, given, lowest, wanted = size // 8, size // 4, size // 16, size // 3
    times, places = np.arange(-below, given), np.arange(-lowest, wanted)
    signal = draw.standard_normal(len(times)) + 1j * draw.standard_normal(len(times))
    work = np.zeros((fourier.ROWS, size))
    fourier.fill_circle(work[fourier.COSINES], work[fourier.SINES])
    work[fourier.ONE, times], work[fourier.ONE + 1, times] = signal.real, signal.imag
    fourier.turn_any(work, period, given, wanted, given - 1 + lowest, size)
    found = work[fourier.ONE, places] + 1j * work[fourier.ONE + 1, places]
    expected = np.exp(-2j * np.pi * (np.multiply.outer(places, times) % period) / period) @ signal
    np.testing.assert_allclose(found, expected, atol=1e-13 * size)
