"""What one training run is, as committed data: `training/configurations/NAME.toml`."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from engine.models import MODELS
from engine.schema import SchemaError, read
from engine.string import StringParameters

CONFIGURATIONS = Path(__file__).parent / "configurations"


@dataclass(frozen=True)
class DatasetConfiguration:
    """A set of simulated trajectories; the defaults are the paper's protocol (§4.1)."""

    initial: Literal["gaussian", "noise"]
    rate_hz: int
    modes: int
    tension_modulated: bool = True
    steps: int = 4000  # frames after the initial one
    count: int = 1000  # split 80/10/10 in order
    grid_points: int = 101
    seed: int = 0
    string: StringParameters = field(default_factory=StringParameters)

    def __post_init__(self) -> None:
        if self.count < 10:
            raise ValueError(f"count must be at least 10 for a split 80/10/10, not {self.count}")
        for name in ("rate_hz", "modes", "steps"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, not {getattr(self, name)}")


@dataclass(frozen=True)
class Recipe:
    """How a model is fitted."""

    epochs: int  # passes over the training set
    seed: int = 0
    initialisation: str = ""  # one of the model's `initialisations`; empty: the first, its source's own
    batch_size: int = 50
    peak_learning_rate: float = 3e-3
    warm_up: float = 0.1  # share of the run until the peak; then a cosine down to zero
    eigenvalue_rate: float = 0.2  # learning rate of ν_log and θ_log, as a share
    weight_decay: float = 0.01  # AdamW's
    clip_norm: float = 1.0
    steps_per_batch: int = 64  # random frames of a batch
    first_horizon: int = 150  # frames; grows geometrically to all of them …
    grow_until: float = 0.5  # … over this share of the run
    prediction_weight: float = 1.0  # α₁ of the paper's loss
    encoding_weight: float = 1.0  # α₂
    consistency_weight: float = 0.01  # α₃
    flip: bool = True  # sign and mirror augmentation: -u and u(ℓ-x) are solutions too
    validate_every: int = 10  # epochs

    def __post_init__(self) -> None:
        for name in ("epochs", "batch_size", "steps_per_batch", "first_horizon", "validate_every"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} must be at least 1, not {getattr(self, name)}")
        for name in ("warm_up", "grow_until"):
            if not 0 <= getattr(self, name) < 1:
                raise ValueError(f"{name} must lie in 0 … 1, not {getattr(self, name)}")


@dataclass(frozen=True)
class TrainingConfiguration:
    """A run: data, model, recipe, and what the preset says of itself."""

    title: str
    model: str
    data: DatasetConfiguration
    recipe: Recipe
    description: str = ""
    model_configuration: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.model not in MODELS:
            raise ValueError(f"model {self.model!r} is not one of {', '.join(MODELS)}")


def load(name_or_path: str) -> TrainingConfiguration:
    """A committed configuration by name, or any TOML file by path.

    Raises:
        SchemaError: not found, not TOML, or a field is wrong; the message names the file and the field.
    """
    path = Path(name_or_path)
    if not path.suffix:
        path = CONFIGURATIONS / f"{name_or_path}.toml"
    if not path.is_file():
        known = ", ".join(sorted(p.stem for p in CONFIGURATIONS.glob("*.toml")))
        raise SchemaError(f"no training configuration {name_or_path!r}; give a .toml file or one of: {known}")
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SchemaError(f"{path}: not valid TOML: {error}") from error
    return read(TrainingConfiguration, data, str(path))
