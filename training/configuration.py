"""The configuration of one training run: of a cell of the paper's tables (`cell.py`), or one's own TOML file."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any, Literal

from engine import bounds
from engine.models import MODELS, read_model_configuration
from engine.models import RETIRED as RETIRED_SIZES
from engine.resonators.base import Resonator
from engine.resonators.string import resonator_of
from engine.schema import SchemaError, read, without_retired, write
from engine.values.string import StringParameters
from training.start import BLIND_PURSUIT, COUNT, PHASES, PURSUIT, SYMMETRIES, given_to, starts_of

DIGEST_VERSION = 3  # of the rule that distinguishes runs
DATA_VERSION = 3  # raise when the solver, a draw or the cache's files change what they hold


def _check_least(value: object, least: int, *names: str) -> None:
    """Raise ValueError: one of these fields of a dataclass is below `least`."""
    for name in names:
        if getattr(value, name) < least:
            raise ValueError(f"{name} must be at least {least}, not {getattr(value, name)}")


@dataclass(frozen=True)
class DatasetConfiguration:
    """A set of simulated trajectories; the defaults are the paper's protocol (§4.1)."""

    initial: Literal["gaussian", "noise", "pluck"]
    rate_hz: int
    modes: int
    tension_modulated: bool = True
    steps: int = 4000  # frames after the initial one
    stride: int = 1  # only every so many frames are kept, which is enough for a model that knows any frame at once
    substeps: int | None = None  # of the solver in a frame; None: its default, exact to 1e-7
    count: int = 1000  # split 80/10/10 in order
    grid_points: int = 101
    seed: int = 0
    string: StringParameters = field(default_factory=StringParameters)
    # ΔT/T₀; a draw that would pull the string harder is made as much softer. A real one would break.
    largest_tension_rise: float | None = None

    def __post_init__(self) -> None:
        if self.largest_tension_rise is not None and not self.largest_tension_rise > 0:
            raise ValueError(f"largest_tension_rise must be above 0, not {self.largest_tension_rise}")
        if self.count < 10:
            raise ValueError(f"count must be at least 10 for a split 80/10/10, not {self.count}")
        _check_least(self, 1, "rate_hz", "modes", "steps", "stride")
        if self.steps % self.stride:
            raise ValueError(f"steps must be a multiple of stride, {self.stride}, not {self.steps}")
        self.string.check_motion(self.modes, self.grid_points, self.rate_hz, self.tension_modulated)
        if self.substeps is not None:
            bounds.check("substeps", self.substeps, (1, bounds.MOST_SUBSTEPS))
        size_bytes = 4 * self.count * (self.steps // self.stride + 1) * self.modes
        if size_bytes > bounds.LARGEST_DATASET_BYTES or self.count * self.steps > bounds.MOST_FRAMES:
            raise ValueError(
                f"count {self.count}, steps {self.steps} and modes {self.modes} would be {size_bytes / 2**30:.3g} GiB"
                " of data; ask for less"
            )

    @property
    def string_kind(self) -> str:
        """The word of names and tables: "linear" or "nonlinear"."""
        return "nonlinear" if self.tension_modulated else "linear"

    @cached_property
    def resonator(self) -> Resonator:
        """The resonator whose motion is learned."""
        return resonator_of(
            self.string, self.modes, tension_modulated=self.tension_modulated, grid_points=self.grid_points
        )


@dataclass(frozen=True)
class Recipe:
    """The recipe of a model's fit."""

    epochs: int  # passes over the training set
    seed: int = 0
    start: str = ""  # one of the model's `starts_of`; empty: the first, its source's own
    batch_size: int = 50
    peak_learning_rate: float = 3e-3
    schedule: Literal["one_cycle", "constant"] = "one_cycle"
    start_share: float = 0.04  # of the peak rate, at the start of a cycle
    warm_up: float = 0.1  # share of the run until the peak; then a cosine down to zero
    eigenvalue_rate: float = 0.2  # learning rate of the eigenvalues' parameters, as a share
    coupling_rate: float = 1.0  # learning rate of an integrated phase's K, as a share
    weight_decay: float = 0.01  # decoupled, AdamW's
    eigenvalue_decay: bool = False  # whether it decays the eigenvalues' parameters too
    slow_parameters: tuple[str, ...] = ()  # that learn at eigenvalue_rate; empty: those of the model's eigenvalues
    clip_norm: float = 1.0  # of the gradient …
    clip_eigenvalues: bool = True  # … with that of the slow parameters; else of the others alone
    loss: Literal["mse", "log10_mse", "relative_mse"] = "mse"  # of the prediction; relative: to each string's own
    latent_epochs: int = 0  # at first, in which Koopman's encoder learns the latents of its matching pursuit
    latent_learning_rate: float = 3e-3  # the peak of these epochs' own cycle
    latent_polish: int = 0  # the last steps of these epochs are L-BFGS over all trajectories (`pursuit`)
    fixed_batches: bool = False  # an epoch draws the order of the batches, not their trajectories
    steps_per_batch: int = 64  # random frames of a batch; 0: every frame of the horizon
    first_horizon: int = 150  # frames; grows geometrically to all of them …
    grow_until: float = 0.5  # … over this share of the run
    consistency_weight: float = 0.01  # α₃ of the paper's loss, whose α₁ and α₂ are 1
    koopman_terms: Literal["text", "published"] = "text"  # of the paper's loss, or of its authors' script
    flip: bool = True  # sign and mirror augmentation: -u and u(ℓ-x) are solutions too
    validate_every: int = 10  # epochs
    patience: int = 0  # epochs without a better validation error until the run ends early; 0: never
    batch_statistics_until: float = 1.0  # share of the run in which batch norm takes a batch's own; then those stored
    average_decay: float = 0.0  # of a running mean of the weights, an iteration; above 0 that mean is the result
    optimiser: Literal["adamw", "soap"] = "adamw"  # soap: Adam in the eigenbasis of the gradients' covariances

    def __post_init__(self) -> None:
        _check_least(self, 1, "epochs", "batch_size", "first_horizon", "validate_every")
        _check_least(self, 0, "steps_per_batch", "patience", "latent_epochs", "latent_polish")
        if self.latent_polish and not self.latent_epochs:
            raise ValueError("latent_polish needs latent_epochs: it is the last of their steps")
        for name in ("warm_up", "grow_until", "average_decay"):
            if not 0 <= getattr(self, name) < 1:
                raise ValueError(f"{name} must lie in 0 … 1, not {getattr(self, name)}")
        if not 0 < self.batch_statistics_until <= 1:
            raise ValueError(f"batch_statistics_until must lie in 0 … 1, not {self.batch_statistics_until}")


@dataclass(frozen=True)
class TrainingConfiguration:
    """A run: data, model, recipe, and what the preset says of itself."""

    title: str
    model: str
    data: DatasetConfiguration
    recipe: Recipe
    description: str = ""
    model_configuration: dict[str, Any] = field(default_factory=dict)
    horizon: int | None = None  # frames that are trained and measured; None: all of the data's

    def __post_init__(self) -> None:
        bounds.check_choice("model", self.model, MODELS)
        try:
            model = read_model_configuration(self.model, self.model_configuration, "model_configuration")
        except SchemaError as error:
            raise ValueError(str(error)) from error  # the reader of the file adds its name
        if model.grid_points != self.data.grid_points:
            raise ValueError(
                f"model_configuration.grid_points is {model.grid_points}, the data's are {self.data.grid_points}"
            )
        bounds.check_choice("start", self.start, starts_of(self.model))
        if (self.start in (PURSUIT, BLIND_PURSUIT)) != (self.recipe.latent_epochs > 0):
            raise ValueError(
                f"latent_epochs is {self.recipe.latent_epochs} with the start {self.start!r}; a pursuit needs some, "
                "any other start none"
            )
        if self.model == "dmd" and self.data.stride > 1:
            raise ValueError(f"a DMD goes from frame to frame: its data's stride must be 1, not {self.data.stride}")
        if self.steps % self.data.stride:
            raise ValueError(
                f"horizon must be a multiple of the data's stride, {self.data.stride}, not {self.horizon}"
            )
        if not 1 <= self.steps <= self.data.steps:
            raise ValueError(f"horizon must lie in 1 … {self.data.steps}, the data's steps, not {self.horizon}")

    @property
    def steps(self) -> int:
        """Frames that are trained and measured."""
        return self.data.steps if self.horizon is None else self.horizon

    @property
    def start(self) -> str:
        """The name of the model's start: the recipe's choice, or its source's own."""
        return self.recipe.start or next(iter(starts_of(self.model)))

    @property
    def hints(self) -> str:
        """The hints that a start found in the displacement was given, in words; empty for other starts."""
        if self.start not in (BLIND_PURSUIT, PHASES):
            return ""
        counted = self.model == "koopman_integrated" and "state_size" in self.model_configuration
        parts = (SYMMETRIES if self.recipe.flip else "", COUNT if counted else "")
        return ", and ".join(words for words in parts if words)

    @property
    def knowledge(self) -> str:
        """The knowledge of the string that the start uses, in words; empty: the displacement alone."""
        return given_to(self.model, self.start) or self.hints

    @property
    def digest(self) -> str:
        """The digest of all that determines the run's result, the model's defaults among it. Its name does not count.

        Of data and recipe, whose defaults are never changed, fields that have theirs are left out. So one which comes
        later leaves earlier runs their digest; sizes that are no longer there count with the value that they
        had.
        """
        sizes = write(read_model_configuration(self.model, self.model_configuration, "model_configuration"))
        return digest_of(
            {
                "digest_version": DIGEST_VERSION,
                "model": self.model,
                "model_configuration": sizes | RETIRED_SIZES.get(self.model, {}),
                "data": non_default(self.data),
                "data_version": DATA_VERSION,
                "recipe": {**non_default(self.recipe), "start": self.start},
                "horizon": self.steps,
            }
        )


@dataclass(frozen=True)
class Run:
    """A configuration with the names that its row carries.

    Attributes:
        name: also of its folder and its preset.
        recipe: "" where it is none of the tables'.
    """

    name: str
    recipe: str
    configuration: TrainingConfiguration

    @cached_property
    def digest(self) -> str:
        """See `TrainingConfiguration.digest`."""
        return self.configuration.digest


def digest_of(plain: Any) -> str:
    """The sixteen digits that tell plain data apart."""
    return hashlib.sha256(json.dumps(plain, sort_keys=True).encode()).hexdigest()[:16]


# fields of earlier versions, and the only value that they ever had in a run that was kept
RETIRED = {"random_start": False, "prediction_weight": 1.0, "encoding_weight": 1.0}


def read_configuration(plain: Any, where: str) -> TrainingConfiguration:
    """A configuration as a preset or a checkpoint of this version or an earlier one holds it.

    Raises:
        SchemaError: it is none, or sets what is no longer there; the message names the field.
    """
    if isinstance(plain, dict) and isinstance(plain.get("recipe"), dict):
        recipe = without_retired(plain["recipe"], RETIRED, f"{where}.recipe")
        plain = {**plain, "recipe": recipe if "start" in recipe else _with_start(recipe)}
    return read(TrainingConfiguration, plain, where)


def _with_start(recipe: dict[str, Any]) -> dict[str, Any]:
    """An earlier recipe with its start by name; before, `blind` and `latent_epochs` chose it."""
    settings = {
        name: value for name, value in recipe.items() if name not in ("initialisation", "blind", "latents_per_mode")
    }
    blind, pursued = recipe.get("blind"), recipe.get("latent_epochs")
    if pursued:
        return {**settings, "start": BLIND_PURSUIT if blind else PURSUIT}
    return {**settings, "start": PHASES if blind else recipe.get("initialisation", "")}


def non_default(value: DatasetConfiguration | Recipe) -> dict[str, Any]:
    """The fields that differ from their default, as plain data: what a digest is taken of."""
    defaults = {f.name: f.default for f in fields(value)}
    return {name: entry for name, entry in write(value).items() if getattr(value, name) != defaults[name]}
