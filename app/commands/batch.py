"""batch: many plucks of many presets to WAV files, with an index."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.commands import options
from app.commands.render import (
    BitsOption,
    DecayDb,
    Normalise,
    PickupOption,
    Rate,
    check_sound,
)
from engine.plain_text import one_line
from training.cli import arguments
from training.cli.console import Failure, progress, say

if TYPE_CHECKING:
    from app.export.sound import Source


def batch(
    presets: Annotated[str, typer.Option(metavar="PRESET,…", help="Names or paths of presets, separated by commas.")],
    positions: Annotated[
        str, typer.Option(metavar="X,…", help="Where to pluck, 0 … 1 of the length, separated by commas.")
    ],
    amplitudes: Annotated[str, typer.Option(metavar="MM,…", help="Peak displacements in mm, separated by commas.")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="The folder, made if needed.")],
    seconds: options.Seconds,
    strings: Annotated[
        str | None,
        typer.Option(
            metavar="STRING,…",
            help="For presets of many strings: names of strings or .toml files, separated by commas.",
        ),
    ] = None,
    modes: arguments.StringModes = None,
    sources: Annotated[
        str, typer.Option(metavar="SOURCE,…", help="Of model, truth, difference, both; separated by commas.")
    ] = "model",
    rate: Rate = None,
    bits: BitsOption = "24",
    listen: options.Listen = options.DEFAULT_LISTEN,
    listen_right: options.ListenRight = None,
    pickup: PickupOption = "displacement",
    difference_gain_db: options.GainDb = 0.0,
    decay_db: DecayDb = None,
    shape: options.Shape = options.DEFAULT_SHAPE,
    width: options.Width = options.DEFAULT_WIDTH,
    normalise: Normalise = False,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Render files again that are there.")] = False,
) -> None:
    """Render many plucks of many presets to WAV files.

    All combinations of positions, amplitudes, presets, strings and sources are rendered. index.csv lists the files
    with their peaks and errors. The same command continues a batch that was stopped: whole files are kept.
    """
    places, heights = _numbers("--positions", positions), _numbers("--amplitudes", amplitudes)
    for place in places:
        for height in heights:
            pluck = options.check_pluck(place, height, shape, width)
    check_sound(seconds, rate, listen, listen_right, difference_gain_db, decay_db)
    from app.export.batch import INDEX, BatchPlan, NamedString, run_batch
    from app.export.wav import WavSettings
    from engine.folders import usable_files
    from engine.presets import find_preset, find_string, read_string

    files = usable_files()
    paths = tuple(find_preset(name, files) for name in _words(presets))
    named = tuple(NamedString(path.stem, read_string(path)) for path in map(find_string, _words(strings or "")))
    try:
        plan = BatchPlan(
            paths,
            places,
            heights,
            _sources(sources),
            out,
            seconds,
            listen,
            pluck,
            listen_right,
            pickup,
            difference_gain_db,
            decay_db,
            WavSettings(bits, rate, normalise),
            overwrite,
            named,
            modes,
        )
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error
    with progress("batch") as report:
        rows = run_batch(plan, report)
    for message in dict.fromkeys(row.message for row in rows if row.message):
        say(message)
    counts = Counter(row.status for row in rows)
    print(
        f"{one_line(str(out / INDEX))}: {counts['written']} written, {counts['kept']} kept, {counts['failed']} failed"
    )
    clipped = sum(row.clipped or 0 for row in rows)
    if clipped:
        say(f"note: {clipped} samples were clipped; lower the amplitudes, or choose --bits 32f or --normalise")
    if counts["failed"]:
        raise Failure(f"{counts['failed']} of {len(rows)} files were not made; {out / INDEX} says why")


def _words(text: str) -> list[str]:
    return [word.strip() for word in text.split(",") if word.strip()]


def _numbers(option: str, text: str) -> tuple[float, ...]:
    try:
        found = tuple(float(word) for word in _words(text))
    except ValueError as error:
        raise typer.BadParameter(f"must be numbers separated by commas, not {text!r}", param_hint=option) from error
    if not found:
        raise typer.BadParameter("give at least one number", param_hint=option)
    return found


def _sources(text: str) -> tuple[Source, ...]:
    from app.export.sound import SOURCES

    known = {str(source): source for source in SOURCES}
    for word in _words(text):
        if word not in known:
            raise typer.BadParameter(f"{word!r} is not one of {', '.join(SOURCES)}", param_hint="--sources")
    return tuple(known[word] for word in _words(text))
