"""The sound device is taken away and given back while the app is played: when is there sound again?

In turn the card goes while the sound server stays, as a plug that is pulled, and the server itself ends, as one that
crashes or is updated. Keys are pressed all the time, from outside. What the card that is back is given is recorded.
"""

from __future__ import annotations

import contextlib
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from random import Random

import numpy as np

from app.audio.choices import SoundChoice
from app.patches.patch import Patch
from app.session.choices import Choices
from app.window.settings import Settings
from tests.bench.machine import Machine
from tests.bench.play import analysis, hands, program
from tests.bench.play.children import need_programs
from tests.bench.play.recording import AUDIBLE, recording
from tests.bench.play.screen import Screen, private_screen
from tests.bench.play.sound_server import RATE_HZ, SoundServer, sound_server

KINDS = ("card", "server")
GONE_S = (0.2, 4.0)  # from shorter than anybody notices to several looks for it
PLAYED_S = 1.5  # before it goes, and listened to after it is back
PATIENCE_S = 15.0
TARGET_S = 2.0
NOTES_HZ = 6.0
STOP = "space"
END_PATIENCE_S = 5.0


@dataclass(frozen=True)
class Loss:
    """One time.

    Attributes:
        kind: what was taken away, of `KINDS`.
        gone_s: for how long.
        back_s: from the device's return to the first sound of the app in it; None: there was none.
        loudest: sample in the sound then.
        holes: silences of a millisecond or more in it.
    """

    kind: str
    gone_s: float
    back_s: float | None
    loudest: float
    holes: int


@dataclass(frozen=True)
class Unplugged:
    """`loudest_before`: sample before the first time. `ends_s`: from the key that stops all notes to silence at the
    end; None: something hung. `alive`: whether the app was still there, and ended as it should."""

    machine: Machine
    seed: int
    patch: str
    times: int
    losses: tuple[Loss, ...]
    loudest_before: float
    ends_s: float | None
    alive: bool

    @property
    def in_time(self) -> int:
        return sum(loss.back_s is not None and loss.back_s <= TARGET_S for loss in self.losses)

    @property
    def passed(self) -> bool:
        return self.in_time == self.times and self.ends_s is not None and self.alive

    @property
    def back_s(self) -> list[float]:
        return [loss.back_s for loss in self.losses if loss.back_s is not None]


def measure(times: int, seed: int, patch: Patch, report: Callable[..., None]) -> Unplugged:
    """Take the device away so many times.

    Raises:
        Missing: A program or library is not there.
        RuntimeError: The app did not open, or nothing was heard of it.
    """
    need_programs()
    random = Random(seed)
    with contextlib.ExitStack() as stack:
        stack.enter_context(program.ended_politely())
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="unplug")))
        report(0.0, "sound card, screen, start")
        server = stack.enter_context(sound_server(folder))
        screen = stack.enter_context(private_screen())
        settings = Settings(choices=Choices(instrument=patch), sound=SoundChoice(rate_hz=RATE_HZ))
        with recording(server, folder / "before") as recorded:
            process = stack.enter_context(program.app(folder, settings, server, screen))
            program.open_window(screen, process)
            program.try_keys(screen, recorded, process, time.monotonic())
            with _played(screen, random):
                time.sleep(PLAYED_S)
            loudest_before = float(np.abs(recorded.sound()).max(initial=0))
        losses = []
        with _played(screen, random):
            for number in range(times):
                kind = KINDS[number % len(KINDS)]
                report(number / times, f"the {kind} goes")
                losses.append(_lose(server, kind, random.uniform(*GONE_S), folder / "recording"))
                if process.poll() is not None:
                    break
        with recording(server, folder / "end") as recorded:
            time.sleep(0.5)
            stopped_s = time.monotonic()
            hands.tap(screen, STOP)
            silent = recorded.wait_for_silence(0.5, END_PATIENCE_S)
            ends_s = max(0.0, recorded.sounded_s - stopped_s) if silent else None
        alive = process.poll() is None
        return Unplugged(Machine.here(), seed, patch.name, times, tuple(losses), loudest_before, ends_s, alive)


def _lose(server: SoundServer, kind: str, gone_s: float, path: Path) -> Loss:
    time.sleep(PLAYED_S)
    if kind == "card":
        server.take_card_away()
    else:
        server.end()
    time.sleep(gone_s)
    if kind == "card":
        server.give_card_back()
    else:
        server.start()
    back_s = time.monotonic()
    with recording(server, path) as recorded:
        server.refresh_card()
        heard = recorded.wait_for_sound(back_s, PATIENCE_S)
        heard_s = time.monotonic()
        time.sleep(PLAYED_S)
        sound = recorded.sound()
    if not heard:
        return Loss(kind, gone_s, None, 0.0, 0)
    first = int(np.argmax(np.abs(sound).max(axis=1) > AUDIBLE))
    holes = analysis.silences(sound[first:, 0], RATE_HZ)
    return Loss(kind, gone_s, heard_s - back_s, float(np.abs(sound).max()), len(holes))


@contextlib.contextmanager
def _played(screen: Screen, random: Random) -> Iterator[None]:
    """Keys, as long as the block lasts; nobody else uses the screen meanwhile."""
    ended = threading.Event()

    def play() -> None:
        while not ended.wait(1 / NOTES_HZ - hands.HELD_S):
            hands.tap(screen, random.choice(hands.KEYS))

    thread = threading.Thread(target=play, name="hands")
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
