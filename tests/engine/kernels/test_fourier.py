"""The transform without memory of its own against NumPy's."""

from __future__ import annotations

import numpy as np
import pytest

from engine.kernels.fourier import transform

TURNS = 2 * np.pi * np.arange(2048) / 2048


@pytest.mark.parametrize("size", [2, 8, 128, 2048])
def test_it_is_numpys_and_with_its_parts_exchanged_the_inverse(size: int) -> None:
    re, im = np.random.default_rng(size).standard_normal((2, size))
    given = re + 1j * im
    room = np.empty((2, size))
    transform(re, im, *room, np.cos(TURNS), np.sin(TURNS))
    passes_are_even = size not in (2,)
    found = re + 1j * im if passes_are_even else room[0] + 1j * room[1]
    np.testing.assert_allclose(found, np.fft.fft(given), atol=1e-12 * size)
    if passes_are_even:
        transform(im, re, room[1], room[0], np.cos(TURNS), np.sin(TURNS))
        np.testing.assert_allclose((re + 1j * im) / size, given, atol=1e-13)
