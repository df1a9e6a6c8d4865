"""Notes in a mixer whose frames the test takes itself; presets that sound at once, and one that is rendered first."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from app.instrument.events import PluckAt
from app.playing.note import Note
from app.playing.notes import Notes
from app.playing.sources import Sources
from app.rendering import RenderRequest
from engine.pluck import Pluck
from engine.presets import SHIPPED
from engine.values.ear import Ear
from engine.voices import Mixer
from tests.app.monitors import hears

DEADLINE_S = 30.0
EAR = Ear((0.37,))


class StandingSound:
    """A `Sound` whose clock is the mixer's own: nothing takes a frame but the test."""

    def __init__(self, rate_hz: int = 48_000) -> None:
        self.mixer = Mixer(rate_hz)
        self.load = 0.0
        self.latency_s = 0.0
        self._watch: Callable[[Any], None] = lambda status: None

    @property
    def rate_hz(self) -> int:
        return self.mixer.rate_hz

    def now_s(self) -> float:
        return self.mixer.seconds

    def status(self) -> SimpleNamespace:
        return SimpleNamespace(load=self.load, latency_s=self.latency_s)

    def watch(self, look: Callable[[Any], None]) -> None:
        self._watch = look

    def take_care(self) -> None:
        """A turn of the caretaker's thread."""
        self._watch(self.status())


@pytest.fixture
def sound() -> StandingSound:
    made = StandingSound()
    made.mixer.render(64)  # a clock that stands at zero has not begun
    return made


@pytest.fixture(scope="session")
def bank() -> Path:
    """A model that sounds at once."""
    return SHIPPED / "nylon_nonlinear_gaussian_4k_koopman_integrated.safetensors"


@pytest.fixture(scope="session")
def sources(bank: Path, small_preset: Path) -> Sources:
    """With both presets loaded at 48 kHz; nobody may change it."""
    made = Sources()
    for path in (bank, small_preset):
        made.prepare(path, 48_000)
    return made


@pytest.fixture
def reports() -> list[tuple[str, str]]:
    return []


@pytest.fixture
def notes(sound: StandingSound, sources: Sources, reports: list[tuple[str, str]]) -> Iterator[Notes]:
    report = lambda message, detail: reports.append((message, detail))  # noqa: E731
    made = Notes(sound, sources, lambda name: None, report)  # type: ignore[arg-type]
    made.set_monitor(hears("model"))
    yield made
    made.close()


@pytest.fixture
def pluck_of() -> Callable[..., RenderRequest]:
    """pluck_of(path, position=…, others=…, seconds=…, ear=…, amplitude_mm=…)"""

    def made(
        path: Path,
        position: float = 0.35,
        others: tuple[Path, ...] = (),
        seconds: float = 1.0,
        ear: Ear = EAR,
        amplitude_mm: float = 3.0,
    ) -> RenderRequest:
        return RenderRequest(path, Pluck(position, amplitude_mm), seconds, ear, 1.0, others)

    return made


@pytest.fixture
def strike(notes: Notes) -> Callable[..., Note]:
    """Chooses a pluck and plays it: as an event, or from some time or frame on."""

    def made(request: RenderRequest, from_s: float = 0.0, alone: bool = False, begin_frame: int = 0) -> Note:
        notes.choose(request)
        if from_s or alone or begin_frame:
            note = notes.ring(from_s, begin_frame, alone)
        else:
            note = notes.handle(PluckAt(request.pluck))
        assert note is not None
        return note

    return made


@pytest.fixture
def wait() -> Callable[[Callable[[], bool]], None]:
    """For what another thread does."""

    def until(done: Callable[[], bool]) -> None:
        deadline = time.monotonic() + DEADLINE_S
        while not done():
            assert time.monotonic() < deadline, "nothing came"
            time.sleep(0.002)

    return until
