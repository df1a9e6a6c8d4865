"""Plug-ins in a host: they sound as the app renders, in blocks of any size, and survive what hosts do."""

import json
import subprocess
import sys
import zlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from app.export.plugin import build
from app.instruments.instrument import Instrument
from app.player.events import Bend, ControlChange, InstrumentTurned, NoteOn
from app.player.strings import Strings
from engine.kernels.midi import HARMONICS, STRUM, TREMOLO
from engine.parameters import OF_INSTRUMENTS
from tests.app.export.plugin import host, pieces
from tests.app.export.plugin.abi import Sound
from tests.app.export.plugin.host import Event, Library, choke, midi, note_off, note_on, param
from tests.app.export.plugin.pieces import (
    MOVED,
    NAMES,
    RATE_HZ,
    active,
    difference_db,
    instrument_of,
    piece,
    played,
    rendered,
)

Values = dict[str, float]  # of parameters, by their ids in the app
Turned = Callable[[Instrument, list[int], np.random.Generator], Values]


def id_of(id: str) -> int:
    """The number of a parameter, which songs keep."""
    return zlib.crc32(id.encode()) & 0x7FFFFFFF


def moves(values: Values, time_s: float = 0.0) -> list[Event]:
    return [param(round(time_s * RATE_HZ), id_of(id), value) for id, value in values.items()]


def check_alike(sound: Sound, wanted: Sound, plain: Sound | None = None) -> None:
    """It sounds as wanted, and not as without the changes."""
    assert difference_db(sound, wanted) < pieces.EQUAL_DB
    assert plain is None or difference_db(sound, plain) > -60


def macros_anywhere(instrument: Instrument, _ids: list[int], draw: np.random.Generator) -> Values:
    return {f"macros.{number}": float(place) for number, place in enumerate(draw.random(len(instrument.macros)))}


def parameters_anywhere(instrument: Instrument, ids: list[int], draw: np.random.Generator) -> Values:
    """Values of one to nine parameters, each up to 0.4 of its range away, with which the piece can be played."""
    known = [id for id in OF_INSTRUMENTS if id_of(id) in ids]
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
TECHNIQUE = {"harmonic": 3.0, "strum_ms": 12.0, "strokes": 1.0, "tremolo_hz": 9.0}
RATES_HZ = (44_100, 96_000, 192_000)
SOUNDS: list[tuple[str, int, Values | Turned]] = [
    *((name, RATE_HZ, Values()) for name in NAMES),
    *(((name, rate_hz, Values()) for rate_hz in RATES_HZ for name in NAMES) if pieces.LONG else ()),
    ("concert_harp", 44_100, {}),
    (pieces.MEMBERS, 96_000, {}),
    *((name, RATE_HZ, macros_anywhere) for name in pieces.TURNED),
    *((name, RATE_HZ, parameters_anywhere) for name in pieces.TURNED if name not in pieces.DRUMS for _ in range(2)),
    *((name, RATE_HZ, values) for name in pieces.DRUMS for values in ({**STEEL, **PLACES}, RUBBER, ENDS)),
    *((pieces.OTHERS, RATE_HZ, {"knobs.modulus": factor}) for factor in (0.05, 20.0)),
    (MOVED, RATE_HZ, {f"technique.{name}": value for name, value in TECHNIQUE.items()}),
    *(("electric_bass", RATE_HZ, {"source": source}) for source in (1.0, 2.0)),
]


@pytest.mark.parametrize("seed", range(12 if pieces.LONG else 1))
@pytest.mark.parametrize(("name", "rate_hz", "turned"), SOUNDS)
def test_it_sounds_as_the_app_renders(bank, name, rate_hz, turned, seed, request):
    """At any rate, with parameters and macros anywhere, of the model and of the truth."""
    instrument, instance = instrument_of(name), active(bank, name, rate_hz)
    draw = np.random.default_rng(zlib.crc32(request.node.name.encode()))
    values = turned(instrument, instance.ids, draw) if callable(turned) else turned
    print(values)
    wanted = instrument.with_values({id: value for id, value in values.items() if id in OF_INSTRUMENTS})
    for number in range(len(instrument.macros) if turned is macros_anywhere else 0):
        wanted = wanted.turned(number, values[f"macros.{number}"])
    instance.block(64, moves(values))
    assert turned is not macros_anywhere or instance.callbacks == 1  # the host must read what they moved
    instance.deactivate()
    instance.activate(rate_hz)
    sound, source = played(instance, piece(instrument), rate_hz), values.get("source", 0.0)
    if source < 2.0:
        check_alike(sound, rendered(wanted, None, rate_hz, "truth" if source else "model"))
        assert turned is not macros_anywhere or difference_db(sound, rendered(instrument)) > -60  # they are heard
    else:  # of model and truth
        assert float(np.abs(sound).max()) < 1e-3


WHEELS = {HARMONICS: 127, TREMOLO: 127, STRUM: 127}
OF_BENDS = {101: 0, 100: 0, 6: 12}  # the range


@pytest.mark.parametrize(
    ("name", "steps", "settled_s"),
    [  # what moves when; knobs of body and room glide until they are settled
        *(
            (name, ((0.05, STEEL), (0.2, PLACES), (0.4, {"knobs.decay": 0.6, **RUBBER})), 0.0)
            for name in pieces.DRUMS
        ),
        ("fretless_bass", ((0.05, (0, 0.9)), (0.2, (1, 0.2)), (0.47, (2, 0.7)), (0.58, (0, 0.35))), 0.0),
        (MOVED, ((0.3, {"room.mix": 0.9}),), 0.7),
        (MOVED, ((0.3, ROOM),), 0.9),
        ("concert_harp", ((0.3, ControlChange(1, 100)),), 0.7),  # the wheel
        (MOVED, tuple((0.0, ControlChange(*each)) for each in WHEELS.items()), 0.0),
        ("electric_bass", tuple((0.0, ControlChange(*each)) for each in OF_BENDS.items()), 0.0),
    ],
)
def test_it_follows_parameters_and_controllers_while_it_plays(bank, name, steps, settled_s):
    """Blows and plucks follow at once; drums that ring are heard at other places."""
    instrument = turned = instrument_of(name)
    instance, events, controls, changes = active(bank, name), list[Event](), [], []
    instance.go_offline()
    for time_s, change in steps:
        if isinstance(change, ControlChange):
            controls.append((time_s, change))
            continue
        if isinstance(change, dict):
            turned, values = turned.with_values(change), change
        else:
            number, place = change
            turned, values = turned.turned(number, place), {f"macros.{number}": place}
        changes.append((time_s, InstrumentTurned(turned)))
        events += moves(values, time_s)
    music, after = [*controls, *piece(instrument)], slice(round(settled_s * RATE_HZ), None)
    sound = played(instance, music, more=events)
    check_alike(sound[after], rendered(instrument, [*music, *changes])[after])
    assert difference_db(sound, rendered(instrument)) > -60


def test_words_of_a_host_become_values_within_their_range_or_none(bank):
    instance = active(bank, MOVED)
    volume, strokes = (instance.parameters[name] for name in ("volume", "strokes of strums"))
    assert [instance.text(strokes.id, value) for value in range(3)] == ["down", "up", "both"]
    assert [instance.number(volume.id, text) for text in (b"nan", b"", b"loud", b"\xff\xfe")] == [None] * 4
    assert [instance.number(volume.id, text) for text in (b"-1e400 dB", b"inf")] == [volume.low, volume.high]


def test_expressions_of_notes_are_what_bend_and_slide_of_a_member_are(bank):
    def in_host(timed: pieces.Timed, *more: Event) -> Sound:
        return played(active(bank, pieces.MEMBERS), timed, more=more, seconds=0.8)

    instrument, bends = instrument_of(pieces.MEMBERS), [(0.1, Bend(0.0625, 1)), (0.3, Bend(0.0, 1))]
    expressed = [
        host.brighten(0, 57 / 127, 1),
        note_on(480, 52, 100, 1, note_id=5),
        host.tune(4_800, 3.0, note_id=5),  # a sixteenth of a member's 48 semitones
        host.tune(14_400, 0.0, note_id=5),
    ]
    slid = [(0.0, ControlChange(pieces.SLIDE, 57, 1)), (0.01, NoteOn(52, 100, 1)), *bends]
    check_alike(in_host([], *expressed), rendered(instrument, slid, seconds=0.8))
    pressed = midi(9_000, 0xD1, 100, 0), midi(9_100, 0xA1, 52, 100)  # changes nothing
    assert np.array_equal(in_host(piece(instrument), *pressed), in_host(piece(instrument)))


def test_blocks_of_any_size_and_neighbours_change_nothing(bank):
    music, neighbour = piece(instrument_of("cimbalom")), active(bank, "concert_harp")
    whole = played(active(bank, "cimbalom"), music)
    sound = played(active(bank, "cimbalom"), music, block=1, seconds=0.1)  # a block is a call from Python
    assert np.array_equal(sound, whole[: len(sound)])
    for block in (17, 4096):
        neighbour.block(480, [note_on(0, 60, 100)])
        assert np.array_equal(played(active(bank, "cimbalom"), music, block=block), whole)


# State and presets


def test_the_browser_of_presets_lists_each_instrument_and_nothing_else(bank):
    assert host.presets(bank) == [*zip((instrument_of(name).name for name in NAMES), bank.plugins, strict=True)]
    assert host.presets(bank, host.IN_FILE) == []
    assert not bank.entry.get_factory(b"unknown")


@pytest.mark.parametrize("playing", [False, True])
def test_a_preset_brings_back_the_instrument_as_it_was_and_that_of_another_is_refused(bank, playing):
    music, fresh, instance = piece(instrument_of(MOVED)), active(bank, MOVED), active(bank, MOVED)
    own, foreign = (bank.id_of(instrument_of(name).name) for name in (MOVED, "timpani"))
    state, sound = fresh.save(), played(fresh, music)
    instance.render(24_000, [param(0, each.id, each.high) for each in fresh.parameters.values()])
    moved = instance.save()
    for key, kind in ((foreign, host.IN_PLUGIN), (None, host.IN_PLUGIN), ("", host.IN_PLUGIN), (own, host.IN_FILE)):
        assert not instance.load_preset(key, kind)
    assert instance.errors == [b"the preset belongs to another instrument"] * 4
    assert (instance.save(), instance.rescans, instance.loaded) == (moved, [], [])
    if not playing:
        instance.deactivate()
    assert instance.load_preset(own)
    assert instance.save() == state != moved
    assert instance.rescans == [1]  # of values
    assert instance.loaded == [(host.IN_PLUGIN, None, own.encode())]
    if playing:  # knobs glide, the room follows
        instance.render(96_000, [])
    else:
        instance.activate(RATE_HZ)
    assert difference_db(played(instance, music), sound) < (-80 if playing else -400)
    instance.offers.clear()  # as a host that has no extensions
    assert instance.load_preset(own) and not instance.load_preset(foreign)


# Notes, resets and other calls of a host


def test_latency_tail_and_ends_of_notes_are_reported(bank):
    harp = active(bank, "concert_harp", 96_000)
    assert harp.latency == 96
    tail = harp.extension("clap.tail", host.clap.Frames).get(harp.at)
    assert tail / 96_000 > instrument_of("concert_harp").room.t60_s
    instance = active(bank, "electric_bass")
    instance.block(4_096, [note_on(0, 40, 100, note_id=7)])
    instance.render(300_000, [note_off(0, 40)], 1_024)
    assert instance.ended == [7]
    assert instance.status == 4  # it may sleep


@pytest.fixture
def ringing(bank: Library) -> Callable[..., float]:
    """The level of the end of a second, in which events were sent to a bass."""

    def level(*events: Event) -> float:
        return float(np.abs(active(bank, "electric_bass").render(RATE_HZ, events)[-4_800:]).max())

    return level


def test_a_choked_note_is_silent_at_once_and_others_ring_on(ringing):
    both = note_on(0, 40, 120, note_id=1), note_on(0, 47, 120, note_id=2)
    rest, one = ringing(*both), ringing(*both, choke(4_800, note_id=1))
    assert ringing(*both, choke(4_800, note_id=1), choke(4_800, key=47)) < 0.01 * rest
    assert 0.05 * rest < one < 0.99 * rest
    assert ringing(*both, choke(4_800)) < 0.01 * rest


def test_a_release_belongs_to_the_stroke_before_it(ringing):
    struck = note_on(0, 40, 120), note_on(4_800, 40, 120)
    held = ringing(*struck)
    assert ringing(*struck, note_off(4_900, 40)) == held  # of the first stroke
    assert ringing(*struck, note_off(4_900, 40), note_off(6_000, 40)) < 0.01 * held


@pytest.mark.parametrize("name", NAMES)
def test_after_a_reset_it_is_as_a_new_one(bank, name):
    instrument = instrument_of(name)
    instance, fresh = active(bank, name), active(bank, name)
    pedals = [midi(0, 0xE0, 0, 100), midi(0, 0xB0, 1, 90), midi(0, 0xB0, 64, 127), midi(0, 0xB1, 101, 0)]
    notes = (note_on(10 + 900 * each, pieces.lowest(instrument) + 2 * each, 90 + 4 * each) for each in range(9))
    events = [*pedals, *notes]
    instance.render(9_000, events)
    instance.reset()
    silence = instance.render(24_000, [])
    assert np.array_equal(silence, fresh.render(24_000, []))
    assert not silence.any() or (instrument.amp.drive_db > 0 and np.abs(silence).max() < 1e-15)  # as when new
    instance.render(9_000, events)
    names = {"volume", "decay", "modulus", "pluck position", "release", "body mix", "room", "amplifier drive"}
    for moved in (each for shown, each in instance.parameters.items() if shown in names):
        instance.block(1, [param(0, moved.id, moved.low + 0.3 * (moved.high - moved.low))])
    state = instance.save()
    fresh.deactivate()
    assert fresh.load(state)
    fresh.activate(RATE_HZ)
    instance.reset()
    assert instance.save() == state
    wanted = played(fresh, piece(instrument))
    assert np.abs(wanted).max() > 1e-3
    assert np.array_equal(played(instance, piece(instrument)), wanted)


@pytest.fixture(scope="module")
def attack(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A host in C that sends random events and counts allocations meanwhile, compiled."""
    if not sys.platform.startswith("linux"):
        pytest.skip("counts allocations as GNU libc has them")
    path = tmp_path_factory.mktemp("attack") / "attack"
    headers = Path(build.__file__).parent / "shell"
    command = [sys.executable, "-m", "ziglang", "cc", "-O2", "-std=gnu23", "-rdynamic", f"-I{headers}", "-o", path]
    subprocess.run([*command, Path(__file__).with_name("attack.c"), "-ldl", "-lm"], check=True)
    return path


@pytest.mark.parametrize("name", (MOVED, "fretless_bass", *(("concert_harp", "timpani") if pieces.LONG else ())))
def test_nothing_random_does_harm_or_allocates(built, attack, bank, name):
    seconds = 600 if pieces.LONG else 8  # of sound
    command = [attack, built("clap"), bank.id_of(instrument_of(name).name), str(seconds), "3"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found.pop("seconds") >= seconds
    assert found.pop("blocks") > seconds
    assert 0.1 < found.pop("peak") <= 1.0
    assert found == {"wild": 0, "refused": 0, "allocations": 0}
