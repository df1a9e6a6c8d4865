"""The oracle: SciPy's explicit Runge-Kutta 8(5,3) at the tolerances of the paper's authors."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from engine.resonators.base import Resonator
from engine.truth.state import ModalState


def solve_dop853(
    resonator: Resonator,
    state: ModalState,
    rate_hz: float,
    steps: int,
    *,
    rtol: float = 1e-12,
    atol: float = 1e-14,
) -> Tensor:
    """Modal amplitudes of frames 0 … steps, float64 (batch, steps + 1, modes), by DOP853 (Eq. 4).

    Raises:
        RuntimeError: the integrator gave up on a trajectory.
    """
    from scipy.integrate import solve_ivp  # slow to load, and only the oracle needs it

    modes = resonator.modes
    stiffness, friction = resonator.omega**2, 2 * resonator.sigma
    eta_squared, coupling = resonator.stretch, resonator.coupling

    def right_side(_time_s: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
        q, v = y[:modes], y[modes:]
        return np.concatenate([v, -(stiffness + coupling * (eta_squared @ (q * q))) * q - friction * v])

    times_s = np.arange(steps + 1) / rate_hz
    trajectories = []
    for start in torch.cat([state.amplitude, state.velocity], dim=1).numpy():
        span = (0.0, float(times_s[-1]))
        solution = solve_ivp(right_side, span, start, "DOP853", times_s, rtol=rtol, atol=atol)
        if not solution.success:
            raise RuntimeError(f"DOP853 failed: {solution.message}")
        trajectories.append(solution.y[:modes].T)
    return torch.from_numpy(np.stack(trajectories))
