"""compare: the motion of the whole string by a model against the physics."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import typer

from app.commands import options
from engine.plain_text import one_line
from training.cli import arguments
from training.cli.console import number, print_json, print_table, progress, say

if TYPE_CHECKING:
    from collections.abc import Iterator

    from engine.metrics import ErrorSums
    from engine.pluck import Pluck
    from engine.presets import Preset, PresetInfo

LONGEST_S = 600.0  # the longest comparison
FRAMES_AT_ONCE = 4096


def compare(
    preset: arguments.PresetName,
    position: options.Position,
    amplitude_mm: options.AmplitudeMm,
    seconds: options.Seconds,
    shape: options.Shape = options.DEFAULT_SHAPE,
    width: options.Width = options.DEFAULT_WIDTH,
    string: arguments.StringName = None,
    rate: arguments.StringRate = None,
    modes: arguments.StringModes = None,
    json: arguments.Json = False,
) -> None:
    """Compare a preset's model with the physics on one pluck.

    Prints relative errors over the whole grid, in total, by second, and past the training horizon.
    """
    pluck = options.check_pluck(position, amplitude_mm, shape, width)
    arguments.check_range("--seconds", seconds, 0, LONGEST_S, "s")
    loaded = arguments.open_preset_of_string(preset, string, rate, modes)
    info = loaded.info
    steps = round(seconds * info.rate_hz)
    if steps < 1:
        raise typer.BadParameter(
            f"must hold a sample of {info.rate_hz} Hz, not {seconds:g} s", param_hint="--seconds"
        )
    found = _comparison(loaded, pluck, steps)
    for warning in found["warnings"]:
        say(f"warning: {warning}")
    if json:
        print_json(found)
        return
    print(f"{one_line(str(loaded.name))}: rel. MSE {number(found['rel_mse'])}, rel. MAE {number(found['rel_mae'])}")
    columns = ("from s", "to s", "rel. MSE", "rel. MAE", "")
    rows = [
        [*list(w.values())[:4], "past the training horizon" if w["past_horizon"] else ""] for w in found["windows"]
    ]
    print_table(columns, rows)


def _comparison(preset: Preset, pluck: Pluck, steps: int) -> dict[str, Any]:
    from engine.presets import outside_training

    info = preset.info
    seconds = steps / info.rate_hz
    sums = _compared(preset, pluck, steps)
    total = sums.total()
    windows = [
        {
            "start_s": w.start_s,
            "stop_s": w.stop_s,
            "rel_mse": w.rel_mse,
            "rel_mae": w.rel_mae,
            "past_horizon": w.start_s >= info.horizon_s,
        }
        for w in sums.windows(info.rate_hz, window_edges(seconds, info))
    ]
    return {
        "preset": preset.name,
        "rate_hz": info.rate_hz,
        "position": pluck.position,
        "amplitude_mm": pluck.amplitude_mm,
        "shape": pluck.shape,
        "width": pluck.width,
        "seconds": seconds,
        "horizon_s": info.horizon_s,
        "rel_mse": total.rel_mse,
        "rel_mae": total.rel_mae,
        "windows": windows,
        "warnings": outside_training(info, pluck),
    }


def window_edges(seconds: float, info: PresetInfo) -> list[float]:
    """Times of the edges in s: whole seconds and the training horizon, from 0 to `seconds`."""
    inner = {float(second) for second in range(int(seconds) + 1)} | {info.horizon_s}
    return [*sorted(edge for edge in inner if edge < seconds), seconds]


def _compared(preset: Preset, pluck: Pluck, steps: int) -> ErrorSums:
    from engine.metrics import ErrorSums
    from engine.resonators.sine_transform import project
    from engine.sources import ModelSource, TruthSource

    info = preset.info
    initial = project(pluck.displacement(info.grid_points), info.modes)[None]
    model, truth = ModelSource(preset), TruthSource(info)
    model_state, truth_state = model.start(initial), truth.start(initial)
    sums, done = ErrorSums(steps), 0
    with progress("compare") as report:
        for count in _blocks_of(steps):
            predicted, model_state = model.advance(model_state, count)
            true, truth_state = truth.advance(truth_state, count)
            sums.add(predicted, true, first=done)
            done += count
            report(done / steps)
    return sums


def _blocks_of(steps: int) -> Iterator[int]:
    """The lengths of the blocks of at most `FRAMES_AT_ONCE` frames that make up `steps`."""
    for first in range(0, steps, FRAMES_AT_ONCE):
        yield min(FRAMES_AT_ONCE, steps - first)
