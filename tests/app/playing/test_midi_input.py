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

import numpy as np
import pytest

from app.instruments.instrument import Damping, Pickup
from app.instruments.library import SHIPPED as INSTRUMENTS
from app.instruments.library import read_instrument
from app.player.events import Bend, ControlChange, Event, NoteOff, NoteOn, release_all
from app.player.midi_file import event_of, message_of
from app.playing.midi import MidiChoices, turns_of
from app.playing.midi_backend import VARIABLE, MidiUnavailable, RtMidi, RtMidiInput, load_backend
from app.playing.midi_port import MidiInput
from app.playing.notes import Notes
from app.playing.sources import Sources
from app.session.choices import Choices
from app.shared.parameters import LEARNABLE, OF_CHOICES, OF_INSTRUMENTS
from engine.values.ear import Ear
from tests.app.monitors import find_shipped, hears
from tests.app.player.stage import cents, level_db, pitch_hz

ROOT = Path(__file__).parents[3]
GUITAR = read_instrument(INSTRUMENTS / "classical_guitar.json")


@pytest.mark.skipif(shutil.which("jackd") is None, reason="no JACK server is installed")
def test_messages_come_through_jack_and_an_input_closes_while_they_stream(tmp_path):
    command = [sys.executable, "-m", "tests.app.playing.test_midi_input", str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=150)
    if "cannot be" in (tmp_path / "log").read_text(errors="replace") and done.returncode:
        pytest.skip("JACK does not start here")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    came = [NoteOn(60, 100, 2), Bend(-1.0), ControlChange(64, 127), NoteOff(60, 2)]
    assert found["came"] == [repr(each) for each in came]
    assert found["closed"] == 10 and found["streamed"]
    gone, back = [each for each in found["looks"] if each]
    assert found["looks"][0] == "" and "was disconnected" in gone and "is connected again" in back
    assert found["came again"] == repr(NoteOn(60, 100))
    assert "Nobody:nothing is not connected" in found["absent"]
    assert "does not answer" in found["no server"]
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
    library.ports = library.ports[:2]
    assert "Keys #2 was disconnected" in midi.look()
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


class Cable:
    """A system for MIDI of one input, in this process, whose messages a thread of its own delivers."""

    def __init__(self) -> None:
        self.get_input_names, self.connected = lambda: ["Keys"], lambda: True
        self.close = lambda: None

    def open_input(self, name: str, *, callback: Callable[[Sequence[int]], None]) -> "Cable":
        self._callback = callback
        return self

    def send(self, *message: int) -> None:
        thread = threading.Thread(target=self._callback, args=(message,))
        thread.start()
        thread.join()


def test_messages_of_an_input_are_heard(sound, wait):
    strings = {"polarisations": None, "sympathy_s_kg": 0.0, "damping": Damping(release_t60_s=0.15)}
    instrument = read_instrument(INSTRUMENTS / "steel_string_acoustic.json").model_copy(update=strings)
    notes, cable = Notes(sound, Sources(), find_shipped, lambda *report: pytest.fail(str(report))), Cable()
    notes.set_monitor(hears("model"))
    notes.set_instrument(instrument, Ear((0.3,)))
    wait(lambda: notes.keys.player is not None)
    released: list[object] = []
    midi = MidiInput(notes.handle, lambda: cable, lambda event: released.append(event) or notes.handle(event))

    def hear(seconds: float) -> np.ndarray:
        heard: np.ndarray = sound.mixer.render(round(48_000 * seconds))[:, 0].astype(np.float64)
        return heard

    def falls_db(*messages: Sequence[int]) -> float:
        """By how much after these, from one 40 ms to those that begin 60 ms later."""
        for message in messages:
            cable.send(*message)
        heard = hear(0.15)
        return level_db(heard, 0.02, 0.06) - level_db(heard, 0.08, 0.12)

    def send_key(*release: int) -> float:
        cable.send(0x90, 57, 90)
        hear(0.1)
        return falls_db(release)

    midi.open("Keys")
    cable.send(0x90, 57, 8)
    for high, semitones in ((0x40, 0.0), (0x7F, 2.0), (0x00, -2.0), (0x40, 0.0)):
        cable.send(0xE0, 0x7F if high == 0x7F else 0, high)
        wanted_hz = 220 * 2 ** (semitones / 12)
        assert abs(cents(pitch_hz(hear(1.0), wanted_hz), wanted_hz)) < 1.5
    assert falls_db((0x80, 57, 64)) > 15 and send_key(0x80, 57, 64) > 15 and send_key(0x90, 57, 0) > 15
    cable.send(0xB0, 64, 127)
    assert send_key(0x80, 57, 0) < 6 and falls_db((0xB0, 64, 0)) > 15 and send_key(0xB0, 120, 0) > 60
    assert falls_db((0x90, 57, 90)) < 6
    midi.close()
    assert falls_db() > 15 and released == release_all([0])
    notes.close()


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


def measured(backend: RtMidi) -> dict[str, Any]:
    came: list[Event] = []
    ended, found = threading.Event(), dict[str, Any]()
    midi, output = MidiInput(came.append), tried(lambda: virtual_output("hands"))

    def send(*events: Event) -> None:
        for event in events:
            output.send_message(message_of(event))

    def stream() -> None:
        while not ended.is_set():
            send(Bend(0.5))
            time.sleep(0.001)

    def port(ending: str) -> str:
        return next(each for each in midi.names() if each.endswith(ending))

    name = tried(lambda: port("hands"))
    tried(lambda: midi.open(name))
    until(lambda: send(Bend(0.0)) or came)  # until the server has connected them
    events = [NoteOn(60, 100, 2), Bend(-1.0), ControlChange(64, 127), NoteOff(60, 2)]
    send(*events)
    until(lambda: came[-4:] == events)
    found["came"] = [repr(event) for event in came[-4:]]
    streaming = threading.Thread(target=stream)
    streaming.start()
    try:
        for found["closed"] in range(1, 11):
            midi.close()
            came.clear()
            tried(lambda: midi.open(name))
        until(lambda: came)
        found["streamed"] = bool(came)
        midi.close()
    finally:
        ended.set()
        streaming.join()
    other = virtual_output("other")
    midi.open(port("other"))
    found["looks"] = [midi.look()]
    other.delete()
    until(lambda: found["looks"][-1] or found["looks"].append(midi.look()))
    found["looks"].append(midi.look())
    other = virtual_output("other")
    until(lambda: found["looks"][-1] or found["looks"].append(midi.look()))
    came.clear()
    until(lambda: other.send_message([0x90, 60, 100]) or came)
    found["came again"] = repr(came[0])
    try:
        midi.open("Nobody:nothing")
    except MidiUnavailable as error:
        found["absent"] = str(error)
    for each in (other, output):
        each.delete()
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
        found = measured(load_backend())
    finally:
        process.terminate()
        process.wait()
    try:
        MidiInput(print).names()
    except (MidiUnavailable, OSError) as error:
        found["no server"] = str(error)
    print(json.dumps(found))


if __name__ == "__main__":
    main(sys.argv[1])
