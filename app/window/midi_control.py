"""MIDI in the window: messages of the input become notes and new values of `Choices`; the dialog sets both up.

Messages come in mido's thread. Notes are played there, without the window; controllers reach the window's thread
through a queued signal.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtWidgets import QWidget

from app.instrument.events import Controller, Event, NoteOn, fixed_function
from app.patches.patch import Patch
from app.playing.keyboard import Reach
from app.playing.midi import MidiChoices, meaning_of
from app.playing.midi_port import Backend, MidiInput, MidiUnavailable, load_backend
from app.shared.parameters import LEARNABLE, OF_PATCHES, modulated_by
from app.views.dialogs.midi_dialog import MidiDialog


class MidiControl(QObject):
    """Lives in the window's thread; notes are played in mido's.

    Args:
        reach: the positions and amplitudes that notes pluck with; called in any thread.
        presets: the names that notes may select; called in any thread.
        play: plucks with new values of `Choices`; called in mido's thread.
        handle: plays an event as a pitch; False where there is no patch to play. Called in mido's thread.

    Attributes:
        choices: what is to be remembered.
    """

    performed = Signal(dict)  # new values of `Choices`, by a controller
    patch_turned = Signal(str, object)  # field and value of the patch, by the dialog
    told = Signal(str)  # an error, for the user
    _received = Signal(object)  # emitted in mido's thread

    def __init__(
        self,
        choices: MidiChoices,
        reach: Callable[[], Reach],
        presets: Callable[[], list[str]],
        play: Callable[[dict[str, Any]], None],
        handle: Callable[[Event], bool],
        parent: QObject | None = None,
        load: Callable[[], Backend] = load_backend,
    ) -> None:
        super().__init__(parent)
        self.choices = choices
        self._reach = reach
        self._presets = presets
        self._play, self._handle = play, handle
        self._learning: str | None = None  # the field to which the next controller is assigned
        self._dialog: MidiDialog | None = None
        self._patch: Patch | None = None
        self._received.connect(self._answer, Qt.ConnectionType.QueuedConnection)
        self.input = MidiInput(self._receive, load, handle)

    def start(self) -> None:
        """Opens the remembered input, if any; emits `told` where it cannot."""
        if self.choices.port:
            try:
                self.input.open(self.choices.port)
            except MidiUnavailable as error:
                self.told.emit(str(error))

    def close(self) -> None:
        self.input.close()

    # The dialog

    def show_dialog(self, window: QWidget) -> None:
        """Opens the dialog, which does not block the window, or brings it to the front."""
        if self._dialog is None:
            dialog = self._dialog = MidiDialog(
                {id: f"patch: {each.name}" if id in OF_PATCHES else each.name for id, each in LEARNABLE.items()},
                {each.id: each.name for each in modulated_by("wheel")},
                window,
            )
            dialog.patch_turned.connect(self.patch_turned)
            dialog.port_chosen.connect(self._choose_port)
            dialog.notes_chosen.connect(self._choose_notes)
            dialog.learn_asked.connect(self._learn)
            dialog.forget_asked.connect(lambda field: self._remember(self.choices.forgotten(field)))
            dialog.finished.connect(lambda _: self._learn(""))
        self._show_inputs()
        self._show_choices()
        self.show_patch(self._patch)
        self._dialog.show()
        self._dialog.raise_()

    def _show_inputs(self) -> None:
        assert self._dialog is not None
        try:
            self._dialog.show_inputs(self.input.names(), self.input.name, "")
            self._dialog.set_learnable("")
        except MidiUnavailable as error:
            self._dialog.show_inputs([], "", str(error))
            self._dialog.set_learnable(str(error))

    def _show_choices(self) -> None:
        if self._dialog is not None:
            controllers = {str(field): number for field, number in self.choices.controllers.items()}
            self._dialog.show_choices(self.choices.notes, controllers, self._learning)

    def show_patch(self, patch: Patch | None) -> None:
        """The patch that is played; None for none."""
        self._patch = patch
        if self._dialog is not None:
            self._dialog.set_patch_turnable(patch is not None)
            if patch is not None:
                self._dialog.show_patch(patch.mode, patch.bend_semitones, patch.bend_by, patch.mod_wheel)

    def _choose_port(self, name: str) -> None:
        assert self._dialog is not None
        problem = ""
        try:
            if name:
                self.input.open(name)
            else:
                self.input.close()
        except MidiUnavailable as error:
            problem = str(error)
        self._remember(self.choices.model_copy(update={"port": self.input.name}))
        if problem:
            self._dialog.show_problem(problem)

    def _choose_notes(self, mode: str) -> None:
        self.input.let_go()  # releases of what is held would no longer be played
        self._remember(self.choices.model_copy(update={"notes": mode}))

    def _learn(self, field: str) -> None:
        """Assigns the next controller that moves to `field`; "", or the same field again: ends waiting for one."""
        self._learning = field if field and field != self._learning else None
        if self._dialog is not None and self._learning is not None:
            self._dialog.show_problem("")
        self._show_choices()

    def _remember(self, choices: MidiChoices) -> None:
        self.choices = choices
        self._show_choices()

    # Messages

    def _receive(self, event: Event) -> None:
        """In mido's thread. Notes are played at once; an assigned controller waits for the window's thread.

        While a controller is waited for, one with a function of its own goes both ways.
        """
        if isinstance(event, Controller) and (
            self._learning is not None or event.number in self.choices.controllers.values()
        ):
            self._received.emit(event)
            if not fixed_function(event.number):
                return
        if self.choices.notes == "pitch" and self._handle(event):
            return
        if isinstance(event, NoteOn):
            self._play(meaning_of(event, self.choices, self._reach(), self._presets()).changes)

    def _answer(self, event: Event) -> None:
        """In the window's thread: assigns a controller that is waited for, and applies its value."""
        if self._learning is not None and isinstance(event, Controller):
            if does := fixed_function(event.number):
                if self._dialog is not None:
                    self._dialog.show_problem(f"Controller {event.number} {does}: move another control.")
                return
            field, self._learning = self._learning, None
            self._remember(self.choices.learned(field, event.number))
            if self._dialog is not None:
                self._dialog.show_problem("")
            self.input.let_go()  # it may be the modulation wheel, whose way back would no longer be played
        meaning = meaning_of(event, self.choices, self._reach(), self._presets(), self._patch)
        if meaning.changes:
            self.performed.emit(meaning.changes)
