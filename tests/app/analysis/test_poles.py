"""Learned eigenvalues as frequencies and decay times, against those that were put in."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from app.analysis.poles import pole_figure
from engine.models import build_model
from engine.models.base import Physics
from engine.presets import Preset, load_preset


def of_family(path: Path, model: str) -> Preset:
    """The small preset with another model that starts from the physics."""
    preset, made = load_preset(path), build_model(model, {})
    how = "physics" if "physics" in made.initialisations else made.own_initialisation()
    physics = Physics(preset.info.resonator, preset.info.rate_hz)
    made.initialise(how, physics, torch.Generator().manual_seed(0))
    weights = {name: tensor.numpy() for name, tensor in made.state_dict().items()}
    return Preset(preset.name, path, replace(preset.info, model=model, model_configuration={}), weights)


@pytest.mark.parametrize("model", ["dmd", "koopman", "koopman_var", "koopman_integrated", "lru", "s5"])
def test_a_model_that_starts_from_the_string_has_its_modes_each_with_its_own_frequency(
    small_preset: Path, model: str
) -> None:
    preset = of_family(small_preset, model)
    figure, own = pole_figure(preset), preset.info.resonator
    own_hz = own.eigenvalues().imag / (2 * math.pi)
    assert own_hz[-1] > 2000  # half the rate: it folds to where it is heard
    np.testing.assert_allclose(figure.string.mode_hz, own_hz)
    np.testing.assert_allclose(figure.string.folded_hz, np.minimum(own_hz, 4000 - own_hz))
    np.testing.assert_allclose(figure.string.t60_s, math.log(1000) / own.sigma)
    assert (figure.string.mode == np.arange(1, 11)).all()
    assert (np.abs(figure.string.cents) < 1e-6).all()
    for mode in range(1, 11):
        found = (figure.learned.layer == 0) & (figure.learned.mode == mode)
        best = np.abs(figure.learned.cents[found]).argmin()
        assert figure.learned.cents[found][best] == pytest.approx(0, abs=0.5)
        assert figure.learned.mode_hz[found][best] == pytest.approx(own_hz[mode - 1], rel=1e-3)


def test_of_a_conjugate_pair_one_is_shown_and_what_grows_has_no_decay_time(small_preset: Path) -> None:
    preset = of_family(small_preset, "dmd")
    assert len(pole_figure(preset).learned) == 10  # of 20 that are there and 50 that could be
    with torch.no_grad():
        preset.model.magnitude_log[0] = 0.01  # type: ignore[operator,union-attr,index]
    assert np.isinf(pole_figure(preset).learned.t60_s).sum() == 1


def test_a_sharp_eigenvalue_is_so_many_cents_high(small_preset: Path) -> None:
    preset = load_preset(small_preset)
    with torch.no_grad():
        preset.model.theta_log += math.log(2 ** (10 / 1200))  # type: ignore[operator,union-attr]
    learned = pole_figure(preset).learned
    np.testing.assert_allclose(learned.cents[learned.mode_hz < 1500], 10, atol=0.01)


@pytest.mark.parametrize("model", ["fgru", "frnn"])
def test_a_model_without_eigenvalues_says_so(small_preset: Path, model: str) -> None:
    figure = pole_figure(of_family(small_preset, model))
    assert (len(figure.learned), figure.layers, len(figure.string)) == (0, 0, 10)
    assert f"a {model} has no eigenvalues" in figure.note
