"""The input with a backend of our own in place of the system's, and what the window makes of it."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from typing import Any

import mido
import pytest
from PySide6.QtCore import QCoreApplication, Qt
from PySide6.QtWidgets import QComboBox, QPushButton, QWidget
from pytestqt.qtbot import QtBot

from app.instrument.events import Bend, Controller, Event, NoteOff, NoteOn, release_all
from app.patches.library import SHIPPED as PATCHES
from app.patches.library import read_patch
from app.patches.patch import Patch
from app.playing.midi import MidiChoices
from app.playing.midi_backend import MidiUnavailable
from app.playing.midi_port import MidiInput, same_device
from app.window.midi_control import MidiControl


class FakeBackend:
    """Two inputs; `send` speaks in a thread of its own, as the system's does."""

    def __init__(self) -> None:
        self.names = ["Keys:Keys 20:0", "Pads:Pads 24:0"]
        self.busy = False
        self.open_name = ""
        self._callback: Callable[[Any], None] | None = None

    def get_input_names(self) -> list[str]:
        return self.names

    def open_input(self, name: str, *, callback: Callable[[Any], None]) -> FakeBackend:
        if self.busy:
            raise OSError("resource busy")
        self.open_name, self._callback = name, callback
        return self

    def close(self) -> None:
        self.open_name, self._callback = "", None

    def connected(self) -> bool:
        return self.open_name in self.names

    def send(self, kind: str, **facts: int) -> None:
        callback = self._callback
        assert callback is not None
        thread = threading.Thread(target=callback, args=(mido.Message(kind, **facts).bytes(),))
        thread.start()
        thread.join()


def test_an_input_is_found_again_under_new_numbers() -> None:
    backend, heard = FakeBackend(), list[Event]()
    midi = MidiInput(heard.append, lambda: backend)
    midi.open("Pads:Pads 31:0")
    assert (midi.name, backend.open_name) == ("Pads:Pads 24:0", "Pads:Pads 24:0")
    backend.send("control_change", control=1, value=2, channel=0)
    backend.send("clock")
    assert heard == [Controller(1, 2)]
    midi.close()
    midi.close()
    assert (midi.name, backend.open_name) == ("", "")
    assert not same_device("Keys 1", "Keys 2")


def test_on_windows_an_input_is_found_again_at_another_place(monkeypatch: pytest.MonkeyPatch) -> None:
    """RtMidi ends names with the place in the list, which another device moves."""
    monkeypatch.setattr(sys, "platform", "win32")
    backend = FakeBackend()
    backend.names = ["Pads 0", "Keys 61 1"]
    midi = MidiInput(lambda event: None, lambda: backend)
    midi.open("Keys 61 1")
    backend.names = ["Keys 61 0"]
    assert "Keys 61 1 was disconnected" in midi.look()
    assert "Keys 61 0 is connected again" in midi.look()
    assert not same_device("Keys 61 0", "Keys 49 0")


def test_of_two_inputs_of_one_make_the_one_that_was_chosen_opens() -> None:
    backend = FakeBackend()
    backend.names = ["Keys:Keys MIDI 1 20:0", "Keys:Keys MIDI 1 24:0", "Keys:Keys MIDI 1 28:0"]
    midi = MidiInput(lambda event: None, lambda: backend)
    for name in backend.names:
        midi.open(name)
        assert (midi.name, backend.open_name) == (name, name)


def test_an_input_that_is_unplugged_releases_its_keys_and_comes_back_by_itself() -> None:
    backend, heard, released = FakeBackend(), list[Event](), list[Event]()
    midi = MidiInput(heard.append, lambda: backend, released.append)
    midi.open("Keys:Keys 20:0")
    backend.send("note_on", note=60, velocity=90, channel=2)
    assert midi.look() == ""
    backend.names = ["Pads:Pads 24:0"]
    assert "Keys:Keys 20:0 was disconnected" in midi.look()
    assert released == release_all([2])
    assert (midi.name, backend.open_name, midi.look()) == ("", "", "")
    backend.names = ["Pads:Pads 24:0", "Keys:Keys 31:0"]  # another number, as ALSA gives
    backend.busy = True
    assert midi.look() == ""
    backend.busy = False
    assert "Keys:Keys 31:0 is connected again" in midi.look()
    backend.send("note_on", note=62, velocity=90, channel=2)
    assert heard[-1] == NoteOn(62, 90, 2)
    midi.close()
    backend.names = []
    assert midi.look() == ""  # none is wanted


def test_faults_are_reported_in_plain_words() -> None:
    backend = FakeBackend()
    midi = MidiInput(lambda message: None, lambda: backend)
    with pytest.raises(MidiUnavailable, match="Strings is not connected"):
        midi.open("Strings")
    backend.busy = True
    with pytest.raises(MidiUnavailable, match="Another program"):
        midi.open("Keys:Keys 20:0")
    assert midi.name == ""


@pytest.fixture
def backend() -> FakeBackend:
    return FakeBackend()


Played = list[tuple[NoteOn, str, threading.Thread]]


@pytest.fixture
def played() -> Played:
    """Notes, and the threads that they were played in."""
    return []


def control(
    choices: MidiChoices,
    played: Played,
    load: Callable[[], FakeBackend],
    handle: Callable[[Event], object] = lambda event: None,
) -> MidiControl:
    def play_note(event: NoteOn, mode: str) -> None:
        played.append((event, mode, threading.current_thread()))

    return MidiControl(choices, handle, play_note, load=load)


@pytest.fixture
def midi(qtbot: QtBot, backend: FakeBackend, played: Played) -> MidiControl:
    return control(MidiChoices(port="Keys:Keys 9:0"), played, lambda: backend)


def test_a_note_is_played_at_once_in_the_thread_that_brings_it(
    qtbot: QtBot, midi: MidiControl, backend: FakeBackend, played: Played
) -> None:
    """The window may be busy with anything; it hears nothing of it here."""
    midi.start()
    midi._remember(midi.choices.model_copy(update={"notes": "position"}))
    with qtbot.assertNotEmitted(midi.performed, wait=50):
        backend.send("note_on", note=96, velocity=127, channel=0)
        ((event, mode, thread),) = played
        assert (event, mode) == (NoteOn(96, 127), "position")
        assert thread is not threading.main_thread()
        backend.send("note_on", note=96, velocity=0, channel=0)  # a key is released
        backend.send("note_off", note=96, velocity=64, channel=0)
    assert len(played) == 1


def test_keys_of_the_instrument_are_played_with_bends_pedals_and_releases(
    qtbot: QtBot, backend: FakeBackend, played: Played
) -> None:
    came: list[tuple[Event, bool]] = []

    def handle(event: Event) -> None:
        came.append((event, threading.current_thread() is threading.main_thread()))

    midi = control(MidiChoices(port="Keys"), played, lambda: backend, handle)
    backend.names = ["Keys"]
    midi.start()
    midi._remember(midi.choices.learned("width", 74))
    backend.send("note_on", note=60, velocity=90, channel=3)
    backend.send("pitchwheel", pitch=-8192, channel=3)
    backend.send("control_change", control=64, value=127, channel=3)
    backend.send("note_off", note=60, velocity=0, channel=3)
    with qtbot.waitSignal(midi.performed):
        backend.send("control_change", control=74, value=0, channel=3)  # taught: it turns what it was taught
    assert came == [
        (event, False) for event in (NoteOn(60, 90, 3), Bend(-1.0, 3), Controller(64, 127, 3), NoteOff(60, 3))
    ]
    assert played == []


@pytest.fixture
def came() -> list[Event]:
    """What the patch was given to play."""
    return []


@pytest.fixture
def heard(qtbot: QtBot, backend: FakeBackend, played: Played, came: list[Event]) -> Iterator[MidiControl]:
    """An input through which a patch is played, with the dialog open; a controller is assigned."""
    choices = MidiChoices(port="Keys:Keys 9:0", controllers={"width": 74})
    midi = control(choices, played, lambda: backend, came.append)
    window = QWidget()
    qtbot.addWidget(window)
    midi.start()
    midi.show_dialog(window)
    yield midi
    midi.close()


@pytest.mark.parametrize("change", ["another", "none", "close", "notes"])
def test_what_an_input_holds_is_let_go_with_it(
    heard: MidiControl, backend: FakeBackend, came: list[Event], change: str
) -> None:
    """And nothing of that is learned, or taken for a controller that somebody moved."""
    performed: list[dict[str, Any]] = []
    heard.performed.connect(performed.append)
    dialog = heard._dialog
    assert dialog is not None
    backend.send("note_on", note=60, velocity=90, channel=2)
    backend.send("pitchwheel", pitch=-8192, channel=2)
    dialog.learn_asked.emit("listen")
    came.clear()
    changes: dict[str, Callable[[], object]] = {
        "another": lambda: dialog.port_chosen.emit("Pads:Pads 24:0"),
        "none": lambda: dialog.port_chosen.emit(""),
        "close": heard.close,
        "notes": lambda: dialog.notes_chosen.emit("position"),
    }
    changes[change]()
    assert came == release_all([2])
    heard.close()
    assert came == release_all([2])
    QCoreApplication.processEvents()
    assert performed == []
    assert heard.choices.controllers == {"width": 74}


def test_a_wheel_that_is_assigned_while_it_is_turned_does_not_stay_there(
    qtbot: QtBot, heard: MidiControl, backend: FakeBackend, came: list[Event]
) -> None:
    backend.send("control_change", control=1, value=127, channel=1)
    assert came == [Controller(1, 127, 1)]
    heard._learn("listen")
    with qtbot.waitSignal(heard.performed):
        backend.send("control_change", control=1, value=127, channel=1)
    assert came[1:] == release_all([1])


@pytest.mark.parametrize("number", [64, 6, 101, 120, 123])
def test_a_controller_with_a_function_of_its_own_is_not_learned(
    qtbot: QtBot, heard: MidiControl, backend: FakeBackend, came: list[Event], number: int
) -> None:
    """It is played, the dialog says why it is not assigned, and another one is still waited for."""
    dialog = heard._dialog
    assert dialog is not None
    taught, learn, _ = dialog._rows["listen"]
    qtbot.mouseClick(learn, Qt.MouseButton.LeftButton)
    backend.send("control_change", control=number, value=127, channel=1)
    qtbot.waitUntil(lambda: f"Controller {number} " in dialog._problem.text())
    assert "move another" in dialog._problem.text()
    assert dialog._problem.isVisible()
    assert came == [Controller(number, 127, 1)]
    assert heard.choices.controllers == {"width": 74}
    assert learn.isChecked()
    with qtbot.waitSignal(heard.performed):
        backend.send("control_change", control=20, value=127, channel=1)
    assert heard.choices.controllers == {"width": 74, "listen": 20}
    assert taught.text() == "Controller 20"
    assert dialog._problem.text() == ""
    backend.send("control_change", control=number, value=0, channel=1)
    assert came[-1] == Controller(number, 0, 1)


def test_a_pedal_that_an_earlier_version_assigned_is_the_pedal(
    backend: FakeBackend, played: Played, came: list[Event]
) -> None:
    choices = MidiChoices.model_validate_json('{"port": "Keys:Keys 9:0", "controllers": {"width": 64, "listen": 7}}')
    midi = control(choices, played, lambda: backend, came.append)
    midi.start()
    backend.send("control_change", control=64, value=127, channel=0)
    assert came == [Controller(64, 127, 0)]
    assert midi.choices.controllers == {"listen": 7}
    midi.close()


def test_controllers_reach_the_windows_thread(
    qtbot: QtBot, midi: MidiControl, backend: FakeBackend, played: Played
) -> None:
    midi.start()
    midi._remember(midi.choices.learned("width", 74))
    threads = []
    midi.performed.connect(lambda changes: threads.append(threading.current_thread()))
    with qtbot.waitSignal(midi.performed) as performed:
        backend.send("control_change", control=74, value=0, channel=0)
    assert performed.args == [{"width": pytest.approx(0.02)}]
    assert threads == [threading.main_thread()]
    assert played == []


def test_learn_and_forget_in_the_dialog(qtbot: QtBot, midi: MidiControl, backend: FakeBackend) -> None:
    window = QWidget()
    qtbot.addWidget(window)
    midi.show_dialog(window)
    dialog = midi._dialog
    assert dialog is not None
    taught, learn, forget = dialog._rows["width"]
    assert not forget.isEnabled()
    dialog.port_chosen.emit("Pads:Pads 24:0")
    assert midi.choices.port == "Pads:Pads 24:0"
    qtbot.mouseClick(learn, Qt.MouseButton.LeftButton)
    assert "Move" in taught.text()
    with qtbot.waitSignal(midi.performed):
        backend.send("control_change", control=74, value=127, channel=0)
    assert midi.choices.controllers == {"width": 74}
    assert taught.text() == "Controller 74"
    with qtbot.waitSignal(midi.performed) as performed:
        backend.send("control_change", control=74, value=0, channel=0)
    assert performed.args == [{"width": pytest.approx(0.02)}]
    qtbot.mouseClick(forget, Qt.MouseButton.LeftButton)
    assert midi.choices.controllers == {}
    qtbot.mouseClick(learn, Qt.MouseButton.LeftButton)
    qtbot.mouseClick(learn, Qt.MouseButton.LeftButton)  # thought better of it
    assert not learn.isChecked()


def test_without_the_package_nothing_can_be_learned(qtbot: QtBot) -> None:
    """And the dialog says how to get it; with it, they can."""
    window, missing = QWidget(), True
    qtbot.addWidget(window)

    def load() -> FakeBackend:
        if missing:
            raise MidiUnavailable("Install it with: pip install supriya-midi")
        return FakeBackend()

    midi = control(MidiChoices(), [], load)
    midi.show_dialog(window)
    dialog = midi._dialog
    assert dialog is not None
    for _, learn, _ in dialog._rows.values():
        assert not learn.isEnabled()
        assert "pip install supriya-midi" in learn.toolTip()
    assert "pip install supriya-midi" in dialog._problem.text()
    missing = False
    midi.show_dialog(window)
    assert all(learn.isEnabled() for _, learn, _ in dialog._rows.values())
    assert "move a control" in dialog._rows["width"][1].toolTip()


def test_the_patch_says_what_channels_and_wheels_do(qtbot: QtBot, midi: MidiControl) -> None:
    window = QWidget()
    qtbot.addWidget(window)
    midi.show_dialog(window)
    dialog = midi._dialog
    assert dialog is not None
    assert not dialog._wheel.isEnabled()  # there is no patch
    patch = read_patch(PATCHES / "classical_guitar.json")
    hands = {"mode": "guitar", "bend_semitones": 2.5, "bend_by": "length", "mod_wheel": "knobs.decay"}
    midi.show_patch(patch.model_copy(update=hands))
    shown = [box.currentData() for box in (dialog._channels, dialog._bends, dialog._bends_by, dialog._wheel)]
    assert shown == ["guitar", 2.5, "length", "knobs.decay"]
    turned: list[Patch] = []
    midi.performed.connect(lambda changes: turned.append(changes["patch"]))
    for box, value in (
        (dialog._channels, "mpe"),
        (dialog._bends, 12.0),
        (dialog._bends_by, "tension"),
        (dialog._wheel, "pluck.position"),
    ):
        box.activated.emit(box.findData(value))
    found = [each.mode for each in turned], turned[1].bend_semitones, turned[2].bend_by, turned[3].mod_wheel
    assert found == (["mpe", "guitar", "guitar", "guitar"], 12.0, "tension", "pluck.position")
    boxes, buttons = dialog.findChildren(QComboBox), dialog.findChildren(QPushButton)
    assert [each.accessibleName() for each in (*boxes, *buttons) if not each.toolTip()] == []


def test_an_input_that_comes_and_goes_is_reported_and_shown(
    qtbot: QtBot, midi: MidiControl, backend: FakeBackend, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(midi._look_timer, "start", lambda: None)
    present, backend.names = backend.names, []
    with qtbot.waitSignal(midi.reported):
        midi.start()
    window = QWidget()
    qtbot.addWidget(window)
    midi.show_dialog(window)
    assert midi._dialog is not None
    backend.names = present
    with qtbot.waitSignal(midi.informed) as informed:
        midi._look()
    assert "Keys:Keys 20:0 is connected again" in informed.args[0]
    assert midi._dialog._inputs.currentText() == "Keys:Keys 20:0"
    backend.names = ["Pads:Pads 24:0"]
    with qtbot.waitSignal(midi.reported) as reported:
        midi._look()
    assert "disconnected" in reported.args[0]
    assert midi._dialog._inputs.currentText() == "None"
    assert midi.choices.port == "Keys:Keys 9:0"  # still remembered
    midi._dialog.port_chosen.emit("Strings")  # a wrong choice is not waited for
    backend.names = ["Strings"]
    with qtbot.assertNotEmitted(midi.informed, wait=10):
        midi._look()
    midi.close()


def test_an_input_that_is_gone_is_reported_and_kept(qtbot: QtBot, midi: MidiControl, backend: FakeBackend) -> None:
    backend.names = []
    with qtbot.waitSignal(midi.reported) as reported:
        midi.start()
    assert "not connected" in reported.args[0]
    assert midi.choices.port == "Keys:Keys 9:0"
    window = QWidget()
    qtbot.addWidget(window)
    midi.show_dialog(window)
    assert midi._dialog is not None
    assert midi._dialog._inputs.currentText() == "No MIDI input found"
