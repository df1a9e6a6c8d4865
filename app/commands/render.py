"""render: a pluck to a WAV file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from app.commands import arguments
from app.commands.console import progress, say
from engine.pluck import DEFAULT_LISTEN

if TYPE_CHECKING:
    from app.export import SoundRequest, WavReport

SILENT_DB = -120.0

Bits = Literal["16", "24", "32f"]  # app.wav.Bits, known without soundfile
Source = Literal["model", "truth", "difference"]  # app.export.Source


def render(
    preset: arguments.PresetName,
    out: Annotated[Path, typer.Argument(metavar="OUT.wav", help="The file to write.")],
    position: arguments.Position,
    amplitude_mm: arguments.AmplitudeMm,
    seconds: arguments.Seconds,
    rate: Annotated[
        int | None,
        typer.Option(metavar="HZ", help="Sample rate; default the preset's own. A higher one adds no bandwidth."),
    ] = None,
    bits: Annotated[Bits, typer.Option(help="16 is dithered; 32f is floating point and never clips.")] = "24",
    listen: Annotated[float, typer.Option(help="Where to listen, 0 … 1 as for --position.")] = DEFAULT_LISTEN,
    source: Annotated[Source, typer.Option(help="difference is model minus truth.")] = "model",
    shape: arguments.Shape = arguments.DEFAULT_SHAPE,
    width: arguments.Width = arguments.DEFAULT_WIDTH,
    normalise: Annotated[bool, typer.Option("--normalise", help="To -1 dBFS, one gain for model and truth.")] = False,
) -> None:
    """Render a pluck to a WAV file. 10 mm of displacement at the listening point are full scale."""
    pluck = arguments.check_pluck(position, amplitude_mm, shape, width)
    from app.export import LONGEST_S, RATE_RANGE_HZ, SoundRequest, WavSettings, export_sound

    arguments.check_range("--seconds", seconds, 0, LONGEST_S, "s")
    arguments.check_range("--listen", listen, 0, 1)
    if rate is not None:
        arguments.check_range("--rate", rate, *RATE_RANGE_HZ, "Hz")
    loaded = arguments.open_preset(preset)
    if round(seconds * loaded.info.rate_hz) < 1:
        raise typer.BadParameter(
            f"must hold a sample of {loaded.info.rate_hz} Hz, not {seconds:g} s", param_hint="--seconds"
        )
    request = SoundRequest(loaded, pluck, listen, seconds, source)
    with progress("render") as report:
        written = export_sound(request, out, WavSettings(bits, rate, normalise), progress=report)
    for note in _notes(request):  # after the work: a failure is told in one line, alone
        say(note)
    if written.peak_db < SILENT_DB:
        say("note: the file is silent; amplitude 0, or the string does not move at the listening point")
    print(_summary(written, bits))


def _notes(request: SoundRequest) -> list[str]:
    from engine.preset import outside_training

    info = request.preset.info
    if request.source == "truth":
        return []
    notes = [f"warning: {words}" for words in outside_training(info, request.pluck)]
    if request.seconds > info.horizon_s:
        notes.append(f"note: from {info.horizon_s:g} s on, the model is past its training")
    return notes


def _summary(written: WavReport, bits: str) -> str:
    level = f"peak {written.peak_db:.1f} dBFS, {written.clipped} samples clipped"
    kind = "32-bit float" if bits == "32f" else f"{bits} bits"
    return f"{written.path}: {written.frames} frames at {written.rate_hz} Hz, {kind}, {level}"
