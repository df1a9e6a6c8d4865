"""Programs of models whose decoder is linear: banks of latents, at the device's own rate; made with torch."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial, singledispatch
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from engine.kernels.constants import QUANTUM
from engine.kernels.mixer_records import MOST_LATENTS
from engine.kernels.voice_records import BANK, BANK_PARTS, BANK_PROGRAM, MOST_WIDTHS
from engine.levels import FULL_SCALE_M
from engine.models.base import StringModel
from engine.models.dmd import DMD
from engine.models.integrated_phase import GAIN_LIMIT, SETTLED, IntegratedPhase
from engine.presets import PresetInfo
from engine.resonators.base import Array
from engine.voices.program import Program, fits, packed, voice_ends_s


@singledispatch
def bank_program(model: StringModel[Any], info: PresetInfo, rate_hz: int) -> Program | None:
    """The program of a model, registered below by its class; None: it is rendered ahead."""
    return None


@bank_program.register
@torch.no_grad()
def _integrated_phase_program(model: IntegratedPhase, info: PresetInfo, rate_hz: int) -> Program | None:
    """The program of an integrated-phase model; None: it has more latents or layers than the kernel holds.

    The parts are what the kernel reads of it, in the order of `BANK_PARTS`; a part that a model lacks is empty.
    """
    c, n = model.configuration, model.configuration.state_size
    widths = (n, *c.eigenvalue_widths)
    if max(widths) > MOST_LATENTS or len(widths) >= MOST_WIDTHS:
        return None
    rates = model._rates()
    network = np.zeros(0, np.float32)
    at_zero = torch.zeros(2 * n)  # g(0)
    sizes = [0]  # widths of g from the input on; [0]: there is no g
    if model.g is not None:
        at_zero = model.g(torch.zeros(n))
        layers = [layer for layer in model.g if isinstance(layer, nn.Linear)]
        sizes = [n, *(layer.out_features for layer in layers)]
        network = np.concatenate([_flat(layer) for layer in layers])
    turn = rates.coupling[:, n:]  # Im K transposed, rad a sample, (n, n)
    matrix = (model.M_out * model._modulation_units).double().view(2, n, 2, n)
    modulation = matrix.permute(1, 3, 0, 2).contiguous()  # (of, by, gain or turn, of Re z² or of Im z²)
    change = torch.zeros(0, dtype=torch.float64)  # A transposed
    if model.A_out is not None:
        change = (model.A_out * model._modulation_units[:n]).double().T.contiguous()
    values = {
        "spacing": c.node_spacing,
        "limit": GAIN_LIMIT,
        "second_order": c.second_order,
        "higher": model.g is not None or c.adiabatic,
        "adiabatic": c.adiabatic,
        "layers": len(sizes) - 1 if model.g is not None else 0,
        "modulates": True,
        "early": math.ceil(SETTLED * c.node_spacing / (info.rate_hz / rate_hz) / QUANTUM) * QUANTUM,
        "widths": sizes + [0] * (MOST_WIDTHS - len(sizes)),
    }
    parts = (
        rates.sigma,
        rates.omega,
        rates.coupling,
        rates.coupling.abs().amax(1),
        turn / rates.omega,
        model.energy_units,
        model._rate_units,
        at_zero.double(),
        torch.from_numpy(np.pad(network, (0, len(network) % 2)).view(np.float64)),
        modulation,
        modulation.abs().sum((2, 3)).amax(0),
        change,
    )
    decoder = model.decoder.weight.double(), model.decoder.bias.double()
    return _bank(info, rate_hz, values, parts, partial(_origin, model), *decoder)


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
    parts = (sigma, omega, torch.zeros(n, 2 * n, dtype=torch.float64), zeros, *(zeros[:0] for _ in range(8)))
    real, imaginary = model.modes.double().chunk(2, dim=-1)
    decoder = torch.cat([real[:, present], -imaginary[:, present]], dim=-1)
    offset = torch.zeros(info.grid_points, dtype=torch.float64)

    def encode(displacement: Array) -> NDArray[np.complex128]:
        return _origin(model, displacement)[present.numpy()]

    return _bank(info, rate_hz, {"spacing": 1.0, "limit": 1.0}, parts, encode, decoder, offset)


def _bank(
    info: PresetInfo,
    rate_hz: int,
    values: Mapping[str, Any],
    parts: Sequence[Tensor],
    encode: Callable[[Array], NDArray[np.complex128]],
    decoder: Tensor,
    offset: Tensor,
) -> Program:
    """The program of latents by their `BANK_PARTS`, which are σ, ω …, all in the model's units.

    Args:
        rate_hz: the device's.
        values: of the fields of `BANK_PROGRAM` that are the model's own.
        encode: a displacement's (grid_points,) latents (n,).
        decoder, offset: (grid_points, 2 n), real parts first, and (grid_points,).
    """
    omega = parts[1]
    ratio = info.rate_hz / rate_hz  # trained samples in a frame of the device
    scale = info.scale_m / FULL_SCALE_M  # of full scale, for a normalised displacement of 1
    values = {**values, "modes": len(omega), "ratio": ratio, "loudness": math.log(scale)}
    memory = packed(BANK_PROGRAM, values, *(part.numpy() for part in parts), names=BANK_PARTS)
    if rate_hz != info.rate_hz:
        decoder = decoder * torch.from_numpy(fits((omega * ratio).numpy())).repeat(2)
    matrix, constant = decoder.numpy(), offset.numpy()

    def start(displacement_m: Array) -> tuple[Array, Array]:
        latents = encode(displacement_m / info.scale_m)
        return np.log(np.maximum(np.abs(latents), 1e-300)), np.angle(latents)

    def read(weights: Array) -> tuple[Array, Array]:
        return scale * weights.T @ matrix, scale * constant @ weights

    ends_s, force = voice_ends_s(info), info.resonator.force_weights
    return Program(BANK, memory, len(omega), rate_hz, info.grid_points, start, read, None, ends_s, force)


def _origin(model: IntegratedPhase | DMD, displacement: Array) -> NDArray[np.complex128]:
    """The latents (state_size,) of a displacement (grid_points,) in normalised units."""
    with torch.inference_mode():
        state = model.encode(torch.from_numpy(displacement[None]).float())
    return state.origin[0].to(torch.complex128).numpy()


def _flat(layer: nn.Linear) -> NDArray[np.float32]:
    """Bias (outputs,), then for each input its weights (outputs,), float32, in one row."""
    bias = torch.zeros(layer.out_features) if layer.bias is None else layer.bias
    return torch.cat([bias.detach(), layer.weight.detach().T.flatten()]).numpy().astype(np.float32)
