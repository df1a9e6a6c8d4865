"""Commands `simulate`, `predict`, `compare`: motion of the whole string, by the physics and by models."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from app.commands import options
from engine.bounds import MOST_FRAMES, MOST_SUBSTEPS, SIZES
from engine.plain_text import one_line
from training.cli import arguments
from training.cli.console import Failure, ProgressReport, number, print_json, print_table, progress, say

if TYPE_CHECKING:
    from collections.abc import Iterator

    from app.commands.arrays import Array, Motion
    from engine.compare.relative import ErrorSums
    from engine.pluck import Pluck
    from engine.presets import Preset, PresetInfo
    from engine.resonators import Resonator
    from engine.values.string import StringParameters

InputFile = Annotated[Path, typer.Argument(metavar="U0.npy", help="Initial displacement (batch, points) in m.")]
OutputFile = Annotated[Path, typer.Argument(metavar="OUT.npy", help="Motion (batch, steps + 1, points) in m.")]
Steps = Annotated[int, typer.Option(min=1, max=MOST_FRAMES, help="Frames after the initial one.")]
STRING_KINDS = ("linear", "nonlinear")
SolverOption = Annotated[
    Literal["fast", "dop853"],
    typer.Option(help="fast: a splitting method; dop853: the slow reference that it is checked against."),
]
LONGEST_S = 600.0  # the longest comparison


def simulate(
    u0: InputFile,
    out: OutputFile,
    string: Annotated[
        str,
        typer.Option(
            metavar="KIND|NAME|STRING.toml",
            help='The paper\'s nylon B3, "linear" or "nonlinear" (tension-modulated); or a nonlinear string by name '
            "(steel_e4) or as a file of its parameters.",
        ),
    ],
    steps: Steps,
    rate: Annotated[float, typer.Option(metavar="HZ", help="Sample rate.")] = 48_000,
    modes: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=SIZES["modes"][1],
            metavar="M",
            help="Number of modes; default all below 20 kHz and half the rate, as many as the grid of U0 holds.",
        ),
    ] = None,
    solver: SolverOption = "fast",
    substeps: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=MOST_SUBSTEPS,
            metavar="N",
            help="Sub-steps of the fast solver per sample: fewer are faster, and less accurate. Default: enough for "
            "a relative error of 1e-7 on the paper's data.",
        ),
    ] = None,
) -> None:
    """Simulate the motion of a string by the physics.

    U0 is its displacement at rest, in metres, on any grid of at least M + 2 points.
    """
    arguments.check_range("--rate", rate, 1, 1_000_000, "Hz")
    parameters, tension_modulated = _string_of(string)
    if substeps is not None and (solver != "fast" or not tension_modulated):
        raise typer.BadParameter(
            "only the fast solver of the nonlinear string has sub-steps", param_hint="--substeps"
        )
    from app.commands import arrays
    from engine.presets.of_string import HIGHEST_HZ
    from engine.resonators.string import resonator_of

    initial = arrays.read_displacements(u0)
    points = initial.shape[1]
    highest_hz = min(HIGHEST_HZ, rate / 2)
    if modes is None:
        modes = min(parameters.modes_below(highest_hz), points - 2)
    if modes < 1:
        raise Failure(f"{string}: no mode is below {highest_hz:g} Hz, or {u0} has no point between its ends")
    if modes > points - 2:
        raise typer.BadParameter(
            f"a grid of {points} points holds 1 … {points - 2} modes, not {modes}", param_hint="--modes"
        )
    arrays.check_result_size(len(initial), steps + 1, points)
    try:
        parameters.check_motion(modes, points, rate, tension_modulated)
    except ValueError as error:
        raise Failure(f"{string}: {error}") from error
    resonator = resonator_of(parameters, modes, tension_modulated=tension_modulated, grid_points=points)
    with progress("simulate") as report:
        if solver == "fast":
            motion = _splitting_motion(resonator, rate, steps, substeps)
        else:
            motion = _dop853_motion(resonator, rate, steps, len(initial), report)
        arrays.write_motion(out, initial, steps, motion, report)
    if (peak_m := float(abs(initial).max())) > arrays.IMPLAUSIBLE_PEAK_M:
        say(f"note: {u0} rises to {peak_m:g} m; displacement is in metres")


def predict(
    preset: arguments.PresetName,
    u0: InputFile,
    out: OutputFile,
    steps: Steps,
    string: arguments.StringName = None,
    rate: arguments.StringRate = None,
    modes: arguments.StringModes = None,
) -> None:
    """Predict the motion of a string with a preset's model.

    U0 is its displacement at rest, in metres, on the preset's grid.
    """
    loaded = arguments.open_preset_of_string(preset, string, rate, modes)
    from app.commands import arrays

    initial = arrays.read_displacements(u0)
    points = loaded.info.grid_points
    if initial.shape[1] != points:
        raise Failure(
            f"{u0}: has shape {tuple(initial.shape)}, expected (batch, {points}), the grid of {loaded.name}; "
            f"sample the displacement at {points} points with both ends"
        )
    arrays.check_result_size(len(initial), steps + 1, points)
    with progress("predict") as report:
        arrays.write_motion(out, initial, steps, _predicted_motion(loaded, steps), report)
    for words in _outside_family(loaded.info, initial):
        say(f"warning: {words}")


def _outside_family(info: PresetInfo, initial: Array) -> list[str]:
    """The deviations of a string and its displacements from a preset of many strings, where the error grows."""
    if info.family is None:
        return []
    warnings = info.family.warnings(info.string)
    rise = float(info.resonator.relative_tension_rise(info.resonator.to_modes(initial)).max())
    if rise > (limit := info.family.tension_rise[1]):
        warnings.append(f"the displacement raises the tension by {rise:.0%}, beyond the trained {limit:.0%}")
    return warnings


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
    options.check_shortest(seconds, info.rate_hz)
    facts = _comparison(loaded, pluck, round(seconds * info.rate_hz))
    for warning in facts["warnings"]:
        say(f"warning: {warning}")
    if json:
        print_json(facts)
        return
    print(f"{one_line(str(loaded.name))}: rel. MSE {number(facts['rel_mse'])}, rel. MAE {number(facts['rel_mae'])}")
    columns = ("from s", "to s", "rel. MSE", "rel. MAE", "")
    figures = ("start_s", "stop_s", "rel_mse", "rel_mae")
    rows = [
        [*(w[name] for name in figures), "past the training horizon" if w["past_horizon"] else ""]
        for w in facts["windows"]
    ]
    print_table(columns, rows)


def _comparison(preset: Preset, pluck: Pluck, steps: int) -> dict[str, Any]:
    """The facts that `compare` prints: choices, relative errors over `steps` frames and by window, and warnings."""
    from engine.presets import outside_training

    info = preset.info
    seconds = steps / info.rate_hz
    sums = _error_sums(preset, pluck, steps)
    windows = [
        {**asdict(w), "past_horizon": w.start_s >= info.horizon_s}
        for w in sums.windows(info.rate_hz, window_edges(seconds, info))
    ]
    return {
        "preset": preset.name,
        "rate_hz": info.rate_hz,
        **asdict(pluck),
        "seconds": seconds,
        "horizon_s": info.horizon_s,
        **asdict(sums.total()),
        "windows": windows,
        "warnings": outside_training(info, pluck),
    }


def window_edges(seconds: float, info: PresetInfo) -> list[float]:
    """Times of the edges in s: whole seconds and the training horizon, from 0 to `seconds`."""
    inner = {float(second) for second in range(int(seconds) + 1)} | {info.horizon_s}
    return [*sorted(edge for edge in inner if edge < seconds), seconds]


def _error_sums(preset: Preset, pluck: Pluck, steps: int) -> ErrorSums:
    """The sums of the model's errors over the first `steps` frames after a pluck, with progress printed."""
    from app.commands import arrays
    from engine.compare.relative import ErrorSums
    from engine.resonators.sine_transform import project
    from engine.sources import ModelSource, TruthSource

    info = preset.info
    initial = project(pluck.displacement(info.grid_points), info.modes)[None]
    sources = ModelSource(preset), TruthSource(info)
    motions = (arrays.blocks_of(source.advance, source.start(initial), steps) for source in sources)
    sums, done = ErrorSums(steps), 0
    with progress("compare") as report:
        for predicted, true in zip(*motions, strict=True):
            sums.add(predicted, true, first=done)
            done += true.shape[1]
            report(done / steps)
    return sums


def _string_of(kind_or_file: str) -> tuple[StringParameters, bool]:
    """A string, and whether its tension is modulated by its stretch. Raises typer.BadParameter."""
    from engine.presets import PresetError, find_string, read_string
    from engine.values.string import StringParameters

    if kind_or_file in STRING_KINDS:
        return StringParameters(), kind_or_file == "nonlinear"
    try:
        return read_string(find_string(kind_or_file)), True
    except PresetError as error:
        kinds = " or ".join(STRING_KINDS)
        raise typer.BadParameter(f"must be {kinds}, or a string: {error}", param_hint="--string") from error


def _splitting_motion(resonator: Resonator, rate_hz: float, steps: int, substeps: int | None) -> Motion:
    """The motion by the fast solver, in blocks; `substeps`: per sample, None for `default_substeps`."""
    from app.commands.arrays import blocks_of
    from engine.truth import ModalState, SplittingSolver

    solver = SplittingSolver(resonator, rate_hz, substeps=substeps)

    def motion(initial: Array) -> Iterator[Array]:
        state = ModalState.at_rest(resonator.to_modes(initial))
        yield resonator.to_grid(state.amplitude[:, None])
        for amplitudes in blocks_of(solver.advance, state, steps):
            yield resonator.to_grid(amplitudes)

    return motion


def _dop853_motion(
    resonator: Resonator, rate_hz: float, steps: int, trajectories: int, report: ProgressReport
) -> Motion:
    """The motion by the slow reference solver, in one block; `trajectories`: in all calls together, for progress."""
    from engine.truth import ModalState, solve_dop853

    solved = 0  # trajectories so far

    def motion(initial: Array) -> Iterator[Array]:
        """See `Motion`."""
        nonlocal solved
        before, solved = solved, solved + len(initial)
        starts = ModalState.at_rest(resonator.to_modes(initial))
        amplitudes = solve_dop853(
            resonator,
            starts,
            rate_hz,
            steps,
            report=lambda share: report((before + share * len(initial)) / trajectories),
        )
        yield resonator.to_grid(amplitudes)

    return motion


def _predicted_motion(preset: Preset, steps: int) -> Motion:
    """The motion by a preset's model, in blocks, from the displacement that its modes can have."""
    from app.commands.arrays import blocks_of
    from engine.resonators.sine_transform import project
    from engine.sources import ModelSource

    source = ModelSource(preset)

    def motion(initial: Array) -> Iterator[Array]:
        start = project(initial, preset.info.modes)
        yield start[:, None]
        yield from blocks_of(source.advance, source.start(start), steps)

    return motion
