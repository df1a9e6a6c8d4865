"""The same run twice gives the same weights, bit for bit: a run of each kind of start and loss.

Those that `fitting.test_fit` cuts and continues repeat themselves there."""

import hashlib

import pytest
import torch

from engine.presets import load_preset
from tests.training.conftest import fit
from training.cell import Cell, configuration_of
from training.family.preset import FamilyConfiguration, train_preset

DATA = {"count": 20, "steps": 450, "modes": 5}
KINDS = {
    "dmd_400": {},
    "koopman_400_blind": {"latent_epochs": 1, "latent_polish": 1},
    "koopman_400_paper": {},
    "koopman_integrated_400": {},
    "koopman_integrated_400_blind": {},
    "frnn_100": {"epochs": 1, "start": "paper"},
    "fgru_20_paper": {"epochs": 1},
}


def digest(model: torch.nn.Module) -> str:
    found = hashlib.sha256()
    for name, weight in sorted(model.state_dict().items()):
        found.update(name.encode() + weight.contiguous().numpy().tobytes())
    return found.hexdigest()


@pytest.mark.parametrize("kind", KINDS)
def test_a_run_repeats_bit_for_bit(kind, small_dataset, tmp_path, monkeypatch):
    monkeypatch.setattr("training.fitting.pursuit.POLISH_ITERATIONS", 5)
    cell = Cell.parse(f"nylon_nonlinear_gaussian_4k_{kind}")
    assert cell is not None
    made = configuration_of(cell, DATA, {"epochs": 2, **KINDS[kind]})
    first, second = (digest(fit(made, small_dataset, tmp_path / folder).model) for folder in ("first", "second"))
    assert first == second


def test_a_model_of_many_strings_repeats_bit_for_bit(tmp_path):
    made = FamilyConfiguration(
        "Two", "", 25, strings=2, validation_strings=1, test_strings=1, seconds=0.02, steps=1, first_s=0.01
    )
    paths = [tmp_path / f"{name}.safetensors" for name in ("first", "second")]
    for path in paths:
        train_preset(made, path)
    assert len({digest(load_preset(path).model) for path in paths}) == 1
