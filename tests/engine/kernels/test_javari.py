"""The force of a bridge's edge within a step: it solves its equation, and takes energy."""

from __future__ import annotations

import numpy as np
import pytest

from engine.kernels.javari import force

GIVE = 3e-7  # m/N


@pytest.mark.parametrize("loss", [0.0, 2e4, 1e6])
@pytest.mark.parametrize("stiffness", [1e3, 3e5, 1e8])
def test_force_is_the_discrete_gradient_of_the_edge(stiffness: float, loss: float) -> None:
    """Over all ways in which a string arrives, stays and leaves. In the step in which it arrives there is no loss."""
    generator = np.random.default_rng(1)
    for before, free in generator.normal(0, 1e-5, (2_000, 2)):
        found = force(before, free, GIVE, stiffness, loss)
        after = free - GIVE * found
        risen = 0.5 * stiffness * (max(after, 0.0) ** 2 - max(before, 0.0) ** 2)  # V(d₁) - V(d₀)
        factor = 1 + loss * (after - before) if before > 0 else 1.0
        assert found * (after - before) == pytest.approx(risen * factor, rel=1e-6, abs=1e-15)
        assert risen - found * (after - before) <= 1e-15 * (1 + loss)  # J
        if before <= 0 and free <= 0:
            assert found == 0


def test_a_stiff_edge_stops_the_string() -> None:
    assert force(0.0, 1e-5, GIVE, 1e12, 0.0) * GIVE == pytest.approx(1e-5, rel=1e-4)
