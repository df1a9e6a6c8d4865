"""A MIDI system of our own, in place of the computer's."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence

from app.player.events import Event, NoteOn
from app.player.midi_file import message_of
from app.views.dialogs.midi_dialog import MidiDialog
from tests.app.window.driver import CONTROL, KEY, Window

KEYS, PADS = "Keys:Keys 20:0", "Pads:Pads 24:0"


class FakeBackend:
    """Two inputs; `send` speaks in a thread of its own, as the system's does."""

    def __init__(self) -> None:
        self.names = [KEYS, PADS]
        self.busy = False
        self.open_name = ""
        self.callback: Callable[[Sequence[int]], None] | None = None

    def get_input_names(self) -> list[str]:
        return self.names

    def open_input(self, name: str, *, callback: Callable[[Sequence[int]], None]) -> FakeBackend:
        if self.busy:
            raise OSError("resource busy")
        self.open_name, self.callback = name, callback
        return self

    def close(self) -> None:
        self.open_name, self.callback = "", None

    def connected(self) -> bool:
        return self.open_name in self.names

    def send(self, *events: Event | Sequence[int]) -> None:
        """Send events, or the bytes of a message."""
        assert self.callback is not None
        for event in events:
            message = event if isinstance(event, bytes) else message_of(event)  # type: ignore[arg-type]
            thread = threading.Thread(target=self.callback, args=(message,))
            thread.start()
            thread.join()

    def play(self, w: Window, notes: str, *events: NoteOn) -> None:
        """Choose an input in the window's dialog, and what notes do; then send some."""
        w.key(KEY.Key_M, CONTROL)
        (dialog,) = w.window.findChildren(MidiDialog)
        dialog.port_chosen.emit(PADS)
        dialog.notes_chosen.emit(notes)
        self.send(*events)
