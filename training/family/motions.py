"""True motions of the family's strings, each a file of the cache."""

from __future__ import annotations

import hashlib
import io
import json
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from engine.resonators.base import Resonator
from engine.schema import write
from engine.truth import ModalState, SplittingSolver, default_substeps
from engine.whole_file import whole_file
from training.configuration import DATA_VERSION
from training.data.dataset import default_cache
from training.family.strings import PluckedString

COARSER = 3  # times fewer sub-steps than a data set has: 1e-12 of the energy off after a second, inside the family


def true_motion(plucked: PluckedString, rate_hz: int, steps: int, cache: Path | None = None) -> Tensor:
    """Modal amplitudes of the frames 1 … steps in m, float64 (steps, modes); from the cache where they are there.

    They are kept in single precision: 4e-15 of the energy.

    Raises:
        ValueError: a cached file is damaged; the message names the file to delete.
        OSError: the cache cannot be written.
    """
    text = json.dumps([DATA_VERSION, COARSER, write(plucked.string), plucked.amplitudes_m.tolist(), rate_hz, steps])
    file = (cache or default_cache()) / "motions" / f"{hashlib.sha256(text.encode()).hexdigest()[:32]}.npy"
    if not file.exists():
        file.parent.mkdir(parents=True, exist_ok=True)
        motion = solve(plucked, rate_hz, steps).float().numpy()
        buffer = io.BytesIO()  # what NumPy writes itself fails without the system's reason
        np.save(buffer, motion)
        with whole_file(file) as unfinished:
            unfinished.write_bytes(buffer.getbuffer())
    try:
        motion = np.load(file)
    except (ValueError, EOFError) as error:
        raise ValueError(f"{file}: damaged data cache ({error}); delete it to make it again") from error
    if motion.shape != (steps, plucked.resonator.modes):
        raise ValueError(f"{file}: holds {motion.shape}; delete it to make it again")
    return torch.from_numpy(motion).double()


def solve(plucked: PluckedString, rate_hz: int, steps: int) -> Tensor:
    """The same without the cache, as it is computed."""
    solver = SplittingSolver(plucked.resonator, rate_hz, substeps=substeps_of(plucked.resonator, rate_hz))
    return solver.advance(ModalState.at_rest(plucked.amplitudes_m[None]), steps)[0][0]


def substeps_of(resonator: Resonator, rate_hz: int) -> int:
    """Of the true motion in a frame."""
    return max(1, -(-default_substeps(resonator, rate_hz) // COARSER))
