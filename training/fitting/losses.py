"""The losses of the paper, on displacement in normalised units; means over frames where the paper sums.

Koopman models are trained on prediction, encoding and consistency (§4.2); the others on prediction alone, the Fourier
models on its logarithm. All take any selection of frames: a Koopman rollout needs no recursion, the others run up to
the last of them.

They follow the paper's text, or with `koopman_terms = "published"` its authors' script (rodrigodzf/physmodjax,
`lindyn_loss`): that encodes and decodes all frames without Koopman_var's multiplier, and compares φ(u_k) with the
multiplied states. The text sums over grid points and latents where means are taken here: with 101 points and 128
latents that counts consistency 0.79 times as much.
"""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

import torch
from torch import Tensor

from engine.models.base import StringModel
from training.configuration import Recipe
from training.data.batches import Batch

SILENT = 1e-12  # a string's mean square in normalised units that a relative loss divides by at least


@runtime_checkable
class KoopmanModel(Protocol):
    """A model whose latents can be had at any frame."""

    def encode(self, displacement: Tensor) -> Any: ...
    def latents(self, origin: Tensor, frames: Tensor) -> Tensor: ...
    def decode(self, latents: Tensor) -> Tensor: ...


@runtime_checkable
class ObservedModel(Protocol):
    """A Koopman model whose decoder reads states that follow from the latents."""

    def encode(self, displacement: Tensor) -> Any: ...
    def latents(self, origin: Tensor, frames: Tensor) -> Tensor: ...
    def observed(self, latents: Tensor) -> Tensor: ...
    def read(self, states: Tensor) -> Tensor: ...


def training_loss(model: StringModel[Any], batch: Batch, recipe: Recipe) -> tuple[Tensor, Tensor]:
    """The loss that is minimised, and the mean square of the prediction's error alone.

    Consistency compares with the encoded truth; without a weight it costs nothing.
    """
    if recipe.koopman_terms == "published" and isinstance(model, ObservedModel):
        return _published_loss(model, batch, recipe)
    if not isinstance(model, KoopmanModel):
        return _prediction(_predicted(model, batch), batch.target, recipe)
    origin = model.encode(batch.initial).origin
    latents = model.latents(origin, batch.frames)
    loss, prediction = _prediction(model.decode(latents), batch.target, recipe)
    loss = loss + _mean_square(model.decode(origin), batch.initial)
    if recipe.consistency_weight:
        encoded = model.encode(batch.target.flatten(0, 1)).origin.view_as(latents)
        loss = loss + recipe.consistency_weight * _consistency(latents, encoded)
    return loss, prediction


def _published_loss(model: ObservedModel, batch: Batch, recipe: Recipe) -> tuple[Tensor, Tensor]:
    """The loss of the authors' script: encoding on all frames, consistency of what the decoder reads."""
    frames = torch.cat([batch.initial[:, None], batch.target], dim=1)
    encoded = model.encode(frames.flatten(0, 1)).origin.unflatten(0, frames.shape[:2])
    states = model.observed(model.latents(encoded[:, 0], batch.frames))
    loss, prediction = _prediction(model.read(states), batch.target, recipe)
    loss = loss + _mean_square(model.read(encoded), frames)
    return loss + recipe.consistency_weight * _consistency(states, encoded[:, 1:]), prediction


def _consistency(states: Tensor, encoded: Tensor) -> Tensor:
    return torch.view_as_real(encoded - states).square().sum(-1).mean()


def _predicted(model: StringModel[Any], batch: Batch) -> Tensor:
    last = int(batch.frames[-1])
    frames, _ = model.advance(model.encode(batch.initial), last)
    every = torch.arange(1, last + 1, device=batch.frames.device)  # some may be drawn twice, and others not
    return frames if torch.equal(batch.frames, every) else frames[:, batch.frames - 1]


def _mean_square(found: Tensor, wanted: Tensor) -> Tensor:
    return (found - wanted).square().mean()


def _prediction(found: Tensor, wanted: Tensor, recipe: Recipe) -> tuple[Tensor, Tensor]:
    """The prediction's loss, and the mean square of its error."""
    error = _mean_square(found, wanted)
    if recipe.loss == "log10_mse":
        return error.log10(), error.detach()
    if recipe.loss == "relative_mse":
        own = (found - wanted).square().mean((1, 2)) / wanted.square().mean((1, 2)).clamp(min=SILENT)
        return own.mean(), error.detach()
    return error, error.detach()
