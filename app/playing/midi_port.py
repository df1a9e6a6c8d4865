"""The MIDI input that a player has chosen, and what its keys hold."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Sequence

from app.player.events import Event, channels_in, event_of, release_all
from app.playing.midi_backend import MidiUnavailable, RtMidi, RtMidiInput, load_backend


class MidiInput:
    """A MIDI input with at most one open port. All is called by one thread.

    Args:
        on_message: is called with the event of each message, in the input's thread.
        load: loads the system's MIDI, when it is needed first.
        on_release_all: is called with the events that release what came, in the thread of `release_all`,
            `close` or `open`.
    """

    def __init__(
        self,
        on_message: Callable[[Event], None],
        load: Callable[[], RtMidi] = load_backend,
        on_release_all: Callable[[Event], object] = lambda event: None,
    ) -> None:
        self._on_message = on_message
        self._on_release_all = on_release_all
        self._load = load
        self._backend: RtMidi | None = None
        self._port: RtMidiInput | None = None
        self._channels: set[int] = set()  # on which events came since the last `release_all`
        self.name = ""  # of the open input; "": none is
        self._awaited = ""  # name of the input that `look` opens once it is connected; "": none

    def names(self) -> list[str]:
        """The inputs that are connected now.

        Raises:
            MidiUnavailable: no backend, or the system's MIDI does not answer.
        """
        try:
            return self._load_backend().get_input_names()
        except OSError as error:
            raise MidiUnavailable(f"The system's MIDI does not answer ({error}).") from error

    def open(self, name: str) -> None:
        """Open the input of that name, else one of the same device, and close any other, whose keys are released.

        One that cannot be opened is tried again by `look`, until `close`.

        Raises:
            MidiUnavailable: no backend, no such input, or another program has it.
        """
        self.close()
        self._awaited = name
        names = self.names()
        port_name = name if name in names else next((other for other in names if same_device(other, name)), None)
        if port_name is None:
            raise MidiUnavailable(f"The MIDI input {name} is not connected. Connect it, or choose another.")
        try:
            self._port = self._load_backend().open_input(port_name, callback=self._receive)
        except OSError as error:
            raise MidiUnavailable(
                f"The MIDI input {port_name} cannot be opened ({error}). Another program may be using it."
            ) from error
        self.name, self._awaited = port_name, ""

    def look(self) -> str:
        """Release the keys of an input that was disconnected, and open it when it is back; to be called often.

        Returns: what happened, for the player; "" for nothing.
        """
        if self._port is not None and not self._port.connected():
            name = self.name
            self.close()
            self._awaited = name
            return f"The MIDI input {name} was disconnected. It is played again as soon as it is connected."
        if not self._awaited:
            return ""
        name = self._awaited
        try:
            self.open(name)
        except MidiUnavailable:
            return ""
        return f"The MIDI input {self.name} is connected again."

    def close(self) -> None:
        """Close the input, if one is open, and let its keys go; may be called again."""
        port = self._port
        self._port = None
        self.name = ""
        self._awaited = ""
        if port is not None:
            port.close()
        self.release_all()

    def release_all(self) -> None:
        """Release the keys that are held through the input, and leave its wheels and pedals at rest."""
        channels, self._channels = self._channels, set()
        for event in release_all(channels):
            self._on_release_all(event)

    def _load_backend(self) -> RtMidi:
        if self._backend is None:
            self._backend = self._load()
        return self._backend

    def _receive(self, message: Sequence[int]) -> None:
        event = event_of(message)
        if event is not None:
            self._channels |= channels_in([event])
            self._on_message(event)


def same_device(one: str, other: str) -> bool:
    """Return True if two names differ only in the system's numbers, which change with what else is connected."""
    return _without_numbers(one) == _without_numbers(other)


def _without_numbers(name: str) -> str:
    """The name without RtMidi's ending: the port's place on Windows ("Keys 1"), ALSA's numbers ("Keys:Keys 20:0")."""
    return re.sub({"win32": r"\s+\d+$"}.get(sys.platform, r"\s+\d+:\d+$"), "", name)
