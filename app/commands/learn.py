"""Command `learn`: recordings of a string to an instrument."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from engine.plain_text import name_text
from training.cli import arguments
from training.cli.arguments import Json
from training.cli.console import print_json, progress, say

Instrument = Literal["guitar", "bass", "harp", "piano"]
InstrumentOption = Annotated[Instrument, typer.Option(help="What it was: for what a sound does not give.")]
Anyway = Annotated[
    bool,
    typer.Option("--anyway", help="Continue where a recording is refused, and keep it where no string is found."),
]


def learn(
    notes: Annotated[list[Path], typer.Argument(metavar="NOTE.wav…", help="Recordings; the first gives the string.")],
    name: Annotated[str, typer.Option("--name", help="Of the instrument.")],
    instrument: InstrumentOption = "guitar",
    scale_length: Annotated[
        float | None, typer.Option(metavar="M", help="Sounding length of the string; default assumed.")
    ] = None,
    gauge: Annotated[float | None, typer.Option(metavar="MM", help="Its diameter; default assumed.")] = None,
    anyway: Anyway = False,
    json: Json = False,
) -> None:
    """Learn the string of a recorded note: a preset and an instrument, with its errors against the recording.

    Of more files, takes of the same pitch share the partials, all of them the damping. Interrupt it at any time:
    the same command continues there. Preset and instrument are written at the end.
    """
    from app.player.learned import check_name, keep, learn_files
    from training.recording.learn import require_found
    from training.recording.table import as_data, as_text

    if scale_length is not None:
        arguments.check_range("--scale-length", scale_length, 0.05, 5.0, "m")
    if gauge is not None:
        arguments.check_range("--gauge", gauge, 0.05, 10.0, "mm")
    name = name_text(name)
    check_name(name)
    try:
        with progress("learn") as report:
            learned = learn_files(
                notes, kind=instrument, length_m=scale_length, gauge_mm=gauge, anyway=anyway, progress=report
            )
    except KeyboardInterrupt:
        say("stopped; the same command continues there")
        raise
    if not anyway:
        require_found(learned)
    kept = keep(name, learned, instrument)
    if json:
        files = {name: str(getattr(kept, name)) for name in ("preset", "instrument", "body", "report")}
        print_json({**files, "recordings": [as_data(recording) for recording in learned]})
        return
    for recording in learned:
        for line in as_text(recording):
            print(line)
    say(f"note: hear it again by: learned-strings render {kept.preset.stem} out.wav --as-recorded")
    print(f"{kept.preset}, {kept.instrument}")
