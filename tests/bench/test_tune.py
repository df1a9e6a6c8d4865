"""What `bench tune` measures, on sounds whose pitch and loudness are known."""

from __future__ import annotations

import json

import numpy as np
import pytest

from tests.bench.tune import RATE_HZ, loudness_db, pitch_hz

TIMES = np.arange(RATE_HZ) / RATE_HZ


@pytest.mark.parametrize("frequency_hz", [30.87, 440.0, 1480.0])
def test_pitch_is_that_of_the_partial_to_a_hundredth_of_a_cent(frequency_hz: float) -> None:
    sound = np.exp(-2 * TIMES) * (
        np.sin(2 * np.pi * frequency_hz * TIMES) + np.sin(2 * np.pi * 2.01 * frequency_hz * TIMES)
    )
    assert abs(1200 * np.log2(pitch_hz(sound, frequency_hz * 1.01) / frequency_hz)) < 0.01
    assert np.isnan(pitch_hz(np.zeros(RATE_HZ), frequency_hz))


def test_loudness_is_that_of_broadcasters() -> None:
    """BS.1770: a sine of 997 Hz at full scale is -3.01 LUFS, whose constant of -0.691 dB is its weighting there."""
    sine = np.sin(2 * np.pi * 997 * TIMES)[:, None]
    assert loudness_db(sine) == pytest.approx(-3.01 + 0.691, abs=0.05)
    assert loudness_db(0.1 * sine) == pytest.approx(-23.01 + 0.691, abs=0.05)
    low = np.sin(2 * np.pi * 40 * TIMES)[:, None]
    assert loudness_db(low) < loudness_db(sine) - 5


def test_the_command_prints_what_it_heard(run) -> None:
    found = run("tune", "tanpura_drone", "--every", "24", "--json")
    assert found.status == 0
    (patch,) = json.loads(found.out)["patches"]
    assert patch["cents"] < 0.5
    assert patch["spread_db"] < 3
    assert patch["hands_rel_mse"] < 1e-6
    assert patch["chord_peak_db"] < 0
    assert run("tune", "nothing").status == 1
