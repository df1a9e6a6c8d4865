"""MIDI input: through JACK, of other kinds of ports, with faults in plain words; its sound; what controllers turn."""

import faulthandler
import json
import os
import shutil
import subprocess
import sys
import threading
import time
import types
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest

from app.instruments.instrument import Pickup
from app.instruments.library import SHIPPED as INSTRUMENTS
from app.instruments.library import read_instrument
from app.player.events import Bend, ControlChange, Event, NoteOff, NoteOn, event_of, message_of, release_all
from app.playing.midi import MidiChoices, turns_of
from app.playing.midi_backend import VARIABLE, MidiUnavailable, RtMidiInput, load_backend
from app.playing.midi_port import MidiInput
from app.session.choices import Choices
from app.shared.parameters import LEARNABLE, OF_CHOICES
from engine.parameters import OF_INSTRUMENTS

ROOT = Path(__file__).parents[3]
GUITAR = read_instrument(INSTRUMENTS / "classical_guitar.json")


@pytest.mark.skipif(shutil.which("jackd") is None, reason="no JACK server is installed")
def test_messages_come_through_jack_and_an_input_closes_while_they_stream(tmp_path):
    command = [sys.executable, "-m", "tests.app.playing.test_midi_input", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=150)
    if "cannot be" in (tmp_path / "log").read_text(errors="replace") and done.returncode:
        pytest.skip("JACK does not start here")
    assert done.returncode == 0, done.stderr
    came = [NoteOn(60, 100, 2), Bend(-1.0), ControlChange(64, 127), NoteOff(60, 2)]
    assert json.loads(done.stdout.splitlines()[-1]) == [repr(each) for each in came]
    assert "leaked" not in done.stderr


@pytest.mark.parametrize(
    ("text", "reported"),
    [(None, r"-m pip install supriya-midi"), ("raise RuntimeError('not built')", r"not built.*pip install")],
)
def test_a_package_that_cannot_be_loaded_has_its_remedy(monkeypatch, tmp_path, text, reported):
    monkeypatch.delitem(sys.modules, "supriya_midi", raising=False)
    if text is None:
        monkeypatch.setitem(sys.modules, "supriya_midi", None)
    else:
        (tmp_path / "supriya_midi.py").write_text(text)
        monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(MidiUnavailable, match=reported):
        load_backend()


@pytest.fixture
def library(monkeypatch: pytest.MonkeyPatch) -> types.SimpleNamespace:
    """A package whose port belongs to another program, as Windows has it; it notes what is asked."""

    class RtMidiError(Exception):
        pass

    def open_port(number: int) -> None:
        library.opened.append(number)
        if library.busy:
            raise RtMidiError("error creating Windows MM MIDI input port")

    def delete() -> None:
        library.deleted += 1

    def midi_in(api: int, name: str, queue: int) -> types.SimpleNamespace:
        library.systems.append(api)
        silent = {"get_message": lambda: None, "close_port": lambda: None}
        return types.SimpleNamespace(get_ports=lambda: library.ports, open_port=open_port, delete=delete, **silent)

    names = {1: "winmm", 2: "jack"}
    library = types.SimpleNamespace(ports=["Keys 0"], systems=[], opened=[], busy=True, deleted=0)
    library.RtMidiError, library.MidiIn = RtMidiError, midi_in
    library.get_api_name, library.get_compiled_apis = names.get, lambda: list(names)
    monkeypatch.setitem(sys.modules, "supriya_midi", library)
    return library


def test_a_busy_input_is_a_message_and_leaves_no_client_and_one_of_a_name_can_be_chosen(library):
    midi = MidiInput(lambda event: None)
    with pytest.raises(MidiUnavailable, match=r"Keys 0 cannot be opened \(error creating.*Another program"):
        midi.open("Keys 0")
    assert library.deleted == len(library.systems) == 2  # of the list of names, and of the try
    library.busy, library.ports = False, ["Keys", "Pads", "Keys", "Keys"]
    assert midi.names() == ["Keys", "Pads", "Keys #2", "Keys #3"]
    midi.open("Keys #2")
    assert (library.opened, midi.name, midi.look()) == ([0, 2], "Keys #2", "")
    for ports, words in (["Keys", "Pads"], "was disconnected"), (["Keys", "Keys"], "is connected again"):
        library.ports = ports
        assert f"Keys #2 {words}" in midi.look() and midi.look() == ""
    with pytest.raises(MidiUnavailable, match="Nobody:nothing is not connected"):
        midi.open("Nobody:nothing")
    midi.close()


@pytest.mark.parametrize(("name", "system"), [("", 1), ("jack", 2), ("oss", None)])
def test_a_variable_names_the_system(library, monkeypatch, name, system):
    monkeypatch.setenv(VARIABLE, name)
    if system is None:
        with pytest.raises(MidiUnavailable, match=r"LEARNED_STRINGS_MIDI is oss.*winmm, jack"):
            load_backend()
        return
    assert load_backend().get_input_names() == ["Keys 0"]
    assert library.systems == [system]


def test_noise_and_a_fault_cost_one_message_and_not_the_input(monkeypatch):
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


def test_messages_of_an_input_are_events_and_what_it_holds_is_released_when_it_closes():
    came, released, ports = list[Event](), list[Event](), list[Callable[[Sequence[int]], None]]()
    port = types.SimpleNamespace(connected=lambda: True, close=lambda: None)
    opened = lambda name, callback: ports.append(callback) or port  # noqa: E731
    system = types.SimpleNamespace(get_input_names=lambda: ["Keys"], open_input=opened)
    midi = MidiInput(came.append, lambda: system, released.append)
    midi.open("Keys")
    for message in (
        (0x90, 57, 90),
        (0xE0, 0x7F, 0x7F),
        (0xF8,),
        (0x91, 57, 0),
        (0xC0, 3),
        (0xA0, 3, 4),
        (0xB0, 121, 127),
    ):
        ports[0](message)
    assert came == [NoteOn(57, 90), Bend(1.0), NoteOff(57, 1), ControlChange(121, 0)] and released == []
    midi.close()
    assert released == release_all([0, 1])
    silent = types.SimpleNamespace(get_input_names=Mock(side_effect=OSError("gone")))
    with pytest.raises(MidiUnavailable, match=r"does not answer \(gone\)"):
        MidiInput(came.append, lambda: silent).names()


def test_a_taught_controller_goes_through_all_of_its_field():
    choices = MidiChoices()
    learned = [field for field in LEARNABLE if field in OF_CHOICES]
    for number, field in enumerate(learned, 16):
        choices = choices.learned(field, number)
    for number, field in enumerate(learned, 16):
        for value, expected in zip((0, 127), OF_CHOICES[field].limits, strict=True):
            turns = turns_of(ControlChange(number, value), choices, None)
            assert turns == {field: pytest.approx(expected)}
            Choices(**turns)  # allowed to the last bit
    assert OF_CHOICES["speed"].value(64 / 127) == pytest.approx(0.001**0.5, rel=0.05)


def test_a_controller_turns_every_parameter_and_macro_of_the_instrument_and_leaves_what_is_impossible():
    instrument = GUITAR.model_copy(update={"pickup": Pickup(points=(0.3, 0.7))})
    instrument = instrument.with_value("pluck.softest_mm", 0.001)  # which may not be above the hardest
    for field in (field for field in LEARNABLE if field in OF_INSTRUMENTS):
        choices = MidiChoices().learned(field, 16)
        turned = turns_of(ControlChange(16, 64), choices, instrument)["instrument"]
        assert turned.value(field) == pytest.approx(OF_INSTRUMENTS[field].value(64 / 127))
        assert turns_of(ControlChange(16, 64), choices, None) == {}
    soft = GUITAR.with_value("pluck.hardest_mm", 0.5)
    for field, instrument, expected in (
        ("macros.0", GUITAR, GUITAR.turned(0, 1.0)),
        ("macros.7", GUITAR, GUITAR),  # it has fewer
        ("pluck.softest_mm", soft, soft),
    ):
        assert (
            turns_of(ControlChange(16, 127), MidiChoices().learned(field, 16), instrument)["instrument"] == expected
        )


# A script of its own, which a fault or a deadlock would end:  python -m tests.app.playing.test_midi_input FOLDER


PATIENCE_S = 10.0


def until(done: Callable[[], object]) -> None:
    deadline_s = time.monotonic() + PATIENCE_S
    while not done() and time.monotonic() < deadline_s:
        time.sleep(0.005)


def tried(work: Callable[[], Any]) -> Any:
    """What `work` returns at last; JACK refuses a client while it starts, and now and then while it is busy."""
    deadline_s = time.monotonic() + PATIENCE_S
    while True:
        try:
            return work()
        except (OSError, MidiUnavailable):
            if time.monotonic() > deadline_s:
                raise
            time.sleep(0.05)


def virtual_output(name: str) -> Any:
    """An output that other programs find as an input."""
    import supriya_midi

    systems = {supriya_midi.get_api_name(api): api for api in supriya_midi.get_compiled_apis()}
    output = supriya_midi.MidiOut(systems[os.environ[VARIABLE]], "Learned Strings")
    try:
        return output.open_virtual_port(name)
    except (supriya_midi.RtMidiError, RuntimeError) as error:
        output.delete()
        raise OSError(str(error)) from error


def measured() -> list[Event]:
    """What came of four events, before an input was closed and opened under a stream of messages."""
    came, ended = list[Event](), threading.Event()
    midi, output = MidiInput(came.append), tried(lambda: virtual_output("hands"))

    def send(*events: Event) -> None:
        for event in events:
            output.send_message(message_of(event))

    def stream() -> None:
        while not ended.is_set():
            send(Bend(0.5))
            time.sleep(0.001)

    name = tried(lambda: next(each for each in midi.names() if each.endswith("hands")))
    tried(lambda: midi.open(name))
    until(lambda: send(Bend(0.0)) or came)  # until the server has connected them
    events = [NoteOn(60, 100, 2), Bend(-1.0), ControlChange(64, 127), NoteOff(60, 2)]
    send(*events)
    until(lambda: came[-4:] == events)
    found = came[-4:]
    streaming = threading.Thread(target=stream)
    streaming.start()
    try:
        for _ in range(10):
            midi.close()
            came.clear()
            tried(lambda: midi.open(name))
            until(lambda: came)
            assert came
        midi.close()
    finally:
        ended.set()
        streaming.join()
    output.delete()
    return found


def main(folder: str) -> None:
    faulthandler.dump_traceback_later(120, exit=True)
    server = f"play{os.getpid()}"
    os.environ |= {"JACK_DEFAULT_SERVER": server, "JACK_NO_START_SERVER": "1", VARIABLE: "jack"}
    options = "--no-realtime --sync --name {} -d dummy --rate 48000 --period 128"
    command = ["jackd", *options.format(server).split()]
    environment = {**os.environ, "JACK_NO_AUDIO_RESERVATION": "1"}
    with (Path(folder) / "log").open("wb") as log:
        process = subprocess.Popen(command, env=environment, stdout=log, stderr=log)
    try:
        load_backend()  # before RtMidi is imported: it finds the libjack of the system
        print(json.dumps([repr(event) for event in measured()]))
    finally:
        process.terminate()
        process.wait()


if __name__ == "__main__":
    main(sys.argv[1])
