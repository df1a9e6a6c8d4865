"""Command `play`: a MIDI file, played by an instrument, to a sound file."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from app.commands import options
from app.commands.render import SILENT_DB, BitsOption
from app.shared.vocabulary import WRITTEN_ENDINGS
from engine.plain_text import one_line
from training.cli import arguments
from training.cli.console import progress, say

DEFAULT_RATE_HZ = 48_000


def play(
    midi: Annotated[Path, typer.Argument(metavar="FILE.mid", help="The MIDI file to play.")],
    instrument: Annotated[
        str, typer.Option(metavar="INSTRUMENT", help="An instrument's name, or the path of its file.")
    ],
    out: Annotated[Path, typer.Option(metavar="OUT.wav", help="The file to write, or OUT.flac.")],
    source: options.ModelOrTruth = "model",
    rate: Annotated[int, typer.Option(metavar="HZ", help="Sample rate.")] = DEFAULT_RATE_HZ,
    bits: BitsOption = "24",
    seconds: Annotated[
        float | None, typer.Option(metavar="S", help="Duration in s; default until all notes have decayed.")
    ] = None,
    normalise: Annotated[bool, typer.Option("--normalise", help="Normalise to -1 dBFS.")] = False,
) -> None:
    """Render a MIDI file, played by an instrument, to WAV or FLAC.

    The same files give the same samples. Strings leave out channel 10, except in MPE; a kit of drums plays it alone.
    """
    from app.export.sound import LONGEST_S
    from app.export.wav import RATE_RANGE_HZ

    arguments.check_suffix("--out", out, WRITTEN_ENDINGS)
    arguments.check_range("--rate", rate, *RATE_RANGE_HZ, "Hz")
    if seconds is not None:
        arguments.check_range("--seconds", seconds, 0.001, LONGEST_S, "s")
    from app.instrument.effects import body_problem
    from app.instrument.midi_file import read_song
    from app.patches.library import find_patch

    patch = find_patch(instrument).patch
    song = read_song(midi, patch)

    if song.left_out:
        say(song.left_out)
    if problem := body_problem(patch):
        say(problem)
    loaded = arguments.open_preset(patch.preset)
    from app.export.played import Played, write_played
    from app.export.wav import WavSettings

    began_s = time.monotonic()
    with progress(f"{midi.name} by {patch.name}") as report:
        played, settings = Played(patch, song.events, source), WavSettings(bits, rate, normalise)
        written = write_played(out, played, loaded, midi.name, settings, seconds, report)
    if written.peak_db < SILENT_DB:
        say("note: the file is silent")
    print(
        f"{one_line(str(out))}: {written.seconds:.1f} s of {source} in {time.monotonic() - began_s:.1f} s, "
        f"peak {written.peak_db:.1f} dBFS, {written.clipped} samples clipped"
    )
