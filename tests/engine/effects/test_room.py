"""The room: how long it rings in each band, what comes first, that it is wide and the same at any rate."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from engine.effects.room import room_response


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
