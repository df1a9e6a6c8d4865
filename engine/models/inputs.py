"""What an encoder is told of the moment from which it sets out.

Source: the paper, §4.1 (displacement alone) and its conclusion, which proposes the other two: without a velocity
or an earlier frame, no phase is known but that of a string at rest.

    displacement             u₀; the string was at rest
    displacement_velocity    u₀ and u̇₀, in units of displacement per sample
    two_frames               u₀ and u₋₁, the frame before it
"""

from __future__ import annotations

from typing import Literal

import torch
from torch import Tensor

InputKind = Literal["displacement", "displacement_velocity", "two_frames"]

_SECOND = {"displacement_velocity": "the velocity", "two_frames": "the frame before"}


def input_size(kind: InputKind, grid_points: int) -> int:
    """Numbers that go into an encoder."""
    return grid_points if kind == "displacement" else 2 * grid_points


def join_input(kind: InputKind, displacement: Tensor, second: Tensor | None) -> Tensor:
    """Displacement and `second`, (..., grid_points) each, as the encoder's input (..., input_size).

    Raises:
        ValueError: `second` is missing, not wanted, or of another shape.
    """
    if kind == "displacement":
        if second is not None:
            raise ValueError("input 'displacement' takes no second array; train a model with another input")
        return displacement
    if second is None:
        raise ValueError(f"input {kind!r} needs {_SECOND[kind]} beside the displacement")
    if second.shape != displacement.shape:
        raise ValueError(
            f"{_SECOND[kind]} has shape {tuple(second.shape)}, the displacement {tuple(displacement.shape)}"
        )
    return torch.cat([displacement, second], dim=-1)


def second_at_rest(kind: InputKind, displacement: Tensor) -> Tensor | None:
    """What an encoder is told beside the displacement (..., grid_points) of a string that is released at rest.

    Raises:
        ValueError: a string at rest has no frame before.
    """
    if kind == "two_frames":
        raise ValueError("input 'two_frames' needs the frame before, which a string at rest does not have")
    return torch.zeros_like(displacement) if kind == "displacement_velocity" else None
