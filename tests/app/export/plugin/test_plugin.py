"""Plug-ins in a host: they sound as the app renders, in blocks of any size, and survive what hosts do."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import zlib
from collections.abc import Callable
from contextlib import suppress
from ctypes import c_double
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from app.export.plugin import build
from app.export.plugin.build import build_plugin
from app.export.plugin.formats import FORMATS, TARGETS, PluginError, this_target
from app.export.plugin.identity import held_in
from app.export.plugin.image import Image, _Header, image_of
from app.export.plugin.objects import digest, objects_of, reason_of
from app.instrument.events import HARMONICS, STRUM, TREMOLO, Controller, NoteOn, PatchTurned, TimedEvent
from app.instrument.offline import render_events
from app.instrument.strings import Strings
from app.patches.drums import Drums
from app.patches.patch import Patch, Technique
from app.shared.parameters import OF_PATCHES
from engine.kernels import cache as kernel_cache
from engine.python_process import python_command, python_environment
from engine.result_file import WriteError
from tests.app.export.plugin import host, lv2_host
from tests.app.export.plugin.host import (
    IN_FILE,
    IN_PLUGIN,
    Browser,
    Event,
    Instance,
    Library,
    Params,
    Preset,
    choke,
    midi,
    note_off,
    note_on,
    param,
    tune,
)
from tests.app.export.plugin.pieces import DRUMS as DRUM_NAMES
from tests.app.export.plugin.pieces import (
    EQUAL_DB,
    LEARNED,
    LONG,
    MOVED,
    NAMES,
    TURNED,
    difference_db,
    patch_of,
    piece,
    played,
    preset_of,
    rendered,
    to_host,
)

pytestmark = pytest.mark.skipif(find_spec("ziglang") is None, reason="needs ziglang, the extra [plugin]")


LARGEST_BYTES = 2_000_000  # the code has 0.8 MB more


def instance_of(bank: Library, name: str, rate_hz: int = 48_000) -> Instance:
    id = next(id for id, shown in bank.plugins.items() if shown == patch_of(name).name)
    instance = bank.create(id)
    instance.activate(rate_hz)
    return instance


@pytest.mark.parametrize("name", NAMES)
def test_it_sounds_as_the_app_renders(bank: Library, name: str) -> None:
    patch = patch_of(name)
    instance = instance_of(bank, name)
    assert difference_db(played(instance, patch, 48_000), rendered(patch, 48_000)) < EQUAL_DB
    instance.deactivate()
    instance.destroy()


@pytest.mark.parametrize(
    ("name", "rate_hz"),
    [
        *(("concert_harp", rate_hz) for rate_hz in (44_100, 96_000, 192_000)),
        *((name, rate_hz) for rate_hz in (44_100, 96_000) for name in (NAMES[1:] if LONG else ())),
    ],
)
def test_it_sounds_so_at_other_rates(bank: Library, name: str, rate_hz: int) -> None:
    patch = patch_of(name)
    instance = instance_of(bank, name, rate_hz)
    assert difference_db(played(instance, patch, rate_hz), rendered(patch, rate_hz)) < EQUAL_DB
    instance.destroy()


@pytest.mark.parametrize("name", ("electric_bass", "timpani"))
def test_the_source_may_be_the_truth_or_the_difference(bank: Library, name: str) -> None:
    patch = patch_of(name)
    for value, source in ((1, "truth"), (2, "difference")):
        instance = instance_of(bank, name)
        id = instance.parameters["Source"].id
        instance.block(512, [param(0, id, value)])
        instance.deactivate()
        instance.activate(48_000)
        sound = played(instance, patch, 48_000)
        other = rendered(patch, 48_000, source)
        if source == "difference":  # model and truth differ less than any ear can find
            assert float(np.abs(sound).max()) < 1e-3
        else:
            assert difference_db(sound, other) < EQUAL_DB


def test_blocks_of_any_size_and_neighbours_change_nothing(bank: Library) -> None:
    patch = patch_of("cimbalom")
    whole = played(instance_of(bank, "cimbalom"), patch, 48_000)
    for block in (1, 17, 64, 480, 4096):
        if block == 1:  # the first tenth alone: each block is a call from Python
            instance = instance_of(bank, "cimbalom")
            events = [to_host(event, round(time_s * 48_000)) for time_s, event in piece(patch)]
            sound = instance.render(4_800, events, 1)[instance.latency :]
            assert np.array_equal(sound, whole[: len(sound)])
        else:
            assert np.array_equal(played(instance_of(bank, "cimbalom"), patch, 48_000, block), whole)
    one, other = instance_of(bank, "cimbalom"), instance_of(bank, "concert_harp")
    parts = []
    events = [to_host(event, round(time_s * 48_000)) for time_s, event in piece(patch)]
    while one.frame < len(whole) + one.latency:
        count = min(480, len(whole) + one.latency - one.frame)
        parts.append(one.block(count, [each for each in events if one.frame <= each.frame < one.frame + count]))
        other.block(480, [note_on(other.frame, 60, 100)])
    assert np.array_equal(np.concatenate(parts)[one.latency :], whole)


def test_a_macro_moves_its_targets_and_the_state_keeps_them(bank: Library) -> None:
    patch = patch_of("classical_guitar")
    instance = instance_of(bank, "classical_guitar")
    macro = patch.macros[0]
    control = instance.parameters[macro.name]
    assert (control.low, control.high, control.standard) == (0.0, 1.0, macro.value)
    before = {name: instance.value(each.id) for name, each in instance.parameters.items()}
    instance.block(512, [param(100, control.id, 1.0)])
    moved = {name for name, each in instance.parameters.items() if instance.value(each.id) != before[name]}
    assert macro.name in moved
    assert len(moved) > 1
    assert instance.callbacks == 1  # the host must read the other parameters again
    state, sound = instance.save(), played(instance, patch, 48_000)
    for reload in (False, True):  # before it is activated, and while it plays
        other = bank.create(next(id for id, name in bank.plugins.items() if name == patch.name))
        if reload:
            other.activate(48_000)
        assert other.load(state)
        if not reload:
            other.activate(48_000)
        assert other.save() == state
        again = played(other, patch, 48_000)
        assert difference_db(again, sound) < -80  # a knob glides to where it was set; the state is there at once
    assert not other.load(b"\x07" + state[1:])
    assert not other.load(state[:5])
    assert other.save() == state


def test_the_browser_of_presets_lists_each_instrument(bank: Library) -> None:
    browser = Browser(bank)
    done, found = browser.read()
    assert done
    assert browser.locations == [(1, "Instruments", IN_PLUGIN, None)]  # of the factory
    assert {preset.key: preset.name for preset in found} == bank.plugins
    assert len(found) == len(NAMES)
    for preset, name in zip(found, NAMES, strict=True):
        patch = patch_of(name)
        kind = "drum" if name in DRUM_NAMES else "synthesizer"
        features = ["instrument", kind, "stereo", patch.category]
        owner, text = [("clap", preset.key)], patch.description.encode()[:511].decode(errors="ignore")
        assert preset == Preset(patch.name, preset.key, owner, 1, ["Learned Strings"], text, features)
    assert len(browser.read(most=2)[1]) == 3  # where the host has enough, the plug-in stops
    assert browser.read(bare=True) == (True, [Preset(preset.name, preset.key) for preset in found])
    assert browser.read(kind=IN_FILE) == (False, [])


def test_a_browser_of_presets_that_asks_for_what_is_not_there_gets_nothing(bank: Library) -> None:
    browser = Browser(bank)
    assert browser.ids == ["org.learned-strings.bank.presets"]
    assert not browser.create("unknown")
    assert not browser.create(None)
    assert not browser.create(browser.ids[0], indexer=False)
    assert not browser.factory.contents.descriptor(None, 1)
    assert not bank.entry.get_factory(b"unknown")


@pytest.mark.parametrize("name", (MOVED, "timpani"))
def test_a_preset_brings_back_the_instrument_as_it_was(bank: Library, name: str) -> None:
    patch, fresh = patch_of(name), instance_of(bank, name)
    state, sound = fresh.save(), played(fresh, patch, 48_000)
    (key,) = (preset.key for preset in Browser(bank).read()[1] if preset.name == patch.name)
    all_at_the_top = [param(0, each.id, each.high) for each in fresh.parameters.values()]
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
            assert difference_db(played(instance, patch, 48_000), sound) < -80
        else:
            instance.activate(48_000)
            assert np.array_equal(played(instance, patch, 48_000), sound)


def test_the_preset_of_another_instrument_is_refused(bank: Library) -> None:
    instance, other = instance_of(bank, MOVED), instance_of(bank, "timpani")
    own, foreign = (
        next(id for id, shown in bank.plugins.items() if shown == patch_of(name).name) for name in (MOVED, "timpani")
    )
    control = instance.parameters[patch_of(MOVED).macros[0].name]
    instance.block(512, [param(0, control.id, 1.0)])
    state = instance.save()
    for key, kind in ((foreign, IN_PLUGIN), (None, IN_PLUGIN), ("", IN_PLUGIN), (own, IN_FILE)):
        assert not instance.load_preset(key, kind)
    assert instance.errors == ["the preset belongs to another instrument"] * 4
    assert (instance.save(), instance.rescans, instance.loaded) == (state, [], [])
    other.withdraw_extensions()
    assert not other.load_preset(own)
    assert other.load_preset(foreign)


def test_a_plug_in_of_one_instrument_has_one_preset(images: list[Image], objects: Path, tmp_path: Path) -> None:
    library = Library(build_plugin(images[:1], "clap", this_target(), tmp_path / "one", objects))
    browser = Browser(library)
    assert browser.ids == [f"{images[0].id}.presets"]
    assert [(preset.name, preset.key) for preset in browser.read()[1]] == [(images[0].name, images[0].id)]
    assert library.create(images[0].id).load_preset(images[0].id)
    library.destroy_instances()


def test_techniques_are_as_in_the_app(bank: Library) -> None:
    patch = patch_of("classical_guitar")
    values = {"harmonic": 3.0, "strum": 12.0, "strokes of strums": 1.0, "tremolo": 9.0}
    fields = ("harmonic", "strum_ms", "strokes", "tremolo_hz")
    turned = patch.model_copy(update={"technique": Technique(**dict(zip(fields, values.values(), strict=True)))})
    instance = instance_of(bank, "classical_guitar")
    ids = {name: instance.parameters[name].id for name in values}
    instance.block(64, [param(0, ids[name], value) for name, value in values.items()])
    state = instance.save()
    assert [instance.text(ids["strokes of strums"], value) for value in range(3)] == ["down", "up", "both"]
    assert [instance.text(ids["harmonic"], value) for value in (1, 5)] == ["1", "5"]
    volume = instance.parameters["volume"].id
    assert instance.text(volume, -1.4e-6) == "0 dB"  # what a host in single precision makes of 0
    other = instance_of(bank, "classical_guitar")
    assert other.load(state)
    other.deactivate()
    other.activate(48_000)
    assert difference_db(played(other, patch, 48_000), rendered(turned, 48_000)) < EQUAL_DB
    switched = (HARMONICS, TREMOLO, STRUM)
    events = tuple(midi(0, 0xB0, number, 127) for number in switched)
    timed = tuple(TimedEvent(0.0, Controller(number, 127)) for number in switched)
    third = instance_of(bank, "classical_guitar")
    assert (
        difference_db(played(third, patch, 48_000, before=events), rendered(patch, 48_000, before=timed)) < EQUAL_DB
    )


def ids_of(bank: Library, images: list[Image], name: str) -> dict[str, int]:
    """Of a host's parameters, by those of the table."""
    (image,) = (each for each in images if each.name == patch_of(name).name)
    instance = bank.create(image.id)
    found = dict(zip((each.id for each in image.parameters), instance.ids, strict=True))
    instance.destroy()
    return found


def with_values(bank: Library, name: str, values: dict[int, float]) -> Instance:
    """Its parameters, by their identifiers, are moved before anything is played."""
    instance = instance_of(bank, name)
    instance.block(64, [param(0, id, value) for id, value in values.items()])
    instance.deactivate()
    instance.activate(48_000)
    return instance


@pytest.mark.parametrize("seed", range(12 if LONG else 1))
@pytest.mark.parametrize("name", TURNED)
def test_with_all_macros_anywhere_it_sounds_as_the_app_renders(bank: Library, name: str, seed: int) -> None:
    patch, instance = patch_of(name), instance_of(bank, name)
    turned, values = patch, dict[int, float]()
    for number, place in enumerate(np.random.default_rng(seed).random(len(patch.macros))):
        turned = turned.turned(number, float(place))
        values[instance.parameters[patch.macros[number].name].id] = float(place)
    instance.destroy()
    assert difference_db(played(with_values(bank, name, values), patch, 48_000), rendered(turned, 48_000)) < EQUAL_DB
    assert difference_db(rendered(turned, 48_000), rendered(patch, 48_000)) > -60


def drawn(patch: Patch, image: Image, draw: np.random.Generator, count: int) -> dict[str, float]:
    """Values of so many parameters, each up to 0.4 of its range away, with which the piece can be played."""
    known = {each.id for each in image.parameters} & {*OF_PATCHES}
    while True:
        chosen, found = draw.choice(sorted(known), min(count, len(known)), replace=False), dict[str, float]()
        for id in map(str, chosen):
            share = OF_PATCHES[id].share(patch.value(id))
            found[id] = OF_PATCHES[id].value(share + draw.uniform(-0.4, 0.4))
        if not 0.02 < found.get("pickup.points.0", 0.5) < 0.98:  # at its ends a string is silent
            continue
        with suppress(ValueError):
            changed = patch.with_values(found)
            keys = [Strings(changed).of_key(event.key) for _, event in piece(patch) if isinstance(event, NoteOn)]
            if all(key is not None and key.modes > 1 for key in keys):
                return found


@pytest.mark.parametrize("count", (1, 1, 1, 1, 4, 9) * 5 if LONG else (1, 4, 9))
@pytest.mark.parametrize("name", [name for name in TURNED if name not in DRUM_NAMES])
def test_with_any_parameters_anywhere_it_sounds_as_the_app_renders(
    bank: Library, images: list[Image], name: str, count: int, request: pytest.FixtureRequest
) -> None:
    patch = patch_of(name)
    (image,) = (each for each in images if each.name == patch.name)
    seed = zlib.crc32(request.node.name.encode())
    values = drawn(patch, image, np.random.default_rng(seed), count)
    print(values)
    instance = instance_of(bank, name)
    ids = dict(zip((each.id for each in image.parameters), instance.ids, strict=True))
    instance.destroy()
    sound = played(with_values(bank, name, {ids[id]: value for id, value in values.items()}), patch, 48_000)
    assert difference_db(sound, rendered(patch.with_values(values), 48_000)) < EQUAL_DB


def test_keys_struck_after_a_macro_has_moved_are_as_loud_as_in_the_app(bank: Library) -> None:
    patch, rate_hz = patch_of("fretless_bass"), 48_000
    moved = [n for n, macro in enumerate(patch.macros) if all(t.field != "room.mix" for t in macro.targets)]
    assert len(moved) > 2
    instance, turned = instance_of(bank, "fretless_bass"), patch
    more, events = list[TimedEvent](), list[Event]()
    for step, time_s in enumerate((0.05, 0.2, 0.47, 0.58)):
        number, place = moved[step % len(moved)], (0.9, 0.2, 0.7, 0.35)[step]
        turned = turned.turned(number, place)
        frame = round(time_s * rate_hz)
        events.append(param(frame, instance.parameters[patch.macros[number].name].id, place))
        more.append(TimedEvent(time_s, PatchTurned(turned)))
    sound = played(instance, patch, rate_hz, more=tuple(events))
    assert difference_db(sound, rendered(patch, rate_hz, more=tuple(more))) < EQUAL_DB
    assert difference_db(sound, rendered(patch, rate_hz)) > -40


STEEL, RUBBER = {"knobs.modulus": 3.0}, {"knobs.modulus": 0.3}
PLACES = {"pickup.points.0": 0.1, "pickup.points.1": 0.93}
ENDS = {"knobs.modulus": 20.0, "knobs.decay": 0.5, "knobs.brightness_decay": 3.0, "pickup.points.0": 0.5}


@pytest.mark.parametrize("values", (STEEL, RUBBER, PLACES, ENDS))
@pytest.mark.parametrize("name", DRUM_NAMES)
def test_drums_follow_their_parameters(
    bank: Library, images: list[Image], name: str, values: dict[str, float]
) -> None:
    patch, ids = patch_of(name), ids_of(bank, images, name)
    moved = patch.with_values(values)
    sound = played(with_values(bank, name, {ids[id]: value for id, value in values.items()}), patch, 48_000)
    assert difference_db(sound, rendered(moved, 48_000)) < EQUAL_DB
    assert difference_db(rendered(moved, 48_000), rendered(patch, 48_000)) > -40


@pytest.mark.parametrize("name", DRUM_NAMES)
def test_drums_follow_while_they_play(bank: Library, images: list[Image], name: str) -> None:
    """Blows follow modulus and decay; drums that ring are heard at other places."""
    patch, rate_hz, ids = patch_of(name), 48_000, ids_of(bank, images, name)
    turned, more, events = patch, list[TimedEvent](), list[Event]()
    for time_s, values in ((0.05, STEEL), (0.2, PLACES), (0.4, {"knobs.decay": 0.6, **RUBBER})):
        turned = turned.with_values(values)
        more.append(TimedEvent(time_s, PatchTurned(turned)))
        events += [param(round(time_s * rate_hz), ids[id], value) for id, value in values.items()]
    sound = played(instance_of(bank, name), patch, rate_hz, more=tuple(events))
    assert difference_db(sound, rendered(patch, rate_hz, more=tuple(more))) < EQUAL_DB
    assert difference_db(sound, rendered(patch, rate_hz)) > -40


@pytest.mark.parametrize("factor", (0.05, 1.0, 20.0))
def test_other_drums_are_computed_as_in_the_app(objects: Path, tmp_path: Path, factor: float) -> None:
    """A shell, a kettle, a rectangle in air, of many modes, and a modulus that is impossible."""
    timpani = patch_of("timpani")
    assert isinstance(timpani.strings, Drums)
    one = timpani.strings.drums[0]
    changed: list[dict[str, object]] = [
        {"shell_m": 0.4, "cavity_m3": 0.0},
        {"length_m": 0.33, "width_m": 0.31, "cavity_m3": 0.02, "uneven": 0.01},
        {"shape": "rectangle", "length_m": 0.3541, "width_m": 0.0612, "cavity_m3": 0.0, "shell_m": 0.2},
        {"youngs_modulus_pa": 9e11},
    ]
    drums = [
        one.model_copy(update={"note": 50 + place, "drum": replace(one.drum, **each)})
        for place, each in enumerate(changed)
    ]
    strings = timpani.strings.model_copy(update={"drums": tuple(drums), "keys": "pads"})
    patch = timpani.model_copy(update={"name": "Others", "strings": strings, "range": (50, 53)})
    path = build_plugin([image_of(patch, preset_of("timpani"))], "clap", this_target(), tmp_path / "others", objects)
    library = Library(path)
    instance = library.create(next(iter(library.plugins)))
    id = instance.parameters["modulus"].id
    struck = [(0.02 * place, NoteOn(50 + place, 90)) for place in range(4)]
    instance.activate(48_000)
    instance.block(64, [param(0, id, factor)])
    instance.deactivate()
    instance.activate(48_000)
    frames, moved = 24_000, patch.with_value("knobs.modulus", factor)
    events = [to_host(event, round(time_s * 48_000)) for time_s, event in struck]
    sound = instance.render(frames + instance.latency, events)[instance.latency :]
    library.destroy_instances()
    possible = struck[:3] if factor > 1 else struck  # beyond the bounds of a modulus a key is silent
    timed = [TimedEvent(time_s, event) for time_s, event in possible]
    wanted = np.concatenate(list(render_events(moved, preset_of("timpani"), timed, 48_000, "model", 0.5)))
    assert difference_db(sound, wanted) < EQUAL_DB


def test_body_and_room_follow_macros_and_the_wheel_while_it_plays(bank: Library) -> None:
    rate_hz, settled_s = 48_000, 0.7
    after = slice(round(settled_s * rate_hz), None)
    patch = patch_of(MOVED)
    room = [macro.targets[0].field for macro in patch.macros].index("room.mix")
    instance = instance_of(bank, MOVED)
    moved = param(round(0.3 * rate_hz), instance.parameters[patch.macros[room].name].id, 1.0)
    sound = played(instance, patch, rate_hz, more=(moved,))
    wanted = rendered(patch, rate_hz, more=(TimedEvent(0.3, PatchTurned(patch.turned(room, 1.0))),))
    assert difference_db(sound[after], wanted[after]) < EQUAL_DB
    harp = patch_of("concert_harp")
    assert harp.mod_wheel == "room.mix"
    wheel = Controller(1, 100)
    sound = played(instance_of(bank, "concert_harp"), harp, rate_hz, more=(to_host(wheel, round(0.3 * rate_hz)),))
    wanted = rendered(harp, rate_hz, more=(TimedEvent(0.3, wheel),))
    assert difference_db(sound[after], wanted[after]) < EQUAL_DB
    assert difference_db(sound, rendered(harp, rate_hz)) > -60


def test_size_of_body_and_time_of_room_are_followed_while_it_plays(bank: Library, images: list[Image]) -> None:
    rate_hz, after = 48_000, slice(round(0.9 * 48_000), None)
    patch = patch_of(MOVED)
    (image,) = (each for each in images if each.name == patch.name)
    ids = dict(zip((each.id for each in image.parameters), instance_of(bank, MOVED).ids, strict=True))
    turned = patch.with_values({"body.size": 1.3, "room.t60_s": 2.2, "room.mix": 0.4})
    values = {ids[id]: turned.value(id) for id in ("body.size", "room.t60_s", "room.mix")}

    moved = [param(round(0.3 * rate_hz), id, value) for id, value in values.items()]
    swept = [param(480 * step, ids["body.size"], 0.6 + 0.02 * step) for step in range(100)]

    def bounced(more: list[Event]) -> NDArray[np.float32]:
        instance = instance_of(bank, MOVED)
        instance.go_offline()
        return played(instance, patch, rate_hz, more=tuple(more))

    sound = bounced(moved)
    wanted = rendered(patch, rate_hz, more=(TimedEvent(0.3, PatchTurned(turned)),))
    assert difference_db(sound[after], wanted[after]) < EQUAL_DB
    assert difference_db(sound, rendered(patch, rate_hz)) > -40
    assert np.array_equal(bounced(swept), bounced(swept))  # the sound waits for the thread


def test_registered_parameter_0_sets_the_range_of_bends(bank: Library) -> None:
    patch = patch_of("electric_bass")
    wide = [Controller(101, 0), Controller(100, 0), Controller(6, 12)]
    sound = played(instance_of(bank, "electric_bass"), patch, 48_000, more=tuple(to_host(each, 0) for each in wide))
    assert (
        difference_db(sound, rendered(patch, 48_000, more=tuple(TimedEvent(0.0, each) for each in wide))) < EQUAL_DB
    )
    assert difference_db(sound, rendered(patch, 48_000)) > -20


def test_latency_and_tail_are_reported(bank: Library) -> None:
    instance = instance_of(bank, "concert_harp", 96_000)
    assert instance.latency == 96
    tail = instance.extension("clap.tail", host.Frames).get(instance.at)  # type: ignore[attr-defined]
    assert tail / 96_000 > patch_of("concert_harp").room.t60_s


def test_ends_of_notes_are_reported(bank: Library) -> None:
    instance = instance_of(bank, "electric_bass")
    instance.block(4_096, [note_on(0, 40, 100, note_id=7)])
    instance.block(512, [note_off(4_096, 40)])
    for _ in range(300):
        instance.block(1_024, [])
    assert instance.ended == [7]
    assert instance.status == 4  # it may sleep


def test_a_choked_note_is_silent_at_once_and_others_ring_on(bank: Library) -> None:
    def ringing(*events: Event) -> float:
        instance = instance_of(bank, "electric_bass")
        events = (note_on(0, 40, 120, note_id=1), note_on(0, 47, 120, note_id=2), *events)
        return float(np.abs(instance.render(24_000, list(events))[-4_800:]).max())

    rest, one = ringing(), ringing(choke(4_800, note_id=1))
    assert ringing(choke(4_800, note_id=1), choke(4_800, key=47)) < 0.01 * rest
    assert 0.05 * rest < one < 0.99 * rest
    assert ringing(choke(4_800)) < 0.01 * rest


def by_midi(event: Event) -> Event:
    """The same note as a message of MIDI."""
    note = event.content
    kind, velocity = (0x90, round(127 * note.velocity)) if note.header.type == host.NOTE_ON else (0x80, 64)
    return midi(event.frame, kind | note.channel, note.key, velocity)


@pytest.mark.parametrize("sent", [lambda event: event, by_midi])
def test_a_release_belongs_to_the_stroke_before_it(bank: Library, sent: Callable[[Event], Event]) -> None:
    def ringing(*events: Event) -> float:
        struck = [note_on(0, 40, 120), note_on(4_800, 40, 120), *events]
        sound = instance_of(bank, "electric_bass").render(48_000, [sent(each) for each in struck])
        return float(np.abs(sound[-4_800:]).max())

    held = ringing()
    assert ringing(note_off(4_900, 40)) == held  # of the first
    assert ringing(note_off(4_900, 40), note_off(6_000, 40)) < 0.01 * held


@pytest.mark.parametrize("choked", [choke(4_800), choke(4_800, key=40), choke(4_800, note_id=1)])
def test_a_key_that_was_choked_is_damped_when_it_is_struck_and_released_again(bank: Library, choked: Event) -> None:
    def ringing(*before: Event) -> float:
        events = [*before, note_on(9_600, 40, 120, note_id=2), note_off(12_000, 40)]
        return float(np.abs(instance_of(bank, "electric_bass").render(48_000, events)[-4_800:]).max())

    assert ringing(note_on(0, 40, 120, note_id=1), choked) < 2 * ringing()


def test_tuning_one_note_leaves_the_others(bank: Library) -> None:
    def sound(*events: Event) -> NDArray[np.float32]:
        instance = instance_of(bank, "fretless_bass")  # without an amplifier sounds add
        return instance.render(9_600, [note_on(0, 40, 100, note_id=1), *events])

    other = note_on(0, 47, 100, note_id=2)
    bent = sound(other, tune(2_000, 2.0, note_id=2))
    assert np.array_equal(bent[:2_000], sound(other)[:2_000])
    assert difference_db(bent - sound(), sound(other) - sound()) > -20
    alone = instance_of(bank, "fretless_bass").render(9_600, [other, tune(2_000, 2.0, note_id=2)])
    assert difference_db(bent - sound(), alone) < -100  # in the sum only single precision is lost


@pytest.mark.parametrize("name", NAMES)
def test_after_a_reset_it_is_as_a_new_one(bank: Library, name: str) -> None:
    patch = patch_of(name)
    low = max(patch.range[0], min(52, patch.range[1] - 20))
    instance, fresh = instance_of(bank, name), instance_of(bank, name)
    pedals = [midi(0, 0xE0, 0, 100), midi(0, 0xB0, 1, 90), midi(0, 0xB0, 64, 127), midi(0, 0xB1, 101, 0)]
    events = [*pedals, *(note_on(10 + 900 * each, low + 2 * each, 90 + 4 * each) for each in range(9))]
    instance.render(9_000, events)
    instance.reset()
    silence = instance.render(48_000, [])
    assert np.array_equal(silence, fresh.render(48_000, []))
    assert not silence.any() or (patch.amp.drive_db > 0 and np.abs(silence).max() < 1e-15)  # as when new
    instance.render(9_000, events)
    names = {"volume", "decay", "modulus", "pluck position", "release", "body mix", "room", "amplifier drive"}
    for moved in (each for shown, each in instance.parameters.items() if shown in names):
        instance.block(1, [param(instance.frame, moved.id, moved.low + 0.3 * (moved.high - moved.low))])
    state = instance.save()
    fresh.deactivate()
    assert fresh.load(state)
    fresh.activate(48_000)
    instance.reset()
    assert instance.save() == state
    wanted = played(fresh, patch, 48_000)
    assert np.abs(wanted).max() > 1e-3
    assert np.array_equal(played(instance, patch, 48_000), wanted)


def test_the_last_of_many_values_counts(bank: Library) -> None:
    instance, other = instance_of(bank, "electric_bass"), instance_of(bank, "electric_bass")
    moved = [each for name, each in instance.parameters.items() if name not in ("Source", "volume")][:6]
    ends = [param(511, each.id, each.low + 0.4 * (each.high - each.low)) for each in moved]
    swept = [param(frame, each.id, each.high) for frame in range(511) for each in moved]
    instance.render(512, swept + ends)
    other.render(512, ends)
    for each in (instance, other):
        each.render(48_000, [])
    assert instance.save() == other.save()
    found, wanted = (each.render(9_600, [note_on(0, 40, 100)]) for each in (instance, other))
    assert difference_db(found, wanted) < -80  # of body and room, which glide


def test_a_parameter_that_moved_just_before_a_reset_counts(bank: Library) -> None:
    instance = instance_of(bank, "electric_bass")
    volume = instance.parameters["volume"].id
    plain = instance.render(9_600, [note_on(0, 40, 100)])
    instance.render(64, [param(63, volume, -24.0)])
    instance.reset()
    instance.render(4_800, [])
    quiet = instance.render(9_600, [note_on(0, 40, 100)])
    assert instance.value(volume) == -24.0
    assert 20 < 20 * np.log10(np.abs(plain).max() / np.abs(quiet).max()) < 28


def test_impossible_rates_and_blocks_are_refused(bank: Library) -> None:
    instance = bank.create(next(id for id, name in bank.plugins.items() if name == patch_of("electric_bass").name))
    for rate_hz in (0.0, -1.0, np.nan, np.inf, -np.inf, 999.0, 1e300):
        assert not instance.accepts(rate_hz, 4_096)
    for most in (0, 2**31, 2**32 - 1):
        assert not instance.accepts(48_000.0, most)
    instance.activate(48_000.0, 2**31 - 1)
    assert np.abs(instance.render(4_096, [note_on(0, 40, 100)])).max() > 0.01


def test_values_without_a_finite_number_are_ignored(bank: Library) -> None:
    plain, instance = instance_of(bank, "electric_bass"), instance_of(bank, "electric_bass")
    bad = (np.nan, np.inf, -np.inf)
    struck = note_on(0, 40, 100)
    events = [
        *(param(0, id, value) for id in instance.ids for value in bad),
        struck,
        *(note_on(0, 45, value) for value in bad),
        *(tune(0, value, -1) for value in bad),
    ]
    assert np.array_equal(instance.render(4_096, events), plain.render(4_096, [struck]))
    assert instance.save() == plain.save()


def test_damaged_states_change_nothing(bank: Library) -> None:
    instance, draw = instance_of(bank, MOVED), np.random.default_rng(1)
    instance.render(64, [param(0, id, 0.3) for id in instance.ids])
    state = instance.save()
    for _ in range(100):
        place = 12 + 12 * int(draw.integers((len(state) - 8) // 12))
        bad = c_double(draw.choice([np.nan, np.inf, -np.inf]))
        for damaged in (state[: draw.integers(len(state))], state[:place] + bytes(bad) + state[place + 8 :]):
            assert not instance.load(damaged)
            assert instance.save() == state
    assert instance.load(state)
    assert instance.save() == state


@pytest.mark.parametrize("text", (b"nan", b"", b"loud", b"\xff\xfe"))
def test_a_text_without_a_number_is_refused_and_numbers_are_bounded(bank: Library, text: bytes) -> None:
    instance, found = instance_of(bank, "electric_bass"), c_double()
    params, volume = instance.extension("clap.params", Params), instance.parameters["volume"]
    assert not params.from_text(instance.at, volume.id, text, found)
    for beyond, bound in ((b"-1e400 dB", volume.low), (b"inf", volume.high)):
        assert params.from_text(instance.at, volume.id, beyond, found)
        assert found.value == bound


def test_process_calls_nothing_but_arithmetic(objects: Path) -> None:
    paths = objects_of("linux-x64", objects)
    if shutil.which("nm") is None:
        pytest.skip("needs nm")
    listed = subprocess.run(["nm", "-u", *paths], capture_output=True, text=True, check=True).stdout.split()
    assert not {"malloc", "free", "calloc", "fopen", "pthread_mutex_lock"} & set(listed)


def test_an_lv2_bundle_is_valid(images: list[Image], objects: Path, tmp_path: Path) -> None:
    path = build_plugin(images[:1], "lv2", this_target(), tmp_path / "Concert harp", objects)
    described = (path / "instruments.ttl").read_text(encoding="utf-8")
    assert re.search(r"lv2:minorVersion [1-9]\d* ; lv2:microVersion \d+ ;", described)
    assert "lv2:extensionData state:interface ;" in described
    if shutil.which("lv2_validate") and shutil.which("sord_validate"):  # which the first calls
        names = [each.name for each in path.glob("*.ttl")]  # it skips paths that have a space
        done = subprocess.run(["lv2_validate", *names], cwd=path, capture_output=True, text=True, check=False)
        assert "Found 0 errors" in done.stdout + done.stderr, done  # its status is 0 for some errors
        assert not any(name in done.stderr for name in names)
    if shutil.which("lv2ls"):
        environment = {**os.environ, "LV2_PATH": str(tmp_path)}
        done = subprocess.run(["lv2ls"], env=environment, capture_output=True, text=True, check=True)
        assert done.stdout.split() == [f"urn:{images[0].id}"]


def test_an_instrument_that_cannot_sound_is_refused() -> None:
    sitar = patch_of("sitar")
    assert sitar.pickup.kind == "bridge"  # whose force a recording does not give
    with pytest.raises(ValueError, match="no key sounds"):
        image_of(sitar, preset_of(LEARNED))


def test_any_other_kernel_makes_other_object_files(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the user chooses the folder of compiled code, it is the same for every version."""
    read, usual = set[Path](), Path.read_bytes
    monkeypatch.setattr(Path, "read_bytes", lambda path: read.add(path) or usual(path))
    digest()
    kernels = Path(kernel_cache.__file__).parent
    assert set(kernels.rglob("*.py")) <= read


def test_instruments_with_the_most_drums_or_modes_and_the_longest_room_are_small() -> None:
    for name in ("concert_toms", "frame_drum", "slow_water"):
        assert image_of(patch_of(name), preset_of(name)).bytes < LARGEST_BYTES


def test_targets_are_known_and_an_unknown_one_is_refused(objects: Path) -> None:
    with pytest.raises(ValueError, match="linux-x64, linux-arm64, windows-x64"):
        objects_of("amiga", objects)
    assert set(TARGETS) == {"linux-x64", "linux-arm64", "windows-x64", "macos-x64", "macos-arm64"}
    assert host.NOTE_ON == 0


def test_names_in_any_script_are_plug_ins_of_their_own(objects: Path, tmp_path: Path) -> None:
    names = ("é" * 60, "古琴" * 18, "古琴" * 18 + "!", "🎸" * 60, "My bass!", "my bass-", "My bass", "عود", "!!!")
    harp, preset = patch_of("concert_harp"), preset_of("concert_harp")
    made = [image_of(harp.model_copy(update={"name": name}), preset) for name in names]
    library = Library(build_plugin(made, "clap", this_target(), tmp_path / "bank", objects))
    assert list(library.plugins) == [image.id for image in made]
    assert len({bytes(_Header.from_buffer_copy(image.content).uid) for image in made}) == len(names)
    for id in library.plugins:
        assert library.create(id).save()
    library.destroy_instances()
    bundle = build_plugin(made, "lv2", this_target(), tmp_path / "bank", objects)
    for image in made:
        lv2_host.Instance(bundle, image.id, image.parameters, 48_000).destroy()
    if shutil.which("lv2ls"):
        environment = {**os.environ, "LV2_PATH": str(tmp_path)}
        done = subprocess.run(["lv2ls"], env=environment, capture_output=True, text=True, check=True)
        assert sorted(done.stdout.splitlines()) == sorted(f"urn:{image.id}" for image in made)


def test_two_instruments_of_one_name_are_no_bank(images: list[Image], objects: Path, tmp_path: Path) -> None:
    with pytest.raises(PluginError, match=f"two instruments are named {images[0].name}"):
        build_plugin([*images[:2], images[0]], "clap", this_target(), tmp_path / "bank", objects)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("form", FORMATS)
def test_a_plug_in_that_holds_others_is_kept_until_it_is_to_be_replaced(
    images: list[Image], objects: Path, tmp_path: Path, form: str
) -> None:
    place = tmp_path / "bank"
    path = build_plugin(images[:2], form, this_target(), place, objects)
    assert held_in(path) == {image.id for image in images[:2]}
    before = {each: each.read_bytes() for each in path.rglob("*") if each.is_file()} or path.read_bytes()
    with pytest.raises(PluginError, match=r"another instrument, .*--replace"):
        build_plugin(images[1:3], form, this_target(), place, objects)
    assert ({each: each.read_bytes() for each in path.rglob("*") if each.is_file()} or path.read_bytes()) == before
    build_plugin(images[:3], form, this_target(), place, objects)  # the same instruments, built again, and another
    build_plugin(images[1:2], form, this_target(), place, objects, replace=True)
    assert held_in(path) == {images[1].id}
    assert [each.name for each in tmp_path.iterdir()] == [path.name]


def test_a_folder_that_cannot_be_written_is_named_before_anything_is_compiled(
    images: list[Image], objects: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(build, "objects_of", lambda *_: pytest.fail("it was compiled"))
    (tmp_path / "file").touch()
    for folder in (tmp_path / "file", Path("/dev/null/there"), Path("/proc/there")):
        with pytest.raises(WriteError, match=f"^{folder}.*: cannot be written .*; "):
            build_plugin(images[:1], "clap", this_target(), folder / "bank", objects)


def test_a_full_disk_is_said_so(
    images: list[Image], objects: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for said in ("error: NoSpaceLeft", "LLVM ERROR: IO failure on output stream: No space left on device"):
        monkeypatch.setattr(build, "run_waiting", lambda *_, said=said: (1, said))
        with pytest.raises(WriteError, match=r"No space left on device.*free some space"):
            build_plugin(images[:1], "clap", this_target(), tmp_path / "bank", objects)
        assert not list(tmp_path.iterdir())


KILLED = """
import os, signal, sys
from pathlib import Path
from app.export.plugin import build
from app.export.plugin.formats import this_target
from app.export.plugin.image import Image
build.check_compiler = lambda: None
build.objects_of = lambda *_: ()
build._link = lambda *_: os.kill(os.getpid(), signal.SIGKILL)
image = Image("org.learned-strings.a", "A", b"", (), ())
build.build_plugin([image], "lv2", this_target(), Path(sys.argv[1]), Path())
"""


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs a kill that nothing can catch")
def test_what_a_killed_build_left_goes_with_the_next(
    images: list[Image], objects: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    aside, out = tmp_path / "temporary", tmp_path / "out"
    aside.mkdir()
    command = python_command("-c", KILLED, str(out / "a"))
    subprocess.run(command, env={**python_environment(), "TMPDIR": str(aside)}, check=False)
    (left,) = aside.iterdir()
    assert (left / "images.c").exists()
    monkeypatch.setattr("tempfile.tempdir", str(aside))
    build_plugin(images[:1], "lv2", this_target(), out / "b", objects)
    assert not list(aside.iterdir())
    assert [each.name for each in out.iterdir()] == ["b.lv2"]


@pytest.mark.parametrize(
    ("said", "wanted"),
    [
        ("warning\nlib.c:1:2: error: no\nnote", "lib.c:1:2: error: no"),
        ("Traceback\n  x\nFileNotFoundError: zig", "FileNotFoundError: zig"),
        ("a\nb\n\n", "b"),
        ("", "its process ended with status -9; free some memory and try again"),
    ],
)
def test_why_a_process_failed_is_one_line(said: str, wanted: str) -> None:
    assert reason_of(-9, said) == wanted
