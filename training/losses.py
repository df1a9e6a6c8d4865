"""The losses of the paper, on displacement in normalised units."""

from __future__ import annotations

import torch
from torch import Tensor

from engine.models import KoopmanVar


def koopman_terms(
    model: KoopmanVar, initial: Tensor, frames: Tensor, target: Tensor
) -> tuple[Tensor, Tensor, Tensor]:
    """Prediction, encoding and consistency terms of the paper's Koopman loss, each a mean square.

    Args:
        initial: frame 0, (batch, grid_points).
        frames: int64 (frames,), any selection of 1 … N.
        target: the truth at these frames, (batch, frames, grid_points).
    """
    origin = model.encode(initial).origin
    latents = model.latents(origin, frames)
    prediction = (model.decode(latents) - target).square().mean()
    encoding = (model.decode(origin) - initial).square().mean()
    encoded = torch.view_as_real(model.encode(target).origin - latents)
    consistency = encoded.square().sum(-1).mean()
    return prediction, encoding, consistency
