"""MIDI in the window: messages of the input are events and new values of `Choices`; the dialog sets both up.

Messages come in the input's thread. Notes are played there, without the window; controllers reach the window's thread
through a queued signal.
"""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtWidgets import QWidget

from app.instruments.instrument import Instrument
from app.player.events import ControlChange, Event, NoteOn, fixed_function
from app.playing.midi import MidiChoices, turns_of
from app.playing.midi_backend import MidiUnavailable, RtMidi, load_backend
from app.playing.midi_port import MidiInput
from app.views.dialogs.midi_dialog import MidiDialog


class MidiControl(QObject):
    """MIDI control, which lives in the window's thread; notes are played in the input's.

    Args:
        handle: plays an event; called in the input's thread.
        play_note: plays a note that does not play a key of the instrument, by `MidiChoices.notes`; called there too.

    Attributes:
        choices: what is to be remembered.
    """

    performed = Signal(dict)  # new values for `Choices.changed`, by a controller or the dialog
    reported = Signal(str)  # an error, for the user
    informed = Signal(str)  # what went well
    _received = Signal(object)  # emitted in the input's thread

    def __init__(
        self,
        choices: MidiChoices,
        handle: Callable[[Event], object],
        play_note: Callable[[NoteOn, str], None],
        parent: QObject | None = None,
        load: Callable[[], RtMidi] = load_backend,
    ) -> None:
        super().__init__(parent)
        self.choices = choices
        self._handle, self._play_note = handle, play_note
        self._learning: str | None = None  # the field that waits for a controller to be assigned; None: none
        self._dialog: MidiDialog | None = None
        self._instrument: Instrument | None = None  # that is played; None: none
        self._received.connect(self._answer, Qt.ConnectionType.QueuedConnection)
        self.input = MidiInput(self._receive, load, handle)

    def start(self) -> None:
        """Open the remembered input, if any, now or when it is connected; emits `reported` where it cannot."""
        if self.choices.port:
            try:
                self.input.open(self.choices.port)
            except MidiUnavailable as error:
                self.reported.emit(str(error))

    def close(self) -> None:
        self.input.close()

    def look(self) -> None:
        """Follow an input that was disconnected, or is connected again; to be called once a second."""
        if not (happened := self.input.look()):
            return
        (self.informed if self.input.name else self.reported).emit(happened)
        if self._dialog is not None and self._dialog.isVisible():
            self._show_inputs()

    # The dialog

    def show_dialog(self, window: QWidget) -> None:
        """Open the dialog, which does not block the window, or bring it to the front."""
        if self._dialog is None:
            dialog = self._dialog = MidiDialog(window)
            dialog.instrument_turned.connect(self._turn_instrument)
            dialog.port_chosen.connect(self._choose_port)
            dialog.notes_chosen.connect(self._choose_notes)
            dialog.learn_asked.connect(self._learn)
            dialog.forget_asked.connect(lambda field: self._remember(self.choices.forgotten(field)))
            dialog.finished.connect(lambda _: self._learn(""))
        self._show_inputs()
        self._show_choices()
        self.show_instrument(self._instrument)
        self._dialog.show()
        self._dialog.raise_()

    def _show_inputs(self) -> None:
        assert self._dialog is not None
        try:
            self._dialog.show_inputs(self.input.names(), self.input.name, "")
        except MidiUnavailable as error:
            self._dialog.show_inputs([], "", str(error))

    def _show_choices(self) -> None:
        if self._dialog is not None:
            self._dialog.show_choices(self.choices, self._learning)

    def show_instrument(self, instrument: Instrument | None) -> None:
        """Show the instrument that is played; None for none."""
        self._instrument = instrument
        if self._dialog is not None:
            self._dialog.show_instrument(instrument)

    def _turn_instrument(self, field: str, value: object) -> None:
        if self._instrument is not None:
            self.performed.emit({"instrument": Instrument.model_validate({**dict(self._instrument), field: value})})

    def _choose_port(self, name: str) -> None:
        """Open an input and remember it; "": close the present one. Show in the dialog why it cannot be opened."""
        assert self._dialog is not None
        problem = ""
        try:
            if name:
                self.input.open(name)
            else:
                self.input.close()
        except MidiUnavailable as error:
            problem = str(error)
            self.input.close()  # it is not waited for
        self._remember(self.choices.model_copy(update={"port": self.input.name}))
        if problem:
            self._dialog.show_problem(problem)

    def _choose_notes(self, mode: str) -> None:
        self.input.release_all()  # releases of what is held would no longer be played
        self._remember(self.choices.model_copy(update={"notes": mode}))

    def _learn(self, field: str) -> None:
        """Assign the next controller that moves to `field`; "", or the same field again: ends waiting for one."""
        self._learning = field if field and field != self._learning else None
        if self._dialog is not None and self._learning is not None:
            self._dialog.show_problem("")
        self._show_choices()

    def _remember(self, choices: MidiChoices) -> None:
        self.choices = choices
        self._show_choices()

    # Messages

    def _receive(self, event: Event) -> None:
        """Receive an event in the input's thread.

        Notes are played at once; an assigned controller waits for the window's thread.

        While a controller is waited for, one with a function of its own goes both ways.
        """
        if isinstance(event, ControlChange) and (
            self._learning is not None or event.number in self.choices.controllers.values()
        ):
            self._received.emit(event)
            if not fixed_function(event.number):
                return
        if self.choices.notes == "pitch":
            self._handle(event)
        elif isinstance(event, NoteOn) and event.velocity > 0:
            self._play_note(event, self.choices.notes)

    def _answer(self, event: ControlChange) -> None:
        """Assign, in the window's thread, a controller that is waited for, and apply its value."""
        if self._learning is not None:
            if does := fixed_function(event.number):
                if self._dialog is not None:
                    self._dialog.show_problem(f"Controller {event.number} {does}: move another control.")
                return
            field, self._learning = self._learning, None
            self._remember(self.choices.learned(field, event.number))
            if self._dialog is not None:
                self._dialog.show_problem("")
            self.input.release_all()  # it may be the modulation wheel, whose way back would no longer be played
        if changes := turns_of(event, self.choices, self._instrument):
            self.performed.emit(changes)
