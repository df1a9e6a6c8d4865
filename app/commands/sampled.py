"""Command `sampled`: an instrument for samplers, in SFZ or SoundFont 2."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from app.commands import options
from app.shared.key_names import key_named
from engine.plain_text import one_line
from training.cli.console import Failure, progress, say

ASKED_ABOVE_BYTES = 2**30  # refused without --yes


def sampled(
    instrument: Annotated[
        str, typer.Argument(metavar="INSTRUMENT", help="An instrument's name or the path of its file.")
    ],
    out: Annotated[Path, typer.Argument(metavar="OUT.sfz|OUT.sf2", help="An SFZ has a folder of samples beside it.")],
    keys: Annotated[
        str | None,
        typer.Option(metavar="LOW-HIGH", help="Keys, as in E2-E5 or 40-76; default all of the instrument."),
    ] = None,
    every: Annotated[
        int, typer.Option(metavar="N", help="Sample one of every N keys; the others transpose its samples.")
    ] = 1,
    layers: Annotated[int, typer.Option(metavar="N", help="Velocity layers.")] = 4,
    seconds: Annotated[
        float, typer.Option(metavar="S", help="Longest sample in s; what still rings then is faded out.")
    ] = 8.0,
    rate: Annotated[int, typer.Option(metavar="HZ", help="Sample rate.")] = 48_000,
    form: Annotated[
        Literal["flac", "wav"] | None, typer.Option("--format", help="Of the samples of an SFZ; default flac.")
    ] = None,
    bits: Annotated[
        Literal["16", "24"] | None, typer.Option(help="Of the samples of an SFZ; default 24. A SoundFont has 16.")
    ] = None,
    source: options.ModelOrTruth = "model",
    dry: Annotated[
        bool,
        typer.Option("--dry", help="Leave out the instrument's room, whose tail would end at each key's release."),
    ] = False,
    size_only: Annotated[bool, typer.Option("--size-only", help="Print the size, and render nothing.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Allow more than 1 GiB.")] = False,
) -> None:
    """Render an instrument for samplers.

    Each key is rendered at several velocities, without loops.
    """
    from app.export.sampled.job import export_sampled, note_renderer, planned
    from app.export.sampled.plan import SampledPlan
    from app.export.sampled.words import counted, megabytes, needed_bytes, notes, pitch_words, size_words
    from app.instruments.library import find_instrument
    from app.player.effects import body_problem
    from engine.folders import usable_files
    from engine.presets import find_preset, load_preset

    soundfont = out.suffix.lower() == ".sf2"
    if soundfont and (form or bits):
        raise typer.BadParameter(
            "--format and --bits are of an SFZ's samples; a SoundFont holds 16 bits", param_hint="OUT.sf2"
        )
    chosen = find_instrument(instrument).instrument
    if dry:
        chosen = chosen.with_value("room.mix", 0.0)
    if problem := body_problem(chosen):
        say(problem)
    preset_path = find_preset(chosen.preset, usable_files())
    try:
        plan = SampledPlan(chosen, _keys(keys), every, layers, seconds, rate, form or "flac", bits or "24", source)
        planned(plan, out)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error
    words, pitch = f"{counted(plan)}, {size_words(plan, soundfont)}", pitch_words(plan.pitch_error_cents)
    if size_only:
        print(f"{one_line(str(out))}: {words}; {pitch}")
        return
    if needed_bytes(plan, soundfont) > ASKED_ABOVE_BYTES and not yes:
        raise Failure(f"{out}: {words}; take fewer --keys, --layers or --seconds, or say --yes")
    say(f"{words}; {pitch}")
    with progress("sampled") as report:
        written = export_sampled(plan, out, note_renderer(load_preset(preset_path), source), progress=report)
    for note in notes(plan, written, "--dry"):
        say(f"note: {note}")
    print(f"{one_line(str(out))}: {written.samples} samples, {megabytes(written.size_bytes)}; {pitch}")


def _keys(text: str | None) -> tuple[int, int] | None:
    """The lowest and highest MIDI key of a text such as E2-E5 or 60; None for None. Raises typer.BadParameter."""
    if text is None:
        return None
    parts = [(text, text), *((text[:place], text[place + 1 :]) for place, sign in enumerate(text) if sign == "-")]
    for part in parts:  # C-1 has a minus of its own
        low, high = map(key_named, part)
        if low is not None and high is not None:
            return low, high
    raise typer.BadParameter(f"must be two keys as in E2-E5 or 40-76, not {text!r}", param_hint="--keys")
