"""FGRU and FRNN: the laws, plain recurrences, the kernel, and the way that learns."""

from typing import Any, ClassVar

import pytest
import torch
from torch import Tensor

from engine.models.fno import FGRU, FRNN, FieldState, FourierConvolution
from tests.engine.models.laws import ModelLaws
from tests.engine.tensors import convolved


class FourierLaws(ModelLaws):
    """Laws of both, which give `tensor_step`: a step by its definition, of tensors (batch, points, width)."""

    sizes: ClassVar = {"width": 6}
    variants = ({}, {"width": 3})  # by the kernel, and by the roll-out, which takes an odd width
    blocks = (1, 64, 65, 313, 57)
    reference = 1e-6
    reference_sizes: ClassVar = {"grid_points": 11, "width": 6}

    def stir(self, model: Any, generator: torch.Generator) -> None:
        """Weights under which the motion neither dies nor grows at once."""
        for module in model.modules():
            if isinstance(module, FourierConvolution):
                module.weight.normal_(0, 0.5 * module.weight.shape[1] ** -0.5, generator=generator)
                module.bias.normal_(0, 0.5, generator=generator)
            elif isinstance(module, torch.nn.Linear):
                module.weight.normal_(0, 0.5 * module.in_features**-0.5, generator=generator)

    @pytest.mark.parametrize(
        ("points", "kept_bytes"), [(1, 10**9), (2, 50_000), (3, 10**9), (10, 50_000), (101, 50_000)]
    )
    def test_what_learns_agrees_with_the_definition(self, points, kept_bytes, monkeypatch):
        """Frames, last state and every gradient; also where steps are computed again for want of memory."""
        monkeypatch.setattr("engine.models.fno.KEPT_BYTES", kept_bytes)
        model, found = self.stirred(grid_points=points).double(), []
        start, wanted = drawn(3, points).double(), drawn(21, points).double().view(3, 7, points)

        def by_definition(hidden: Tensor) -> tuple[Tensor, Tensor]:
            frames = []
            for _ in range(7):
                hidden = self.tensor_step(model, hidden)
                frames.append(model.out_mapping(hidden)[..., 0])
            return torch.stack(frames, dim=1), hidden

        def learning(hidden: Tensor) -> tuple[Tensor, Tensor]:
            frames, state = model.advance(FieldState(hidden), 7)
            return frames, state.hidden

        for advance in (by_definition, learning):
            model.zero_grad()
            frames, last = advance(model.encode(start).hidden)
            ((frames - wanted).square().mean() + last.square().mean()).backward()
            found.append([frames, last, *(parameter.grad for parameter in model.parameters())])
        for expected, fast in zip(*found, strict=True):
            torch.testing.assert_close(fast, expected, rtol=1e-9, atol=1e-12)

    def test_its_papers_start_is_uniform_and_positive(self):
        for module in self.made().modules():
            for name, tensor in module.state_dict().items() if isinstance(module, FourierConvolution) else ():
                largest = 1 / 36 if name == "weight" else 1 / 6
                assert 0 <= float(tensor.min()) < 0.1 * largest < 0.9 * largest < float(tensor.max()) <= largest


def drawn(batch: int, points: int) -> Tensor:
    return torch.randn(batch, points, generator=torch.Generator().manual_seed(1))


class TestFGRU(FourierLaws):
    name = "fgru"
    count = 640_033

    def tensor_step(self, model: FGRU, hidden: Tensor) -> Tensor:
        z, r = convolved(model.z_layer, hidden).sigmoid(), convolved(model.r_layer, hidden).sigmoid()
        return (1 - z) * hidden + z * convolved(model.h_layer, r * hidden).tanh()


class TestFRNN(FourierLaws):
    name = "frnn"
    count = 643_201

    def tensor_step(self, model: FRNN, hidden: Tensor) -> Tensor:
        for layer, pointwise in zip(model.fourier_layers, model.pointwise_layers, strict=True):
            hidden = convolved(layer, hidden).relu() + pointwise(hidden)
        return hidden
