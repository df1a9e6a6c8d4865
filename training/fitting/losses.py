"""The losses of the paper, on displacement in normalised units; means over frames where the paper sums.

Koopman models are trained on prediction, encoding and consistency (§4.2); the others on prediction alone, the Fourier
models on its logarithm. All take any selection of frames: a Koopman rollout needs no recursion, the others run up to
the last of them.

Where the paper's text and its authors' code (rodrigodzf/physmodjax, `lindyn_loss`) differ, a recipe's
`koopman_terms` chooses. "text", the default: consistency is of Λᵏ φ(u₀), encoding of frame 0, decoded as any other
frame. The text sums over grid points and latents where means are taken here: with 101 points and 128 latents that
counts consistency 0.79 times as much. "code": φ(u_k) is compared with Koopman_var's multiplied states, as a mean over
real and imaginary parts, half of that over latents; the encoding is of all frames, past the multiplier.
"""

from __future__ import annotations

from typing import Any, Protocol, cast, runtime_checkable

import torch
from torch import Tensor

from engine.models import DiagonalModel, StringModel
from training.configuration import Recipe
from training.data.batches import Batch

SILENT = 1e-12  # a string's mean square in normalised units that a relative loss divides by at least


@runtime_checkable
class KoopmanModel(Protocol):
    """A model whose latents can be had at any frame."""

    def encode(self, displacement: Tensor) -> Any: ...
    def latents(self, origin: Tensor, frames: Tensor) -> Tensor: ...
    def decode(self, latents: Tensor) -> Tensor: ...


def training_loss(model: StringModel[Any], batch: Batch, recipe: Recipe) -> tuple[Tensor, Tensor]:
    """The weighted loss that is minimised, and the mean square of the prediction's error alone.

    A term of weight 0 costs nothing. Consistency compares with the encoded truth.
    """
    if recipe.koopman_terms == "code":
        return _loss_of_code(cast("DiagonalModel", model), batch, recipe)
    if not isinstance(model, KoopmanModel):
        loss, prediction = _prediction(_predicted(model, batch), batch.target, recipe)
        return recipe.prediction_weight * loss, prediction
    origin = model.encode(batch.initial).origin
    latents = model.latents(origin, batch.frames)
    loss, prediction = _prediction(model.decode(latents), batch.target, recipe)
    loss = recipe.prediction_weight * loss
    if recipe.encoding_weight:
        loss = loss + recipe.encoding_weight * _mean_square(model.decode(origin), batch.initial)
    if recipe.consistency_weight:
        encoded = model.encode(batch.target.flatten(0, 1)).origin.view_as(latents)
        consistency = torch.view_as_real(encoded - latents).square().sum(-1).mean()
        loss = loss + recipe.consistency_weight * consistency
    return loss, prediction


def _loss_of_code(model: DiagonalModel, batch: Batch, recipe: Recipe) -> tuple[Tensor, Tensor]:
    frames = torch.cat([batch.initial[:, None], batch.target], dim=1)
    encoded = model.encode(frames.flatten(0, 1)).origin.unflatten(0, frames.shape[:2])
    modulated = model.modulated(model.latents(encoded[:, 0], batch.frames))
    loss, prediction = _prediction(model.synthesise(modulated), batch.target, recipe)
    loss = recipe.prediction_weight * loss
    if recipe.encoding_weight:
        loss = loss + recipe.encoding_weight * _mean_square(model.synthesise(encoded), frames)
    if recipe.consistency_weight:
        difference = torch.view_as_real(modulated - encoded[:, 1:])
        loss = loss + recipe.consistency_weight * difference.square().mean()
    return loss, prediction


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
