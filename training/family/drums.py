"""The drums that no model has seen, and how well models of many strings play them.

Drums differ in kind, size, pitch, decay and blow. Half of the membranes are loaded by air. Decay rates scatter by
20 % from mode to mode. Half of the blows are those of a mallet (speeds alone), half begin pressed down, at rest.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar, Literal, TypeVar, get_args

import numpy as np
import torch
from filelock import FileLock

from engine.kernels.drum_modes import AIR_KG_M3
from engine.kernels.pulses import spectrum
from engine.resonators.base import Array
from engine.resonators.drum import DrumModes, bending_nm, modes_of
from engine.strike import Strike
from engine.table import checked, read_table, write_table
from engine.values.drum import DrumParameters
from training.family.errors import geometric_mean
from training.family.motion import Player, Released, motion_errors
from training.family.strings import log_uniform
from training.provenance import now

T = TypeVar("T")
Kind = Literal["tom", "frame drum", "small head", "rectangular membrane", "steel plate", "narrow plate"]
KINDS: tuple[Kind, ...] = get_args(Kind)
DRUMS_VERSION = 1  # of the draws: with another one the same seed and number give another drum
HIGHEST_HZ = 4_000.0  # of a mode
BRIGHT_HZ = 3_000.0  # where a mode decays in `BRIGHT_T60_S`
LEAST_MODES = 10  # of a drum; one with fewer is drawn again
SLOWER = 8.0  # times as slowly decay drums that are measured in the tenth second
LARGEST_BYTES = 2**21  # of a table of errors
ROWS = Path(__file__).parents[1] / "drums.csv"

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
T60_S = (0.4, 2.5)  # decay by 60 dB of the lowest mode
BRIGHT_T60_S = (0.08, 0.35)
RISE = (0.02, 0.5)  # ΔT/T₀, see `Released.tension_rise`
RADIUS_M = (0.005, 0.04)  # of the disc that is struck or pressed
CONTACT_S = (1e-3, 5e-3)  # of a mallet
SCATTER = 0.2  # of the decay rates from mode to mode, a share to either side
NOWHERE = np.zeros((1, 2))  # a place, where none counts
AIRLESS: tuple[Kind, ...] = ("steel plate", "narrow plate")


@dataclass(frozen=True, eq=False)
class StruckDrum(Released):
    """A drum with all its modes below 4 kHz, and a blow on it or a shape that it is pressed to."""

    silence: ClassVar = 1e-10

    kind: Kind
    drum: DrumParameters

    @classmethod
    def by(cls, strike: Strike, modes: DrumModes, tension_modulated: bool = True) -> StruckDrum:
        """A drum of an instrument with the speeds from a blow on it; its kind is "tom", whatever it is."""
        # speeds (modes,) in m/s, from the amplitude 0
        speeds, resonator = strike.speeds(modes), modes.resonator(NOWHERE, tension_modulated=tension_modulated)
        rise = float(resonator.relative_tension_rise(speeds / resonator.omega))
        return cls(resonator, np.zeros_like(speeds), speeds, modes.scale**2, rise, "tom", modes.drum)


def draw_drum(number: int, seed: int = 0) -> StruckDrum:
    """The drum of a number with its start, always the same.

    Kinds take turns. In the first round of all kinds the drums are struck, in the next one pressed, and so on.
    """
    random = np.random.default_rng((DRUMS_VERSION, seed, number))
    kind = KINDS[number % len(KINDS)]
    while True:
        drum = _drawn(random, kind)
        try:
            modes = modes_of(drum, HIGHEST_HZ)
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
    # the start is scaled so that it reaches the rise that was drawn
    share = math.sqrt(rise / float(resonator.relative_tension_rise(np.hypot(q, v / resonator.omega))))
    return StruckDrum(resonator, q * share, v * share, modes.scale**2, rise, kind, drum)


def _drawn(random: np.random.Generator, kind: Kind) -> DrumParameters:
    """Draw the parameters of a drum within the ranges of its kind; damping follows from two times of decay."""
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
        air_kg_m3=AIR_KG_M3 if not metal and random.random() < 0.5 else 0.0,
    )
    # wavenumber of the lowest mode in 1/m; 2.4048: first zero of the Bessel function J₀
    kappa = 2 * 2.4048 / length if circle else math.hypot(math.pi / length, math.pi / (length * ratio))
    if not metal:
        drum = replace(drum, tension_n_m=drum.mass_kg_m2 * (2 * math.pi * pitch / kappa) ** 2)
    # decay rates σ in 1/s of the lowest mode, and of one at BRIGHT_HZ with the wavenumber `bright`
    slow, fast = (math.log(1000) / _between(random, ends) for ends in (T60_S, BRIGHT_T60_S))
    fast = max(fast, 1.5 * slow)
    stiff = drum.tension_n_m + bending_nm(drum) * kappa**2
    bright = kappa * max(2.0, (2 * math.pi * BRIGHT_HZ) / (kappa * math.sqrt(stiff / drum.mass_kg_m2)))
    d3 = 2 * drum.mass_kg_m2 * (fast - slow) / (bright**2 - kappa**2)
    d1 = max(0.0, 2 * drum.mass_kg_m2 * slow - d3 * kappa**2)
    return replace(drum, damping_d1_kg_m2_s=d1, damping_d3_kg_s=d3)


def _start(
    random: np.random.Generator, modes: DrumModes, place: tuple[float, float], blow: bool
) -> tuple[Array, Array]:
    """Draw a start: amplitudes and speeds (modes,), one of them 0, up to a common factor.

    Args:
        place: of `_place`.
        blow: True: struck at rest, so speeds alone; False: pressed and released, so amplitudes alone.
    """
    radius_m, contact_s = _between(random, RADIUS_M), _between(random, CONTACT_S)
    still, pressed = np.zeros(len(modes)), modes.struck(place, radius_m)
    if blow:
        return still, pressed * spectrum(modes.omega * contact_s / (2 * math.pi))
    return pressed / modes.omega**2, still


def _place(random: np.random.Generator, circle: bool) -> tuple[float, float]:
    """A random place (x, y), evenly over the surface up to 0.9 of the way from the centre to the edge."""
    if circle:
        r, angle = 0.9 * math.sqrt(random.random()), random.uniform(0, 2 * math.pi)
        return r * math.cos(angle), r * math.sin(angle)
    return float(random.uniform(-0.9, 0.9)), float(random.uniform(-0.9, 0.9))


def _between(random: np.random.Generator, ends: tuple[float, float]) -> float:
    """A draw that is uniform in the logarithm; equal ends, which may be 0, are the value itself."""
    return ends[0] if ends[0] == ends[1] else log_uniform(random, ends)


@dataclass(frozen=True)
class DrumError:
    """The errors of one drum and player over the surface: relative squared, in the first second and in the tenth.

    Attributes:
        number: of the drum, see `draw_drum`.
        blow: "blow" or "pressed": how it starts.
        tenth: None: not measured, or the drum is silent by then.
        processor_s: the processor's time for the first second of all modes.
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
def measure_drum(number: int, players: Mapping[str, Player], rate_hz: int, tenth: bool, seed: int) -> list[DrumError]:
    """The errors of players on the drum of a number, one `DrumError` each.

    Args:
        players: by name.
        tenth: measure the tenth second, too, on the same drum with decays `SLOWER` times as long.
    """
    struck = draw_drum(number, seed)
    if tenth:
        struck = replace(struck, resonator=replace(struck.resonator, sigma=struck.resonator.sigma / SLOWER))
    # over all, in the first second, in each further one
    _, first, *others = motion_errors(struck, players, rate_hz, (10 if tenth else 1) * rate_hz)
    last = others[-1] if tenth and others[-1].energy > struck.unheard * rate_hz else None
    blow = "blow" if struck.speeds_m_s.any() else "pressed"
    drum = struck.kind, struck.pitch_hz, struck.resonator.modes, struck.tension_rise, blow
    errors = []
    for name in players:
        late = None if last is None else last.rel_mse[name]
        slower = SLOWER if tenth else 1.0
        errors.append(DrumError(number, name, *drum, first.rel_mse[name], late, first.processor_s[name], slower))
    return errors


def measure_drums(
    players: Mapping[str, Player],
    count: int,
    tenth: int,
    rate_hz: int,
    seed: int,
    checkpoint: Path,
    report: Callable[[float], None] = lambda share: None,
) -> list[DrumError]:
    """The errors of players on so many drums; those that a checkpoint holds are not measured again.

    Args:
        players: by name, which the checkpoint keeps.
        count: drums, numbered from 0, that are measured over the first second.
        tenth: drums, numbered from 0, that are measured over ten seconds, too; 0: none.
        checkpoint: a CSV file, written after each drum.
        report: receives the share that is done, 0 … 1.

    Raises:
        SchemaError: the checkpoint is no table of errors.
    """
    errors = _read(DrumError, checkpoint)
    checkpoint.parent.mkdir(parents=True, exist_ok=True)
    wanted = [(number, False) for number in range(count)] + [(number, True) for number in range(tenth)]
    for done, (number, slow) in enumerate(wanted, 1):
        known = {one.player for one in errors if (one.number, one.slow) == (number, slow)}
        lacking = {name: play for name, play in players.items() if name not in known}
        if lacking:
            errors += measure_drum(number, lacking, rate_hz, slow, seed)
            write_table(checkpoint, DrumError, errors)
        report(done / len(wanted))
    return [one for one in errors if (one.number, one.slow) in wanted and one.player in players]


def checkpoint_file(runs: Path, preset: str, rate_hz: int, seed: int) -> Path:
    """The table of a preset's errors on drums in the folder of runs, for `measure_drums`."""
    return runs / f"drums_{preset}_{rate_hz}_seed{seed}_v{DRUMS_VERSION}.csv"


@dataclass(frozen=True)
class DrumsRow:
    """The errors of one player on many drums: relative squared ones in the first second, see `DrumError`.

    Attributes:
        drums: how many.
        modes: the fewest and the most of a drum, in words.
        geometric_mean, worst: over all drums; `worst_at` describes the drum of the worst.
        blows, pressed: geometric means of the drums that start so.
        tenth_drums: how many still sound in the tenth second; `tenth_…`: their errors then.
        tenth_first: geometric mean of the same drums in the first second.
        processor_s: median of the processor's time for a second.
        finished: UTC, ISO 8601.
    """

    player: str
    drums: int
    rate_hz: int
    seed: int
    modes: str = ""
    geometric_mean: float | None = None
    worst: float | None = None
    worst_at: str = ""
    blows: float | None = None
    pressed: float | None = None
    tenth_drums: int = 0
    tenth_geometric_mean: float | None = None
    tenth_worst: float | None = None
    tenth_first: float | None = None
    processor_s: float | None = None
    finished: str = ""


def summary(errors: Iterable[DrumError], player: str, rate_hz: int, seed: int) -> DrumsRow:
    """The summary of one player's errors.

    `tenth_first` is the first second's mean of the drums that sound in the tenth.
    """
    of_player = [one for one in errors if one.player == player]
    # drums with their own decays, and those `SLOWER` times as slow
    of_kind, slow = ([one for one in of_player if one.slow == kind] for kind in (False, True))
    worst = max(of_kind, key=lambda one: one.first)
    late = [one for one in slow if one.tenth is not None]
    modes = sorted(one.modes for one in of_kind)
    return DrumsRow(
        player,
        len(of_kind),
        rate_hz,
        seed,
        f"{modes[0]} … {modes[-1]}",
        _mean(one.first for one in of_kind),
        worst.first,
        f"{worst.kind}, {worst.pitch_hz:.0f} Hz, {worst.modes} modes, rise {worst.tension_rise:.2f}",
        _mean(one.first for one in of_kind if one.blow == "blow"),
        _mean(one.first for one in of_kind if one.blow == "pressed"),
        len(late),
        _mean(one.tenth for one in late),
        max((one.tenth for one in late if one.tenth is not None), default=None),
        _mean(one.first for one in late),
        float(np.median([one.processor_s for one in of_kind])),
        now(),
    )


def _mean(errors: Iterable[float | None]) -> float | None:
    """The geometric mean of the errors that are known; None: none is."""
    known = [error for error in errors if error is not None]
    return geometric_mean(known) if known else None


def store(rows: Iterable[DrumsRow], path: Path = ROWS) -> None:
    """Add rows to the table of results; a row of the same player, drums, rate and seed is replaced."""
    with FileLock(f"{path}.lock"):
        by_key = {(row.player, row.drums, row.rate_hz, row.seed): row for row in (*_read(DrumsRow, path), *rows)}
        write_table(path, DrumsRow, [by_key[key] for key in sorted(by_key)])


def _read(kind: type[T], path: Path) -> list[T]:
    """The rows of a table, as instances of a dataclass; none where there is no file. Raises SchemaError."""
    return list(checked(read_table(kind, path, "table of drums", LARGEST_BYTES))) if path.exists() else []
