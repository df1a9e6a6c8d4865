"""What concerns every learned string: its laws are tested, its resonator need be no string; the dense product."""

import importlib
import math
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch.nn import functional

from engine.models import MODELS, build_model
from engine.models._dense import linear
from engine.models.base import Physics
from engine.resonators import Resonator
from engine.truth import ModalState, SplittingSolver
from tests.engine.models.laws import subclasses
from tests.engine.sounds import relative


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


def membrane(stiffening: float) -> Resonator:
    """Waves of 60 m/s on a rectangle that is held at its edges, whose tension is the same everywhere (Berger)."""
    sides_m, points = np.array([0.30, 0.22]), (9, 7)
    modes = sorted(product(range(1, 4), repeat=2), key=lambda mode: math.hypot(*(mode / sides_m)))
    stretch = np.square(math.pi * np.array(modes) / sides_m).sum(1)
    x, y = (np.linspace(0, 1, count) for count in points)
    shapes = np.stack([np.outer(np.sin(math.pi * m * x), np.sin(math.pi * n * y)).ravel() for m, n in modes])
    return Resonator(
        omega=60.0 * np.sqrt(stretch),
        sigma=np.full_like(stretch, 8.0),
        coupling=stiffening * stretch,
        stretch=stretch,
        tension_rise=stiffening / 60.0**2,
        shapes=shapes,
        analysis=shapes.T * (4 / ((points[0] - 1) * (points[1] - 1))),
    )


@torch.no_grad()
def error(name: str, sizes: dict[str, Any], how: str, steps: int, stiffening: float = 0.0) -> float:
    """Of a model of a membrane as it starts, which is pulled a millimetre off its middle, against the truth."""
    drum = membrane(stiffening)
    x, y = (np.linspace(0, 1, count) for count in (9, 7))
    q = 1e-3 * drum.to_modes(np.exp(-40 * ((x - 0.4)[:, None] ** 2 + (y - 0.3) ** 2)).ravel())[None]
    model = build_model(name, {"grid_points": drum.points, **sizes}).double().eval()
    model.initialise(how, Physics(drum, 8_000, 1e-3), torch.Generator().manual_seed(0))
    found = model(torch.from_numpy(drum.to_grid(q)) / 1e-3, steps).numpy() * 1e-3
    return relative(found, drum.to_grid(SplittingSolver(drum, 8_000).solve(ModalState.at_rest(q), steps)[:, 1:]))


def test_models_start_as_a_linear_membrane_and_averaging_follows_its_stiffening():
    for name, sizes in (("dmd", {"rank": 18}), ("lru", {"state_size": 16, "layers": 1})):
        assert error(name, sizes, "physics", 800) < 0.05  # a release from rest, to about σ/ω
    assert error("koopman_integrated", {"state_size": 9}, "averaging", 800) < 0.05
    averaging, physics = (
        error("koopman_integrated", {"state_size": 9}, how, 1600, 1e7) for how in ("averaging", "physics")
    )
    assert averaging < 0.1 * physics
