"""Koopman's start by matching pursuit."""

from dataclasses import replace

import pytest
import torch

from engine.models.configurations import KoopmanConfiguration, KoopmanVarConfiguration
from engine.models.koopman import Koopman
from engine.models.koopman_var import KoopmanVar
from engine.resonators.sine_transform import synthesis_matrix
from engine.resonators.string import resonator_of
from training.configuration import Recipe
from training.fitting.modes import found_modes, known_modes
from training.fitting.pursuit import pursue

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


@torch.no_grad()
def test_its_loss_is_the_error_of_the_prediction(small_dataset):
    """In coordinates as on the string: any encoder will do."""
    model = koopman()
    latents = pursue(model, small_dataset, STEPS, torch.Generator().manual_seed(0))
    rows = torch.arange(16)
    _, error = latents.loss(model, Recipe(epochs=1, flip=False), rows, 0)
    latents.yield_latents(model)
    truth = (small_dataset.split("train")[:, : STEPS + 1] / small_dataset.scale_m) @ SINES.float()
    found = model(truth[:, 0], STEPS)
    assert float((found - truth[:, 1:]).square().mean()) == pytest.approx(float(error), rel=0.03)


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


def test_other_models_and_strided_data_are_refused(small_dataset):
    with pytest.raises(ValueError, match="needs the model 'koopman'"):
        pursue(KoopmanVar(KoopmanVarConfiguration()), small_dataset, STEPS, torch.Generator())
    strided = replace(small_dataset, configuration=replace(small_dataset.configuration, stride=2))
    with pytest.raises(ValueError, match="stride must be 1, not 2"):
        pursue(koopman(), strided, STEPS, torch.Generator())


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
