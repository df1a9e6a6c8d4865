"""recordings: the errors of a folder of recordings in one table."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from training.cli.arguments import Json
from training.cli.console import Failure, print_json, print_table, progress, say

COLUMNS = ("figure", "median", "90 %", "N")
GATE_COLUMNS = ("kind", "N", "refused", "fitted", "no string found", "kept")


def recordings(
    folder: Annotated[Path | None, typer.Argument(metavar="FOLDER", help="Of recordings, one note each.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Only the own note, without baselines and halves.")] = False,
    most: Annotated[int | None, typer.Option("--most", min=1, metavar="N", help="The first N files alone.")] = None,
    only_dynamics: Annotated[bool, typer.Option("--dynamics", help="Only held-out dynamics.")] = False,
    only_attacks: Annotated[
        bool, typer.Option("--attacks", help="Only the own key with and without attack.")
    ] = False,
    only_neighbours: Annotated[bool, typer.Option("--neighbours", help="Only keys of neighbouring pitch.")] = False,
    blind: Annotated[
        int | None,
        typer.Option(
            "--pitches", min=0, metavar="N", help="Only blind pitch: of N synthetic notes, and of the folder's."
        ),
    ] = None,
    gate: Annotated[
        int | None,
        typer.Option(
            min=0, metavar="N", help="Only which of N synthetic notes, and the folder's, are kept; --quick: no fit."
        ),
    ] = None,
    fit_every: Annotated[
        int, typer.Option("--fit-every", min=1, metavar="N", help="With --gate: one of N notes is fitted.")
    ] = 20,
    synthetic: Annotated[
        int | None,
        typer.Option(min=1, metavar="N", help="Instead: N synthetic notes, how intervals hold them, or neighbours."),
    ] = None,
    json: Json = False,
) -> None:
    """Print how well a folder's recordings are learned: own note, baselines, unseen half, takes, gate.

    The ends of names show takes and dynamics (p, m or f): bass_a2_fb is the second take (b) of a forte (f).
    """
    from app.audio.note_file import NoteFileError, read_note
    from tests.bench.recordings.coverage import FIRST_SEED, coverage
    from tests.bench.recordings.evaluate import dynamics, evaluate, table
    from tests.bench.recordings.gate import as_data, outcomes, rows
    from tests.bench.recordings.instrument import attacks, neighbours, synthetic_neighbours
    from tests.bench.recordings.pitch import pitches, pitches_of

    if synthetic is not None and only_neighbours:
        with progress("bench recordings") as report:
            _print_values(synthetic_neighbours(range(FIRST_SEED, FIRST_SEED + synthetic), report), json)
        return
    if synthetic is not None:
        with progress("bench recordings") as report:
            held = coverage(range(FIRST_SEED, FIRST_SEED + synthetic), lambda done: report(done / synthetic))
        print_json(held) if json else print_table(tuple(held), [tuple(held.values())])
        return
    if folder is None and blind:
        with progress("bench recordings") as report:
            _print_values(pitches(blind, report), json)
        return
    found = {}
    if folder is not None or not gate:
        if folder is None or not folder.is_dir():
            words = "give a folder of recordings, or --synthetic, --pitches or --gate"
            raise typer.BadParameter(words, param_hint="FOLDER")
        files = sorted(path for path in folder.iterdir() if path.suffix.lower() in (".wav", ".flac", ".aif", ".aiff"))
        if not files:
            raise Failure(f"{folder}: no WAV, FLAC or AIFF file; give a folder of recordings")
        for path in files[:most]:
            try:
                read = read_note(path)
            except NoteFileError as error:
                say(f"note: {error}")
                continue
            found[path.stem] = (read.samples, read.rate_hz)
    if gate is not None:
        with progress("bench recordings") as report:
            ends = outcomes(found, gate, 0 if quick else fit_every, progress=report)
        print_json(as_data(ends)) if json else print_table(GATE_COLUMNS, rows(ends))
        return
    with progress("bench recordings") as report:
        if blind is not None:
            _print_values({**pitches(blind, report), **pitches_of(found)}, json)
            return
        for chosen, part in ((only_dynamics, dynamics), (only_attacks, attacks), (only_neighbours, neighbours)):
            if chosen:
                _print_values(part(found, progress=report), json)
                return
        results = evaluate(found, quick=quick, progress=report)
    if json:
        print_json(results)
        return
    print_table(
        ("recording", "gate", "ESR", "from 50 ms", "LSD dB", "1 pole", "2 poles", "half", "half, 2 poles"),
        results["rows"],
    )
    print_table(COLUMNS, table(results["values"]))
    print(f"N = {len(found)} recordings of {folder}; run.py bench recordings {folder}{' --quick' if quick else ''}")


def _print_values(values: dict[str, list[float]], json: bool) -> None:
    from tests.bench.recordings.evaluate import table

    print_json(values) if json else print_table(COLUMNS, table(values))
