"""Drums whose motion models of many strings play, and their errors: the same equation in two dimensions."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from torch import Tensor

from engine.models import build_model
from engine.models.base import Physics, StringModel
from engine.models.koopman_tension import KoopmanTension
from engine.resonators.base import Array, Resonator
from engine.resonators.drum import DrumParameters
from engine.truth import ModalState, SplittingSolver
from training.family.errors import SCALE_M
from training.family.motions import substeps_of

SILENCE = 1e-10  # of a mode, of all: the solver leaves it out
AT_ONCE = 1_200  # frames; 1,600 modes of them are 15 MB


@dataclass(frozen=True, eq=False)
class StruckDrum:
    """Modes of a drum, and a start of it.

    Attributes:
        amplitudes_m, speeds_m_s: mass-normalised, (modes,).
        weight: of the squares of amplitudes in the mean square over the surface, (modes,).
        tension_rise: ΔT/T₀ that the start would reach, if all of it were displacement.
    """

    kind: str
    drum: DrumParameters
    resonator: Resonator
    amplitudes_m: Array
    speeds_m_s: Array
    weight: Array
    tension_rise: float

    @property
    def pitch_hz(self) -> float:
        return float(self.resonator.omega[0]) / (2 * math.pi)


# each call gives the next frames, (frames, modes) in m
Blocks = Callable[[int], Tensor]
DrumPlayer = Callable[[StruckDrum, int], Blocks]


def true_motion(struck: StruckDrum, rate_hz: int) -> Blocks:
    """By the solver."""
    return _solved(struck.resonator, struck, rate_hz)


def linear_drum(struck: StruckDrum, rate_hz: int) -> Blocks:
    """Without tension modulation, exactly."""
    return _solved(replace(struck.resonator, coupling=np.zeros_like(struck.resonator.coupling)), struck, rate_hz)


def _solved(resonator: Resonator, struck: StruckDrum, rate_hz: int) -> Blocks:
    solver = SplittingSolver(resonator, rate_hz, substeps=substeps_of(resonator, rate_hz), silence=SILENCE)
    state = ModalState(*(torch.from_numpy(part)[None] for part in (struck.amplitudes_m, struck.speeds_m_s)))

    def more(frames: int) -> Tensor:
        nonlocal state
        found, state = solver.advance(state, frames)
        return found[0]

    return more


def model_player(model: StringModel[Any]) -> DrumPlayer:
    """What was learned of strings, on drums. Raises ValueError: it learned one string, which its weights are."""
    if not isinstance(model, KoopmanTension):
        raise ValueError("its model knows the one string that it learned; choose a preset of many strings")

    def play(struck: StruckDrum, rate_hz: int) -> Blocks:
        own = model.for_resonator(Physics(struck.resonator, rate_hz, SCALE_M))
        q, v = (torch.from_numpy(part)[None] / SCALE_M for part in (struck.amplitudes_m, struck.speeds_m_s))
        state = own.encode_modes(q, v / rate_hz)

        def more(frames: int) -> Tensor:
            nonlocal state
            found, state = own.advance_modes(state, frames)
            return found[0] * SCALE_M

        return more

    return play


def untrained_player(how: str) -> DrumPlayer:
    """`koopman_tension` as its start of this name leaves it."""
    model = build_model("koopman_tension", {"modes": 1, "grid_points": 1})
    assert isinstance(model, KoopmanTension)
    if how == "series":
        from engine.models.koopman_tension import SERIES

        with torch.no_grad():
            model.r[0] = model.p[0] = SERIES
    return model_player(model)


@dataclass(frozen=True)
class Window:
    """Relative squared errors over the surface between two times, by player."""

    start_s: float
    stop_s: float
    rel_mse: Mapping[str, float]


@torch.inference_mode()
def motion_errors(
    struck: StruckDrum,
    players: Mapping[str, DrumPlayer],
    rate_hz: int,
    frames: int,
    report: Callable[[float], None] = lambda share: None,
) -> list[Window]:
    """The errors of players over the first frames: in all, then in each second."""
    true, weight = true_motion(struck, rate_hz), torch.from_numpy(struck.weight)
    playing = {name: play(struck, rate_hz) for name, play in players.items()}
    wrong: dict[str, list[float]] = {name: [] for name in players}
    energy: list[float] = []
    edges = [*range(0, frames, rate_hz), frames]
    for first, stop in pairwise(edges):
        for series in (energy, *wrong.values()):
            series.append(0.0)
        for begin in range(first, stop, AT_ONCE):
            count = min(AT_ONCE, stop - begin)
            expected = true(count)
            energy[-1] += float((expected.square() @ weight).sum())
            for name, more in playing.items():
                wrong[name][-1] += float(((more(count) - expected).square() @ weight).sum())
            report((begin + count) / frames)

    def window(first: int, stop: int, seconds: slice) -> Window:
        whole = sum(energy[seconds])
        errors = {name: finite(sum(each[seconds]) / whole) if whole else math.nan for name, each in wrong.items()}
        return Window(first / rate_hz, stop / rate_hz, errors)

    parts = [window(*ends, slice(place, place + 1)) for place, ends in enumerate(pairwise(edges))]
    return [window(0, frames, slice(None)), *parts]


def finite(error: float) -> float:
    return float(error) if math.isfinite(error) else math.inf
