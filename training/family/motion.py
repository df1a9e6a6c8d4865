"""The motion of a string or a drum from its release on: the truth, models of many strings, and their errors.

It is one equation, in one dimension or in two.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor

from engine.models import build_model
from engine.models.base import Physics, StringModel
from engine.models.koopman_tension import SERIES, KoopmanTension
from engine.resonators.base import Array, Resonator
from engine.truth import ModalState, SplittingSolver, default_substeps

SCALE_M = 1e-3  # a model's unit of displacement
UNHEARD = 1e-18  # share of the squares at the release: a motion that has fallen below it counts as silent
AT_ONCE = 1_200  # frames of a block; with 1,600 modes they are 15 MB
# times fewer sub-steps than a data set has: 1e-12 of the energy off after a second, inside the family
SUBSTEP_DIVISOR = 3


@dataclass(frozen=True, eq=False)
class Released:
    """A string or a drum with all its modes, and a start of it.

    Attributes:
        amplitudes_m, speeds_m_s: of the modes at the start, float64 (modes,).
        weight: of the squares of amplitudes in the mean square over the string or surface, (modes,).
        tension_rise: ΔT/T₀ that the start would reach, if all of it were displacement.
    """

    silence: ClassVar = 0.0  # share of the amplitude of all modes, below which the highest is left out; 0: none is

    resonator: Resonator
    amplitudes_m: Array
    speeds_m_s: Array
    weight: Array
    tension_rise: float

    @property
    def pitch_hz(self) -> float:
        return float(self.resonator.omega[0]) / (2 * math.pi)

    @property
    def state(self) -> ModalState:
        """Amplitudes in m and speeds in m/s at the start, float64 (1, modes) each."""
        return ModalState(*(torch.from_numpy(part)[None] for part in (self.amplitudes_m, self.speeds_m_s)))

    @property
    def unheard(self) -> float:
        """The weighted sum of squared amplitudes in m² of a frame that is just silent: `UNHEARD` of the start's."""
        size = np.square(self.amplitudes_m) + np.square(self.speeds_m_s / self.resonator.omega)
        return UNHEARD * float(size @ self.weight)


# Each call with a number of frames gives the next ones, modal amplitudes (frames, modes) in m. The first call begins
# one sample after the start, which is no frame itself.
Blocks = Callable[[int], Tensor]
# from what is `Released`, and a rate in Hz, to its motion
Player = Callable[[Any, int], Blocks]


def true_motion(released: Released, rate_hz: int) -> Blocks:
    """The true motion by the solver (a splitting of exact flows and kicks), from one sample after the start."""
    resonator, state = released.resonator, released.state
    substeps = max(1, -(-default_substeps(resonator, rate_hz) // SUBSTEP_DIVISOR))
    solver = SplittingSolver(resonator, rate_hz, substeps=substeps, silence=released.silence)
    return _blocks(solver.advance, state)


def linear_motion(released: Released, rate_hz: int) -> Blocks:
    """The exact motion without tension modulation, as a baseline that every model should be far better than."""
    uncoupled = replace(released.resonator, coupling=np.zeros_like(released.resonator.coupling))
    return true_motion(replace(released, resonator=uncoupled), rate_hz)


def model_player(model: StringModel[Any]) -> Player:
    """The player by a model of many strings, for strings and drums alike. Raises ValueError: see `of_many`.

    It sets out from the modes' amplitudes and speeds; `errors.player` sets out from displacement on a grid.
    """
    of_any = of_many(model)

    def play(released: Released, rate_hz: int) -> Blocks:
        played = of_any.for_resonator(Physics(released.resonator, rate_hz, SCALE_M))
        state = released.state
        start = played.encode_modes(state.amplitude / SCALE_M, state.velocity / SCALE_M / rate_hz)
        return _blocks(played.advance_modes, start, SCALE_M)

    return play


def untrained_player(how: str) -> Player:
    """The player by `koopman_tension` as its start of this name leaves it."""
    return model_player(untrained(how))


def of_many(model: StringModel[Any]) -> KoopmanTension:
    """Return a model of many strings. Raises ValueError: it learned one string, which its weights are."""
    if not isinstance(model, KoopmanTension):
        raise ValueError("its model knows the one string that it learned; choose a preset of many strings")
    return model


def untrained(how: str) -> KoopmanTension:
    """`koopman_tension` before training, without a string; `how`: the name of its start, "kicks" or "series"."""
    model = of_many(build_model("koopman_tension", {"modes": 1, "grid_points": 1}))
    if how == "series":
        with torch.no_grad():
            model.r[0] = model.p[0] = SERIES
    return model.eval()


def _blocks(advance: Callable[[Any, int], tuple[Any, Any]], state: Any, scale: float = 1.0) -> Blocks:
    """The motion from a state on.

    Args:
        advance: from a state and a number of frames to these frames (1, frames, modes) and the state after them.
        scale: m in a unit of its amplitudes.
    """

    def more(frames: int) -> Tensor:
        nonlocal state
        motion, state = advance(state, frames)
        return motion[0] * scale

    return more


@dataclass(frozen=True)
class Window:
    """The errors between two times, counted from the start.

    Attributes:
        energy: weighted sum of the true squared amplitudes of its frames, in m², which errors are relative to.
        rel_mse: by player; inf: the motion is not finite; nan: the truth has no energy there.
        processor_s: time of the processor that each player took for it.
    """

    start_s: float
    stop_s: float
    energy: float
    rel_mse: Mapping[str, float]
    processor_s: Mapping[str, float]


@torch.inference_mode()
def motion_errors(
    released: Released,
    players: Mapping[str, Player],
    rate_hz: int,
    frames: int,
    report: Callable[[float], None] = lambda share: None,
    *,
    window: int | None = None,
) -> list[Window]:
    """The errors of players over the first `frames` of a motion.

    Args:
        report: receives the share that is done, 0 … 1.
        window: frames of a window; None: a second of them. The last window may be shorter.

    Returns:
        One `Window` over all frames, then each window by itself.
    """
    true, weight = true_motion(released, rate_hz), torch.from_numpy(released.weight)
    playing = [play(released, rate_hz) for play in players.values()]
    edges = [*range(0, frames, window or rate_hz), frames]
    energy = np.zeros(len(edges) - 1)  # (windows,)
    wrong, spent = np.zeros((2, len(edges) - 1, len(players)))  # squared errors, seconds: (windows, players)
    for part, (first, stop) in enumerate(pairwise(edges)):
        for begin in range(first, stop, AT_ONCE):
            count = min(AT_ONCE, stop - begin)
            expected = true(count)
            energy[part] += float((expected.square() @ weight).sum())
            for place, more in enumerate(playing):
                begun = time.process_time()
                motion = more(count)
                spent[part, place] += time.process_time() - begun
                wrong[part, place] += float(((motion - expected).square() @ weight).sum())
            report((begin + count) / frames)

    def window_of(first: int, stop: int, of: slice) -> Window:
        whole = float(energy[of].sum())
        errors = [sums / whole if whole else math.nan for sums in wrong[of].sum(0).tolist()]
        errors = [math.inf if whole and not math.isfinite(error) else error for error in errors]
        by_player = (dict(zip(players, sums, strict=True)) for sums in (errors, spent[of].sum(0).tolist()))
        return Window(first / rate_hz, stop / rate_hz, whole, *by_player)

    parts = [window_of(*ends, slice(place, place + 1)) for place, ends in enumerate(pairwise(edges))]
    return [window_of(0, frames, slice(None)), *parts]
