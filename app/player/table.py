"""The table that the compiled player reads of an instrument, prepared off the audio thread."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from dataclasses import asdict

import numpy as np
from numpy.typing import NDArray

from app.instruments.drums import Drums
from app.instruments.instrument import Fretted, Instrument
from app.player.drum_keys import DrumKeys, block_of
from app.player.strings import StringKeys
from engine.contact import CONTACTS
from engine.kernels import constants as of
from engine.kernels.fields import slots
from engine.kernels.records import ATTACK, RECORDED, TABLE
from engine.kernels.voice_records import TENSION, TRUTH
from engine.levels import FULL_SCALE_M
from engine.parameters import OF_INSTRUMENTS, PLAYED
from engine.pluck import SHAPES
from engine.presets import Preset
from engine.resonators.recorded import RecordedString
from engine.voices.player import Table
from engine.voices.programs import (
    DRUM_SILENCE,
    DRUM_STILL,
    DRUM_UNHEARD,
    HEARD_SILENCE,
    solver_memory,
    tension_memory,
)

WHEELED = PLAYED[: of.VALUE.body_mix]  # ids of parameters that the player itself turns with the modulation wheel
MODES = {"poly": of.POLY, "guitar": of.GUITAR, "mpe": of.MPE}
BENDS = {"tension": of.BY_TENSION, "length": of.BY_LENGTH}
SOURCES = ("model", "truth")
HALVINGS = 8  # of the way to the wheel's end, until the value there is within its bounds


def wheel_goal(instrument: Instrument) -> float | None:
    """The value of its parameter at the modulation wheel's end; None: the wheel turns nothing."""
    name = instrument.mod_wheel
    if name == "none":
        return None
    value, parameter = instrument.value(name), OF_INSTRUMENTS[name]
    goal = value * parameter.wheel_factor if parameter.wheel is None else parameter.wheel
    for _ in range(HALVINGS):
        try:
            instrument.with_value(name, goal)
        except ValueError:  # beyond its bounds: half as far
            goal = (goal + value) / 2
        else:
            return goal
    return None


def wheeled(instrument: Instrument, wheel: int, *parts: str) -> Instrument:
    """The instrument as the modulation wheel, 0 … 127, turns it; unchanged where the wheel turns none of `parts`.

    Args:
        parts: beginnings of ids, as "body.".
    """
    goal = wheel_goal(instrument) if wheel and instrument.mod_wheel.startswith(parts) else None
    if goal is None:
        return instrument
    value, share = instrument.value(instrument.mod_wheel), min(max(wheel, 0), 127) / 127
    return instrument.with_value(instrument.mod_wheel, value + share * (goal - value))


def programs_of(preset: Preset, rate_hz: int, sources: Iterable[str], drums: bool) -> tuple[NDArray[np.float64], ...]:
    """The program of each source, in their order, as memory of the kernels; `drums`: of drums instead of strings."""
    model_silence = HEARD_SILENCE
    unheard = 0.0
    silence = HEARD_SILENCE
    if drums:
        model_silence = DRUM_STILL
        unheard = DRUM_UNHEARD
        silence = DRUM_SILENCE
    model = tension_memory(preset.weights, preset.configuration, rate_hz, model_silence, unheard)
    return tuple(solver_memory(rate_hz, silence=silence) if source == "truth" else model for source in sources)


def table_of(
    loud: StringKeys | DrumKeys,
    grid_points: int,
    sources: Iterable[str],
    programs: tuple[NDArray[np.float64], ...],
    varied: bool = True,
) -> Table:
    """The table of an instrument, whose serial and instrument numbers are still 0.

    Args:
        loud: the keys of the instrument, with the body's curves, from which the player computes how loud keys are.
        grid_points: of the preset.
        sources, programs: what plays, and for each its program as of `programs_of`.
        varied: whether plucks vary from stroke to stroke, as the instrument says.
    """
    instrument, ear = loud.instrument, loud.ear
    record = np.zeros(1, TABLE)
    table = record[0]
    table["mode"], table["bend_by"] = MODES[instrument.mode], BENDS[instrument.bend_by]
    table["low"], table["high"] = instrument.range
    table["shape"], table["stops"] = SHAPES.index(instrument.pluck.shape), instrument.pluck.stops
    table["strikes"], table["let_ring"] = instrument.pluck.is_blow, instrument.damping.let_ring
    table["points"], table["velocity"] = len(ear.points), ear.pickup == "velocity"
    table["solo"] = ear.solo
    table["grid"] = grid_points
    table["detuning"] = 1.0
    if (moving := loud.polarisations) is not None:
        table["pairs"], table["detuning"] = of.MOST_PAIRS, moving.detuning
        table["pulled"], table["heard"] = moving.pulled, moving.heard
        table["conductance"] = moving.conductance_s_kg, moving.second_conductance_s_kg
    if instrument.losses is not None:
        table["losses"] = instrument.losses.air, instrument.losses.friction, instrument.losses.bending
    if instrument.sympathy_s_kg > 0:
        table["sympathy"] = of.EVERY_KEY if instrument.damping.let_ring else of.OPEN_STRINGS
        table["sympathy_s_kg"] = instrument.sympathy_s_kg
    if ear.pickup == "velocity":
        table["aperture_m"] = instrument.pickup.aperture_mm / 1000
        if instrument.pickup.flux_mm > 0:
            table["nearness"] = FULL_SCALE_M / (instrument.pickup.flux_mm / 1000)
    course = instrument.course
    table["course"] = course.strings
    table["octaves"] = course.octaves
    table["bridge"] = course.bridge
    table["apart_cents"], table["apart_s"] = course.cents, course.apart_ms / 1000
    table["variation"] = instrument.pluck.variation if varied else 0.0
    table["level"] = 10 ** (instrument.level_db / 20)
    table["noise_level"] = of.PART_S * 10 ** ((of.WANTED_DB + instrument.level_db) / 10)
    for place, contact in enumerate(CONTACTS[instrument.noise.kind]):
        for name, value in asdict(contact).items():
            table["contacts"][place][name] = value
    goal = wheel_goal(instrument) if instrument.mod_wheel in WHEELED else None
    table["wheel"] = -1 if goal is None else WHEELED.index(instrument.mod_wheel)
    table["wheel_goal"] = 0.0 if goal is None else goal
    for place, (source, program) in enumerate(zip(sources, programs, strict=True)):
        table["kinds"][place] = TRUTH if source == "truth" else TENSION
        table["programs"][place] = program.ctypes.data
    table["sources"] = len(programs)
    points = [of.BRIDGE] * len(ear.points) if ear.pickup == "bridge" else ear.points
    values = [*(instrument.value(id) for id in PLAYED[: of.VALUE.pickup_points_0]), *points]
    table["values"][: len(values)] = values
    tail = Tail()
    if loud.body is not None:
        table["body"] = tail.put(loud.body)
    if isinstance(loud, DrumKeys):
        table["drums"] = _put_drums(tail, loud)
    else:
        _fill_strings(table, tail, loud, grid_points)
    return Table(np.concatenate([record.view(np.float64), *tail.parts]), programs)


class Tail:
    """The data that a table points to, which follow its record."""

    def __init__(self) -> None:
        self.parts: list[NDArray[np.float64]] = []
        self.slot = slots(TABLE)  # of the next part: 8-byte numbers from the beginning of the record

    def put(self, *parts: NDArray[np.float64]) -> int:
        """The slot of the first of these parts, which are put at the end."""
        first = self.slot
        self.parts += parts
        self.slot += sum(map(len, parts))
        return first


def _fill_strings(table: np.void, tail: Tail, loud: StringKeys, grid_points: int) -> None:
    """Fill in the table's strings, their pitches and what a recording adds to them; arrays are put in the tail."""
    instrument = loud.instrument
    if loud.recorded is not None:
        put_recorded(table, tail, loud.recorded, grid_points)
        if instrument.noise.kind == "recorded" and loud.recorded.attack is not None:
            attack = np.zeros(1, ATTACK)
            samples = loud.recorded.attack.samples
            attack["rate_hz"], attack["frames"] = loud.recorded.attack.rate_hz, len(samples)
            table["attack"] = tail.put(attack.view(np.float64), samples)
    elif (edge := instrument.javari).distance_mm > 0:
        table["javari"] = edge.distance_mm / 1000, edge.stiffness_n_m, edge.loss_s_m
    table["pitches_hz"] = [loud.pitch_hz(key) or 0.0 for key in range(of.KEYS)]
    strings = instrument.strings
    assert not isinstance(strings, Drums)
    if isinstance(strings, Fretted):
        table["open"][0]["string"] = strings.string.row
    else:
        table["strings"] = len(strings.strings)
        for number, string in enumerate(strings.strings[::-1]):
            table["open"][number] = string.note, loud.open_hz(string.note), string.string.row
    turn = 2 * (grid_points - 1)  # samples in a period of the sine
    table["sines"] = tail.put(np.sin(2 * np.pi * np.arange(turn) / turn))


def put_recorded(table: np.void, tail: Tail, string: RecordedString, grid_points: int) -> None:
    """Put what a recording adds to strings behind a table."""
    header = np.zeros(1, RECORDED)
    pitch_hz, rest, hz, ratios, rows = string.additions
    header["pitch_hz"] = pitch_hz
    header["rest"] = rest
    header["modes"] = grid_points - 2
    header["smooth"], header["partials"] = len(hz), rows.shape[1]
    table["recorded"] = tail.put(header.view(np.float64), hz, ratios, rows.ravel())


def _put_drums(tail: Tail, loud: DrumKeys) -> int:
    """Put the drums of all keys in the tail; return the slot of the list (KEYS,) of their slots.

    In the list 0 stands for a key that is silent or whose drum is impossible.
    """
    blocks: list[NDArray[np.float64]] = []
    places = np.zeros(of.KEYS, np.int64)
    free = tail.slot + of.KEYS
    low, high = loud.instrument.range
    for key in range(low, high + 1):
        with contextlib.suppress(ValueError):
            if (drum_key := loud.of_key(key)) is not None:
                blocks.append(block_of(drum_key))
                places[key] = free
                free += len(blocks[-1])
    return tail.put(places.view(np.float64), *blocks)
