"""The recurrences of `fno`, which gradients pass through: any number of strings at once.

As written, a step would mostly compute transforms of a length with a large prime factor, multiply complex numbers of
single frequencies, and call. Here it is some ten matrix products: the folded transforms
(`_fno_transform`) of all strings together, and at each frequency one real matrix for real and imaginary parts of all
channels; the gates z and r, which see the same field, in one.

Fields are (points, batch, width), width being the number of channels. Spectra are (frequencies, batch, 2·width) with
the real parts of all channels first, and as many frequencies as points. Below, half = points // 2 + 1.
"""

from __future__ import annotations

from functools import cache

import torch
from torch import Tensor
from torch.nn import functional

from engine.models._fno_transform import exact_matrices


def channel_matrices(weight: Tensor) -> Tensor:
    """A Fourier convolution's weight (frequency, in, 2, out) as real matrices (frequency, 2·in, 2·out)."""
    real, imaginary = weight[:, :, 0], weight[:, :, 1]
    return torch.cat([torch.cat([real, imaginary], 2), torch.cat([-imaginary, real], 2)], 1)


def joined(first: Tensor, second: Tensor) -> Tensor:
    """Two convolutions of one field in one: matrices (frequency, 2·in, 2·out) to (frequency, 2·in, 4·out).

    Outputs are the real parts of the first and of the second, then the imaginary parts of both.
    """
    pairs = zip(first.chunk(2, 2), second.chunk(2, 2), strict=True)  # of real, then of imaginary parts
    return torch.cat([part for pair in pairs for part in pair], 2)


@cache
def _matrices(points: int, dtype: torch.dtype, device: torch.device) -> tuple[Tensor, Tensor]:
    """The folded transform (2, frequencies, half) and its inverse (2, half, frequencies), see `exact_matrices`."""
    forward, inverse = (torch.from_numpy(matrix).to(device, dtype) for matrix in exact_matrices(points))
    return forward, inverse


def _analyse(field: Tensor, matrix: Tensor) -> Tensor:
    """The spectrum (frequencies, batch, 2·width) of a field (points, batch, width), real parts first.

    The field is folded in its middle: sums of mirrored points give the real parts, differences the imaginary ones.

    Args:
        matrix: the folded transform, (2, frequencies, half).
    """
    points, batch, width = field.shape
    half = points // 2 + 1
    # the second half of the points, backwards, (half, batch, width): 0 for the first point and a middle one, which
    # have no mirror image
    mirrored = functional.pad(field[half:].flip(0), (0, 0, 0, 0, 1, 2 * half - 1 - points))
    folded = torch.stack([field[:half] + mirrored, field[:half] - mirrored])
    parts = torch.bmm(matrix, folded.view(2, half, batch * width)).view(2, points, batch, width)
    return torch.cat([parts[0], parts[1]], dim=2)


def _synthesise(spectrum: Tensor, matrix: Tensor) -> Tensor:
    """The field (points, batch, channels) of a spectrum (frequencies, batch, 2·channels), real parts first.

    Cosines give the symmetric part of the field and sines the antisymmetric one, on half of the points; the other
    half is their difference, mirrored.

    Args:
        matrix: the inverse of the folded transform, (2, half, frequencies).
    """
    points, batch, width = spectrum.shape
    parts = torch.stack(spectrum.chunk(2, dim=2)).view(2, points, batch * width // 2)
    even, odd = torch.bmm(matrix, parts).view(2, points // 2 + 1, batch, width // 2)
    first = (points + 1) // 2
    return torch.cat([even + odd, (even[1:first] - odd[1:first]).flip(0)])


def fgru_rollout(
    hidden: Tensor, gates: Tensor, gates_bias: Tensor, candidate: Tensor, bias: Tensor, steps: int
) -> Tensor:
    """The hidden fields of an FGRU after each of `steps` steps, (steps, points, batch, width).

    Args:
        hidden: the field before the first step, (points, batch, width).
        gates, gates_bias: of z and r, `joined`: (frequency, 2·width, 4·width) and, in space, (points, 2·width).
        candidate, bias: of tanh's argument, (frequency, 2·width, 2·width) and (points, width).
    """
    forward, inverse = _matrices(len(hidden), hidden.dtype, hidden.device)
    fields = []
    for _ in range(steps):
        both = _synthesise(torch.bmm(_analyse(hidden, forward), gates), inverse) + gates_bias[:, None]
        z, r = both.sigmoid().chunk(2, dim=2)
        c = _synthesise(torch.bmm(_analyse(r * hidden, forward), candidate), inverse) + bias[:, None]
        hidden = torch.lerp(hidden, c.tanh(), z)
        fields.append(hidden)
    return torch.stack(fields)


def frnn_rollout(
    hidden: Tensor, matrices: Tensor, biases: Tensor, pointwise: Tensor, offsets: Tensor, steps: int
) -> Tensor:
    """The hidden fields of an FRNN after each of `steps` steps, (steps, points, batch, width).

    Args:
        hidden: the field before the first step, (points, batch, width).
        matrices, biases: of the Fourier layers, (depth, frequency, 2·width, 2·width) and (depth, points, width).
        pointwise, offsets: of the layers at each point, (depth, width out, width in) and (depth, width).
    """
    forward, inverse = _matrices(len(hidden), hidden.dtype, hidden.device)
    fields = []
    for _ in range(steps):
        for matrix, bias, weight, offset in zip(matrices, biases, pointwise, offsets, strict=True):
            branch = _synthesise(torch.bmm(_analyse(hidden, forward), matrix), inverse) + bias[:, None]
            hidden = functional.linear(hidden, weight, offset) + branch.relu()
        fields.append(hidden)
    return torch.stack(fields)
