"""The system's MIDI through RtMidi, which is loaded only when it is needed."""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

VARIABLE = "LEARNED_STRINGS_MIDI"
CLIENT = "Learned Strings"
QUEUE_MESSAGES = 4096  # that RtMidi holds until they are fetched
PERIOD_S = 0.001  # between two looks at its queue


class MidiUnavailable(Exception):
    """The error that there is no MIDI, in plain words with the remedy."""


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
    """A system for MIDI: ALSA, JACK, CoreMIDI or Windows'. Its methods raise OSError where it does not answer.

    Args:
        library: the package `supriya_midi`.
        api: RtMidi's number of the system.
    """

    def __init__(self, library: Any, api: Any) -> None:
        self._library, self._api = library, api

    def get_input_names(self) -> list[str]:
        """The inputs that are connected now, no two of one name. Raises OSError."""
        with self._faults():
            client = self._client()
            try:
                return _number_duplicates(client.get_ports())
            finally:
                client.delete()

    def open_input(self, name: str, *, callback: Callable[[Sequence[int]], None]) -> RtMidiInput:
        """Open an input; the bytes of its messages go to `callback`, in a thread of its own. Raises OSError."""
        with self._faults():
            client = self._client()
            try:
                client.open_port(_number_duplicates(client.get_ports()).index(name))
            except BaseException:
                client.delete()
                raise
            return RtMidiInput(client, name, callback)

    def _client(self) -> Any:
        return self._library.MidiIn(self._api, CLIENT, QUEUE_MESSAGES)

    @contextlib.contextmanager
    def _faults(self) -> Iterator[None]:
        """Turn what RtMidi and its binding raise within it into an OSError."""
        try:
            yield
        except (self._library.RtMidiError, RuntimeError, ValueError) as error:
            raise OSError(str(error).strip()) from error


def _number_duplicates(names: Iterable[str]) -> list[str]:
    """Names of ports; further ones of the same name are numbered, as some systems do not."""
    distinct_names: list[str] = []
    for name in names:
        number, distinct = 1, name
        while distinct in distinct_names:
            number += 1
            distinct = f"{name} #{number}"
        distinct_names.append(distinct)
    return distinct_names


class RtMidiInput:
    """An open input. Its thread fetches messages from RtMidi's queue, within a millisecond.

    RtMidi could call Python from the driver's thread. There a message that arrives during `close` would wait for the
    interpreter, which waits for the driver's thread.
    """

    def __init__(self, client: Any, name: str, callback: Callable[[Sequence[int]], None]) -> None:
        self._client = client
        self._name = name
        self._callback = callback
        self._open = True
        self._thread = threading.Thread(target=self._fetch, name="midi-input", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Close the input; no message comes afterwards."""
        self._open = False
        self._thread.join()
        with contextlib.suppress(Exception):  # a device that is gone has nothing to close
            self._client.close_port()
        self._client.delete()

    def connected(self) -> bool:
        """Return True if its device is still there. No other client of the system is needed to ask."""
        try:
            return self._name in _number_duplicates(self._client.get_ports())
        except Exception:  # the system itself is gone
            return False

    def _fetch(self) -> None:
        """Pass the messages of RtMidi's queue on to the callback, until `close`; in the thread."""
        while self._open:
            time.sleep(PERIOD_S)
            while self._open and (message := self._client.get_message()) is not None:
                try:
                    self._callback(message[0])
                except Exception as error:  # is reported, and costs this message only
                    threading.excepthook(
                        threading.ExceptHookArgs((type(error), error, error.__traceback__, self._thread))
                    )
