"""The VST3 plug-in in two hosts: it plays what the CLAP plug-in plays, and keeps to the interface."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from app.export.plugin.build import build_plugin
from app.export.plugin.formats import this_target
from app.export.plugin.image import Image
from app.instrument.events import Bend, Controller, NoteOff, NoteOn
from app.shared.parameters import OF_CHOICES, OF_PATCHES
from tests.app.export.plugin import host, vst3_host
from tests.app.export.plugin.pieces import SECONDS, difference_db, patch_of, piece, played
from tests.app.export.plugin.vst3_host import Event, Instance, Library

RATE_HZ = 48_000
BEND = 129

pytestmark = pytest.mark.skipif(find_spec("ziglang") is None, reason="needs ziglang, the extra [plugin]")


@pytest.fixture(scope="module")
def bundle(images: list[Image], objects: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_plugin(images, "vst3", this_target(), tmp_path_factory.mktemp("vst3") / "bank", objects)


@pytest.fixture(scope="module")
def library(bundle: Path) -> Library:
    inside = [each for each in bundle.rglob("*") if each.is_file()]
    assert [str(each.relative_to(bundle)) for each in inside] == ["Contents/x86_64-linux/bank.so"]
    return Library(inside[0])


def active(library: Library, name: str, rate_hz: int = RATE_HZ) -> Instance:
    instance = library.create(patch_of(name).name)
    instance.activate(rate_hz)
    return instance


def test_it_plays_as_the_clap_plug_in(library: Library, bank: host.Library) -> None:
    for name in ("classical_guitar", "fretless_bass"):
        patch = patch_of(name)
        id = next(id for id, shown in bank.plugins.items() if shown == patch.name)
        other = bank.create(id)
        other.activate(RATE_HZ)
        wanted = played(other, patch, RATE_HZ)
        instance, events, changes = active(library, name), [], []
        for time_s, event in piece(patch):
            frame = round(time_s * RATE_HZ)
            if isinstance(event, NoteOn):
                events.append((frame, vst3_host.note_on(event.key, event.velocity, event.channel)))
            elif isinstance(event, NoteOff):
                events.append((frame, vst3_host.note_off(event.key, event.channel)))
            elif isinstance(event, Bend):
                id_ = instance.assigned(event.channel, BEND)
                wheel = 8192 + round(event.value * (8191 if event.value > 0 else 8192))
                changes.append((frame, id_ or 0, wheel / 16383))
            elif isinstance(event, Controller):
                changes.append((frame, instance.assigned(event.channel, event.number) or 0, event.value / 127))
        found, total = [], round(SECONDS * RATE_HZ) + instance.latency
        while instance.frame < total:
            first, count = instance.frame, min(480, total - instance.frame)
            due = [each for each in events if first <= each[0] < first + count]
            moved = [each for each in changes if first <= each[0] < first + count]
            found.append(instance.block(count, due, moved))
        assert np.array_equal(np.concatenate(found)[instance.latency :], wanted)
        instance.destroy()


def share_of(name: str, shown: host.ParamInfo, value: float) -> float:
    """Where a knob of a VST3 host stands: as that of the window."""
    known = {each.name: each for each in (*OF_PATCHES.values(), OF_CHOICES["volume_db"])}
    return known[name].share(value) if name in known else (value - shown.low) / (shown.high - shown.low)


def test_parameters_are_the_clap_plug_in_s_and_macros_move_them(library: Library, bank: host.Library) -> None:
    patch = patch_of("classical_guitar")
    other = bank.create(next(id for id, shown in bank.plugins.items() if shown == patch.name))
    instance = active(library, "classical_guitar")
    shown, wanted = instance.parameters, other.parameters
    for name, each in wanted.items():
        assert shown[name].id == each.id
        assert instance.value(each.id) == pytest.approx(share_of(name, each, each.standard))
    assert instance.shown(shown["Source"].id, 0.5) == "truth"
    hidden = [each for name, each in shown.items() if name not in wanted]
    assert len({each.id for each in shown.values()}) == len(shown)
    assert hidden
    assert all(each.flags & 16 for each in hidden)
    macro = patch.macros[0].name
    instance.block(64, [], [(0, shown[macro].id, 1.0)])
    assert instance.moved  # the host is given what else has moved
    other.activate(RATE_HZ)
    other.block(64, [host.param(0, wanted[macro].id, 1.0)])
    for name, each in wanted.items():
        assert instance.value(each.id) == pytest.approx(share_of(name, each, other.value(each.id)), abs=1e-9)
    state = instance.save()
    assert state == other.save()
    again = library.create(patch.name)
    assert again.load(state)
    assert again.save() == state
    assert [again.value(each.id) for each in wanted.values()] == [instance.value(each.id) for each in wanted.values()]
    assert not again.load(state[:7])
    again.activate(RATE_HZ)
    for each in (instance, again):
        each.destroy()


def test_a_note_expression_tunes_one_note(library: Library) -> None:
    def sound(events: list[tuple[int, Event]]) -> np.ndarray:
        return active(library, "jazz_guitar").block(4_000, events)

    low, high = (0, vst3_host.note_on(45, 100, id=1)), (0, vst3_host.note_on(57, 100, id=2))
    both = sound([low, high, (0, vst3_host.tuned(2, 1.0))])
    assert difference_db(both, sound([low, high])) > -30
    assert difference_db(both, sound([low, (0, vst3_host.note_on(57, 100, id=2, cents=100.0))])) < -140


_PEDALBOARD = """
import json, sys
import numpy as np
from pedalboard import load_plugin
path, name, out, wanted = sys.argv[1:]
plugin = load_plugin(path, plugin_name=name)
messages = [(bytes(data), time_s) for data, time_s in json.loads(wanted)]
sound = plugin(messages, duration=1.6, sample_rate=48_000, num_channels=2, buffer_size=480)
np.save(out, np.asarray(sound).T)
print(json.dumps(sorted(plugin.parameters)))
"""


def test_pedalboard_plays_it(bundle: Path, bank: host.Library, tmp_path: Path) -> None:
    python = os.environ.get("PEDALBOARD_PYTHON") or (sys.executable if find_spec("pedalboard") else "")
    if not python:
        pytest.skip("needs pedalboard; PEDALBOARD_PYTHON may be a Python that has it")
    patch, events = patch_of("classical_guitar"), []
    for time_s, event in piece(patch):
        if isinstance(event, NoteOn):
            events.append(([0x90, event.key, event.velocity], time_s))
        elif isinstance(event, NoteOff):
            events.append(([0x80, event.key, 0], time_s))
        elif isinstance(event, Controller):
            events.append(([0xB0, event.number, event.value], time_s))
        else:
            wheel = 8192 + round(event.value * (8191 if event.value > 0 else 8192))
            events.append(([0xE0, wheel & 127, wheel >> 7], time_s))
    command = [python, "-c", _PEDALBOARD, str(bundle), patch.name, str(tmp_path / "sound.npy"), json.dumps(events)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-600:]
    sound = np.load(tmp_path / "sound.npy")
    other = bank.create(next(id for id, shown in bank.plugins.items() if shown == patch.name))
    other.activate(RATE_HZ)
    wanted = played(other, patch, RATE_HZ)
    count = min(len(sound), len(wanted))
    assert count > RATE_HZ
    latest = min(difference_db(sound[skip:][:count], wanted[: len(sound[skip:][:count])]) for skip in (0, 64, 96))
    assert latest < -120


IMPOSSIBLE_HZ = (0.0, -1.0, float("nan"), float("inf"), 999.0, 1e300)
NOT_FINITE = (float("nan"), float("inf"), float("-inf"))


def test_impossible_rates_and_blocks_are_refused(library: Library) -> None:
    instance = library.create(patch_of("electric_bass").name)
    assert not any(instance.accepts(rate_hz) for rate_hz in IMPOSSIBLE_HZ)
    assert not any(instance.accepts(RATE_HZ, most) for most in (0, -1, -(2**31)))
    instance.activate(RATE_HZ)
    assert np.abs(instance.block(4_096, [(0, vst3_host.note_on(40, 100))])).max() > 0.01
    instance.destroy()


def test_values_without_a_finite_number_are_ignored(library: Library) -> None:
    plain, instance = active(library, "electric_bass"), active(library, "electric_bass")
    ids = [each.id for each in instance.parameters.values()]
    state = instance.save()
    assert not any(instance.set_value(id, bad) for id in ids for bad in NOT_FINITE)
    changes = [(0, id, bad) for bad in NOT_FINITE for id in ids]
    struck = [(0, vst3_host.note_on(40, 100)), (0, vst3_host.note_on(45, float("nan")))]
    assert np.array_equal(instance.block(4_096, struck, changes), plain.block(4_096, struck[:1]))
    assert instance.save() == state == plain.save()
    for each in (plain, instance):
        each.destroy()
