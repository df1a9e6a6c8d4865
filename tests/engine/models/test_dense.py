"""The product of dense layers, in parts for a processor: PyTorch's, with its gradients."""

from __future__ import annotations

import pytest
import torch
from torch.nn import functional

from engine.models._dense import FEWEST_ROWS, WIDTHS, linear


@pytest.mark.parametrize("shape", [(32, 100), (3200,), (2053,), (4, 8)], ids=["images", "parts", "a prime", "few"])
@pytest.mark.parametrize("has_bias", [True, False])
@pytest.mark.parametrize("on_gpu", [False, True])
def test_it_is_torchs_layer_with_its_gradients(
    shape: tuple[int, ...], has_bias: bool, on_gpu: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("engine.models._dense.PARTED_ON", ("cpu",) if on_gpu else ())
    generator = torch.Generator().manual_seed(0)
    inputs = torch.randn(*shape, 101, generator=generator, requires_grad=True)
    weight = torch.randn(64, 101, generator=generator, requires_grad=True)
    bias = torch.randn(64, generator=generator, requires_grad=True) if has_bias else None
    leaves = [tensor for tensor in (inputs, weight, bias) if tensor is not None]
    slope = torch.randn(*shape, 64, generator=generator)
    found, expected = linear(inputs, weight, bias), functional.linear(inputs, weight, bias)
    assert torch.allclose(found, expected, atol=1e-4)
    gradients = torch.autograd.grad(found, leaves, slope), torch.autograd.grad(expected, leaves, slope)
    for ours, theirs in zip(*gradients, strict=True):
        assert torch.allclose(ours, theirs, rtol=1e-4, atol=1e-5 * float(theirs.abs().max()))


def test_rendering_takes_the_product_itself() -> None:
    """What a preset sounds like does not follow from how it is trained."""
    inputs, weight = torch.randn(FEWEST_ROWS, 101), torch.randn(64, 101)
    assert FEWEST_ROWS % WIDTHS[0] == 0
    with torch.no_grad():
        assert torch.equal(linear(inputs, weight), functional.linear(inputs, weight))
