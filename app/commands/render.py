"""Command `render`: a pluck to a sound file, or the recipe of one once more."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from app.commands import options
from app.shared.vocabulary import WRITTEN_ENDINGS, Bits, Source
from engine.values.ear import Pickup
from training.cli import arguments
from training.cli.console import Failure, progress, say

if TYPE_CHECKING:
    from app.export.note import WavReport
    from app.export.wav import WavSettings
    from app.rendering.note_sound import NoteSound
    from engine.presets import Preset

Value = TypeVar("Value")
SILENT_DB = -120.0  # peak below which a note says that the file is silent

BitsOption = Annotated[
    Bits, typer.Option(help="16 (dithered) or 24 bits; of WAV also 32f: floating point, never clips.")
]


PickupOption = Annotated[
    Pickup,
    typer.Option(
        help="What is picked up; velocity is brighter by 6 dB per octave, its full scale is 30 m/s; bridge is "
        "the force on the end at 0, its full scale is 20 N."
    ),
]


def render(
    context: typer.Context,
    position: Annotated[float | None, options.POSITION] = None,
    amplitude_mm: Annotated[float | None, options.AMPLITUDE_MM] = None,
    shape: options.Shape = options.DEFAULT_SHAPE,
    width: options.Width = options.DEFAULT_WIDTH,
    seconds: Annotated[float | None, options.SECONDS] = None,
    string: arguments.StringName = None,
    modes: arguments.StringModes = None,
    listen: options.Listen = options.DEFAULT_LISTEN,
    listen_right: options.ListenRight = None,
    pickup: PickupOption = "displacement",
    rate: Annotated[
        int | None,
        typer.Option(
            metavar="HZ",
            help="Sample rate; default the preset's own. Only a preset of many strings gains bandwidth by a higher "
            "one.",
        ),
    ] = None,
    bits: BitsOption = "24",
    source: Annotated[
        Source,
        typer.Option(help="truth: the solved physics; difference: model minus truth; both: model left, truth right."),
    ] = "model",
    difference_gain_db: options.GainDb = 0.0,
    decay_db: Annotated[
        float | None,
        typer.Option(metavar="DB", help="End when the sound has decayed by so much, after --seconds at the latest."),
    ] = None,
    normalise: Annotated[
        bool, typer.Option("--normalise", help="Normalise to -1 dBFS, with one gain for model and truth.")
    ] = False,
    preset: Annotated[
        str | None, typer.Argument(metavar="PRESET", help="A preset's name or the path of its file.")
    ] = None,
    out: Annotated[Path | None, typer.Argument(metavar="OUT.wav", help="The file to write, or OUT.flac.")] = None,
    as_recorded: Annotated[
        bool,
        typer.Option(
            "--as-recorded",
            help="Render the recorded note of a learned preset: pitch, level, onset, rate and length. Give PRESET "
            "and OUT.wav with it, and --bits.",
        ),
    ] = False,
    recipe: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.wav",
            help="Render the recipe in this WAV or FLAC file again. Give only OUT.wav with it; by default its name "
            "follows from the recipe, in the current folder.",
        ),
    ] = None,
) -> None:
    """Render a pluck to a WAV or FLAC file. 10 mm of displacement at the listening point are full scale.

    PRESET, OUT.wav, --position, --amplitude-mm and --seconds are needed, except with --recipe.
    """
    from app.export.sound import IN_ONE_FILE
    from app.export.wav import DECAY_RANGE_DB, LONGEST_S, RATE_RANGE_HZ, WavSettings
    from app.rendering.note_sound import NoteSound
    from app.rendering.subject import StringOf, Subject
    from engine.values.ear import Ear

    if recipe is not None:
        _check_alone(context)
        _render_again(recipe, Path(preset) if preset else None)
        return
    if out is not None:
        arguments.check_suffix("OUT.wav", out, *WRITTEN_ENDINGS)
    preset, out = _require("PRESET", preset), _require("OUT.wav", out)
    if as_recorded:
        _render_as_recorded(preset, out, bits)
        return

    options.check(difference_gain_db=difference_gain_db)
    if decay_db is not None:
        arguments.check_range("--decay-db", decay_db, *DECAY_RANGE_DB, "dB")
    if rate is not None:
        arguments.check_range("--rate", rate, *RATE_RANGE_HZ, "Hz")
    position, amplitude_mm = _require("--position", position), _require("--amplitude-mm", amplitude_mm)
    seconds = _require("--seconds", seconds)
    pluck = options.check_pluck(position, amplitude_mm, shape, width)
    options.check(listen=listen, listen_right=listen_right)
    arguments.check_range("--seconds", seconds, 0, LONGEST_S, "s")
    loaded = arguments.open_preset_of_string(preset, string, rate, modes, to_render=True)
    info = loaded.info
    options.check_shortest(seconds, info.rate_hz)
    if source == "both" and listen_right is not None:
        raise typer.BadParameter(IN_ONE_FILE, param_hint="--source")
    points = (listen,) if listen_right is None else (listen, listen_right)
    subject: Subject = loaded.path
    if info.family is not None:
        subject = StringOf(loaded.path, info.string, info.rate_hz, info.modes)
    sound = NoteSound(subject, pluck, seconds, Ear(points, pickup))
    settings = WavSettings(bits, rate, normalise, decay_db=decay_db, difference_gain_db=difference_gain_db)
    _write(sound, loaded, source, out, settings)


def _check_alone(context: typer.Context) -> None:
    """Raise typer.BadParameter: more is given than a recipe and the file to write, which comes in place of PRESET."""
    sources = {name: context.get_parameter_source(name) for name in context.params}
    names = {name for name, source in sources.items() if source is not None and source.name == "COMMANDLINE"}
    if names - {"preset", "recipe"}:
        raise typer.BadParameter(
            "holds all that its sound was made with; give OUT.wav alone beside it", param_hint="--recipe"
        )


def _require(name: str, value: Value | None) -> Value:
    """Return an option's value. Raises typer.BadParameter: it is not given."""
    if value is None:
        raise typer.BadParameter("is missing (only --recipe goes without it)", param_hint=name)
    return value


def _render_as_recorded(preset: str, out: Path, bits: Bits) -> None:
    """Write the recorded note of a preset, as the preset plays it. Raises Failure: it has no recording."""
    from app.export.wav import WavSettings, form_of, write_wav
    from engine.folders import usable_files
    from engine.presets import find_preset, read_info
    from engine.whole_file import result_file

    info = read_info(find_preset(preset, usable_files()))
    if info.recorded is None:
        raise Failure(f"{preset}: was not learned from a recording; leave out --as-recorded, or choose one that was")
    note = info.recorded.note
    form = form_of(out, bits, note.rate_hz)
    tags = {"title": info.title, "comment": f"as recorded in {info.recorded.file}, SHA-256 {info.recorded.digest}"}
    with result_file(out) as file:
        level = write_wav(file, note.sound(), note.rate_hz, WavSettings(bits, fade_out_s=0.0), tags, form=form)
    print(f"{out}: {note.frames} frames at {note.rate_hz} Hz, peak {level.peak_db:.1f} dBFS")


def _render_again(file: Path, out: Path | None) -> None:
    """Render the recipe in a sound file; `out`: None for a new file in this folder, named after the recipe."""
    from app.export.note import default_file_name
    from app.export.recipe import changed_notices, preset_of, read_recipe
    from app.shared.version import program_version
    from engine.folders import usable_files

    recipe = read_recipe(file)
    path, exact = preset_of(recipe, usable_files())
    if out is None:
        ending = ending if (ending := file.suffix.lower()) in WRITTEN_ENDINGS else ".wav"
        rate_hz = recipe.settings.rate_hz or recipe.preset_rate_hz
        out = Path(default_file_name(path.stem, recipe.pluck, rate_hz, recipe.source, ending))
        if out.exists():
            raise Failure(f"{out}: is there already; say where to write, as in --recipe {file} OUT.wav")
    sound = recipe.sound(path, file)
    for notice in changed_notices(recipe, exact):
        say(f"note: {notice}")
    if recipe.version != program_version():
        say(f"note: {file} was made by version {recipe.version}, this is {program_version()}: bytes may differ")
    _write(sound, sound.load(), recipe.source, out, recipe.settings)


def _write(sound: NoteSound, preset: Preset, source: Source, out: Path, settings: WavSettings) -> None:
    """Write the file; then, so that a failure is the only line, print what is to be known of it."""
    from app.export.note import export_sounds
    from engine.plain_text import duration
    from engine.presets import outside_training

    with progress("render") as report:
        (written,) = export_sounds(sound, preset, {source: out}, settings, report)
    for words in outside_training(preset.info, sound.pluck) if source != "truth" else ():
        say(f"warning: {words}")
    if written.past_training_s > 0:
        say(f"note: from {duration(preset.info.horizon_s)} on, the model is past its training")
    if not written.decayed:
        say(f"note: the sound had not fallen by {settings.decay_db:g} dB after {duration(written.seconds)}")
    if written.peak_db < SILENT_DB:
        say("note: the file is silent; amplitude 0, or the string does not move at the listening point")
    print(_summary(written, settings.bits))


def _summary(written: WavReport, bits: Bits) -> str:
    level = f"peak {written.peak_db:.1f} dBFS, {written.clipped} samples clipped"
    kind = "32-bit float" if bits == "32f" else f"{bits} bits"
    return f"{written.path}: {written.frames} frames at {written.rate_hz} Hz, {kind}, {level}"
