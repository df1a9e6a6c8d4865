"""The state of a string in modal coordinates: a value that is passed in and out."""

from __future__ import annotations

from dataclasses import dataclass

from engine.array_library import Values, in_double, library_of


@dataclass(frozen=True)
class ModalState:
    """Modal amplitudes in m and their velocities in m/s, both float64 (batch, modes): arrays, or tensors."""

    amplitude: Values
    velocity: Values

    def __post_init__(self) -> None:
        if self.amplitude.ndim != 2 or self.amplitude.shape != self.velocity.shape:
            raise ValueError(
                "a modal state needs amplitude and velocity of one shape (batch, modes), not "
                f"{tuple(self.amplitude.shape)} and {tuple(self.velocity.shape)}"
            )

    @classmethod
    def at_rest(cls, amplitude: Values) -> ModalState:
        """A string released with zero velocity from `amplitude` (batch, modes) in m."""
        released = in_double(amplitude)
        return cls(released, library_of(released).zeros_like(released))

    @property
    def modes(self) -> int:
        return int(self.amplitude.shape[1])
