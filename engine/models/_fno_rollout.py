"""The recurrences of `fno` for training: any number of strings at once, with their gradients by hand.

The definition spends most of its time on transforms of a length with a large prime factor, on complex products of
single frequencies, and on calls. Here a step is some ten matrix products: the folded transforms (`_fno_transform`) of
all strings together, and at each frequency one real matrix for real and imaginary parts of all channels; the gates z
and r, which see the same field, in one. Gradients of the weights are summed up in place, step after step.

Fields are (points, batch, width), spectra (frequencies, batch, 2·width) with the real parts first.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from engine.models._fno_transform import exact_matrices


@dataclass(frozen=True)
class Transforms:
    """The folded transform, its inverse, and the transposes of both, which gradients need.

    Attributes:
        forward, inverse_transposed: (2, frequencies, half).
        inverse, forward_transposed: (2, half, frequencies).
    """

    forward: Tensor
    inverse: Tensor
    forward_transposed: Tensor
    inverse_transposed: Tensor

    @classmethod
    def of(cls, field: Tensor) -> Transforms:
        """For fields like this one (points, batch, width)."""
        forward, inverse = (torch.from_numpy(matrix).to(field) for matrix in exact_matrices(len(field)))
        return cls(forward, inverse, forward.mT.contiguous(), inverse.mT.contiguous())


def channel_matrices(weight: Tensor) -> Tensor:
    """A Fourier convolution's weight (frequency, in, 2, out) as real matrices (frequency, 2·in, 2·out)."""
    real, imaginary = weight[:, :, 0], weight[:, :, 1]
    return torch.cat([torch.cat([real, imaginary], 2), torch.cat([-imaginary, real], 2)], 1)


def joined(first: Tensor, second: Tensor) -> Tensor:
    """Two convolutions of one field in one: matrices (frequency, 2·in, 2·out) to (frequency, 2·in, 4·out)."""
    pairs = zip(first.chunk(2, 2), second.chunk(2, 2), strict=True)  # of real, then of imaginary parts
    return torch.cat([part for pair in pairs for part in pair], 2)


def _analyse(field: Tensor, matrix: Tensor) -> Tensor:
    points, batch, width = field.shape
    half, first = points // 2 + 1, (points + 1) // 2
    folded = field[:half].expand(2, -1, -1, -1).contiguous()
    mirrored = field[half:].flip(0)
    folded[0, 1:first] += mirrored
    folded[1, 1:first] -= mirrored
    parts = torch.bmm(matrix, folded.view(2, half, batch * width)).view(2, -1, batch, width)
    return torch.cat([parts[0], parts[1]], dim=2)


def _synthesise(spectrum: Tensor, matrix: Tensor, points: int) -> Tensor:
    frequencies, batch, width = spectrum.shape
    width //= 2
    half, first = points // 2 + 1, (points + 1) // 2
    parts = torch.stack(spectrum.chunk(2, dim=2)).view(2, frequencies, batch * width)
    even, odd = torch.bmm(matrix, parts).view(2, half, batch, width)
    field = spectrum.new_empty(points, batch, width)
    torch.add(even, odd, out=field[:half])
    field[half:] = (even[1:first] - odd[1:first]).flip(0)
    return field


class FGRURollout(torch.autograd.Function):
    """hidden, of z and r: matrices (frequency, 2·width, 4·width) and bias (points, 2·width), of the candidate: the
    same, half as wide, steps → the hidden fields after each step (steps, points, batch, width)."""

    @staticmethod
    def forward(
        ctx: Any, hidden: Tensor, gates: Tensor, gates_bias: Tensor, candidate: Tensor, bias: Tensor, steps: int
    ) -> Tensor:
        first, points = hidden, len(hidden)
        transforms = Transforms.of(hidden)
        fields = hidden.new_empty(steps, *hidden.shape)
        kept = []
        for step in range(steps):
            spectrum = _analyse(hidden, transforms.forward)
            both = _synthesise(torch.bmm(spectrum, gates), transforms.inverse, points)
            z, r = both.add_(gates_bias[:, None]).sigmoid_().chunk(2, dim=2)
            reset = _analyse(r * hidden, transforms.forward)
            c = _synthesise(torch.bmm(reset, candidate), transforms.inverse, points).add_(bias[:, None]).tanh_()
            kept.append((spectrum, both, reset, c))
            hidden = torch.lerp(hidden, c, z, out=fields[step])
        ctx.kept, ctx.transforms = kept, transforms
        ctx.save_for_backward(first, fields, gates, candidate)
        return fields

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, d_fields: Tensor) -> tuple[Tensor | None, ...]:
        first, fields, gates, candidate = ctx.saved_tensors
        transforms, steps, points = ctx.transforms, len(fields), fields.shape[1]
        d_gates, d_candidate = torch.zeros_like(gates), torch.zeros_like(candidate)
        d_hidden = torch.zeros_like(fields[0])
        d_gates_bias = d_hidden.new_zeros(points, 2 * fields.shape[-1])
        d_bias = d_hidden.new_zeros(points, fields.shape[-1])
        gates_back, candidate_back = gates.mT.contiguous(), candidate.mT.contiguous()
        for step in reversed(range(steps)):
            spectrum, both, reset, c = ctx.kept.pop()
            before = fields[step - 1] if step else first
            z, r = both.chunk(2, dim=2)
            d_hidden = d_hidden + d_fields[step]
            through = (d_hidden * z).mul_(1 - c.square())
            d_bias += through.sum(1)
            d_product = _analyse(through, transforms.inverse_transposed)
            d_candidate.baddbmm_(reset.mT, d_product)
            d_reset = _synthesise(torch.bmm(d_product, candidate_back), transforms.forward_transposed, points)
            d_both = torch.cat([d_hidden * (c - before), d_reset * before], dim=2).mul_(both).mul_(1 - both)
            d_gates_bias += d_both.sum(1)
            d_product = _analyse(d_both, transforms.inverse_transposed)
            d_gates.baddbmm_(spectrum.mT, d_product)
            d_hidden = d_hidden * (1 - z) + d_reset.mul_(r)
            d_hidden += _synthesise(torch.bmm(d_product, gates_back), transforms.forward_transposed, points)
        return d_hidden, d_gates, d_gates_bias, d_candidate, d_bias, None


class FRNNRollout(torch.autograd.Function):
    """hidden, matrices (depth, frequency, 2·width, 2·width), biases (depth, points, width), pointwise weights (depth,
    width out, width in) and biases (depth, width), steps → fields after each step (steps, points, batch, width)."""

    @staticmethod
    def forward(
        ctx: Any, hidden: Tensor, matrices: Tensor, biases: Tensor, pointwise: Tensor, offsets: Tensor, steps: int
    ) -> Tensor:
        points = len(hidden)
        transforms = Transforms.of(hidden)
        fields = hidden.new_empty(steps, *hidden.shape)
        constants = offsets[:, None, None]
        kept = []
        for step in range(steps):
            for layer, matrix in enumerate(matrices):
                spectrum = _analyse(hidden, transforms.forward)
                branch = _synthesise(torch.bmm(spectrum, matrix), transforms.inverse, points)
                branch.add_(biases[layer][:, None]).relu_()
                kept.append((hidden, spectrum, branch))
                hidden = (hidden @ pointwise[layer].T).add_(branch).add_(constants[layer])
            fields[step] = hidden
        ctx.kept, ctx.transforms, ctx.steps = kept, transforms, steps
        ctx.save_for_backward(matrices, pointwise)
        return fields

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, d_fields: Tensor) -> tuple[Tensor | None, ...]:
        matrices, pointwise = ctx.saved_tensors
        transforms, points, width = ctx.transforms, d_fields.shape[1], d_fields.shape[-1]
        d_matrices, d_pointwise = torch.zeros_like(matrices), torch.zeros_like(pointwise)
        d_biases = d_fields.new_zeros(len(matrices), points, width)
        d_offsets = d_fields.new_zeros(len(matrices), width)
        d_hidden = torch.zeros_like(d_fields[0])
        back = matrices.mT.contiguous()
        for step in reversed(range(ctx.steps)):
            d_hidden = d_hidden + d_fields[step]
            for layer in reversed(range(len(matrices))):
                hidden, spectrum, branch = ctx.kept.pop()
                d_branch = d_hidden * (branch > 0)
                d_biases[layer] += d_branch.sum(1)
                d_offsets[layer] += d_hidden.sum((0, 1))
                d_pointwise[layer].addmm_(d_hidden.view(-1, width).T, hidden.reshape(-1, width))
                d_product = _analyse(d_branch, transforms.inverse_transposed)
                d_matrices[layer].baddbmm_(spectrum.mT, d_product)
                d_field = _synthesise(torch.bmm(d_product, back[layer]), transforms.forward_transposed, points)
                d_hidden = d_field.add_(d_hidden @ pointwise[layer])
        return d_hidden, d_matrices, d_biases, d_pointwise, d_offsets, None
