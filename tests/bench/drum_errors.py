"""drum-errors: how well models of many strings play drums that no model has seen.

Drums differ in kind, size, pitch, decay and blow. Half of the membranes are loaded by air. Decay rates scatter by
20 % from mode to mode. Half of the blows are those of a mallet (speeds alone), half begin pressed down, at rest.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal, get_args

import numpy as np
import torch
import typer

from engine.resonators.air import DENSITY_KG_M3
from engine.resonators.base import Array
from engine.resonators.drum import DrumModes, DrumParameters
from engine.resonators.surface import spread
from engine.strike import pulse_spectrum
from training.cli.arguments import Json, PresetName
from training.cli.console import number, print_json, print_table, progress
from training.cli.family import Rate, Seed, open_preset_of_many
from training.family.drums import (
    AT_ONCE,
    DrumPlayer,
    StruckDrum,
    finite,
    linear_drum,
    model_player,
    true_motion,
    untrained_player,
)
from training.family.errors import UNHEARD

Kind = Literal["tom", "frame drum", "small head", "rectangular membrane", "steel plate", "narrow plate"]
KINDS: tuple[Kind, ...] = get_args(Kind)
DRUMS_VERSION = 1  # of what a seed means
HIGHEST_HZ = 4_000.0
BRIGHT_HZ = 3_000.0
LEAST_MODES = 10
SLOWER = 8.0  # decays of drums that are measured in the tenth second

# of a kind: length in m, width in lengths, thickness in m, pitch in Hz (of the first mode in a vacuum)
Ranges = tuple[tuple[float, float], ...]
RANGES: Mapping[Kind, Ranges] = {
    "tom": ((0.22, 0.40), (1.0, 1.0), (1.5e-4, 3e-4), (70, 180)),
    "frame drum": ((0.30, 0.50), (1.0, 1.0), (2e-4, 5e-4), (60, 140)),
    "small head": ((0.12, 0.24), (1.0, 1.0), (1.5e-4, 4e-4), (150, 400)),
    "rectangular membrane": ((0.20, 0.45), (0.4, 0.95), (1.5e-4, 4e-4), (70, 200)),
    "steel plate": ((0.15, 0.50), (0.4, 0.95), (3e-4, 1.2e-3), (0, 0)),
    "narrow plate": ((0.15, 0.40), (0.05, 0.15), (5e-4, 2e-3), (0, 0)),
}
T60_S, BRIGHT_T60_S, RISE, RADIUS_M, CONTACT_S = (0.4, 2.5), (0.08, 0.35), (0.02, 0.5), (0.005, 0.04), (1e-3, 5e-3)
SCATTER = 0.2
AIRLESS: tuple[Kind, ...] = ("steel plate", "narrow plate")


def draw_drum(number: int, seed: int = 0) -> StruckDrum:
    """The drum of a number; the same for ever, however many are drawn."""
    random = np.random.default_rng((DRUMS_VERSION, seed, number))
    kind = KINDS[number % len(KINDS)]
    while True:
        drum = _drawn(random, kind)
        try:
            modes = drum.modes(HIGHEST_HZ)
        except ValueError:
            continue  # a plate so stiff that none is so low
        if len(modes) >= LEAST_MODES:
            break
    circle = drum.shape == "circle"
    place = _place(random, circle)
    resonator = modes.resonator(np.array([place]))
    scatter = random.uniform(1 - SCATTER, 1 + SCATTER, len(modes))
    resonator = replace(resonator, sigma=np.minimum(resonator.sigma * scatter, 0.9 * resonator.omega))
    q, v = _start(random, modes, place, number // len(KINDS) % 2 == 0)
    rise = _between(random, RISE)
    share = math.sqrt(rise / float(resonator.relative_tension_rise(np.hypot(q, v / resonator.omega))))
    return StruckDrum(kind, drum, resonator, q * share, v * share, modes.scale**2, rise)


def _drawn(random: np.random.Generator, kind: Kind) -> DrumParameters:
    length, ratio, thickness, pitch = (_between(random, ends) for ends in RANGES[kind])
    circle = kind in ("tom", "frame drum", "small head")
    metal = kind in AIRLESS
    drum = DrumParameters(
        shape="circle" if circle else "rectangle",
        length_m=length,
        width_m=length * ratio,
        thickness_m=min(thickness, 0.09 * length * ratio),
        density_kg_m3=7850.0 if metal else 1390.0,
        youngs_modulus_pa=2e11 if metal else 3.5e9,
        poisson=0.3 if metal else 0.38,
        tension_n_m=0.0,
        uneven=float(random.uniform(0, 0.01)) if circle else 0.0,
        air_kg_m3=DENSITY_KG_M3 if not metal and random.random() < 0.5 else 0.0,
    )
    kappa = 2 * 2.4048 / length if circle else math.hypot(math.pi / length, math.pi / (length * ratio))
    if not metal:
        drum = replace(drum, tension_n_m=drum.mass_kg_m2 * (2 * math.pi * pitch / kappa) ** 2)
    slow, fast = (math.log(1000) / _between(random, ends) for ends in (T60_S, BRIGHT_T60_S))
    fast = max(fast, 1.5 * slow)
    stiff = drum.tension_n_m + drum.bending_nm * kappa**2
    bright = kappa * max(2.0, (2 * math.pi * BRIGHT_HZ) / (kappa * math.sqrt(stiff / drum.mass_kg_m2)))
    d3 = 2 * drum.mass_kg_m2 * (fast - slow) / (bright**2 - kappa**2)
    d1 = max(0.0, 2 * drum.mass_kg_m2 * slow - d3 * kappa**2)
    return replace(drum, damping_d1_kg_m2_s=d1, damping_d3_kg_s=d3)


def _start(
    random: np.random.Generator, modes: DrumModes, place: tuple[float, float], blow: bool
) -> tuple[Array, Array]:
    radius_m, contact_s = _between(random, RADIUS_M), _between(random, CONTACT_S)
    still = np.zeros(len(modes))
    if blow:
        return still, modes.struck(place, radius_m) * pulse_spectrum(modes.omega, contact_s)
    pressed = modes.shapes(np.array([place]))[:, 0] * spread(modes.surface.wavenumber, radius_m)
    return pressed / modes.omega**2, still


def _place(random: np.random.Generator, circle: bool) -> tuple[float, float]:
    if circle:
        r, angle = 0.9 * math.sqrt(random.random()), random.uniform(0, 2 * math.pi)
        return r * math.cos(angle), r * math.sin(angle)
    return float(random.uniform(-0.9, 0.9)), float(random.uniform(-0.9, 0.9))


def _between(random: np.random.Generator, ends: tuple[float, float]) -> float:
    low, high = ends
    return low if low == high else math.exp(random.uniform(math.log(low), math.log(high)))


@dataclass(frozen=True)
class DrumError:
    """Of one drum and player: relative squared errors over the surface in the first second and in the tenth.

    Attributes:
        tenth: None: not measured, or the drum is silent by then.
        processor_s: for the first second of all modes.
        slower: how many times as slowly the drum decays, to be there in the tenth second.
    """

    number: int
    player: str
    kind: str
    pitch_hz: float
    modes: int
    tension_rise: float
    blow: str
    first: float
    tenth: float | None = None
    processor_s: float = 0.0
    slower: float = 1.0

    @property
    def slow(self) -> bool:
        return self.slower > 1


@torch.inference_mode()
def measure_drum(
    number: int, players: Mapping[str, DrumPlayer], rate_hz: int, tenth: bool, seed: int
) -> list[DrumError]:
    """The errors of players on the drum of a number; in the tenth second, too, where it decays `SLOWER` times."""
    struck = draw_drum(number, seed)
    if tenth:
        slow = replace(struck.resonator, sigma=struck.resonator.sigma / SLOWER)
        struck = replace(struck, resonator=slow)
    seconds = 10 if tenth else 1
    true = true_motion(struck, rate_hz)
    playing = {name: play(struck, rate_hz) for name, play in players.items()}
    weight = torch.from_numpy(struck.weight)
    wrong = {name: np.zeros(2) for name in players}
    energy, spent = np.zeros(2), dict.fromkeys(players, 0.0)
    for second in range(seconds):
        window, done = (0 if second == 0 else 1), 0
        while done < rate_hz:
            frames = min(AT_ONCE, rate_hz - done)
            done += frames
            expected, counts = true(frames), second in (0, 9)
            energy[window] += float((expected.square() @ weight).sum()) if counts else 0.0
            for name, more in playing.items():
                begun = time.process_time()
                found = more(frames)
                spent[name] += (time.process_time() - begun) if second == 0 else 0.0
                if counts:
                    wrong[name][window] += float(((found - expected).square() @ weight).sum())
    size = np.square(struck.amplitudes_m) + np.square(struck.speeds_m_s / struck.resonator.omega)
    sounds = energy[1] > UNHEARD * float(size @ struck.weight) * rate_hz
    reported = (struck.kind, struck.pitch_hz, struck.resonator.modes, struck.tension_rise)
    blow = "blow" if struck.speeds_m_s.any() else "pressed"
    return [
        DrumError(
            number,
            name,
            *reported,
            blow,
            finite(wrong[name][0] / energy[0]),
            finite(wrong[name][1] / energy[1]) if tenth and sounds else None,
            spent[name],
            SLOWER if tenth else 1.0,
        )
        for name in players
    ]


def _mean(errors: Iterable[float | None]) -> float | None:
    known = [max(error, 1e-300) for error in errors if error is not None]
    return math.exp(sum(map(math.log, known)) / len(known)) if known else None


def summary(errors: Iterable[DrumError], player: str) -> dict[str, Any]:
    """Of one player's errors; `tenth_first` is the first second's mean of the drums that sound in the tenth."""
    of_player = [one for one in errors if one.player == player]
    own, slow = ([one for one in of_player if one.slow == kind] for kind in (False, True))
    worst = max(own, key=lambda one: one.first)
    late = [one for one in slow if one.tenth is not None]
    return {
        "geometric_mean": _mean(one.first for one in own),
        "worst": worst.first,
        "blows": _mean(one.first for one in own if one.blow == "blow"),
        "pressed": _mean(one.first for one in own if one.blow == "pressed"),
        "processor_s": float(np.median([one.processor_s for one in own])),
        "tenth_drums": len(late),
        "tenth_geometric_mean": _mean(one.tenth for one in late),
        "tenth_worst": max((one.tenth for one in late if one.tenth is not None), default=None),
        "tenth_first": _mean(one.first for one in late),
        "worst_at": f"{worst.kind}, {worst.pitch_hz:.0f} Hz, {worst.modes} modes, rise {worst.tension_rise:.2f}",
    }


def drum_errors(
    preset: PresetName,
    drums: Annotated[int, typer.Option(min=1, max=10_000, help="How many are drawn.")] = 200,
    tenth: Annotated[
        int, typer.Option(min=0, max=1_000, help="Drums of longer decays that are measured over ten seconds.")
    ] = 0,
    rate: Rate = 48_000,
    seed: Seed = 0,
    json: Json = False,
) -> None:
    """Errors of a preset of many strings on drums, which no model has seen."""
    torch.set_num_threads(1)
    loaded = open_preset_of_many(preset)
    players: dict[str, DrumPlayer] = {
        loaded.name: model_player(loaded.model),
        "backward error analysis (1/12)": untrained_player("series"),
        "kicks without corrections": untrained_player("kicks"),
        "linear drum": linear_drum,
    }
    errors: list[DrumError] = []
    wanted = [(n, False) for n in range(drums)] + [(n, True) for n in range(tenth)]
    with progress("bench drum-errors") as report:
        for done, (n, slow) in enumerate(wanted, 1):
            errors += measure_drum(n, players, rate, slow, seed)
            report(done / len(wanted))
    found = {name: summary(errors, name) for name in players}
    if json:
        print_json({"drums": drums, "tenth": tenth, "rate_hz": rate, "seed": seed, "players": found})
        return
    columns = next(iter(found.values()))
    rows = [
        [name, *(v if isinstance(v, str | int) else number(v) for v in figures.values())]
        for name, figures in found.items()
    ]
    print_table(("", *(column.replace("_", " ") for column in columns)), rows)
