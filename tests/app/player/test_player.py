"""The player itself: more events than fit, threads, other players, knobs, plucks by hand, and what it reports."""

from __future__ import annotations

import gc
import threading
import weakref
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from app.instruments.instrument import ASSIGNABLE, WHEEL, BodyChoice, Fretted, Instrument, Knobs, Noise
from app.instruments.library import SHIPPED as INSTRUMENTS
from app.instruments.library import read_instrument
from app.instruments.tuning import TuningChoice
from app.player import events
from app.player.compiled import InstrumentPlayer
from app.player.events import Bend, ControlChange, InstrumentTurned, NoteOff, NoteOn, PluckAt, TimedEvent, release_all
from app.player.offline import (
    BLOCK_FRAMES,
    SILENT_DB,
    OfflinePlayer,
    channels_played,
    render_events,
    render_note,
)
from app.player.strings import StringKeys, on_string
from app.shared.parameters import OF_INSTRUMENTS
from engine import bounds
from engine.kernels import constants as of
from engine.kernels import midi
from engine.kernels.constants import QUANTUM
from engine.pluck import SHAPES, Pluck, Shape
from engine.presets import Preset, load_preset
from engine.presets.finding import SHIPPED
from engine.values.effects import Room
from engine.values.string import Polarisations
from engine.voices import Mixer, Voice, plain_program
from tests.app.player.conftest import STEEL
from tests.app.player.seen import seen, sounding
from tests.app.player.stage import KEY, RATE_HZ, SOURCES, Stage, changed, level_db, play, relative


def shipped(name: str, **parts: Any) -> Instrument:
    """Without strings that ring in sympathy, so that silence can be heard."""
    return changed(read_instrument(INSTRUMENTS / f"{name}.json"), sympathy_s_kg=0.0, **parts)


@pytest.fixture
def koto(preset: Preset) -> Stage:
    return Stage(shipped("koto", pluck={"variation": 0.0}), preset)


@pytest.fixture
def harp(preset: Preset) -> Stage:
    return Stage(shipped("concert_harp"), preset)


# More than fits


def test_more_notes_than_there_are_places_all_begin(preset: Preset) -> None:
    """The oldest are cut before they are heard."""
    stage = Stage(shipped("concert_harp", mode="mpe"), preset)
    given = [stage.player.handle(NoteOn(30 + 20 * (number % 3), 80, number % 16)) for number in range(300)]
    sound = stage.run((), 40 * QUANTUM)
    begun = [each.id for each in stage.begun]
    assert begun == given[-len(begun) :] and len(begun) > 200
    assert np.isfinite(sound).all()
    assert len(stage.player.compiled.ringing()) <= 40


def test_more_events_than_the_ring_holds_are_played_later(koto: Stage) -> None:
    count, compiled = 2 * of.EVENTS + 500, koto.player.compiled
    for number in range(count):
        koto.player.handle(Bend(number / count), 10 + number)
    assert compiled.waiting == count + 1  # with the table
    for _ in range(count // QUANTUM + 2):
        koto.run((), QUANTUM)
        _ = compiled.waiting
    assert compiled.waiting == 0
    assert compiled.channel(0).bend == (count - 1) / count


def test_threads_may_give_events_while_the_mixer_plays(koto: Stage) -> None:
    count, compiled = 1500, koto.player.compiled

    def give(channel: int) -> None:
        for number in range(count):
            koto.player.handle(Bend((number + 1) / count, channel))

    threads = [threading.Thread(target=give, args=(channel,)) for channel in range(4)]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads) or compiled.waiting:
        koto.mixer.render(QUANTUM)
    assert [compiled.channel(channel).bend for channel in range(5)] == [1, 1, 1, 1, 0]
    assert int(compiled.record["taken"]) == 4 * count + 1


def test_tables_are_freed_when_the_kernel_has_left_them(koto: Stage) -> None:
    tables = []
    for number in range(20):
        koto.take(koto.player.instrument.with_value("knobs.decay", 1 + number / 100))
        tables.append(weakref.ref(koto.player.table))
        koto.run((), QUANTUM)
    gc.collect()
    assert sum(table() is not None for table in tables) <= 2


# Notes that wait, ring, and are ended


def test_a_single_note_can_be_released_and_its_events_cancelled(harp: Stage) -> None:
    one, other = (harp.player.handle(NoteOn(key, 90)) for key in (50, 57))
    harp.run((), 10 * QUANTUM)
    harp.player.release(one, 0.01)
    harp.player.release(other, 0.01, frame=5_000)
    harp.run((), 20 * QUANTUM)
    assert [each.key for each in harp.player.compiled.ringing()] == [57]
    harp.player.cancel(other)
    later = harp.player.handle(NoteOn(60, 90), 6_000)
    harp.player.cancel(one)
    harp.run((), 120 * QUANTUM)
    assert {each.key for each in harp.player.compiled.ringing()} == {57, 60}
    assert later in [each.id for each in harp.begun]


def test_notes_of_the_player_before_ring_on_and_can_be_stopped(harp: Stage, preset: Preset) -> None:
    harp.run([(1, NoteOn(50, 90))], 20 * QUANTUM)
    others = [InstrumentPlayer(shipped("koto"), preset, RATE_HZ, {"model": 1.0}) for _ in range(2)]
    harp.mixer.set_player(others[0].compiled)
    assert np.abs(harp.run((), 100 * QUANTUM)[-1000:]).max() > 1e-3
    harp.player.stop(0.01)
    assert not harp.run((), 40 * QUANTUM)[-500:].any()
    others[0].handle(NoteOn(60, 90))
    harp.run((), 20 * QUANTUM)
    harp.mixer.set_player(others[1].compiled)
    harp.mixer.set_player(harp.player.compiled)
    assert not harp.run((), 60 * QUANTUM)[-500:].any(), "two others have come"


@pytest.mark.parametrize("source", SOURCES)
def test_players_one_after_the_other_add_up(instrument: Instrument, preset: Preset, source: str) -> None:
    """Of courses, whose strokes have the same numbers in both."""
    moving = Polarisations(angle_deg=30, second_cents=2, conductance_s_kg=0.02, second_conductance_s_kg=0.004)
    course = changed(instrument, polarisations=moving, course={"strings": 2, "bridge": 1.0, "cents": 2})

    def rendered(*begins: bool) -> np.ndarray:
        mixer, found = Mixer(RATE_HZ, limited=False), []
        for plays in begins:
            player = InstrumentPlayer(course, preset, RATE_HZ, {source: 1.0}, varied=False)
            mixer.set_player(player.compiled)
            if plays:
                player.handle(NoteOn(KEY, 60), 0)
            found.append(mixer.render(4_800)[:, 0].astype(np.float64))
        return np.concatenate(found)

    both, one, other = rendered(True, True), rendered(True, False), rendered(False, True)
    np.testing.assert_allclose(both, one + other, atol=1e-6 * np.abs(both).max())


@pytest.mark.parametrize("name", ["brass_strung_harp", "electric_guitar_bridge_pick_up", "tanpura_drone"])
def test_what_is_handed_to_its_mixer_and_what_it_plays_add_up(preset: Preset, name: str) -> None:
    """A string of the Lab neither sounds through an instrument that rings nor moves its other strings."""
    instrument = read_instrument(INSTRUMENTS / f"{name}.json")
    strangers = np.random.default_rng(0).uniform(-0.5, 0.5, (RATE_HZ // 4, 2)).astype(np.float32)

    def mixed(plays: bool, adds: bool) -> np.ndarray:
        stage = OfflinePlayer(instrument, preset, RATE_HZ, {"model": 1.0}, limited=False, varied=False, dry=False)
        if plays:
            stage.handle(NoteOn(sum(instrument.range) // 2, 100), 0)
        if adds:
            stage.mixer.add(Voice.of_samples(plain_program(RATE_HZ), strangers))
        return stage.mixer.render(RATE_HZ // 2).astype(np.float64)

    both, own, alone = mixed(True, True), mixed(True, False), mixed(False, True)
    np.testing.assert_allclose(both, own + alone, atol=1e-6)
    assert np.abs(own).max() > 0.01
    np.testing.assert_allclose(alone[200 : RATE_HZ // 4], strangers[200:], atol=1e-6)
    assert np.abs(alone[RATE_HZ // 4 :]).max() < 1e-12


@pytest.mark.parametrize("name", ["koto", "timpani"])
def test_without_a_comparison_a_note_has_a_voice_of_the_audible_source_alone(name: str, preset: Preset) -> None:
    instrument, sounds = read_instrument(INSTRUMENTS / f"{name}.json"), {}
    event = NoteOn(sum(instrument.range) // 2, 100)
    for compared in (False, True):
        stage = Stage(instrument, preset, SOURCES)
        stage.player.set_gains({"model": 1.0, "truth": 0.0}, compared)
        stage.player.handle(event)
        sounds[compared] = stage.left(4_800)
        assert stage.mixer.active == (2 if compared else 1)
        stage.player.set_gains({"model": 0.0, "truth": 1.0}, compared)
        stage.left(9_600)
        assert bool(np.abs(stage.left(480)).max() > 1e-4) == compared
        stage.player.handle(event)  # the next note has the other source
        assert np.abs(stage.left(4_800)).max() > 1e-4
    np.testing.assert_array_equal(sounds[False], sounds[True])


# Strokes, and what is reported of them


def test_reports_say_what_was_plucked(preset: Preset) -> None:
    instrument = shipped("fretless_bass", mod_wheel="none", pluck={"variation": 0.0})
    draw, stage = np.random.default_rng(9), Stage(instrument, preset)
    keys, struck = draw.integers(instrument.range[0], instrument.range[1] + 1, 6), {}
    for number, key in enumerate(keys.tolist()):
        struck[500 * number + 7] = NoteOn(key, int(draw.integers(1, 128)), number % 4)
    stage.run(list(struck.items()), 4_800)
    assert isinstance(stage.player.keys, StringKeys) and len(stage.begun) == 6
    for report in stage.begun:
        event = struck[report.frame]
        assert (report.key, report.channel, report.velocity) == (event.key, event.channel, event.velocity)
        found = stage.player.keys.of_key(event.key, report.string if report.string >= 0 else None)
        assert found is not None and report.parameters == found.parameters and report.gain > 0
        assert report.modes == found.modes + (min(of.MOST_PAIRS, found.modes) if instrument.polarisations else 0)
        pluck = on_string(found, instrument.pluck.pluck(event.velocity))
        assert (report.position, report.amplitude_mm) == pytest.approx((pluck.position, pluck.amplitude_mm))


def test_strokes_vary_where_the_instrument_says_so(preset: Preset) -> None:
    instrument = shipped("koto", pluck={"variation": 1.0, "release_ms": 2.0, "release_hard_ms": 1.0})
    found = []
    for varied in (True, False):
        stage = Stage(instrument, preset, varied=varied)
        stage.run([(64 * number, NoteOn(60, 90)) for number in range(5)], 512)
        found.append(np.array([(each.position, each.amplitude_mm, each.width) for each in stage.begun]))
    apart = np.abs(found[0] / found[1] - 1)
    assert (apart > 0).all() and (apart < [0.08, 0.13, 0.12]).all()
    assert [len(np.unique(each, axis=0)) for each in found] == [5, 1]


@pytest.mark.parametrize(("node", "place"), [(2, 0.2), (5, 0.08)])
def test_a_harmonic_is_plucked_short_of_its_first_node(
    instrument: Instrument, preset: Preset, node: int, place: float
) -> None:
    stage = Stage(changed(instrument, technique={"harmonic": node}), preset)
    stage.play(NoteOn(KEY, 60))
    assert stage.begun[0].position == pytest.approx(place)


def test_slide_moves_the_pluck_until_all_is_released(instrument: Instrument, preset: Preset) -> None:
    stage, on = Stage(changed(instrument, mode="mpe"), preset), NoteOn(57, 60, 1)
    stage.play(ControlChange(midi.SLIDE, 127, 1), on)
    stage.play(ControlChange(midi.RESET, 0, 1), on)  # RP-015: it is a sound controller
    stage.play(*release_all([1]), on)
    assert [each.position for each in stage.begun] == [pytest.approx(0.5)] * 2 + [instrument.pluck.position]


# Plucks by hand


@pytest.mark.parametrize(("name", "key"), [("classical_guitar", 52), ("fretless_bass", 40), ("cimbalom", 60)])
def test_a_pluck_by_hand_with_the_values_of_a_velocity_sounds_like_its_key(
    preset: Preset, name: str, key: int
) -> None:
    instrument = shipped(name, pluck={"variation": 0.0})
    one, other = Stage(instrument, preset), Stage(instrument, preset)
    assert isinstance(one.player.keys, StringKeys)
    found = one.player.keys.of_key(key)
    assert found is not None
    by_hand = NoteOn(key, 1, pluck=on_string(found, instrument.pluck.pluck(90)))
    sound, alike = one.run([(0, NoteOn(key, 90))], 6_400), other.run([(0, by_hand)], 6_400)
    np.testing.assert_allclose(alike, sound, rtol=0, atol=1e-9 * np.abs(sound).max())


@pytest.mark.parametrize("shape", SHAPES)
def test_a_pluck_by_hand_is_exactly_itself(preset: Preset, shape: Shape) -> None:
    """As in an instrument that plucks so, whose keys have other gains; also where strokes vary."""
    instrument = shipped("classical_guitar", noise=Noise(), pluck={"variation": 0.0})
    pluck, heard = Pluck(0.3, 2.5, shape, 0.2), []
    for variation, own in ((0.0, instrument.pluck.shape), (0.0, shape), (1.0, shape)):
        each = changed(instrument, pluck={"shape": own, "variation": variation})
        stage = Stage(each, preset)
        sound = stage.run([(0, NoteOn(52, 90, pluck=pluck))], 6_400)
        (begun,) = stage.begun
        assert (begun.position, begun.amplitude_mm, begun.width) == (0.3, 2.5, 0.2)
        heard.append(sound / begun.gain)
    np.testing.assert_allclose(heard[1], heard[0], rtol=0, atol=1e-9 * np.abs(heard[0]).max())


@pytest.mark.parametrize(
    ("switch", "moves_to"), [(ControlChange(midi.TREMOLO, 127), 52), (ControlChange(midi.LEGATO, 127), 53)]
)
def test_a_string_plucked_by_hand_rings_until_a_key_of_it_is_released(
    preset: Preset, switch: ControlChange, moves_to: int
) -> None:
    """No tremolo plucks it again, and with legato a key moves it."""
    stage = Stage(shipped("classical_guitar"), preset)
    by_hand = NoteOn(52, 90, pluck=Pluck(0.3, 1.0, stage.player.instrument.pluck.shape, 0.03))
    moved = [(6_400, NoteOn(53, 90))] if moves_to == 53 else []
    stage.run([(0, switch), (64, by_hand), *moved], 200 * QUANTUM)
    assert [(each.key, each.damped) for each in sounding(stage.player)] == [(moves_to, False)]
    assert len(stage.begun) == 1 + len(moved)
    stage.run([(0, NoteOff(moves_to))], 128)
    assert [(each.key, each.damped) for each in sounding(stage.player)] == [(moves_to, True)]


def test_a_pluck_at_a_place_is_none_of_a_key(koto: Stage) -> None:
    assert koto.player.handle(PluckAt(Pluck())) == 0
    koto.run((), QUANTUM)
    assert koto.reports == [] and not koto.mixer.active


# Hands


def test_another_player_begins_as_the_hands_are(preset: Preset) -> None:
    """With wheels, pedals, footswitches, ranges and gains; and body and room are turned by the wheel."""
    instrument = shipped("concert_harp")  # the wheel turns its room
    stage = Stage(instrument, preset)
    assert stage.player.at_hand == [] and stage.player.heard_through == instrument
    stage.player.set_gains({"model": 0.25})
    chosen = [ControlChange(midi.REGISTERED, 0, 1), ControlChange(midi.FINE_REGISTERED, 0, 1)]
    switches = [ControlChange(number, 127, events.KEYS) for number in (midi.HARMONICS, midi.TREMOLO, midi.STRUM)]
    given = [*chosen, ControlChange(midi.VALUE, 5, 1), ControlChange(midi.FINE_VALUE, 50, 1), Bend(0.25, 1)]
    given += [
        ControlChange(midi.SUSTAIN, 127),
        ControlChange(midi.SLIDE, 9, 2),
        ControlChange(midi.MOD_WHEEL, 127, 3),
    ]
    stage.run([(0, event) for event in (*given, *switches)], QUANTUM)
    made, mixer = stage.player.again(44_100), Mixer(44_100)
    mixer.set_player(made.compiled)
    mixer.render(QUANTUM)
    channels = [stage.player.compiled.channel(number) for number in range(of.CHANNELS)]
    assert [made.compiled.channel(number) for number in range(of.CHANNELS)] == channels
    assert (channels[1].bend, channels[1].range_semitones, channels[0].pedal, channels[2].slide) == (
        0.25,
        5.5,
        True,
        9,
    )
    assert made.at_hand == stage.player.at_hand and set(switches) < set(made.at_hand)
    assert (made.rate_hz, made.compiled.source_gain(0)) == (44_100, 0.25)
    assert stage.player.heard_through == made.heard_through != instrument and made.compiled.wheel == (127, 3)
    stage.player.handle(ControlChange(midi.RESET, 0, 3), 0)
    assert stage.player.heard_through == instrument


@pytest.mark.parametrize("field", [field for field in WHEEL if field != "damping.mute" and "technique" not in field])
def test_the_wheel_turns_whatever_it_may(instrument: Instrument, preset: Preset, field: str) -> None:
    """Something of the next notes, soft and hard, or of what they are heard through, is another."""

    def heard(value: int) -> object:
        wheel = changed(instrument, mod_wheel=field, body=BodyChoice(name="guitar"), room=Room(mix=0.1))
        stage = Stage(wheel, preset)
        stage.play(ControlChange(midi.MOD_WHEEL, value))
        for key, velocity in ((50, 20), (52, 110)):
            stage.play(NoteOn(key, velocity), NoteOff(key))
        plucks = [(each.position, each.amplitude_mm, each.width) for each in stage.begun]
        return plucks, [each.now for each in seen(stage.player)], stage.player.heard_through

    assert heard(0) != heard(127)


def test_the_wheel_brings_the_room(instrument: Instrument, preset: Preset) -> None:
    wheel = changed(instrument, mod_wheel="room.mix", room=Room(mix=0.0, t60_s=1.0))

    def tail(value: int) -> float:
        played = [(0.0, ControlChange(midi.MOD_WHEEL, value)), (0.1, NoteOn(50, 100)), (0.4, NoteOff(50))]
        return float(np.abs(play(wheel, preset, 1.6, *played)[round(1.2 * RATE_HZ) :]).max())

    assert tail(0) < 1e-5 and tail(127) > 1e-4
    turned, still = ([TimedEvent(0.0, ControlChange(midi.MOD_WHEEL, 127))], [TimedEvent(0.0, NoteOn(50, 100))])
    assert [channels_played(wheel, each) for each in (turned, still)] == [2, 1], "its echo has two sides"


# Knobs


@pytest.mark.parametrize("id", [id for id in of.PLAYED[: of.POINT] if id in ASSIGNABLE])
def test_a_parameter_changes_as_by_a_turned_instrument(preset: Preset, id: str) -> None:
    """What rings, and what is struck later."""
    slow = {"release_ms": 4.0, "release_hard_ms": 2.0, "variation": 0.0}
    instrument = shipped("koto", noise=Noise(onset_db=-20, release_db=-20), pluck=slow)
    value = OF_INSTRUMENTS[id].value(0.9 * OF_INSTRUMENTS[id].share(instrument.value(id)) + 0.03)
    one, other = Stage(instrument, preset), Stage(instrument, preset)
    for stage in (one, other):
        stage.run([(1, NoteOn(60, 90))], 640)
    one.player.handle(InstrumentTurned(instrument.with_value(id, value)), 0)
    other.player.compiled.give(of.PARAMETER, key=of.PLAYED.index(id), value=value)
    later = [(10, NoteOn(62, 90)), (3000, NoteOff(62)), (3000, NoteOff(60))]
    np.testing.assert_array_equal(*(stage.run(later, 100 * QUANTUM) for stage in (one, other)))


TURNS = {f"knobs.{name}": value for name, value in (("stiffness", 4.0), ("decay", 8.0), ("brightness_decay", 6.0))}
TURNS |= {"knobs.modulus": 3.0, "knobs.density": 2.0, "knobs.gauge": 1.6, "knobs.tension": 3.0, "knobs.length": 0.6}
TURNS |= {"tuning.a4_hz": 466.16}


@pytest.mark.parametrize("field", sorted({*TURNS, *(f"knobs.{name}" for name in Knobs.model_fields)}))
def test_every_knob_turned_while_it_rings_changes_model_and_truth_alike_without_a_click(
    instrument: Instrument, preset: Preset, field: str
) -> None:
    section, _, name = field.partition(".")
    sounds, at, glide = {}, RATE_HZ // 4, round(0.1 * RATE_HZ)
    for turned in (changed(instrument, **{section: {name: TURNS[field]}}), instrument):
        for source in SOURCES:
            stage = Stage(instrument, preset, (source,))
            stage.play(NoteOn(57, 100))
            before = stage.left(at)
            stage.take(turned)
            sounds[source, turned is instrument] = np.concatenate([before, stage.left(RATE_HZ // 2)])
    for source in SOURCES:
        sound, free = sounds[source, False], sounds[source, True]
        np.testing.assert_array_equal(sound[:at], free[:at])
        edges = np.abs(np.diff(sound, 2))
        beside = max(edges[at - glide : at - 2].max(), edges[at + glide : at + 2 * glide].max())  # higher partials
        assert edges[at - 2 : at + glide].max() < 1.3 * beside, source
        assert relative(sound[at + glide :], free[at + glide :]) > 0.03**2, source
    assert relative(sounds["model", False][at:], sounds["truth", False][at:]) < 1e-5


def test_a_knob_goes_as_far_as_a_string_is_possible(instrument: Instrument, preset: Preset) -> None:
    """For what rings and for the next key; where it would overdamp what rings, that stays as it is."""
    stage, densest = Stage(instrument, preset), bounds.STRING["density_kg_m3"][1]
    (note,) = stage.play(NoteOn(57, 60))
    before = note.now.now
    stage.take(changed(instrument, strings=Fretted(string=replace(STEEL, damping_d3_kg_m_s=2e-2))))
    stage.play()
    assert note.now.now == before
    with pytest.raises(ValueError, match="overdamped"):
        stage.player.handle(NoteOn(45, 90))
    heavy = changed(
        instrument, strings=Fretted(string=replace(STEEL, density_kg_m3=90_000.0)), knobs={"density": 3.0}
    )
    stage.take(heavy)
    stage.play(NoteOn(52, 60))
    assert note.now.now.density_kg_m3 == densest
    assert stage.begun[-1].parameters.density_kg_m3 == densest  # type: ignore[union-attr]


# Files of events


def test_a_file_ends_when_nothing_is_heard(instrument: Instrument, preset: Preset) -> None:
    lively = changed(instrument, room=Room(mix=0.4, t60_s=1.0), sympathy_s_kg=0.01)
    timed = [TimedEvent(0.0, NoteOn(60, 100)), TimedEvent(0.2, NoteOff(60))]
    sound = np.concatenate(list(render_events(lively, preset, timed, RATE_HZ)))
    heard = np.flatnonzero(np.abs(sound).max(axis=1) >= 10 ** (SILENT_DB / 20))[-1]
    assert heard > 0.2 * RATE_HZ and len(sound) - heard <= 2 * BLOCK_FRAMES


def test_a_file_ends_with_its_last_note_whatever_controllers_follow(instrument: Instrument, preset: Preset) -> None:
    timed = [TimedEvent(0.0, NoteOn(57, 90)), TimedEvent(0.1, NoteOff(57))]
    late = [TimedEvent(time_s, ControlChange(11, 90)) for time_s in (30.0, 50.0)]
    alone, followed = (
        sum(map(len, render_events(instrument, preset, each, RATE_HZ))) for each in (timed, timed + late)
    )
    assert followed == alone < 20 * RATE_HZ
    pedal = [TimedEvent(0.05, ControlChange(midi.SUSTAIN, 127)), TimedEvent(1.0, ControlChange(midi.SUSTAIN, 0))]
    sound = np.concatenate(list(render_events(instrument, preset, timed + pedal, RATE_HZ)))
    assert RATE_HZ < len(sound) < 2 * RATE_HZ  # the pedal after it is followed
    assert level_db(sound[:, 0], 0.8, 0.95) > -60


def test_a_note_can_be_stopped_while_it_is_rendered(instrument: Instrument, preset: Preset) -> None:
    reached_s: list[float] = []

    def advanced(seconds: float) -> None:
        reached_s.append(seconds)
        if seconds > 0.5:
            raise InterruptedError

    with pytest.raises(InterruptedError):
        render_note(instrument, preset, 50, 100, 60.0, 60.0, RATE_HZ, "model", advanced)
    assert len(reached_s) > 1 and reached_s[-1] < 1.0


# What cannot be played


def impossible(instrument: Instrument, preset: Preset) -> object:
    high = changed(instrument, range=(0, 127), tuning=TuningChoice(a4_hz=880, transpose=48))
    return Stage(high, preset).player.handle(NoteOn(127, 90))


def of_one_string(instrument: Instrument, _: Preset) -> object:
    return Stage(instrument, load_preset(SHIPPED / "studio_nylon_b3.safetensors"))


def no_source(instrument: Instrument, preset: Preset) -> object:
    return next(render_events(instrument, preset, [TimedEvent(0.0, NoteOn(57, 90))], RATE_HZ, "noise"))


def drums(instrument: Instrument, preset: Preset) -> object:
    return Stage(instrument, preset).player.keys_of(read_instrument(INSTRUMENTS / "concert_toms.json"))


@pytest.mark.parametrize(
    ("ask", "reported"),
    [
        (impossible, "key 127"),
        (of_one_string, "learned one string only"),
        (no_source, "source must be model, truth or difference, not 'noise'"),
        (drums, "has drums"),
    ],
)
def test_what_cannot_be_played_is_an_error(
    instrument: Instrument, preset: Preset, ask: Callable[[Instrument, Preset], object], reported: str
) -> None:
    with pytest.raises(ValueError, match=reported):
        ask(instrument, preset)


@pytest.mark.parametrize(("name", "key"), [("koto", 10), ("concert_toms", 52)])
def test_a_key_out_of_range_is_silent_and_refused(preset: Preset, name: str, key: int) -> None:
    stage = Stage(read_instrument(INSTRUMENTS / f"{name}.json"), preset)
    stage.player.handle(NoteOn(key, 90))
    stage.run((), 128)
    assert [each.kind for each in stage.reports] == [of.REFUSED] and not stage.mixer.active
