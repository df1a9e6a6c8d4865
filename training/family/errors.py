"""How well models play strings of the family: the error on each string, over the whole of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from engine.averaging import slow_flow
from engine.models import KoopmanIntegrated, StringModel, build_model
from engine.models.base import Physics
from training.family.motions import solve, true_motion
from training.family.strings import Column, PluckedString, displacement_m, draw_string

# modal amplitudes (steps, modes) in m of a string, at a rate
Player = Callable[[PluckedString, int, int], Tensor]
LARGE = 1e-2  # an error that is heard as another string
UNHEARD = 1e-18  # of the energy at the pluck: an error below that of a string that has fallen so far is none
SCALE_M = 1e-3


@dataclass(frozen=True)
class StringError:
    """Of one string and pluck: relative squared error over the grid."""

    pitch_hz: float
    inharmonicity: float
    tension_rise: float
    modes: int
    rel_mse: float


@dataclass(frozen=True)
class FamilyErrors:
    """Of many strings, one at least."""

    strings: tuple[StringError, ...]

    @property
    def geometric_mean(self) -> float:
        return math.exp(sum(math.log(max(one.rel_mse, 1e-300)) for one in self.strings) / len(self.strings))

    @property
    def worst(self) -> StringError:
        return max(self.strings, key=lambda one: one.rel_mse)

    @property
    def share_large(self) -> float:
        """Of the strings, above `LARGE`."""
        return sum(one.rel_mse > LARGE for one in self.strings) / len(self.strings)


@torch.inference_mode()
def measure(
    players: dict[str, Player],
    column: Column,
    split: str,
    count: int,
    rate_hz: int,
    seconds: tuple[float, float],
    *,
    cache: Path | None = None,
    seed: int = 0,
    report: Callable[[float], None] = lambda share: None,
) -> dict[str, FamilyErrors]:
    """The errors of each player from one time to another after the pluck.

    Args:
        cache: where true motions are kept; None: they are not.
    """
    first, last = (round(edge * rate_hz) for edge in seconds)
    found: dict[str, list[StringError]] = {name: [] for name in players}
    for number in range(count):
        plucked = draw_string(column, split, number, seed)
        truth = (solve(plucked, rate_hz, last) if cache is None else true_motion(plucked, rate_hz, last, cache))[
            first:
        ]
        unheard = UNHEARD * float(plucked.amplitudes_m.square().sum()) * len(truth)
        for name, play in players.items():
            wrong = play(plucked, rate_hz, last)[first:] - truth
            error = float(wrong.square().sum() / max(float(truth.square().sum()), unheard))
            told = (plucked.pitch_hz, plucked.inharmonicity, plucked.tension_rise, plucked.resonator.modes)
            found[name].append(StringError(*told, error if math.isfinite(error) else math.inf))
        report((number + 1) / count)
    return {name: FamilyErrors(tuple(errors)) for name, errors in found.items()}


def player(model: StringModel[Any]) -> Player:
    """A model of many strings."""

    def play(plucked: PluckedString, rate_hz: int, steps: int) -> Tensor:
        own = model.tuned(Physics(plucked.resonator, rate_hz, SCALE_M))
        return _played(own, plucked, steps)

    return play


def linear_string(plucked: PluckedString, rate_hz: int, steps: int) -> Tensor:
    """The string without tension modulation: what all errors are large beside."""
    times = torch.arange(1, steps + 1, dtype=torch.float64)[:, None] / rate_hz
    eigenvalues = plucked.resonator.eigenvalues()
    sine = -eigenvalues.real / eigenvalues.imag
    angle = times * eigenvalues.imag
    return plucked.amplitudes_m * torch.exp(times * eigenvalues.real) * (angle.cos() + sine * angle.sin())


def averaging(plucked: PluckedString, rate_hz: int, steps: int) -> Tensor:
    """`koopman_integrated` as averaging over a period starts it, without networks and without training."""
    sizes = {
        "state_size": plucked.resonator.modes,
        "encoder_widths": (),
        "eigenvalue_widths": (),
        "node_spacing": 160,
        "modulation": True,
        "adiabatic": True,
        "physical_units": True,
        "second_order": True,
    }
    model = build_model("koopman_integrated", sizes)
    assert isinstance(model, KoopmanIntegrated)
    physics = Physics(plucked.resonator, rate_hz, SCALE_M)
    model.initialise("averaging", physics, torch.Generator().manual_seed(0))
    return _played(model.eval(), plucked, steps)


def averaged_flow(plucked: PluckedString, rate_hz: int, steps: int) -> Tensor:
    """`engine.averaging.slow_flow`: averaging to third order, in which modes trade energy."""
    return slow_flow(plucked.resonator, plucked.amplitudes_m, rate_hz, steps)


def untrained(how: str) -> Player:
    """`koopman_tension` as a start of its own leaves it."""
    model = build_model("koopman_tension", {})
    for curve in model.parameters():
        torch.nn.init.zeros_(curve)
    if how == "series":
        from engine.models.koopman_tension import SERIES

        with torch.no_grad():
            state = model.state_dict()
            state["r"][0] = state["p"][0] = SERIES
            model.load_state_dict(state)
    return player(model.eval())


def _played(model: StringModel[Any], plucked: PluckedString, steps: int) -> Tensor:
    displacement = (displacement_m(plucked)[None] / SCALE_M).to(torch.get_default_dtype())
    state, blocks, done = model.release(displacement), [], 0
    while done < steps:
        count = min(4_800, steps - done)
        frames, state = model.advance(state, count)
        blocks.append(plucked.resonator.to_modes(frames[0].double()) * SCALE_M)
        done += count
    return torch.cat(blocks)


def by_rise(errors: Sequence[StringError], edges: Sequence[float]) -> list[tuple[float, float, FamilyErrors]]:
    """In ranges of the rise of tension, those that hold strings."""
    found = []
    for low, high in pairwise(edges):
        inside = tuple(one for one in errors if low <= one.tension_rise < high)
        if inside:
            found.append((low, high, FamilyErrors(inside)))
    return found
