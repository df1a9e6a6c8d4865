"""Rendering a model: how much faster than real time, and how soon after a pluck the first block is ready."""

from __future__ import annotations

import statistics
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from app.bench.machine import Machine, median_s, one_thread, times_s
from engine.models import MODELS, StringModel
from engine.pluck import DEFAULT_LISTEN, Pluck
from engine.sine_transform import listening_weights
from training.configuration import DatasetConfiguration, Recipe, TrainingConfiguration
from training.fit import new_model

STRINGS = ((4_000, 10), (16_000, 25))  # the paper's rates in Hz and modes
FIRST_BLOCK = 256
AUDIO_S = 2.0
PLUCKS = 25
SCALE_M = 1e-3  # of the order of a data set's


@dataclass(frozen=True)
class RenderTiming:
    """One model on one thread. A real-time factor above 1 is faster than the string sounds.

    Attributes:
        grid_factor, point_factor: for the whole grid, and for one listening point.
        first_block_s, worst_first_block_s: from the pluck to 256 samples on the whole grid, median and worst.
    """

    model: str
    rate_hz: int
    grid_factor: float
    point_factor: float
    first_block_s: float
    worst_first_block_s: float


@dataclass(frozen=True)
class RenderBenchmark:
    machine: Machine
    models: tuple[RenderTiming, ...]


def measure(report: Callable[[float, str], None]) -> RenderBenchmark:
    """Every model at the paper's size, untrained: its values do not matter to its cost."""
    found = []
    with one_thread(), torch.inference_mode():
        machine = Machine.here()
        cases = [(name, rate_hz, modes) for name in MODELS for rate_hz, modes in STRINGS]
        for number, (name, rate_hz, modes) in enumerate(cases):
            report(number / len(cases), f"{name} {rate_hz} Hz")
            found.append(_measure(name, rate_hz, modes))
    return RenderBenchmark(machine, tuple(found))


def _measure(name: str, rate_hz: int, modes: int) -> RenderTiming:
    model = _untrained(name, rate_hz, modes)
    pluck = (Pluck().displacement(model.grid_points) / SCALE_M).float()[None]
    point = listening_weights(torch.tensor([DEFAULT_LISTEN]), model.grid_points).float()
    samples = round(AUDIO_S * rate_hz)

    def factor(readout: Tensor | None) -> float:
        return AUDIO_S / median_s(lambda: model(pluck, samples, readout), 5)

    first_s = times_s(lambda: model(pluck, FIRST_BLOCK), PLUCKS)
    return RenderTiming(name, rate_hz, factor(None), factor(point), statistics.median(first_s), max(first_s))


def _untrained(name: str, rate_hz: int, modes: int) -> StringModel[Any]:
    data = DatasetConfiguration(initial="gaussian", rate_hz=rate_hz, modes=modes)
    return new_model(TrainingConfiguration("benchmark", name, data, Recipe(epochs=1))).eval()
