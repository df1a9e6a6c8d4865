"""A private MIDI cable: messages go through a real port from this process into the app's own MIDI input.

It is carried by a JACK server with the dummy driver, which needs neither a device nor the kernel's sequencer. This
process receives the messages too, which shows how long the cable itself takes and what it loses.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from app.instrument.events import Event
from app.instrument.midi_file import messages_of
from app.playing.midi_backend import VARIABLE, MidiUnavailable, RtMidi, load_backend
from tests.bench.play.children import Missing, child, need_programs

SYSTEM = "jack"
PORT = "hands"
RATE_HZ, PERIOD_FRAMES = 48_000, 128  # of the JACK server: a message takes a period or two
START_PATIENCE_S = 10.0
SETTLE_S = 0.3


@dataclass
class Cable:
    """Both ends of the cable.

    Attributes:
        name: of the input port that a program opens.
        environment: variables for a program that is to find it.
    """

    name: str
    environment: dict[str, str]
    _output: Any
    _sent_s: list[float] = field(default_factory=list)
    _arrived_s: list[float] = field(default_factory=list)

    def send(self, event: Event) -> float:
        """Send an event; return when (`time.monotonic`)."""
        sent_s = time.monotonic()
        for message in messages_of(event):
            self._sent_s.append(time.monotonic())
            self._output.send_message(message.bytes())
        return sent_s

    def plug(self, name: str) -> Any:
        """A further port, which `delete` unplugs."""
        return load_backend().virtual_output(name)

    def hear(self, _message: Any) -> None:
        """Receive a message at the other end, in the port's thread."""
        self._arrived_s.append(time.monotonic())

    @property
    def lost(self) -> int:
        """How many messages have not arrived."""
        return len(self._sent_s) - len(self._arrived_s)

    @property
    def transits_s(self) -> list[float]:
        """The time from one end to the other of each message; empty where some were lost."""
        if self.lost:
            return []
        return [arrived_s - sent_s for sent_s, arrived_s in zip(self._sent_s, self._arrived_s, strict=True)]


@contextlib.contextmanager
def cable(folder: Path) -> Iterator[Cable]:
    """Start the server, with its files in `folder`, and end it afterwards. The user's own MIDI is left alone.

    Raises:
        Missing: it did not start, or MIDI or JACK is not supported here.
    """
    need_programs("jackd")
    server = f"play{os.getpid()}"
    ours = {"JACK_DEFAULT_SERVER": server, "JACK_NO_START_SERVER": "1", VARIABLE: SYSTEM}
    command = ["jackd", "--no-realtime", "--sync", "--name", server, "-d", "dummy"]
    command += ["--rate", str(RATE_HZ), "--period", str(PERIOD_FRAMES)]
    environment = {**os.environ, "JACK_NO_AUDIO_RESERVATION": "1"}
    with contextlib.ExitStack() as stack:
        log = stack.enter_context((folder / "jackd.log").open("wb"))
        process = stack.enter_context(child(command, environment, stdout=log, stderr=log))
        stack.enter_context(_environment(ours))
        try:
            backend = load_backend()
        except MidiUnavailable as error:
            raise Missing(f"{error} Or play by keys") from error
        with _quiet(folder / "jack.log"):
            output = _opened(backend, process, folder / "jackd.log")
        stack.callback(output.delete)
        names = [name for name in backend.get_input_names() if name.endswith(PORT)]
        if not names:
            raise Missing("JACK does not show the MIDI port that was made; play by keys")
        made = Cable(names[0], ours, output)
        stack.callback(backend.open_input(names[0], callback=made.hear).close)
        time.sleep(SETTLE_S)
        yield made


def _opened(backend: RtMidi, process: subprocess.Popen[bytes], log: Path) -> Any:
    """The output port, as soon as the server is running. Raises Missing."""
    deadline_s = time.monotonic() + START_PATIENCE_S
    while True:
        try:
            return backend.virtual_output(PORT)
        except OSError as error:
            if process.poll() is not None or time.monotonic() > deadline_s:
                said = log.read_text(errors="replace").strip()[-300:]
                raise Missing(f"no MIDI port can be had of JACK ({error}; it said: {said}); play by keys") from error
            time.sleep(0.1)


@contextlib.contextmanager
def _environment(values: dict[str, str]) -> Iterator[None]:
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@contextlib.contextmanager
def _quiet(log: Path) -> Iterator[None]:
    """Within, standard error, on which JACK's library prints, goes to a file."""
    sys.stderr.flush()
    kept = os.dup(2)
    try:
        with log.open("wb") as file:
            os.dup2(file.fileno(), 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
