"""The errors of models on strings of the family: on each string, over the whole of it."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import torch
from torch import Tensor

from engine.compare.relative import error_to_signal
from engine.models import build_model
from engine.models.base import Physics, StringModel
from engine.models.koopman_tension import SERIES, KoopmanTension
from training.family.strings import Column, PluckedString, displacement_m, draw_string, solve

# modal amplitudes (steps, modes) in m of a string, at a rate
Player = Callable[[PluckedString, int, int], Tensor]
LARGE = 1e-2  # an error that is heard as another string
UNHEARD = 1e-18  # of the energy at the pluck: an error below that of a string that has fallen so far is none
SCALE_M = 1e-3
FRAMES_AT_ONCE = 4_800


@dataclass(frozen=True)
class StringError:
    """The error of one string and pluck.

    Attributes:
        rel_mse: relative squared error over the grid.
        processor_s: for a second of the whole string's motion.
        sounds: whether the string still moves, by the limit `UNHEARD`.
    """

    pitch_hz: float
    inharmonicity: float
    tension_rise: float
    modes: int
    rel_mse: float
    processor_s: float = 0.0
    sounds: bool = True


@dataclass(frozen=True)
class FamilyErrors:
    """The errors of many strings, one at least."""

    strings: tuple[StringError, ...]

    @property
    def geometric_mean(self) -> float:
        return geometric_mean(one.rel_mse for one in self.strings)

    @property
    def worst(self) -> StringError:
        return max(self.strings, key=lambda one: one.rel_mse)

    @property
    def processor_s(self) -> float:
        """The processor's time for a second of motion: the median of the strings."""
        return statistics.median(one.processor_s for one in self.strings)

    @property
    def share_large(self) -> float:
        """The share of the strings with errors above `LARGE`."""
        return sum(one.rel_mse > LARGE for one in self.strings) / len(self.strings)


def geometric_mean(errors: Iterable[float]) -> float:
    logarithms = [math.log(max(error, 1e-300)) for error in errors]
    return math.exp(sum(logarithms) / len(logarithms))


@torch.inference_mode()
def measure(
    players: dict[str, Player],
    column: Column,
    split: str,
    count: int,
    rate_hz: int,
    seconds: tuple[float, float],
    *,
    seed: int = 0,
    report: Callable[[float], None] = lambda share: None,
) -> dict[str, FamilyErrors]:
    """The errors of each player from one time to another after the pluck."""
    first, last = (round(edge * rate_hz) for edge in seconds)
    errors_by_player: dict[str, list[StringError]] = {name: [] for name in players}
    for number in range(count):
        plucked = draw_string(column, split, number, seed)
        truth = solve(plucked, rate_hz, last)[first:]
        unheard = UNHEARD * float(plucked.amplitudes_m.square().sum()) * len(truth)
        for name, play in players.items():
            started = time.process_time()
            played = play(plucked, rate_hz, last)
            processor_s = (time.process_time() - started) * rate_hz / last
            error = error_to_signal(played[first:], truth, unheard)
            sounds = float(truth.square().sum()) > unheard
            reported = (plucked.pitch_hz, plucked.inharmonicity, plucked.tension_rise, plucked.resonator.modes)
            errors_by_player[name].append(StringError(*reported, error, processor_s, sounds))
        report((number + 1) / count)
    return {name: FamilyErrors(tuple(errors)) for name, errors in errors_by_player.items()}


def player(model: StringModel[Any]) -> Player:
    """The player of strings by a model of many. Raises ValueError: see `of_many`."""
    of_any = of_many(model)

    def play(plucked: PluckedString, rate_hz: int, steps: int) -> Tensor:
        return rollout(of_any.for_resonator(Physics(plucked.resonator, rate_hz, SCALE_M)), plucked, steps)

    return play


def of_many(model: StringModel[Any]) -> KoopmanTension:
    """Return a model of many strings. Raises ValueError: it learned one string, which its weights are."""
    if not isinstance(model, KoopmanTension):
        raise ValueError("its model knows the one string that it learned; choose a preset of many strings")
    return model


def untrained(how: str) -> KoopmanTension:
    """`koopman_tension` as its start of this name leaves it, without a string."""
    model = of_many(build_model("koopman_tension", {"modes": 1, "grid_points": 1}))
    if how == "series":
        with torch.no_grad():
            model.r[0] = model.p[0] = SERIES
    return model.eval()


def linear_string(plucked: PluckedString, rate_hz: int, steps: int) -> Tensor:
    """The player of strings without tension modulation: what all errors are large beside."""
    times = torch.arange(1, steps + 1, dtype=torch.float64)[:, None] / rate_hz
    eigenvalues = torch.from_numpy(plucked.resonator.eigenvalues())
    sine = -eigenvalues.real / eigenvalues.imag
    angle = times * eigenvalues.imag
    return plucked.amplitudes_m * torch.exp(times * eigenvalues.real) * (angle.cos() + sine * angle.sin())


def averaging(plucked: PluckedString, rate_hz: int, steps: int) -> Tensor:
    """The player by `koopman_integrated` as averaging over a period starts it, without networks or training."""
    sizes = {
        "state_size": plucked.resonator.modes,
        "encoder_widths": (),
        "eigenvalue_widths": (),
        "node_spacing": 160,
        "adiabatic": True,
        "second_order": True,
    }
    model = build_model("koopman_integrated", sizes)
    model.initialise("averaging", Physics(plucked.resonator, rate_hz, SCALE_M), torch.Generator().manual_seed(0))
    return rollout(model.eval(), plucked, steps)


def knowing_physics() -> dict[str, Player]:
    """Untrained players by name: each knows the string, and more or less of what its tension does."""
    return {
        "kicks without corrections": player(untrained("kicks")),
        "backward error analysis (1/12)": player(untrained("series")),
        "averaging": averaging,
        "linear string": linear_string,
    }


def rollout(model: StringModel[Any], plucked: PluckedString, steps: int) -> Tensor:
    displacement = (displacement_m(plucked)[None] / SCALE_M).to(torch.get_default_dtype())
    state = model.encode(displacement)
    blocks = []
    for done in range(0, steps, FRAMES_AT_ONCE):
        frames, state = model.advance(state, min(FRAMES_AT_ONCE, steps - done))
        blocks.append(torch.from_numpy(plucked.resonator.to_modes(frames[0].double().numpy()) * SCALE_M))
    return torch.cat(blocks)


def by_rise(errors: Sequence[StringError], edges: Sequence[float]) -> list[tuple[tuple[float, float], FamilyErrors]]:
    """The errors in ranges of the rise of tension.

    The last has both ends, and ranges without a string are left out.
    """
    groups = []
    for low, high in pairwise(edges):
        inside = tuple(
            one for one in errors if low <= one.tension_rise < high or one.tension_rise == high == edges[-1]
        )
        if inside:
            groups.append(((low, high), FamilyErrors(inside)))
    return groups
