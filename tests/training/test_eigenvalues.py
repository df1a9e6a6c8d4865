"""Eigenvalues of models before training: those of the string that they start from."""

from typing import Any

import pytest
import torch

from engine.models import build_model
from engine.models.base import Physics
from engine.resonators.string import resonator_of
from engine.values.string import StringParameters

SIZES: list[tuple[str, int, dict[str, Any]]] = [
    ("dmd", 1, {"rank": 12}),
    ("koopman", 1, {"state_size": 6, "encoder_widths": [32], "decoder_widths": [32]}),
    ("koopman_integrated", 1, {"state_size": 5, "encoder_widths": [], "eigenvalue_widths": [4]}),
    ("lru", 2, {"state_size": 6, "layers": 1}),
    ("s5", 2, {"state_size": 12, "hippo_blocks": 2, "layers": 1}),
]


@pytest.mark.parametrize(("model", "layers", "sizes"), SIZES, ids=[name for name, *_ in SIZES])
def test_a_model_with_linear_dynamics_starts_with_the_strings_eigenvalues(model, layers, sizes):
    resonator = resonator_of(StringParameters(), 5)
    built = build_model(model, sizes)
    how = "physics" if "physics" in built.initialisations else built.own_initialisation()
    built.initialise(how, Physics(resonator, 4000, 1e-3), torch.Generator().manual_seed(0))
    found = built.log_eigenvalues()
    assert [log.dtype for log in found] == [torch.complex128] * layers
    nearest = (found[0].exp()[:, None] - torch.from_numpy(resonator.eigenvalues() / 4000).exp()).abs().amin(0)
    assert float(nearest.max()) < 1e-5
