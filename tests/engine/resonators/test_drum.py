"""Drums: modes over a fine grid, Bessel functions, frequencies, air and tension."""

import math
from dataclasses import replace

import numpy as np
import pytest
import scipy

from engine.kernels import drum_modes as kernel
from engine.resonators.base import Array
from engine.resonators.drum import bending_nm, modes_of, stretching_n_m
from engine.resonators.surface import Surface, modes_below, tools
from engine.strike import Strike
from engine.values.drum import SHAPES, DrumParameters

TOM = DrumParameters(uneven=0.004)
PLATE = DrumParameters("rectangle", 0.3, 0.2, 6e-4, 7850, 2e11, 0.3, tension_n_m=0)
# A timpani's head of 65.6 cm without kettle: dimensions, tension and frequencies as in Fletcher and Rossing,
# The Physics of Musical Instruments (1998), table 18.1, after Christian et al., JASA 76 (1984), 1336: from memory
HEAD = DrumParameters(
    length_m=0.656, width_m=0.656, thickness_m=0.262 / 1390, density_kg_m3=1390, tension_n_m=3990, air_kg_m3=1.2
)
# Ratios to (1,1) of a head of 26 inches without kettle: Rossing, Percussive Notes Research Edition 19/3 (1982), 18,
# as R. K. Jones quotes them (In Search of the Missing Fundamental, wtt.pauken.org)
MEASURED_RATIOS = {(2, 1): 1.48, (3, 1): 1.92, (4, 1): 2.36, (5, 1): 2.78}
MEASURED_HZ = {(0, 1): 82, (1, 1): 155, (2, 1): 229, (3, 1): 297, (4, 1): 366, (5, 1): 431}


def lowest(drum: DrumParameters) -> dict[tuple[int, int], float]:
    """Frequencies in Hz by nodal diameters and circles, of cosines."""
    modes, found = modes_of(drum, 800), {}
    for m, sine, omega in zip(modes.surface.m, modes.surface.n, modes.omega, strict=True):
        if not sine:
            n = 1 + sum(key[0] == m for key in found)
            found[int(m), n] = omega / (2 * math.pi)
    return found


def test_membrane_and_plate_in_closed_form_and_pairs_that_are_split():
    first = 2.404826 / (0.33 / 2) * math.sqrt(1500 / TOM.mass_kg_m2) / (2 * math.pi)
    assert lowest(TOM)[0, 1] == pytest.approx(first, rel=1e-3)
    kappa = (math.pi / 0.3) ** 2 + (math.pi / 0.2) ** 2
    assert modes_of(PLATE, 2000).omega[0] == pytest.approx(kappa * math.sqrt(bending_nm(PLATE) / PLATE.mass_kg_m2))
    omega = modes_of(replace(TOM, length_m=0.332, width_m=0.328), 2000).omega
    assert omega[2] / omega[1] == pytest.approx(1 + 0.004 / 0.66 + 0.004, rel=1e-3)
    assert omega[4] / omega[3] == pytest.approx(1.004, rel=1e-4)


def test_tension_of_the_stretch_is_bergers():
    """C (1/A) ∫|∇w|² dA, by differences on a grid."""
    modes, side = modes_of(PLATE, 1500), 201
    grid = np.stack(np.meshgrid(*(np.linspace(-1, 1, side),) * 2, indexing="ij"), axis=-1)
    q = 1e-3 * np.random.default_rng(1).standard_normal(len(modes))
    w = (q @ modes.shapes(grid.reshape(-1, 2))).reshape(side, side)
    along, across = np.gradient(w, 0.3 / (side - 1), 0.2 / (side - 1))
    expected = stretching_n_m(PLATE) * (along**2 + across**2).mean()
    resonator = modes.resonator(np.zeros((1, 2)))
    at_rest = stretching_n_m(PLATE) / resonator.tension_rise
    assert float(resonator.relative_tension_rise(q)) * at_rest == pytest.approx(expected, rel=0.02)


def test_air_and_a_kettle_shift_a_single_head_as_measured():
    """Without air the ratios would be 1.34, 1.66, 1.98 and 2.29; a kettle raises the first mode."""
    found, vacuum = lowest(HEAD), lowest(replace(HEAD, air_kg_m3=0.0))
    for mode, measured_hz in MEASURED_HZ.items():
        assert found[mode] == pytest.approx(measured_hz, rel=0.05)
    for mode, measured in MEASURED_RATIOS.items():
        assert found[mode] / found[1, 1] == pytest.approx(measured, rel=0.015)
        assert vacuum[mode] / vacuum[1, 1] < 0.93 * measured
    kettle = lowest(replace(HEAD, tension_n_m=3710, cavity_m3=0.14))
    assert kettle[0, 1] == pytest.approx(127, rel=0.1)
    assert kettle[1, 1] == pytest.approx(150, rel=0.05)


def test_a_shell_lowers_the_first_mode_to_that_of_a_measured_tom():
    """142 Hz where (1,1) has 305 Hz (Rossing, see bench/drums.py); its size is not known, toms are alike."""
    for size_m, tension_n_m, shell_m in ((0.254, 1497, 0.165), (0.305, 2301, 0.203), (0.356, 3337, 0.203)):
        open_head = DrumParameters(length_m=size_m, width_m=size_m, tension_n_m=tension_n_m, air_kg_m3=1.2)
        found, flat = lowest(replace(open_head, shell_m=shell_m)), lowest(open_head)
        assert found[1, 1] == pytest.approx(305, rel=0.005)
        assert found[0, 1] == pytest.approx(142, rel=0.05)
        assert found[0, 2] == pytest.approx(3.42 * 142, rel=0.05)
        assert flat[0, 1] > 1.15 * 142
        assert found[2, 1] == flat[2, 1]


def test_what_the_drum_does_not_tell_is_refused():
    modes = modes_of(TOM, 500)
    with pytest.raises(ValueError, match="do not follow from displacement at 2 places"):
        modes.resonator(np.zeros((2, 2))).to_modes(np.zeros(2))
    with pytest.raises(ValueError, match="not on the drum"):
        Strike((0.8, 0.8)).speeds(modes)


SIDE = 251
GRID = np.stack(np.meshgrid(*(np.linspace(-1, 1, SIDE),) * 2), axis=-1).reshape(-1, 2)


def surface_of(shape: str, length_m: float, width_m: float) -> Surface:
    sides = np.array([SHAPES.index(shape), length_m, width_m])
    return Surface(sides, modes_below(shape, length_m / width_m, 60.0 * kernel.size(sides)))


CIRCLE, RECTANGLE = surface_of("circle", 0.4, 0.4), surface_of("rectangle", 0.4, 0.3)


@pytest.mark.parametrize("own", [CIRCLE, RECTANGLE], ids=["circle", "rectangle"])
def test_shapes_are_orthonormal_and_their_transforms_are_the_integrals(own):
    places, angle = GRID[np.hypot(*GRID.T) <= 1] if own.round else GRID, 0.4
    shapes = own.shapes(places)
    gram = shapes @ shapes.T / len(places)
    assert np.abs(gram - np.eye(len(gram))).max() < 0.02
    along, across = 9.0 * np.cos(angle), 9.0 * np.sin(angle)
    phase = (places * ([0.2, 0.2] if own.round else [0.2, 0.15])) @ np.array([along, across])
    found = [kernel.transform(own.sides, own.rows, mode, along, across, tools()) for mode in range(len(own.m))]
    np.testing.assert_allclose(np.abs(found), np.abs((shapes * np.exp(1j * phase)).mean(1)), atol=0.01)
    lowest, s = own.picked(np.arange(4)), np.linspace(0.01, 120, 6000)
    whole, out = np.zeros(4), np.empty(4)
    for each in s:  # a mode's density holds all of it
        kernel.densities(lowest.sides, lowest.rows, float(each), out, np.empty(kernel.ORDERS))
        whole += out * (s[1] - s[0])
    np.testing.assert_allclose(whole, 1, atol=2e-3)


def test_the_mean_over_a_disc():
    place, radius = np.array([0.3, -0.2]), 0.02
    expected = CIRCLE.shapes(GRID[np.hypot(*GRID.T) <= 1] * (radius / 0.2) + place).mean(1)
    spread = [kernel.spread(each * radius, tools()) for each in CIRCLE.wavenumber]
    assert np.allclose(CIRCLE.shapes(place[None])[:, 0] * spread, expected, atol=2e-3)


def test_bessel_functions_their_table_and_zeros_are_scipys():
    for x in (0.0, 1e-5, 2e-4, 0.3, 5.0, 77.7, 280.0):
        all_orders = np.empty(300)
        assert kernel.bessels(x, all_orders) == pytest.approx(scipy.special.struve(1, x), abs=1e-14)
        np.testing.assert_allclose(all_orders, scipy.special.jv(np.arange(300), x), atol=2e-14)
    table = np.zeros((300, 100 + 2 * kernel.TERMS))
    kernel.tabulate(table)
    orders, places = np.arange(0, 120, 3), np.linspace(0, 29.9, 1234)
    found = [[kernel.bessel(int(m), float(x), (table, np.empty(kernel.ORDERS))) for m in orders] for x in places]
    np.testing.assert_allclose(found, scipy.special.jv(orders, places[:, None]), atol=5e-11)
    rows = modes_below("circle", 1.0, 60.0)
    expected = [z for m in range(60) for z in scipy.special.jn_zeros(m, 20) for _ in range(2 if m else 1) if z <= 60]
    np.testing.assert_allclose(rows[kernel.Z], sorted(expected), rtol=1e-12)
    np.testing.assert_allclose(rows[kernel.SLOPE], scipy.special.jvp(rows[kernel.M], rows[kernel.Z]), atol=1e-13)


def test_the_air_at_a_circle_is_the_integral_with_scipys_functions():
    low, ka, points = np.ascontiguousarray(modes_below("circle", 1.0, 16.0)[:, ::7]), 3.3, 4096
    found: Array = np.empty((2, low.shape[1]))
    kernel.air_at(np.array([0.0, 2.0, 2.0]), low, ka, 256, found, np.empty(low.shape[1] + kernel.ORDERS))
    z, m = (row[:, None] for row in low[:2])

    def shares(s: Array) -> Array:
        return 2 * s * (z * scipy.special.jv(m, s) / (z * z - s * s)) ** 2

    u, alpha = ((np.arange(points) + 0.5) / points * most for most in (128.0, np.pi / 2))
    s = np.hypot(ka, u)
    np.testing.assert_allclose(found[0], (shares(s) / s).sum(1) * u[0] * 2, rtol=3e-5)
    np.testing.assert_allclose(found[1], shares(ka * np.sin(alpha)).sum(1) * alpha[0] * 2 / ka, rtol=2e-4)
