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
    out: Annotated[Path, typer.Option(metavar="OUT.wav", help="The file to write, or OUT.flac.")],
    instrument: Annotated[
        str | None,
        typer.Option(
            metavar="INSTRUMENT",
            help="An instrument's name, or the path of its file, which plays all; default: of each channel the "
            "factory instrument that its program of General MIDI chooses, and drums on channel 10.",
        ),
    ] = None,
    source: options.ModelOrTruth = "model",
    rate: Annotated[int, typer.Option(metavar="HZ", help="Sample rate.")] = DEFAULT_RATE_HZ,
    bits: BitsOption = "24",
    seconds: Annotated[
        float | None, typer.Option(metavar="S", help="Duration in s; default until all notes have decayed.")
    ] = None,
    normalise: Annotated[bool, typer.Option("--normalise", help="Normalise to -1 dBFS.")] = False,
) -> None:
    """Render a MIDI file, played by an instrument or by those of its programs, to WAV or FLAC.

    The same files give the same samples. Strings leave out channel 10, except in MPE; a kit of drums plays it alone.
    A program that no instrument is like leaves the one that the channel has, at first the classical guitar.
    """
    from app.export.wav import LONGEST_S, RATE_RANGE_HZ

    arguments.check_suffix("--out", out, *WRITTEN_ENDINGS)
    arguments.check_range("--rate", rate, *RATE_RANGE_HZ, "Hz")
    if seconds is not None:
        arguments.check_range("--seconds", seconds, 0.001, LONGEST_S, "s")
    from app.instruments.library import find_instrument
    from app.player.effects import body_problem
    from app.player.midi_file import read_parts, read_song

    if instrument is None:
        parts, left_out = read_parts(midi)
    else:
        chosen = find_instrument(instrument).instrument
        parts, left_out = [(chosen, read_song(midi, chosen))], ""
    for chosen, part in parts:
        if part.words:
            print(f"{part.words}: {chosen.name}")
    for words in (left_out, *(part.left_out for _, part in parts), *(body_problem(chosen) for chosen, _ in parts)):
        if words:
            say(words)
    presets = {name: arguments.open_preset(name) for name in {chosen.preset for chosen, _ in parts}}
    from app.export.played import Played, write_played
    from app.export.wav import WavSettings

    began_s = time.monotonic()
    with progress(midi.name) as report:
        played = [(Played(chosen, part.events, source), presets[chosen.preset]) for chosen, part in parts]
        written = write_played(out, played, midi.name, WavSettings(bits, rate, normalise), seconds, report)
    if written.gain_db < 0 and not normalise:
        say(f"note: made softer by {-written.gain_db:.1f} dB, so that the parts together do not clip")
    if written.peak_db < SILENT_DB:
        say("note: the file is silent")
    print(
        f"{one_line(str(out))}: {written.seconds:.1f} s of {source} in {time.monotonic() - began_s:.1f} s, "
        f"peak {written.peak_db:.1f} dBFS, {written.clipped} samples clipped"
    )
