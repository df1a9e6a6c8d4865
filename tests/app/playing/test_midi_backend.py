"""The system's MIDI: through a private JACK server where there is one, and the words where there is none."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import threading
import types
from collections.abc import Sequence
from pathlib import Path

import pytest

from app.instrument.events import Bend, Controller, NoteOff, NoteOn
from app.instrument.midi_file import event_of
from app.playing.midi_backend import VARIABLE, MidiUnavailable, RtMidiInput, load_backend
from app.playing.midi_port import MidiInput

ROOT = Path(__file__).parents[3]
IN_JACK = """
import faulthandler, json, sys, threading, time
from pathlib import Path
faulthandler.dump_traceback_later(120, exit=True)
from tests.bench.play.children import Missing
from tests.app.playing.midi_cable import cable
from app.instrument.events import Bend, Controller, NoteOff, NoteOn
from app.playing.midi_port import MidiInput, MidiUnavailable

def opened(name):
    for _ in range(20):  # JACK refuses a client now and then while the computer is busy
        try:
            return midi.open(name)
        except MidiUnavailable as error:
            refused = error
            time.sleep(0.2)
    raise refused

def stream():
    while not ended.is_set():
        line.send(Bend(0.5))
        time.sleep(0.001)

came, ended, found = [], threading.Event(), {}
midi = MidiInput(came.append)
streaming = threading.Thread(target=stream)
try:
    with cable(Path(sys.argv[1])) as line:
        opened(line.name)
        time.sleep(0.3)
        for event in (NoteOn(60, 100, 2), Bend(-1.0), Controller(64, 127), NoteOff(60, 2)):
            line.send(event)
        deadline_s = time.monotonic() + 10
        while len(came) < 4 and time.monotonic() < deadline_s:
            time.sleep(0.01)
        found["came"] = [repr(event) for event in came]
        streaming.start()
        try:
            for found["closed"] in range(1, 21):
                midi.close()
                came.clear()
                opened(line.name)
                time.sleep(0.02)
            while not came and time.monotonic() < deadline_s + 20:
                time.sleep(0.01)
            midi.close()
        finally:
            ended.set()
            streaming.join()
        found["streamed"] = bool(came)
        plugged = line.plug("other")
        name = next(each for each in midi.names() if each.endswith("other"))
        opened(name)
        found["looks"] = [midi.look()]
        plugged.delete()
        time.sleep(0.2)
        found["looks"] += [midi.look(), midi.look()]
        plugged = line.plug("other")
        time.sleep(0.2)
        came.clear()
        found["looks"].append(midi.look())
        time.sleep(0.2)
        plugged.send_message([0x90, 60, 100])
        time.sleep(0.2)
        found["came again"] = [repr(event) for event in came]
        plugged.delete()
        try:
            midi.open("Nobody:nothing")
        except MidiUnavailable as error:
            found["absent"] = str(error)
    try:
        midi.names()
    except MidiUnavailable as error:
        found["no server"] = str(error)
except Missing as error:
    found = {"missing": str(error)}
print(json.dumps(found))
"""


@pytest.mark.skipif(shutil.which("jackd") is None, reason="no JACK server is installed")
def test_messages_come_through_jack_and_an_input_closes_while_they_stream(tmp_path: Path) -> None:
    """In a process of its own, which a driver's fault or a deadlock would end."""
    command = [sys.executable, "-c", IN_JACK, str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=150)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    if "missing" in found:
        pytest.skip(found["missing"])
    came = [NoteOn(60, 100, 2), Bend(-1.0), Controller(64, 127), NoteOff(60, 2)]
    assert found["came"] == [repr(each) for each in came]
    assert found["closed"] == 20 and found["streamed"]
    before, gone, waiting, back = found["looks"]
    assert (before, waiting) == ("", "") and "was disconnected" in gone and "is connected again" in back
    assert found["came again"] == [repr(NoteOn(60, 100))]
    assert "Nobody:nothing is not connected" in found["absent"]
    assert "does not answer" in found["no server"]
    assert "leaked" not in done.stderr


def test_without_the_package_the_remedy_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "supriya_midi", None)
    with pytest.raises(MidiUnavailable, match=r"-m pip install supriya-midi"):
        load_backend()


def test_a_broken_package_is_no_more_than_that(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "supriya_midi.py").write_text("raise RuntimeError('not built for this system')")
    monkeypatch.delitem(sys.modules, "supriya_midi", raising=False)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(MidiUnavailable, match=r"not built for this system.*pip install"):
        load_backend()


@pytest.fixture
def library(monkeypatch: pytest.MonkeyPatch) -> types.SimpleNamespace:
    """A package whose port belongs to another program, as Windows has it."""

    class RtMidiError(Exception):
        pass

    class MidiIn:
        deleted = 0

        def __init__(self, api: int, name: str, queue: int) -> None:
            pass

        def get_ports(self) -> list[str]:
            return ["Keys 0"]

        def open_port(self, number: int) -> None:
            raise RtMidiError("error creating Windows MM MIDI input port")

        def delete(self) -> None:
            MidiIn.deleted += 1

    names = {1: "winmm", 2: "jack"}
    library = types.SimpleNamespace(
        RtMidiError=RtMidiError, MidiIn=MidiIn, get_api_name=names.get, get_compiled_apis=lambda: list(names)
    )
    monkeypatch.setitem(sys.modules, "supriya_midi", library)
    return library


def test_a_busy_input_is_a_message_and_leaves_no_client(library: types.SimpleNamespace) -> None:
    midi = MidiInput(lambda event: None)
    with pytest.raises(MidiUnavailable, match=r"Keys 0 cannot be opened \(error creating.*Another program"):
        midi.open("Keys 0")
    assert library.MidiIn.deleted == 2  # of the list of names, and of the try


def test_inputs_of_one_name_can_be_chosen_and_seen_to_be_gone(library: types.SimpleNamespace) -> None:
    opened, ports = list[int](), ["Keys", "Pads", "Keys", "Keys"]
    library.MidiIn.get_ports = lambda self: list(ports)
    library.MidiIn.open_port = lambda self, number: opened.append(number)
    library.MidiIn.get_message = lambda self: None
    library.MidiIn.close_port = lambda self: None
    midi = MidiInput(lambda event: None)
    assert midi.names() == ["Keys", "Pads", "Keys #2", "Keys #3"]
    midi.open("Keys #2")
    assert (opened, midi.name, midi.look()) == ([2], "Keys #2", "")
    ports[2:] = []
    assert "Keys #2 was disconnected" in midi.look()
    midi.close()


def test_a_variable_names_the_system(library: types.SimpleNamespace, monkeypatch: pytest.MonkeyPatch) -> None:
    assert load_backend()._api == 1
    monkeypatch.setenv(VARIABLE, "jack")
    assert load_backend()._api == 2
    monkeypatch.setenv(VARIABLE, "oss")
    with pytest.raises(MidiUnavailable, match=r"LEARNED_STRINGS_MIDI is oss.*winmm, jack"):
        load_backend()


def test_noise_and_a_fault_cost_one_message_and_not_the_input(monkeypatch: pytest.MonkeyPatch) -> None:
    waiting = [([0xF4], 0.0), ([0x90, 60, 1], 0.0), ([0x90, 61, 1], 0.0)]
    client = types.SimpleNamespace(get_message=lambda: waiting.pop(0) if waiting else None)
    client.close_port, client.delete = lambda: None, lambda: None
    faults: list[threading.ExceptHookArgs] = []
    monkeypatch.setattr(threading, "excepthook", faults.append)
    came: list[Sequence[int]] = []
    arrived = threading.Event()

    def play(message: Sequence[int]) -> None:
        if message == [0x90, 60, 1]:
            raise ValueError("no such string")
        came.append(message)
        if message == [0x90, 61, 1]:
            arrived.set()

    port = RtMidiInput(client, "Keys", play)
    assert arrived.wait(10)
    port.close()
    assert came == [[0xF4], [0x90, 61, 1]] and event_of(came[0]) is None
    assert [str(each.exc_value) for each in faults] == ["no such string"]
