"""MIDI in the window: inputs come and go, notes are played at once, and controllers are assigned in the dialog."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from PySide6.QtCore import QCoreApplication
from PySide6.QtWidgets import QComboBox, QLabel, QPushButton, QWidget
from pytestqt.qtbot import QtBot

from app.instruments.library import SHIPPED as INSTRUMENTS
from app.instruments.library import read_instrument
from app.player.events import Bend, ControlChange, Event, NoteOff, NoteOn, release_all
from app.playing.midi import MidiChoices
from app.playing.midi_backend import MidiUnavailable
from app.playing.midi_port import MidiInput, same_device
from app.views.dialogs.midi_dialog import MidiDialog
from app.window.midi_control import MidiControl
from app.window.settings import load_settings
from tests.app.window.driver import CONTROL, KEY, LEFT, Window, choose, find
from tests.app.window.midi import KEYS, PADS, FakeBackend

WIDTH, LISTEN = "Assign a controller to pluck width", "Assign a controller to listen"


def test_an_input_is_found_again_under_new_numbers_and_faults_are_in_plain_words(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    backend, heard, released = FakeBackend(), list[Event](), list[Event]()
    midi = MidiInput(heard.append, lambda: backend, released.append)
    midi.open("Pads:Pads 31:0")
    assert (midi.name, backend.open_name) == (PADS, PADS)
    backend.send(ControlChange(1, 2), b"\xf8")  # the latter is a clock
    assert heard == [ControlChange(1, 2)]
    with pytest.raises(MidiUnavailable, match="Strings is not connected"):
        midi.open("Strings")
    backend.busy = True
    with pytest.raises(MidiUnavailable, match="Another program"):
        midi.open(KEYS)
    assert midi.name == ""
    backend.busy = False
    backend.names = ["Keys:Keys MIDI 1 20:0", "Keys:Keys MIDI 1 24:0", "Keys:Keys MIDI 1 28:0"]
    for name in backend.names:  # of one make
        midi.open(name)
        assert (midi.name, backend.open_name) == (name, name)
    midi.close()
    midi.close()
    assert (midi.name, backend.open_name) == ("", "") and not same_device("Keys 1", "Keys 2")
    monkeypatch.setattr(sys, "platform", "win32")  # names end with the place in the list, which another device moves
    backend.names = ["Pads 0", "Keys 61 1"]
    midi.open("Keys 61 1")
    backend.names = ["Keys 61 0"]
    assert "Keys 61 1 was disconnected" in midi.look()
    assert "Keys 61 0 is connected again" in midi.look()
    assert not same_device("Keys 61 0", "Keys 49 0")


def test_an_input_that_is_unplugged_releases_its_keys_and_comes_back_by_itself() -> None:
    backend, heard, released = FakeBackend(), list[Event](), list[Event]()
    midi = MidiInput(heard.append, lambda: backend, released.append)
    midi.open(KEYS)
    backend.send(NoteOn(60, 90, 2))
    assert midi.look() == ""
    backend.names = [PADS]
    assert f"{KEYS} was disconnected" in midi.look()
    assert released == release_all([2])
    assert (midi.name, backend.open_name, midi.look()) == ("", "", "")
    backend.names = [PADS, "Keys:Keys 31:0"]  # another number, as ALSA gives
    backend.busy = True
    assert midi.look() == ""
    backend.busy = False
    assert "Keys:Keys 31:0 is connected again" in midi.look()
    backend.send(NoteOn(62, 90, 2))
    assert heard[-1] == NoteOn(62, 90, 2)
    midi.close()
    backend.names = []
    assert midi.look() == "", "none is wanted"


class Desk:
    """The control with its dialog, and what it has played and said."""

    def __init__(self, backend: FakeBackend, choices: MidiChoices, window: QWidget) -> None:
        self.backend, self.window = backend, window
        self.came: list[Event] = []
        self.played: list[tuple[NoteOn, str]] = []
        self.threads: list[threading.Thread] = []
        self.said: list[str] = []
        self.performed: list[dict[str, Any]] = []

        def handle(event: Event) -> None:
            self.came.append(event)
            self.threads.append(threading.current_thread())

        def play_note(event: NoteOn, mode: str) -> None:
            self.played.append((event, mode))
            self.threads.append(threading.current_thread())

        self.midi = MidiControl(choices, handle, play_note, load=lambda: backend)
        self.midi.reported.connect(self.said.append)
        self.midi.informed.connect(self.said.append)
        self.midi.performed.connect(self.performed.append)
        self.midi.start()
        self.midi.show_dialog(window)
        (self.dialog,) = window.findChildren(MidiDialog)

    def words(self) -> list[str]:
        return [label.text() for label in self.dialog.findChildren(QLabel) if label.isVisible() and label.text()]


@pytest.fixture
def desk(qtbot: QtBot, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Desk]]:
    made: list[Desk] = []

    def make(names: tuple[str, ...] = (KEYS, PADS), **choices: Any) -> Desk:
        window, backend = QWidget(), FakeBackend()
        qtbot.addWidget(window)
        backend.names = list(names)
        made.append(Desk(backend, MidiChoices(**{"port": "Keys:Keys 9:0", **choices}), window))
        return made[-1]

    yield make
    for each in made:
        each.midi.close()


def test_notes_are_played_at_once_in_the_thread_that_brings_them_and_controllers_in_the_windows(
    qtbot: QtBot, desk: Callable[..., Desk]
) -> None:
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


@pytest.mark.parametrize("change", ["another", "none", "close", "notes"])
def test_keys_that_an_input_holds_are_released_with_it(desk: Callable[..., Desk], change: str) -> None:
    """And nothing of that is learned, or taken for a controller that somebody moved."""
    keys = desk(controllers={"width": 74})
    keys.backend.send(NoteOn(60, 90, 2), Bend(-1.0, 2))
    find(keys.dialog, QPushButton, LISTEN).click()
    keys.came.clear()
    changes: dict[str, Callable[[], object]] = {
        "another": lambda: keys.dialog.port_chosen.emit(PADS),
        "none": lambda: keys.dialog.port_chosen.emit(""),
        "close": keys.midi.close,
        "notes": lambda: keys.dialog.notes_chosen.emit("position"),
    }
    changes[change]()
    assert keys.came == release_all([2])
    keys.midi.close()
    assert keys.came == release_all([2])
    QCoreApplication.processEvents()
    assert keys.performed == [] and keys.midi.choices.controllers == {"width": 74}


def test_a_controller_is_learned_in_the_dialog_and_forgotten_there(qtbot: QtBot, desk: Callable[..., Desk]) -> None:
    keys = desk()
    learn, forget = find(keys.dialog, QPushButton, WIDTH), find(keys.dialog, QPushButton, "Unassign pluck width")
    assert not forget.isEnabled()
    keys.backend.send(ControlChange(1, 127, 1))  # a wheel that is assigned while it is turned does not stay there
    qtbot.mouseClick(learn, LEFT)
    assert "Move a control …" in keys.words()
    keys.backend.send(ControlChange(1, 127, 1))
    qtbot.waitUntil(lambda: keys.midi.choices.controllers == {"width": 1} and len(keys.performed) == 1)
    assert keys.came == [ControlChange(1, 127, 1), *release_all([1])] and "Controller 1" in keys.words()
    qtbot.mouseClick(forget, LEFT)
    assert keys.midi.choices.controllers == {}
    for waits in (True, False):  # thought better of it
        qtbot.mouseClick(learn, LEFT)
        assert learn.isChecked() == waits


def test_an_input_that_comes_and_goes_is_reported_shown_and_remembered(
    qtbot: QtBot, desk: Callable[..., Desk]
) -> None:
    keys = desk(names=())
    box = find(keys.dialog, QComboBox, "MIDI input")
    assert "not connected" in keys.said[0] and box.currentText() == "No MIDI input found"
    for names, words, shown in (([KEYS, PADS], f"{KEYS} is connected again", KEYS), ([PADS], "disconnected", "None")):
        keys.backend.names = names
        keys.midi.look()
        qtbot.waitUntil(lambda words=words: words in keys.said[-1])
        qtbot.waitUntil(lambda shown=shown: box.currentText() == shown)
    assert keys.midi.choices.port == "Keys:Keys 9:0"
    keys.dialog.port_chosen.emit("Strings")  # a wrong choice is not waited for
    before, keys.backend.names = len(keys.said), ["Strings"]
    keys.midi.look()
    assert len(keys.said) == before


@pytest.mark.parametrize("number", [64, 101, 123])
def test_a_controller_with_a_function_of_its_own_is_played_and_not_learned(
    qtbot: QtBot, desk: Callable[..., Desk], number: int
) -> None:
    """The dialog says why, and another one is still waited for; a pedal that an earlier version assigned is one."""
    choices = MidiChoices.model_validate_json(f'{{"controllers": {{"width": {number}, "volume_db": 7}}}}')
    keys = desk(controllers=choices.controllers)
    learn = find(keys.dialog, QPushButton, LISTEN)
    qtbot.mouseClick(learn, LEFT)
    keys.backend.send(ControlChange(number, 127, 1))
    qtbot.waitUntil(lambda: any(f"Controller {number} " in each and "move another" in each for each in keys.words()))
    assert keys.came == [ControlChange(number, 127, 1)]
    assert keys.midi.choices.controllers == {"volume_db": 7} and learn.isChecked()
    keys.backend.send(ControlChange(20, 127, 1))
    qtbot.waitUntil(lambda: keys.midi.choices.controllers == {"volume_db": 7, "listen": 20})
    assert "Controller 20" in keys.words() and not any("move another" in each for each in keys.words())
    keys.backend.send(ControlChange(number, 0, 1))
    assert keys.came[-1] == ControlChange(number, 0, 1)


def test_the_instrument_says_what_channels_and_wheels_do_and_without_the_package_nothing_is_learned(
    desk: Callable[..., Desk], monkeypatch: pytest.MonkeyPatch
) -> None:
    keys = desk()
    boxes = [find(keys.dialog, QComboBox, name) for name in ("Channels", "Bend range", "Pitch bend", "Modulation")]
    assert not boxes[3].isEnabled(), "there is no instrument"
    hands = {"mode": "guitar", "bend_semitones": 2.5, "bend_by": "length", "mod_wheel": "knobs.decay"}
    keys.midi.show_instrument(read_instrument(INSTRUMENTS / "classical_guitar.json").model_copy(update=hands))
    assert [box.currentData() for box in boxes] == list(hands.values())
    for (field, _), box, value in zip(hands.items(), boxes, ("mpe", 12.0, "tension", "pluck.position"), strict=True):
        choose(box, value)
        assert getattr(keys.performed[-1]["instrument"], field) == value
    learns = [each for each in keys.dialog.findChildren(QPushButton) if each.accessibleName().startswith("Assign")]

    def missing() -> list[str]:
        raise MidiUnavailable("Install it with: pip install supriya-midi")

    for names, enabled, tip in ((missing, False, "pip install"), (lambda: [KEYS], True, "move a control")):
        monkeypatch.setattr(keys.midi.input, "names", names)
        keys.midi.show_dialog(keys.window)
        assert all(learn.isEnabled() == enabled and tip in learn.toolTip() for learn in learns)
        assert any("pip install supriya-midi" in each for each in keys.words()) is not enabled


def test_midi_plays_the_window_and_what_it_learned_is_saved(backend: FakeBackend, lab: Window, tmp_path: Any) -> None:
    lab.wait_for_take()
    lab.key(KEY.Key_M, CONTROL)
    (dialog,) = lab.window.findChildren(MidiDialog)
    assert dialog.isVisible()
    choose(find(dialog, QComboBox, "MIDI input"), KEYS)
    before = lab.choices
    backend.send(NoteOn(96, 127))
    (note,) = lab.struck
    assert (note.request.pluck.position, note.request.pluck.amplitude_mm) == pytest.approx((0.7, 10))
    assert lab.choices.position == before.position, "the window has had no time yet"
    lab.wait(lambda: (lab.choices.position, lab.choices.amplitude_mm) == pytest.approx((0.7, 10)))
    assert not lab.session.undo_words
    lab.wait(lambda: lab.performance.position_s > 0)
    find(dialog, QPushButton, WIDTH).click()
    backend.send(ControlChange(74, 0))
    lab.wait(lambda: lab.choices.width == pytest.approx(0.02))
    lab.close()
    assert load_settings(tmp_path / "settings.json")[0].midi == MidiChoices(port=KEYS, controllers={"width": 74})
