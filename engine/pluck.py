"""A musician's pluck: a shape at a place, of a width and an amplitude."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, get_args

from engine import bounds
from engine.parameters import OF_INSTRUMENTS

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Shape = Literal["gaussian", "triangular", "raised_cosine", "rounded"]
SHAPES: tuple[Shape, ...] = get_args(Shape)  # numbers of the kernels
DEFAULT_LISTEN = OF_INSTRUMENTS["pickup.points.0"].default  # the listening point beside a pluck


@dataclass(frozen=True)
class Pluck:
    """The pull on the string before its release: its place, height and shape.

    Attributes:
        position: 0 and 1 are the fixed ends, 0.5 the middle.
        amplitude_mm: peak displacement; 0 is silence.
        width: of the Gaussian (its s), of the raised cosine, or of what pulls a rounded triangle, in lengths. A
            triangle has none.

    Raises:
        ValueError: a value is out of its range; the message names it and the range.
    """

    position: float = 0.35
    amplitude_mm: float = 4.0
    shape: Shape = "gaussian"
    width: float = 0.06

    def __post_init__(self) -> None:
        bounds.check_all(self, bounds.PLUCK)
        bounds.check_choice("shape", self.shape, SHAPES)

    def moved(self, **changes: float | str) -> Pluck:
        """A copy with some values changed."""
        return replace(self, **changes)  # type: ignore[arg-type]

    def nearest(self, **changes: float) -> Pluck:
        """A copy with some values changed, each to the nearest within its range; not a number is the lowest."""
        limits = bounds.PLUCK
        return self.moved(
            **{name: min(max(limits[name][0], value), limits[name][1]) for name, value in changes.items()}
        )

    def displacement(self, grid_points: int) -> NDArray[np.float64]:
        """The raw shape in m before any projection on modes, float64 (grid_points,)."""
        from engine.excitation import displacement  # NumPy only when it is needed: the command line starts without

        return displacement(self.shape, self.position, self.width, self.amplitude_mm / 1000, grid_points)
