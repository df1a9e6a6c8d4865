"""The state of a string in modal coordinates: a value that is passed in and out."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass(frozen=True)
class ModalState:
    """Modal amplitudes in m and their velocities in m/s, both float64 (batch, modes)."""

    amplitude: Tensor
    velocity: Tensor

    def __post_init__(self) -> None:
        if self.amplitude.ndim != 2 or self.amplitude.shape != self.velocity.shape:
            raise ValueError(
                "a modal state needs amplitude and velocity of one shape (batch, modes), not "
                f"{tuple(self.amplitude.shape)} and {tuple(self.velocity.shape)}"
            )

    @classmethod
    def at_rest(cls, amplitude: Tensor) -> ModalState:
        """A string released with zero velocity from `amplitude` (batch, modes) in m."""
        amplitude = amplitude.to(torch.float64)
        return cls(amplitude, torch.zeros_like(amplitude))

    @property
    def modes(self) -> int:
        return self.amplitude.shape[1]
