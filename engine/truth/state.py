"""The state of a string in modal coordinates: a value that is passed in and out."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from engine.resonators.base import Array


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
    def at_rest(cls, amplitude: Tensor | Array) -> ModalState:
        """A string released with zero velocity from `amplitude` (batch, modes) in m."""
        released = torch.as_tensor(amplitude, dtype=torch.float64)
        return cls(released, torch.zeros_like(released))

    @property
    def modes(self) -> int:
        return self.amplitude.shape[1]
