"""The program as its user starts it, with a private sound card and screen, driven from outside.

It is driven by its command, its window's title, its keys and its settings file.
"""

from __future__ import annotations

import contextlib
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import psutil

from app.audio.choices import Buffer, SoundChoice
from app.instruments.instrument import Instrument
from app.session.choices import Choices
from app.window.settings import Settings, save_settings
from bench.play import hands
from bench.play.calibration import Handed, click_through
from bench.play.children import child, need_programs
from bench.play.control import steady_tone
from bench.play.recording import Recording, recording
from bench.play.screen import Screen, private_screen
from bench.play.sound_server import RATE_HZ, SoundServer, sound_server
from training.cli.console import ProgressReport

PROGRAMS = ("pulseaudio", "pacat", "parec", "pactl", "Xvfb")
TITLE = "Learned Strings"
START_PATIENCE_S = 120.0
TRY_EVERY_S = 0.25  # a key, while the program starts


@dataclass(frozen=True)
class Program:
    """The program while it runs; times are by `time.monotonic`.

    Attributes:
        settings, printed: the files of its settings, and of all that it prints.
        recorded, control: the recordings of its sound, and of a steady tone of another process.
        clicks: see `calibration`; played before the program started.
        started_s, shown_s: when it was started, and when its window was to be seen.
    """

    process: subprocess.Popen[bytes]
    settings: Path
    printed: Path
    server: SoundServer
    screen: Screen
    recorded: Recording
    control: Recording
    clicks: tuple[Handed, ...]
    started_s: float
    shown_s: float

    @property
    def alive(self) -> bool:
        return self.process.poll() is None

    def try_keys(self, key: str) -> None:
        """Press a key again and again until something is heard."""
        began_s = time.monotonic()
        while True:
            hands.tap(self.screen, key)
            if self.recorded.wait_for_sound(began_s, TRY_EVERY_S):
                return
            if not self.alive or time.monotonic() > began_s + START_PATIENCE_S:
                raise RuntimeError("no key of the app was heard; is its sound device the system's default?")

    def processor_s(self) -> float:
        """Processor time of the program and all that it has started."""
        return sum(self._of_each(lambda one: sum(one.cpu_times()[:2])))

    def resident_mib(self) -> float:
        """Resident memory of the program and all that it has started."""
        return sum(self._of_each(lambda one: one.memory_info().rss / 2**20))

    def _of_each(self, figure: Callable[[psutil.Process], float]) -> list[float]:
        found: list[float] = []
        with contextlib.suppress(psutil.NoSuchProcess):  # one that has ended
            parent = psutil.Process(self.process.pid)
            for one in (parent, *parent.children(recursive=True)):
                found.append(figure(one))
        return found


@contextlib.contextmanager
def program(
    instrument: Instrument | str, buffer: Buffer, report: ProgressReport, *, calibrated: bool = False
) -> Iterator[Program]:
    """Start the program with an instrument, and wait until its first key is heard. A single string is in the Lab.

    Args:
        calibrated: clicks are played first.

    Raises:
        Missing: a program or library is not there.
        RuntimeError: the app did not open, or no sound of it was recorded.
    """
    need_programs(*PROGRAMS)
    alone = isinstance(instrument, str)
    face, octave = "lab" if alone else "play", hands.octave_of(instrument)
    choices = Choices().changed({"preset" if alone else "played": instrument, "octave": octave, "face": face})
    settings = Settings(choices=choices, sound=SoundChoice(rate_hz=RATE_HZ, buffer=buffer))
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="play")))
        report(0.0, "sound card and screen")
        server = stack.enter_context(sound_server(folder))
        screen = stack.enter_context(private_screen())
        recorded = stack.enter_context(recording(server, folder / "recording"))
        time.sleep(0.5)
        clicks = click_through(server) if calibrated else []
        control = stack.enter_context(steady_tone(server, folder, buffer))
        report(0.05, "start")
        file, printed, started_s = folder / "settings.json", folder / "app.log", time.monotonic()
        save_settings(file, settings)
        process = stack.enter_context(_started(file, printed, server, screen))
        shown_s = _show(screen, process)
        files = file, printed
        found = Program(process, *files, server, screen, recorded, control, tuple(clicks), started_s, shown_s)
        found.try_keys(hands.keys_of(instrument)[0])
        yield found


@contextlib.contextmanager
def _started(settings: Path, printed: Path, server: SoundServer, screen: Screen) -> Iterator[subprocess.Popen[bytes]]:
    environment = {
        **server.environment,
        "DISPLAY": screen.name,
        "QT_QPA_PLATFORM": "xcb",
        "LEARNED_STRINGS_SETTINGS": str(settings),
    }
    environment.pop("WAYLAND_DISPLAY", None)
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # as at a user's second start
    command = [sys.executable, "-m", "app.commands.cli"]
    with printed.open("wb") as log, child(command, environment, stdout=log, stderr=log) as process:
        yield process


def _show(screen: Screen, process: subprocess.Popen[bytes]) -> float:
    """Wait for the program's window, and give it the screen; return when it was to be seen."""
    deadline_s = time.monotonic() + START_PATIENCE_S
    while (window := screen.find(TITLE)) is None:
        if process.poll() is not None or time.monotonic() > deadline_s:
            raise RuntimeError("the app opened no window; start it by hand to see why")
        time.sleep(0.01)
    shown_s = time.monotonic()
    screen.take(window)
    return shown_s
