"""A cell of the paper's tables: one model, data set and horizon, by one recipe, from one seed.

A cell has a name, which is its preset's, and from the name alone its whole configuration follows: the paper's
protocol gives the data, `recipes/RECIPE.toml` gives the rest. `load` reads runs that are no cells, too.

    nylon_nonlinear_noise_16k_koopman_var                     4000 frames, our recipe, seed 0
    nylon_linear_gaussian_4k_lru_400_paper_seed3              400 frames, the paper's recipe, seed 3
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Literal

from engine import bounds
from engine.models import MODELS, OF_MANY_STRINGS
from engine.schema import SchemaError, read, read_toml, write
from training.configuration import DatasetConfiguration, Recipe, TrainingConfiguration

RECIPES = Path(__file__).parent / "recipes"
CONFIGURATIONS = Path(__file__).parent / "configurations"
MODES = {4000: 10, 16000: 25}  # kept by the authors at each sample rate in Hz
HORIZON = 4000  # frames, unless a name says otherwise
RECIPE = "ours"

MODEL_NAMES = {
    "dmd": "DMD",
    "koopman": "Koopman",
    "koopman_var": "Koopman_var",
    "koopman_integrated": "integrated phase",
    "koopman_tension": "shared tension",
    "lru": "LRU",
    "s5": "S5",
    "fgru": "FGRU",
    "frnn": "FRNN",
}

KNOWLEDGE_RECIPES = ("blind", "hinted")  # named by what the model knows of the string
TITLE_WORDS = {  # where a musician would not know the tables' name
    "koopman_var": "Koopman, variable",
    "koopman_integrated": "Integrated phase",
    "koopman_tension": "Shared tension",
    "fgru": "Fourier GRU",
    "frnn": "Fourier RNN",
}


Initial = Literal["gaussian", "noise"]
_NAME = re.compile(
    r"nylon_(?P<kind>linear|nonlinear)_(?P<initial>gaussian|noise)_(?P<rate>\d+)k_(?P<model>[a-z0-9_]+?)"
    r"(_(?P<horizon>\d+))?(_(?P<recipe>[a-z]+))?(_seed(?P<seed>\d+))?"
)


@dataclass(frozen=True, order=True)
class Cell:
    """A place in the paper's tables, and which run of ours fills it; see the module.

    Attributes:
        model: a name of `engine.models.MODELS`.
        tension_modulated: False: the linear string.
        initial: the random shape that the string is released from.
        horizon: frames that are trained and measured.
        recipe: a file of `recipes/`, without its ending.
    """

    model: str
    tension_modulated: bool
    initial: Initial
    rate_hz: int
    horizon: int = HORIZON
    recipe: str = RECIPE
    seed: int = 0

    def __post_init__(self) -> None:
        bounds.check_choice("model", self.model, MODELS)
        if self.model in OF_MANY_STRINGS:
            raise ValueError(f"model {self.model!r} learns many strings, no cell's one; `family train` trains it")
        if self.rate_hz not in MODES:
            raise ValueError(f"rate_hz must be one of {', '.join(map(str, MODES))}, the paper's, not {self.rate_hz}")
        if self.horizon < 1:
            raise ValueError(f"horizon must be at least 1 frame, not {self.horizon}")
        if self.seed < 0:
            raise ValueError(f"seed must be at least 0, not {self.seed}")

    @property
    def string_kind(self) -> str:
        """The word of names and tables: "linear" or "nonlinear"."""
        return "nonlinear" if self.tension_modulated else "linear"

    @property
    def name(self) -> str:
        parts = ["nylon", self.string_kind, self.initial, f"{self.rate_hz // 1000}k", self.model]
        if self.horizon != HORIZON:
            parts.append(str(self.horizon))
        if self.recipe != RECIPE:
            parts.append(self.recipe)
        if self.seed:
            parts.append(f"seed{self.seed}")
        return "_".join(parts)

    @property
    def title(self) -> str:
        """The title in a list of presets: string, training data and rate, then model and what is unusual in it."""
        string = "Nylon B3" if self.tension_modulated else "Nylon B3, linear"
        start = "plucks" if self.initial == "gaussian" else "random shapes"
        details = [TITLE_WORDS.get(self.model, MODEL_NAMES[self.model])]
        if self.recipe != RECIPE:
            details.append(self.recipe if self.recipe in KNOWLEDGE_RECIPES else f"{self.recipe} recipe")
        if self.horizon != HORIZON:
            details.append(f"trained on {1000 * self.horizon / self.rate_hz:g} ms")
        if self.seed:
            details.append(f"seed {self.seed}")
        return f"{string}, {start}, {self.rate_hz // 1000} kHz — {', '.join(details)}"

    @classmethod
    def parse(cls, name: str) -> Cell | None:
        """The cell of a name; None where it is no cell's.

        Raises:
            SchemaError: it has a cell's form, but names no cell, for example an unknown model, or states a default.
        """
        # the longest model first: koopman_var is not koopman by the recipe var
        models = "|".join(sorted(MODELS, key=len, reverse=True))
        match = re.fullmatch(_NAME.pattern.replace("[a-z0-9_]+?", models), name) or _NAME.fullmatch(name)
        if match is None:
            return None
        try:
            cell = cls(
                match["model"],
                match["kind"] == "nonlinear",
                "gaussian" if match["initial"] == "gaussian" else "noise",
                1000 * int(match["rate"]),
                int(match["horizon"] or HORIZON),
                match["recipe"] or RECIPE,
                int(match["seed"] or 0),
            )
        except ValueError as error:
            raise SchemaError(f"{name}: {error}") from error
        if cell.name != name:
            raise SchemaError(f"{name}: a cell's name leaves defaults out; this one is {cell.name}")
        return cell


@dataclass(frozen=True)
class RecipeCase:
    """A difference of a recipe from its default, in cells that match every field given here."""

    model: tuple[str, ...] = ()  # any of these; empty: all
    initial: tuple[str, ...] = ()
    rate_hz: tuple[int, ...] = ()
    horizon: tuple[int, ...] = ()
    tension_modulated: bool | None = None
    set: dict[str, Any] = field(default_factory=dict)  # fields of the recipe
    model_configuration: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for model in self.model:
            bounds.check_choice("model", model, MODELS)

    def matches(self, cell: Cell) -> bool:
        """Return True if a cell has one of the choices in every field that is given."""
        for name in ("model", "initial", "rate_hz", "horizon"):
            choice = getattr(self, name)
            if choice and getattr(cell, name) not in choice:
                return False
        return self.tension_modulated in (None, cell.tension_modulated)


@dataclass(frozen=True)
class RecipeBook:
    """A file of `recipes/`: its defaults, and the cases that change them, the later ones last."""

    description: str
    default: dict[str, Any]
    case: tuple[RecipeCase, ...] = ()


@cache
def _recipe_book(path: Path) -> RecipeBook:
    """A recipe's file, read once. Raises SchemaError."""
    return read(RecipeBook, read_toml(path), str(path))


def recipe_names() -> list[str]:
    return sorted(path.stem for path in RECIPES.glob("*.toml"))


def load(name_or_path: str) -> TrainingConfiguration:
    """A committed configuration by its file's name, a cell of the tables by its name, or any TOML file by path.

    Raises:
        SchemaError: not found, not TOML, or a field is wrong; the message names the file and the field.
    """
    path = Path(name_or_path)
    if not path.suffix:
        path = CONFIGURATIONS / f"{name_or_path}.toml"
        if not path.is_file() and (cell := Cell.parse(name_or_path)) is not None:
            return configuration_of(cell)
    if not path.is_file():
        known = "".join(f", {p.stem}" for p in sorted(CONFIGURATIONS.glob("*.toml")))
        raise SchemaError(
            f"no training configuration {name_or_path!r}; give a .toml file, or a name: a cell of the tables like "
            f"nylon_nonlinear_noise_16k_koopman_var_400_seed1{known}"
        )
    return read(TrainingConfiguration, read_toml(path), str(path))


def configuration_of(
    cell: Cell, data: Mapping[str, Any] | None = None, recipe: Mapping[str, Any] | None = None
) -> TrainingConfiguration:
    """The run that fills a cell.

    Args:
        data, recipe: fields that differ from the protocol and from the recipe: for a quick trial.

    Raises:
        SchemaError: the recipe's file, or a field given here, is wrong.
    """
    path = RECIPES / f"{cell.recipe}.toml"
    if not path.is_file():
        raise SchemaError(f"{cell.name}: recipe {cell.recipe!r} is not one of {', '.join(recipe_names())}")
    book = _recipe_book(path)
    settings: dict[str, Any] = dict(book.default)
    sizes: dict[str, Any] = {}
    for case in book.case:
        if case.matches(cell):
            settings |= case.set
            sizes |= case.model_configuration
    protocol = _protocol(cell.initial, cell.rate_hz, cell.tension_modulated)
    dataset = read(DatasetConfiguration, {**write(protocol), **(data or {})}, "data")
    fitted = read(Recipe, {**settings, "seed": cell.seed, **(recipe or {})}, str(path))
    string = "tension-modulated" if cell.tension_modulated else "linear"
    start = "Gaussian plucks" if cell.initial == "gaussian" else "noise as first displacement"
    try:
        return TrainingConfiguration(
            title=cell.title,
            model=cell.model,
            data=dataset,
            recipe=fitted,
            description=f"The paper's {string} nylon string after {start}, learned over {cell.horizon} frames.",
            model_configuration=sizes,
            horizon=cell.horizon,
        )
    except ValueError as error:
        raise SchemaError(f"{cell.name}: {error}") from error


def follows_protocol(data: DatasetConfiguration) -> bool:
    """Return True if a data set is one of the paper's."""
    return data.rate_hz in MODES and data == _protocol(data.initial, data.rate_hz, data.tension_modulated)


def _protocol(initial: Literal["gaussian", "noise", "pluck"], rate_hz: int, modulated: bool) -> DatasetConfiguration:
    return DatasetConfiguration(initial, rate_hz, MODES[rate_hz], modulated)
