"""Command `drums`: modes of a drum, its motion by the physics and by a model, their errors, and its sound."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.commands.motion import SolverOption
from app.commands.render import BitsOption
from app.shared.vocabulary import WRITTEN_ENDINGS, PlayedSource
from engine.bounds import MOST_FRAMES
from training.cli import arguments
from training.cli.arguments import Json
from training.cli.console import Failure, ProgressReport, number, print_json, print_table, progress

if TYPE_CHECKING:
    from app.commands.arrays import Array
    from app.instruments.instrument import Instrument
    from app.player.drum_keys import DrumKey
    from engine.resonators.drum import DrumModes
    from engine.strike import Strike
    from training.family.drums import StruckDrum
    from training.family.motion import Blocks, Player

drums = typer.Typer(help="Motions and sounds of drums.", no_args_is_help=True)
DrumName = Annotated[
    str, typer.Argument(metavar="DRUM.toml|INSTRUMENT", help="A drum's file, or an instrument of drums with --key.")
]
KeyOption = Annotated[
    int | None, typer.Option("--key", min=0, max=127, metavar="KEY", help="The MIDI key of an instrument's drum.")
]
Velocity = Annotated[int, typer.Option(min=1, max=127, help="Of the key; of a drum's file 0.2 to 8 m/s.")]
Seconds = Annotated[float, typer.Option(metavar="S", help="Duration in s.")]
Place = Annotated[
    tuple[float, float] | None,
    typer.Option(metavar="X Y", help="Where it is struck, from the centre in half-lengths; default its own place."),
]
Rate = Annotated[int, typer.Option(min=8_000, max=192_000, metavar="HZ", help="Sample rate.")]
OutputFile = Annotated[Path, typer.Argument(metavar="OUT.npy", help="Motion (steps + 1, rows, columns) in m.")]
Steps = Annotated[int, typer.Option(min=1, max=MOST_FRAMES, help="Frames after the blow.")]
Points = Annotated[
    int, typer.Option(min=3, max=513, metavar="N", help="Points of the grid along the longer side, rounded to odd.")
]
PresetOption = Annotated[
    str | None, typer.Option("--preset", metavar="PRESET", help="A preset of many strings; default the instrument's.")
]
LONGEST_S = 60.0
HIGHEST_HZ = 20_000.0  # of a drum's file
FILE_KEY = 60  # on which the drum of a file is played
FRAMES_AT_ONCE = 1_200
LARGEST_SHAPES_BYTES = 512 * 2**20  # of all modes on the grid


@drums.callback()
def _group() -> None:
    """Motions and sounds of drums."""


@drums.command()
def modes(
    drum: DrumName,
    key: KeyOption = None,
    count: Annotated[int, typer.Option(min=1, max=1_600, help="So many modes, the lowest.")] = 12,
    json: Json = False,
) -> None:
    """Print frequencies and decays of a drum's modes. Air counts, and the drop of pitch is added."""
    instrument, drum_key = drum_of(drum, key)
    drum_modes = drum_key.modes
    drops = {str(velocity): drum_key.drop_cents(velocity, instrument.pluck.curve) for velocity in (32, 64, 127)}
    facts = {"modes": len(drum_modes), "hardest_m_s": drum_key.played.hardest_m_s, "drop_cents": drops}
    rows = [*mode_rows(drum_modes, min(count, len(drum_modes)))]
    if json:
        print_json({**facts, "lowest": rows})
        return
    print_table(
        ("m", "n", "Hz", "T60 s", "mass with air / without"),
        [[r["m"], r["n"], round(r["hz"], 2), round(r["t60_s"], 3), round(r["air_mass"], 3)] for r in rows],
    )
    words = ", ".join(f"{cents:.0f} cents at velocity {velocity}" for velocity, cents in drops.items())
    print(f"{len(drum_modes)} modes; pitch drop {words}; hardest blow {drum_key.played.hardest_m_s:g} m/s")


@drums.command()
def simulate(
    drum: DrumName,
    out: OutputFile,
    steps: Steps,
    key: KeyOption = None,
    velocity: Velocity = 100,
    place: Place = None,
    rate: Rate = 48_000,
    points: Points = 33,
    linear: Annotated[bool, typer.Option("--linear", help="Without tension modulation.")] = False,
    solver: SolverOption = "fast",
) -> None:
    """Simulate the motion of a struck drum by the physics.

    OUT has its displacement on a grid, the first row at the top, 0 outside the drum.
    """
    from training.family.motion import linear_motion, true_motion

    blow = _blow_of(drum, key, velocity, place)
    with progress(out.name) as report:
        if solver == "dop853":
            motion = _dop853(blow.struck(linear), rate, steps, report)
        else:
            motion = (linear_motion if linear else true_motion)(blow.struck(), rate)
        _write(out, blow, motion, steps, points, report)


@drums.command()
def predict(
    drum: DrumName,
    out: OutputFile,
    steps: Steps,
    key: KeyOption = None,
    velocity: Velocity = 100,
    place: Place = None,
    rate: Rate = 48_000,
    points: Points = 33,
    preset: PresetOption = None,
) -> None:
    """Predict the motion of a struck drum by a model of many strings.

    OUT is as that of `drums simulate`.
    """
    blow = _blow_of(drum, key, velocity, place, preset)
    with progress(out.name) as report:
        _write(out, blow, blow.player()(blow.struck(), rate), steps, points, report)


@drums.command()
def render(
    drum: DrumName,
    out: Annotated[Path, typer.Argument(metavar="OUT.wav", help="The file to write, or OUT.flac.")],
    key: KeyOption = None,
    velocity: Velocity = 100,
    place: Place = None,
    seconds: Seconds = 3.0,
    source: Annotated[
        PlayedSource, typer.Option(help="The learned model, the truth (the solved physics), or their difference.")
    ] = "model",
    rate: Rate = 48_000,
    bits: BitsOption = "24",
    preset: PresetOption = None,
) -> None:
    """Render a blow on a drum to a WAV or FLAC file."""
    arguments.check_range("--seconds", seconds, 0.01, LONGEST_S, "s")
    arguments.check_suffix("OUT.wav", out, *WRITTEN_ENDINGS)
    blow = _blow_of(drum, key, velocity, place, preset)
    from app.export.played import Played, write_played
    from app.export.wav import WavSettings
    from app.player.events import NoteOn, TimedEvent

    events = [TimedEvent(0.0, NoteOn(blow.key.key, velocity, place=place))]
    loaded, played = arguments.open_preset(blow.instrument.preset), Played(blow.instrument, events, source)
    with progress(blow.instrument.name) as report:
        written = write_played(out, [(played, loaded)], "", WavSettings(bits, rate), seconds, report)
    print(f"{out}: {written.seconds:.1f} s of {source}, peak {written.peak_db:.1f} dBFS")


@drums.command()
def compare(
    drum: DrumName,
    key: KeyOption = None,
    velocity: Velocity = 127,
    place: Place = None,
    seconds: Seconds = 1.0,
    rate: Rate = 48_000,
    preset: PresetOption = None,
    json: Json = False,
) -> None:
    """Compare a drum's models with the truth.

    Prints relative errors over the whole surface, in total and by second. They are those of the model, of a series of
    backward error analysis, and of the linear drum.
    """
    arguments.check_range("--seconds", seconds, 0.01, LONGEST_S, "s")
    blow = _blow_of(drum, key, velocity, place, preset)
    import torch

    from training.family.motion import linear_motion, motion_errors, untrained_player

    torch.set_num_threads(1)
    players = {
        blow.instrument.preset: blow.player(),
        "r = p = 1/12": untrained_player("series"),
        "linear drum": linear_motion,
    }
    struck_drum = blow.struck()
    with progress("drums compare") as report:
        whole, *windows = motion_errors(struck_drum, players, rate, round(seconds * rate), report)
    if json:
        print_json(
            {
                "modes": struck_drum.resonator.modes,
                "tension_rise": struck_drum.tension_rise,
                "rel_mse": whole.rel_mse,
                "windows": [{"start_s": w.start_s, "stop_s": w.stop_s, "rel_mse": w.rel_mse} for w in windows],
            }
        )
        return
    print(
        f"{blow.key.played.name}, {struck_drum.resonator.modes} modes, "
        f"rise of tension {struck_drum.tension_rise:.3g}, {rate} Hz; relative MSE over the surface:"
    )
    rows = [[f"{w.start_s:g} … {w.stop_s:g} s", *map(number, w.rel_mse.values())] for w in (*windows, whole)]
    print_table(("", *players), rows if len(windows) > 1 else rows[1:])


@dataclass(frozen=True)
class _Blow:
    """A drum of an instrument, and a blow on it."""

    instrument: Instrument
    key: DrumKey
    strike: Strike

    def struck(self, linear: bool = False) -> StruckDrum:
        """The struck drum at its start; `linear`: without tension modulation."""
        from training.family.drums import StruckDrum

        return StruckDrum.by(self.strike, self.key.modes, not linear)

    def player(self) -> Player:
        """The player of the instrument's preset. Raises Failure: its model learned one string."""
        from training.family.motion import model_player

        try:
            return model_player(arguments.open_preset(self.instrument.preset).model)
        except ValueError as error:
            raise Failure(f"{self.instrument.preset}: {error}") from error


def _blow_of(
    drum: str, key: int | None, velocity: int, place: tuple[float, float] | None, preset: str | None = None
) -> _Blow:
    """The blow that the options of a command describe.

    Args:
        drum, key: see `drum_of`.
        place: from the centre in half-lengths; None: the drum's own.
        preset: plays in place of the instrument's; None: that one.

    Raises:
        typer.BadParameter: the place is not on the drum.
    """
    import numpy as np

    from engine.strike import Strike

    instrument, drum_key = drum_of(drum, key)
    if preset is not None:
        instrument = instrument.model_copy(update={"preset": preset})
    own_strike = drum_key.strike(velocity, instrument.pluck.curve)
    if place is None:
        return _Blow(instrument, drum_key, own_strike)
    if not drum_key.modes.surface.inside(np.array([place])):
        raise typer.BadParameter(
            f"must be on the drum, not {place[0]:g} {place[1]:g}; choose one nearer the centre", param_hint="--place"
        )
    return _Blow(instrument, drum_key, Strike(place, own_strike.speed_m_s, own_strike.mallet))


def drum_of(name: str, key: int | None) -> tuple[Instrument, DrumKey]:
    """The drum of a file, or of a key of an instrument.

    Raises:
        Failure, InstrumentError, SchemaError: there is none.
        typer.BadParameter: an instrument is named without a key.
    """
    from app.instruments.drums import Drums
    from app.instruments.library import find_instrument
    from app.player.drum_keys import DrumKeys
    from engine.values.ear import Ear

    if name.endswith(".toml"):
        instrument, key = _with_file(Path(name)), FILE_KEY
    else:
        instrument = find_instrument(name).instrument
    if not isinstance(instrument.strings, Drums):
        raise Failure(f"{instrument.name} has no drums; choose one of those that `instruments` lists under drums")
    played = ", ".join(str(drum.note) for drum in instrument.strings.drums)
    if key is None:
        raise typer.BadParameter(
            f"is missing; give a MIDI key of {instrument.name}: its drums have {played}", param_hint="--key"
        )
    drum_key = DrumKeys(instrument, Ear(tuple(instrument.pickup.points))).of_key(key)
    if drum_key is None:
        raise Failure(f"{instrument.name} has no drum on key {key}; its drums have the keys {played}")
    return instrument, drum_key


def _with_file(path: Path) -> Instrument:
    """An instrument of one drum, struck by a stick."""
    from app.instruments.drums import Drums, PlayedDrum
    from app.instruments.instrument import Instrument
    from engine.presets.of_string import read_drum

    drum = PlayedDrum(note=FILE_KEY, name="Drum", drum=read_drum(path)[0])
    return Instrument(name="Drum", category="drums", strings=Drums(drums=(drum,), highest_hz=HIGHEST_HZ))


def _dop853(struck_drum: StruckDrum, rate_hz: int, steps: int, report: ProgressReport) -> Blocks:
    """Solve a drum's motion by the slow reference; each call of the result gives the next frames, (frames, modes)."""
    import torch

    from engine.truth import solve_dop853

    rows = iter(solve_dop853(struck_drum.resonator, struck_drum.state, rate_hz, steps, report=report)[0, 1:])
    return lambda count: torch.stack([*islice(rows, count)])


def _write(out: Path, blow: _Blow, motion: Blocks, steps: int, points: int, report: ProgressReport) -> None:
    """Write the displacement (steps + 1, rows, columns) in m, from the blow on.

    Args:
        motion: each call gives the next frames of the modes' amplitudes, (frames, modes) in m.
        points: of the grid, along the longer side.

    Raises:
        Failure: the file or the modes' shapes on the grid would be too large.
    """
    import numpy as np

    from app.commands import arrays
    from app.rendering.blow import grid_of

    drum_modes = blow.key.modes
    inside, places = grid_of(drum_modes.surface, (drum_modes.drum.length_m, drum_modes.drum.width_m), points)
    arrays.check_result_size(1, steps + 1, inside.size)
    if (size := 8 * len(drum_modes) * len(places)) > LARGEST_SHAPES_BYTES:
        raise Failure(
            f"the shapes of {len(drum_modes)} modes at {len(places)} points would take {size / 2**20:.0f} MiB, more "
            f"than the {LARGEST_SHAPES_BYTES // 2**20} MiB allowed; lower --points"
        )
    shapes = drum_modes.shapes(places)
    at_once = max(1, min(FRAMES_AT_ONCE, arrays.BYTES_AT_ONCE // (8 * inside.size)))

    def pictures() -> Iterator[Array]:
        yield np.zeros((1, *inside.shape))
        for first in range(0, steps, at_once):
            amplitudes = motion(min(at_once, steps - first)).numpy()
            block = np.zeros((len(amplitudes), *inside.shape))
            block[:, inside] = amplitudes @ shapes
            yield block

    arrays.write_array(out, (steps + 1, *inside.shape), pictures(), report)


def mode_rows(drum_modes: DrumModes, count: int) -> Iterator[dict[str, float]]:
    """The lowest modes; `air_mass`: with air, relative to that without."""
    circles = dict[tuple[int, int], int]()
    surface = drum_modes.surface
    for place in range(count):
        omega, sigma = float(drum_modes.omega[place]), float(drum_modes.sigma[place])
        m, n = int(surface.m[place]), int(surface.n[place])
        if surface.round:
            circles[m, n] = n = circles.get((m, n), 0) + 1
        decay = {"hz": omega / math.tau, "t60_s": math.log(1000) / max(sigma, 1e-9)}
        yield {"m": m, "n": n, **decay, "air_mass": float(drum_modes.scale[place]) ** -2}
