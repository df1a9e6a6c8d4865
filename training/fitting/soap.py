"""SOAP: Adam in the eigenbasis of Shampoo's preconditioner.

Source: Vyas et al., SOAP: Improving and Stabilizing Shampoo using Adam, 2024 (arXiv:2409.11321), algorithm 3. The
gradient G (m, n) of a matrix has means of G Gᵀ and Gᵀ G; Adam's second moments are kept in their eigenvectors, where
the loss bends along the axes more nearly than in the weights themselves. What is no matrix takes Adam's step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from math import prod
from typing import Any

import torch
from torch import Tensor
from torch.optim import Optimizer

DECAY = 0.95  # of every running mean, an iteration: the source's
EVERY = 10  # iterations between two refreshes of the eigenvectors
EPSILON = 1e-8


class SOAP(Optimizer):
    """See the module; the decay of weights is AdamW's.

    A tensor of more than two axes is the matrix that is nearest to a square. The first iteration only finds the
    eigenvectors. All of the state are contiguous tensors, so that a run continues from a checkpoint bit for bit.
    """

    def __init__(self, params: Iterable[dict[str, Any]], lr: float, weight_decay: float = 0.0) -> None:
        super().__init__(params, {"lr": lr, "weight_decay": weight_decay})

    @torch.no_grad()
    def step(self, closure: Callable[[], float] | None = None) -> None:  # type: ignore[override]
        if closure is not None:
            raise ValueError("SOAP takes no closure")
        for group in self.param_groups:
            for parameter in group["params"]:
                if parameter.grad is not None:
                    direction = _direction(self.state[parameter], _matrix(parameter.grad))
                    parameter.mul_(1 - group["lr"] * group["weight_decay"])
                    parameter.sub_(direction.view_as(parameter), alpha=group["lr"])


def _matrix(tensor: Tensor) -> Tensor:
    """(m, n) of the smallest m + n that the tensor's axes can be grouped to; vectors as they are. Contiguous."""
    shape = tensor.shape
    if len(shape) < 2:
        return tensor.contiguous()
    rows = min((prod(shape[:k]) for k in range(1, len(shape))), key=lambda m: m + tensor.numel() // m)
    return tensor.reshape(rows, -1).contiguous()


def _direction(state: dict[str, Tensor], gradient: Tensor) -> Tensor:
    """The direction of a step at a learning rate of 1, to be subtracted, of the gradient's shape.

    Args:
        state: of one parameter, changed in place; empty before the first iteration, whose direction is 0.
        gradient: (m, n), or a vector.
    """
    if not state:
        if not bool(gradient.isfinite().all()):  # it has no eigenvectors
            return torch.zeros_like(gradient)
        state["step"] = torch.zeros(())
        state["mean"], state["square"] = torch.zeros_like(gradient), torch.zeros_like(gradient)
        if gradient.ndim == 2:
            for side, covariance in _covariances(gradient):
                state[f"{side}_covariance"] = (1 - DECAY) * covariance
                vectors = torch.linalg.eigh(covariance.double()).eigenvectors.flip(1)  # the largest eigenvalue first
                state[f"{side}_vectors"] = vectors.to(gradient).contiguous()
            return torch.zeros_like(gradient)
    state["step"] += 1
    unbias = 1 - DECAY ** float(state["step"])
    mean = state["mean"].lerp_(gradient, 1 - DECAY)
    if gradient.ndim < 2:
        square = state["square"].lerp_(gradient.square(), 1 - DECAY)
        return mean / unbias / ((square / unbias).sqrt() + EPSILON)
    left, right = state["left_vectors"], state["right_vectors"]
    square = state["square"].lerp_((left.T @ gradient @ right).square(), 1 - DECAY)
    turned = left.T @ mean @ right
    direction = left @ (turned / unbias / ((square / unbias).sqrt() + EPSILON)) @ right.T
    for side, covariance in _covariances(gradient):
        state[f"{side}_covariance"].lerp_(covariance, 1 - DECAY)
    if float(state["step"]) % EVERY == 0:
        _refresh(state)
    return direction


def _covariances(gradient: Tensor) -> tuple[tuple[str, Tensor], tuple[str, Tensor]]:
    """Both covariances of one gradient (m, n): "left" (m, m) and "right" (n, n)."""
    return ("left", gradient @ gradient.T), ("right", gradient.T @ gradient)


def _refresh(state: dict[str, Tensor]) -> None:
    """Take one step of the orthogonal iteration towards the eigenvectors of today's covariances."""
    for axis, side in enumerate(("left", "right")):
        covariance, vectors = state[f"{side}_covariance"], state[f"{side}_vectors"]
        images = covariance @ vectors
        order = (vectors * images).sum(0).argsort(descending=True, stable=True)
        state["square"] = state["square"].index_select(axis, order)
        state[f"{side}_vectors"] = torch.linalg.qr(images[:, order]).Q.contiguous()
