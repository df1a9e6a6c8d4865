"""What a preset says of itself."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

from engine import bounds
from engine.models import MODELS
from engine.pluck import Pluck
from engine.presets.migrations import FORMAT_VERSION
from engine.resonators.base import Resonator
from engine.resonators.family import StringFamily
from engine.resonators.string import StringParameters


@dataclass(frozen=True)
class TrainedRange:
    """What the initial displacements of the training set covered; None: not a parameter of that kind.

    Attributes:
        tension_rise: the largest ΔT/T₀, to which draws were softened; None: they were left as drawn.
    """

    position: tuple[float, float] | None
    width: tuple[float, float] | None
    peak_m: tuple[float, float]
    tension_rise: float | None = None

    def __post_init__(self) -> None:
        for name in ("position", "width", "peak_m"):
            low, high = getattr(self, name) or (0.0, 0.0)
            if not 0 <= low <= high:
                raise ValueError(f"{name} must be a range from 0 on, not {low:g} … {high:g}")


@dataclass(frozen=True)
class PresetInfo:
    """What a preset says of itself.

    Attributes:
        horizon_steps: number of frames after the initial one that the model was trained on.
        modes: modes kept in the training data; the initial displacement is projected on them.
        scale_m: the model's unit of displacement.
        initialisation: how the training began, by name.
        knows: what its start was told of the string, in words; empty: nothing but the displacement.
        rel_mse, rel_mae: validation errors over the horizon (the paper's metrics), test errors beside them.
        family: of a model of many strings, which were learned; `string` is the one that it plays unless told.
        training: the complete training configuration, so that the run can be repeated.
    """

    title: str
    model: str
    model_configuration: dict[str, Any]
    string: StringParameters
    tension_modulated: bool
    initial: Literal["gaussian", "noise", "pluck"]
    rate_hz: int
    modes: int
    grid_points: int
    horizon_steps: int
    scale_m: float
    trained_range: TrainedRange
    initialisation: str
    seed: int
    rel_mse: float | None = None
    rel_mae: float | None = None
    test_rel_mse: float | None = None
    test_rel_mae: float | None = None
    training_seconds: float | None = None
    training: dict[str, Any] = field(default_factory=dict)
    description: str = ""
    knows: str = ""
    family: StringFamily | None = None
    licence: str = "MIT"
    format_version: int = FORMAT_VERSION

    def __post_init__(self) -> None:
        if self.model not in MODELS:
            raise ValueError(f"model {self.model!r} is not one of {', '.join(MODELS)}")
        for name in ("rate_hz", "modes", "horizon_steps", "scale_m"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be above 0, not {getattr(self, name)}")
        bounds.check("horizon_steps", self.horizon_steps, (1, bounds.MOST_FRAMES))
        bounds.check("scale_m", self.scale_m, (1e-12, 1e3), "m")
        self.string.check_motion(self.modes, self.grid_points, self.rate_hz, self.tension_modulated)

    @property
    def horizon_s(self) -> float:
        return self.horizon_steps / self.rate_hz

    @cached_property
    def resonator(self) -> Resonator:
        """What its model learned, at rest and with the tension that it knows."""
        return self.string.resonator(
            self.modes, tension_modulated=self.tension_modulated, grid_points=self.grid_points
        )

    @property
    def string_kind(self) -> str:
        """The command line's word: "linear" or "nonlinear"."""
        return "nonlinear" if self.tension_modulated else "linear"


def outside_training(info: PresetInfo, pluck: Pluck) -> list[str]:
    """How a pluck differs from what the preset was trained on, in plain words; empty where it does not."""
    if info.initial == "noise":
        found = [f"a {pluck.shape.replace('_', ' ')} pluck is not the noise that this preset was trained on"]
    elif info.initial == "gaussian" and pluck.shape != "gaussian":
        found = [f"shape {pluck.shape.replace('_', ' ')} is not the trained gaussian"]
    elif pluck.shape == "triangular":
        found = []  # it has no width
    else:
        found = _beyond("width", pluck.width, info.trained_range.width)
    peak_mm = (1000 * info.trained_range.peak_m[0], 1000 * info.trained_range.peak_m[1])
    return [
        *_beyond("position", pluck.position, info.trained_range.position),
        *found,
        *_beyond("amplitude", pluck.amplitude_mm, peak_mm, " mm"),
        *_too_tense(info, pluck),
        *(info.family.outside(info.string) if info.family else []),
    ]


def _too_tense(info: PresetInfo, pluck: Pluck) -> list[str]:
    limit = info.trained_range.tension_rise
    if limit is None:
        return []
    rise = float(info.resonator.relative_tension_rise(info.resonator.to_modes(pluck.displacement(info.grid_points))))
    if rise <= limit:
        return []
    return [f"the pluck raises the tension by {rise:.0%}, beyond the trained {limit:.0%}: pull less, or wider"]


def _beyond(name: str, value: float, trained: tuple[float, float] | None, unit: str = "") -> list[str]:
    if trained is None or trained[0] <= value <= trained[1]:
        return []
    return [f"{name} {value:.4g}{unit} is outside the trained {trained[0]:g} … {trained[1]:g}{unit}"]
