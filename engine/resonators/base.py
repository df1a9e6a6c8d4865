"""The resonator: modes with their frequencies, decays and shapes, and how they share one tension.

The seam between physics and everything that learns from it or solves it: models, truth, data sets and presets take
these numbers and know no string. A mode n of amplitude q_n moves as

    q̈_n + 2 σ_n q̇_n + ω_n² q_n = -k_n q_n Σ_m η_m² q_m²,

where the sum is the stretch, whose tension acts on all alike (the paper's Eq. 3-5 for a string); k = 0 is linear.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Resonator:
    """A resonator, by its modes.

    Attributes:
        omega: undamped angular frequencies ω in rad/s, ascending, float64 (modes,).
        sigma: decay rates σ in 1/s, (modes,): a free mode falls as exp(-σt).
        coupling: k, in 1/s² for a stretch of 1, (modes,); zeros: linear.
        stretch: η² in 1/m², (modes,): the stretch is Σ η² q².
        tension_rise: ΔT/T₀ of a stretch of 1.
        shapes: displacement of each mode at amplitude 1 on the points of a grid, or at a few places of a surface,
            (modes, points).
        analysis: (points, modes), its inverse for what lies in its modes: displacement @ analysis = amplitudes. None:
            the points are too few to say how all modes move.
        mirror: the sign that each mode takes where the resonator is turned end to end, (modes,); None: it is not
            symmetrical. That -q solves what q does needs no attribute: the tension does not know signs.
        end_force: force of each mode at amplitude 1 m on the end at the start of the grid, in N, (modes,), by the
            tension at rest; None: it has no such end.

    Raises:
        ValueError: shapes that do not go together, or numbers that are not finite.
    """

    omega: Array
    sigma: Array
    coupling: Array
    stretch: Array
    tension_rise: float
    shapes: Array
    analysis: Array | None
    mirror: Array | None = None
    end_force: Array | None = None

    def __post_init__(self) -> None:
        modes, points = self.shapes.shape
        for field in fields(self):
            value = getattr(self, field.name)
            if value is None:
                continue
            others = {"shapes": (modes, points), "analysis": (points, modes), "tension_rise": ()}
            if (shape := np.shape(value)) != (expected := others.get(field.name, (modes,))):
                raise ValueError(f"resonator: {field.name} has the shape {shape}, not {expected}")
            if not np.isfinite(value).all():
                raise ValueError(f"resonator: {field.name} holds a number that is not finite")
        if (np.diff(self.omega) < 0).any():
            raise ValueError("resonator: omega must not fall from one mode to the next")

    @property
    def modes(self) -> int:
        return len(self.shapes)

    @property
    def points(self) -> int:
        """The number of points of the grid."""
        return self.shapes.shape[1]

    @property
    def inverse(self) -> Array:
        """`analysis`.

        Raises:
            ValueError: its points are too few for amplitudes to follow from them.
        """
        if self.analysis is None:
            raise ValueError(
                f"{self.modes} modes do not follow from displacement at {self.points} places; set out from amplitudes"
            )
        return self.analysis

    @property
    def force_weights(self) -> Array | None:
        """float64 (points,): displacement @ weights = force on that end in N; None: it has no such end."""
        return None if self.end_force is None else self.inverse @ self.end_force

    @property
    def tension_modulated(self) -> bool:
        """Return True if any amplitude moves another mode's frequency."""
        return bool(self.coupling.any())

    def eigenvalues(self) -> NDArray[np.complex128]:
        """Continuous-time eigenvalues -σ + i√(ω² - σ²) at rest, complex128 (modes,).

        Raises:
            ValueError: a mode is damped so strongly that it no longer oscillates.
        """
        squared = self.omega**2 - self.sigma**2
        if (squared <= 0).any():
            first = int(np.argmax(squared <= 0)) + 1
            raise ValueError(f"mode {first} is overdamped: lower its damping, or keep fewer modes")
        return -self.sigma + 1j * np.sqrt(squared)

    def falls_s(self, db: float) -> float:
        """The time in s in which its slowest mode, free, falls by so many dB; inf where it never does."""
        slowest = float(self.sigma.min())
        return db * math.log(10) / 20 / slowest if slowest > 0 else math.inf

    def relative_tension_rise(self, amplitudes: Array) -> Array:
        """ΔT/T₀ of modal amplitudes (..., modes) in m; result (...)."""
        return np.asarray((self.stretch * amplitudes**2).sum(-1) * self.tension_rise)

    def to_modes(self, displacement: NDArray[np.floating]) -> Array:
        """Displacement (..., points) to modal amplitudes (..., modes), of the same unit."""
        return displacement @ self.inverse

    def to_grid(self, amplitudes: NDArray[np.floating]) -> Array:
        """Modal amplitudes (..., modes) to displacement (..., points), of the same unit."""
        return amplitudes @ self.shapes
