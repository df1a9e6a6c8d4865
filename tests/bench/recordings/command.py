"""recordings: the errors of a folder of recordings in one table."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from training.cli.arguments import Json
from training.cli.console import Failure, print_json, print_table, progress, say


def recordings(
    folder: Annotated[Path | None, typer.Argument(metavar="FOLDER", help="Of recordings, one note each.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Only the own note, without baselines and halves.")] = False,
    most: Annotated[int | None, typer.Option("--most", min=1, metavar="N", help="The first N files alone.")] = None,
    only_dynamics: Annotated[bool, typer.Option("--dynamics", help="Only held-out dynamics.")] = False,
    synthetic: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Instead: N synthetic notes, and how intervals hold them.")
    ] = None,
    json: Json = False,
) -> None:
    """Print how well a folder's recordings are learned: own note, baselines, unseen half, takes, gate.

    Names show takes: files whose names differ in the last letter alone are takes of one note. The letter before it is
    the dynamic, such as f, m or p.
    """
    from app.audio.note_file import NoteFileError, read_note
    from tests.bench.recordings.coverage import FIRST_SEED, coverage
    from tests.bench.recordings.evaluate import dynamics, evaluate, table

    if synthetic is not None:
        with progress("bench recordings") as report:
            held = coverage(range(FIRST_SEED, FIRST_SEED + synthetic), lambda done: report(done / synthetic))
        print_json(held) if json else print_table(tuple(held), [tuple(held.values())])
        return
    if folder is None or not folder.is_dir():
        raise typer.BadParameter("give a folder of recordings, or --synthetic", param_hint="FOLDER")

    files = sorted(path for path in folder.iterdir() if path.suffix.lower() in (".wav", ".flac", ".aif", ".aiff"))
    if not files:
        raise Failure(f"{folder}: no WAV, FLAC or AIFF file; give a folder of recordings")
    found = {}
    for path in files[:most]:
        try:
            read = read_note(path)
        except NoteFileError as error:
            say(f"note: {error}")
            continue
        found[path.stem] = (read.samples, read.rate_hz)
    with progress("bench recordings") as report:
        if only_dynamics:
            results: dict[str, Any] = {"values": dynamics(found, progress=report)}
        else:
            results = evaluate(found, quick=quick, progress=report)
    if json:
        print_json(results)
        return
    if only_dynamics:
        print_table(("figure", "median", "90 %", "N"), table(results))
        return
    print_table(
        ("recording", "gate", "ESR", "from 50 ms", "LSD dB", "1 pole", "2 poles", "half", "half, 2 poles"),
        results["rows"],
    )
    print_table(("figure", "median", "90 %", "N"), table(results))
    print(f"N = {len(found)} recordings of {folder}; run.py bench recordings {folder}{' --quick' if quick else ''}")
