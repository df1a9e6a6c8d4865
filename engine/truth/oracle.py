"""The oracle: SciPy's explicit Runge-Kutta 8(5,3) at the tolerances of the paper's authors."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from engine.array_library import Values, as_array, library_of
from engine.resonators.base import Resonator
from engine.truth.splitting import ModalState

REPORT_EVERY = 0.01  # of a trajectory


def solve_dop853(
    resonator: Resonator,
    state: ModalState,
    rate_hz: float,
    steps: int,
    *,
    rtol: float = 1e-12,
    atol: float = 1e-14,
    report: Callable[[float], None] = lambda share: None,
) -> Values:
    """Modal amplitudes of frames 0 … steps, float64 (batch, steps + 1, modes), by DOP853 (Eq. 4).

    Args:
        report: called with the share that is done, 0 … 1, about a hundred times a trajectory.

    Raises:
        RuntimeError: the integrator gave up on a trajectory.
    """
    from scipy.integrate import solve_ivp  # slow to load, and only the oracle needs it

    modes = resonator.modes
    stiffness, friction = resonator.omega**2, 2 * resonator.sigma
    eta_squared, coupling = resonator.stretch, resonator.coupling

    reported = 0.0

    def right_side(time_s: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
        """The time derivative of y, (2 modes,): amplitudes in m, then velocities; it also reports the progress."""
        nonlocal reported
        share = (len(trajectories) + time_s / span_s[1]) / len(starts)
        if share >= reported + REPORT_EVERY / len(starts):
            reported = share
            report(min(share, 1.0))
        q, v = y[:modes], y[modes:]
        return np.concatenate([v, -(stiffness + coupling * (eta_squared @ (q * q))) * q - friction * v])

    times_s = np.arange(steps + 1) / rate_hz
    span_s = (0.0, float(times_s[-1]))
    starts = np.concatenate([as_array(state.amplitude), as_array(state.velocity)], axis=1)
    trajectories: list[NDArray[np.float64]] = []
    for start in starts:
        solution = solve_ivp(right_side, span_s, start, "DOP853", times_s, rtol=rtol, atol=atol)
        if not solution.success:
            raise RuntimeError(f"DOP853 failed: {solution.message}")
        trajectories.append(solution.y[:modes].T)
    return library_of(state.amplitude).asarray(np.reshape(trajectories, (len(starts), steps + 1, modes)))
