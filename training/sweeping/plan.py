"""The plan of a sweep, as committed data: `plans/NAME.toml`.

Blocks stand in the order of their value. Within one the seeds come first, so that every cell is there once before any
is there twice; then the non-linear string before the linear one, and the short horizon before the long.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any, Literal

from engine import bounds
from engine.schema import SchemaError, read, read_toml
from training.cell import RECIPE, Cell, Initial, configuration_of
from training.configuration import Run

PLANS = Path(__file__).parent / "plans"
LISTS = ("models", "strings", "initials", "rates_hz", "horizons", "seeds")


@dataclass(frozen=True)
class CellBlock:
    """Cells: the product of what is listed.

    Attributes:
        strings: kinds of string.
        initials: random shapes that strings are released from.
        horizons: frames that are trained.
        recipe: of all its cells, see `Cell`.
    """

    models: tuple[str, ...]
    strings: tuple[Literal["linear", "nonlinear"], ...]
    initials: tuple[Initial, ...]
    rates_hz: tuple[int, ...]
    horizons: tuple[int, ...]
    seeds: tuple[int, ...] = (0,)
    recipe: str = RECIPE

    def __post_init__(self) -> None:
        for name in LISTS:
            if not getattr(self, name):
                raise ValueError(f"{name} is empty; name at least one, or remove the block")
        if self.count > bounds.MOST_RUNS:
            raise ValueError(f"a block of {self.count} cells is too large, at most {bounds.MOST_RUNS} may be")
        list(self.cells())  # a cell that cannot be is reported here

    @property
    def count(self) -> int:
        """The number of its cells."""
        return math.prod(len(getattr(self, name)) for name in LISTS)

    def cells(self) -> Iterator[Cell]:
        """The cells in order of value; see the module."""
        strings, horizons = sorted(self.strings, reverse=True), sorted(self.horizons)  # non-linear, linear
        places = product(self.seeds, strings, horizons, self.models, self.initials, self.rates_hz)
        for seed, string, horizon, model, initial, rate_hz in places:
            yield Cell(model, string == "nonlinear", initial, rate_hz, horizon, self.recipe, seed)


@dataclass(frozen=True)
class Plan:
    """Runs in order of value, each once.

    Attributes:
        name: the file's.
        trial: whether data or recipe differ from what the cells' names promise; its runs and rows are kept apart.
    """

    name: str
    description: str
    runs: tuple[Run, ...]
    trial: bool


@dataclass(frozen=True)
class _File:
    """A plan's file as it is read; `block`: its [[block]] tables in order."""

    description: str
    block: tuple[CellBlock, ...]
    data: dict[str, Any] = field(default_factory=dict)  # fields of the data that differ from the protocol
    recipe_fields: dict[str, Any] = field(default_factory=dict)  # … and from the recipe

    def __post_init__(self) -> None:
        if not self.block:
            raise ValueError("there is no [[block]]; a plan needs at least one")
        if (count := sum(block.count for block in self.block)) > bounds.MOST_RUNS:
            raise ValueError(f"a plan of {count} cells is too large, at most {bounds.MOST_RUNS} may be")
        if "seed" in self.recipe_fields:
            raise ValueError("recipe_fields cannot set the seed; a block's seeds do")


def load_plan(name_or_path: str) -> Plan:
    """A committed plan by its file's name, or any TOML file by path.

    Raises:
        SchemaError: not found, not TOML, or a field is wrong; the message names the file and the field.
        OSError: it cannot be read.
    """
    path = Path(name_or_path)
    if not path.suffix:
        path = PLANS / f"{name_or_path}.toml"
    if not path.is_file():
        raise SchemaError(f"no plan {name_or_path!r}; give a .toml file or one of: {', '.join(plan_names())}")
    file = read(_File, read_toml(path), str(path))
    runs: dict[str, Run] = {}
    for cell in (cell for block in file.block for cell in block.cells()):
        try:
            run = Run(cell.name, cell.recipe, configuration_of(cell, file.data, file.recipe_fields))
        except SchemaError as error:
            raise SchemaError(f"{path}: {error}") from error
        runs.setdefault(run.digest, run)
    return Plan(path.stem, file.description, tuple(runs.values()), bool(file.data or file.recipe_fields))


def plan_names() -> list[str]:
    return sorted(path.stem for path in PLANS.glob("*.toml"))
