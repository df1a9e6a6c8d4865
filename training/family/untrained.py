"""The untrained players of the family's strings, by the physics alone: rows beside those of learned models."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from engine.models import build_model
from engine.models.base import Physics, StringModel
from training.family.errors import SCALE_M, Player, rollout
from training.family.strings import PluckedString


def linear_string(plucked: PluckedString, rate_hz: int, steps: int) -> Tensor:
    """The string without tension modulation: what all errors are large beside."""
    times = torch.arange(1, steps + 1, dtype=torch.float64)[:, None] / rate_hz
    eigenvalues = torch.from_numpy(plucked.resonator.eigenvalues())
    sine = -eigenvalues.real / eigenvalues.imag
    angle = times * eigenvalues.imag
    return plucked.amplitudes_m * torch.exp(times * eigenvalues.real) * (angle.cos() + sine * angle.sin())


def averaging(plucked: PluckedString, rate_hz: int, steps: int) -> Tensor:
    """`koopman_integrated` as averaging over a period starts it, without networks and without training."""
    sizes = {
        "state_size": plucked.resonator.modes,
        "encoder_widths": (),
        "eigenvalue_widths": (),
        "node_spacing": 160,
        "adiabatic": True,
        "second_order": True,
    }
    return rollout(_started("koopman_integrated", sizes, "averaging", plucked, rate_hz), plucked, steps)


def untrained(how: str) -> Player:
    """`koopman_tension` as its start of this name leaves it."""

    def play(plucked: PluckedString, rate_hz: int, steps: int) -> Tensor:
        return rollout(
            _started("koopman_tension", {"modes": plucked.resonator.modes}, how, plucked, rate_hz), plucked, steps
        )

    return play


def knowing_physics() -> dict[str, Player]:
    """The untrained players by name: each knows the string, and more or less of what its tension does."""
    return {
        "kicks without corrections": untrained("kicks"),
        "backward error analysis (1/12)": untrained("series"),
        "averaging": averaging,
        "linear string": linear_string,
    }


def _started(name: str, sizes: dict[str, Any], how: str, plucked: PluckedString, rate_hz: int) -> StringModel[Any]:
    model = build_model(name, sizes)
    model.initialise(how, Physics(plucked.resonator, rate_hz, SCALE_M), torch.Generator().manual_seed(0))
    return model.eval()
