"""VST3 and LV2 in hosts of their own: they play what the CLAP plug-in plays, and keep to their interfaces."""

import struct
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from app.export.plugin.image import Image
from app.shared.parameters import OF_CHOICES
from engine.parameters import OF_INSTRUMENTS
from tests.app.export.plugin import host, lv2_host, vst3_host
from tests.app.export.plugin.abi import Sound
from tests.app.export.plugin.pieces import RATE_HZ, active, difference_db, instrument_of, piece, played

BASS = "electric_bass"
STRUCK = (0, bytes((0x90, 40, 100)))
NOT_FINITE = (np.nan, np.inf, -np.inf)
IMPOSSIBLE_HZ = (0.0, -1.0, -48_000.0, *NOT_FINITE, 1e-300, 1e300, 999.0, 1_000_001.0)


Built = Callable[[str], Path]
Lv2 = Callable[..., lv2_host.Instance]


@pytest.fixture(scope="module")
def vst3(built: Built) -> vst3_host.Library:
    inside = [each for each in built("vst3").rglob("*") if each.is_file()]
    assert [str(each.relative_to(built("vst3"))) for each in inside] == ["Contents/x86_64-linux/a bank.so"]
    return vst3_host.Library(inside[0])


@pytest.fixture
def lv2(built: Built, images: dict[str, Image]) -> Iterator[Lv2]:
    """Make an instance of a name, which is destroyed after the test."""
    made: list[lv2_host.Instance] = []

    def make(name: str, rate_hz: float = RATE_HZ, active: bool = True) -> lv2_host.Instance:
        made.append(lv2_host.Instance(built("lv2"), images[name].id, images[name].parameters, rate_hz))
        if active:
            made[-1].activate()
        return made[-1]

    yield make
    for each in made:
        each.destroy()


@pytest.mark.parametrize("name", ("classical_guitar", "fretless_bass", "timpani"))
def test_all_formats_play_the_same(bank, vst3, lv2, name):
    music, instance = piece(instrument_of(name)), active(vst3, name)
    wanted = played(active(bank, name), music)
    assert np.array_equal(played(instance, music, block=480), wanted)
    instance.destroy()
    for block in (17, 4_096):
        assert np.array_equal(played(lv2(name), music, block=block), wanted)


def test_impossible_rates_and_blocks_are_refused_and_unusual_ones_sound(bank, vst3, lv2):
    other, instance = bank.create_named(instrument_of(BASS).name), vst3.create_named(instrument_of(BASS).name)
    for rate_hz in IMPOSSIBLE_HZ:
        assert not other.accepts(rate_hz) and not instance.accepts(rate_hz)
        with pytest.raises(lv2_host.Refused):
            lv2(BASS, rate_hz)
    assert not any(other.accepts(RATE_HZ, most) for most in (0, 2**31, 2**32 - 1))
    assert not any(instance.accepts(RATE_HZ, most) for most in (0, -1, -(2**31)))
    other.activate(RATE_HZ, 2**31 - 1)
    instance.activate(RATE_HZ)
    for each in (other, instance, *(lv2(BASS, rate_hz) for rate_hz in (1_000.0, 11_025.5, 384_000.0))):
        sound = each.render(4_096, [STRUCK])
        assert np.isfinite(sound).all() and np.abs(sound).max() > 1e-4
    instance.destroy()


def test_values_without_a_finite_number_are_ignored(bank, vst3, lv2):
    plain, other, instance = active(bank, BASS), active(bank, BASS), active(vst3, BASS)
    wanted, bad = (
        plain.render(4_096, [STRUCK]),
        [host.param(0, id, value) for id in other.ids for value in NOT_FINITE],
    )
    bad += [each for value in NOT_FINITE for each in (host.note_on(0, 45, value), host.tune(0, value, -1))]
    assert np.array_equal(other.render(4_096, [STRUCK, *bad]), wanted)
    assert other.save() == plain.save()

    ids, state = [each.id for each in instance.parameters.values()], instance.save()
    assert not any(instance.set_value(id, value) for id in ids for value in NOT_FINITE)
    changes = [(0, (id, value)) for value in NOT_FINITE for id in ids]
    assert np.array_equal(instance.render(4_096, [STRUCK, (0, vst3_host.note_on(45, np.nan)), *changes]), wanted)
    assert instance.save() == state
    instance.destroy()

    ports, music = lv2(BASS), piece(instrument_of(BASS))
    whole, standard = played(lv2(BASS), music), ports.values.copy()
    ports.values[:] = np.nan  # before the first block
    assert np.array_equal(played(ports, music), whole)
    for value in NOT_FINITE:
        ports.values[:] = value
        ports.block(64, [])
    ports.values[:] = standard
    ports.activate_again()
    assert np.array_equal(played(ports, music), whole)


# LV2: ports, and a state beside them

MACRO, SAVED = "macros.0", "classical_guitar"


@pytest.fixture
def moved(lv2: Lv2) -> lv2_host.Instance:
    """A macro is moved, then a parameter that it moves: ports alone do not say which was last."""
    instance, target = lv2(SAVED), instrument_of(SAVED).macros[0].targets[0].field
    for id, share in ((target, 0.7), (MACRO, 0.9), (target, 0.2), (MACRO, 0.1)):
        low, high = instance.controls[id].low, instance.controls[id].high
        instance.move(id, low + share * (high - low))
    return instance


ORDERS = (
    ("restore", "activate", "set"),
    ("set", "activate", "restore"),
    ("activate", "run", "restore", "run", "set", "run", "activate again"),  # of the ports, only after it
)


def test_a_song_comes_back_as_it_was_saved_in_any_order(lv2, moved):
    state, values, music = moved.save(), moved.values.copy(), piece(instrument_of(SAVED))
    moved.activate_again()  # as for another size of blocks
    wanted = played(moved, music, block=256)
    assert difference_db(played(lv2(SAVED), music), wanted) > -60  # the moved values are heard
    for order in ORDERS:
        again = lv2(SAVED, active=False)
        steps = {
            "restore": partial(again.restore, state),
            "activate": again.activate,
            "activate again": again.activate_again,
            "set": partial(np.copyto, again.values, values),
            "run": partial(again.block, 64, []),
        }
        for step in order:
            steps[step]()
        assert np.array_equal(played(again, music, block=1_000), wanted)
        assert again.save() == state


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


def test_damaged_states_are_refused_and_change_nothing(bank, vst3, moved):
    draw, state = np.random.default_rng(4), moved.save()
    for _ in range(100):
        key = str(draw.choice(sorted(state)))
        rest = {name: value for name, value in state.items() if name != key}
        for bad in ({**rest, key: damaged(state[key], draw)}, {**rest, key: state[key] + b"\0" * 100_000}, rest):
            assert not moved.restore(bad)
        assert moved.save() == state
    assert not moved.restore(state, kind="http://lv2plug.in/ns/ext/atom#String")
    assert moved.restore(state) and moved.save() == state

    other, instance = active(bank, SAVED), active(vst3, SAVED)
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


def share_of(name: str, shown: host.clap.ParamInfo, value: float) -> float:
    """The place of a knob in a VST3 host: that of the window's."""
    known = {each.name: each for each in (*OF_INSTRUMENTS.values(), OF_CHOICES["volume_db"])}
    return known[name].share(value) if name in known else (value - shown.low) / (shown.high - shown.low)


def test_parameters_are_the_clap_plug_in_s_and_macros_move_them(vst3, bank):
    instrument, other, instance = instrument_of(SAVED), active(bank, SAVED), active(vst3, SAVED)
    shown, wanted = instance.parameters, other.parameters

    def check_values() -> None:
        for name, each in wanted.items():
            assert shown[name].id == each.id
            assert instance.value(each.id) == pytest.approx(share_of(name, each, other.value(each.id)), abs=1e-9)

    check_values()
    assert instance.shown(shown["Source"].id, 0.5) == "truth"
    hidden = [each for name, each in shown.items() if name not in wanted]
    assert len({each.id for each in shown.values()}) == len(shown)
    assert hidden and all(each.flags & 16 for each in hidden)
    macro = instrument.macros[0].name
    instance.block(64, [(0, (shown[macro].id, 1.0))])
    assert instance.moved  # the host is given the others that have moved
    other.block(64, [host.param(0, wanted[macro].id, 1.0)])
    check_values()
    state, again = instance.save(), vst3.create_named(instrument.name)
    assert state == other.save()
    assert again.load(state)
    assert again.save() == state
    assert [again.value(each.id) for each in wanted.values()] == [instance.value(each.id) for each in wanted.values()]
    again.activate(RATE_HZ)
    for each in (instance, again):
        each.destroy()


def test_a_note_expression_tunes_one_note(vst3):
    def sound(*notes: vst3_host.vst3.Event) -> Sound:
        return active(vst3, "jazz_guitar").block(4_000, [(0, note) for note in notes])

    low, high = vst3_host.note_on(45, 100, id=1), vst3_host.note_on(57, 100, id=2)
    both = sound(low, high, vst3_host.tuned(2, 1.0))
    assert difference_db(both, sound(low, high)) > -30
    assert difference_db(both, sound(low, vst3_host.note_on(57, 100, id=2, cents=100.0))) < -140
