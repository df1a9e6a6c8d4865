"""Notes in a mixer whose frames the test takes itself; presets that sound at once, and one that is rendered first."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from app.player.events import PluckAt
from app.playing.keyboard import PluckRange
from app.playing.note import PluckVoices
from app.playing.notes import Notes
from app.playing.sources import Sources
from app.presets.library import PresetEntry
from app.rendering import NoteSound
from engine.pluck import Pluck
from engine.presets import SHIPPED, read_info
from engine.values.ear import Ear
from engine.voices import Mixer
from tests.app.monitors import hears

DEADLINE_S = 30.0
EAR = Ear((0.37,))
Wait = Callable[[Callable[[], object]], None]


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


class Lab:
    """Notes of single strings, whose sound the test takes: `bank` sounds at once, `small_preset` is rendered."""

    def __init__(self, sound: StandingSound, sources: Sources, bank: Path, small_preset: Path, wait: Wait) -> None:
        self.sound, self.sources, self.bank, self.small_preset, self.wait = sound, sources, bank, small_preset, wait
        self.reports: list[tuple[str, str]] = []
        self.entry = PresetEntry("bank", bank, read_info(bank), 0)
        report = lambda message, detail: self.reports.append((message, detail))  # noqa: E731
        self.notes = Notes(sound, sources, {"bank": self.entry}.get, report)  # type: ignore[arg-type]
        self.notes.set_monitor(hears("model"))

    @property
    def mixer(self) -> Mixer:
        return self.sound.mixer

    @mixer.setter
    def mixer(self, mixer: Mixer) -> None:
        self.sound.mixer = mixer

    def pluck_of(
        self,
        path: Path | None = None,
        position: float = 0.35,
        others: tuple[Path, ...] = (),
        seconds: float = 1.0,
        ear: Ear = EAR,
        amplitude_mm: float = 3.0,
    ) -> NoteSound:
        return NoteSound(path or self.bank, Pluck(position, amplitude_mm), seconds, ear, 1.0, others)

    def strike(
        self,
        plucked: NoteSound | Path | None = None,
        *,
        from_s: float = 0.0,
        alone: bool = False,
        begin_frame: int = 0,
        **options: Any,
    ) -> PluckVoices:
        """Chooses a pluck and plays it: as an event, or from some time or frame on."""
        request = plucked if isinstance(plucked, NoteSound) else self.pluck_of(plucked, **options)
        self.notes.choose(request)
        if from_s or alone or begin_frame:
            note = self.notes.ring(from_s, begin_frame, alone)
        else:
            note = self.notes.handle(PluckAt(request.pluck))  # type: ignore[assignment]
        assert note is not None
        return note

    def play_string(self) -> PluckRange:
        """Let a single string be the instrument; return its reach."""
        self.notes.choose(self.pluck_of())
        self.notes.set_instrument(None, EAR, "bank")
        return PluckRange.of(self.entry.info)

    def hear(self, seconds: float) -> np.ndarray:
        """(frames,), left."""
        return self.mixer.render(round(seconds * self.mixer.rate_hz))[:, 0]

    def alone(self, pluck: NoteSound, seconds: float, source: str = "model") -> np.ndarray:
        """The sound of one source of a pluck in a mixer of its own, (frames,)."""
        mixer = Mixer(48_000)
        mixer.add(self.sources.load(pluck.preset).voice(source, pluck.pluck, pluck.ear, 48_000))
        return mixer.render(round(48_000 * seconds))[:, 0]


@pytest.fixture
def sound() -> StandingSound:
    made = StandingSound()
    made.mixer.render(64)  # a clock that stands at zero has not begun
    return made


@pytest.fixture(scope="session")
def bank() -> Path:
    return SHIPPED / "nylon_nonlinear_gaussian_4k_koopman_integrated.safetensors"


@pytest.fixture(scope="session")
def sources(bank: Path, small_preset: Path) -> Sources:
    made = Sources()
    for path in (bank, small_preset):
        made.prepare(path, 48_000)
    return made


@pytest.fixture
def lab(sound: StandingSound, sources: Sources, bank: Path, small_preset: Path, wait: Wait) -> Iterator[Lab]:
    made = Lab(sound, sources, bank, small_preset, wait)
    yield made
    made.notes.close()


@pytest.fixture
def wait() -> Wait:
    """For what another thread does."""

    def until(done: Callable[[], object]) -> None:
        deadline = time.monotonic() + DEADLINE_S
        while not done():
            assert time.monotonic() < deadline, "nothing came"
            time.sleep(0.002)

    return until
