"""Koopman latents that share one tension: one model for every string.

A latent z_n = x_n + iy_n is a mode: with λ_n = e^{h(-σ_n + iω_n)} of the resonator it turns and decays as the linear
string does, an eigenfunction of its Koopman operator. At nodes, h apart, the tension that the stretch of all modes
adds turns them together, with κ_n = h² k_n, a share of (hω_n)²:

    S = Σ_m η_m² A_m x_m²,    R = Σ_m η_m² κ_m r_m x_m²,
    y_n ← y_n + (h k_n/ω_n) [A_n S (1 - 2R) - κ_n r_n S²] x_n,      z_n ← λ_n z_n,

the exact flow of the potential c/4 (S² - 2 S² R), between exact flows of the damped linear string. What sets out and
the output uses other coordinates than those in which the kicks act:

    x_n(0) = q_n (1 + p_n κ_n S₀),      q̂_n = x_n (1 - p_n κ_n S),      S₀ = Σ_m η_m² q_m².

Momenta go with the coordinates. A string that rings sets out with the speed w instead of its own, v:

    v_n = w_n (1 + p_n κ_n S₀) + 2 p_n κ_n q_n Σ_m η_m² q_m w_m,      y_n(0) = -(w_n + σ_n q_n)/ω_n,

the momentum that belongs to x where p is one number (the lift of a point transformation; the processor of Blanes,
Casas and Ros needs it). Half a kick before the first node follows. From rest, w = v = 0.

A, r and p are what is learned: three curves over the phase hω that a mode turns between two nodes, even polynomials
(Chebyshev, of (hω)²), A(0) = 1. They are shared by all modes of all strings, so that the model takes any resonator
with any number of modes: pitch, length, density and tension change nothing but λ and κ, inharmonicity and damping
enter by them too. At rest all corrections vanish: a quiet string is the linear one, exactly.

What they have to learn is the error that kicks at nodes make, and it is large: without them, a hundred nodes in a
period of the first mode leave 1e-7 to 1e-3 of a second's energy wrong. For h → 0 backward error analysis gives
them: r = p = 1/12 (Takahashi and Imada 1984; Blanes, Casas and Ros 1999 for a processed integrator), the start
"series". A fit that sets out from 0 finds the twelfths by itself, and departs from them where hω is not small.

Stability. A is held in 0 … 2, r and p in -1 … 1, S below what the energy at the start allows; after each frame
Σ ω² |z|² below 1.5 times that energy, falling as the slowest mode does: for every value of every weight the motion is
bounded and decays to silence. A string never comes near that bound, and neither does a model that is any good.

Any rate: nodes are a whole number to a frame, as many as keep ω₁h below `node_phase`, and the highest mode's below
`highest_phase`. (Where two modes' phases add up to 2π, kicks would pump them.) A pluck that is hard and has its
stretch in high modes takes more of them: as many as keep Σ η²κ (q² + v²/ω²) at its start below
`HARDEST_KICK`²: that sum is the square of the phase of the modes that stretch the string, times how far they raise
the tension.
"""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import torch
from torch import nn

from engine.models._tension_law import (
    CURVES,
    KoopmanTensionState,
    TensionLaw,
    resonator_arrays,
    shapes_of_arrays,
)
from engine.models.base import LINEAR_STRING, Physics, StringModel
from engine.models.configurations import KoopmanTensionConfiguration

SERIES = 1 / 12  # r and p of small hω


class KoopmanTension(TensionLaw, StringModel[KoopmanTensionState]):
    """See the module. The resonator is a buffer: `for_resonator` gives the same model of another."""

    any_frame: ClassVar = True
    initialisations: ClassVar = {
        "kicks": f"{LINEAR_STRING}, and how tension couples them",
        "series": f"{LINEAR_STRING}, how tension couples them, and the error of kicks for small steps",
    }

    def __init__(self, configuration: KoopmanTensionConfiguration) -> None:
        super().__init__(configuration)
        for name, shape in shapes_of_arrays(configuration).items():
            zeros = torch.zeros(shape, dtype=torch.float64)
            if name in CURVES:
                self.register_parameter(name, nn.Parameter(zeros))
            else:
                self.register_buffer(name, zeros)

    def set_weights(self, how: str, physics: Physics, generator: torch.Generator) -> None:
        """See the contract. kicks: no correction. series: those that backward error analysis knows."""
        for name in CURVES:
            getattr(self, name).zero_()
        if how == "series":
            self.r[0] = self.p[0] = SERIES
        self._take(physics)

    @torch.no_grad()
    def for_resonator(self, physics: Physics) -> KoopmanTension:
        """The learned model with another resonator, rate or scale."""
        resonator = physics.resonator
        sizes = replace(self.configuration, modes=resonator.modes, grid_points=resonator.points)
        other = KoopmanTension(sizes)
        for name in CURVES:
            getattr(other, name).copy_(getattr(self, name))
        other._take(physics)
        return other.train(self.training)

    def _take(self, physics: Physics) -> None:
        """Write the resonator's arrays, in the units of its rate and scale, into the buffers."""
        arrays = resonator_arrays(self.configuration, physics.resonator, physics.rate_hz, physics.scale_m)
        for name, array in arrays.items():
            getattr(self, name).copy_(torch.from_numpy(array))
