"""Large numbers cost nothing."""

import math

import pytest

from engine.resonators.string import undamped_frequencies
from engine.values.string import StringParameters


@pytest.mark.parametrize("frequency_hz", [0.0, 100.0, 246.93, 20_000.0, 1e6])
@pytest.mark.parametrize("change", [{}, {"second_moment_m4": 0}, {"length_m": 90}])
def test_modes_below_counts_them_and_costs_nothing(change, frequency_hz):
    string = StringParameters(**change)
    count = string.modes_below(frequency_hz)
    omega = undamped_frequencies(string, count + 2)
    assert int((omega < 2 * math.pi * frequency_hz).sum()) == count
    # the table of all modes would take 15 TB here
    string = StringParameters(length_m=100.0, tension_n=1e-3, area_m2=1e-2, density_kg_m3=1e5, second_moment_m4=0)
    assert string.modes_below(1e9) > 10**12
