"""What figures compare: the truth and some models, from the starts of the validation set, in blocks of frames.

The truth is simulated as the data set was, so that no data set is needed and no figure ends where the data end.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from engine.metrics import ErrorSums
from engine.presets import Preset, PresetError
from engine.resonators.sine_transform import listening_weights, to_grid
from engine.schema import SchemaError
from engine.sources import ModelSource, Runaway, SourceState, StringSource, TruthSource
from training.cell import MODEL_NAMES
from training.configuration import DatasetConfiguration, read_configuration
from training.data.dataset import draw_initial, split_rows

STARTS = {"gaussian": "Gaussian plucks", "noise": "noise-like starts", "pluck": "plucks of three shapes"}

FRAMES_AT_ONCE = 2048
TRAJECTORIES_AT_ONCE = 10

Report = Callable[[float], None]


@dataclass(frozen=True)
class Block:
    """Successive frames in m, (batch, frames, points) each; from a model that ran away on, NaN.

    Attributes:
        first: of its frames; the one after the initial displacement is 1.
    """

    first: int
    truth: Tensor
    models: tuple[Tensor, ...]


def data_of(presets: Sequence[Preset]) -> DatasetConfiguration:
    """The data set that all the presets were trained on.

    Raises:
        PresetError: there is no preset, a preset does not say, or two were trained on different data.
    """
    if not presets:
        raise PresetError("no preset was given; a figure needs at least one")
    first, *others = [_data_of(preset) for preset in presets]
    for preset, data in zip(presets[1:], others, strict=True):
        for name in (
            "tension_modulated",
            "initial",
            "rate_hz",
            "modes",
            "grid_points",
            "string",
            "seed",
            "count",
            "largest_tension_rise",
        ):
            mine, its = getattr(first, name), getattr(data, name)
            if mine != its:
                raise PresetError(
                    f"{presets[0].name} and {preset.name} were trained on different data ({name}: {mine} and {its}); "
                    "make a figure of each"
                )
    return first


def describe(data: DatasetConfiguration) -> str:
    """The data set in words, for a title."""
    string = "tension-modulated" if data.tension_modulated else "linear"
    return f"{string} string, {STARTS[data.initial]}, {data.rate_hz / 1000:g} kHz"


def labels(presets: Sequence[Preset]) -> list[str]:
    """Short names that differ: the models', with the rest of the preset's name where one model is there twice."""
    models = [preset.info.model for preset in presets]
    found = []
    for preset in presets:
        label, model = MODEL_NAMES[preset.info.model], preset.info.model
        rest = preset.name.partition(f"_{model}")[2].strip("_").replace("_", " ")
        found.append(f"{label} ({rest})" if models.count(model) > 1 and rest else label)
    return found if len(set(found)) == len(found) else [preset.name for preset in presets]


def horizons(presets: Sequence[Preset]) -> list[tuple[str, float]]:
    """Where training ended, in s, and what to write there: one entry for all presets that have the same."""
    found: dict[float, list[str]] = {}
    for label, preset in zip(labels(presets), presets, strict=True):
        found.setdefault(preset.info.horizon_s, []).append(label)
    if len(found) == 1:
        return [("end of training", horizon_s) for horizon_s in found]
    return [(f"end of training\n{', '.join(who)}", horizon_s) for horizon_s, who in found.items()]


def validation_starts(data: DatasetConfiguration) -> Tensor:
    """Initial displacements of the validation set in m, float64 (trajectories, grid_points)."""
    return to_grid(draw_initial(data)[split_rows(data.count, "validation")], data.grid_points)


def validation_start(data: DatasetConfiguration, trajectory: int) -> Tensor:
    """One of `validation_starts`, (1, grid_points).

    Raises:
        ValueError: there are fewer trajectories.
    """
    starts = validation_starts(data)
    if not 0 <= trajectory < len(starts):
        raise ValueError(
            f"there is no trajectory {trajectory}: the validation set has 0 … {len(starts) - 1}; choose one of these"
        )
    return starts[trajectory : trajectory + 1]


def readout(data: DatasetConfiguration, listen: float) -> Tensor:
    """(grid_points, 1), for a listening point at `listen` lengths."""
    return listening_weights(torch.tensor([listen]), data.grid_points)


def motions(presets: Sequence[Preset], starts_m: Tensor, steps: int) -> Iterator[Block]:
    """The truth and the models in frames 1 … steps after `starts_m` (batch, grid_points), at rest.

    Raises:
        ValueError: a model needs more than a displacement at rest.
    """
    runs = [
        _Run(TruthSource(presets[0].info), starts_m),
        *(_Run(ModelSource(preset), starts_m) for preset in presets),
    ]
    for done in range(0, steps, FRAMES_AT_ONCE):
        truth, *models = [run.advance(min(FRAMES_AT_ONCE, steps - done)) for run in runs]
        yield Block(done + 1, truth, tuple(models))


def errors(
    presets: Sequence[Preset], starts_m: Tensor, steps: int, report: Report = lambda share: None
) -> list[ErrorSums]:
    """The error sums of each model, frame by frame, over all of `starts_m`."""
    sums = [ErrorSums(steps) for _ in presets]
    for done in range(0, len(starts_m), TRAJECTORIES_AT_ONCE):
        few = starts_m[done : done + TRAJECTORIES_AT_ONCE]
        for block in motions(presets, few, steps):
            for total, model in zip(sums, block.models, strict=True):
                total.add(model, block.truth, block.first - 1)
            frames = len(few) * (block.first - 1 + block.truth.shape[1]) + done * steps
            report(frames / (len(starts_m) * steps))
    return sums


class _Run:
    """A source that has been started. It may run away: what it does then is the figure's to show."""

    def __init__(self, source: StringSource, starts_m: Tensor) -> None:
        self._source = source
        self._batch, self._points = starts_m.shape
        self._state: SourceState | None = replace(source.start(starts_m), limit_m=float("inf"))

    def advance(self, steps: int) -> Tensor:
        if self._state is not None:
            try:
                frames, self._state = self._source.advance(self._state, steps)
                return frames.double()
            except Runaway:  # not even finite
                self._state = None
        return torch.full((self._batch, steps, self._points), torch.nan, dtype=torch.float64)


def _data_of(preset: Preset) -> DatasetConfiguration:
    try:
        data = read_configuration(preset.info.training, f"{preset.path}: metadata.training").data
    except SchemaError as error:
        raise PresetError(f"{error}; without it the preset's data set is not known") from error
    if data.grid_points != preset.info.grid_points or data.modes != preset.info.modes:
        raise PresetError(f"{preset.path}: metadata.training is of another grid than the model; get the preset again")
    return data
