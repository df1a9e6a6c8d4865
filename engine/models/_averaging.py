"""The tension-modulated string averaged over a period: frequencies and amplitudes follow its energies.

Lindstedt's first order in closed form (`averaged_*`), and the mean tension to all orders (`stiffening`,
`adiabatic_change`). Amplitudes are in a model's normalised units, time is in samples.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from engine.models.base import Physics

FIXED_POINT_STEPS = 2  # from an action to the amplitude that it means: the error is of fourth order in ΔT/T₀
LEAST_SHARE = -0.4  # of κ/ω; a string's is above 0


def stiffening(energies: Tensor, omega: Tensor, coupling: Tensor) -> Tensor:
    """ω√(1 + 2κ/ω) - ω - Im K E of actions E, (..., n), where κ = Im K q² of the amplitudes' squares q².

    Args:
        energies: E, (..., n): the squares of the actions' roots.
        omega: ω in rad/sample, (n,).
        coupling: Im K in rad/sample, transposed: (n, n).
    """
    shares = coupling / omega
    linear = energies @ shares
    share = linear  # κ/ω of each mode, (..., n)
    for _ in range(FIXED_POINT_STEPS):
        share = (energies / (1 + 2 * share.clamp(min=LEAST_SHARE)).sqrt()) @ shares
    return omega * ((1 + 2 * share.clamp(min=LEAST_SHARE)).sqrt() - 1 - linear)


def adiabatic_change(squares: Tensor, weight: Tensor) -> Tensor:
    """The nepers from an amplitude to its action's root (A positive), or back (A negative): ± log(1 + 4|A q²|)/4.

    Args:
        squares: (..., n): of the amplitudes where A is positive (an encoder's), of the actions' roots where it is
            negative.
        weight: A, (n, n).

    Returns:
        (..., n).
    """
    change = nn.functional.linear(squares, weight)
    falls = (change < 0).to(change.dtype)
    for _ in range(FIXED_POINT_STEPS):  # q² = |z|² / √(1 + 4|A q²|)
        change = nn.functional.linear(squares * (1 - falls + falls / (1 + 4 * change.abs()).sqrt()), weight)
    return change.sign() * torch.log1p(4 * change.abs()) / 4


def averaged_coupling(physics: Physics) -> Tensor:
    """Im K of `initialise`, float64 (modes, modes): rad/sample for squared amplitudes in normalised units."""
    resonator = physics.resonator
    share = resonator.coupling / (4 * resonator.omega)
    squares = resonator.stretch * physics.scale_m**2
    return torch.from_numpy(share[:, None] * squares * (1 + 0.5 * np.eye(resonator.modes)) / physics.rate_hz)


def averaged_amplitude(physics: Physics) -> Tensor:
    """A_in of `initialise`, float64 (modes, modes): half of each frequency's relative rise, in nepers.

    The action ω q² / 2 stays while ω changes slowly, so that √ω q does.
    """
    frequencies = torch.from_numpy(physics.resonator.omega / physics.rate_hz)
    return averaged_coupling(physics) / (2 * frequencies[:, None])


def averaged_modulation(physics: Physics) -> tuple[Tensor, Tensor]:
    """The modulation by the swinging tension within a period, to first order: float64 (modes, modes) each.

    -k_n q_n η_m² q_m² swings at ω_n ± 2ω_m. There mode n answers with α z_m² z_n + β z̄_m² z_n:
    α = k_n η_m²/(16 ω_m (ω_n + ω_m)) and β = -k_n η_m²/(16 ω_m (ω_n - ω_m)); n = m has no β, its part is in K.

    Returns:
        α + β, nepers for Re z_m², and α - β, radians for Im z_m², of amplitudes in normalised units.
    """
    resonator = physics.resonator
    omega = torch.from_numpy(resonator.omega)
    squares = resonator.stretch * physics.scale_m**2
    share = torch.from_numpy(resonator.coupling[:, None] * squares) / (16 * omega)
    difference = omega[:, None] - omega
    alpha = share / (omega[:, None] + omega)
    beta = torch.where(difference == 0, 0.0, -share / torch.where(difference == 0, 1.0, difference))
    return alpha + beta, alpha - beta
