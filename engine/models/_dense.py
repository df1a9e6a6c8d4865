"""Dense layers over many frames in training, as other calls than `torch.nn.functional.linear` for the same product.

On a CPU they are convolutions of width one, taken by oneDNN instead of the BLAS. On processors of another make than
the BLAS's these are two to three times as fast. By hand, on one thread of an AMD EPYC: 58 GFLOP/s as a product, 185
as a convolution (20,000 × 128 by 128 × 128). A training step takes a third less time there. On an Intel Xeon both
have 97 GFLOP/s.

On a GPU the rows go in parts, each with a copy of the weight. The weight's gradient is a sum over all rows for few
weights, which would leave most of the GPU idle.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

FEWEST_ROWS = 2048  # below, the calls cost as much
PARTED_ON = ("cuda",)  # kinds of device
PARTS = range(32, 1, -1)  # numbers of parts of the rows on a GPU, the best first
WIDTHS = range(128, 31, -1)  # numbers of rows of an image, the best first: all in one image is slower than a product


def linear(inputs: Tensor, weight: Tensor, bias: Tensor | None = None) -> Tensor:
    """The product of `torch.nn.functional.linear`: inputs (..., in) by weight (out, in) to (..., out).

    Few rows, other types and calls without gradients take that function itself.
    """
    rows = inputs.numel() // weight.shape[1]
    plain = inputs.device.type in ("cpu", "cuda") and inputs.dtype == torch.float32
    if not plain or rows < FEWEST_ROWS or not torch.is_grad_enabled():
        return functional.linear(inputs, weight, bias)
    if inputs.device.type in PARTED_ON:
        split = inputs.reshape(_largest_divisor(rows, PARTS), -1, weight.shape[1])
        outputs = torch.bmm(split, weight.T.expand(len(split), -1, -1))
        outputs = outputs if bias is None else outputs + bias
        return outputs.view(*inputs.shape[:-1], len(weight))
    width = _largest_divisor(rows, WIDTHS)
    if width == 1:
        return functional.linear(inputs, weight, bias)
    images = inputs.reshape(rows // width, 1, width, -1).permute(0, 3, 1, 2)  # channels last: no copy
    outputs = functional.conv2d(images, weight[:, :, None, None], bias)
    return outputs.permute(0, 2, 3, 1).reshape(*inputs.shape[:-1], len(weight))


class Dense(nn.Linear):
    """`torch.nn.Linear` by `linear`."""

    def forward(self, inputs: Tensor) -> Tensor:
        return linear(inputs, self.weight, self.bias)


def _largest_divisor(rows: int, choices: range) -> int:
    """The first of `choices` that divides the rows; 1: none does."""
    return next((choice for choice in choices if rows % choice == 0), 1)
