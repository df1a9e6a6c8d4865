"""faust: an instrument's quiet string as a Faust program."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from engine.plain_text import one_line
from training.cli.console import say


def faust(
    instrument: Annotated[
        str, typer.Argument(metavar="INSTRUMENT", help="An instrument's name or the path of its file.")
    ],
    out: Annotated[Path, typer.Option("--out", "-o", metavar="OUT.dsp", help="The program.")],
    modes: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="The lowest so many alone; default all below 20 kHz.")
    ] = None,
) -> None:
    """Write an instrument's quiet string as a Faust program.

    A bank of its modes, for plug-ins, Max, the web and more.
    """
    from app.export.faust import write_faust
    from app.patches.library import find_patch
    from training.cli.arguments import open_preset

    chosen = find_patch(instrument).patch
    written = write_faust(out, chosen, open_preset(chosen.preset).info, modes)
    if chosen.body.name or chosen.room.mix:
        say("note: without the instrument's body and room")
    print(f"{one_line(str(out))}: {written} modes")
