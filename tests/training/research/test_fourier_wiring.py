"""Fourier cells that are wired as strings of known modes, against closed forms."""

from dataclasses import replace

import pytest
import torch

from engine.models.base import StringModes
from engine.models.configurations import FGRUConfiguration, FRNNConfiguration
from engine.models.fno import FGRU, FRNN
from engine.resonators.sine_transform import synthesis_matrix
from tests.training.fitting.test_pursuit import motions_of
from training.cell import Cell, configuration_of
from training.evaluate import evaluate_model
from training.fitting import phases
from training.fitting.start import begin
from training.research import fourier_wiring as wiring
from training.research.fourier_wiring import mean_motions, store_in_fgru, store_in_frnn

POINTS = 31


def modes(coupled: float = 0.0, count: int = 5) -> StringModes:
    """A string whose coupling is what FGRU can hold."""
    n = torch.arange(1, count + 1, dtype=torch.float64)
    eigenvalues = torch.complex(-1e-4 * n**2, 0.31 * n)
    squares = torch.rand(30, count, generator=torch.Generator().manual_seed(3), dtype=torch.float64)
    coupling = coupled * n[:, None] * n**2 * (1 + 0.5 * torch.eye(count, dtype=torch.float64))
    starts = torch.complex(torch.ones_like(n), eigenvalues.real / eigenvalues.imag)
    return StringModes(torch.from_numpy(synthesis_matrix(POINTS, count)), eigenvalues, starts, coupling, squares)


def motion(string: StringModes, initial: torch.Tensor, steps: int) -> torch.Tensor:
    """Displacement (strings, steps, points) of initial amplitudes (strings, modes)."""
    t = torch.arange(1.0, steps + 1, dtype=torch.float64)[:, None]
    decay = -2 * string.log_eigenvalues.real
    integrals = initial.square()[:, None] * (1 - torch.exp(-decay * t)) / decay
    phases = string.log_eigenvalues * t + 1j * (integrals @ string.coupling.T)
    return (initial[:, None] * (string.starts * torch.exp(phases)).real) @ string.shapes


def relative_error(model: FGRU | FRNN, string: StringModes, steps: int, skipped: int = 0) -> float:
    """Mean square error, relative, of frames `skipped` + 1 … `steps` of four strings."""
    initial = torch.randn(4, len(string.shapes), generator=torch.Generator().manual_seed(0), dtype=torch.float64) / 2
    truth = motion(string, initial, steps)
    with torch.no_grad():
        found = model((initial @ string.shapes).float(), steps).double()
    return float((found - truth)[:, skipped:].square().sum() / truth[:, skipped:].square().sum())


def fgru(string: StringModes) -> FGRU:
    model = FGRU(FGRUConfiguration(POINTS, 24))
    store_in_fgru(model, string)
    return model


@pytest.mark.parametrize("count", [4, 5])
def test_an_frnn_is_a_linear_string(count):
    string, model = modes(count=count), FRNN(FRNNConfiguration(POINTS, 8, 3))
    store_in_frnn(model, string)
    assert relative_error(model, string, 300) < 1e-7


def test_an_fgru_is_a_linear_string_and_follows_the_squares():
    """Except its first frame, which it has no state for yet; what swings within a period is left."""
    linear, string = modes(), modes(2e-4)
    assert relative_error(fgru(linear), linear, 300, skipped=1) < 1e-4
    assert relative_error(fgru(linear), linear, 10) < 1e-2
    assert relative_error(fgru(string), string, 300) < 0.02
    assert relative_error(fgru(linear), string, 300) > 0.1


def test_a_mean_motion_is_the_linear_strings_own_or_between_those_of_soft_and_loud_strings():
    omega, sigma = torch.tensor([0.4, 1.3]).double(), torch.tensor([1e-4, 2e-3]).double()
    found = mean_motions(motions_of(omega, sigma, torch.zeros(2, 2).double(), 400))
    torch.testing.assert_close(found.log_eigenvalues, torch.complex(-sigma, omega), rtol=1e-6, atol=1e-9)
    assert not found.coupling.any()
    coupling = torch.tensor([[0.002, 0.002], [0.002, 0.004]]).double()
    found = mean_motions(motions_of(omega, sigma, coupling, 400)).log_eigenvalues
    assert (found.imag > omega).all()
    assert (found.imag < omega + coupling.sum(1)).all()
    assert (-found.real > sigma).all()  # motions that part cancel one another


@pytest.mark.parametrize(("model", "largest"), [("fgru", 0.02), ("frnn", 0.5)])
def test_a_fourier_cell_starts_as_the_string_that_it_has_seen(small_dataset, model, largest, monkeypatch):
    """FGRU's frequencies follow the squares; FRNN is the linear string that is nearest."""
    monkeypatch.setattr(phases, "STORES", dict(phases.STORES))
    wiring.use()
    configuration = configuration_of(Cell(model, True, "gaussian", 4000, 200))
    cell, _ = begin(replace(configuration, data=small_dataset.configuration), small_dataset)
    error = evaluate_model(cell, small_dataset, "validation", 200).total()
    assert error.rel_mse < largest
