"""The errors of models on strings of the family: on each string, over the whole of it."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import torch
from torch import Tensor

from engine.models import build_model
from engine.models.base import Physics, StringModel
from engine.resonators.family import inharmonicity
from training.family.motion import SCALE_M, Blocks, Player, linear_motion, motion_errors, of_many, untrained
from training.family.strings import Column, PluckedString, displacement_m, draw_string

LARGE = 1e-2  # relative squared error: above it one hears another string


@dataclass(frozen=True)
class StringError:
    """The error of one string and pluck.

    Attributes:
        inharmonicity: B, see `StringFamily`.
        tension_rise: ΔT/T₀ of the pluck.
        rel_mse: relative squared error over the grid.
        processor_s: the processor's time for a second of the whole string's motion.
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


def measure(
    players: dict[str, Player],
    column: Column,
    count: int,
    rate_hz: int,
    place: int = 0,
    *,
    window_s: float = 1.0,
    seed: int = 0,
    report: Callable[[float], None] = lambda share: None,
) -> dict[str, FamilyErrors]:
    """The errors of each player, by its name, on test strings within one window of time.

    Args:
        column: inside the family or beyond it.
        count: strings.
        place: of the window after the pluck, 0 for the first, 9 for the tenth.
        window_s: length of a window.
        report: receives the share that is done, 0 … 1.
    """
    window = round(window_s * rate_hz)
    errors_by_player: dict[str, list[StringError]] = {name: [] for name in players}
    for number in range(count):
        plucked = draw_string(column, "test", number, seed)
        whole, *windows = motion_errors(plucked, players, rate_hz, (place + 1) * window, window=window)
        sounds = windows[place].energy > plucked.unheard * window
        # the first fields of `StringError`
        facts = plucked.pitch_hz, inharmonicity(plucked.string), plucked.tension_rise, plucked.resonator.modes
        for name, of_player in errors_by_player.items():
            processor_s = whole.processor_s[name] / whole.stop_s
            of_player.append(StringError(*facts, windows[place].rel_mse[name], processor_s, sounds))
        report((number + 1) / count)
    return {name: FamilyErrors(tuple(errors)) for name, errors in errors_by_player.items()}


def player(model: StringModel[Any]) -> Player:
    """The player of strings by a model of many, by displacement on the grid. Raises ValueError: see `of_many`."""
    of_any = of_many(model)

    def play(plucked: PluckedString, rate_hz: int) -> Blocks:
        return rollout(of_any.for_resonator(Physics(plucked.resonator, rate_hz, SCALE_M)), plucked)

    return play


def averaging(plucked: PluckedString, rate_hz: int) -> Blocks:
    """The player by `koopman_integrated` as averaging over a period starts it, without networks or training."""
    sizes = {
        "state_size": plucked.resonator.modes,
        "encoder_widths": (),
        "eigenvalue_widths": (),
        "node_spacing": 160,  # samples
        "adiabatic": True,
        "second_order": True,
    }
    model = build_model("koopman_integrated", sizes)
    model.initialise("averaging", Physics(plucked.resonator, rate_hz, SCALE_M), torch.Generator().manual_seed(0))
    return rollout(model.eval(), plucked)


def knowing_physics() -> dict[str, Player]:
    """Untrained players by name: each knows the string, and more or less of what its tension does."""
    return {
        "kicks without corrections": player(untrained("kicks")),
        "backward error analysis (1/12)": player(untrained("series")),
        "averaging": averaging,
        "linear string": linear_motion,
    }


def rollout(model: StringModel[Any], plucked: PluckedString) -> Blocks:
    """The motion that a model predicts from a pluck's displacement on the grid; the grid's frames become modes."""
    state = model.encode((displacement_m(plucked)[None] / SCALE_M).to(torch.get_default_dtype()))

    def more(frames: int) -> Tensor:
        nonlocal state
        motion, state = model.advance(state, frames)
        return torch.from_numpy(plucked.resonator.to_modes(motion[0].double().numpy()) * SCALE_M)

    return more


def by_rise(errors: Sequence[StringError], edges: Sequence[float]) -> list[tuple[tuple[float, float], FamilyErrors]]:
    """The errors by range of the rise of tension: (low, high) in ΔT/T₀, and the errors of the strings there.

    A range includes its low end; the last one also its high end. Ranges without a string are left out.

    Args:
        edges: of the ranges, ascending.
    """
    groups = []
    for low, high in pairwise(edges):
        inside = tuple(
            one for one in errors if low <= one.tension_rise < high or one.tension_rise == high == edges[-1]
        )
        if inside:
            groups.append(((low, high), FamilyErrors(inside)))
    return groups
