"""The description of a preset, as its file has it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any, Literal, cast

from engine import bounds
from engine.models import MODELS, OF_MANY_STRINGS
from engine.pluck import SHAPES, Pluck, Shape
from engine.presets.migrations import FORMAT_VERSION
from engine.resonators.base import Resonator
from engine.resonators.family import Bounds, StringFamily
from engine.resonators.recorded import RecordedString
from engine.resonators.string import resonator_of
from engine.values.string import StringParameters

# A model of many strings plays wider plucks than the trained ones as well, until the ends cut a Gaussian off.
_WIDEST = {"gaussian": 0.2}


@dataclass(frozen=True)
class TrainedRange:
    """The ranges of the training set's initial displacements; None: not a parameter of that kind.

    Attributes:
        width: by shape, as `Pluck` counts it; a shape that was not drawn, or has no width, is absent.
        peak_m: None: draws were scaled to a rise of tension instead.
        tension_rise: the largest ΔT/T₀, to which draws were softened or scaled; None: they were left as drawn.
    """

    position: Bounds | None
    width: dict[str, Bounds] | None
    peak_m: Bounds | None
    tension_rise: float | None = None

    def __post_init__(self) -> None:
        ranges = {"position": self.position, "peak_m": self.peak_m}
        for shape, width in (self.width or {}).items():
            if shape not in SHAPES:
                raise ValueError(f"width is of {bounds.brief(shape)}, not of one of {', '.join(SHAPES)}")
            ranges[f"width.{shape}"] = width
        for name, (low, high) in ((name, low_high) for name, low_high in ranges.items() if low_high is not None):
            if not 0 <= low <= high:
                raise ValueError(f"{name} must be a range from 0 on, not {low:g} … {high:g}")
        if self.peak_m is None and self.tension_rise is None:
            raise ValueError("peak_m or tension_rise must be given: how hard plucks were in the training")


@dataclass(frozen=True)
class PresetInfo:
    """The description of a preset, as its file has it.

    Attributes:
        horizon_steps: number of frames after the initial one that the model was trained on.
        modes: modes kept in the training data; the initial displacement is projected on them.
        scale_m: the model's unit of displacement.
        initialisation: how the training began, by name.
        knows: what its start received of the string, in words; empty: nothing but the displacement.
        rel_mse, rel_mae: validation errors over the horizon (the paper's metrics), test errors beside them.
        family: of a model of many strings, which were learned; `string` is the one that it plays by default.
        recorded: of a string that was learned from a recording, what that adds to `string`.
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
    recorded: RecordedString | None = None
    licence: str = "MIT"
    format_version: int = FORMAT_VERSION

    def __post_init__(self) -> None:
        bounds.check_choice("model", self.model, MODELS)
        for name in ("rate_hz", "modes", "horizon_steps", "scale_m"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be above 0, not {getattr(self, name)}")
        bounds.check("horizon_steps", self.horizon_steps, (1, bounds.MOST_FRAMES))
        bounds.check("scale_m", self.scale_m, (1e-12, 1e3), "m")
        self.string.check_motion(self.modes, self.grid_points, self.rate_hz, self.tension_modulated)

    @property
    def of_many_strings(self) -> bool:
        """Return True if its model takes any string."""
        return self.model in OF_MANY_STRINGS

    @property
    def horizon_s(self) -> float:
        return self.horizon_steps / self.rate_hz

    @cached_property
    def resonator(self) -> Resonator:
        """The modes of its string, with the tension that its model knows and with what a recording adds."""
        modulated, points = self.tension_modulated, self.grid_points
        if self.recorded is not None:
            return self.recorded.resonator(self.string, self.modes, tension_modulated=modulated, grid_points=points)
        return resonator_of(self.string, self.modes, tension_modulated=modulated, grid_points=points)

    def tension_rise(self, pluck: Pluck) -> float:
        """ΔT/T₀ of its string as it is pulled."""
        displacement = pluck.displacement(self.grid_points)
        return float(self.resonator.relative_tension_rise(self.resonator.to_modes(displacement)))

    def hardest_mm(self, pluck: Pluck) -> float:
        """The amplitude at which a pluck of this shape, place and width has the largest trained rise of tension.

        inf where none is too large.
        """
        limit = self.trained_range.tension_rise
        if limit is None or (rise := self.tension_rise(pluck.moved(amplitude_mm=1.0))) == 0:
            return math.inf
        return math.sqrt(limit / rise)

    def trained_amplitudes_mm(self, pluck: Pluck) -> Bounds:
        """The trained amplitudes of plucks of this shape, place and width, from the least to the largest.

        Where draws were scaled to a rise of tension, from 0 on: the softer a pluck, the nearer to the linear string.
        """
        if self.trained_range.peak_m is None:
            return 0.0, self.hardest_mm(pluck)
        low_m, high_m = self.trained_range.peak_m
        return 1000 * low_m, 1000 * high_m

    @cached_property
    def middle_pluck(self) -> Pluck | None:
        """The pluck in the middle of its training; None: it was not trained on plucks of so many mm.

        Of plucks, widths and amplitudes were drawn evenly on a logarithmic scale; see `training.data.draws`.
        """
        trained = self.trained_range
        if trained.position is None or trained.peak_m is None or not trained.width:
            return None
        shape, width = next(iter(trained.width.items()))
        middle = partial(_middle, logarithmic=self.initial == "pluck")
        pluck = Pluck(shape=cast(Shape, shape)).nearest(position=_middle(*trained.position), width=middle(*width))
        low_mm, high_mm = self.trained_amplitudes_mm(pluck)
        return pluck.nearest(amplitude_mm=round(middle(low_mm, min(high_mm, self.hardest_mm(pluck))), 3))

    @property
    def string_kind(self) -> str:
        """The command line's word: "linear" or "nonlinear"."""
        return "nonlinear" if self.tension_modulated else "linear"


def _middle(low: float, high: float, logarithmic: bool = False) -> float:
    """The middle of a range, or its geometric mean where it is logarithmic, to four places."""
    return round(math.sqrt(low * high) if logarithmic else (low + high) / 2, 4)


def outside_training(info: PresetInfo, pluck: Pluck) -> list[str]:
    """The differences of a pluck from the preset's training, in plain words; empty where there are none.

    Of a preset of many strings only where its error is known to grow: see `docs/many-strings.md`.
    """
    trained = info.trained_range
    width = (trained.width or {}).get(pluck.shape)
    if info.initial == "noise":
        reasons = [f"a {pluck.shape.replace('_', ' ')} pluck is not the noise that this preset was trained on"]
    elif info.initial == "gaussian" and pluck.shape != "gaussian":
        reasons = [f"shape {pluck.shape.replace('_', ' ')} is not the trained gaussian"]
    elif width is None or (info.family and width[0] <= pluck.width <= _WIDEST.get(pluck.shape, math.inf)):
        reasons = []
    else:
        reasons = _beyond("width", pluck.width, width)
    peak_mm = None if trained.peak_m is None else info.trained_amplitudes_mm(pluck)
    return [
        *_beyond("position", pluck.position, trained.position),
        *reasons,
        *_beyond("amplitude", pluck.amplitude_mm, peak_mm, " mm"),
        *_too_tense(info, pluck),
        *(info.family.warnings(info.string) if info.family else []),
    ]


def _too_tense(info: PresetInfo, pluck: Pluck) -> list[str]:
    """The reason, in words, why a pluck raises the tension further than in training; empty where it does not."""
    limit = info.trained_range.tension_rise
    if limit is None or (rise := info.tension_rise(pluck)) <= limit:
        return []
    return [f"the pluck raises the tension by {rise:.0%}, beyond the trained {limit:.0%}: pull less, or wider"]


def _beyond(name: str, value: float, trained: Bounds | None, unit: str = "") -> list[str]:
    """The reason, in words, why a value lies outside its trained range; empty where it does not, or there is none."""
    if trained is None or trained[0] <= value <= trained[1]:
        return []
    return [f"{name} {value:.4g}{unit} is outside the trained {trained[0]:g} … {trained[1]:g}{unit}"]
