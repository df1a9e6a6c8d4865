"""Koopman and Koopman_var: the laws, plain recurrences, and their starts."""

from __future__ import annotations

from typing import ClassVar

import pytest
import torch
from torch import Tensor

from engine.models.koopman import SHARPEST
from tests.engine.models.laws import MODES, PHYSICS, ModelLaws, released


class TestKoopman(ModelLaws):
    name = "koopman"
    count = 191_077
    sizes: ClassVar = {"state_size": 16, "encoder_widths": (24,), "decoder_widths": (24,)}
    variants = ({}, {"decoder_widths": ()}, {"decoder_widths": (16, 16)})
    linear: ClassVar = {"physics": 0.02}
    too_small: ClassVar = ({"state_size": 5}, "at least the 10 modes, not 5")
    reference = 1e-12
    reference_sizes: ClassVar = {
        "grid_points": 11,
        "state_size": 8,
        "encoder_widths": (7, 7),
        "decoder_widths": (7, 7),
        "mixing_layer": False,
    }

    @torch.no_grad()
    def test_it_is_its_equations(self) -> None:
        """Every weight by its name, real and imaginary parts by hand."""
        model = self.made(decoder_widths=(16, 16)).double()
        weights = model.state_dict()

        def dense(name: str, x: Tensor) -> Tensor:
            return x @ weights[f"{name}.weight"].T + weights[f"{name}.bias"]

        def selu(x: Tensor) -> Tensor:
            return 1.0507009873554805 * torch.where(x > 0, x, 1.6732632423543772 * (x.exp() - 1))

        x, y = dense("encoder.3", dense("encoder.2", selu(dense("encoder.0", released().double())))).chunk(2, dim=1)
        decay, angle = torch.exp(-weights["nu_log"].exp()), weights["theta_log"].exp()
        a, b = decay * angle.cos(), decay * angle.sin()
        for frame in model(released().double(), 200).unbind(1):
            x, y = a * x - b * y, b * x + a * y
            hidden = selu(dense("decoder.2", selu(dense("decoder.0", torch.cat([x, y], 1)))))
            torch.testing.assert_close(frame, dense("decoder.4", hidden), rtol=0, atol=1e-11)

    def test_the_starts_lie_where_they_should(self) -> None:
        radius = torch.exp(-self.made().nu_log.detach().exp())
        assert 0.99 - 1e-6 <= float(radius.min()) <= float(radius.max()) <= 1
        physical, linear = self.made("physics", state_size=32), PHYSICS.log_eigenvalues
        torch.testing.assert_close(physical.nu_log.detach()[:MODES].exp().double(), -linear.real, rtol=1e-5, atol=0)
        raised = physical.theta_log.detach().exp().double() / linear.imag.repeat(4)[:32]
        torch.testing.assert_close(raised, 1 + SHARPEST * (torch.arange(32) // 10).double() / 3, rtol=1e-5, atol=0)
        with pytest.raises(ValueError, match="the narrowest has 9 units"):
            self.made("physics", encoder_widths=(24, 9))


class TestKoopmanVar(ModelLaws):
    name = "koopman_var"
    count = 134_885
    sizes: ClassVar = {"state_size": 16, "multiplier_widths": (16, 16)}
    linear: ClassVar = {"physics": 0.1}
    too_small: ClassVar = ({"state_size": 5}, "at least the 10 modes, not 5")
    reference = 1e-12
    reference_sizes: ClassVar = {"grid_points": 11, "state_size": 8, "multiplier_widths": (7, 7, 7)}
