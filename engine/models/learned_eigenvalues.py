"""What a model learned of frequency and decay: the eigenvalues of its linear dynamics, of any family."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from engine.models.base import StringModel
from engine.models.dmd import DMD
from engine.models.ssm import DiagonalSSM

VANISHED = 1e-12  # |λ| of a state that is gone after a sample: an unused mode of a fit


def model_log_eigenvalues(model: StringModel[Any]) -> list[Tensor]:
    """log λ per sample, complex128, a tensor each layer; empty where a model has no linear dynamics.

    Of `koopman_integrated` those of a quiet string: they change with the energy.
    """
    with torch.no_grad():
        if isinstance(model, DMD):
            return [torch.complex(model.magnitude_log.double(), model.angle.double())]
        layers = [_layer_log_eigenvalues(module) for module in model.modules() if isinstance(module, DiagonalSSM)]
        if layers:
            return layers
        nu_log, theta_log = getattr(model, "nu_log", None), getattr(model, "theta_log", None)
        if isinstance(nu_log, Tensor) and isinstance(theta_log, Tensor):
            return [torch.complex(-nu_log.double().exp(), theta_log.double().exp())]
    return []


def _layer_log_eigenvalues(layer: DiagonalSSM) -> Tensor:
    """With both of a conjugate pair, of which a layer may store one."""
    stored = layer.log_eigenvalues()
    return torch.cat([stored, stored.conj()]) if layer.conjugates == 2 else stored
