"""The fast solver: its speed and its error, both against DOP853 on the paper's protocol."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import torch

from engine.compare.relative import error_to_signal
from engine.pluck import Pluck
from engine.resonators.string import resonator_of
from engine.sources import SILENCE
from engine.truth import ModalState, SplittingSolver, solve_dop853
from engine.values.string import StringParameters
from tests.bench.machine import Machine, median_s, one_thread
from training.configuration import DatasetConfiguration
from training.data.dataset import draw_initial

PROTOCOL = tuple(
    DatasetConfiguration(initial=initial, rate_hz=rate_hz, modes=modes)
    for rate_hz, modes in ((16_000, 25), (4_000, 10))
    for initial in ("gaussian", "noise")
)
LOOSE_ERROR = 1e-6  # an inaudible error (-120 dB), of which the fewest sub-steps are found
AUDIO_RATE_HZ = 48_000
HIGHEST_AUDIBLE_HZ = 20_000
AUDIO_S = 0.25


@dataclass(frozen=True)
class SolverTiming:
    """One of the paper's data sets: cost, and error on its trajectory with the largest tension rise.

    Attributes:
        relative_l2: the error with the default sub-steps.
        fast_s, dop853_s: seconds per trajectory; `fast_s` in a batch on all threads.
        loose_substeps: the fewest sub-steps with an error of at most 1e-6, with their error and cost.
    """

    initial: str
    rate_hz: int
    modes: int
    steps: int
    batch: int
    tension_rise: float
    substeps: int
    relative_l2: float
    fast_s: float
    dop853_s: float
    loose_substeps: int
    loose_relative_l2: float
    loose_fast_s: float

    @property
    def speed_up(self) -> float:
        return self.dop853_s / self.fast_s


@dataclass(frozen=True)
class AudioTiming:
    """One string with all audible modes on one thread; a factor below 1 is faster than real time.

    Attributes:
        silence: the share of the whole below which a mode is left out, as when playing; 0 leaves out none.
        relative_l2: the error that this makes.
    """

    rate_hz: int
    modes: int
    substeps: int
    silence: float
    relative_l2: float
    real_time_factor: float


@dataclass(frozen=True)
class SolverBenchmark:
    machine: Machine
    protocol: tuple[SolverTiming, ...]
    audio: tuple[AudioTiming, ...]


def measure(batch: int, steps: int, report: Callable[[float, str], None]) -> SolverBenchmark:
    """Measure the solver. `batch`: trajectories at once for the speed; `steps`: samples of each."""
    protocol = []
    for number, data in enumerate(PROTOCOL):
        report(number / (len(PROTOCOL) + 1), f"{data.initial} {data.rate_hz} Hz")
        protocol.append(_measure_protocol(replace(data, steps=steps), batch))
    report(len(PROTOCOL) / (len(PROTOCOL) + 1), "48 kHz")
    default = _measure_audio(None)
    others = _measure_audio(max(1, default.substeps // 4)), _measure_audio(None, SILENCE)
    return SolverBenchmark(Machine.here(), tuple(protocol), (default, *others))


def _measure_protocol(data: DatasetConfiguration, batch: int) -> SolverTiming:
    drawn = draw_initial(data)
    rise, initial = data.resonator.relative_tension_rise(drawn), torch.from_numpy(drawn)
    worst = ModalState.at_rest(initial[rise.argmax()][None])
    started = time.perf_counter()
    truth = solve_dop853(data.resonator, worst, data.rate_hz, data.steps)
    dop853_s = time.perf_counter() - started

    def error(substeps: int) -> float:
        return math.sqrt(error_to_signal(_solver(data, substeps).solve(worst, data.steps), truth))

    def cost_s(substeps: int) -> float:
        solver, state = _solver(data, substeps), ModalState.at_rest(initial[:batch])
        # no warm-up: `error` has run the solver before
        return median_s(lambda: solver.solve(state, data.steps), 3, warm_up=False) / len(state.amplitude)

    default = _solver(data, None).substeps
    loose = default
    while loose > 1 and error(loose - 1) <= LOOSE_ERROR:
        loose -= 1
    return SolverTiming(
        data.initial,
        data.rate_hz,
        data.modes,
        data.steps,
        min(batch, data.count),
        float(rise.max()),
        default,
        error(default),
        cost_s(default),
        dop853_s,
        loose,
        error(loose),
        cost_s(loose),
    )


def _solver(data: DatasetConfiguration, substeps: int | None) -> SplittingSolver:
    return SplittingSolver(data.resonator, data.rate_hz, substeps=substeps)


def _measure_audio(substeps: int | None, silence: float = 0.0) -> AudioTiming:
    string = StringParameters()
    modes = string.modes_below(HIGHEST_AUDIBLE_HZ)
    resonator = resonator_of(string, modes, grid_points=modes + 2)
    state = ModalState.at_rest(torch.from_numpy(resonator.to_modes(Pluck().displacement(modes + 2)[None])))
    samples = math.ceil(AUDIO_S * AUDIO_RATE_HZ)
    whole, solver = (
        SplittingSolver(resonator, AUDIO_RATE_HZ, substeps=substeps, silence=share) for share in (0.0, silence)
    )
    error = math.sqrt(error_to_signal(solver.solve(state, samples), whole.solve(state, samples)))
    with one_thread():
        taken_s = median_s(lambda: solver.advance(state, samples), 3)
    factor = taken_s * AUDIO_RATE_HZ / samples
    return AudioTiming(AUDIO_RATE_HZ, modes, solver.substeps, silence, error, factor)
