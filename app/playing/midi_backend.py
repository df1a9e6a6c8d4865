"""The system's MIDI through RtMidi, which is loaded only when it is needed."""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any, Protocol

VARIABLE = "LEARNED_STRINGS_MIDI"
CLIENT = "Learned Strings"
QUEUE_MESSAGES = 4096
PERIOD_S = 0.001


class MidiUnavailable(Exception):
    """Why there is no MIDI, in plain words with the remedy."""


class OpenPort(Protocol):
    def close(self) -> None: ...


class Backend(Protocol):
    """A system for MIDI. Both raise OSError where it does not answer."""

    def get_input_names(self) -> list[str]: ...

    def open_input(self, name: str, *, callback: Callable[[Any], None]) -> OpenPort: ...


def load_backend() -> RtMidi:
    """The system's MIDI, or the one that LEARNED_STRINGS_MIDI names, as "jack".

    Raises:
        MidiUnavailable: RtMidi's package cannot be loaded, or has no such system.
    """
    if sys.platform == "linux":
        # RtMidi's package brings a libjack that newer servers refuse: the system's own, if any, is found first.
        with contextlib.suppress(OSError):
            ctypes.CDLL("libjack.so.0", mode=ctypes.RTLD_GLOBAL)
    try:
        import supriya_midi
    except Exception as error:  # a damaged package raises any kind
        raise MidiUnavailable(
            f"MIDI input needs the package supriya-midi, which cannot be loaded ({error}). "
            f"Install it with:  {sys.executable} -m pip install supriya-midi"
        ) from error
    systems = {supriya_midi.get_api_name(api): api for api in supriya_midi.get_compiled_apis()}
    name = os.environ.get(VARIABLE) or next(iter(systems))
    if name not in systems:
        raise MidiUnavailable(f"{VARIABLE} is {name}; set it to one of these, or unset it: {', '.join(systems)}.")
    return RtMidi(supriya_midi, systems[name])


class RtMidi:
    """One system for MIDI: ALSA, JACK, CoreMIDI or Windows'.

    Args:
        library: the package `supriya_midi`.
        api: RtMidi's number of the system.
    """

    def __init__(self, library: Any, api: Any) -> None:
        self._library, self._api = library, api

    def get_input_names(self) -> list[str]:
        """The inputs that are connected now. Raises OSError."""
        with self._faults():
            client = self._client()
            try:
                return list(client.get_ports())
            finally:
                client.delete()

    def open_input(self, name: str, *, callback: Callable[[Any], None]) -> RtMidiInput:
        """Opens an input; its messages go to `callback` as mido's, in a thread of its own. Raises OSError."""
        with self._faults():
            client = self._client()
            try:
                client.open_port(client.get_ports().index(name))
            except BaseException:
                client.delete()
                raise
            return RtMidiInput(client, callback)

    def virtual_output(self, name: str) -> Any:
        """An output that other programs find as an input: the library's `MidiOut`. Raises OSError."""
        with self._faults():
            output = self._library.MidiOut(self._api, CLIENT)
            try:
                return output.open_virtual_port(name)
            except BaseException:
                output.delete()
                raise

    def _client(self) -> Any:
        return self._library.MidiIn(self._api, CLIENT, QUEUE_MESSAGES)

    @contextlib.contextmanager
    def _faults(self) -> Iterator[None]:
        """Within, what RtMidi and its binding raise becomes an OSError."""
        try:
            yield
        except (self._library.RtMidiError, RuntimeError, ValueError) as error:
            raise OSError(str(error).strip()) from error


class RtMidiInput:
    """An open input. Its thread fetches messages from RtMidi's queue, within a millisecond.

    RtMidi could call Python from the driver's thread. There a message that arrives during `close` would wait for the
    interpreter, which waits for the driver's thread.
    """

    def __init__(self, client: Any, callback: Callable[[Any], None]) -> None:
        self._client, self._callback = client, callback
        self._open = True
        self._thread = threading.Thread(target=self._fetch, name="midi-input", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Closes the input; no message comes afterwards."""
        self._open = False
        self._thread.join()
        with contextlib.suppress(Exception):  # a device that is gone has nothing to close
            self._client.close_port()
        self._client.delete()

    def _fetch(self) -> None:
        from mido import Message

        while self._open:
            time.sleep(PERIOD_S)
            while self._open and (found := self._client.get_message()) is not None:
                try:
                    message = Message.from_bytes(found[0])
                except ValueError:  # no message of MIDI's, as a driver's noise
                    continue
                try:
                    self._callback(message)
                except Exception as error:  # is reported, and costs this message only
                    threading.excepthook(
                        threading.ExceptHookArgs((type(error), error, error.__traceback__, self._thread))
                    )
