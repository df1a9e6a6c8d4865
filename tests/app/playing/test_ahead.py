"""Models that are rendered before they are heard: when they begin, what is remembered, how they end."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import torch

from app.playing.ahead import CARE, LEAST_S, Ahead, AheadVoice
from app.playing.sources import Sources
from engine.levels import FULL_SCALE_M
from engine.models.koopman_var import KoopmanState, KoopmanVar
from engine.pluck import Pluck
from engine.resonators.sine_transform import project
from engine.sources import ModelSource
from engine.values.ear import Ear
from engine.voices import Mixer, Voice
from engine.voices.ear import weights_of

RATE_HZ = 4_000  # of the small preset and of the mixer: samples are heard as they are rendered
EAR = Ear((0.37,))
Wait = Callable[[Callable[[], bool]], None]


@pytest.fixture
def ahead(threads_begun: Callable[[], list[str]]) -> Iterator[Ahead]:
    made = Ahead()
    yield made
    made.close()
    assert threads_begun() == []


class Reported:
    """What an ahead voice says."""

    def __init__(self) -> None:
        self.begun_s: list[float] = []  # how much was rendered then
        self.errors: list[Exception] = []
        self.given_up = False


Make = Callable[..., tuple[AheadVoice, Reported]]


@pytest.fixture
def make(sources: Sources, small_preset: Path) -> Make:
    loaded = sources.load(small_preset)
    info = loaded.preset.info
    program = sources.program(small_preset, "model", RATE_HZ)

    def made(
        seconds: float = 1.0,
        from_s: float = 0.0,
        key: object = None,
        model: ModelSource = loaded.model,
        amplitude_mm: float = 3.0,
    ) -> tuple[AheadVoice, Reported]:
        reported = Reported()
        initial_m = project(Pluck(0.4, amplitude_mm).displacement(info.grid_points), info.modes)
        voice = AheadVoice(
            Voice(program, initial_m, EAR, 1.0, seconds, info.rate_hz),
            model,
            initial_m,
            weights_of(EAR, info.grid_points),
            (key or object(),),
            lambda: reported.begun_s.append(voice.rendered_s),
            reported.errors.append,
            lambda: reported.given_up,
            from_s,
        )
        return voice, reported

    return made


def slow_down(monkeypatch: pytest.MonkeyPatch, speed: float) -> None:
    """The model makes so many seconds of sound in a second, about."""
    advance = KoopmanVar.advance

    def slow(
        self: KoopmanVar, state: KoopmanState, steps: int, readout: torch.Tensor | None = None
    ) -> tuple[torch.Tensor, KoopmanState]:
        time.sleep(steps / RATE_HZ / speed)
        return advance(self, state, steps, readout)

    monkeypatch.setattr(KoopmanVar, "advance", slow)


def heard(voice: Voice, frames: int) -> np.ndarray:
    """(frames,)"""
    voice.never_ends()
    mixer = Mixer(RATE_HZ, limited=False)
    mixer.add(voice)
    return mixer.render(frames)[:, 0]


def test_it_begins_when_a_little_is_there_and_is_the_models_signal(ahead: Ahead, make: Make, wait: Wait) -> None:
    voice, reported = make()
    ahead.render(voice)
    wait(lambda: voice.finished and reported.begun_s != [])
    assert len(reported.begun_s) == 1
    assert LEAST_S <= reported.begun_s[0] < 1.0
    assert voice.waits_s == 0
    frames, _ = voice.source.advance(voice.source.start(voice.initial_m[None]), 2_000, voice.weights)
    expected = frames[0, :, 0] / FULL_SCALE_M
    attack = 16
    assert heard(voice.voice, 2_001)[1 + attack :] == pytest.approx(expected[attack:], abs=1e-5)


def test_a_slow_model_begins_when_the_rest_will_be_ready_in_time(
    ahead: Ahead, make: Make, wait: Wait, monkeypatch: pytest.MonkeyPatch
) -> None:
    slow_down(monkeypatch, speed=0.8)
    voice, reported = make(seconds=1.0)
    ahead.render(voice)
    wait(lambda: voice.waits_s > 0)
    wait(lambda: reported.begun_s != [])  # it is `begun` a moment before that is reported
    (begun_s,) = reported.begun_s
    assert 1 - CARE * 0.8 <= begun_s < 1.0, "some of it is rendered while it is heard"
    assert voice.waits_s == 0


def test_what_was_rendered_once_is_there_at_once(ahead: Ahead, make: Make, wait: Wait) -> None:
    first, _ = make(key="a")
    ahead.render(first)
    wait(lambda: first.finished)
    wait(lambda: ("a",) in ahead._known)
    again, reported = make(key="a")
    ahead.render(again)
    assert reported.begun_s == [first.rendered_s]
    np.testing.assert_array_equal(heard(again.voice, 3_000), heard(first.voice, 3_000))
    other, _ = make(key="b")
    ahead.render(other)
    assert not other.finished or other.done


def test_where_a_seek_begins_in_the_middle_it_waits_for_that(
    ahead: Ahead, make: Make, wait: Wait, monkeypatch: pytest.MonkeyPatch
) -> None:
    voice, reported = make(from_s=0.8)
    ahead.render(voice)
    wait(lambda: reported.begun_s != [])
    assert reported.begun_s[0] >= 0.8 + LEAST_S
    late, reported = make(from_s=5.0)  # behind its end
    ahead.render(late)
    wait(lambda: late.begun)
    assert late.finished


def test_a_model_that_runs_away_ends_there(
    ahead: Ahead, make: Make, wait: Wait, monkeypatch: pytest.MonkeyPatch
) -> None:
    advance = KoopmanVar.advance

    def faulty(
        self: KoopmanVar, state: KoopmanState, steps: int, readout: torch.Tensor | None = None
    ) -> tuple[torch.Tensor, KoopmanState]:
        frames, after = advance(self, state, steps, readout)
        return (frames * float("nan") if state.step >= 512 else frames), after

    monkeypatch.setattr(KoopmanVar, "advance", faulty)
    voice, reported = make(key="wild")
    ahead.render(voice)
    wait(lambda: voice.finished)
    wait(lambda: voice.begun)
    assert voice.ends_s == pytest.approx(voice.rendered_s, abs=1 / RATE_HZ)
    samples = heard(voice.voice, 4_000)
    assert np.abs(samples[voice.done - 200 : voice.done]).max() > 0.01
    assert not samples[voice.done + 128 :].any()
    assert reported.errors == []
    assert ahead._known == {}


def test_a_fault_is_reported_and_the_others_go_on(
    ahead: Ahead, make: Make, wait: Wait, monkeypatch: pytest.MonkeyPatch
) -> None:
    voice, reported = make()
    with monkeypatch.context() as broken:
        broken.setattr(KoopmanVar, "encode", lambda *_: 1 / 0)
        ahead.render(voice)
        wait(lambda: reported.errors != [])
    assert isinstance(reported.errors[0], ZeroDivisionError)
    assert reported.begun_s == []
    other, reported = make()
    ahead.render(other)
    wait(lambda: other.finished and reported.begun_s != [])


def test_what_nobody_wants_is_rendered_no_further(
    ahead: Ahead, make: Make, wait: Wait, monkeypatch: pytest.MonkeyPatch
) -> None:
    slow_down(monkeypatch, speed=2.0)
    voice, reported = make(seconds=60.0)
    ahead.render(voice)
    wait(lambda: voice.done > 1_000)
    reported.given_up = True
    wait(lambda: ahead._voices == [])
    assert not voice.finished


def test_the_one_that_is_heard_soonest_goes_first(
    ahead: Ahead, make: Make, wait: Wait, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A new pluck does not wait for all of those before it."""
    slow_down(monkeypatch, speed=5.0)
    first, second = make(seconds=20.0)[0], make(seconds=20.0)[0]
    ahead.render(first)
    wait(lambda: first.begun)
    ahead.render(second)
    wait(lambda: second.begun)
    assert not first.finished
    assert first.done < 10 * second.done + 10 * RATE_HZ


def test_a_string_that_is_silent_is_not_rendered_to_its_end(ahead: Ahead, make: Make, wait: Wait) -> None:
    voice, _ = make(seconds=30.0, amplitude_mm=1e-6)
    ahead.render(voice)
    wait(lambda: voice.finished)
    assert voice.rendered_s < 10
