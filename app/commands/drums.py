"""drums: modes of a drum, its sound, and the model compared with the truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.shared.vocabulary import PlayedSource
from training.cli import arguments
from training.cli.arguments import Json
from training.cli.console import Failure, number, print_json, print_table, progress

if TYPE_CHECKING:
    from app.instrument.drum_keys import DrumKey
    from app.patches.patch import Patch
    from engine.resonators.drum import DrumModes
    from engine.strike import Strike

drums = typer.Typer(help="Modes and sounds of drums.", no_args_is_help=True)
PatchOption = Annotated[str, typer.Argument(metavar="PATCH", help="An instrument of drums, by name or as a file.")]
KeyOption = Annotated[int, typer.Argument(metavar="KEY", min=0, max=127, help="A MIDI key of it.")]
Velocity = Annotated[int, typer.Option(min=1, max=127, help="Of the key.")]
Seconds = Annotated[float, typer.Option(metavar="S", help="Duration in s.")]
Place = Annotated[
    tuple[float, float] | None,
    typer.Option(metavar="X Y", help="Where it is struck, from the centre in half-lengths; default its own place."),
]
Rate = Annotated[int, typer.Option(metavar="HZ", help="Sample rate.")]
LONGEST_S = 60.0
HIGHEST_HZ = 20_000.0


@drums.callback()
def _group() -> None:
    """Modes and sounds of drums."""


@drums.command()
def modes(
    drum: Annotated[str, typer.Argument(metavar="DRUM.toml|PATCH", help="A drum's file, or an instrument of drums.")],
    key: Annotated[int | None, typer.Argument(metavar="KEY", help="A MIDI key of the instrument.")] = None,
    count: Annotated[int, typer.Option(min=1, max=1_600, help="So many modes, the lowest.")] = 12,
    json: Json = False,
) -> None:
    """Print frequencies and decays of a drum's modes, with air; of a key also its pitch drop."""
    facts: dict[str, Any] = {}
    if drum.endswith(".toml"):
        found = _of_file(Path(drum), count)
    else:
        if key is None:
            raise typer.BadParameter("is missing; give a MIDI key of the instrument", param_hint="KEY")
        patch, struck = _key_of(drum, key)
        found = struck.modes
        facts = {
            "modes": len(found),
            "hardest_m_s": struck.played.hardest_m_s,
            "drop_cents": {
                str(velocity): struck.drop_cents(velocity, patch.pluck.curve) for velocity in (32, 64, 127)
            },
        }
    rows = [
        {"m": m, "n": n, "hz": hz, "t60_s": t60, "air_mass": mass}
        for m, n, hz, t60, mass in _rows(found, min(count, len(found)))
    ]
    if json:
        print_json({**facts, "lowest": rows})
        return
    print_table(
        ("m", "n", "Hz", "T60 s", "mass with air / without"),
        [[r["m"], r["n"], round(r["hz"], 2), round(r["t60_s"], 3), round(r["air_mass"], 3)] for r in rows],
    )
    if facts:
        drops = ", ".join(f"{cents:.0f} cents at velocity {v}" for v, cents in facts["drop_cents"].items())
        print(f"{facts['modes']} modes; pitch drop {drops}; hardest blow {facts['hardest_m_s']:g} m/s")


@drums.command()
def strike(
    patch: PatchOption,
    key: KeyOption,
    out: Annotated[Path, typer.Argument(metavar="OUT.wav", help="The file to write.")],
    velocity: Velocity = 100,
    place: Place = None,
    seconds: Seconds = 3.0,
    source: Annotated[
        PlayedSource, typer.Option(help="The learned model, the truth (the solved physics), or their difference.")
    ] = "model",
    rate: Rate = 48_000,
) -> None:
    """Render a blow on a drum to a WAV file of 24 bits."""
    arguments.check_range("--seconds", seconds, 0.01, LONGEST_S, "s")
    chosen, struck = _key_of(patch, key)
    _strike_of(struck, velocity, place)
    from app.export.played import write_played
    from app.export.wav import WavSettings
    from app.instrument.events import NoteOn, TimedEvent

    loaded, events = arguments.open_preset(chosen.preset), [TimedEvent(0.0, NoteOn(key, velocity, place=place))]
    with progress(f"{chosen.name}") as report:
        written = write_played(
            out,
            chosen,
            loaded,
            events,
            "",
            source,
            WavSettings("24", rate),
            seconds,
            lambda done_s: report(min(0.99, done_s / seconds)),
        )
    print(f"{out}: {written.seconds:.1f} s of {source}, peak {written.level.peak_db:.1f} dBFS")


@drums.command()
def compare(
    patch: PatchOption,
    key: KeyOption,
    velocity: Velocity = 127,
    place: Place = None,
    seconds: Seconds = 1.0,
    rate: Rate = 48_000,
    json: Json = False,
) -> None:
    """Compare model and linear drum with the truth, over the whole surface."""
    arguments.check_range("--seconds", seconds, 0.01, LONGEST_S, "s")
    chosen, struck = _key_of(patch, key)
    import numpy as np
    import torch

    from training.family.drums import StruckDrum, linear_drum, model_player, motion_errors

    speeds = _strike_of(struck, velocity, place, chosen.pluck.curve).speeds(struck.modes)
    resonator = struck.modes.resonator(np.zeros((1, 2)))
    rise = float(resonator.relative_tension_rise(speeds / resonator.omega))
    start = np.zeros_like(speeds)
    drum = StruckDrum("tom", struck.modes.drum, resonator, start, speeds, struck.modes.scale**2, rise)
    torch.set_num_threads(1)
    players = {
        chosen.preset: model_player(arguments.open_preset(chosen.preset).model),
        "linear drum": linear_drum,
    }
    errors = motion_errors(drum, players, rate, round(seconds * rate))
    if json:
        print_json({"modes": resonator.modes, "tension_rise": rise, "rel_mse": errors})
        return
    print(
        f"{struck.played.name}, {resonator.modes} modes, rise of tension {rise:.3g}, first {seconds:g} s at {rate} Hz"
    )
    print_table(("", "rel. MSE over the surface"), [[name, number(error)] for name, error in errors.items()])


def _strike_of(struck: DrumKey, velocity: int, place: tuple[float, float] | None, curve: float = 0.0) -> Strike:
    """The blow at a place. Raises typer.BadParameter: it is not on the drum."""
    import numpy as np

    from engine.strike import Strike

    own = struck.strike(velocity, curve)
    if place is None:
        return own
    if not struck.modes.surface.inside(np.array([place])):
        raise typer.BadParameter(
            f"must be on the drum, not {place[0]:g} {place[1]:g}; choose one nearer the centre", param_hint="--place"
        )
    return Strike(place, own.speed_m_s, own.mallet)


def _of_file(path: Path, count: int) -> DrumModes:
    from engine.presets.of_string import read_drum

    return read_drum(path)[0].modes(HIGHEST_HZ, count)


def _key_of(name: str, key: int) -> tuple[Patch, DrumKey]:
    from app.instrument.drum_keys import DrumKeys
    from app.patches.drums import Drums
    from app.patches.library import find_patch
    from engine.voices import Ear

    patch = find_patch(name).patch
    if not isinstance(patch.strings, Drums):
        raise Failure(f"{patch.name} has no drums; choose one of those that `instruments` lists under drums")
    found = DrumKeys(patch, Ear(tuple(patch.pickup.points))).of_key(key)
    if found is None:
        played = ", ".join(str(each.note) for each in patch.strings.drums)
        raise Failure(f"{patch.name} has no drum on key {key}; its drums have the keys {played}")
    return patch, found


def _rows(found: DrumModes, count: int) -> list[tuple[int, int, float, float, float]]:
    import math

    from engine.resonators.surface import Circle, Rectangle

    rows, circles = [], dict[tuple[int, bool], int]()
    for place in range(count):
        surface, omega, sigma = found.surface, float(found.omega[place]), float(found.sigma[place])
        m = n = 0
        if isinstance(surface, Rectangle):
            m, n = int(surface.m[place]), int(surface.n[place])
        elif isinstance(surface, Circle):
            kind = int(surface.m[place]), bool(surface.sine[place])
            circles[kind] = circles.get(kind, 0) + 1
            m, n = kind[0], circles[kind]
        t60_s = math.log(1000) / max(sigma, 1e-9)
        rows.append((m, n, omega / math.tau, t60_s, float(found.scale[place]) ** -2))
    return rows
