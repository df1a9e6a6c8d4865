"""The benchmarks' command line: `python3 run.py bench NAME`.

Exit status: as of `learned-strings`; `tour`, `unplug` and `soak` exit with 1 where a target is missed.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from app.commands.cli import carry_out
from tests.bench.baselines.command import baseline
from tests.bench.instruments import timbre
from tests.bench.printing import show
from tests.bench.recordings.command import recordings
from training.cli.arguments import Json
from training.cli.console import Failure, progress

if TYPE_CHECKING:
    from app.audio.choices import Buffer
    from app.patches.instrument import SingleString
    from app.patches.patch import Patch

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
PatchName = Annotated[str, typer.Option("--instrument", metavar="INSTRUMENT", help="The instrument that is played.")]
Seed = Annotated[int, typer.Option(min=0, help="Of the random keys and changes.")]


def _measure(name: str, json: bool) -> None:
    """Run and show a benchmark without options."""
    from importlib import import_module

    with progress(f"bench {name}") as report:
        found = import_module(f"tests.bench.{name}").measure(report)
    show(found, json)


@bench.command()
def solver(
    json: Json = False,
    batch: Annotated[int, typer.Option(min=1, max=1000, help="Trajectories at once.")] = 100,
    steps: Annotated[int, typer.Option(min=1, help="Samples of each trajectory.")] = 4000,
) -> None:
    """Cost and error of the fast solver against DOP853, on the worst trajectory of each of the paper's data sets."""
    from tests.bench.solver import measure

    with progress("bench solver") as report:
        found = measure(batch, steps, report)
    show(found, json)


@bench.command()
def render(json: Json = False) -> None:
    """Real-time factor and first-block latency of every model, on one thread."""
    _measure("render", json)


@bench.command()
def voices(json: Json = False) -> None:
    """Cost and error of a voice, the cost of a pluck, and how many voices fit on a core."""
    _measure("voices", json)


@bench.command()
def plugin(json: Json = False) -> None:
    """Voices of a plug-in compared with the app: how many times faster than real time each plays 30 notes."""
    _measure("plugin", json)


@bench.command()
def drums(json: Json = False) -> None:
    """Cost of a drum's voice by its modes, of a kit of 16 with 8 strings, of pictures, and of choosing drums."""
    _measure("drums", json)


@bench.command()
def effects(json: Json = False) -> None:
    """Cost of body and room: shares of a core, the slowest quantum, and the time to set them."""
    _measure("effects", json)


@bench.command()
def take(json: Json = False) -> None:
    """Time and memory of a pluck's pictures and signals, and after its listening point has moved."""
    _measure("take", json)


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
    if gpu:
        from tests.bench.train import measure_on_gpu

        with progress("bench train") as report:
            show(measure_on_gpu(report), json)
        return
    if against is None and source is None:
        _measure("train", json)
        return
    if against is None or source is None:
        raise typer.BadParameter("--against and --source go together")
    from tests.bench.authors import measure

    with progress("bench train") as report:
        found = measure(against.absolute(), source.absolute(), report)
    show(found, json)


@bench.command()
def tune(
    patch: Annotated[
        list[str] | None, typer.Argument(metavar="INSTRUMENT", help="Names or files of instruments; default: all.")
    ] = None,
    every: Annotated[int, typer.Option(min=1, max=24, help="Semitones from one measured key to the next.")] = 6,
    json: Json = False,
) -> None:
    """Pitch and loudness of patches over their range.

    Also the level of a chord, and the model's error against the truth while a key is bent and plucked again.
    """
    from app.patches.library import list_patches
    from tests.bench.tune import measure
    from training.cli.arguments import open_preset

    chosen = [_patch(name) for name in patch] if patch else [entry.patch for entry in list_patches()[0]]
    presets = {name: open_preset(name) for name in {each.preset for each in chosen}}
    with progress("bench tune") as report:
        found = measure([(each, presets[each.preset]) for each in chosen], every, report)
    show(found, json)


bench.command()(timbre)
bench.command()(recordings)
bench.command()(baseline)


@bench.command()
def app(
    json: Json = False,
    seconds: Annotated[float, typer.Option(min=0.1, metavar="S", help="Observation of the picture, in s.")] = 5.0,
    starts: Annotated[int, typer.Option(min=1, help="Timed starts, after one that is not.")] = 3,
) -> None:
    """Time until the window can be played, and its frame rate. A window opens for a minute."""
    from tests.bench.app import measure

    with progress("bench app") as report:
        found = measure(starts, seconds, report)
    show(found, json)


@bench.command()
def play(
    json: Json = False,
    seconds: Annotated[float, typer.Option(min=1.0, metavar="S", help="Duration of playing, in s.")] = 60.0,
    rate: Annotated[float, typer.Option(min=0.5, max=20.0, help="Plucks per second.")] = 12.0,
    buffer: BufferName = "medium",
    busy: Annotated[
        bool | None,
        typer.Option(
            "--busy/--alone", help="Only with a process that keeps a core busy, or only without; default both."
        ),
    ] = None,
    seed: Seed = 0,
    patch: PatchName = "concert_harp",
    preset: Annotated[
        str | None, typer.Option(metavar="PRESET", help="A string's preset instead, in the Lab: ten keys pluck it.")
    ] = None,
) -> None:
    """Holes, clicks and latency of the app's sound, recorded.

    The app runs on a private screen and is played by keys. Linux only. Needs PulseAudio and Xvfb; starts a sound
    server and a screen of its own, and leaves yours alone.
    """
    from tests.bench.play.measure import measure

    chosen, instrument = _buffer(buffer), _patch(patch) if preset is None else _single(preset)
    with progress("bench play") as report:
        found = measure(seconds, rate, chosen, (False, True) if busy is None else (busy,), seed, instrument, report)
    show(found, json)


@bench.command()
def tour(
    patch: Annotated[
        list[str] | None, typer.Argument(metavar="INSTRUMENT", help="Names or files of instruments; default: all.")
    ] = None,
    buffer: BufferName = "medium",
    out: Annotated[Path | None, typer.Option(help="WAV file of the recording.")] = None,
    json: Json = False,
) -> None:
    """Holes, clicks and levels of every factory instrument. Status 1 where one has a hole, or a key is not heard.

    Each is chosen in the window's browser and plays a phrase by keys. Linux only. Needs PulseAudio and Xvfb; starts a
    sound server and a screen of its own, and leaves yours alone.
    """
    from app.patches.library import SHIPPED, list_patches
    from tests.bench.play.tour import measure

    chosen = [_patch(name) for name in patch] if patch else [entry.patch for entry in list_patches(SHIPPED)[0]]
    with progress("bench tour") as report:
        found = measure(chosen, _buffer(buffer), out, report)
    show(found, json)
    if not found.passed:
        raise typer.Exit(1)


@bench.command()
def notes(
    json: Json = False,
    by: Annotated[Literal["midi", "keys", "both"], typer.Option(help="What plays the notes.")] = "both",
    buffer: BufferName = "medium",
    seed: Seed = 0,
    patch: PatchName = "classical_guitar",
) -> None:
    """Pitch, loudness, damping and latency of notes, recorded, without body and room.

    A melody, chords, repeats, bends and a pedal are played by MIDI and by keys. Linux only. Needs PulseAudio, Xvfb
    and, for MIDI, JACK; starts a sound server and a screen of its own, and leaves yours alone.
    """
    from tests.bench.play.notes import measure

    chosen, found_patch = _buffer(buffer), _patch(patch)
    if found_patch.damping.let_ring:
        raise Failure(f"{found_patch.name}: its strings ring on after a key's release; choose one with dampers")
    with progress("bench notes") as report:
        found = measure(by, chosen, seed, found_patch, report)
    show(found, json)


@bench.command()
def unplug(
    json: Json = False,
    times: Annotated[int, typer.Option(min=1, max=1000, help="How often the device goes and comes back.")] = 20,
    seed: Seed = 0,
    patch: PatchName = "concert_harp",
) -> None:
    """The sound device is taken away and given back while the app is played. Status 1 where sound is not back in 2 s.

    In turn the card goes, and the sound server. Linux only; needs PulseAudio and Xvfb, and touches nothing of the
    sound and the screen in use.
    """
    from tests.bench.play.unplug import measure

    found_patch = _patch(patch)
    with progress("bench unplug") as report:
        found = measure(times, seed, found_patch, report)
    show(found, json)
    if not found.passed:
        raise typer.Exit(1)


@bench.command()
def soak(
    json: Json = False,
    minutes: Annotated[float, typer.Option(min=0.01, metavar="MIN", help="Duration in minutes.")] = 10.0,
    playing: Annotated[bool, typer.Option("--playing", help="Twelve keys per second, without a pause.")] = False,
    seed: Seed = 0,
    buffer: BufferName = "medium",
) -> None:
    """Holes, memory, threads and faults of a long session.

    Of random plucks and changes, or, with --playing, of keys alone. Exit status 1 where there are faults. Linux only.
    Needs PulseAudio; starts a sound server of its own, and leaves yours alone.
    """
    from tests.bench.soak import soak as run_soak

    with progress("bench soak") as report:
        found = run_soak(60 * minutes, seed, playing, _buffer(buffer), report)
    show(found, json)
    if found.faults or found.threads_left:
        raise typer.Exit(1)


def _buffer(text: str) -> Buffer:
    from pydantic import ValidationError

    from app.audio.choices import SoundChoice

    try:
        return SoundChoice.model_validate({"buffer": int(text) if text.isdecimal() else text}).buffer
    except ValidationError:
        raise typer.BadParameter("low, medium, high, 128, 256, 512, 1024 or 2048", param_hint="--buffer") from None


def _patch(name: str) -> Patch:
    from app.patches.library import PatchError, find_patch

    try:
        return find_patch(name).patch
    except PatchError as error:
        raise Failure(str(error)) from error


def _single(name: str) -> SingleString:
    from app.patches.instrument import SingleString
    from engine.folders import usable_files
    from engine.presets import find_preset

    files = usable_files()
    if (found := find_preset(name, files)) not in files:
        raise typer.BadParameter("the name of a preset, as `learned-strings presets` lists it", param_hint="--preset")
    return SingleString(preset=found.stem)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a benchmark's command line (default: the process's own) and return the exit status."""
    return carry_out(bench, arguments, "run.py bench")
