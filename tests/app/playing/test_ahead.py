"""Models that are rendered before they are heard: when they begin, what is remembered, how they end."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest

from app.playing.ahead import Ahead
from app.playing.ahead_samples import CARE, LEAST_S, AheadSamples
from app.playing.note import PluckVoices
from app.rendering import NoteSound
from app.rendering.motion import ModelMotion
from engine.levels import FULL_SCALE_M
from engine.models.koopman_var import KoopmanVar
from engine.pluck import Pluck
from engine.voices import Mixer, Voice
from tests.app.playing.conftest import EAR, Lab

RATE_HZ = 4_000  # of the small preset and of the mixer: samples are heard as they are rendered
ADVANCE = KoopmanVar.advance


class Ahead4k:
    """Renders voices of the small preset, and notes what is reported of them."""

    def __init__(self, lab: Lab) -> None:
        self.ahead, self.wait = Ahead(self._begin, self._fail), lab.wait
        self.model = lab.sources.load(lab.small_preset)
        self.begun_s: list[float] = []  # how much was rendered then
        self.errors: list[Exception] = []
        self.notes: list[PluckVoices] = []
        self.motions: dict[object, ModelMotion] = {}

    def _begin(self, note: PluckVoices) -> None:
        note.pending = False
        self.begun_s.append(note.ahead[0].rendered_s)

    def _fail(self, note: PluckVoices, error: Exception) -> None:
        note.cut = True
        self.errors.append(error)

    def render(
        self, seconds: float = 1.0, from_s: float = 0.0, key: object = None, amplitude_mm: float = 3.0
    ) -> AheadSamples:
        pluck = Pluck(0.4, amplitude_mm)
        voice = self.model.voice("model", pluck, EAR, RATE_HZ, seconds)
        note = PluckVoices(NoteSound(Path(), pluck, seconds, EAR), ("model",), from_s, voices={"model": voice})
        key = key or object()
        motion = self.motions[key] = ModelMotion(self.model.model, self.model.initial_m(pluck), seconds)
        samples = AheadSamples(voice, motion, key, from_s)
        note.ahead.append(samples)
        self.notes.append(note)
        self.ahead.render(note)
        return samples

    def finished(self, **options: Any) -> AheadSamples:
        samples = self.render(**options)
        self.wait(lambda: samples.finished and not self.notes[-1].pending)
        return samples


@pytest.fixture
def at(lab: Lab, threads_begun: Callable[[], list[str]]) -> Iterator[Ahead4k]:
    made = Ahead4k(lab)
    yield made
    made.ahead.close()
    assert "render-ahead" not in threads_begun()


def slow_down(monkeypatch: pytest.MonkeyPatch, speed: float) -> None:
    """The model makes so many seconds of sound in a second, about."""

    def slow(self: KoopmanVar, state: Any, steps: int, readout: Any = None) -> Any:
        time.sleep(steps / RATE_HZ / speed)
        return ADVANCE(self, state, steps, readout)

    monkeypatch.setattr(KoopmanVar, "advance", slow)


def heard(voice: Voice, frames: int) -> np.ndarray:
    """(frames,)"""
    voice.never_ends()
    mixer = Mixer(RATE_HZ, limited=False)
    mixer.add(voice)
    return mixer.render(frames)[:, 0]


def test_it_begins_when_a_little_is_there_and_is_the_models_signal(at):
    voice = at.finished()
    (begun_s,) = at.begun_s
    assert LEAST_S <= begun_s < 1.0 and voice.waits_s == 0
    model, initial_m = at.model.model, at.model.initial_m(Pluck(0.4, 3.0))
    frames, _ = model.advance(model.start(initial_m[None]), 2_000, voice.voice.program.grid_weights(EAR))
    attack, expected = 16, frames[0, :, 0] / FULL_SCALE_M
    assert heard(voice.voice, 2_001)[1 + attack :] == pytest.approx(expected[attack:], abs=1e-5)
    assert at.finished(seconds=30.0, amplitude_mm=1e-6).rendered_s < 10, "silent, it is not rendered to its end"


def test_what_was_rendered_once_is_there_at_once(at):
    first = at.finished(key="a")
    at.finished(key="b")  # the first is remembered by now: one thread renders both
    again = at.finished(key="a")
    assert at.begun_s[-1] == first.rendered_s, "with all of it"
    assert at.motions["a"].ready_frames == 0, "the motion need not be rendered for it"
    np.testing.assert_array_equal(heard(again.voice, 3_000), heard(first.voice, 3_000))


@pytest.mark.parametrize(("from_s", "least_s"), [(0.8, 0.8 + LEAST_S), (5.0, 1.0)])
def test_where_a_seek_begins_in_the_middle_it_waits_for_that(at, from_s, least_s):
    at.finished(from_s=from_s)
    assert at.begun_s[0] >= least_s - 1e-3


def test_a_model_that_runs_away_is_silent_from_there_on(at, monkeypatch):
    def faulty(self: KoopmanVar, state: Any, steps: int, readout: Any = None) -> Any:
        frames, after = ADVANCE(self, state, steps, readout)
        return (frames * float("nan") if state.step >= 512 else frames), after

    monkeypatch.setattr(KoopmanVar, "advance", faulty)
    voice = at.finished(key="wild")
    samples, ends = heard(voice.voice, 4_000), at.motions["wild"].ends
    assert ends == 512
    assert np.abs(samples[ends - 200 : ends]).max() > 0.01
    assert not samples[ends + 128 :].any() and at.errors == []


def test_a_fault_is_reported_and_the_others_go_on(at, monkeypatch):
    with monkeypatch.context() as broken:
        broken.setattr(KoopmanVar, "encode", lambda *_: 1 / 0)
        at.render()
        at.wait(lambda: at.errors)
    assert isinstance(at.errors[0], ZeroDivisionError) and at.begun_s == []
    at.finished()


def test_the_one_that_is_heard_soonest_goes_first(at, monkeypatch):
    slow_down(monkeypatch, speed=5.0)
    first, second = (at.render(seconds=20.0) for _ in range(2))
    at.wait(lambda: not any(note.pending for note in at.notes))
    assert not first.finished and first.given < 10 * second.given + 10 * RATE_HZ
    slow_down(monkeypatch, speed=0.8)
    voice = at.render()
    at.wait(lambda: voice.waits_s > 0)
    at.wait(lambda: len(at.begun_s) == 3)
    assert 1 - CARE * 0.8 <= at.begun_s[2] < 1.0, "some of it is rendered while it is heard"


def test_a_model_that_is_half_as_quick_as_its_sound_is_waited_for_as_long_as_the_rest_takes():
    samples = AheadSamples(Mock(), Mock(rate_hz=RATE_HZ, frames=RATE_HZ, speed=0.5), object())
    samples.given = RATE_HZ // 4
    assert samples.waits_s == pytest.approx((1 - CARE * 0.5 - 0.25) / 0.5)


def test_where_more_sound_than_can_be_rendered_the_oldest_make_room(at, monkeypatch):
    slow_down(monkeypatch, speed=3.0)
    mixer, began_s = Mixer(RATE_HZ, limited=False), time.monotonic()
    for _ in range(6):
        voice = at.render(seconds=20.0).voice
        at.wait(lambda: not at.notes[-1].pending)
        mixer.add(voice)

    def some_released() -> bool:
        mixer.render(max(0, round((time.monotonic() - began_s) * RATE_HZ) - mixer.frames))
        return any(note.released for note in at.notes)

    at.wait(some_released)
    released = [note.released for note in at.notes]
    assert released == sorted(released, reverse=True) and not released[-1]
