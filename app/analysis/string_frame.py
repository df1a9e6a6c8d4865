"""What the string's picture shows at one moment, as a value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Band = tuple[NDArray[np.float32], NDArray[np.float32]]  # lowest and highest displacement, (points,) each


@dataclass(frozen=True)
class StringFrame:
    """The string at one moment; displacements (points,) in mm.

    Attributes:
        shapes: by source.
        lowest, highest: by source, the extremes within `moment.BLUR_S`: the blur of the motion in real time.
        caption: the time, and the slow motion's speed.
        past_horizon: whether the model is past the end of its training.
        envelopes: by source, the extremes within `moment.ENVELOPE_S`; empty where they are not shown.
    """

    shapes: dict[str, NDArray[np.float32]]
    lowest: dict[str, NDArray[np.float32]]
    highest: dict[str, NDArray[np.float32]]
    caption: str = ""
    past_horizon: bool = False
    envelopes: Mapping[str, Band] = field(default_factory=dict)

    def largest_mm(self) -> float:
        """The largest displacement, in mm, of the motion without its envelopes; 0 where nothing is drawn yet."""
        bands = [*self.lowest.values(), *self.highest.values()]
        return max((float(np.abs(band).max()) for band in bands), default=0.0)
