"""The engine's NumPy functions on tensors, for tests of models and solvers; results have the tensor's own type."""

import numpy as np
import torch
from torch import Tensor

from engine.models.fno import FourierConvolution
from engine.resonators import sine_transform
from engine.resonators.base import Resonator
from engine.truth import ModalState


def to_modes(displacement: Tensor, modes: int) -> Tensor:
    return torch.from_numpy(sine_transform.to_modes(displacement.double().numpy(), modes)).to(displacement)


def to_grid(amplitudes: Tensor, grid_points: int) -> Tensor:
    return torch.from_numpy(sine_transform.to_grid(amplitudes.double().numpy(), grid_points)).to(amplitudes)


def listening_weights(positions: list[float], grid_points: int) -> Tensor:
    return torch.from_numpy(sine_transform.listening_weights(np.array(positions), grid_points))


def solve_linear(resonator: Resonator, state: ModalState, times_s: Tensor) -> Tensor:
    """The closed form of motion without coupling: modal amplitudes at `times_s` (times,), (batch, times, modes)."""
    sigma, omega = torch.from_numpy(resonator.sigma), torch.from_numpy(resonator.eigenvalues().imag)
    q, speed, t = state.amplitude[:, None], state.velocity[:, None], times_s.double()[:, None]
    return torch.exp(-sigma * t) * (q * torch.cos(omega * t) + (speed + sigma * q) / omega * torch.sin(omega * t))


def convolved(layer: FourierConvolution, field: Tensor) -> Tensor:
    """A Fourier convolution by its definition, (batch, grid_points, width) to the same shape."""
    points, weight = field.shape[1], torch.complex(layer.weight[:, :, 0], layer.weight[:, :, 1])
    spectrum = torch.einsum("bki,kio->bko", torch.fft.rfft(field, n=2 * points, dim=1)[:, :points], weight)
    return torch.fft.irfft(spectrum, n=2 * points, dim=1)[:, :points] + layer.bias_field()
