"""The gradients of several seeds of one run in one pass.

Their weights are stacked, and the model is mapped over them.

A small model leaves a GPU waiting for launches; the mapped pass launches as many kernels as one seed does. A CPU does
not wait, and its caches have no room for five: a step of five seeds of Koopman_var took 2.5 s mapped and 0.8 s one
after another (two threads, timed by hand; LRU and S5 alike). Each seed keeps its own weights, batches, optimiser and
checkpoint. One trained with others is the one trained alone, up to the rounding of batched products.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor, nn
from torch.func import functional_call, stack_module_state, vmap

from engine.models.base import StringModel
from training.configuration import Recipe
from training.data.batches import Batch
from training.fitting.losses import ObservedModel, training_loss

MAPPED_ON = ("cuda",)  # kinds of device


def can_be_mapped(models: Sequence[StringModel[Any]], batches: Sequence[Batch]) -> bool:
    """Return True if one pass can serve these models, copies of one another, on these batches of equal shapes.

    Where each seed draws its own frames, a model must take them by number alone, as Koopman and Koopman_var do.
    """
    device = batches[0].target.device.type
    same_shape = all(batch.target.shape == batches[0].target.shape for batch in batches)
    serves = device in MAPPED_ON and models[0].mapped and same_shape
    return serves and (_same_frames(batches) or isinstance(models[0], ObservedModel))


def _same_frames(batches: Sequence[Batch]) -> bool:
    """Return True if all batches have the same frames."""
    if all(batch.every for batch in batches):
        return True
    return all(torch.equal(batch.frames, batches[0].frames) for batch in batches)


def backward(models: Sequence[StringModel[Any]], batches: Sequence[Batch], recipe: Recipe) -> Tensor:
    """Set each model's gradients of its `training_loss`, and return the prediction's mean squares, (models,).

    Running statistics of batch norm move as in a pass of each model alone.
    """
    every = batches[0].every
    template = _Loss(models[0], recipe, every)
    parameters, buffers = stack_module_state([_Loss(model, recipe, every) for model in models])
    initial, target = (torch.stack([getattr(b, name) for b in batches]) for name in ("initial", "target"))
    same = _same_frames(batches)
    frames = batches[0].frames if same else torch.stack([batch.frames for batch in batches])

    def loss(weights: dict[str, Tensor], statistics: dict[str, Tensor], *batch: Tensor) -> tuple[Tensor, Tensor]:
        gradients: tuple[Tensor, Tensor] = functional_call(template, (weights, statistics), batch)
        return gradients

    losses, errors = vmap(loss, in_dims=(0, 0, 0, None if same else 0, 0))(
        parameters, buffers, initial, frames, target
    )
    losses.sum().backward()
    with torch.no_grad():
        for number, model in enumerate(models):
            for name, parameter in model.named_parameters(prefix="model"):
                stacked = parameters[name].grad
                parameter.grad = None if stacked is None else stacked[number]
            for name, buffer in model.named_buffers(prefix="model"):
                buffer.copy_(buffers[name][number])
    return errors


class _Loss(nn.Module):
    """`training_loss` as a module's output, for `functional_call`; `every`: see `Batch`."""

    def __init__(self, model: StringModel[Any], recipe: Recipe, every: bool) -> None:
        super().__init__()
        self.model = model
        self._recipe = recipe
        self._every = every

    def forward(self, initial: Tensor, frames: Tensor, target: Tensor) -> tuple[Tensor, Tensor]:
        return training_loss(self.model, Batch(initial, frames, target, self._every), self._recipe)
