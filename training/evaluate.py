"""The errors of a model on a split of a data set, as in the paper's tables."""

from __future__ import annotations

from typing import Any

import torch

from engine.metrics import ErrorSums
from engine.models import StringModel
from engine.sine_transform import synthesis_matrix
from training.dataset import Dataset

TRAJECTORIES_AT_ONCE = 10


@torch.no_grad()
def evaluate_model(model: StringModel[Any], dataset: Dataset, split: str, steps: int | None = None) -> ErrorSums:
    """Error sums per frame of frames 1 … steps (default: all) over every trajectory of the split."""
    c = dataset.configuration
    steps = steps or c.steps
    device = next(model.parameters()).device
    synthesis = (synthesis_matrix(c.grid_points, c.modes) / dataset.scale_m).float().to(device)
    sums = ErrorSums(steps)
    was_training = model.training
    model.eval()
    for amplitudes in dataset.split(split).split(TRAJECTORIES_AT_ONCE):
        truth = amplitudes[:, : steps + 1].to(device) @ synthesis
        sums.add(model(truth[:, 0], steps), truth[:, 1:])
    model.train(was_training)
    return sums
