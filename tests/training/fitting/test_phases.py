"""An integrated phase's start from the displacement alone."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from engine.models.base import StringModel
from engine.models.configurations import IntegratedPhaseConfiguration
from engine.models.integrated_phase import IntegratedPhase
from engine.resonators.string import resonator_of
from tests.training.conftest import DATA, fit
from training.cell import Cell, configuration_of
from training.configuration import Recipe, TrainingConfiguration
from training.data.dataset import Dataset
from training.evaluate import evaluate_model
from training.fitting.modes import Modes, found_modes
from training.fitting.phases import ModeMotion, fit_phases, upright
from training.fitting.start import begin
from training.start import COUNT, PHASES, SYMMETRIES

STEPS = 450


@torch.no_grad()
def motions_of(omega: torch.Tensor, sigma: torch.Tensor, coupling: torch.Tensor, steps: int) -> Modes:
    """Of 40 strings that are what the fit takes them for."""
    generator = torch.Generator().manual_seed(1)
    starts = torch.rand(40, len(omega), generator=generator, dtype=torch.float64) * 2 - 1
    times = torch.arange(steps + 1)[:, None]
    integrals = starts.square()[:, None] * (1 - torch.exp(-2 * sigma * times)) / (2 * sigma)
    phases = omega * times + integrals @ coupling.T
    motions = starts[:, None] * torch.exp(-sigma * times) * torch.cos(phases)
    return Modes(torch.eye(len(omega), dtype=torch.float64), motions, (), ())


def test_what_follows_its_equation_is_found_exactly():
    omega, sigma = torch.tensor([0.4, 1.3, 2.9]).double(), torch.tensor([1e-4, 2e-3, 5e-3]).double()
    coupling = torch.tensor([[0.003, 0.01, 0.02], [0.01, 0.04, 0.05], [-0.02, -0.06, -0.1]]).double()
    found = fit_phases(motions_of(omega, sigma, coupling, 2000), seed=0)
    torch.testing.assert_close(found.log_eigenvalues, torch.complex(-sigma, omega), rtol=1e-6, atol=1e-9)
    torch.testing.assert_close(found.coupling, coupling, rtol=1e-4, atol=1e-7)
    torch.testing.assert_close(found.starts, torch.ones(3, dtype=torch.complex128), rtol=0, atol=1e-6)


def test_a_negative_frequency_is_the_same_motion_as_a_positive_one():
    times, starts = np.arange(1.0, 50.0), np.linspace(0.1, 1, 49)
    integrals = np.outer(times, [1.0, 0.5])

    def motion(guess: np.ndarray) -> np.ndarray:
        omega, sigma, real, imag = guess[:4]
        phase = omega * times + integrals @ guess[4:]
        return np.asarray((starts * complex(real, imag) * np.exp(-sigma * times + 1j * phase)).real)

    found = np.array([-0.01, 0.002, 0.9, 0.2, 0.03, -0.05])
    other = upright(found)
    assert other[0] == 0.01
    np.testing.assert_allclose(motion(other), motion(found), rtol=1e-12)
    np.testing.assert_array_equal(upright(other), other)
    fitted = ModeMotion(starts, motion(found), times, integrals).fitted(1.01 * found)
    np.testing.assert_allclose(motion(fitted), motion(found), atol=1e-6)


@pytest.mark.parametrize("sizes", [{}, {"state_size": 7}])
def test_a_run_starts_with_a_latent_for_each_mode_and_predicts_strings_that_the_fit_has_not_seen(
    small_dataset, sizes
):
    c = small_dataset.configuration
    configuration = TrainingConfiguration(
        "A test", "koopman_integrated", c, Recipe(epochs=1, start=PHASES), model_configuration=sizes
    )
    assert configuration.start == PHASES
    model, latents = begin(configuration, small_dataset)
    assert (model.configuration.state_size, latents) == (sizes.get("state_size", 5), None)
    assert evaluate_model(model, small_dataset, "validation", STEPS).total().rel_mse < 1e-3
    linear = resonator_of(c.string, 5).eigenvalues() / c.rate_hz
    torch.testing.assert_close(model.theta_log[:5].exp(), torch.from_numpy(linear.imag), rtol=2e-3, atol=0)


def test_what_cannot_start_so_is_refused(small_dataset):
    few = IntegratedPhase(IntegratedPhaseConfiguration(state_size=4))
    with pytest.raises(ValueError, match="state_size must be at least 5, the modes that the data show, not 4"):
        few.store_modes(fit_phases(found_modes(small_dataset, STEPS), seed=0))
    strided = replace(small_dataset, configuration=replace(small_dataset.configuration, stride=2))
    with pytest.raises(ValueError, match="stride must be 1, not 2"):
        found_modes(strided, STEPS)
    for model in ("fgru", "frnn"):
        with pytest.raises(ValueError, match=r"-m training\.research\.fourier_wiring RUN$"):
            begin(configuration_of(Cell(model, True, "gaussian", 4000, 400)), small_dataset)


@pytest.mark.parametrize("model", ["koopman", "koopman_integrated"])
@pytest.mark.parametrize("rate_hz", [4000, 16000])
def test_the_blind_recipe_is_given_nothing_of_the_string_and_hints_are_reported(model, rate_hz):
    blind, hinted = (
        configuration_of(Cell(model, True, "gaussian", rate_hz, recipe=name)) for name in ("blind", "hinted")
    )
    assert blind.knowledge == "" and not blind.recipe.flip
    assert "state_size" not in blind.model_configuration
    assert hinted.knowledge == (SYMMETRIES if model == "koopman" else f"{SYMMETRIES}, and {COUNT}")


def blind_models(cell_model: str, runs: Path, *datasets: Dataset) -> list[StringModel]:
    """Of the committed recipe, cut short."""
    recipe = {"epochs": 4, "batch_size": 8, "validate_every": 2}
    if cell_model == "koopman":
        recipe |= {"latent_epochs": 3, "latent_polish": 1}
    made = configuration_of(Cell(cell_model, True, "gaussian", 4000, STEPS, "blind"), DATA, recipe)
    of_each = [replace(made, data=each.configuration) for each in datasets]
    return [fit(one, each, runs / str(n)).model for n, (one, each) in enumerate(zip(of_each, datasets, strict=True))]


@pytest.mark.parametrize("model", ["koopman", "koopman_integrated"])
def test_of_another_claimed_string_the_weights_are_the_same(small_dataset, runs, model, monkeypatch):
    monkeypatch.setattr("training.fitting.pursuit.POLISH_ITERATIONS", 5)
    c = small_dataset.configuration
    string = replace(c.string, length_m=1.3, tension_n=20.0, density_kg_m3=7850.0, damping_d3_kg_m_s=0.0)
    claimed = replace(c, string=string, tension_modulated=False, initial="noise")
    own, other = blind_models(model, runs, small_dataset, replace(small_dataset, configuration=claimed))
    for name, weights in own.state_dict().items():
        assert torch.equal(weights, other.state_dict()[name]), name


def test_the_number_of_modes_is_found_and_no_claim_of_more_changes_it(small_dataset, runs):
    amplitudes = torch.nn.functional.pad(small_dataset.amplitudes, (0, 2))  # two more that never move
    c = replace(small_dataset.configuration, modes=7)
    claimed = replace(small_dataset, configuration=c, amplitudes=amplitudes)
    own, other = blind_models("koopman_integrated", runs, small_dataset, claimed)
    assert own.configuration.state_size == other.configuration.state_size == 5
    error, again = (evaluate_model(each, small_dataset, "validation", STEPS).total() for each in (own, other))
    assert again.rel_mae == pytest.approx(error.rel_mae, rel=0.05)  # sums of seven products are rounded otherwise
