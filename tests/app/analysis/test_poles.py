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
from engine.resonators.string import decay_rates, resonator_of


def of_family(path: Path, model: str) -> Preset:
    """The small preset with another model that starts from the physics."""
    preset = load_preset(path)
    made = build_model(model, {})
    how = "physics" if "physics" in made.initialisations else made.own_initialisation()
    info = preset.info
    made.initialise(
        how, Physics(resonator_of(info.string, info.modes), info.rate_hz), torch.Generator().manual_seed(0)
    )
    weights = {name: tensor.numpy() for name, tensor in made.state_dict().items()}
    return Preset(preset.name, path, replace(info, model=model, model_configuration={}), weights)


@pytest.mark.parametrize("model", ["dmd", "koopman", "koopman_var", "koopman_integrated", "lru", "s5"])
def test_a_model_that_starts_from_the_string_has_its_modes(small_preset: Path, model: str) -> None:
    figure = pole_figure(of_family(small_preset, model))
    first = figure.learned.layer == 0
    own_hz = figure.string.mode_hz
    for mode in range(1, 11):
        found = first & (figure.learned.mode == mode)
        best = np.abs(figure.learned.cents[found]).argmin()
        assert figure.learned.cents[found][best] == pytest.approx(0, abs=0.5)
        assert figure.learned.mode_hz[found][best] == pytest.approx(own_hz[mode - 1], rel=1e-3)
    assert (np.abs(figure.string.cents) < 1e-6).all()
    assert (figure.string.mode == np.arange(1, 11)).all()


def test_modes_above_half_the_rate_keep_their_own_frequency_and_fold_where_they_are_heard(small_preset: Path) -> None:
    preset = load_preset(small_preset)
    figure = pole_figure(preset)
    own_hz = resonator_of(preset.info.string, 10).eigenvalues().imag / (2 * math.pi)
    assert own_hz[-1] > 2000  # or the test tests nothing
    np.testing.assert_allclose(figure.string.mode_hz, own_hz)
    np.testing.assert_allclose(figure.string.folded_hz, np.minimum(own_hz, 4000 - own_hz))
    sigma = decay_rates(preset.info.string, 10)
    np.testing.assert_allclose(figure.string.t60_s, math.log(1000) / sigma)


def test_of_a_conjugate_pair_one_is_shown_and_what_grows_has_no_decay_time(small_preset: Path) -> None:
    preset = of_family(small_preset, "dmd")
    figure = pole_figure(preset)
    assert len(figure.learned) == 10  # of 20 that are there and 50 that could be
    with torch.no_grad():
        preset.model.magnitude_log[0] = 0.01  # type: ignore[operator,union-attr,index]
    grown = pole_figure(preset).learned
    assert np.isinf(grown.t60_s).sum() == 1


def test_a_sharp_eigenvalue_is_so_many_cents_high(small_preset: Path) -> None:
    preset = load_preset(small_preset)
    with torch.no_grad():
        preset.model.theta_log += math.log(2 ** (10 / 1200))  # type: ignore[operator,union-attr]
    learned = pole_figure(preset).learned
    low = learned.mode_hz < 1500
    np.testing.assert_allclose(learned.cents[low], 10, atol=0.01)


@pytest.mark.parametrize("model", ["fgru", "frnn"])
def test_a_model_without_eigenvalues_says_so(small_preset: Path, model: str) -> None:
    figure = pole_figure(of_family(small_preset, model))
    assert len(figure.learned) == figure.layers == 0
    assert len(figure.string) == 10
    assert f"a {model} has no eigenvalues" in figure.note
