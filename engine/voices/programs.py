"""Programs: what all voices of one source share, at one sample rate.

A model whose decoder is linear becomes a bank of latents, and the string itself a solver; both are compiled and
sound at once, at the device's own rate. Any other model is rendered ahead at its own rate, and converted.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache, singledispatch
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from engine.bounds import SUBSTEPS_IN_A_PERIOD
from engine.kernels import layout as at
from engine.kernels.modes import TOO_HIGH
from engine.models.base import StringModel
from engine.models.dmd import DMD
from engine.models.integrated_phase import GAIN_LIMIT, SETTLED, KoopmanIntegrated
from engine.models.koopman_tension import KoopmanTension
from engine.pluck import FULL_SCALE_M
from engine.presets import PresetInfo
from engine.resonators.base import Resonator
from engine.truth.splitting import KICKS, ROTATIONS
from engine.voices.ear import Ear

HEARD_SILENCE = 4e-6  # of a mode, of all: what the truth leaves out where it is heard is 108 dB down
STRING_SILENT_DB = 120.0  # its slowest mode, below its start
HEARD_COARSER = 15  # times fewer sub-steps than data are made with: 1e-5 off after a second, far below audibility
FILTER_TAPS, FILTER_PHASES, FILTER_BETA = 32, 512, 10.0

Array = NDArray[np.float64]
Strike = Callable[[Tensor], tuple[Array, Array]]
KEPT_WEIGHTS = 32  # listening points of a program


@dataclass(frozen=True, eq=False)
class Program:
    """See the module; the kernels read `memory`.

    Attributes:
        modes: latents of a bank, modes of a solver, 0 where samples are rendered.
        start: initial displacement (grid_points,) in m to the two rows (modes,) that a voice sets out from.
        read: weights (grid_points, points) of displacement to weights (points, 2 modes) and bias (points,), of full
            scale.
        resonator: whose modes its voices begin with, and may leave; None: its kind has none of its own.
        ends_s: since the pluck, when a voice ends whatever its model still gives.
        force: `Resonator.force_weights` of the string that is played; None: it cannot be heard at a bridge.
    """

    kind: int
    memory: Array
    modes: int
    rate_hz: int
    grid_points: int
    start: Strike
    read: Callable[[Tensor], tuple[Array, Array]]
    resonator: Resonator | None = None
    ends_s: float = math.inf
    force: Tensor | None = None
    _known: dict[Ear, tuple[Array, Array]] = field(default_factory=dict)

    def weights(self, ear: Ear) -> tuple[Array, Array]:
        """As `read`, of a pair of listening points; remembered. Any thread may ask."""
        found = self._known.get(ear)
        if found is None:
            found = self.read(self.grid_weights(ear))
            if len(self._known) >= KEPT_WEIGHTS:
                self._known.clear()
            self._known[ear] = found
        return found

    def grid_weights(self, ear: Ear) -> Tensor:
        """As `Ear.weights`, for its string; displacement @ weights is what is heard."""
        return ear.weights(self.grid_points, self.force)

    @property
    def rendered(self) -> bool:
        """Whether somebody renders the samples of its voices."""
        return self.kind == at.RENDERED

    @property
    def address(self) -> int:
        return int(self.memory.ctypes.data)


def voice_ends_s(info: PresetInfo) -> float:
    """When a pluck of a preset's model has ended for certain, in s; inf where its string has no losses.

    The string itself is silent by then. A model need not be: one that was trained on a part of a second may settle to
    a hum of its own, and nothing it has learned makes it end. Latents that share a tension need no such end: their
    energy is held below that of the slowest mode.
    """
    return max(info.horizon_s, info.resonator.falls_s(STRING_SILENT_DB))


@singledispatch
def bank_program(model: StringModel[Any], info: PresetInfo, rate_hz: int) -> Program | None:
    """The program of a model that is compiled here, registered below by its class; None: it is rendered ahead."""
    return None


@bank_program.register
@torch.no_grad()
def _integrated_program(model: KoopmanIntegrated, info: PresetInfo, rate_hz: int) -> Program | None:
    """None where there are more latents or layers than the kernel holds."""
    c, n = model.configuration, model.configuration.state_size
    widths = (n, *c.eigenvalue_widths)
    if max(widths) > at.MOST_MODES or len(widths) > 7:
        return None
    rates = model._rates()
    units = model.energy_units if model.energy_units is not None else torch.ones(n, dtype=torch.float64)
    network, at_zero, sizes = np.zeros(0, np.float32), torch.zeros(2 * n), [0]
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
    header = {
        at.P_RATIO: ratio,
        at.P_SPACING: float(c.node_spacing),
        at.P_LIMIT: GAIN_LIMIT,
        at.P_LOUDNESS: math.log(info.scale_m / FULL_SCALE_M),
    }
    counts = {
        at.P_MODES: n,
        at.P_SECOND_ORDER: int(c.second_order),
        at.P_HIGHER: int(model.g is not None or c.adiabatic),
        at.P_ADIABATIC: int(c.adiabatic),
        at.P_LAYERS: len(sizes) - 1 if model.g is not None else 0,
        at.P_MODULATION: int(model.M_out is not None),
        at.P_EARLY: math.ceil(SETTLED * c.node_spacing / ratio / at.QUANTUM) * at.QUANTUM,
        **{at.P_WIDTHS + place: width for place, width in enumerate(sizes)},
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
    memory = _packed(at.P_HEADER, header, counts, dict(zip(range(at.P_OFFSETS, at.P_WIDTHS), parts, strict=True)))
    weight, offset = model.decoder.weight.double(), model.decoder.bias.double()

    def start(displacement_m: Tensor) -> tuple[Array, Array]:
        with torch.inference_mode():
            z = model.encode((displacement_m[None] / info.scale_m).float()).origin[0].to(torch.complex128)
        return z.abs().clamp(min=1e-300).log().numpy(), z.angle().numpy()

    if rate_hz != info.rate_hz:
        weight = weight * _fits(rates.omega * ratio).repeat(2)

    def read(weights: Tensor) -> tuple[Array, Array]:
        scale = info.scale_m / FULL_SCALE_M
        return (scale * weights.T @ weight).numpy(), (scale * offset @ weights).numpy()

    return _bank(memory, n, rate_hz, start, read, info)


def _bank(
    memory: Array,
    modes: int,
    rate_hz: int,
    start: Strike,
    read: Callable[[Tensor], tuple[Array, Array]],
    info: PresetInfo,
) -> Program:
    force = info.resonator.force_weights
    return Program(at.BANK, memory, modes, rate_hz, info.grid_points, start, read, None, voice_ends_s(info), force)


@bank_program.register
@torch.no_grad()
def _dmd_program(model: DMD, info: PresetInfo, rate_hz: int) -> Program | None:
    """None where no eigenvalue is left, or there are more than the kernel holds."""
    present = model.magnitude_log > -600
    sigma, omega = -model.magnitude_log[present].double(), model.angle[present].double()
    n = int(present.sum())
    if not 0 < n <= at.MOST_MODES:
        return None
    zeros = torch.zeros(n, dtype=torch.float64)
    parts = [sigma, omega, torch.zeros(n, 2 * n, dtype=torch.float64), zeros, *(zeros[:0] for _ in range(8))]
    header = {
        at.P_RATIO: (ratio := info.rate_hz / rate_hz),
        at.P_SPACING: 1.0,
        at.P_LIMIT: 1.0,
        at.P_LOUDNESS: math.log(info.scale_m / FULL_SCALE_M),
    }
    memory = _packed(
        at.P_HEADER, header, {at.P_MODES: n}, dict(zip(range(at.P_OFFSETS, at.P_WIDTHS), parts, strict=True))
    )
    real, imaginary = model.modes.double().chunk(2, dim=-1)
    modes = torch.cat([real[:, present], -imaginary[:, present]], dim=-1)
    if rate_hz != info.rate_hz:
        modes = modes * _fits(omega * ratio).repeat(2)

    def start(displacement_m: Tensor) -> tuple[Array, Array]:
        with torch.inference_mode():
            z = model.encode((displacement_m[None] / info.scale_m).float()).origin[0, present].to(torch.complex128)
        return z.abs().clamp(min=1e-300).log().numpy(), z.angle().numpy()

    def read(weights: Tensor) -> tuple[Array, Array]:
        return (info.scale_m / FULL_SCALE_M * weights.T @ modes).numpy(), np.zeros(weights.shape[1])

    return _bank(memory, n, rate_hz, start, read, info)


@bank_program.register
def _tension_program(model: KoopmanTension, info: PresetInfo, rate_hz: int) -> Program:
    return tension_program(model, info.resonator, rate_hz)


def tension_program(model: KoopmanTension, resonator: Resonator, rate_hz: int) -> Program:
    """What the model learned, for a resonator of any kind at any rate."""
    return _with_modes(at.TENSION, tension_memory(model, rate_hz), resonator, rate_hz)


@torch.no_grad()
def tension_memory(model: KoopmanTension, rate_hz: int) -> Array:
    """What the kernels read of the model, whatever the resonator."""
    c, curves = model.configuration, torch.stack([model.A, model.r, model.p])
    reals = {
        at.S_NODE_PHASE: c.node_phase,
        at.S_HIGHEST_PHASE: c.highest_phase,
        at.S_SILENCE: HEARD_SILENCE,
        at.S_LOUDNESS: -math.log(FULL_SCALE_M),
        at.S_RATE: float(rate_hz),
    }
    return np.concatenate([_header(at.S_HEADER, reals, {at.S_COEFFICIENTS: c.degree + 1}), curves.flatten().numpy()])


def truth_program(info: PresetInfo, rate_hz: int, coarser: int = HEARD_COARSER) -> Program:
    """The physics of a preset's string, with its modes, at any rate.

    Args:
        coarser: how many times fewer sub-steps than `default_substeps`.
    """
    return solver_program(info.resonator, rate_hz, coarser, aliased=rate_hz == info.rate_hz)


def solver_program(
    resonator: Resonator, rate_hz: int, coarser: int = HEARD_COARSER, aliased: bool = False
) -> Program:
    """The physics of a resonator at any rate.

    Args:
        aliased: modes that are too high for the rate are heard as others, as they are in data of that rate.
    """
    return _with_modes(at.TRUTH, solver_memory(rate_hz, coarser), resonator, rate_hz, aliased)


def solver_memory(rate_hz: int, coarser: int = HEARD_COARSER) -> Array:
    """What the kernels read of the solver, whatever the resonator."""
    reals = {
        at.T_SUBSTEPS: SUBSTEPS_IN_A_PERIOD / coarser,
        at.T_SILENCE: HEARD_SILENCE,
        at.T_LOUDNESS: -math.log(FULL_SCALE_M),
        at.T_RATE: float(rate_hz),
        **{at.T_ROTATIONS + stage: share for stage, share in enumerate(ROTATIONS[: at.STAGES // 2])},
        **{at.T_KICKS + stage: share for stage, share in enumerate(KICKS)},
    }
    return _header(at.T_HEADER, reals, {})


def _fits(omega: Tensor) -> Tensor:
    """1 where a mode turns by so few rad a frame, ω (modes,), that it sounds as itself, else 0."""
    return (omega.abs() <= TOO_HIGH).double()


def _with_modes(kind: int, memory: Array, resonator: Resonator, rate_hz: int, aliased: bool = False) -> Program:
    """Of a kind whose voices move amplitudes of the resonator's modes."""
    omega = resonator.eigenvalues().imag  # it swings
    shapes, n = resonator.shapes, resonator.modes
    if not aliased:
        shapes = shapes * _fits(omega / rate_hz)[:, None]

    def start(displacement_m: Tensor) -> tuple[Array, Array]:
        return resonator.to_modes(displacement_m.double()).numpy(), np.zeros(n)

    def read(weights: Tensor) -> tuple[Array, Array]:
        found = (weights.double().T @ shapes.T / FULL_SCALE_M).numpy()
        return np.concatenate([found, np.zeros_like(found)], axis=1), np.zeros(len(found))

    return Program(kind, memory, n, rate_hz, resonator.points, start, read, resonator, force=resonator.force_weights)


def model_program(model: StringModel[Any], info: PresetInfo, rate_hz: int) -> Program:
    """A bank where the model is one, otherwise for samples that are rendered ahead."""
    return bank_program(model, info, rate_hz) or rendered_program(info, rate_hz)


def rendered_program(info: PresetInfo, rate_hz: int) -> Program:
    """For samples that are rendered ahead at the preset's own rate."""
    force = info.resonator.force_weights
    return _samples_program(info.rate_hz, rate_hz, info.grid_points, voice_ends_s(info), force)


@lru_cache(maxsize=4)
def plain_program(rate_hz: int) -> Program:
    """For samples of the device's own rate, which are played as they are."""
    return _samples_program(rate_hz, rate_hz, 0, math.inf)


def _samples_program(
    source_rate_hz: int, rate_hz: int, grid_points: int, ends_s: float, force: Tensor | None = None
) -> Program:
    """Converts by a Kaiser-windowed sinc in `FILTER_PHASES` phases; equal rates leave every sample as it is."""
    ratio = source_rate_hz / rate_hz
    cutoff = min(1.0, 1 / ratio)
    phase = np.arange(FILTER_PHASES + 1)[:, None] / FILTER_PHASES
    place = np.arange(-FILTER_TAPS + 1, FILTER_TAPS + 1)[None] - phase
    window = np.i0(FILTER_BETA * np.sqrt(np.clip(1 - (place / FILTER_TAPS) ** 2, 0, 1))) / np.i0(FILTER_BETA)
    sinc = np.sinc(cutoff * place)
    table = cutoff * np.where(np.abs(sinc) < 1e-15, 0.0, sinc) * window
    memory = _packed(
        at.R_HEADER,
        {at.R_RATIO: ratio},
        {at.R_TAPS: FILTER_TAPS, at.R_PHASES: FILTER_PHASES},
        {at.R_FILTER: np.concatenate([table, table[-1:]])},
    )

    def start(_displacement_m: Tensor) -> tuple[Array, Array]:
        return np.zeros(0), np.zeros(0)

    def read(weights: Tensor) -> tuple[Array, Array]:
        return np.zeros((weights.shape[1], 0)), np.zeros(weights.shape[1])

    return Program(at.RENDERED, memory, 0, rate_hz, grid_points, start, read, None, ends_s, force)


def _flat(layer: nn.Linear) -> NDArray[np.float32]:
    """Bias, then weights by input, float32."""
    bias = torch.zeros(layer.out_features) if layer.bias is None else layer.bias
    return torch.cat([bias.detach(), layer.weight.detach().T.flatten()]).numpy().astype(np.float32)


def _packed(
    header_slots: int, reals: dict[int, float], wholes: dict[int, int], parts: dict[int, Tensor | NDArray[np.generic]]
) -> Array:
    """One array of a header and its parts, whose places the header gives."""
    arrays: Sequence[NDArray[np.generic]] = [np.asarray(part).ravel() for part in parts.values()]
    header = _header(header_slots, reals, wholes)
    memory = np.concatenate([header, np.zeros(sum(len(array) for array in arrays))])
    counts = memory.view(np.int64)
    place = header_slots
    for slot, array in zip(parts, arrays, strict=True):
        counts[slot] = place
        target = counts if array.dtype == np.int64 else memory
        target[place : place + len(array)] = array
        place += len(array)
    return memory


def _header(slots: int, reals: dict[int, float], wholes: dict[int, int]) -> Array:
    memory = np.zeros(slots)
    for slot, real in reals.items():
        memory[slot] = real
    for slot, whole in wholes.items():
        memory.view(np.int64)[slot] = whole
    return memory
