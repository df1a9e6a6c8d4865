"""What a picture of the string shows at one moment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Band = tuple[NDArray[np.float32], NDArray[np.float32]]  # lowest and highest


@dataclass(frozen=True)
class StringFrame:
    """What the string looks like at one moment; displacements (points,) in mm.

    Attributes:
        shapes: by source.
        lowest, highest: by source, the extremes since the last frame: the blur of a string in real time.
        envelopes: by source, the extremes of a longer time before; empty where they are not shown.
    """

    shapes: dict[str, NDArray[np.float32]]
    lowest: dict[str, NDArray[np.float32]]
    highest: dict[str, NDArray[np.float32]]
    caption: str = ""
    past_horizon: bool = False
    envelopes: Mapping[str, Band] = field(default_factory=dict)

    def largest_mm(self) -> float:
        """The largest displacement that is drawn of the motion itself; 0 where nothing is drawn yet."""
        bands = [*self.lowest.values(), *self.highest.values()]
        return max((float(np.abs(band).max()) for band in bands), default=0.0)
