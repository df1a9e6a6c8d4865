"""Plucks and strings stay within their ranges, whatever the knobs, macros and wheels of an instrument stand at."""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator

import numpy as np
import pytest

from app.instrument.compiled import InstrumentPlayer
from app.instrument.drum_keys import DrumKeys
from app.instrument.events import HARMONICS, MOD_WHEEL, SLIDE, Controller, Event, NoteOn, PatchTurned
from app.instrument.strings import KNOBS
from app.instrument.table import wheeled
from app.patches.drums import Drums
from app.patches.library import SHIPPED, list_patches
from app.patches.patch import ASSIGNABLE, VELOCITIES, WHEEL, Fretted, Patch
from app.playing.key_note import KeyNote
from app.shared.parameters import OF_PATCHES
from engine.bounds import AMPLITUDE_MM_RANGE, POSITION_RANGE, WIDTH_RANGE
from engine.kernels import constants as of
from engine.kernels import strings
from engine.kernels.playing.plucks import vary
from engine.pluck import Pluck
from engine.presets import Preset
from engine.strike import Strike
from engine.values.ear import Ear
from engine.voices import Mixer

RATE_HZ = 48_000
STROKES = 40
PATCHES = [entry.patch for entry in list_patches(SHIPPED)[0]]
DRUMS = [patch for patch in PATCHES if isinstance(patch.strings, Drums)]
PLUCKING = [field for field in ASSIGNABLE if field.startswith("pluck.")]


def with_ends(patch: Patch, fields: list[str], draw: random.Random) -> Patch:
    """A patch with some knobs at an end, and then all its macros; an end that another value forbids is left out."""
    for field in fields:
        try:
            patch = patch.with_knob(field, draw.choice(OF_PATCHES[field].limits))
        except ValueError:  # a softest pluck above the hardest
            continue
    for macro in range(len(patch.macros)):
        if draw.random() < 0.5:
            patch = patch.turned(macro, draw.choice((0.0, 1.0)))
    return patch


def turned_to_ends(patch: Patch) -> Iterator[Patch]:
    """Each macro and each knob of the pluck at either end, then some at random together."""
    draw = random.Random(patch.name)
    for macro, end in itertools.product(range(len(patch.macros)), (0.0, 1.0)):
        yield patch.turned(macro, end)
    for field in PLUCKING:
        yield with_ends(patch, [field], draw)
    for _ in range(4):
        yield with_ends(patch, draw.sample(PLUCKING, 6), draw)


@pytest.mark.parametrize("patch", PATCHES, ids=lambda patch: patch.name)
def test_every_stroke_of_every_knob_is_a_pluck(patch: Patch) -> None:
    draw = random.Random(patch.name)
    for turned in turned_to_ends(patch):
        for velocity in (*VELOCITIES, draw.randint(2, 126)):
            pluck = turned.pluck.pluck(velocity)
            for _ in range(STROKES):
                stroke, key = draw.randrange(1_000_000), draw.randrange(128)
                position, amplitude_mm, width = vary(
                    pluck.position, pluck.amplitude_mm, pluck.width, turned.pluck.variation, stroke, key
                )
                Pluck(position, amplitude_mm, pluck.shape, width)
        for wheel in (-1, 0, 127, 128):
            wheeled(turned, wheel, "")


@pytest.mark.parametrize("patch", PATCHES, ids=lambda patch: patch.name)
def test_no_knob_turns_a_string_into_an_impossible_one(patch: Patch) -> None:
    limits = [OF_PATCHES[f"knobs.{name}"].limits for name in KNOBS]
    found, chosen = np.empty(of.STRING), patch.strings
    if isinstance(chosen, Drums):
        return
    own = [chosen.string] if isinstance(chosen, Fretted) else [each.string for each in chosen.strings]
    for string, knobs in itertools.product(own[:: max(len(own) - 1, 1)], itertools.product(*limits)):
        strings.turned(np.array(string.row), np.array(knobs), found)
        assert strings.possible(found), (knobs, found)


@pytest.mark.parametrize("patch", DRUMS, ids=lambda patch: patch.name)
def test_every_blow_of_a_drum_is_possible(patch: Patch) -> None:
    keys, (low, high) = DrumKeys(patch, Ear(tuple(patch.pickup.points))), patch.range
    for key, curve in itertools.product(range(low, high + 1), OF_PATCHES["pluck.curve"].limits):
        if keys.tuned_to(key) is not None:
            found = keys.of_key(key)
            assert found is not None
            for velocity in VELOCITIES:
                assert isinstance(found.strike(velocity, curve), Strike)


class Stage:
    """A player in a mixer, with the notes as the app follows them."""

    def __init__(self, patch: Patch, preset: Preset) -> None:
        self.mixer = Mixer(RATE_HZ)
        self.player = InstrumentPlayer(patch, preset, RATE_HZ, {"model": 1.0})
        self.mixer.set_player(self.player.compiled)
        self._notes: dict[int, KeyNote] = {}

    def play(self, *events: Event) -> list[Pluck]:
        """The plucks of the notes, each begun with quanta of its own, or later where it is strummed."""
        begun = []
        for event in events:
            id = self.player.handle(event)
            if isinstance(event, NoteOn):
                begun.append(KeyNote(self.player, self.mixer, id, event, self.player.preset.path))
                self._notes[id] = begun[-1]
            self._follow(128)
        self._follow(RATE_HZ // 2)
        return [note.pluck for note in begun if note.pluck is not None]

    def _follow(self, frames: int) -> None:
        assert np.isfinite(self.mixer.render(frames)).all()
        for report in self.player.reports():
            self._notes[report.id].take(report)


def scattered(count: int) -> list[Event]:
    draw = random.Random(count)
    return [NoteOn(draw.randrange(40, 76), draw.randint(*VELOCITIES)) for _ in range(count)]


def test_a_tone_at_zero_plays_on(preset: Preset) -> None:
    """Its macro brings both widths to an end of their range, from which strokes vary."""
    patch = next(each for each in PATCHES if each.name == "Classical guitar")
    tone = next(number for number, macro in enumerate(patch.macros) if macro.name == "Tone")
    wide = Stage(patch.turned(tone, 0.0), preset).play(*scattered(60))
    assert len(wide) == 60 and max(pluck.width for pluck in wide) == WIDTH_RANGE[1]
    narrow = patch.with_values({"pluck.width": WIDTH_RANGE[0], "pluck.width_hard": WIDTH_RANGE[0]})
    thin = Stage(narrow, preset).play(*scattered(60))
    assert len(thin) == 60 and min(pluck.width for pluck in thin) == WIDTH_RANGE[0]


def test_wheels_slides_hands_and_techniques_stay_within_ranges(preset: Preset) -> None:
    patch = next(each for each in PATCHES if each.name == "Classical guitar")
    extreme = patch.with_values({"pluck.position": POSITION_RANGE[0], "pluck.hardest_mm": AMPLITUDE_MM_RANGE[1]})
    extreme = extreme.model_copy(update={"pluck": extreme.pluck.model_copy(update={"variation": 1.0})})
    draw = random.Random(1)
    fields = [field for field in WHEEL if field.startswith(("pluck.", "technique."))]
    for field, mode in itertools.product(draw.sample(fields, 6), ("poly", "mpe")):
        turned = extreme.model_copy(update={"mod_wheel": field, "mode": mode})
        stage = Stage(turned, preset)
        for value in (0, 127, 128):
            switches = [Controller(number, value) for number in (MOD_WHEEL, SLIDE, HARMONICS)]
            assert len(stage.play(*switches, *scattered(8))) == 8
        by_hand = [
            Pluck(at, mm, "gaussian", width) for at in POSITION_RANGE for mm in (0.0, 20.0) for width in WIDTH_RANGE
        ]
        plucks = stage.play(*(NoteOn(50, 90, pluck=pluck) for pluck in by_hand))
        assert [(each.position, each.width) for each in plucks] == [(each.position, each.width) for each in by_hand]


def test_a_knob_may_go_to_every_end_while_strings_ring(preset: Preset) -> None:
    """Of the strings and of the pluck, with a note after each."""
    patch = next(each for each in PATCHES if each.name == "Steel-string acoustic")
    stage, draw = Stage(patch, preset), random.Random(2)
    turns = [
        PatchTurned(with_ends(patch, draw.sample([*PLUCKING, *(f"knobs.{name}" for name in KNOBS)], 5), draw))
        for _ in range(12)
    ]
    events = [event for turn in turns for event in (turn, *scattered(3))]
    assert len(stage.play(*events)) == 36


@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf"), -1.0, 1e300])
def test_the_nearest_pluck_is_always_one(value: float) -> None:
    made = Pluck(shape="rounded").nearest(position=value, amplitude_mm=value, width=value)
    assert made.shape == "rounded"
    low, high = POSITION_RANGE
    assert low <= made.position <= high
