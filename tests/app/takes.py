"""Takes of known motion."""

import numpy as np
from numpy.typing import NDArray

from app.rendering import Take


def append_to(take: Take, model_m: NDArray[np.float32], truth_m: NDArray[np.float32]) -> None:
    """Adds pictures (frames, grid_points) in m of model and truth."""
    take.motions["model"].append(model_m)
    take.motions["truth"].append(truth_m)
    take.measure()
