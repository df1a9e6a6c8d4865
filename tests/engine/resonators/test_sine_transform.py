"""The transform is exact on the grid."""

import numpy as np
import pytest

from engine.resonators import sine_transform
from engine.resonators.sine_transform import LARGEST_KEPT, listening_weights, mode_shapes, to_grid, to_modes


@pytest.mark.parametrize("modes", [1, 10, 25, 99])
def test_round_trip(modes: int) -> None:
    amplitudes = np.random.default_rng(1).normal(size=(4, modes))
    displacement = to_grid(amplitudes, 101)
    assert (displacement[:, [0, -1]] == 0).all()
    np.testing.assert_allclose(to_modes(displacement, modes), amplitudes, rtol=1e-7, atol=1e-12)


def test_a_grid_point_listens_to_itself() -> None:
    displacement = np.zeros(101)
    displacement[37] = 1
    heard = displacement @ listening_weights(np.array([0.37, 0.36]), 101)
    np.testing.assert_allclose(heard, [1.0, 0.0], atol=1e-12, rtol=0)


def test_listening_between_points_is_exact_for_band_limited_shapes() -> None:
    amplitudes = np.array([1.0, 0.5, -0.25])
    position = np.array([0.4321])
    heard = to_grid(amplitudes, 101) @ listening_weights(position, 101)
    np.testing.assert_allclose(heard, amplitudes @ mode_shapes(position, 3), rtol=1e-12)


def test_too_many_modes_are_refused() -> None:
    with pytest.raises(ValueError, match="holds 1 to 99 modes, not 100"):
        to_modes(np.zeros(101), 100)


def test_large_tables_are_not_remembered() -> None:
    """A hundred of a stranger's largest strings would be gigabytes."""
    before = sine_transform._sines.cache_info().currsize
    large = sine_transform.synthesis_matrix(1_003, 1_001)
    assert sine_transform._sines.cache_info().currsize == before
    assert np.array_equal(large[:7], sine_transform.synthesis_matrix(1_003, 7))


@pytest.mark.parametrize(("grid_points", "modes"), [(801, 799), (1_201, 90)])
def test_a_large_picture_is_that_of_its_table(grid_points: int, modes: int) -> None:
    amplitudes = np.random.default_rng(0).normal(size=modes)
    assert grid_points * modes > LARGEST_KEPT
    found, table = to_grid(amplitudes, grid_points), to_grid(amplitudes[None], grid_points)[0]
    np.testing.assert_allclose(found, table, atol=1e-11)
    assert found[0] == found[-1] == 0
