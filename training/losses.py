"""The losses of the paper, on displacement in normalised units.

Koopman models are trained on prediction, encoding and consistency (§4.2); the others on prediction alone. Both take
any selection of frames: a Koopman rollout needs no recursion, the others run up to the last of them.
"""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

import torch
from torch import Tensor

from engine.models import StringModel

Terms = tuple[Tensor, Tensor, Tensor]


@runtime_checkable
class KoopmanModel(Protocol):
    """A model whose latents can be had at any frame."""

    def encode(self, displacement: Tensor) -> Any: ...
    def latents(self, origin: Tensor, frames: Tensor) -> Tensor: ...
    def decode(self, latents: Tensor) -> Tensor: ...


def loss_terms(model: StringModel[Any], initial: Tensor, frames: Tensor, target: Tensor) -> Terms:
    """Prediction, encoding and consistency terms, each a mean square; the last two are zero where a model has none.

    Args:
        initial: frame 0, (batch, grid_points).
        frames: int64 (frames,), any selection of 1 … N.
        target: the truth at these frames, (batch, frames, grid_points).
    """
    if isinstance(model, KoopmanModel):
        return _koopman_terms(model, initial, frames, target)
    predicted = model(initial, int(frames.max()))[:, frames - 1]
    zero = target.new_zeros(())
    return (predicted - target).square().mean(), zero, zero


def _koopman_terms(model: KoopmanModel, initial: Tensor, frames: Tensor, target: Tensor) -> Terms:
    origin = model.encode(initial).origin
    latents = model.latents(origin, frames)
    prediction = (model.decode(latents) - target).square().mean()
    encoding = (model.decode(origin) - initial).square().mean()
    encoded = model.encode(target.flatten(0, 1)).origin.view_as(latents)
    consistency = torch.view_as_real(encoded - latents).square().sum(-1).mean()
    return prediction, encoding, consistency
