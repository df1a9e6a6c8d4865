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
from torch import Tensor, nn
from torch.nn import functional

from engine.models.base import KoopmanModel, StringModel
from training.configuration import Recipe
from training.data.batches import Batch

FRAMES_AT_ONCE = 2048  # on a CPU: their numbers stay in a core's cache
SILENT = 1e-12  # a string's mean square in normalised units that a relative loss divides by at least


@runtime_checkable
class ObservedModel(Protocol):
    """A Koopman model of constant eigenvalues λ, whose decoder reads states that follow from the latents."""

    def encode(self, displacement: Tensor) -> Any: ...
    def powers(self, frames: Tensor) -> Tensor: ...
    def states(self, latents: Tensor, origin: Tensor, powers: Tensor) -> Tensor: ...
    def read(self, states: Tensor) -> Tensor: ...
    def decode(self, latents: Tensor) -> Tensor: ...


def training_loss(
    model: StringModel[Any], batch: Batch, recipe: Recipe, powers: Tensor | None = None
) -> tuple[Tensor, Tensor]:
    """The loss that is minimised, and the mean square of the prediction's error alone.

    Consistency compares with the encoded truth; without a weight it costs nothing.

    Args:
        powers: an `ObservedModel`'s at the batch's frames, single precision, where they are known.
    """
    if isinstance(model, ObservedModel):
        powers = _powers(model, batch) if powers is None else powers
        if recipe.koopman_terms == "published":
            return _published_loss(model, batch, recipe, powers)
        origin = model.encode(batch.initial).origin
        latents = origin[:, None] * powers
        predicted = model.read(model.states(latents, origin, powers))
        return _text_loss(model, batch, recipe, origin, latents, predicted)
    if isinstance(model, KoopmanModel):
        origin = model.encode(batch.initial).origin
        latents = model.latents(origin, batch.frames)
        return _text_loss(model, batch, recipe, origin, latents, model.decode(latents))
    return _prediction(_predicted(model, batch), batch.target, recipe)


def backward(model: StringModel[Any], batch: Batch, recipe: Recipe) -> Tensor:
    """Add the gradients of `training_loss` to the weights', and return the mean square of the prediction's error.

    On a CPU a Koopman model takes a few trajectories after another, in about a fifth less time than all at once.
    """
    strings = len(batch.initial)
    if batch.target.device.type != "cpu" or not isinstance(model, KoopmanModel) or not _is_a_mean(model, recipe):
        loss, error = training_loss(model, batch, recipe)
        loss.backward()
        return error
    powers = _powers(model, batch) if isinstance(model, ObservedModel) else None
    held = None if powers is None else powers.detach().requires_grad_()
    error = torch.zeros(())
    for part in batch.split(max(1, FRAMES_AT_ONCE // len(batch.frames))):
        share = len(part.initial) / strings
        loss, mean_square = training_loss(model, part, recipe, held)
        (share * loss).backward()
        error += share * mean_square
    if powers is not None and held is not None:
        powers.backward(held.grad)
    return error


def _is_a_mean(model: nn.Module, recipe: Recipe) -> bool:
    """Return True if the loss of several strings is the mean of the loss of each."""
    return recipe.loss != "log10_mse" and not any(isinstance(module, nn.BatchNorm1d) for module in model.modules())


def _powers(model: ObservedModel, batch: Batch) -> Tensor:
    """The powers of the eigenvalues at the batch's frames, complex of its precision."""
    return model.powers(batch.frames).to(batch.target.dtype.to_complex())


def _text_loss(
    model: KoopmanModel | ObservedModel,
    batch: Batch,
    recipe: Recipe,
    origin: Tensor,
    latents: Tensor,
    predicted: Tensor,
) -> tuple[Tensor, Tensor]:
    """The loss of the paper's text: encoding on the first frame, consistency of latents.

    Args:
        origin: encoded initial frames, complex (batch, latents).
        latents: predicted ones at the batch's frames, (batch, frames, latents).
        predicted: displacement at these frames, (batch, frames, grid_points).

    Returns:
        the loss, and the mean square of the prediction's error.
    """
    loss, prediction = _prediction(predicted, batch.target, recipe)
    loss = loss + functional.mse_loss(model.decode(origin), batch.initial)
    if recipe.consistency_weight:
        encoded = model.encode(batch.target.flatten(0, 1)).origin.view_as(latents)
        loss = loss + recipe.consistency_weight * _consistency(latents, encoded)
    return loss, prediction


def _published_loss(model: ObservedModel, batch: Batch, recipe: Recipe, powers: Tensor) -> tuple[Tensor, Tensor]:
    """The loss of the authors' script: encoding on all frames, consistency of what the decoder reads."""
    frames = torch.cat([batch.initial[:, None], batch.target], dim=1)
    encoded = model.encode(frames.flatten(0, 1)).origin.unflatten(0, frames.shape[:2])
    origin, others = encoded.split([1, len(batch.frames)], dim=1)
    states = model.states(origin * powers, origin[:, 0], powers)
    loss, prediction = _prediction(model.read(states), batch.target, recipe)
    loss = loss + functional.mse_loss(model.read(encoded), frames)
    return loss + recipe.consistency_weight * _consistency(states, others), prediction


def _consistency(states: Tensor, encoded: Tensor) -> Tensor:
    """The mean squared magnitude of the difference of complex states, one number."""
    return 2 * functional.mse_loss(torch.view_as_real(states), torch.view_as_real(encoded))


def _predicted(model: StringModel[Any], batch: Batch) -> Tensor:
    """The prediction at the batch's frames, (batch, frames, grid_points), by a rollout up to the last of them."""
    frames, _ = model.advance(model.encode(batch.initial), batch.last)
    return frames if batch.every else frames[:, batch.frames - 1]


def _prediction(predicted: Tensor, wanted: Tensor, recipe: Recipe) -> tuple[Tensor, Tensor]:
    """The prediction's loss as the recipe counts it, and the mean square of its error, without gradient.

    Args:
        predicted, wanted: (batch, frames, grid_points) in normalised units.
    """
    error = functional.mse_loss(predicted, wanted)
    if recipe.loss == "log10_mse":
        return error.log10(), error.detach()
    if recipe.loss == "relative_mse":
        relative = (predicted - wanted).square().mean((1, 2)) / wanted.square().mean((1, 2)).clamp(min=SILENT)
        return relative.mean(), error.detach()
    return error, error.detach()
