"""The benchmarks' command line: `python3 run.py bench NAME`.

Exit status: as of `learned-strings`; `soak` exits with 1 where the program failed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.commands.cli import carry_out
from training.cli.arguments import Json
from training.cli.console import Failure, ProgressReport, progress, say

if TYPE_CHECKING:
    from app.audio.choices import Buffer
    from app.instruments.instrument import Instrument

bench = typer.Typer(
    help="Measure speed, sound and memory on this machine.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

BufferName = Annotated[
    str, typer.Option("--buffer", help="The device's: low, medium, high, or 128, 256, 512, 1024 or 2048 frames.")
]
Seed = Annotated[int, typer.Option(min=0, help="Of the random keys.")]

PLAIN = {  # benchmarks without options, on one thread, as in the app, where window and sound need the others
    "render": "Real-time factor and first-block latency of every model.",
    "voices": "Cost of a voice and of 64 notes of an instrument, and how many voices fit on a core.",
    "plugin": "Voices of a plug-in compared with the app: how many times faster than real time each plays 36 notes.",
    "drums": "Frequencies and pitch drops of drums compared with published ones; cost of drums, a kit, and choosing.",
    "effects": "Cost of body and room: shares of a core, and the slowest quantum.",
}


def run(
    name: str, work: Callable[[ProgressReport], Mapping[str, Any]], json: bool, threads: int | None = None
) -> Mapping[str, Any]:
    """Carry out a benchmark with its progress, and print its figures below the machine.

    Args:
        threads: to which torch is limited.
    """
    from bench import machine
    from bench.printing import show

    with progress(f"bench {name}") as report, machine.threads(threads):
        found = {"machine": machine.Machine.here(), **work(report)}
    show(found, json)
    return found


def _plain(name: str) -> Callable[[bool], None]:
    def command(json: Json = False) -> None:
        run(name, lambda report: import_module(f"bench.{name}").measure(report), json, threads=1)

    return command


for _name, _help in PLAIN.items():
    bench.command(_name, help=_help)(_plain(_name))


@bench.command()
def memory() -> None:
    """Resident memory of the running app: in Play, after 20 notes, in the Lab. Its window is open for 45 s."""
    from bench.memory import main as watch

    raise typer.Exit(watch())


@bench.command()
def train(
    json: Json = False,
    against: Annotated[
        Path | None, typer.Option(metavar="PYTHON", help="A Python with jax, flax, optax and einops.")
    ] = None,
    source: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="A clone of rodrigodzf/physmodjax, the authors' code.")
    ] = None,
    gpu: Annotated[bool, typer.Option("--gpu", help="Measure several seeds at once on the GPU.")] = False,
) -> None:
    """Time and kernel launches of a training step of every model; or its time compared with the authors' code.

    With --against and --source steps of both are taken in turns, on as many threads.
    """
    from bench import authors
    from bench import train as of_train

    if (against is None) != (source is None):
        raise typer.BadParameter("--against and --source go together")
    if against is not None and source is not None:
        run("train", partial(authors.measure, against.absolute(), source.absolute()), json)
    else:
        run("train", of_train.measure_on_gpu if gpu else of_train.measure, json)


@bench.command()
def recordings(
    folder: Annotated[Path | None, typer.Argument(metavar="FOLDER", help="Of recordings, one note each.")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="No baselines, no halves; with --gate no fit.")] = False,
    most: Annotated[int | None, typer.Option("--most", min=1, metavar="N", help="The first N files alone.")] = None,
    gate: Annotated[
        int | None,
        typer.Option(min=0, metavar="N", help="Only which of N synthetic notes, and the folder's, are kept."),
    ] = None,
    fit_every: Annotated[
        int, typer.Option("--fit-every", min=1, metavar="N", help="With --gate: one of N notes is fitted.")
    ] = 20,
    synthetic: Annotated[
        int | None,
        typer.Option(min=1, metavar="N", help="Instead: N synthetic notes, and how intervals hold them."),
    ] = None,
    json: Json = False,
) -> None:
    """Errors of a folder's recordings: own note, linear baselines, unseen half; or which sounds the gate keeps."""
    from bench.recordings import coverage, evaluate
    from bench.recordings import gate as of_gate

    if synthetic is not None:
        run("recordings", partial(coverage.measure, synthetic), json)
        return
    if folder is None and not gate:
        raise typer.BadParameter("give a folder of recordings, or --synthetic or --gate", param_hint="FOLDER")
    found = _notes(folder, most) if folder is not None else {}
    if gate is not None:
        run("recordings", partial(of_gate.measure, found, gate, 0 if quick else fit_every), json)
    else:
        run("recordings", partial(evaluate.measure, found, quick), json)


@bench.command()
def app(
    json: Json = False,
    starts: Annotated[int, typer.Option(min=1, help="Timed starts, after one that is not.")] = 3,
) -> None:
    """Time from the start until the window is shown, and until keys sound. Windows open."""
    from bench.start import measure

    run("app", partial(measure, starts), json)


@bench.command()
def play(
    json: Json = False,
    seconds: Annotated[float, typer.Option(min=1.0, metavar="S", help="Duration of playing, in s.")] = 60.0,
    rate: Annotated[float, typer.Option(min=0.5, max=20.0, help="Plucks per second.")] = 12.0,
    buffer: BufferName = "medium",
    busy: Annotated[bool, typer.Option("--busy", help="Beside a process that keeps a core busy.")] = False,
    seed: Seed = 0,
    instrument: Annotated[
        str, typer.Option("--instrument", metavar="INSTRUMENT", help="The instrument that is played.")
    ] = "concert_harp",
    preset: Annotated[
        str | None, typer.Option(metavar="PRESET", help="A string's preset instead, in the Lab: ten keys pluck it.")
    ] = None,
) -> None:
    """Holes, clicks and latency of the app's sound, recorded.

    The app runs on a private screen and is played by keys. Linux only. Needs PulseAudio and Xvfb; starts a sound
    server and a screen of its own, and leaves yours alone.
    """
    from bench.play.measure import measure

    chosen = _instrument(instrument) if preset is None else _single(preset)
    run("play", partial(measure, seconds, rate, _buffer(buffer), busy, seed, chosen), json)


@bench.command()
def soak(
    json: Json = False,
    minutes: Annotated[float, typer.Option(min=0.01, metavar="MIN", help="Duration in minutes.")] = 10.0,
    seed: Seed = 0,
    buffer: BufferName = "medium",
    instrument: Annotated[
        list[str] | None,
        typer.Argument(metavar="INSTRUMENT", help="Names or files of instruments; default: the harp."),
    ] = None,
    every: Annotated[bool, typer.Option("--every-instrument", help="Play all of the factory in turn.")] = False,
) -> None:
    """Holes, memory and faults of a long session: twelve keys per second, on one instrument or several in turn.

    It needs the same as `play`. Exit status 1 where there are faults.
    """
    from app.instruments.library import SHIPPED, list_instruments
    from bench.soak import measure

    instruments = [_instrument(name) for name in instrument or ["concert_harp"]]
    if every:
        instruments = [entry.instrument for entry in list_instruments(SHIPPED)[0]]
    if run("soak", partial(measure, 60 * minutes, seed, _buffer(buffer), instruments), json)["soak"].faults:
        raise typer.Exit(1)


def _notes(folder: Path, most: int | None) -> dict[str, Any]:
    """Samples and rate of a folder's recordings by name; those that cannot be read are named."""
    from app.audio.note_file import NoteFileError, read_note

    kinds = (".wav", ".flac", ".aif", ".aiff")
    files = sorted(path for path in folder.glob("*") if path.suffix.lower() in kinds)
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
    return found


def _buffer(text: str) -> Buffer:
    from pydantic import ValidationError

    from app.audio.choices import SoundChoice

    try:
        return SoundChoice.model_validate({"buffer": int(text) if text.isdecimal() else text}).buffer
    except ValidationError:
        raise typer.BadParameter("low, medium, high, 128, 256, 512, 1024 or 2048", param_hint="--buffer") from None


def _instrument(name: str) -> Instrument:
    from app.instruments.library import InstrumentError, find_instrument

    try:
        return find_instrument(name).instrument
    except InstrumentError as error:
        raise Failure(str(error)) from error


def _single(name: str) -> str:
    from engine.folders import usable_files
    from engine.presets import find_preset

    files = usable_files()
    if (found := find_preset(name, files)) not in files:
        raise typer.BadParameter("the name of a preset, as `learned-strings presets` lists it", param_hint="--preset")
    return found.stem


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a benchmark's command line (default: the process's own) and return the exit status."""
    return carry_out(bench, arguments, "run.py bench")
