"""Values out of their bounds are refused by name, and large numbers cost nothing."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from engine.effects import Body, Impulse
from engine.pluck import Pluck
from engine.resonators.string import resonator_of, undamped_frequencies
from engine.truth import ModalState, SplittingSolver
from engine.values.drum import DrumParameters
from engine.values.effects import Amp, Room
from engine.values.string import Losses, Polarisations, StringParameters

GOOD = np.random.default_rng(0).standard_normal((4000, 2))
LOW = np.sin(np.arange(96_000) * 2 * np.pi * 8 / 48_000)[:, None] * np.hanning(96_000)[:, None]


FIVE, FOUR = resonator_of(StringParameters(), 5, grid_points=9), ModalState.at_rest(np.zeros((1, 4)))
ROUND = {"length_m": 0.33, "width_m": 0.33}
REFUSED: list[tuple[type, dict[str, Any], str]] = [
    *((StringParameters, {name: bad}, name) for name in ("length_m", "tension_n") for bad in (0.0, -1, math.nan)),
    *((StringParameters, {"density_kg_m3": bad}, "density_kg_m3 must") for bad in (math.inf, None, True)),
    (Losses, {"friction": -1.0}, "friction must lie in 0"),
    (Polarisations, {"conductance_s_kg": -1.0}, "conductance_s_kg must lie in 0"),
    *((Pluck, {"position": bad}, "position must lie in .* not") for bad in (0.0, 1.2)),
    *((Pluck, {"amplitude_mm": bad}, "amplitude_mm must lie in .* not") for bad in (-1, 99)),
    (Pluck, {"width": 0}, "width must lie in .* not"),
    *((Amp, {name: bad}, name) for name, bad in (("drive_db", -1.0), ("drive_db", 37.0), ("tone_db", 13.0))),
    *((Room, {name: bad}, name) for name, bad in (("mix", -0.1), ("t60_s", 0.1), ("t60_s", 9))),
    *((Body, {"mix": bad}, "mix") for bad in (1.1, math.nan)),
    (Body, {"size": 0.1}, "size"),
    (Body, {"name": "lute"}, "guitar"),
    *((Impulse, {"samples": GOOD, "rate_hz": bad}, "rate") for bad in (4_000, 10**9)),
    *((Impulse, {"samples": GOOD * [1, bad], "rate_hz": 48_000}, "no numbers") for bad in (math.nan, -math.inf)),
    (Impulse, {"samples": GOOD * [1, 1e300], "rate_hz": 48_000}, "largest sample"),
    *((Impulse, {"samples": GOOD[:, each], "rate_hz": 48_000}, "channels") for each in ([0, 0, 0], [])),
    (Impulse, {"samples": GOOD[:, 0], "rate_hz": 48_000}, "dimensions"),
    (Impulse, {"samples": GOOD.repeat(37, 0), "rate_hz": 48_000}, "length"),
    *((Impulse, {"samples": each, "rate_hz": 48_000}, "silent") for each in (GOOD[:0], 1e-9 * GOOD)),
    (Impulse, {"samples": LOW, "rate_hz": 48_000}, "80"),
    (DrumParameters, {"thickness_m": -1.0}, "thickness_m must lie in"),
    (DrumParameters, {"tension_n_m": 1e9}, "tension_n_m must lie in"),
    (DrumParameters, {**ROUND, "width_m": 0.2}, "two diameters, nearly the same"),
    (DrumParameters, {"shape": "square"}, "drum parameter shape 'square' is not one of circle, rectangle, bar"),
    (DrumParameters, {"shell_m": 0.2, "air_kg_m3": 0.0}, "shell_m is of an open shell in air"),
    (DrumParameters, {"shell_m": 0.2, "air_kg_m3": 1.2, "cavity_m3": 0.1}, "shell_m is of an open shell in air"),
    (DrumParameters, {"thickness_m": 0.02, "length_m": 0.1, "width_m": 0.1}, "below a tenth of the sides"),
]


@pytest.mark.parametrize(("kind", "values", "words"), REFUSED, ids=range(len(REFUSED)))
def test_a_value_out_of_its_bounds_is_refused_by_name(kind, values, words):
    with pytest.raises(ValueError, match=words):
        kind(**values)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: resonator_of(StringParameters(damping_d1_kg_m_s=10.0), 3).eigenvalues(), "mode 1 is overdamped"),
        (lambda: SplittingSolver(FIVE, 0), "sample rate must be above 0"),
        (lambda: SplittingSolver(FIVE, 16_000, silence=1.0), "silence"),
        (lambda: SplittingSolver(FIVE, 4_000, substeps=0), "substeps must lie in 1 … 1024"),
        (lambda: ModalState(np.zeros((1, 3)), np.zeros((1, 4))), "one shape"),
        (lambda: SplittingSolver(FIVE, 4_000).advance(FOUR, 3), "5 modes, the state 4"),
        (lambda: replace(FIVE, coupling=np.zeros(4)), "coupling has the shape"),
        (lambda: replace(FIVE, sigma=np.full(5, math.nan)), "sigma holds a number that is not finite"),
        (lambda: replace(FIVE, omega=np.arange(5.0, 0.0, -1.0)), "omega must not fall"),
    ],
)
def test_what_does_not_go_together_is_refused(make, words):
    with pytest.raises(ValueError, match=words):
        make()


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
