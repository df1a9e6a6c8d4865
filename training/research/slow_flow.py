"""The slow flow of modes that share one tension: an averaged Hamiltonian in which triads of modes trade energy.

With k_n = c η_n² the motion of `engine.resonators.base` without damping has the Hamiltonian
Σ (p_n² + ω_n² q_n²)/2 + (c/4) S², S = Σ η_n² q_n². What is left when every period has been averaged out:

1. Mean tension. q_n = √(2I_n/Ω_n) cos θ_n, p_n = -√(2I_n Ω_n) sin θ_n, Ω_n² = ω_n² + c η_n² S̄, S̄ = Σ a_n,
   a_n = b_n I_n, b_n = η_n²/Ω_n. Because Ω follows I, θ_n = θ'_n + (c/4) (∂S̄/∂I_n) Σ a_m sin 2θ_m/Ω_m makes (I, θ')
   canonical, and H = K₀ + (c/4)(Σ a_n cos 2θ_n)² with K₀ = Σ Ω_n I_n - (c/4) S̄², ∂K₀/∂I_n = Ω_n.
2. First order: K₁ = (c/8) Σ a_n².
3. Second order, with V_mn = 1/(Ω_m² - Ω_n²): K₂ = -(c²/64) [Σ a_n³ b_n/Ω_n + 4 Σ_{m≠n} η_m² V_mn a_m a_n²].
4. Triads. In second order there is also, for all j ≤ k < l with |ω_j + ω_k - ω_l| < ω_1, 2τ Re(z_j² z_k² z̄_l²) of
   z = √I e^{iθ}: τ = -(c²/32) b_j b_k b_l [(b_j + b_k)/Ω_l - (b_j - b_l)/Ω_k - (b_k - b_l)/Ω_j], half for j = k.
5. Third order. With Ω and S̄ held, H₁ = (c/4)(S - S̄)² is a polynomial, {K₀, χ₁} = K₁ - H₁ defines its generator, and
   K₃ = Res ({{H₁, χ₁}, χ₁}/3 + {{K₁, χ₁}, χ₁}/6), where S̄ becomes Σ a_n again.
   Its mean is a sum over pairs and chains of three modes (`third_order` in the kernel), it corrects the triads that
   count by what every other mode's energy adds to τ (`third_order_triad`), and it has resonances of four,
   j + k = l + m and j + k + l = m (`weigh_quartet`), of which those of the loudest modes are kept.
6. Flow: ż_n = i ∂K/∂z̄_n - σ_n z_n. K₁ and K₂ are differentiated through S̄, too, K₃ and triads nearly so: as if all
   frequencies rose alike, which they do except for the stiffness.
7. Back: (I, θ') is the averaged one moved by χ = (c/4) Σ_{m≠n} Ω_m V_mn Y_m X_n + (c/16) Σ X_n Y_n/Ω_n, where
   X_n = a_n cos 2θ_n and Y_n = a_n sin 2θ_n: θ + ∂χ/∂I, I - ∂χ/∂θ. A start, which decides all later phases, is moved
   in second order; frames in first, which is most of what is wrong with the first periods of a hard pluck.

Damping. (q, p = q̇ + σq) obeys the same Hamiltonian with ω² - σ² in place of ω², beside a decay of both by σ: a quiet
resonator is the damped linear one exactly.

Sources: Lie transforms (Deprit 1969); that triads j + k = l are what is left in second order of Kirchhoff's string.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import torch

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from torch import Tensor

    from engine.resonators.base import Resonator

    Array = NDArray[np.float64]

SILENCE = 1e-6  # share of the amplitude of all together below which the highest modes are left out: -120 dB
NEGLIGIBLE = 1e-7  # share of the amplitude of all together; what a triad does that stays below it is left out
RESONANT = 1 - 1e-9  # largest detuning of a triad in units of ω_1: (n, 1, n), which is none, stays outside
LEAST_GAP = 1e-2  # between the frequencies of two modes, in units of ω_1: closer ones resonate in first order
SETTLED = 1e-13  # relative change of the averaged start in the last of its steps
MOST_STEPS = 300  # of them


class _Modes(NamedTuple):
    """A resonator as the kernels take it, float64 (modes,) each but c."""

    c: float
    frequencies: Array  # √(ω² - σ²)
    decays: Array
    stiffening: Array  # c η²
    stretch: Array  # η²


def slow_flow(
    resonator: Resonator,
    amplitudes_m: Tensor,
    rate_hz: float,
    steps: int,
    *,
    node_s: float = 0.5e-3,
    triads: bool = True,
) -> Tensor:
    """Modal amplitudes in m of frames 1 … steps after a release at rest, float64 (steps, modes), without learning.

    Args:
        resonator: its coupling is a multiple of its stretch.
        amplitudes_m: at frame 0, (modes,).
        node_s: time between the nodes of the integration, s.
        triads: whether modes trade energy; without it each keeps its own.

    Raises:
        ValueError: a coupling without an energy, modes too close to each other, or impossible sizes.
        ArithmeticError: no averaged motion starts there: the tension rises too much.
    """
    # compiles, or loads what it compiled earlier: only when it is needed
    from training.research import _slow_flow_kernel as kernel

    for name, value in (("rate_hz", rate_hz), ("node_s", node_s)):
        if not value > 0:
            raise ValueError(f"{name} must be above 0, not {value}")
    if steps < 0:
        raise ValueError(f"steps must not be negative, as {steps} is")
    modes = _modes(resonator)
    if tuple(amplitudes_m.shape) != (resonator.modes,):
        raise ValueError(f"amplitudes_m must have the shape ({resonator.modes},), not {tuple(amplitudes_m.shape)}")
    start = _averaged_start(modes, amplitudes_m.detach().to(torch.float64).numpy())
    which = resonant_triads(modes.frequencies) if triads else np.empty((0, 3), np.int32)
    out = np.zeros((steps, resonator.modes))
    kernel.flow(start, *modes, which, rate_hz, node_s, SILENCE, NEGLIGIBLE, out)
    return torch.from_numpy(out)


def resonant_triads(frequencies: Array) -> NDArray[np.int32]:
    """All j ≤ k < l whose detuning |ω_j + ω_k - ω_l| is below ω_1, (triads, 3)."""
    detuning = np.abs(frequencies[:, None, None] + frequencies[:, None] - frequencies)
    found = np.argwhere(detuning < RESONANT * frequencies[0])
    j, k, l = found.T  # noqa: E741
    return found[(j <= k) & (k < l)].astype(np.int32)


def _modes(resonator: Resonator) -> _Modes:
    stretch, coupling = (np.ascontiguousarray(t) for t in (resonator.stretch, resonator.coupling))
    c = float(coupling.sum() / stretch.sum()) if stretch.any() else 0.0
    if not np.allclose(coupling, c * stretch, rtol=1e-9, atol=0):
        raise ValueError("the slow flow needs an energy: the resonator's coupling must be a multiple of its stretch")
    eigenvalues = resonator.eigenvalues()
    frequencies = np.ascontiguousarray(eigenvalues.imag)
    closest = np.diff(np.sort(frequencies)).min(initial=np.inf)
    if closest < LEAST_GAP * frequencies.min():
        raise ValueError("the slow flow needs modes apart from each other: two have nearly the same frequency")
    return _Modes(c, frequencies, np.ascontiguousarray(-eigenvalues.real), coupling, stretch)


def _averaged_start(modes: _Modes, amplitudes_m: Array) -> Array:
    """z of the averaged motion whose displacement is at rest at `amplitudes_m`, (2, modes)."""
    from training.research import _slow_flow_kernel as kernel

    c, frequencies, decays, stiffening, stretch = modes
    squares = stretch * amplitudes_m**2
    s = squares.sum() / 2
    for _ in range(MOST_STEPS):  # p = σ q is not quite nothing
        raised = np.sqrt(frequencies**2 + stiffening * s)
        last, s = s, float((squares * (1 + (decays / raised) ** 2)).sum() / 2)
        if abs(s - last) <= SETTLED * s:
            break
    raised = np.sqrt(frequencies**2 + stiffening * s)
    origin = np.sqrt(raised / 2) * (1 - 1j * decays / raised) * amplitudes_m
    b = stretch / raised
    falls = 1 + c / 2 * (b**2 * np.abs(origin) ** 2 / raised).sum()
    origin = origin * np.exp(-1j * c / 4 * b / falls * (b * (origin**2).imag / raised).sum())
    z, change, loudest = origin, np.inf, float(np.abs(origin).max(initial=0))
    for step in range(MOST_STEPS):
        if step < 4 or step % 16 == 0:  # a small part that hardly changes, and by far the dearest
            second = kernel.second_order(np.abs(z) ** 2, *modes, RESONANT * frequencies[0])
        with np.errstate(over="ignore", invalid="ignore"):
            found = origin * np.exp(-second - kernel.swing(z * np.exp(second), *modes))
            change = float(np.abs(found - z).max(initial=0))
        z = found
        if not np.isfinite(change) or change <= SETTLED * loudest:
            break
    if not change <= SETTLED * loudest:
        raise ArithmeticError("the slow flow has no averaged start: the tension rises too much; pluck more softly")
    return np.stack([z.real, z.imag])
