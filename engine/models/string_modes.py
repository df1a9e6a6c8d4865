"""The modes of an unknown string as its motions show them, from which a model can be started.

Where they come from is the caller's: `training.fitting.phases` finds them in displacement alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass(frozen=True)
class StringModes:
    """The modes of a string in normalised units, float64; times are in samples.

    A mode n that starts at rest at q moves as q Re s exp[(log λ) t + i Σ_m κ_nm ∫ E_m]. Here E_m(t) is the square of
    mode m's start, decaying twice as fast as its motion.

    Attributes:
        shapes: (modes, grid_points), linearly independent.
        log_eigenvalues: log λ = -σ + iω, complex128 (modes,).
        starts: s, complex128 (modes,).
        coupling: κ, rad/sample, (modes, modes).
        squares: q² of typical strings, (strings, modes).
    """

    shapes: Tensor
    log_eigenvalues: Tensor
    starts: Tensor
    coupling: Tensor
    squares: Tensor

    @property
    def analysis(self) -> Tensor:
        """(modes, grid_points): of a displacement, each mode's amplitude."""
        return torch.linalg.pinv(self.shapes).T

    @property
    def drift(self) -> Tensor:
        """The typical Σ κ_m q_m², (modes,)."""
        return self.coupling @ self.squares.mean(0)
