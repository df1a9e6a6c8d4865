"""The compiled player, event for event, on rendered sound.

`frozen/sounds.json` has what an independent player in Python made of the same events, before it was removed: the norm
of the sound, then its projections on eight random directions, in norms. The compiled player agreed with it to 1e-9.
They were frozen again when fades lost their corners; with straight fades all agreed until then, to 3e-5, which silent
modes make that rest from the start. Eight were frozen again when nothing touched a string for longer than a period;
without that bound all agreed until then. Four were frozen again when both sides of a body came to bound the level of
keys; with the left side alone all agreed until then.
Its instruments are there as they were then, so that those of the factory may be voiced otherwise.
"""

from __future__ import annotations

import json
import threading
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from app.instrument import events
from app.instrument.compiled import InstrumentPlayer
from app.instrument.events import KEYS, Bend, Controller, Event, NoteOff, NoteOn, PatchTurned, PluckAt
from app.instrument.string_keys import StringKeys, on_string
from app.patches.library import find_patch, read_patch
from app.patches.patch import ASSIGNABLE, Noise, Patch, Pickup
from app.patches.tuning import TuningChoice
from app.shared.parameters import OF_PATCHES
from engine.kernels import constants as of
from engine.kernels.constants import QUANTUM
from engine.pluck import SHAPES, Pluck, Shape
from engine.presets import Preset
from engine.values.string import Losses, Polarisations
from engine.voices import Mixer
from tests.app.instrument.seen import sounding
from tests.engine.resonators.test_recorded import recorded

RATE_HZ = 48_000
GAINS = {"model": 1.0, "truth": -0.5}
CLOSE = 1e-7
FROZEN_PATCHES = Path(__file__).parent / "frozen"
FROZEN = json.loads((FROZEN_PATCHES / "sounds.json").read_text())
Framed = Sequence[tuple[int, Event]]


class Compiled:
    def __init__(self, patch: Patch, preset: Preset, most: int = 40, varied: bool = True) -> None:
        self.mixer = Mixer(RATE_HZ, limited=False)
        self.player = InstrumentPlayer(patch, preset, RATE_HZ, GAINS, most_notes=most, varied=varied)
        self.mixer.set_player(self.player.compiled)

    def handle(self, event: Event, frame: int) -> None:
        self.player.handle(event, frame)


def quantum(mixer: Mixer) -> NDArray[np.float64]:
    """The next one as it is mixed, in double precision."""
    mixer.render(QUANTUM)
    return mixer.record["mix"].flatten()


def rendered(stage: Compiled, played: Framed, quanta: int) -> NDArray[np.float64]:
    """(frames, 2), events being handed over with the quantum of their frames."""
    sound, left = [], list(played)
    for number in range(quanta):
        while left and left[0][0] < (number + 1) * QUANTUM:
            frame, event = left.pop(0)
            stage.handle(event, frame)
        sound.append(quantum(stage.mixer))
    return np.concatenate(sound).reshape(-1, 2)


def difference(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Relative to the highest sample of both."""
    highest = max(np.abs(one).max(), np.abs(other).max())
    assert highest > 1e-4
    return float(np.abs(one - other).max() / highest)


def off(name: str, sound: NDArray[np.float64]) -> float:
    """By how much a sound is another than the frozen one of this name: the largest of all its numbers."""
    flat = sound.ravel()
    norm = float(np.linalg.norm(flat))
    directions = np.random.default_rng(0).standard_normal((8, len(flat)))
    known = np.array(FROZEN[name])
    return float(np.abs(np.array([norm / known[0] - 1, *(directions @ flat / norm - known[1:])])).max())


def compared(name: str, patch: Patch, preset: Preset, played: Framed, quanta: int, most: int = 40) -> float:
    return off(name, rendered(Compiled(patch, preset, most), played, quanta))


@pytest.fixture(scope="session")
def shipped() -> dict[str, Patch]:
    """Without variation from stroke to stroke and strings at rest, which the frozen sounds have not."""
    paths = [path for path in FROZEN_PATCHES.glob("*.json") if path.stem != "sounds"]
    read = {path.stem: read_patch(path) for path in paths}
    even = {name: patch.pluck.model_copy(update={"variation": 0.0}) for name, patch in read.items()}
    return {name: changed(patch, pluck=even[name], sympathy_s_kg=0.0) for name, patch in read.items()}


def changed(patch: Patch, **parts: object) -> Patch:
    return Patch.model_validate({**dict(patch), **parts})


CONTROLLERS = (
    *(events.SUSTAIN, events.MOD_WHEEL, events.SLIDE, events.RESET, events.NOTES_OFF),
    *(events.REGISTERED, events.FINE_REGISTERED, events.VALUE, events.FINE_VALUE, events.OTHER),
)
KNOBS = ("knobs.tension", "knobs.gauge", "knobs.decay", "knobs.stiffness", "damping.release_t60_s", "pluck.position")


def drawn(patch: Patch, other: Patch, seed: int, seconds: float, count: int = 60) -> list[tuple[int, Event]]:
    """Random events, in their order; keys are often struck again, and two events often share a frame."""
    draw = np.random.default_rng(seed)
    low, high = patch.range
    keys = draw.integers(low, high + 1, 5).tolist()
    channels = {"poly": (0, 0, 1, KEYS), "guitar": (0, 1, 2, 3, 4, 9, KEYS), "mpe": (0, 1, 2, 3, KEYS)}[patch.mode]
    frames = np.sort(draw.integers(1, round(seconds * RATE_HZ), count))
    frames[::7] = frames[::7] // QUANTUM * QUANTUM
    frames = np.sort(frames)
    present, found = patch, list[tuple[int, Event]]()
    for number, frame in enumerate(frames.tolist()):
        channel, kind = int(draw.choice(channels)), draw.random()
        key, value = int(draw.choice(keys)), int(draw.integers(0, 128))
        if number < 3 or kind < 0.4:
            found.append((frame, NoteOn(key, max(1, value), channel)))
        elif kind < 0.6:
            found.append((frame, NoteOff(key, channel)))
        elif kind < 0.75:
            found.append((frame, Bend(float(draw.uniform(-1.2, 1.2)), channel)))
        elif kind < 0.97:
            number = int(draw.choice(CONTROLLERS))
            chooses = number in (events.REGISTERED, events.FINE_REGISTERED)
            found.append((frame, Controller(number, 0 if chooses else value, channel)))
        elif kind < 0.98:
            found.append((frame, Controller(events.SOUND_OFF, 0, channel)))
        else:
            name = str(draw.choice(KNOBS))
            turned = present.with_value(name, present.value(name) * float(draw.uniform(0.8, 1.2)))
            present = turned if draw.random() < 0.8 else other
            found.append((frame, PatchTurned(present)))
    return released_once(found)


def released_once(played: list[tuple[int, Event]]) -> list[tuple[int, Event]]:
    """With a release for each stroke, and resets of all that a channel has, as the frozen sounds know them."""
    strokes, found = Counter[tuple[int, int]](), list[tuple[int, Event]]()
    for frame, event in played:
        if isinstance(event, NoteOn):
            strokes[event.key, event.channel] += 1
        elif isinstance(event, NoteOff):
            found += [(frame, event)] * (strokes.pop((event.key, event.channel), 1) - 1)
        elif isinstance(event, Controller) and event.number == events.RESET:
            event = replace(event, value=events.AT_REST)
        found.append((frame, event))
    return found


TWO = Polarisations(angle_deg=30.0, second_heard=0.4, second_cents=3.0, conductance_s_kg=0.02)
INSTRUMENTS = [
    ("classical_guitar", {}),  # wheel on a knob
    ("electric_bass", {}),  # velocity
    ("concert_harp", {}),  # rings
    ("cimbalom", {}),  # added to the motion
    ("felt_on_wires", {"mod_wheel": "knobs.tension"}),
    ("guitar_in_nineteen_tones", {}),
    ("fretless_bass", {}),  # guitar, by length, wheel on the pluck, velocity
    ("oud", {"mod_wheel": "damping.release_t60_s"}),  # guitar
    ("sitar", {"pluck": "stops"}),  # guitar, velocity, added
    ("koto", {"mode": "mpe", "mod_wheel": "pluck.curve"}),
    ("jazz_guitar", {"mode": "mpe"}),
    ("flamenco_guitar", {"polarisations": TWO, "losses": Losses(), "mod_wheel": "knobs.decay"}),
    ("cimbalom", {"polarisations": TWO, "pluck": "slow"}),
]


def instrument(shipped: dict[str, Patch], name: str, parts: dict[str, object]) -> Patch:
    patch = shipped[name]
    if parts.get("pluck") == "stops":
        parts = {**parts, "pluck": patch.pluck.model_copy(update={"stops": False})}
    if parts.get("pluck") == "slow":
        slow = {"release_ms": 3.0, "release_hard_ms": 0.7}
        parts = {**parts, "pluck": patch.pluck.model_copy(update=slow)}
    return changed(patch, **parts)


@pytest.mark.parametrize("number", range(len(INSTRUMENTS)), ids=[name for name, _ in INSTRUMENTS])
@pytest.mark.parametrize("seed", [1, 2])
def test_random_events_sound_as_they_did(shipped: dict[str, Patch], preset: Preset, number: int, seed: int) -> None:
    name, parts = INSTRUMENTS[number]
    patch = instrument(shipped, name, parts)
    played = drawn(patch, shipped["kora"], seed, 0.4)
    assert compared(f"{number} {name} {seed}", patch, preset, played, 400) < CLOSE


@pytest.mark.parametrize(("name", "kind"), [("classical_guitar", "displacement"), ("fretless_bass", "velocity")])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_string_learned_from_a_recording_has_its_own_modes(
    shipped: dict[str, Patch], preset: Preset, name: str, kind: str, seed: int
) -> None:
    own = replace(recorded(), smooth_hz=(200.0, 1e3, 5e3), smooth_ratio=(1.5, 2.5, 0.8), pitch_hz=196.0)
    learned = replace(preset, info=replace(preset.info, recorded=own))
    pickup = Pickup(points=shipped[name].pickup.points, kind=kind)
    patch, other = (changed(shipped[each], pickup=pickup) for each in (name, "kora"))
    assert compared(f"recorded {name} {seed}", patch, learned, drawn(patch, other, seed, 0.4), 400) < CLOSE


def test_cancel_leaves_what_has_begun(shipped: dict[str, Patch], preset: Preset) -> None:
    stage = Compiled(shipped["cimbalom"], preset)
    stage.handle(NoteOn(50, 90), 0)
    stage.handle(NoteOn(57, 90), 200)
    for frame, key in ((5000, 50), (5003, 57), (6000, 62)):
        stage.handle(NoteOn(key, 120), frame)
    first = rendered(stage, (), 20)
    stage.player.cancel()
    assert off("cancel", np.concatenate([first, rendered(stage, (), 150)])) < CLOSE


def test_a_cancelled_note_is_reported(shipped: dict[str, Patch], preset: Preset) -> None:
    stage = Compiled(shipped["koto"], preset)
    number = stage.player.handle(NoteOn(60, 90), 5000)
    rendered(stage, (), 2)
    stage.player.cancel()
    rendered(stage, (), 1)
    assert [(each.kind, each.id) for each in stage.player.reports()] == [(of.REFUSED, number)]
    assert not stage.mixer.active


def test_a_burst_of_500_events_in_a_block_is_played_in_its_order(shipped: dict[str, Patch], preset: Preset) -> None:
    patch = changed(shipped["damped_harp"], mod_wheel="knobs.tension")
    draw, burst = np.random.default_rng(3), list[tuple[int, Event]]()
    for number in range(500):
        frame = 640 + number // 8
        if number % 10 == 0:
            burst.append((frame, NoteOn(40 + int(draw.integers(0, 25)), 80)))
        elif number % 10 == 5:
            burst.append((frame, NoteOff(40 + int(draw.integers(0, 25)))))
        elif number % 3 == 0:
            burst.append((frame, Bend(float(draw.uniform(-1, 1)))))
        else:
            burst.append((frame, Controller(int(draw.choice([events.MOD_WHEEL, events.SUSTAIN])), number % 128)))
    assert burst[0][0] // QUANTUM == burst[-1][0] // QUANTUM
    assert compared("burst", patch, preset, released_once(burst), 100) < CLOSE


def test_more_notes_than_there_are_places_all_begin(shipped: dict[str, Patch], preset: Preset) -> None:
    """The oldest are cut before they are heard."""
    patch = changed(shipped["concert_harp"], mode="mpe")
    stage = Compiled(patch, preset)
    given = [stage.player.handle(NoteOn(30 + 20 * (number % 3), 80, number % 16)) for number in range(300)]
    sound = rendered(stage, (), 40)
    begun = [each.id for each in stage.player.reports() if each.kind == of.BEGAN]
    assert begun == given[-len(begun) :] and len(begun) > 200
    assert np.isfinite(sound).all()
    assert len(stage.player.ringing()) <= 40


def test_more_events_than_the_ring_holds_are_played_later(shipped: dict[str, Patch], preset: Preset) -> None:
    stage = Compiled(shipped["koto"], preset)
    count = 2 * of.EVENTS + 500
    for number in range(count):
        stage.player.handle(Bend(number / count), 10 + number)
    assert stage.player.compiled.waiting == count + 1  # with the table
    for _ in range(count // QUANTUM + 2):
        rendered(stage, (), 1)
        _ = stage.player.compiled.waiting
    assert stage.player.compiled.waiting == 0
    assert stage.player.compiled.channel(0).bend == (count - 1) / count


def test_threads_may_give_events_while_the_mixer_plays(shipped: dict[str, Patch], preset: Preset) -> None:
    stage = Compiled(shipped["koto"], preset)
    count = 1500

    def give(channel: int) -> None:
        for number in range(count):
            stage.player.handle(Bend((number + 1) / count, channel))

    threads = [threading.Thread(target=give, args=(channel,)) for channel in range(4)]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads) or stage.player.compiled.waiting:
        quantum(stage.mixer)
    assert [stage.player.compiled.channel(channel).bend for channel in range(5)] == [1, 1, 1, 1, 0]
    assert int(stage.player.compiled.record["taken"]) == 4 * count + 1


def test_the_same_events_give_the_same_samples(shipped: dict[str, Patch], preset: Preset) -> None:
    patch = changed(shipped["oud"], pluck=shipped["oud"].pluck.model_copy(update={"variation": 1.0}))
    played = drawn(patch, shipped["kora"], 5, 0.2)
    one, other = (rendered(Compiled(patch, preset), played, 100) for _ in range(2))
    np.testing.assert_array_equal(one, other)


def test_strokes_vary_where_the_instrument_says_so(shipped: dict[str, Patch], preset: Preset) -> None:
    varied = shipped["koto"].pluck.model_copy(update={"variation": 1.0, "release_ms": 2.0, "release_hard_ms": 1.0})
    patch = changed(shipped["koto"], pluck=varied, polarisations=TWO)
    found = []
    for stage in (Compiled(patch, preset), Compiled(patch, preset, varied=False)):
        for number in range(5):
            stage.player.handle(NoteOn(60, 90), 64 * number)
        rendered(stage, (), 8)
        plucks = [(each.position, each.amplitude_mm, each.width) for each in stage.player.reports()]
        found.append(np.array([each for each in plucks if each[1] > 0]))
    apart = np.abs(found[0] / found[1] - 1)
    assert (apart > 0).all() and (apart < [0.08, 0.13, 0.12]).all()
    assert len(np.unique(found[0], axis=0)) == 5 and len(np.unique(found[1], axis=0)) == 1


def test_the_oldest_make_room(shipped: dict[str, Patch], preset: Preset) -> None:
    patch = shipped["concert_harp"]
    played = [(1 + 480 * number, NoteOn(30 + 3 * number, 90)) for number in range(12)]
    assert compared("oldest", patch, preset, played, 200, most=5) < CLOSE


# Plucks by hand


def test_a_pluck_by_hand_with_the_values_of_a_velocity_sounds_like_its_key(
    shipped: dict[str, Patch], preset: Preset
) -> None:
    for name, key in (("classical_guitar", 52), ("fretless_bass", 40), ("cimbalom", 60)):
        patch = shipped[name]
        one, other = Compiled(patch, preset), Compiled(patch, preset)
        keys = one.player.keys
        assert isinstance(keys, StringKeys)
        found = keys.string_of(key)
        assert found is not None
        pluck = on_string(found, patch.pluck.pluck(90))
        sound = rendered(one, [(0, NoteOn(key, 90))], 100)
        assert difference(sound, rendered(other, [(0, NoteOn(key, 1, pluck=pluck))], 100)) < 1e-9


@pytest.mark.parametrize("shape", SHAPES)
def test_a_pluck_by_hand_has_its_own_shape(shipped: dict[str, Patch], preset: Preset, shape: Shape) -> None:
    """As in an instrument that plucks so, whose keys have other gains."""
    patch = changed(shipped["classical_guitar"], noise=Noise(), sympathy_s_kg=0.0)
    alike = changed(patch, pluck=patch.pluck.model_copy(update={"shape": shape}))
    heard = []
    for each in (patch, alike):
        stage = Compiled(each, preset)
        sound = rendered(stage, [(0, NoteOn(52, 90, pluck=Pluck(0.3, 2.5, shape, 0.2)))], 100)
        (gain,) = (report.gain for report in stage.player.reports() if report.kind == of.BEGAN)
        heard.append(sound / gain)
    assert difference(*heard) < 1e-9


def test_a_pluck_by_hand_is_exact_where_strokes_vary(shipped: dict[str, Patch], preset: Preset) -> None:
    patch = changed(shipped["koto"], pluck=shipped["koto"].pluck.model_copy(update={"variation": 1.0}))
    stage, pluck = Compiled(patch, preset), Pluck(0.31, 2.5, patch.pluck.shape, 0.03)
    for number in range(3):
        stage.handle(NoteOn(60, 90, pluck=pluck), 640 * number)
    rendered(stage, (), 30)
    reports = [each for each in stage.player.reports() if each.kind == of.BEGAN]
    assert {(each.position, each.amplitude_mm, each.width) for each in reports} == {(0.31, 2.5, 0.03)}


def test_a_string_plucked_by_hand_rings_until_its_key_is_released_and_no_tremolo_plucks_it(
    shipped: dict[str, Patch], preset: Preset
) -> None:
    patch = changed(shipped["classical_guitar"], technique={"tremolo_hz": 16.0})
    stage, pluck = Compiled(patch, preset), Pluck(0.3, 1.0, patch.pluck.shape, 0.03)
    rendered(stage, [(64, NoteOn(52, 90, pluck=pluck))], 300)
    assert [each.kind for each in stage.player.reports()] == [of.BEGAN]
    assert [(each.key, each.damped) for each in sounding(stage.player)] == [(52, False)]
    rendered(stage, [(0, NoteOff(52))], 2)
    assert [each.damped for each in sounding(stage.player)] == [True]


def test_with_legato_a_key_moves_a_string_plucked_by_hand_which_no_key_holds(
    shipped: dict[str, Patch], preset: Preset
) -> None:
    patch = shipped["classical_guitar"]
    stage, pluck = Compiled(patch, preset), Pluck(0.3, 1.0, patch.pluck.shape, 0.03)
    legato = Controller(events.LEGATO, 127)
    rendered(stage, [(0, legato), (64, NoteOn(52, 90, pluck=pluck)), (6400, NoteOn(53, 90))], 200)
    assert [(each.key, each.damped) for each in sounding(stage.player)] == [(53, False)]
    rendered(stage, [(0, NoteOff(53))], 2)
    assert [(each.key, each.damped) for each in sounding(stage.player)] == [(53, True)]


# What comes back


def test_reports_say_what_was_plucked(shipped: dict[str, Patch], preset: Preset) -> None:
    patch = changed(shipped["fretless_bass"], mod_wheel="none")
    stage, played = Compiled(patch, preset), drawn(patch, shipped["koto"], 9, 0.2)
    struck = [(frame, each) for frame, each in played if isinstance(each, NoteOn)]
    keys = stage.player.keys
    assert isinstance(keys, StringKeys)
    for frame, event in struck:
        stage.handle(event, frame)
    rendered(stage, (), 200)
    reports = [each for each in stage.player.reports() if each.kind == of.BEGAN]
    assert len(reports) == len(struck) > 3
    for report, (frame, event) in zip(reports, struck, strict=True):
        assert (report.key, report.channel, report.velocity) == (event.key, event.channel, event.velocity)
        assert report.frame == frame
        found = keys.string_of(event.key, report.string if report.string >= 0 else None)
        assert found is not None
        assert report.parameters == found.parameters
        pairs = min(of.MOST_PAIRS, found.modes) if patch.polarisations else 0
        assert report.modes == found.modes + pairs and report.gain > 0
        pluck = on_string(found, patch.pluck.pluck(event.velocity))
        plucked = report.position, report.amplitude_mm
        assert plucked == pytest.approx((pluck.position, pluck.amplitude_mm), rel=1e-12)
        if pluck.shape != "triangular":
            assert report.width == pytest.approx(pluck.width, rel=1e-12)


def test_wheels_and_pedals_can_be_read(shipped: dict[str, Patch], preset: Preset) -> None:
    patch = shipped["concert_harp"]  # the wheel turns its room
    stage = Compiled(patch, preset)
    assert stage.player.at_hand == [] and stage.player.heard_through == patch
    chosen = [Controller(events.REGISTERED, 0, 1), Controller(events.FINE_REGISTERED, 0, 1)]
    for event in (
        *(*chosen, Controller(events.VALUE, 5, 1), Controller(events.FINE_VALUE, 50, 1)),
        *(Bend(0.25, 1), Controller(events.SUSTAIN, 127), Controller(events.SLIDE, 9, 2)),
        Controller(events.MOD_WHEEL, 127, 3),
    ):
        stage.handle(event, 0)
    stage.player.compiled.catch_up(stage.mixer.address)
    other = Compiled(patch, preset)
    for event in stage.player.at_hand:
        other.handle(event, 0)
    other.player.compiled.catch_up(other.mixer.address)
    for number in range(of.CHANNELS):
        assert other.player.compiled.channel(number) == stage.player.compiled.channel(number)
    one = stage.player.compiled.channel(1)
    assert (one.bend, one.range_semitones, one.pedal, one.slide) == (0.25, 5.5, False, None)
    assert stage.player.compiled.channel(0).pedal and stage.player.compiled.channel(2).slide == 9
    assert stage.player.compiled.wheel == other.player.compiled.wheel == (127, 3)
    assert stage.player.heard_through == other.player.heard_through != patch
    stage.handle(Controller(events.RESET, 0, 3), 0)
    assert stage.player.heard_through == patch


@pytest.mark.parametrize("name", ["koto", "timpani"])
def test_without_a_comparison_a_note_has_a_voice_of_the_audible_source_alone(name: str, preset: Preset) -> None:
    patch, sounds = find_patch(name).patch, {}
    event = NoteOn(sum(patch.range) // 2, 100)
    for compared in (False, True):
        mixer = Mixer(RATE_HZ, limited=False)
        player = InstrumentPlayer(patch, preset, RATE_HZ, GAINS)
        mixer.set_player(player.compiled)
        player.set_gains({"model": 1.0, "truth": 0.0}, compared)
        player.handle(event)
        sounds[compared] = mixer.render(4_800)
        assert mixer.active == (2 if compared else 1)
        player.set_gains({"model": 0.0, "truth": 1.0}, compared)
        mixer.render(9_600)
        assert bool(np.abs(mixer.render(480)).max() > 1e-4) == compared
        player.handle(event)  # the next note has the other source
        assert np.abs(mixer.render(4_800)).max() > 1e-4
    np.testing.assert_array_equal(sounds[False], sounds[True])


def test_another_player_begins_as_the_hands_are(shipped: dict[str, Patch], preset: Preset) -> None:
    stage = Compiled(shipped["koto"], preset)
    stage.player.set_gains({"model": 0.25, "truth": 0.0})
    for event in (Controller(events.SUSTAIN, 127), Bend(-0.5)):
        stage.handle(event, 0)
    stage.player.compiled.catch_up(stage.mixer.address)
    made = stage.player.again(44_100)
    mixer = Mixer(44_100)
    mixer.set_player(made.compiled)
    made.compiled.catch_up(mixer.address)
    assert made.rate_hz == 44_100 and made.keys is stage.player.keys
    assert made.compiled.channel(0) == stage.player.compiled.channel(0)
    assert [made.compiled.source_gain(source) for source in (0, 1)] == [0.25, 0.0]


def test_notes_of_the_player_before_ring_on_and_can_be_stopped(shipped: dict[str, Patch], preset: Preset) -> None:
    stage = Compiled(shipped["concert_harp"], preset)
    rendered(stage, [(1, NoteOn(50, 90))], 20)
    others = [InstrumentPlayer(shipped["koto"], preset, RATE_HZ, GAINS) for _ in range(2)]
    stage.mixer.set_player(others[0].compiled)
    sound = rendered(stage, (), 100)
    assert np.abs(sound[-1000:]).max() > 1e-3
    stage.player.stop(0.01)
    assert not rendered(stage, (), 40)[-500:].any()
    others[0].handle(NoteOn(60, 90))
    rendered(stage, (), 20)
    stage.mixer.set_player(others[1].compiled)
    stage.mixer.set_player(stage.player.compiled)
    assert not rendered(stage, (), 60)[-500:].any(), "two others have come"
    for _ in range(2):
        stage.mixer.forget_ended()
        stage.mixer.render(20_000)
    stage.mixer.forget_ended()
    assert len(stage.mixer._players) == 1


def test_a_single_note_can_be_released_and_its_events_cancelled(shipped: dict[str, Patch], preset: Preset) -> None:
    stage = Compiled(shipped["concert_harp"], preset)
    one, other = (stage.player.handle(NoteOn(key, 90)) for key in (50, 57))
    rendered(stage, (), 10)
    stage.player.release(one, 0.01)
    stage.player.release(other, 0.01, frame=5_000)
    rendered(stage, (), 20)
    assert [each.key for each in stage.player.ringing()] == [57]
    stage.player.cancel(other)
    later = stage.player.handle(NoteOn(60, 90), 6_000)
    stage.player.cancel(one)
    rendered(stage, (), 120)
    assert {each.key for each in stage.player.ringing()} == {57, 60}
    assert later in [each.id for each in stage.player.reports() if each.kind == of.BEGAN]


def test_levels_can_be_read(shipped: dict[str, Patch], preset: Preset) -> None:
    stage = Compiled(shipped["concert_harp"], preset)
    rendered(stage, [(1, NoteOn(50, 30)), (2, NoteOn(57, 120))], 100)
    soft, hard = stage.player.ringing()
    assert (soft.key, hard.key) == (50, 57)
    assert hard.level_db > soft.level_db + 6
    assert soft.seconds == pytest.approx(100 * QUANTUM / RATE_HZ, abs=0.003)


def test_tables_are_freed_when_the_kernel_has_left_them(shipped: dict[str, Patch], preset: Preset) -> None:
    stage = Compiled(shipped["koto"], preset)
    for number in range(20):
        turned = shipped["koto"].with_value("knobs.decay", 1 + number / 100)
        rendered(stage, [(0, PatchTurned(turned))], 1)
    assert len(stage.player.compiled._tables) <= 2


@pytest.mark.parametrize("id", [id for id in of.PLAYED[: of.POINT] if id in ASSIGNABLE])
def test_a_parameter_changes_as_by_a_turned_patch(shipped: dict[str, Patch], preset: Preset, id: str) -> None:
    """What rings, and what is struck later."""
    pluck = shipped["koto"].pluck.model_copy(update={"release_ms": 4.0, "release_hard_ms": 2.0})
    patch = changed(shipped["koto"], noise=Noise(onset_db=-20, release_db=-20), pluck=pluck)
    value = OF_PATCHES[id].value(0.9 * OF_PATCHES[id].share(patch.value(id)) + 0.03)
    one, other = Compiled(patch, preset), Compiled(patch, preset)
    for stage in (one, other):
        rendered(stage, [(1, NoteOn(60, 90))], 10)
    one.handle(PatchTurned(patch.with_value(id, value)), 0)
    other.player.compiled.give(of.PARAMETER, key=of.PLAYED.index(id), value=value)
    later = [(10, NoteOn(62, 90)), (3000, NoteOff(62)), (3000, NoteOff(60))]
    sounds = [rendered(stage, later, 100) for stage in (one, other)]
    np.testing.assert_array_equal(*sounds)


def test_gains_of_sources_may_change_while_notes_ring(shipped: dict[str, Patch], preset: Preset) -> None:
    stage = Compiled(shipped["koto"], preset)
    rendered(stage, [(1, NoteOn(60, 90))], 50)
    stage.player.compiled.set_source_gains((0.0, 0.0))
    sound = rendered(stage, (), 60)
    assert sound[:200].any() and not sound[round(0.025 * RATE_HZ) :].any()


def test_a_key_without_a_string_is_an_error_and_one_out_of_range_is_silent(
    shipped: dict[str, Patch], preset: Preset
) -> None:
    stage = Compiled(shipped["koto"], preset)
    stage.player.handle(NoteOn(10, 90))
    rendered(stage, (), 2)
    assert [each.kind for each in stage.player.reports()] == [of.REFUSED] and not stage.mixer.active
    impossible = changed(shipped["koto"], range=(0, 127), tuning=TuningChoice(a4_hz=880, transpose=48))
    with pytest.raises(ValueError, match="key 127"):
        Compiled(impossible, preset).player.handle(NoteOn(127, 90))


def test_a_pluck_at_a_place_is_none_of_a_key(shipped: dict[str, Patch], preset: Preset) -> None:
    stage = Compiled(shipped["koto"], preset)
    assert stage.player.handle(PluckAt(Pluck())) == 0
    rendered(stage, (), 1)
    assert stage.player.reports() == [] and not stage.mixer.active
