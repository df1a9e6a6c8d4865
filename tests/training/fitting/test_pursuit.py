"""Starts of models: by matching pursuit, by the phases of the displacement, with the string's eigenvalues."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from engine.models import build_model
from engine.models.base import Physics, StringModel
from engine.models.configurations import IntegratedPhaseConfiguration, KoopmanConfiguration, KoopmanVarConfiguration
from engine.models.integrated_phase import IntegratedPhase
from engine.models.koopman import Koopman
from engine.models.koopman_var import KoopmanVar
from engine.resonators.sine_transform import synthesis_matrix
from engine.resonators.string import resonator_of
from engine.values.string import StringParameters
from tests.training.conftest import DATA, fit
from tests.training.fitting.test_fit import SMALL
from training.cell import Cell, configuration_of, load
from training.configuration import Recipe, TrainingConfiguration
from training.data.dataset import Dataset
from training.evaluate import evaluate_model
from training.fitting.modes import Modes, found_modes, known_modes
from training.fitting.phases import ModeMotion, fit_phases, upright
from training.fitting.pursuit import pursue
from training.fitting.start import begin
from training.start import COUNT, PHASES, SYMMETRIES

STEPS = 400
SINES = torch.from_numpy(synthesis_matrix(101, 5))


def koopman(state_size: int = 40) -> Koopman:
    sizes = KoopmanConfiguration(state_size=state_size, encoder_widths=(24,), decoder_widths=(24, 24))
    model = Koopman(sizes)
    model.initialise("paper", None, torch.Generator().manual_seed(0))
    return model


@pytest.mark.parametrize(("blind", "largest"), [(False, 1e-3), (True, 3e-3)])
@torch.no_grad()
def test_an_encoder_that_has_learned_its_targets_predicts_every_frame(small_dataset, blind, largest):
    model = koopman()
    latents = pursue(model, small_dataset, STEPS, torch.Generator().manual_seed(0), blind=blind)
    parts = latents.targets.double() @ latents.mixing.T
    origin = torch.complex(*parts.chunk(2, dim=1)).to(torch.complex64)
    found = model.decode(model.latents(origin, torch.arange(1, STEPS + 1)))
    amplitudes = small_dataset.split("train")[:, 1 : STEPS + 1] / small_dataset.scale_m
    truth = amplitudes @ SINES.float()
    assert float((found - truth).square().sum() / truth.square().sum()) < largest
    if not blind:
        energies = latents.targets.square().sum(1) * latents.unit**2
        assert torch.allclose(energies, amplitudes.square().mean(1).sum(1), rtol=1e-3)


def test_a_mirrored_string_has_mirrored_coordinates(small_dataset):
    """A model that does not care for its input is as wrong about a string as about its mirror image."""
    latents = pursue(koopman(), small_dataset, STEPS, torch.Generator().manual_seed(0))
    amplitudes = small_dataset.split("train")[:, 0] / small_dataset.scale_m
    signs = torch.tensor([1.0, -1, 1, -1, 1])
    mirrored = (amplitudes * signs) @ SINES.float()
    assert torch.allclose(latents.initial.flip(1), mirrored, atol=1e-5)
    assert set(latents.mirror.tolist()) == {1.0, -1.0}


@pytest.mark.parametrize("blind", [False, True])
@torch.no_grad()
def test_modes_are_known_or_found_in_the_displacement_alone(small_dataset, blind):
    modes = (found_modes if blind else known_modes)(small_dataset, STEPS)
    alike = modes.shapes @ SINES.T / 50
    torch.testing.assert_close(alike.abs(), torch.eye(5, dtype=torch.float64), rtol=0, atol=2e-3)
    truth = small_dataset.split("train")[:, : STEPS + 1].double() / small_dataset.scale_m @ SINES
    torch.testing.assert_close(modes.motions @ modes.shapes, truth, rtol=0, atol=1e-5)
    assert modes.mirror == (1, -1, 1, -1, 1)
    linear = resonator_of(small_dataset.configuration.string, 5).eigenvalues() / small_dataset.configuration.rate_hz
    for grid, eigenvalue in zip(modes.grids, linear, strict=True):
        assert grid.imag.min() <= eigenvalue.imag < grid.imag.max()
        assert -float(grid.real.max()) == pytest.approx(-float(eigenvalue.real), rel=0.5, abs=3e-5)


@torch.no_grad()
def test_a_mode_that_seems_to_grow_decays_all_the_same(small_dataset):
    """Koopman keeps the logarithm of the decay."""
    swelling = torch.linspace(0.5, 1.5, small_dataset.amplitudes.shape[1])[:, None]
    grown = replace(small_dataset, amplitudes=small_dataset.amplitudes * swelling)
    assert all(float(grid.real.max()) < 0 for grid in found_modes(grown, STEPS).grids)


def test_a_polish_holds_weights_down_by_the_recipes_decay_and_reports_the_error_alone(small_dataset):
    def polished(weight_decay: float) -> tuple[float, float]:
        model = koopman()
        latents = pursue(model, small_dataset, STEPS, torch.Generator().manual_seed(0))
        reported = latents.polish(model, Recipe(epochs=1, weight_decay=weight_decay))
        size = sum(float(weight.detach().square().sum()) for weight in model.encoder.parameters() if weight.ndim > 1)
        return size, float(reported)

    free, held = polished(0.0), polished(1e-2)
    assert held[0] < 0.7 * free[0]
    assert held[1] == free[1], "of the same weights, before"


EVERY_STEP = 450


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
def test_a_run_starts_with_a_latent_for_each_mode_and_predicts_other_strings(small_dataset, sizes):
    c = small_dataset.configuration
    recipe = Recipe(epochs=1, start=PHASES)
    configuration = TrainingConfiguration("A test", "koopman_integrated", c, recipe, model_configuration=sizes)
    model, latents = begin(configuration, small_dataset)
    assert (model.configuration.state_size, latents) == (sizes.get("state_size", 5), None)
    assert evaluate_model(model, small_dataset, "validation", EVERY_STEP).total().rel_mse < 1e-3
    linear = resonator_of(c.string, 5).eigenvalues() / c.rate_hz
    torch.testing.assert_close(model.theta_log[:5].exp(), torch.from_numpy(linear.imag), rtol=2e-3, atol=0)


def test_what_cannot_start_so_is_refused(small_dataset):
    strided = replace(small_dataset, configuration=replace(small_dataset.configuration, stride=2))
    few, generator = IntegratedPhase(IntegratedPhaseConfiguration(state_size=4)), torch.Generator()
    phases = fit_phases(found_modes(small_dataset, STEPS), seed=0)
    for start, words in (
        (lambda: pursue(KoopmanVar(KoopmanVarConfiguration()), small_dataset, STEPS, generator), "model 'koopman'"),
        (lambda: pursue(koopman(), strided, STEPS, generator), "stride must be 1, not 2"),
        (lambda: found_modes(strided, STEPS), "stride must be 1, not 2"),
        (lambda: few.store_modes(phases), "state_size must be at least 5, the modes that the data show, not 4"),
        (lambda: begin(load("nylon_nonlinear_gaussian_4k_fgru_400"), small_dataset), "fourier_wiring RUN$"),
        (lambda: begin(load("nylon_nonlinear_gaussian_4k_frnn_400"), small_dataset), "fourier_wiring RUN$"),
    ):
        with pytest.raises(ValueError, match=words):
            start()


@pytest.mark.parametrize("model", ["koopman", "koopman_integrated"])
@pytest.mark.parametrize("rate", ["4k", "16k"])
def test_the_blind_recipe_is_given_nothing_of_the_string_and_hints_are_reported(model, rate):
    blind, hinted = (load(f"nylon_nonlinear_noise_{rate}_{model}_{recipe}") for recipe in ("blind", "hinted"))
    assert blind.knowledge == "" and not blind.recipe.flip
    assert "state_size" not in blind.model_configuration
    assert hinted.knowledge == (SYMMETRIES if model == "koopman" else f"{SYMMETRIES}, and {COUNT}")


def blind_models(cell_model: str, runs: Path, *datasets: Dataset) -> list[StringModel]:
    """Of the committed recipe, cut short."""
    recipe = {"epochs": 4, "batch_size": 8, "validate_every": 2}
    if cell_model == "koopman":
        recipe |= {"latent_epochs": 3, "latent_polish": 1}
    made = configuration_of(Cell(cell_model, True, "gaussian", 4000, EVERY_STEP, "blind"), DATA, recipe)
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
    error, again = (evaluate_model(each, small_dataset, "validation", EVERY_STEP).total() for each in (own, other))
    assert again.rel_mae == pytest.approx(error.rel_mae, rel=0.05)  # sums of seven products are rounded otherwise


LAYERS = {"dmd": 1, "koopman": 1, "koopman_integrated": 1, "lru": 2, "s5": 2}


@pytest.mark.parametrize("model", LAYERS)
def test_a_model_with_linear_dynamics_starts_with_the_strings_eigenvalues(model):
    resonator, layers = resonator_of(StringParameters(), 5), LAYERS[model]
    built = build_model(model, SMALL.get(model, {"rank": 12}))
    how = "physics" if "physics" in built.initialisations else built.own_initialisation()
    built.initialise(how, Physics(resonator, 4000, 1e-3), torch.Generator().manual_seed(0))
    found = built.log_eigenvalues()
    assert [log.dtype for log in found] == [torch.complex128] * layers
    nearest = (found[0].exp()[:, None] - torch.from_numpy(resonator.eigenvalues() / 4000).exp()).abs().amin(0)
    assert float(nearest.max()) < 1e-5
