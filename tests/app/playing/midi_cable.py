"""A private MIDI cable: messages go through a real port from this process into the app's own MIDI input.

It is carried by a JACK server with the dummy driver, which needs neither a device nor the kernel's sequencer.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
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


@dataclass(frozen=True)
class Cable:
    """The sending end. `name`: of the input port that a program opens."""

    name: str
    _output: Any

    def send(self, event: Event) -> None:
        for message in messages_of(event):
            self._output.send_message(message.bytes())

    def plug(self, name: str) -> Any:
        """A further port, which `delete` unplugs."""
        return load_backend().virtual_output(name)


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
            raise Missing(str(error)) from error
        with _quiet(folder / "jack.log"):
            output = _opened(backend, process, folder / "jackd.log")
        stack.callback(output.delete)
        names = [name for name in backend.get_input_names() if name.endswith(PORT)]
        if not names:
            raise Missing("JACK does not show the MIDI port that was made")
        time.sleep(SETTLE_S)
        yield Cable(names[0], output)


def _opened(backend: RtMidi, process: subprocess.Popen[bytes], log: Path) -> Any:
    """The output port, as soon as the server is running. Raises Missing."""
    deadline_s = time.monotonic() + START_PATIENCE_S
    while True:
        try:
            return backend.virtual_output(PORT)
        except OSError as error:
            if process.poll() is not None or time.monotonic() > deadline_s:
                said = log.read_text(errors="replace").strip()[-300:]
                raise Missing(f"no MIDI port can be had of JACK ({error}; it said: {said})") from error
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
