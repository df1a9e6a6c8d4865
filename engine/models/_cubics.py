"""Cubics between samples of a smooth function: its integral, and what lies between values with known slopes."""

from __future__ import annotations

import torch
from torch import Tensor, nn


def integrate_parabolas(samples: Tensor, positions: Tensor) -> tuple[Tensor, Tensor]:
    """The integral from 0 of the parabolas through samples at 0, ½, 1 of every segment, and the parabolas themselves.

    Simpson's rule over whole segments, and the cubic of the rest. Both have O(1) cost at a position.

    Args:
        samples: (batch, 2 segments + 1, values).
        positions: (times,) in segments.

    Returns:
        (batch, times, values) each.
    """
    left = samples[:, :-1:2]
    middle = samples[:, 1::2]
    right = samples[:, 2::2]
    whole = torch.cumsum((left + 4 * middle + right) / 6, dim=1)  # from 0 to the end of each segment
    segment = positions.floor().long().clamp(0, left.shape[1] - 1)
    u = (positions - segment)[:, None]  # 0 … 1 within the segment, (times, 1)
    left = left[:, segment]
    middle = middle[:, segment]
    right = right[:, segment]
    before = nn.functional.pad(whole, (0, 0, 1, 0))[:, segment]
    # left + u slope + u² bend
    slope, bend = 4 * middle - 3 * left - right, 2 * (left + right) - 4 * middle
    return before + u * (left + u * (slope / 2 + u * bend / 3)), left + u * (slope + u * bend)


def hermite(count: int, like: Tensor) -> Tensor:
    """Weights (count, 4) of a unit segment's left and right value, left and right slope, at 0, 1/count, …

    Their type and device are those of the tensor `like`.
    """
    share = torch.arange(count, device=like.device).double() / count
    square, cube = share**2, share**3
    right = 3 * square - 2 * cube
    return torch.stack([1 - right, right, share - 2 * square + cube, cube - square], dim=1).to(like)
