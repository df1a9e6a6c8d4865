"""What concerns every learned string: its laws are tested; the dense product."""

import importlib
from pathlib import Path

import pytest
import torch
from torch.nn import functional

from engine.models import MODELS
from engine.models._dense import linear
from tests.engine.models.laws import subclasses


def test_every_model_has_its_laws_tested():
    for path in Path(__file__).parent.glob("test_*.py"):
        importlib.import_module(f"tests.engine.models.{path.stem}")
    assert {kind.name for kind in subclasses() if hasattr(kind, "name")} == MODELS.keys()


@pytest.mark.parametrize("shape", [(32, 100), (3200,), (2053,), (4, 8)], ids=["images", "parts", "a prime", "few"])
@pytest.mark.parametrize("has_bias", [True, False])
@pytest.mark.parametrize("parted", [True, False])
def test_a_product_in_parts_is_torchs_with_its_gradients(shape, has_bias, parted, monkeypatch):
    monkeypatch.setattr("engine.models._dense.PARTED_ON", ("cpu",) if parted else ())
    generator = torch.Generator().manual_seed(0)
    sizes = (*shape, 101), (64, 101), *([(64,)] if has_bias else [])
    leaves = [torch.randn(*size, generator=generator, requires_grad=True) for size in sizes]
    slope, found = torch.randn(*shape, 64, generator=generator), []
    rest = [] if has_bias else [None]
    for multiplied in (linear, functional.linear):
        result = multiplied(*leaves, *rest)
        found.append([result, *torch.autograd.grad(result, leaves, slope)])
    for ours, theirs in zip(*found, strict=True):
        assert torch.allclose(ours, theirs, rtol=1e-4, atol=1e-5 * float(theirs.detach().abs().max()))
    with torch.no_grad():  # what a preset sounds like does not follow from how it is trained
        assert torch.equal(linear(*leaves, *rest), functional.linear(*leaves, *rest))
