"""Plug-ins in a host: they sound as the app renders, in blocks of any size, and survive what hosts do."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from app.export.plugin.build import build_plugin
from app.export.plugin.formats import this_target
from app.export.plugin.image import Image, image_of
from app.instruments.drums import Drums
from app.instruments.instrument import Instrument, Technique
from app.player.events import ControlChange, InstrumentTurned, NoteOn, TimedEvent
from app.player.offline import render_events
from app.player.strings import Strings
from app.shared.parameters import OF_INSTRUMENTS
from engine.kernels.midi import HARMONICS, STRUM, TREMOLO
from tests.app.export.plugin import host
from tests.app.export.plugin.host import (
    IN_FILE,
    IN_PLUGIN,
    Browser,
    Event,
    Instance,
    Library,
    Preset,
    choke,
    midi,
    note_off,
    note_on,
    param,
    tune,
)
from tests.app.export.plugin.pieces import (
    DRUMS,
    EQUAL_DB,
    LONG,
    MOVED,
    NAMES,
    TURNED,
    difference_db,
    instrument_of,
    piece,
    played,
    preset_of,
    rendered,
    to_host,
)

pytestmark = pytest.mark.skipif(find_spec("ziglang") is None, reason="needs ziglang, the extra [plugin]")

RATE_HZ = 48_000
Sound = NDArray[np.float32]
Values = dict[str, float]  # of parameters, by their ids in the app


def frame_of(time_s: float) -> int:
    return round(time_s * RATE_HZ)


def instance_of(bank: Library, name: str, rate_hz: int = RATE_HZ) -> Instance:
    instance = bank.create_named(instrument_of(name).name)
    instance.activate(rate_hz)
    return instance


def of_name(images: list[Image], name: str) -> Image:
    return next(each for each in images if each.name == instrument_of(name).name)


def moves(images: list[Image], instance: Instance, name: str, values: Values, time_s: float = 0.0) -> list[Event]:
    """Events that move parameters."""
    ids = dict(zip((each.id for each in of_name(images, name).parameters), instance.ids, strict=True))
    return [param(frame_of(time_s), ids[id], value) for id, value in values.items()]


def with_values(bank: Library, images: list[Image], name: str, values: Values, rate_hz: int = RATE_HZ) -> Instance:
    """An instance whose parameters are moved before anything is played."""
    instance = instance_of(bank, name, rate_hz)
    if values:
        instance.block(64, moves(images, instance, name, values))
        instance.deactivate()
        instance.activate(rate_hz)
    return instance


def check_alike(sound: Sound, wanted: Sound, plain: Sound | None = None) -> None:
    """It sounds as wanted, and not as without the changes."""
    assert difference_db(sound, wanted) < EQUAL_DB
    assert plain is None or difference_db(sound, plain) > -60


Turned = Callable[[Instrument, Image, np.random.Generator], Values]


def macros_anywhere(instrument: Instrument, _image: Image, draw: np.random.Generator) -> Values:
    return {f"macros.{number}": float(place) for number, place in enumerate(draw.random(len(instrument.macros)))}


def parameters_anywhere(instrument: Instrument, image: Image, draw: np.random.Generator) -> Values:
    """Values of one to nine parameters, each up to 0.4 of its range away, with which the piece can be played."""
    known = {each.id for each in image.parameters} & {*OF_INSTRUMENTS}
    while True:
        count = min(int(draw.choice([1, 2, 4, 9])), len(known))
        chosen, found = draw.choice(sorted(known), count, replace=False), Values()
        for id in map(str, chosen):
            share = OF_INSTRUMENTS[id].share(instrument.value(id))
            found[id] = OF_INSTRUMENTS[id].value(share + draw.uniform(-0.4, 0.4))
        if not 0.02 < found.get("pickup.points.0", 0.5) < 0.98:  # at its ends a string is silent
            continue
        with suppress(ValueError):
            changed = instrument.with_values(found)
            keys = [Strings(changed).of_key(event.key) for _, event in piece(instrument) if isinstance(event, NoteOn)]
            if all(key is not None and key.modes > 1 for key in keys):
                return found


STEEL, RUBBER = {"knobs.modulus": 3.0}, {"knobs.modulus": 0.3}
PLACES = {"pickup.points.0": 0.1, "pickup.points.1": 0.93}
ENDS = {"knobs.modulus": 20.0, "knobs.decay": 0.5, "knobs.brightness_decay": 3.0, "pickup.points.0": 0.5}
ROOM = {"body.size": 1.3, "room.t60_s": 2.2, "room.mix": 0.4}
RATES_HZ = (44_100, 96_000, 192_000) if LONG else (44_100, 96_000)
SOUNDS: list[tuple[str, int, Values | Turned]] = [
    *((name, RATE_HZ, Values()) for name in NAMES),
    *((name, rate_hz, Values()) for rate_hz in RATES_HZ for name in (NAMES if LONG else NAMES[:1])),
    *((name, RATE_HZ, macros_anywhere) for name in TURNED),
    *((name, RATE_HZ, parameters_anywhere) for name in TURNED if name not in DRUMS for _ in range(2)),
    *((name, RATE_HZ, values) for name in DRUMS for values in ({**STEEL, **PLACES}, RUBBER, ENDS)),
    ("electric_bass", RATE_HZ, {"source": 1.0}),
]


@pytest.mark.parametrize("seed", range(12 if LONG else 1))
@pytest.mark.parametrize(("name", "rate_hz", "turned"), SOUNDS)
def test_it_sounds_as_the_app_renders(
    bank: Library,
    images: list[Image],
    name: str,
    rate_hz: int,
    turned: Values | Turned,
    seed: int,
    request: pytest.FixtureRequest,
) -> None:
    """At any rate, with parameters and macros anywhere, of the model and of the truth."""
    instrument, image = instrument_of(name), of_name(images, name)
    draw = np.random.default_rng(zlib.crc32(request.node.name.encode()))
    values = turned(instrument, image, draw) if callable(turned) else turned
    print(values)
    wanted = instrument.with_values({id: value for id, value in values.items() if id in OF_INSTRUMENTS})
    for number in range(len(instrument.macros)):
        wanted = wanted.turned(number, values[f"macros.{number}"]) if turned is macros_anywhere else wanted
    sound = played(with_values(bank, images, name, values, rate_hz), instrument, rate_hz)
    check_alike(sound, rendered(wanted, rate_hz, "truth" if values == {"source": 1.0} else "model"))
    assert (
        turned is not macros_anywhere or difference_db(sound, rendered(instrument, rate_hz)) > -60
    )  # they are heard


def test_the_difference_of_model_and_truth_is_nearly_silent(bank: Library, images: list[Image]) -> None:
    sound = played(
        with_values(bank, images, "electric_bass", {"source": 2.0}), instrument_of("electric_bass"), RATE_HZ
    )
    assert float(np.abs(sound).max()) < 1e-3


@pytest.mark.parametrize(
    ("name", "steps", "settled_s"),
    [  # what moves when; knobs of body and room glide until they are settled
        *((name, ((0.05, STEEL), (0.2, PLACES), (0.4, {"knobs.decay": 0.6, **RUBBER})), 0.0) for name in DRUMS),
        ("fretless_bass", ((0.05, 0, 0.9), (0.2, 1, 0.2), (0.47, 2, 0.7), (0.58, 0, 0.35)), 0.0),
        (MOVED, ((0.3, {"room.mix": 0.9}),), 0.7),
        (MOVED, ((0.3, ROOM),), 0.9),
    ],
)
def test_it_follows_parameters_while_it_plays(
    bank: Library, images: list[Image], name: str, steps: tuple, settled_s: float
) -> None:
    """Blows and plucks follow at once; drums that ring are heard at other places."""
    instrument = turned = instrument_of(name)
    instance, more, events = instance_of(bank, name), list[TimedEvent](), list[Event]()
    instance.go_offline()
    for time_s, *change in steps:
        if len(change) == 1:
            turned, values = turned.with_values(change[0]), change[0]
        else:  # a macro of those that do not move the room
            dry = [
                n for n, macro in enumerate(instrument.macros) if all(t.field != "room.mix" for t in macro.targets)
            ]
            number, place = dry[change[0]], change[1]
            turned, values = turned.turned(number, place), {f"macros.{number}": place}
        more.append(TimedEvent(time_s, InstrumentTurned(turned)))
        events += moves(images, instance, name, values, time_s)
    sound, after = played(instance, instrument, RATE_HZ, more=tuple(events)), slice(frame_of(settled_s), None)
    check_alike(sound[after], rendered(instrument, RATE_HZ, more=tuple(more))[after])
    assert difference_db(sound, rendered(instrument, RATE_HZ)) > -60


def test_a_bounce_of_a_swept_body_waits_for_its_thread(bank: Library, images: list[Image]) -> None:
    def bounced() -> Sound:
        instance = instance_of(bank, MOVED)
        instance.go_offline()
        sweep = [
            each for step in range(40)
            for each in moves(images, instance, MOVED, {"body.size": 0.6 + 0.05 * step}, 0.01 * step)
        ]  # fmt: skip
        return played(instance, instrument_of(MOVED), RATE_HZ, more=tuple(sweep))

    assert np.array_equal(bounced(), bounced())


@pytest.mark.parametrize(
    ("name", "time_s", "sent"),
    [
        ("concert_harp", 0.3, {1: 100}),  # the wheel
        (MOVED, 0.0, {HARMONICS: 127, TREMOLO: 127, STRUM: 127}),
        ("electric_bass", 0.0, {101: 0, 100: 0, 6: 12}),  # the range of bends
    ],
)
def test_controllers_are_followed_as_in_the_app(
    bank: Library, name: str, time_s: float, sent: dict[int, int]
) -> None:
    instrument, controls = instrument_of(name), [ControlChange(number, value) for number, value in sent.items()]
    sound = played(
        instance_of(bank, name),
        instrument,
        RATE_HZ,
        before=tuple(to_host(each, frame_of(time_s)) for each in controls),
    )
    wanted = rendered(instrument, RATE_HZ, before=tuple(TimedEvent(time_s, each) for each in controls))
    after = slice(frame_of(0.7) if time_s else 0, None)
    check_alike(sound[after], wanted[after])
    assert difference_db(sound, rendered(instrument, RATE_HZ)) > -60


def test_techniques_are_as_in_the_app_and_their_values_are_words(bank: Library) -> None:
    instrument = instrument_of(MOVED)
    values = {"harmonic": 3.0, "strum": 12.0, "strokes of strums": 1.0, "tremolo": 9.0}
    fields = ("harmonic", "strum_ms", "strokes", "tremolo_hz")
    turned = instrument.model_copy(update={"technique": Technique(**dict(zip(fields, values.values(), strict=True)))})
    instance = instance_of(bank, MOVED)
    ids = {name: instance.parameters[name].id for name in values}
    instance.block(64, [param(0, ids[name], value) for name, value in values.items()])
    assert [instance.text(ids["strokes of strums"], value) for value in range(3)] == ["down", "up", "both"]
    assert [instance.text(ids["harmonic"], value) for value in (1, 5)] == ["1", "5"]
    volume = instance.parameters["volume"]
    assert instance.text(volume.id, -1.4e-6) == "0 dB"  # what a host in single precision makes of 0
    assert [instance.number(volume.id, text) for text in (b"nan", b"", b"loud", b"\xff\xfe")] == [None] * 4
    assert [instance.number(volume.id, text) for text in (b"-1e400 dB", b"inf")] == [volume.low, volume.high]
    other = instance_of(bank, MOVED)
    assert other.load(instance.save())
    other.deactivate()
    other.activate(RATE_HZ)
    check_alike(played(other, instrument, RATE_HZ), rendered(turned, RATE_HZ), rendered(instrument, RATE_HZ))


@pytest.fixture(scope="module")
def others(objects: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Instrument, Library]:
    """A shell, a kettle, a rectangle in air, of many modes, and a modulus that becomes impossible."""
    timpani = instrument_of("timpani")
    assert isinstance(timpani.strings, Drums)
    one = timpani.strings.drums[0]
    changed: list[dict[str, object]] = [
        {"shell_m": 0.4, "cavity_m3": 0.0},
        {"length_m": 0.33, "width_m": 0.31, "cavity_m3": 0.02, "uneven": 0.01},
        {"shape": "rectangle", "length_m": 0.3541, "width_m": 0.0612, "cavity_m3": 0.0, "shell_m": 0.2},
        {"youngs_modulus_pa": 9e11},
    ]
    drums = tuple(
        one.model_copy(update={"note": 50 + place, "drum": replace(one.drum, **each)})
        for place, each in enumerate(changed)
    )
    strings = timpani.strings.model_copy(update={"drums": drums, "keys": "pads"})
    instrument = timpani.model_copy(update={"name": "Others", "strings": strings, "range": (50, 53)})
    image, place = image_of(instrument, preset_of("timpani")), tmp_path_factory.mktemp("others") / "others"
    return instrument, Library(build_plugin([image], "clap", this_target(), place, objects))


@pytest.mark.parametrize("factor", (0.05, 1.0, 20.0))
def test_other_drums_are_computed_as_in_the_app(others: tuple[Instrument, Library], factor: float) -> None:
    instrument, library = others
    instance = library.create_named("Others")
    instance.activate(RATE_HZ)
    instance.block(64, [param(0, instance.parameters["modulus"].id, factor)])
    instance.deactivate()
    instance.activate(RATE_HZ)
    struck = [(0.02 * place, NoteOn(50 + place, 90)) for place in range(4)]
    events = [to_host(event, frame_of(time_s)) for time_s, event in struck]
    sound = instance.render(24_000 + instance.latency, events)[instance.latency :]
    library.destroy_instances()
    possible = struck[:3] if factor > 1 else struck  # beyond the bounds of a modulus a key is silent
    timed, moved = [TimedEvent(*each) for each in possible], instrument.with_value("knobs.modulus", factor)
    check_alike(sound, np.concatenate(list(render_events(moved, preset_of("timpani"), timed, RATE_HZ, "model", 0.5))))


def test_blocks_of_any_size_and_neighbours_change_nothing(bank: Library) -> None:
    instrument, neighbour = instrument_of("cimbalom"), instance_of(bank, "concert_harp")
    whole = played(instance_of(bank, "cimbalom"), instrument, RATE_HZ)
    events = [to_host(event, frame_of(time_s)) for time_s, event in piece(instrument)]
    instance = instance_of(bank, "cimbalom")
    sound = instance.render(4_800, events, 1)[instance.latency :]  # the first tenth: a block is a call from Python
    assert np.array_equal(sound, whole[: len(sound)])
    for block in (17, 4096):
        neighbour.block(480, [note_on(neighbour.frame, 60, 100)])
        assert np.array_equal(played(instance_of(bank, "cimbalom"), instrument, RATE_HZ, block), whole)


# State and presets


def test_a_macro_moves_its_targets_and_the_state_keeps_them(bank: Library) -> None:
    instrument, instance = instrument_of(MOVED), instance_of(bank, MOVED)
    macro = instrument.macros[0]
    control = instance.parameters[macro.name]
    assert (control.low, control.high, control.standard) == (0.0, 1.0, macro.value)
    before = {name: instance.value(each.id) for name, each in instance.parameters.items()}
    instance.block(512, [param(100, control.id, 1.0)])
    moved = {name for name, each in instance.parameters.items() if instance.value(each.id) != before[name]}
    assert macro.name in moved and len(moved) > 1
    assert instance.callbacks == 1  # the host must read the other parameters again
    state, sound = instance.save(), played(instance, instrument, RATE_HZ)
    for running in (False, True):
        other = bank.create_named(instrument.name)
        if running:
            other.activate(RATE_HZ)
        assert other.load(state)
        if not running:
            other.activate(RATE_HZ)
        assert other.save() == state
        again = played(other, instrument, RATE_HZ)
        assert difference_db(again, sound) < -80  # a knob glides to where it was set; the state is there at once


def test_the_browser_of_presets_lists_each_instrument_and_nothing_else(bank: Library) -> None:
    browser = Browser(bank)
    done, found = browser.read()
    assert done
    assert browser.locations == [(1, "Instruments", IN_PLUGIN, None)]  # of the factory
    assert {preset.key: preset.name for preset in found} == bank.plugins
    for preset, name in zip(found, NAMES, strict=True):
        instrument = instrument_of(name)
        features = ["instrument", "drum" if name in DRUMS else "synthesizer", "stereo", instrument.category]
        owner, text = [("clap", preset.key)], instrument.description.encode()[:511].decode(errors="ignore")
        assert preset == Preset(instrument.name, preset.key, owner, 1, ["Learned Strings"], text, features)
    assert len(browser.read(most=2)[1]) == 3  # where the host has enough, the plug-in stops
    assert browser.read(bare=True) == (True, [Preset(preset.name, preset.key) for preset in found])
    assert browser.read(kind=IN_FILE) == (False, [])
    assert browser.ids == ["org.learned-strings.bank.presets"]
    assert not (browser.create("unknown") or browser.create(None) or browser.create(browser.ids[0], indexer=False))
    assert not browser.factory.descriptor(None, 1)
    assert not bank.entry.get_factory(b"unknown")


@pytest.mark.parametrize("name", (MOVED, "timpani"))
def test_a_preset_brings_back_the_instrument_as_it_was(bank: Library, name: str) -> None:
    instrument, fresh = instrument_of(name), instance_of(bank, name)
    state, sound = fresh.save(), played(fresh, instrument, RATE_HZ)
    (key,) = (preset.key for preset in Browser(bank).read()[1] if preset.name == instrument.name)
    all_at_the_top = [param(0, each.id, each.high) for each in fresh.described]
    for playing in (False, True):
        instance = instance_of(bank, name)
        instance.render(24_000, all_at_the_top)
        assert instance.save() != state
        if not playing:
            instance.deactivate()
        assert instance.load_preset(key)
        assert instance.save() == state
        assert instance.rescans == [1]  # of values
        assert instance.loaded == [(IN_PLUGIN, None, key.encode())]
        if playing:  # knobs glide, the room follows
            instance.render(96_000, [])
            assert difference_db(played(instance, instrument, RATE_HZ), sound) < -80
        else:
            instance.activate(RATE_HZ)
            assert np.array_equal(played(instance, instrument, RATE_HZ), sound)


def test_the_preset_of_another_instrument_is_refused(bank: Library) -> None:
    instance, other = instance_of(bank, MOVED), instance_of(bank, "timpani")
    by_name = {shown: id for id, shown in bank.plugins.items()}
    own, foreign = by_name[instrument_of(MOVED).name], by_name[instrument_of("timpani").name]
    instance.block(512, [param(0, instance.parameters[instrument_of(MOVED).macros[0].name].id, 1.0)])
    state = instance.save()
    for key, kind in ((foreign, IN_PLUGIN), (None, IN_PLUGIN), ("", IN_PLUGIN), (own, IN_FILE)):
        assert not instance.load_preset(key, kind)
    assert instance.errors == ["the preset belongs to another instrument"] * 4
    assert (instance.save(), instance.rescans, instance.loaded) == (state, [], [])
    other.withdraw_extensions()
    assert not other.load_preset(own)
    assert other.load_preset(foreign)


# Notes, resets and other calls of a host


def test_latency_tail_and_ends_of_notes_are_reported(bank: Library) -> None:
    harp = instance_of(bank, "concert_harp", 96_000)
    assert harp.latency == 96
    tail = harp.extension("clap.tail", host.Frames).get(harp.at)
    assert tail / 96_000 > instrument_of("concert_harp").room.t60_s
    instance = instance_of(bank, "electric_bass")
    instance.block(4_096, [note_on(0, 40, 100, note_id=7)])
    instance.block(512, [note_off(4_096, 40)])
    for _ in range(300):
        instance.block(1_024, [])
    assert instance.ended == [7]
    assert instance.status == 4  # it may sleep


@pytest.fixture
def ringing(bank: Library) -> Callable[..., float]:
    """The level of the end of a second, or of some frames, in which events were sent to a bass."""

    def level(*events: Event, frames: int = RATE_HZ) -> float:
        return float(np.abs(instance_of(bank, "electric_bass").render(frames, list(events))[-4_800:]).max())

    return level


def test_a_choked_note_is_silent_at_once_and_others_ring_on(ringing: Callable[..., float]) -> None:
    both = note_on(0, 40, 120, note_id=1), note_on(0, 47, 120, note_id=2)
    rest, one = ringing(*both), ringing(*both, choke(4_800, note_id=1))
    assert ringing(*both, choke(4_800, note_id=1), choke(4_800, key=47)) < 0.01 * rest
    assert 0.05 * rest < one < 0.99 * rest
    assert ringing(*both, choke(4_800)) < 0.01 * rest
    for choked in (choke(4_800), choke(4_800, key=40), choke(4_800, note_id=1)):
        again = note_on(9_600, 40, 120, note_id=2), note_off(12_000, 40)
        assert ringing(note_on(0, 40, 120, note_id=1), choked, *again) < 2 * ringing(*again)


def by_midi(event: Event) -> Event:
    """The same note as a message of MIDI."""
    note = event.content
    kind, velocity = (0x90, round(127 * note.velocity)) if note.header.type == host.NOTE_ON else (0x80, 64)
    return midi(event.frame, kind | note.channel, note.key, velocity)


@pytest.mark.parametrize("sent", [lambda event: event, by_midi])
def test_a_release_belongs_to_the_stroke_before_it(
    ringing: Callable[..., float], sent: Callable[[Event], Event]
) -> None:
    struck = [sent(each) for each in (note_on(0, 40, 120), note_on(4_800, 40, 120))]
    first, second = (sent(note_off(frame, 40)) for frame in (4_900, 6_000))
    held = ringing(*struck)
    assert ringing(*struck, first) == held  # of the first stroke
    assert ringing(*struck, first, second) < 0.01 * held


def test_tuning_one_note_leaves_the_others(bank: Library) -> None:
    def sound(*events: Event) -> Sound:
        return instance_of(bank, "fretless_bass").render(9_600, list(events))  # without an amplifier sounds add

    one, other, bend = note_on(0, 40, 100, note_id=1), note_on(0, 47, 100, note_id=2), tune(2_000, 2.0, note_id=2)
    bent, plain, alone = sound(one, other, bend), sound(one, other), sound(one)
    assert np.array_equal(bent[:2_000], plain[:2_000])
    assert difference_db(bent - alone, plain - alone) > -20
    assert difference_db(bent - alone, sound(other, bend)) < -100  # in the sum only single precision is lost


@pytest.mark.parametrize("name", NAMES)
def test_after_a_reset_it_is_as_a_new_one(bank: Library, name: str) -> None:
    instrument = instrument_of(name)
    low = max(instrument.range[0], min(52, instrument.range[1] - 20))
    instance, fresh = instance_of(bank, name), instance_of(bank, name)
    pedals = [midi(0, 0xE0, 0, 100), midi(0, 0xB0, 1, 90), midi(0, 0xB0, 64, 127), midi(0, 0xB1, 101, 0)]
    events = [*pedals, *(note_on(10 + 900 * each, low + 2 * each, 90 + 4 * each) for each in range(9))]
    instance.render(9_000, events)
    instance.reset()
    silence = instance.render(24_000, [])
    assert np.array_equal(silence, fresh.render(24_000, []))
    assert not silence.any() or (instrument.amp.drive_db > 0 and np.abs(silence).max() < 1e-15)  # as when new
    instance.render(9_000, events)
    names = {"volume", "decay", "modulus", "pluck position", "release", "body mix", "room", "amplifier drive"}
    for moved in (each for shown, each in instance.parameters.items() if shown in names):
        instance.block(1, [param(instance.frame, moved.id, moved.low + 0.3 * (moved.high - moved.low))])
    state = instance.save()
    fresh.deactivate()
    assert fresh.load(state)
    fresh.activate(RATE_HZ)
    instance.reset()
    assert instance.save() == state
    wanted = played(fresh, instrument, RATE_HZ)
    assert np.abs(wanted).max() > 1e-3
    assert np.array_equal(played(instance, instrument, RATE_HZ), wanted)


def test_the_last_of_many_values_counts_also_just_before_a_reset(bank: Library) -> None:
    instance, other, third = (instance_of(bank, "electric_bass") for _ in range(3))
    moved = [each for name, each in instance.parameters.items() if name not in ("Source", "volume")][:6]
    ends = [param(511, each.id, each.low + 0.4 * (each.high - each.low)) for each in moved]
    swept = [param(frame, each.id, each.high) for frame in range(511) for each in moved]
    instance.render(512, swept + ends)
    other.render(512, ends)
    found, wanted = (each.render(57_600, [note_on(48_000, 40, 100)]) for each in (instance, other))
    assert instance.save() == other.save()
    assert difference_db(found, wanted) < -80  # of body and room, which glide

    volume = third.parameters["volume"].id
    plain = third.render(9_600, [note_on(0, 40, 100)])
    third.render(64, [param(63, volume, -24.0)])
    third.reset()
    quiet = third.render(14_400, [note_on(4_800, 40, 100)])
    assert third.value(volume) == -24.0
    assert 20 < 20 * np.log10(np.abs(plain).max() / np.abs(quiet).max()) < 28
