"""Rendering a model: its real-time factor, and how soon after a pluck the first block is ready."""

from __future__ import annotations

import statistics
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from bench.machine import median_s, times_s
from engine.models import build_model
from engine.models.base import Physics, StringModel
from engine.pluck import DEFAULT_LISTEN, Pluck
from engine.resonators.sine_transform import listening_weights
from engine.resonators.string import resonator_of
from engine.values.string import StringParameters
from training.cli.console import ProgressReport

FIRST_BLOCK = 256  # frames
AUDIO_S = 2.0
PLUCKS = 25  # whose first block is timed
SCALE_M = 1e-3  # of the order of a data set's
RATES = ((4_000, 10), (16_000, 25))  # the paper's, in Hz, and how many modes
CASES: tuple[tuple[str, int, int, dict[str, int]], ...] = (  # sizes: those that are not the paper's
    *((name, *rate, {}) for name in ("dmd", "koopman", "koopman_var", "lru", "s5") for rate in RATES),
    *(("koopman_integrated", *rate, {"state_size": rate[1]}) for rate in (*RATES, (48_000, 57))),
    ("fgru", 4_000, 10, {}),
    ("frnn", 4_000, 10, {}),
)


@dataclass(frozen=True)
class RenderTiming:
    """The times of a model on one thread.

    Attributes:
        grid, point: real-time factors, seconds of work for a second of sound (below 1: faster than real time), for
            the whole grid and for one listening point.
        first_block_s, worst_first_block_s: from the pluck to 256 samples on the whole grid, median and worst.
    """

    model: str
    rate_hz: int
    modes: int
    grid: float
    point: float
    first_block_s: float
    worst_first_block_s: float


def measure(report: ProgressReport) -> dict[str, Any]:
    """Measure every model, untrained, as its cost does not depend on its weights."""
    found = []
    for number, (name, rate_hz, modes, sizes) in enumerate(CASES):
        report(number / len(CASES), f"{name} {rate_hz} Hz")
        model = _untrained(name, rate_hz, modes, sizes)
        pluck = torch.from_numpy(Pluck().displacement(model.grid_points) / SCALE_M).float()[None]
        point = torch.from_numpy(listening_weights(np.array([DEFAULT_LISTEN]), model.grid_points)).float()
        samples = round(AUDIO_S * rate_hz)
        with torch.inference_mode():
            grid, heard = (
                median_s(lambda m=model, p=pluck, n=samples, r=readout: m(p, n, r)) / AUDIO_S  # type: ignore[misc]
                for readout in (None, point)
            )
            first_s = times_s(lambda m=model, p=pluck: m(p, FIRST_BLOCK), PLUCKS)  # type: ignore[misc]
        found.append(RenderTiming(name, rate_hz, modes, grid, heard, statistics.median(first_s), max(first_s)))
    return {"models": tuple(found)}


def _untrained(name: str, rate_hz: int, modes: int, sizes: dict[str, int]) -> StringModel[Any]:
    model = build_model(name, dict(sizes))
    physics = Physics(resonator_of(StringParameters(), modes), rate_hz)
    # modes decay one by one, and the integrated phase skips those that have; random eigenvalues would decay at once
    how = "averaging" if "averaging" in model.initialisations else model.own_initialisation()
    model.initialise(how, physics, torch.Generator().manual_seed(0))
    return model.eval()
