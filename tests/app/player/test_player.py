"""The player itself: more events than fit, threads, other players, knobs, plucks by hand, and what it reports."""

import threading
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from app.instruments.instrument import ASSIGNABLE, WHEEL, BodyChoice, Fretted, Instrument, Knobs, Noise
from app.instruments.library import SHIPPED as INSTRUMENTS
from app.instruments.library import read_instrument
from app.player import events
from app.player.compiled import InstrumentPlayer
from app.player.events import Bend, ControlChange, InstrumentTurned, NoteOff, NoteOn, TimedEvent
from app.player.offline import BLOCK_FRAMES, SILENT_DB, OfflinePlayer, render_events, render_note
from app.player.strings import StringKeys, on_string
from engine import bounds
from engine.kernels import constants as of
from engine.kernels import midi
from engine.kernels.constants import QUANTUM
from engine.parameters import OF_INSTRUMENTS, PLAYED
from engine.pluck import SHAPES, Pluck
from engine.values.effects import Room
from engine.values.string import Polarisations
from engine.voices import Mixer, Voice, plain_program
from tests.app.player.conftest import STEEL
from tests.app.player.seen import seen
from tests.app.player.stage import KEY, PRESET, RATE_HZ, SOURCES, Stage, changed, relative


def shipped(name: str, **parts: Any) -> Instrument:
    """Without strings that ring in sympathy, so that silence can be heard."""
    return changed(read_instrument(INSTRUMENTS / f"{name}.json"), sympathy_s_kg=0.0, **parts)


@pytest.fixture
def stage() -> Stage:
    return Stage(shipped("concert_harp"))


def test_more_notes_than_there_are_places_all_begin():
    stage = Stage(shipped("concert_harp", mode="mpe"))
    given = [stage.player.handle(NoteOn(30 + 20 * (number % 3), 80, number % 16)) for number in range(300)]
    assert np.isfinite(stage.run((), 40 * QUANTUM)).all()
    begun = [each.id for each in stage.begun]
    assert begun == given[-len(begun) :] and len(begun) > 200 and len(stage.player.compiled.ringing()) <= 40


def test_threads_may_give_more_events_than_the_ring_holds_while_the_mixer_plays(stage):
    count, compiled = of.EVENTS, stage.player.compiled

    def give(channel: int) -> None:
        for number in range(1, count + 1):
            stage.player.handle(Bend(number / count, channel), 10 + number)

    first, *others = [threading.Thread(target=give, args=(channel,)) for channel in range(4)]
    first.start()
    first.join()
    assert compiled.waiting == count + 1, "with the table"
    for thread in others:
        thread.start()
    while any(thread.is_alive() for thread in others) or compiled.waiting:
        stage.mixer.render(QUANTUM)
    assert [compiled.channel(channel).bend for channel in range(5)] == [1, 1, 1, 1, 0]
    assert int(compiled.record["taken"]) == 4 * count + 1


def test_notes_of_the_player_before_ring_on_and_can_be_stopped(stage):
    stage.run([(1, NoteOn(50, 90))], 20 * QUANTUM)
    others = [InstrumentPlayer(shipped("koto"), PRESET, RATE_HZ, {"model": 1.0}) for _ in range(2)]
    stage.mixer.set_player(others[0].compiled)
    assert np.abs(stage.run((), 100 * QUANTUM)[-1000:]).max() > 1e-3
    stage.player.stop(0.01)
    assert not stage.run((), 40 * QUANTUM)[-500:].any()
    others[0].handle(NoteOn(60, 90))
    stage.run((), 20 * QUANTUM)
    for player in (others[1], stage.player):
        stage.mixer.set_player(player.compiled)
    assert not stage.run((), 60 * QUANTUM)[-500:].any(), "two others have come"


@pytest.mark.parametrize("source", SOURCES)
def test_players_one_after_the_other_add_up(instrument, source):
    """Of courses, whose strokes have the same numbers in both."""
    moving = Polarisations(angle_deg=30, second_cents=2, conductance_s_kg=0.02, second_conductance_s_kg=0.004)
    course = changed(instrument, polarisations=moving, course={"strings": 2, "bridge": 1.0, "cents": 2})

    def rendered(*begins: bool) -> np.ndarray:
        stage, found = Stage(course, (source,), varied=False), []
        for plays in begins:
            stage.player = stage.player.again(RATE_HZ)
            stage.mixer.set_player(stage.player.compiled)
            if plays:
                stage.player.handle(NoteOn(KEY, 60), 0)
            found.append(stage.left(4_800))
        return np.concatenate(found)

    both, one, other = rendered(True, True), rendered(True, False), rendered(False, True)
    np.testing.assert_allclose(both, one + other, atol=1e-6 * np.abs(both).max())


@pytest.mark.parametrize("name", ["brass_strung_harp", "electric_guitar_bridge_pick_up", "tanpura_drone"])
def test_what_is_handed_to_its_mixer_and_what_it_plays_add_up(name):
    """A string of the Lab neither sounds through an instrument that rings nor moves its other strings."""
    instrument = read_instrument(INSTRUMENTS / f"{name}.json")
    strangers = np.random.default_rng(0).uniform(-0.5, 0.5, (RATE_HZ // 4, 2)).astype(np.float32)

    def mixed(plays: bool, adds: bool) -> np.ndarray:
        stage = OfflinePlayer(instrument, PRESET, RATE_HZ, {"model": 1.0}, limited=False, varied=False, dry=False)
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
def test_without_a_comparison_a_note_has_a_voice_of_the_audible_source_alone(name):
    instrument, sounds = read_instrument(INSTRUMENTS / f"{name}.json"), {}
    event = NoteOn(sum(instrument.range) // 2, 100)
    for compared in (False, True):
        stage = Stage(instrument, SOURCES)
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


def test_reports_say_what_was_plucked():
    instrument = shipped("fretless_bass", mod_wheel="none", pluck={"variation": 0.0})
    stage = Stage(instrument)
    struck = {500 * n + 7: NoteOn(key, 1 + 25 * n, n % 4) for n, key in enumerate((28, 33, 41, 47, 52, 60))}
    stage.run(list(struck.items()), 4_800)
    assert isinstance(stage.player.keys, StringKeys) and len(stage.begun) == 6
    for report in stage.begun:
        event = struck[report.frame]
        assert (report.key, report.channel, report.velocity) == (event.key, event.channel, event.velocity)
        found = stage.player.keys.of_key(event.key, report.string if report.string >= 0 else None)
        assert found is not None and report.parameters is not None and report.gain > 0
        assert report.parameters.row == pytest.approx(found.parameters.row)
        assert report.modes == found.modes + (min(of.MOST_PAIRS, found.modes) if instrument.polarisations else 0)
        pluck = on_string(found, instrument.pluck.pluck(event.velocity))
        assert (report.position, report.amplitude_mm, report.width) == pytest.approx(
            (pluck.position, pluck.amplitude_mm, pluck.width)
        )


@pytest.mark.parametrize("shape", SHAPES)
def test_a_pluck_by_hand_is_exactly_itself(shape):
    instrument = shipped("classical_guitar", noise=Noise(), pluck={"variation": 0.0})
    pluck, heard = Pluck(0.3, 2.5, shape, 0.2), []
    for variation, own in ((0.0, instrument.pluck.shape), (0.0, shape), (1.0, shape)):
        each = changed(instrument, pluck={"shape": own, "variation": variation})
        stage = Stage(each)
        sound = stage.run([(0, NoteOn(52, 90, pluck=pluck))], 6_400)
        (begun,) = stage.begun
        assert (begun.position, begun.amplitude_mm, begun.width) == (0.3, 2.5, 0.2)
        heard.append(sound / begun.gain)
    np.testing.assert_allclose(heard[1], heard[0], rtol=0, atol=1e-9 * np.abs(heard[0]).max())


def test_another_player_begins_as_the_hands_are(stage):
    player, instrument = stage.player, stage.player.instrument  # the wheel turns its room
    assert player.at_hand == [] and player.heard_through == instrument
    player.set_gains({"model": 0.25})
    switches = [ControlChange(number, 127, events.KEYS) for number in (midi.HARMONICS, midi.TREMOLO, midi.STRUM)]
    wheels = [(midi.SUSTAIN, 127, 0), (midi.SLIDE, 9, 2), (midi.MOD_WHEEL, 127, 3)]
    tuned = [*events.parameter_set(midi.FINE_TUNING, 80, 3, 2), *events.parameter_set(midi.COARSE_TUNING, 66, 0, 2)]
    given = [*tuned, *events.parameter_set(0, 5, 50, 1), Bend(0.25, 1), *(ControlChange(*each) for each in wheels)]
    stage.run([(0, event) for event in (*given, *switches)], QUANTUM)
    made, mixer = player.again(44_100), Mixer(44_100)
    mixer.set_player(made.compiled)
    mixer.render(QUANTUM)
    channels = [player.compiled.channel(number) for number in range(of.CHANNELS)]
    assert [made.compiled.channel(number) for number in range(of.CHANNELS)] == channels
    assert (channels[1].bend, channels[1].range_semitones) == (0.25, 5.5)
    assert channels[0].pedal and channels[2].slide == 9 and channels[2].coarse_tuning == 2
    assert made.at_hand == player.at_hand and set(switches) < set(made.at_hand)
    assert (made.rate_hz, made.compiled.source_gain(0)) == (44_100, 0.25)
    assert player.heard_through == made.heard_through != instrument and made.compiled.wheel == (127, 3)
    player.handle(ControlChange(midi.RESET, 0, 3), 0)
    assert player.heard_through == instrument


def test_the_wheel_turns_whatever_it_may(instrument):

    def heard(field: str, value: int) -> object:
        stage = Stage(changed(instrument, mod_wheel=field, body=BodyChoice(name="guitar"), room=Room(mix=0.1)))
        stage.play(ControlChange(midi.MOD_WHEEL, value))
        for key, velocity in ((50, 20), (52, 110)):
            stage.play(NoteOn(key, velocity), NoteOff(key))
        plucks = [(each.position, each.amplitude_mm, each.width) for each in stage.begun]
        return plucks, [each.now for each in seen(stage.player)], stage.player.heard_through

    for field in WHEEL:
        assert field == "damping.mute" or "technique" in field or heard(field, 0) != heard(field, 127), field


def test_a_turned_knob_is_the_event_of_a_plug_in_and_sounds_as_another_table():
    slow = {"release_ms": 4.0, "release_hard_ms": 2.0, "variation": 0.0}
    instrument = shipped("koto", noise=Noise(onset_db=-20, release_db=-20), pluck=slow)
    later = [(10, NoteOn(62, 90)), (3000, NoteOff(62)), (3000, NoteOff(60))]
    for id in (id for id in PLAYED[: of.VALUE.pickup_points_0] if id in ASSIGNABLE):
        value = OF_INSTRUMENTS[id].value(0.9 * OF_INSTRUMENTS[id].share(instrument.value(id)) + 0.03)
        turned, stages = instrument.with_value(id, value), [Stage(instrument) for _ in range(3)]
        one, other, plugged = (stage.player for stage in stages)
        for stage in stages:
            stage.run([(1, NoteOn(60, 90))], 640)
        table = one.table
        one.handle(InstrumentTurned(turned))
        other.take(other.keys_of(turned))
        plugged.compiled.give(of.PARAMETER, key=PLAYED.index(id), value=value)
        assert (one.table, one.instrument) == (table, turned), f"{id} needs no table"
        first, *rest = (stage.run(later, 100 * QUANTUM) for stage in stages)
        for sound in rest:
            np.testing.assert_array_equal(sound, first, err_msg=id)


TURNS = {f"knobs.{name}": value for name, value in (("stiffness", 4.0), ("decay", 8.0), ("brightness_decay", 6.0))}
TURNS |= {"knobs.modulus": 3.0, "knobs.density": 2.0, "knobs.gauge": 1.6, "knobs.tension": 3.0, "knobs.length": 0.6}
TURNS |= {"tuning.a4_hz": 466.16}


@pytest.mark.parametrize("field", sorted({*TURNS, *(f"knobs.{name}" for name in Knobs.model_fields)}))
def test_every_knob_turned_while_it_rings_changes_model_and_truth_alike_without_a_click(instrument, field):
    section, _, name = field.partition(".")
    sounds, at, glide = {}, RATE_HZ // 4, round(0.1 * RATE_HZ)
    for turned in (changed(instrument, **{section: {name: TURNS[field]}}), instrument):
        for source in SOURCES:
            stage = Stage(instrument, (source,))
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


def test_a_knob_goes_as_far_as_a_string_is_possible(instrument):
    stage, densest = Stage(instrument), bounds.STRING["density_kg_m3"][1]
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


def test_a_file_ends_when_nothing_is_heard_whatever_controllers_follow(instrument):
    lively, timed = changed(instrument, room=Room(mix=0.4, t60_s=1.0), sympathy_s_kg=0.01), timed_key(0.2)
    late = [TimedEvent(time_s, ControlChange(11, 90)) for time_s in (30.0, 50.0)]
    sound, followed = (
        np.concatenate(list(render_events(lively, PRESET, each, RATE_HZ))) for each in (timed, timed + late)
    )
    heard = np.flatnonzero(np.abs(sound).max(axis=1) >= 10 ** (SILENT_DB / 20))[-1]
    assert heard > 0.2 * RATE_HZ and len(followed) == len(sound) <= heard + 2 * BLOCK_FRAMES


def timed_key(seconds: float) -> list[TimedEvent]:
    return [TimedEvent(0.0, NoteOn(60, 100)), TimedEvent(seconds, NoteOff(60))]


def test_a_note_can_be_stopped_while_it_is_rendered(instrument):
    reached_s: list[float] = []

    def advanced(seconds: float) -> None:
        reached_s.append(seconds)
        if seconds > 0.5:
            raise InterruptedError

    with pytest.raises(InterruptedError):
        render_note(instrument, PRESET, 50, 100, 60.0, 60.0, RATE_HZ, "model", advanced)
    assert len(reached_s) > 1 and reached_s[-1] < 1.0
