"""The LV2 plug-in in a host: it plays what the CLAP plug-in plays, and its ports say how it sounds."""

from __future__ import annotations

import struct
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from app.export.plugin.build import build_plugin
from app.export.plugin.formats import this_target
from app.export.plugin.image import Image
from app.instrument.events import Bend, Controller, NoteOff, NoteOn
from tests.app.export.plugin import host
from tests.app.export.plugin.lv2_host import Instance, Refused, State
from tests.app.export.plugin.pieces import SECONDS, difference_db, patch_of, piece, played

RATE_HZ = 48_000

pytestmark = pytest.mark.skipif(find_spec("ziglang") is None, reason="needs ziglang, the extra [plugin]")


@pytest.fixture(scope="module")
def bundle(images: list[Image], objects: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_plugin(images, "lv2", this_target(), tmp_path_factory.mktemp("lv2") / "a bank", objects)


def image_named(images: list[Image], name: str) -> Image:
    (image,) = (each for each in images if each.name == patch_of(name).name)
    return image


def instance_of(bundle: Path, images: list[Image], name: str, active: bool = True) -> Instance:
    image = image_named(images, name)
    return Instance(bundle, image.id, image.parameters, RATE_HZ, active)


def place_of(images: list[Image], name: str, id: str) -> int:
    """Of a parameter, among the control ports."""
    (place,) = (n for n, each in enumerate(image_named(images, name).parameters) if each.id == id)
    return place


def bytes_of(event: NoteOn | NoteOff | Bend | Controller) -> bytes:
    if isinstance(event, NoteOn):
        return bytes((0x90 | event.channel, event.key, event.velocity))
    if isinstance(event, NoteOff):
        return bytes((0x80 | event.channel, event.key, 0))
    if isinstance(event, Bend):
        wheel = 8192 + round(event.value * (8191 if event.value > 0 else 8192))
        return bytes((0xE0 | event.channel, wheel & 127, wheel >> 7))
    return bytes((0xB0 | event.channel, event.number, event.value))


def sound_of(instance: Instance, name: str, block: int = 512) -> NDArray[np.float32]:
    messages = [(round(time_s * RATE_HZ), bytes_of(event)) for time_s, event in piece(patch_of(name))]
    return instance.render(round(SECONDS * RATE_HZ), messages, block)


@pytest.mark.parametrize("name", ("classical_guitar", "sitar", "timpani"))
def test_it_plays_as_the_clap_plug_in(bundle: Path, images: list[Image], bank: host.Library, name: str) -> None:
    other = bank.create(next(id for id, shown in bank.plugins.items() if shown == patch_of(name).name))
    other.activate(RATE_HZ)
    wanted = played(other, patch_of(name), RATE_HZ)
    for block in (17, 1_000, 4_096):
        instance = instance_of(bundle, images, name)
        assert np.array_equal(sound_of(instance, name, block), wanted)
        instance.destroy()


def test_ports_that_return_to_their_defaults_while_it_is_inactive_count(bundle: Path, images: list[Image]) -> None:
    name = "electric_bass"
    plain, instance = instance_of(bundle, images, name), instance_of(bundle, images, name)
    wanted, standard = sound_of(plain, name), instance.values.copy()
    volume = place_of(images, name, "volume_db")
    instance.values[volume] = -24.0
    instance.activate_again()
    assert difference_db(sound_of(instance, name), wanted) > -10
    instance.values[:] = standard
    instance.activate_again()
    assert np.array_equal(sound_of(instance, name), wanted)
    for each in (plain, instance):
        each.destroy()


MACRO = "macros.0"
SAVED = "classical_guitar"


def moved_by_hand(bundle: Path, images: list[Image]) -> Instance:
    """A macro is moved, then a parameter that it moves: ports alone do not say which was last."""
    instance = instance_of(bundle, images, SAVED)
    macro = place_of(images, SAVED, MACRO)
    target = place_of(images, SAVED, patch_of(SAVED).macros[0].targets[0].field)
    for place, share in ((target, 0.7), (macro, 0.9), (target, 0.2), (macro, 0.1)):
        each = image_named(images, SAVED).parameters[place]
        instance.values[place] = each.low + share * (each.high - each.low)
        instance.render(64, [])
    return instance


def restore_first(instance: Instance, state: State, values: NDArray[np.float32]) -> None:
    assert instance.restore(state)
    instance.activate()
    instance.values[:] = values


def restore_last(instance: Instance, state: State, values: NDArray[np.float32]) -> None:
    instance.values[:] = values
    instance.activate()
    assert instance.restore(state)


def restore_while_it_runs(instance: Instance, state: State, values: NDArray[np.float32]) -> None:
    instance.activate()
    instance.render(64, [])
    assert instance.restore(state)
    instance.render(64, [])  # of the ports, only after it
    instance.values[:] = values
    instance.render(64, [])
    instance.activate_again()


@pytest.mark.parametrize("order", (restore_first, restore_last, restore_while_it_runs))
def test_a_song_comes_back_as_it_was_saved(
    bundle: Path, images: list[Image], order: Callable[[Instance, State, NDArray[np.float32]], None]
) -> None:
    live, fresh = moved_by_hand(bundle, images), instance_of(bundle, images, SAVED)
    state, values = live.save(), live.values.copy()
    live.activate_again()  # as for another size of blocks
    wanted = sound_of(live, SAVED, 256)
    assert difference_db(sound_of(fresh, SAVED), wanted) > -60  # what was moved is heard
    again = instance_of(bundle, images, SAVED, active=False)
    order(again, state, values)
    assert np.array_equal(sound_of(again, SAVED, 1_000), wanted)
    assert again.save() == state
    again.activate_again()
    assert np.array_equal(sound_of(again, SAVED, 64), wanted)
    for each in (live, fresh, again):
        each.destroy()


def test_a_port_that_moves_after_a_restored_state_counts(bundle: Path, images: list[Image]) -> None:
    live, again = moved_by_hand(bundle, images), instance_of(bundle, images, SAVED, active=False)
    restore_first(again, live.save(), live.values.copy())
    again.render(64, [])
    macro = place_of(images, SAVED, MACRO)
    for instance in (live, again):
        for value in (0.6, float(live.values[macro])):  # away, and back to where it was saved
            instance.values[macro] = value
            instance.render(64, [])
        instance.activate_again()
    assert again.save() == live.save()
    assert np.array_equal(sound_of(again, SAVED), sound_of(live, SAVED))
    for each in (live, again):
        each.destroy()


def damaged(state: State, draw: np.random.Generator) -> State:
    """A property is cut, grown, of another version, without end or without a finite number; or it is not there."""
    key, kind = str(draw.choice(sorted(state))), int(draw.integers(7))
    whole = state[key]
    place = 12 + 12 * int(draw.integers((len(whole) - 8) // 12))
    bad = struct.pack("<d", float(draw.choice([np.nan, np.inf, -np.inf])))
    changed = (
        whole[: draw.integers(len(whole))],
        whole + b"\0" * 100_000,
        b"\x07" + whole[1:],
        whole[:4] + struct.pack("<i", int(draw.choice([-1, 2**31 - 1, 4_096, -(2**31)]))) + whole[8:],
        whole[:place] + bad + whole[place + 8 :],
        b"",
    )
    rest = {name: value for name, value in state.items() if name != key}
    return rest if kind == len(changed) else {**rest, key: changed[kind]}


def test_damaged_states_are_refused_and_change_nothing(bundle: Path, images: list[Image]) -> None:
    live, draw = moved_by_hand(bundle, images), np.random.default_rng(4)
    state = live.save()
    for _ in range(200):
        assert not live.restore(damaged(state, draw))
        assert live.save() == state
    assert not live.restore(state, kind="http://lv2plug.in/ns/ext/atom#String")
    assert live.restore(state)
    assert live.save() == state
    live.destroy()


def test_ports_without_a_finite_number_are_ignored(bundle: Path, images: list[Image]) -> None:
    name = "electric_bass"
    plain, instance = instance_of(bundle, images, name), instance_of(bundle, images, name)
    wanted, standard = sound_of(plain, name), instance.values.copy()
    instance.values[:] = np.nan  # before the first block
    assert np.array_equal(sound_of(instance, name), wanted)
    for bad in (np.inf, -np.inf, np.nan):
        instance.values[:] = bad
        instance.render(64, [])
    instance.values[:] = standard
    instance.activate_again()
    assert np.array_equal(sound_of(instance, name), wanted)
    for each in (plain, instance):
        each.destroy()


@pytest.mark.parametrize(
    "rate_hz", (0.0, -1.0, -48_000.0, np.nan, np.inf, -np.inf, 1e-300, 1e300, 999.0, 1_000_001.0)
)
def test_impossible_rates_are_refused(bundle: Path, images: list[Image], rate_hz: float) -> None:
    image = images[0]
    with pytest.raises(Refused):
        Instance(bundle, image.id, image.parameters, rate_hz)


@pytest.mark.parametrize("rate_hz", (1_000.0, 8_000.0, 11_025.5, 384_000.0))
def test_unusual_rates_sound(bundle: Path, images: list[Image], rate_hz: float) -> None:
    image = image_named(images, SAVED)
    instance = Instance(bundle, image.id, image.parameters, rate_hz)
    sound = instance.render(4_096, [(0, bytes((0x90, 40, 100)))])
    assert np.isfinite(sound).all() and np.abs(sound).max() > 1e-4
    instance.destroy()
