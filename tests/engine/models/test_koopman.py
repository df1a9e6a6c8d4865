"""Koopman and Koopman_var: the laws, plain recurrences, and their starts."""

from typing import ClassVar

import pytest
import torch

from engine.models.koopman import SHARPEST
from tests.engine.models.laws import MODES, PHYSICS, ModelLaws, relative, released


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
    def test_its_mixing_layer_is_linear_behind_the_encoder(self):
        mixed, plain = (self.made(mixing_layer=mixing).double() for mixing in (True, False))
        weights = mixed.state_dict()
        weight, bias = (weights.pop(f"encoder.3.{name}") for name in ("weight", "bias"))
        weights["encoder.2.weight"] = weight @ weights["encoder.2.weight"]
        weights["encoder.2.bias"] = weight @ weights["encoder.2.bias"] + bias
        plain.load_state_dict(weights)
        assert relative(mixed(released().double(), 200), plain(released().double(), 200)) < 1e-12

    def test_the_starts_lie_where_they_should(self):
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
