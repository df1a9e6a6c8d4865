"""VST3 and LV2 in hosts of their own: they play what the CLAP plug-in plays, and keep to their interfaces."""

from __future__ import annotations

import json
import os
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from app.export.plugin.build import build_plugin
from app.export.plugin.formats import this_target
from app.export.plugin.image import Image
from app.player.events import Bend, NoteOff, NoteOn
from app.shared.parameters import OF_CHOICES, OF_INSTRUMENTS
from tests.app.export.plugin import host, lv2_host, vst3_host
from tests.app.export.plugin.pieces import SECONDS, difference_db, instrument_of, midi_bytes, piece, played

RATE_HZ = 48_000
BEND = 129
NOT_FINITE = (np.nan, np.inf, -np.inf)
IMPOSSIBLE_HZ = (0.0, -1.0, -48_000.0, *NOT_FINITE, 1e-300, 1e300, 999.0, 1_000_001.0)
Sound = NDArray[np.float32]

pytestmark = pytest.mark.skipif(find_spec("ziglang") is None, reason="needs ziglang, the extra [plugin]")


@pytest.fixture(scope="module")
def vst3_bundle(images: list[Image], objects: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_plugin(images, "vst3", this_target(), tmp_path_factory.mktemp("vst3") / "bank", objects)


@pytest.fixture(scope="module")
def vst3(vst3_bundle: Path) -> vst3_host.Library:
    inside = [each for each in vst3_bundle.rglob("*") if each.is_file()]
    assert [str(each.relative_to(vst3_bundle)) for each in inside] == ["Contents/x86_64-linux/bank.so"]
    return vst3_host.Library(inside[0])


Lv2 = Callable[..., lv2_host.Instance]


@pytest.fixture(scope="module")
def lv2_bundle(images: list[Image], objects: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_plugin(images, "lv2", this_target(), tmp_path_factory.mktemp("lv2") / "a bank", objects)


@pytest.fixture
def lv2(lv2_bundle: Path, images: list[Image]) -> Iterator[Lv2]:
    """Make an instance of a name, which is destroyed after the test."""
    made: list[lv2_host.Instance] = []

    def make(name: str, rate_hz: float = RATE_HZ, active: bool = True) -> lv2_host.Instance:
        image = image_of(images, name)
        made.append(lv2_host.Instance(lv2_bundle, image.id, image.parameters, rate_hz, active))
        return made[-1]

    yield make
    for each in made:
        each.destroy()


def image_of(images: list[Image], name: str) -> Image:
    return next(each for each in images if each.name == instrument_of(name).name)


def active(library: vst3_host.Library, name: str, rate_hz: int = RATE_HZ) -> vst3_host.Instance:
    instance = library.create(instrument_of(name).name)
    instance.activate(rate_hz)
    return instance


def by_clap(bank: host.Library, name: str) -> Sound:
    instance = bank.create_named(instrument_of(name).name)
    instance.activate(RATE_HZ)
    return played(instance, instrument_of(name), RATE_HZ)


def by_lv2(instance: lv2_host.Instance, name: str, block: int = 512) -> Sound:
    messages = [(round(time_s * RATE_HZ), bytes(midi_bytes(event))) for time_s, event in piece(instrument_of(name))]
    return instance.render(round(SECONDS * RATE_HZ), messages, block)


def by_vst3(instance: vst3_host.Instance, name: str, block: int = 480) -> Sound:
    events, changes = [], []
    for time_s, event in piece(instrument_of(name)):
        frame = round(time_s * RATE_HZ)
        if isinstance(event, NoteOn):
            events.append((frame, vst3_host.note_on(event.key, event.velocity, event.channel)))
        elif isinstance(event, NoteOff):
            events.append((frame, vst3_host.note_off(event.key, event.channel)))
        elif isinstance(event, Bend):
            _, low, high = midi_bytes(event)
            changes.append((frame, instance.assigned(event.channel, BEND) or 0, (low + 128 * high) / 16383))
        else:
            changes.append((frame, instance.assigned(event.channel, event.number) or 0, event.value / 127))
    found, total = [], round(SECONDS * RATE_HZ) + instance.latency
    while instance.frame < total:
        first, count = instance.frame, min(block, total - instance.frame)
        due, moved = ([each for each in all_ if first <= each[0] < first + count] for all_ in (events, changes))
        found.append(instance.block(count, due, moved))
    return np.concatenate(found)[instance.latency :]


@pytest.mark.parametrize("name", ("classical_guitar", "fretless_bass", "timpani"))
def test_all_formats_play_the_same(bank: host.Library, vst3: vst3_host.Library, lv2: Lv2, name: str) -> None:
    wanted, instance = by_clap(bank, name), active(vst3, name)
    assert np.array_equal(by_vst3(instance, name), wanted)
    instance.destroy()
    for block in (17, 4_096):
        assert np.array_equal(by_lv2(lv2(name), name, block), wanted)


def test_impossible_rates_and_blocks_are_refused_and_unusual_ones_sound(
    bank: host.Library, vst3: vst3_host.Library, lv2: Lv2
) -> None:
    name = "electric_bass"
    other, instance = bank.create_named(instrument_of(name).name), vst3.create(instrument_of(name).name)
    for rate_hz in IMPOSSIBLE_HZ:
        assert not other.accepts(rate_hz, 4_096) and not instance.accepts(rate_hz)
        with pytest.raises(lv2_host.Refused):
            lv2(name, rate_hz)
    assert not any(other.accepts(RATE_HZ, most) for most in (0, 2**31, 2**32 - 1))
    assert not any(instance.accepts(RATE_HZ, most) for most in (0, -1, -(2**31)))
    other.activate(RATE_HZ, 2**31 - 1)
    instance.activate(RATE_HZ)
    sounds = [other.render(4_096, [host.note_on(0, 40, 100)])]
    sounds.append(instance.block(4_096, [(0, vst3_host.note_on(40, 100))]))
    sounds += [
        lv2(name, rate).render(4_096, [(0, bytes((0x90, 40, 100)))]) for rate in (1_000.0, 11_025.5, 384_000.0)
    ]
    assert all(np.isfinite(sound).all() and np.abs(sound).max() > 1e-4 for sound in sounds)
    instance.destroy()


def test_values_without_a_finite_number_are_ignored(bank: host.Library, vst3: vst3_host.Library, lv2: Lv2) -> None:
    name = "electric_bass"
    plain, other = (bank.create_named(instrument_of(name).name) for _ in range(2))
    for each in (plain, other):
        each.activate(RATE_HZ)
    struck = host.note_on(0, 40, 100)
    bad = [host.param(0, id, value) for id in other.ids for value in NOT_FINITE]
    bad += [each for value in NOT_FINITE for each in (host.note_on(0, 45, value), host.tune(0, value, -1))]
    wanted = plain.render(4_096, [struck])
    assert np.array_equal(other.render(4_096, [struck, *bad]), wanted)
    assert other.save() == plain.save()

    instance = active(vst3, name)
    ids = [each.id for each in instance.parameters.values()]
    state = instance.save()
    assert not any(instance.set_value(id, value) for id in ids for value in NOT_FINITE)
    changes = [(0, id, value) for value in NOT_FINITE for id in ids]
    notes = [(0, vst3_host.note_on(40, 100)), (0, vst3_host.note_on(45, float("nan")))]
    assert np.array_equal(instance.block(4_096, notes, changes), wanted)
    assert instance.save() == state
    instance.destroy()

    ports, whole = lv2(name), by_lv2(lv2(name), name)
    standard = ports.values.copy()
    ports.values[:] = np.nan  # before the first block
    assert np.array_equal(by_lv2(ports, name), whole)
    for value in NOT_FINITE:
        ports.values[:] = value
        ports.render(64, [])
    ports.values[:] = standard
    ports.activate_again()
    assert np.array_equal(by_lv2(ports, name), whole)


# LV2: ports, and a state beside them

MACRO, SAVED = "macros.0", "classical_guitar"


def place_of(images: list[Image], name: str, id: str) -> int:
    """The place of a parameter among the control ports."""
    return [each.id for each in image_of(images, name).parameters].index(id)


def test_ports_that_return_to_their_defaults_while_it_is_inactive_count(lv2: Lv2, images: list[Image]) -> None:
    name = "electric_bass"
    wanted, instance = by_lv2(lv2(name), name), lv2(name)
    standard = instance.values.copy()
    instance.values[place_of(images, name, "volume_db")] = -24.0
    instance.activate_again()
    assert difference_db(by_lv2(instance, name), wanted) > -10
    instance.values[:] = standard
    instance.activate_again()
    assert np.array_equal(by_lv2(instance, name), wanted)


@pytest.fixture
def moved(lv2: Lv2, images: list[Image]) -> lv2_host.Instance:
    """A macro is moved, then a parameter that it moves: ports alone do not say which was last."""
    instance = lv2(SAVED)
    macro = place_of(images, SAVED, MACRO)
    target = place_of(images, SAVED, instrument_of(SAVED).macros[0].targets[0].field)
    for place, share in ((target, 0.7), (macro, 0.9), (target, 0.2), (macro, 0.1)):
        each = image_of(images, SAVED).parameters[place]
        instance.values[place] = each.low + share * (each.high - each.low)
        instance.render(64, [])
    return instance


def restore_first(instance: lv2_host.Instance, state: lv2_host.State, values: Sound) -> None:
    assert instance.restore(state)
    instance.activate()
    instance.values[:] = values


def restore_last(instance: lv2_host.Instance, state: lv2_host.State, values: Sound) -> None:
    instance.values[:] = values
    instance.activate()
    assert instance.restore(state)


def restore_while_it_runs(instance: lv2_host.Instance, state: lv2_host.State, values: Sound) -> None:
    instance.activate()
    instance.render(64, [])
    assert instance.restore(state)
    instance.render(64, [])  # of the ports, only after it
    instance.values[:] = values
    instance.render(64, [])
    instance.activate_again()


def test_a_song_comes_back_as_it_was_saved_in_any_order(lv2: Lv2, moved: lv2_host.Instance) -> None:
    state, values = moved.save(), moved.values.copy()
    moved.activate_again()  # as for another size of blocks
    wanted = by_lv2(moved, SAVED, 256)
    assert difference_db(by_lv2(lv2(SAVED), SAVED), wanted) > -60  # the moved values are heard
    for order in (restore_first, restore_last, restore_while_it_runs):
        again = lv2(SAVED, active=False)
        order(again, state, values)
        assert np.array_equal(by_lv2(again, SAVED, 1_000), wanted)
        assert again.save() == state


def test_a_port_that_moves_after_a_restored_state_counts(
    lv2: Lv2, images: list[Image], moved: lv2_host.Instance
) -> None:
    again, macro = lv2(SAVED, active=False), place_of(images, SAVED, MACRO)
    restore_first(again, moved.save(), moved.values.copy())
    again.render(64, [])
    for instance in (moved, again):
        for value in (0.6, float(moved.values[macro])):  # away, and back to where it was saved
            instance.values[macro] = value
            instance.render(64, [])
        instance.activate_again()
    assert again.save() == moved.save()
    assert np.array_equal(by_lv2(again, SAVED), by_lv2(moved, SAVED))


def damaged(whole: bytes, draw: np.random.Generator) -> bytes:
    """A state that is cut, grown, of another version, without end or without a finite number."""
    place = 12 + 12 * int(draw.integers((len(whole) - 8) // 12))
    bad = struct.pack("<d", float(draw.choice(NOT_FINITE)))
    count = struct.pack("<i", int(draw.choice([-1, 2**31 - 1, 4_096, -(2**31)])))
    changed = (
        whole[: draw.integers(len(whole))],
        b"\x07" + whole[1:],
        whole[:4] + count + whole[8:],
        whole[:place] + bad + whole[place + 8 :],
        b"",
    )
    return changed[draw.integers(len(changed))]


def test_damaged_states_are_refused_and_change_nothing(
    bank: host.Library, vst3: vst3_host.Library, moved: lv2_host.Instance
) -> None:
    draw, state = np.random.default_rng(4), moved.save()
    for _ in range(100):
        key = str(draw.choice(sorted(state)))
        rest = {name: value for name, value in state.items() if name != key}
        for bad in ({**rest, key: damaged(state[key], draw)}, {**rest, key: state[key] + b"\0" * 100_000}, rest):
            assert not moved.restore(bad)
        assert moved.save() == state
    assert not moved.restore(state, kind="http://lv2plug.in/ns/ext/atom#String")
    assert moved.restore(state) and moved.save() == state

    other, instance = bank.create_named(instrument_of(SAVED).name), active(vst3, SAVED)
    other.activate(RATE_HZ)
    other.render(64, [host.param(0, id, 0.3) for id in other.ids])
    whole = other.save()
    assert instance.load(whole) and instance.save() == whole
    for _ in range(100):
        bad_bytes = damaged(whole, draw)
        for each in (other, instance):
            assert not each.load(bad_bytes)
            assert each.save() == whole
    instance.destroy()


# VST3: parameters of the controller, and note expressions


def share_of(name: str, shown: host.ParamInfo, value: float) -> float:
    """The place of a knob in a VST3 host: that of the window's."""
    known = {each.name: each for each in (*OF_INSTRUMENTS.values(), OF_CHOICES["volume_db"])}
    return known[name].share(value) if name in known else (value - shown.low) / (shown.high - shown.low)


def test_parameters_are_the_clap_plug_in_s_and_macros_move_them(vst3: vst3_host.Library, bank: host.Library) -> None:
    instrument = instrument_of("classical_guitar")
    other, instance = bank.create_named(instrument.name), active(vst3, "classical_guitar")
    shown, wanted = instance.parameters, other.parameters
    for name, each in wanted.items():
        assert shown[name].id == each.id
        assert instance.value(each.id) == pytest.approx(share_of(name, each, each.standard))
    assert instance.shown(shown["Source"].id, 0.5) == "truth"
    hidden = [each for name, each in shown.items() if name not in wanted]
    assert len({each.id for each in shown.values()}) == len(shown)
    assert hidden and all(each.flags & 16 for each in hidden)
    macro = instrument.macros[0].name
    instance.block(64, [], [(0, shown[macro].id, 1.0)])
    assert instance.moved  # the host is given the others that have moved
    other.activate(RATE_HZ)
    other.block(64, [host.param(0, wanted[macro].id, 1.0)])
    for name, each in wanted.items():
        assert instance.value(each.id) == pytest.approx(share_of(name, each, other.value(each.id)), abs=1e-9)
    state, again = instance.save(), vst3.create(instrument.name)
    assert state == other.save()
    assert again.load(state)
    assert again.save() == state
    assert [again.value(each.id) for each in wanted.values()] == [instance.value(each.id) for each in wanted.values()]
    again.activate(RATE_HZ)
    for each in (instance, again):
        each.destroy()


def test_a_note_expression_tunes_one_note(vst3: vst3_host.Library) -> None:
    def sound(*notes: vst3_host.Event) -> Sound:
        return active(vst3, "jazz_guitar").block(4_000, [(0, note) for note in notes])

    low, high = vst3_host.note_on(45, 100, id=1), vst3_host.note_on(57, 100, id=2)
    both = sound(low, high, vst3_host.tuned(2, 1.0))
    assert difference_db(both, sound(low, high)) > -30
    assert difference_db(both, sound(low, vst3_host.note_on(57, 100, id=2, cents=100.0))) < -140


PEDALBOARD = """
import json, sys
import numpy as np
from pedalboard import load_plugin
path, name, out, wanted = sys.argv[1:]
plugin = load_plugin(path, plugin_name=name)
messages = [(bytes(data), time_s) for data, time_s in json.loads(wanted)]
np.save(out, np.asarray(plugin(messages, duration=1.6, sample_rate=48_000, num_channels=2, buffer_size=480)).T)
"""


def test_pedalboard_plays_it(vst3_bundle: Path, bank: host.Library, tmp_path: Path) -> None:
    python = os.environ.get("PEDALBOARD_PYTHON") or (sys.executable if find_spec("pedalboard") else "")
    if not python:
        pytest.skip("needs pedalboard; PEDALBOARD_PYTHON may be a Python that has it")
    events = json.dumps([(midi_bytes(event), time_s) for time_s, event in piece(instrument_of(SAVED))])
    words = [str(vst3_bundle), instrument_of(SAVED).name, str(tmp_path / "sound.npy"), events]
    done = subprocess.run([python, "-c", PEDALBOARD, *words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-600:]
    sound, wanted = np.load(tmp_path / "sound.npy"), by_clap(bank, SAVED)
    count = min(len(sound), len(wanted))
    assert count > RATE_HZ
    latest = min(difference_db(sound[skip:][:count], wanted[: len(sound[skip:][:count])]) for skip in (0, 64, 96))
    assert latest < -120
