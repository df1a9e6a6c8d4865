"""MIDI in the window: inputs come and go, notes are played at once, and controllers are assigned in the dialog."""

import sys
import threading
from collections.abc import Callable
from typing import Any

import pytest
from PySide6.QtWidgets import QComboBox, QLabel, QPushButton, QWidget

from app.instruments.library import SHIPPED as INSTRUMENTS
from app.instruments.library import read_instrument
from app.player.events import Bend, ControlChange, Event, NoteOff, NoteOn, release_all
from app.playing.midi import MidiChoices
from app.playing.midi_backend import MidiUnavailable
from app.playing.midi_port import MidiInput, same_device
from app.views.dialogs.midi_dialog import MidiDialog
from app.window.midi_control import MidiControl
from tests.app.gestures import reported
from tests.app.window.conftest import KEYBOARD, PADS, FakeBackend
from tests.app.window.driver import LEFT, choose, find

LISTEN = "Assign a controller to listen"


def test_an_input_is_found_again_and_releases_its_keys(monkeypatch):
    backend, heard, released = FakeBackend(), list[Event](), list[Event]()
    midi = MidiInput(heard.append, lambda: backend, released.append)
    midi.open("Pads:Pads 31:0")
    assert (midi.name, backend.open_name) == (PADS, PADS)
    backend.send(ControlChange(1, 2), b"\xf8", NoteOn(60, 90, 2))  # the second is a clock
    assert heard == [ControlChange(1, 2), NoteOn(60, 90, 2)] and midi.look() == ""
    backend.names = [KEYBOARD]
    assert f"{PADS} was disconnected" in midi.look()
    assert released == release_all([0, 2])
    assert (midi.name, backend.open_name, midi.look()) == ("", "", "")
    backend.names = [KEYBOARD, "Pads:Pads 44:0"]  # another number, as ALSA gives
    for backend.busy, words in ((True, ""), (False, "Pads:Pads 44:0 is connected again")):
        assert words in midi.look() and bool(midi.name) == bool(words)
    backend.send(NoteOn(62, 90, 2))
    assert heard[-1] == NoteOn(62, 90, 2)
    with pytest.raises(MidiUnavailable, match="Strings is not connected"):
        midi.open("Strings")
    backend.busy = True
    with pytest.raises(MidiUnavailable, match="Another program"):
        midi.open(KEYBOARD)
    assert midi.name == ""
    backend.busy = False
    assert not same_device("Keys 1", "Keys 2")
    monkeypatch.setattr(sys, "platform", "win32")  # names end with the place in the list, which another device moves
    backend.names = ["Pads 0", "Keys 61 1"]
    midi.open("Keys 61 1")
    backend.names = ["Keys 61 0"]
    assert "Keys 61 1 was disconnected" in midi.look()
    assert "Keys 61 0 is connected again" in midi.look() and not same_device("Keys 61 0", "Keys 49 0")


class Desk:
    """The control with its dialog, and what it has played and said."""

    def __init__(self, window: QWidget, **choices: Any) -> None:
        self.backend, self.window = FakeBackend(), window
        self.came: list[Event] = []
        self.played: list[tuple[NoteOn, str]] = []
        self.threads: list[threading.Thread] = []

        def handle(event: Event) -> None:
            self.came.append(event)
            self.threads.append(threading.current_thread())

        chosen = MidiChoices(**{"port": "Keys:Keys 9:0", **choices})
        played = lambda event, mode: self.played.append((event, mode))  # noqa: E731
        self.midi = MidiControl(chosen, handle, played, load=lambda: self.backend)
        self.said = reported(self.midi.reported, self.midi.informed)
        self.performed = reported(self.midi.performed)
        self.midi.start()
        self.midi.show_dialog(window)
        (self.dialog,) = window.findChildren(MidiDialog)

    def words(self) -> str:
        return "\n".join(each.text() for each in self.dialog.findChildren(QLabel) if each.isVisible())


@pytest.fixture
def desk(qtbot) -> Callable[..., Desk]:
    def make(**choices: Any) -> Desk:
        window = QWidget()
        made = Desk(window, **choices)
        qtbot.addWidget(window, before_close_func=lambda _: made.midi.close())
        return made

    return make


def test_notes_are_played_in_the_thread_that_brings_them(qtbot, desk):
    """The window may be busy with anything; a taught controller turns what it was taught, and is not played."""
    keys = desk(controllers={"width": 74})
    events = [NoteOn(60, 90, 3), Bend(-1.0, 3), ControlChange(64, 127, 3), NoteOff(60, 3)]
    keys.backend.send(*events)
    assert keys.came == events and keys.performed == keys.played == []
    assert threading.main_thread() not in keys.threads
    keys.backend.send(ControlChange(74, 0, 3))
    qtbot.waitUntil(lambda: keys.performed == [{"width": pytest.approx(0.02)}])
    assert keys.came == events
    choose(find(keys.dialog, QComboBox, "MIDI notes control"), "position")
    del keys.came[:]
    keys.backend.send(NoteOn(96, 127), NoteOn(96, 0), NoteOff(96))
    assert (keys.played, keys.came) == ([(NoteOn(96, 127), "position")], [])


RELEASES: dict[str, Callable[[Desk], object]] = {
    "another": lambda keys: keys.dialog.port_chosen.emit(PADS),
    "none": lambda keys: keys.dialog.port_chosen.emit(""),
    "close": lambda keys: keys.midi.close(),
    "notes": lambda keys: keys.dialog.notes_chosen.emit("position"),
}


@pytest.mark.parametrize("release", RELEASES.values(), ids=RELEASES)
def test_keys_that_an_input_holds_are_released_with_it(desk, release):
    keys = desk()
    keys.backend.send(NoteOn(60, 90, 2), Bend(-1.0, 2))
    keys.came.clear()
    release(keys)
    assert keys.came == release_all([2])
    keys.midi.close()
    assert keys.came == release_all([2])


@pytest.mark.parametrize("number", [64, 101, 123])
def test_a_controller_is_learned_unless_it_has_a_function(qtbot, desk, number):
    """The dialog says why, and another one is still waited for; a pedal that an earlier version assigned is one."""
    choices = MidiChoices.model_validate_json(f'{{"controllers": {{"width": {number}, "volume_db": 7}}}}')
    keys = desk(controllers=choices.controllers)
    learn, forget = find(keys.dialog, QPushButton, LISTEN), find(keys.dialog, QPushButton, "Unassign listen")
    assert not forget.isEnabled()
    keys.backend.send(ControlChange(1, 127, 1))  # a wheel that is assigned while it is turned does not stay there
    qtbot.mouseClick(learn, LEFT)
    assert "Move a control …" in keys.words()
    keys.backend.send(ControlChange(number, 127, 1))
    qtbot.waitUntil(lambda: f"Controller {number} " in keys.words() and "move another" in keys.words())
    assert keys.midi.choices.controllers == {"volume_db": 7} and learn.isChecked()
    keys.backend.send(ControlChange(1, 127, 1))
    qtbot.waitUntil(lambda: keys.midi.choices.controllers == {"volume_db": 7, "listen": 1})
    assert "Controller 1" in keys.words() and "move another" not in keys.words()
    assert keys.came == [ControlChange(1, 127, 1), ControlChange(number, 127, 1), *release_all([1])]
    keys.backend.send(ControlChange(number, 0, 1))
    assert keys.came[-1] == ControlChange(number, 0, 1)
    qtbot.mouseClick(forget, LEFT)
    assert keys.midi.choices.controllers == {"volume_db": 7}


def test_inputs_and_instrument_are_shown(qtbot, desk, monkeypatch):
    keys = desk(port="Strings")
    box = find(keys.dialog, QComboBox, "MIDI input")
    assert "not connected" in keys.said[0]
    for names, words, shown in (
        (["Strings", PADS], "Strings is connected again", "Strings"),
        ([PADS], "disconnected", "None"),
    ):
        keys.backend.names = names
        keys.midi.look()
        assert words in keys.said[-1] and box.currentText() == shown
    assert keys.midi.choices.port == "Strings"
    keys.dialog.port_chosen.emit("Wind")  # a wrong choice is not waited for
    before, keys.backend.names = len(keys.said), ["Wind"]
    keys.midi.look()
    assert len(keys.said) == before
    boxes = [find(keys.dialog, QComboBox, name) for name in ("Channels", "Bend range", "Pitch bend", "Modulation")]
    assert not boxes[3].isEnabled(), "there is no instrument"
    hands = {"mode": "guitar", "bend_semitones": 2.5, "bend_by": "length", "mod_wheel": "knobs.decay"}
    keys.midi.show_instrument(read_instrument(INSTRUMENTS / "classical_guitar.json").model_copy(update=hands))
    assert [each.currentData() for each in boxes] == list(hands.values())
    for field, each, value in zip(hands, boxes, ("mpe", 12.0, "tension", "pluck.position"), strict=True):
        choose(each, value)
        assert getattr(keys.performed[-1]["instrument"], field) == value
