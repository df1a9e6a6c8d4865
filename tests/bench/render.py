"""Rendering a model: its real-time factor, and how soon after a pluck the first block is ready.

Each factor has a floor beside it: the time that the model's matrix products alone would take at this machine's
measured rate of float32 products, or that writing its frames would take, whichever is longer. A factor below the
floor means that the model renders by a cheaper method than its definition.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.utils.flop_counter import FlopCounterMode

from engine.models import build_model
from engine.models.base import Physics, StringModel
from engine.pluck import DEFAULT_LISTEN, Pluck
from engine.resonators.sine_transform import listening_weights
from engine.resonators.string import resonator_of
from engine.values.string import StringParameters
from tests.bench.machine import Machine, median_s, one_thread, times_s

FIRST_BLOCK = 256  # frames
AUDIO_S = 2.0
PLUCKS = 25  # whose first block is timed
REPEATS = 5
SCALE_M = 1e-3  # of the order of a data set's


@dataclass(frozen=True)
class Case:
    """A model at a rate, with so many modes of the string; `sizes` are those that are not the paper's."""

    model: str
    rate_hz: int
    modes: int
    sizes: tuple[tuple[str, Any], ...] = ()


_PAPER_RATES = ((4_000, 10), (16_000, 25))
CASES = (
    *(Case(name, *rate) for name in ("dmd", "koopman", "koopman_var", "lru", "s5") for rate in _PAPER_RATES),
    *(Case("koopman_integrated", *rate, (("state_size", rate[1]),)) for rate in (*_PAPER_RATES, (48_000, 57))),
    Case("fgru", 4_000, 10),
    Case("frnn", 4_000, 10),
)


@dataclass(frozen=True)
class RenderTiming:
    """One model on one thread.

    Attributes:
        grid, point: real-time factors, seconds of work for a second of sound (below 1: faster than real time), for
            the whole grid and for one listening point.
        grid_floor, point_floor: see the module.
        first_block_s, worst_first_block_s: from the pluck to 256 samples on the whole grid, median and worst.
    """

    model: str
    rate_hz: int
    modes: int
    grid: float
    grid_floor: float
    point: float
    point_floor: float
    first_block_s: float
    worst_first_block_s: float


@dataclass(frozen=True)
class RenderBenchmark:
    """`products_per_s`: float32 operations in large matrix products; `written_per_s`: bytes, both on one thread."""

    machine: Machine
    products_per_s: float
    written_per_s: float
    models: tuple[RenderTiming, ...]


def measure(report: Callable[[float, str], None]) -> RenderBenchmark:
    """Measure every model, untrained, as its cost does not depend on its weights."""
    found = []
    with one_thread():
        machine = Machine.here()
        rates = _products_per_s(), _written_per_s()
        for number, case in enumerate(CASES):
            report(number / len(CASES), f"{case.model} {case.rate_hz} Hz")
            found.append(_measure(case, *rates))
    return RenderBenchmark(machine, *rates, tuple(found))


def _measure(case: Case, products_per_s: float, written_per_s: float) -> RenderTiming:
    model = _untrained(case)
    pluck = torch.from_numpy(Pluck().displacement(model.grid_points) / SCALE_M).float()[None]
    point = torch.from_numpy(listening_weights(np.array([DEFAULT_LISTEN]), model.grid_points)).float()
    samples = round(AUDIO_S * case.rate_hz)

    def floor(readout: Tensor | None) -> float:
        with FlopCounterMode(display=False) as counter, torch.enable_grad():  # by the definition
            points = model(pluck, FIRST_BLOCK, readout).shape[-1]
        a_second = case.rate_hz / FIRST_BLOCK
        return max(counter.get_total_flops() * a_second / products_per_s, 4 * points * case.rate_hz / written_per_s)

    floors = floor(None), floor(point)
    with torch.inference_mode():
        factors = [median_s(lambda r=r: model(pluck, samples, r), REPEATS) / AUDIO_S for r in (None, point)]  # type: ignore[misc]
        first_s = times_s(lambda: model(pluck, FIRST_BLOCK), PLUCKS)
    return RenderTiming(
        case.model,
        case.rate_hz,
        case.modes,
        factors[0],
        floors[0],
        factors[1],
        floors[1],
        statistics.median(first_s),
        max(first_s),
    )


def _untrained(case: Case) -> StringModel[Any]:
    model = build_model(case.model, dict(case.sizes))
    physics = Physics(resonator_of(StringParameters(), case.modes), case.rate_hz)
    # modes decay one by one, and the integrated phase skips those that have; random eigenvalues would decay at once
    how = "averaging" if "averaging" in model.initialisations else model.own_initialisation()
    model.initialise(how, physics, torch.Generator().manual_seed(0))
    return model.eval()


def _products_per_s() -> float:
    size = 1024
    matrix = torch.ones(size, size)
    return 2 * size**3 / median_s(lambda: matrix @ matrix, 9)


def _written_per_s() -> float:
    source = torch.ones(2**24)
    target = torch.empty_like(source)
    return 4 * source.numel() / median_s(lambda: target.copy_(source), 9)
