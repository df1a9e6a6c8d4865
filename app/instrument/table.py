"""An instrument's table: a patch as the compiled player reads it, prepared off the audio thread."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable
from dataclasses import astuple

import numpy as np
from numpy.typing import NDArray

from app.instrument.drum_keys import DrumKeys, block_of
from app.instrument.string_keys import StringKeys
from app.instrument.strings import KNOBS, STRING
from app.patches.drums import Drums
from app.patches.patch import Fretted, Patch, StringSet
from app.shared.parameters import OF_PATCHES
from engine.contact import CONTACTS
from engine.kernels import layout as at
from engine.kernels import playing_layout as of
from engine.pluck import FULL_SCALE_M, SHAPES
from engine.presets import Preset
from engine.resonators.polarised import PAIRS
from engine.resonators.recorded import OF_PARTIALS, RecordedAttack, RecordedString
from engine.voices.player import Table
from engine.voices.programs import (
    DRUM_SILENCE,
    DRUM_STILL,
    DRUM_UNHEARD,
    HEARD_SILENCE,
    solver_memory,
    tension_memory,
)

PLAYED_PARAMETERS = (
    *(f"knobs.{name}" for name in KNOBS),
    *(f"pluck.{name}" for name in ("position", "width", "width_hard", "softest_mm", "hardest_mm", "curve")),
    "damping.release_t60_s",
    "bend_semitones",
    "noise.onset_db",
    "noise.release_db",
    "damping.mute",
    *(
        f"technique.{name}"
        for name in ("harmonic", "strum_ms", "strokes", "tremolo_hz", "vibrato_cents", "vibrato_hz")
    ),
    "pluck.release_ms",
    "pluck.release_hard_ms",
    "javari.gap_um",
    "body.mix",
    "pickup.points.0",
    "pickup.points.1",
)
WHEELED = PLAYED_PARAMETERS[: of.BODY_MIX]  # what the kernel turns with the modulation wheel
MODES = {"poly": of.POLY, "guitar": of.GUITAR, "mpe": of.MPE}
BENDS = {"tension": of.BY_TENSION, "length": of.BY_LENGTH}
SOURCES = ("model", "truth")
HALVINGS = 8  # of the way to the wheel's end, until the value there is within its bounds


def wheel_goal(patch: Patch) -> float | None:
    """The value of its parameter at the modulation wheel's end; None: the wheel turns nothing."""
    name = patch.mod_wheel
    if name == "none":
        return None
    value, parameter = patch.value(name), OF_PATCHES[name]
    goal = value * parameter.wheel_factor if parameter.wheel is None else parameter.wheel
    for _ in range(HALVINGS):
        try:
            patch.with_value(name, goal)
        except ValueError:  # beyond its bounds: half as far
            goal = (goal + value) / 2
        else:
            return goal
    return None


def wheeled(patch: Patch, wheel: int, *parts: str) -> Patch:
    """The patch as the modulation wheel, 0 … 127, turns it, where it turns anything of these parts."""
    goal = wheel_goal(patch) if wheel and patch.mod_wheel.startswith(parts) else None
    if goal is None:
        return patch
    value, share = patch.value(patch.mod_wheel), min(max(wheel, 0), 127) / 127
    return patch.with_value(patch.mod_wheel, value + share * (goal - value))


def programs_of(preset: Preset, rate_hz: int, sources: Iterable[str], drums: bool) -> tuple[NDArray[np.float64], ...]:
    """What the kernels read of each source; `drums`: of drums in place of strings."""
    model_silence, unheard, silence = HEARD_SILENCE, 0.0, HEARD_SILENCE
    if drums:
        model_silence, unheard, silence = DRUM_STILL, DRUM_UNHEARD, DRUM_SILENCE
    model = tension_memory(preset.weights, preset.configuration, rate_hz, model_silence, unheard)
    return tuple(solver_memory(rate_hz, silence=silence) if each == "truth" else model for each in sources)


def table_of(
    loud: StringKeys | DrumKeys,
    grid_points: int,
    sources: Iterable[str],
    programs: tuple[NDArray[np.float64], ...],
    varied: bool = True,
) -> Table:
    """The table of a patch, without its number.

    Args:
        varied: whether plucks vary from stroke to stroke, as the patch says.
    """
    patch, ear = loud.patch, loud.ear
    memory = np.zeros(of.table_slots(grid_points))
    counts = memory.view(np.int64)
    counts[of.TABLE_MODE], counts[of.TABLE_BEND_BY] = MODES[patch.mode], BENDS[patch.bend_by]
    counts[of.TABLE_LOW], counts[of.TABLE_HIGH] = patch.range
    counts[of.TABLE_SHAPE], counts[of.TABLE_STOPS] = SHAPES.index(patch.pluck.shape), patch.pluck.stops
    counts[of.TABLE_STRIKES] = patch.pluck.is_blow
    counts[of.TABLE_LET_RING] = patch.damping.let_ring
    counts[of.TABLE_POINTS], counts[of.TABLE_VELOCITY] = len(ear.points), ear.pickup == "velocity"
    counts[of.TABLE_SOLO], counts[of.TABLE_GRID] = ear.solo, grid_points
    if (moving := loud.polarisations) is not None:
        counts[of.TABLE_PAIRS], memory[of.TABLE_DETUNING] = PAIRS, moving.detuning
        for first, both in (
            (of.TABLE_PULLED, moving.pulled),
            (of.TABLE_HEARD, moving.heard),
            (of.TABLE_CONDUCTANCE, (moving.conductance_s_kg, moving.second_conductance_s_kg)),
        ):
            memory[first : first + 2] = both
    else:
        memory[of.TABLE_DETUNING] = 1.0
    if patch.losses is not None:
        lost = patch.losses.air, patch.losses.friction, patch.losses.bending
        memory[of.TABLE_LOSSES : of.TABLE_LOSSES + 3] = lost
    if patch.sympathy_s_kg > 0:
        counts[of.TABLE_SYMPATHY] = of.EVERY_KEY if patch.damping.let_ring else of.OPEN_STRINGS
        memory[of.TABLE_SYMPATHY_S_KG] = patch.sympathy_s_kg
    if ear.pickup == "velocity":
        memory[of.TABLE_APERTURE_M] = patch.pickup.aperture_mm / 1000
        if patch.pickup.flux_mm > 0:
            memory[of.TABLE_NEARNESS] = FULL_SCALE_M / (patch.pickup.flux_mm / 1000)
    course = patch.course
    counts[of.TABLE_COURSE], counts[of.TABLE_OCTAVES] = course.strings, course.octaves
    memory[of.TABLE_APART_CENTS], memory[of.TABLE_APART_S] = course.cents, course.apart_ms / 1000
    memory[of.TABLE_BRIDGE] = course.bridge
    memory[of.TABLE_VARIATION] = patch.pluck.variation if varied else 0.0
    memory[of.TABLE_LEVEL] = 10 ** (patch.level_db / 20)
    memory[of.TABLE_NOISE_LEVEL] = of.PART_S * 10 ** ((of.WANTED_DB + patch.level_db) / 10)
    for place, each in enumerate(CONTACTS[patch.noise.kind]):
        first = of.TABLE_CONTACTS + place * of.CONTACT
        memory[first : first + len(astuple(each))] = astuple(each)
    goal = wheel_goal(patch) if patch.mod_wheel in WHEELED else None
    counts[of.TABLE_WHEEL] = -1 if goal is None else WHEELED.index(patch.mod_wheel)
    memory[of.TABLE_WHEEL_GOAL] = 0.0 if goal is None else goal
    for place, (source, program) in enumerate(zip(sources, programs, strict=True)):
        counts[of.TABLE_KINDS + place] = at.TRUTH if source == "truth" else at.TENSION
        counts[of.TABLE_PROGRAMS + place] = program.ctypes.data
    counts[of.TABLE_SOURCES] = len(programs)
    points = [of.BRIDGE] * len(ear.points) if ear.pickup == "bridge" else ear.points
    values = [*(patch.value(name) for name in (*WHEELED, "body.mix")), *points]
    memory[of.TABLE_VALUES : of.TABLE_VALUES + len(values)] = values
    if loud.body is not None:
        memory = _with_body(memory, loud.body)
        counts = memory.view(np.int64)
    if isinstance(loud, DrumKeys):
        return Table(_with_drums(memory, loud), programs)
    if loud.recorded is not None:
        memory = _with_recorded(memory, loud.recorded, grid_points)
        if patch.noise.kind == "recorded" and loud.recorded.attack is not None:
            memory = _with_attack(memory, loud.recorded.attack)
        counts = memory.view(np.int64)
    elif (edge := patch.javari).distance_mm > 0:
        memory[of.TABLE_JAVARI : of.TABLE_JAVARI + 3] = edge.distance_mm / 1000, edge.stiffness_n_m, edge.loss_s_m
    for key in range(of.KEYS):
        memory[of.TABLE_PITCHES + key] = loud.strings.pitch_hz(key) or 0.0
    strings = patch.strings
    assert not isinstance(strings, Drums)
    if isinstance(strings, Fretted):
        memory[of.TABLE_OPEN + of.OPEN_STRING : of.TABLE_OPEN + of.OPEN_SLOTS] = _row(strings.string)
    else:
        counts[of.TABLE_STRINGS] = len(strings.strings)
        for number, string in enumerate(strings.strings[::-1]):
            first = of.TABLE_OPEN + number * of.OPEN_SLOTS
            row = string.note, loud.strings.open_hz(string.note), *_row(string.string)
            memory[first : first + of.OPEN_SLOTS] = row
    turn = 2 * (grid_points - 1)
    memory[of.TABLE_SINES : of.TABLE_SINES + turn] = np.sin(2 * np.pi * np.arange(turn) / turn)
    return Table(memory, programs)


def _with_body(memory: NDArray[np.float64], curves: NDArray[np.float64]) -> NDArray[np.float64]:
    """The table with what the body does at each frequency."""
    memory.view(np.int64)[of.TABLE_BODY] = len(memory)
    return np.concatenate([memory, curves])


def _with_drums(memory: NDArray[np.float64], loud: DrumKeys) -> NDArray[np.float64]:
    """The table with the drums of all keys. A key whose drum is impossible has none."""
    blocks: list[NDArray[np.float64]] = []
    first = len(memory) + of.KEYS
    slots = np.zeros(of.KEYS, np.int64)
    low, high = loud.patch.range
    for key in range(low, high + 1):
        with contextlib.suppress(ValueError):
            if (found := loud.of_key(key)) is not None:
                blocks.append(block_of(found))
                slots[key] = first
                first += len(blocks[-1])
    memory.view(np.int64)[of.TABLE_DRUMS] = len(memory)
    return np.concatenate([memory, slots.view(np.float64), *blocks])


def _with_recorded(memory: NDArray[np.float64], own: RecordedString, grid_points: int) -> NDArray[np.float64]:
    """The table with what a recording adds to strings."""
    header = np.zeros(of.RECORDED_HEADER)
    header[of.RECORDED_HZ] = own.pitch_hz
    header[of.RECORDED_REST : of.RECORDED_REST + len(OF_PARTIALS)] = [own.rest(name) for name in OF_PARTIALS]
    counts = header.view(np.int64)
    counts[of.RECORDED_SMOOTH], counts[of.RECORDED_PARTIALS] = len(own.smooth_hz), len(own.cents)
    counts[of.RECORDED_MODES] = grid_points - 2
    memory.view(np.int64)[of.TABLE_RECORDED] = len(memory)
    rows = [getattr(own, name) for name in OF_PARTIALS]
    return np.concatenate([memory, header, np.log(own.smooth_hz), np.log(own.smooth_ratio), *rows])


def _with_attack(memory: NDArray[np.float64], attack: RecordedAttack) -> NDArray[np.float64]:
    """The table with a recorded attack as the noise of strokes."""
    samples, header = attack.samples, np.zeros(of.ATTACK_HEADER)
    header[of.ATTACK_RATE] = attack.rate_hz
    header.view(np.int64)[of.ATTACK_FRAMES] = len(samples)
    memory.view(np.int64)[of.TABLE_ATTACK] = len(memory)
    return np.concatenate([memory, header, samples])


def strings_of(patch: Patch) -> int:
    """How many strings of a set channels of a guitar may choose."""
    chosen = patch.mode == "guitar" and isinstance(patch.strings, StringSet)
    return min(of.GUITAR_STRINGS, len(patch.strings.strings)) if chosen else 0  # type: ignore[union-attr]


def _row(string: object) -> list[float]:
    return [getattr(string, name) for name in STRING]
