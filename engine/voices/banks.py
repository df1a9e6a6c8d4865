"""Programs of models whose decoder is linear: banks of latents, at the device's own rate; made with torch."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import singledispatch
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from engine.kernels.constants import QUANTUM
from engine.kernels.mixer_records import MOST_LATENTS
from engine.kernels.voice_records import BANK, BANK_PARTS, BANK_PROGRAM, MOST_WIDTHS
from engine.levels import FULL_SCALE_M
from engine.models.base import StringModel
from engine.models.dmd import DMD
from engine.models.integrated_phase import GAIN_LIMIT, SETTLED, IntegratedPhase
from engine.presets import PresetInfo
from engine.resonators.base import Array
from engine.voices.program import Program, Strike, fits, packed, voice_ends_s


@singledispatch
def bank_program(model: StringModel[Any], info: PresetInfo, rate_hz: int) -> Program | None:
    """The program of a model, registered below by its class; None: it is rendered ahead."""
    return None


@bank_program.register
@torch.no_grad()
def _integrated_phase_program(model: IntegratedPhase, info: PresetInfo, rate_hz: int) -> Program | None:
    """The program of an integrated-phase model; None: it has more latents or layers than the kernel holds."""
    c, n = model.configuration, model.configuration.state_size
    widths = (n, *c.eigenvalue_widths)
    if max(widths) > MOST_LATENTS or len(widths) >= MOST_WIDTHS:
        return None
    rates = model._rates()
    units = model.energy_units if model.energy_units is not None else torch.ones(n, dtype=torch.float64)
    network = np.zeros(0, np.float32)
    at_zero = torch.zeros(2 * n)
    sizes = [0]
    if model.g is not None:
        at_zero = model.g(torch.zeros(n))
        layers = [layer for layer in model.g if isinstance(layer, nn.Linear)]
        sizes = [n, *(layer.out_features for layer in layers)]
        network = np.concatenate([_flat(layer) for layer in layers])
    turn = rates.coupling[:, n:]
    modulation = largest_m = torch.zeros(0, dtype=torch.float64)
    if model.M_out is not None:
        matrix = (model.M_out * model._modulation_units).double().view(2, n, 2, n)
        modulation = matrix.permute(1, 3, 0, 2).contiguous()  # (of, by, gain or turn, of Re z² or of Im z²)
        largest_m = modulation.abs().sum((2, 3)).amax(0)
    change = torch.zeros(0, dtype=torch.float64)
    if model.A_out is not None:
        change = (model.A_out * model._modulation_units[:n]).double().T.contiguous()
    ratio = info.rate_hz / rate_hz
    values = {
        "modes": n,
        "ratio": ratio,
        "spacing": c.node_spacing,
        "limit": GAIN_LIMIT,
        "second_order": c.second_order,
        "higher": model.g is not None or c.adiabatic,
        "adiabatic": c.adiabatic,
        "layers": len(sizes) - 1 if model.g is not None else 0,
        "modulates": model.M_out is not None,
        "loudness": math.log(info.scale_m / FULL_SCALE_M),
        "early": math.ceil(SETTLED * c.node_spacing / ratio / QUANTUM) * QUANTUM,
        "widths": sizes + [0] * (MOST_WIDTHS - len(sizes)),
    }
    parts = (
        rates.sigma,
        rates.omega,
        rates.coupling,
        rates.coupling.abs().amax(1),
        turn / rates.omega,
        units,
        model._rate_units,
        at_zero.double(),
        torch.from_numpy(np.pad(network, (0, len(network) % 2)).view(np.float64)),
        modulation,
        largest_m,
        change,
    )
    memory = packed(BANK_PROGRAM, values, *(part.numpy() for part in parts), names=BANK_PARTS)
    weight, offset = model.decoder.weight.double(), model.decoder.bias.double()

    def start(displacement_m: Array) -> tuple[Array, Array]:
        return _polar(_origin(model, displacement_m / info.scale_m))

    if rate_hz != info.rate_hz:
        weight = weight * torch.from_numpy(fits((rates.omega * ratio).numpy())).repeat(2)

    decoder, constant = weight.numpy(), offset.numpy()

    def read(weights: Array) -> tuple[Array, Array]:
        scale = info.scale_m / FULL_SCALE_M
        return scale * weights.T @ decoder, scale * constant @ weights

    return _bank(memory, n, rate_hz, start, read, info)


@bank_program.register
@torch.no_grad()
def _dmd_program(model: DMD, info: PresetInfo, rate_hz: int) -> Program | None:
    """The program of a DMD model; None: no eigenvalue is left, or there are more than the kernel holds."""
    present = model.magnitude_log > -600
    sigma, omega = -model.magnitude_log[present].double(), model.angle[present].double()
    n = int(present.sum())
    if not 0 < n <= MOST_LATENTS:
        return None
    zeros = torch.zeros(n, dtype=torch.float64)
    parts = [sigma, omega, torch.zeros(n, 2 * n, dtype=torch.float64), zeros, *(zeros[:0] for _ in range(8))]
    ratio = info.rate_hz / rate_hz
    values = {
        "modes": n,
        "ratio": ratio,
        "spacing": 1.0,
        "limit": 1.0,
        "loudness": math.log(info.scale_m / FULL_SCALE_M),
    }
    memory = packed(BANK_PROGRAM, values, *(part.numpy() for part in parts), names=BANK_PARTS)
    real, imaginary = model.modes.double().chunk(2, dim=-1)
    modes = torch.cat([real[:, present], -imaginary[:, present]], dim=-1)
    if rate_hz != info.rate_hz:
        modes = modes * torch.from_numpy(fits((omega * ratio).numpy())).repeat(2)

    def start(displacement_m: Array) -> tuple[Array, Array]:
        return _polar(_origin(model, displacement_m / info.scale_m)[present.numpy()])

    decoder = modes.numpy()

    def read(weights: Array) -> tuple[Array, Array]:
        return info.scale_m / FULL_SCALE_M * weights.T @ decoder, np.zeros(weights.shape[1])

    return _bank(memory, n, rate_hz, start, read, info)


def _bank(
    memory: Array,
    modes: int,
    rate_hz: int,
    start: Strike,
    read: Callable[[Array], tuple[Array, Array]],
    info: PresetInfo,
) -> Program:
    force = info.resonator.force_weights
    return Program(BANK, memory, modes, rate_hz, info.grid_points, start, read, None, voice_ends_s(info), force)


def _origin(model: IntegratedPhase | DMD, displacement: Array) -> NDArray[np.complex128]:
    """The latents (state_size,) of a displacement (grid_points,) in normalised units."""
    with torch.inference_mode():
        state = model.encode(torch.from_numpy(displacement[None]).float())
    return state.origin[0].to(torch.complex128).numpy()


def _polar(latents: NDArray[np.complex128]) -> tuple[Array, Array]:
    return np.log(np.maximum(np.abs(latents), 1e-300)), np.angle(latents)


def _flat(layer: nn.Linear) -> NDArray[np.float32]:
    """Bias, then weights by input, float32."""
    bias = torch.zeros(layer.out_features) if layer.bias is None else layer.bias
    return torch.cat([bias.detach(), layer.weight.detach().T.flatten()]).numpy().astype(np.float32)
