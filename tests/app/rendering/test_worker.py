"""The render worker: complete motions, the latest request wins, others come and go, faults are reported."""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from app.playing.sources import Sources
from app.rendering import NoteSound, RenderWorker, Take
from app.rendering import worker as worker_module
from app.rendering.line import SourceLine
from engine.models._diagonal import KoopmanState
from engine.models.koopman_var import KoopmanVar
from engine.pluck import Pluck
from engine.values.ear import Ear

DEADLINE_S = 30.0
EAR = Ear((0.37,))


class Heard:
    """Collects what the worker says."""

    def __init__(self) -> None:
        self.started: list[Take] = []
        self.finished: list[Take] = []
        self.failed: list[str] = []
        self.others_failed: list[str] = []

    def say(self, signal_name: str, value: Take | str, message: str = "") -> None:
        if isinstance(value, Take):
            assert value.ready_frames > 1, "there is something to draw"
            (self.started if signal_name == "started" else self.finished).append(value)
        elif signal_name == "failed":
            self.failed.append(value)
        else:
            self.others_failed.append(f"{value}: {message}")


def wait_until(done: Callable[[], bool]) -> None:
    deadline = time.monotonic() + DEADLINE_S
    while not done():
        assert time.monotonic() < deadline, "nothing came"
        time.sleep(0.005)


@pytest.fixture
def heard() -> Heard:
    return Heard()


@pytest.fixture
def sources() -> Sources:
    return Sources()


@pytest.fixture
def worker(heard: Heard, sources: Sources) -> Iterator[RenderWorker]:
    made = RenderWorker(heard.say, sources.load)
    yield made
    made.close()
    wait_until(lambda: not any(thread.name.startswith("render") for thread in threading.enumerate()))


def request_of(preset: Path, **changes: object) -> NoteSound:
    return replace(NoteSound(preset, Pluck(0.4, 3.0), 1.0, EAR, 0.004), **changes)  # type: ignore[arg-type]


def test_the_latest_request_wins(small_preset: Path, heard: Heard, sources: Sources) -> None:
    submitted = threading.Event()  # or the first could be finished before the last is submitted
    worker = RenderWorker(heard.say, lambda subject: submitted.wait(20) and sources.load(subject))
    for position in (0.3, 0.35, 0.4, 0.45, 0.5):
        worker.submit(request_of(small_preset, pluck=Pluck(position, 3.0), seconds=4.0))
    submitted.set()
    wait_until(lambda: bool(heard.finished))
    worker.close()
    assert [take.pluck.position for take in heard.finished] == [0.5]


def test_a_motion_that_is_asked_for_again_is_announced_again(
    small_preset: Path, worker: RenderWorker, heard: Heard
) -> None:
    """The window may have chosen something else in between, of which the worker had no request."""
    worker.submit(request_of(small_preset))
    wait_until(lambda: len(heard.finished) == 1)
    worker.submit(request_of(small_preset))
    wait_until(lambda: len(heard.finished) == 2)
    assert heard.started[0] is heard.started[1]


def test_while_plucks_are_heard_a_motion_keeps_step_with_its_sound(
    small_preset: Path, heard: Heard, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And is whole at once when they are not heard any more."""
    monkeypatch.setattr(worker_module, "IN_STEP_S", 600.0)  # not over before this is looked at
    hurried = True
    worker = RenderWorker(heard.say, Sources().load, lambda: hurried)
    try:
        worker.submit(request_of(small_preset, seconds=30.0))
        wait_until(lambda: bool(heard.started))
        (take,) = heard.started
        time.sleep(0.1)
        assert not take.complete
        hurried = False
        wait_until(lambda: take.complete)
    finally:
        worker.close()


def test_the_first_motion_waits_until_a_pluck_would_sound(small_preset: Path, heard: Heard) -> None:
    """It may load torch, which would keep the sound waiting."""
    sounds = False
    worker = RenderWorker(heard.say, Sources().load, sounds=lambda: sounds)
    try:
        worker.submit(request_of(small_preset))
        time.sleep(0.1)
        assert not heard.started
        sounds = True
        wait_until(lambda: bool(heard.finished))
    finally:
        worker.close()


def test_a_broken_preset_is_reported_and_the_worker_lives_on(
    small_preset: Path, tmp_path: Path, worker: RenderWorker, heard: Heard
) -> None:
    broken = tmp_path / "broken.safetensors"
    broken.write_bytes(small_preset.read_bytes()[:100])
    worker.submit(request_of(broken))
    wait_until(lambda: bool(heard.failed))
    assert str(broken) in heard.failed[0]
    worker.submit(request_of(small_preset))
    wait_until(lambda: bool(heard.finished))


def test_a_runaway_model_is_silenced_and_the_truth_goes_on(
    small_preset: Path, worker: RenderWorker, heard: Heard, monkeypatch: pytest.MonkeyPatch
) -> None:
    advance = KoopmanVar.advance

    def faulty(
        self: KoopmanVar, state: KoopmanState, steps: int, readout: torch.Tensor | None = None
    ) -> tuple[torch.Tensor, KoopmanState]:
        frames, after = advance(self, state, steps, readout)
        return (frames * float("nan") if state.step >= 256 else frames), after

    monkeypatch.setattr(KoopmanVar, "advance", faulty)
    worker.submit(request_of(small_preset))
    wait_until(lambda: bool(heard.finished))
    (take,) = heard.started
    assert take.model_ends_s == pytest.approx(256 / 4_000)
    assert not take.motion_m("model")[300:].any()
    assert np.abs(take.motion_m("truth")[1_000:]).max() > 1e-4
    assert np.isfinite(take.motion_m("model")).all()
    heard_m = take.listened.signals["model"].read()
    assert np.isfinite(heard_m).all()
    assert not heard_m[3_000:].any()


def test_another_presets_model_moves_beside_it(
    small_preset: Path, tmp_path: Path, worker: RenderWorker, heard: Heard
) -> None:
    """It may come later: the motion is not rendered again. One that is damaged is reported, and at rest."""
    other = tmp_path / "other.safetensors"
    shutil.copy(small_preset, other)
    broken = tmp_path / "broken.safetensors"
    broken.write_bytes(b"damaged")
    worker.submit(request_of(small_preset, others=(other,)))
    wait_until(lambda: bool(heard.finished))
    (take,) = heard.started
    wait_until(lambda: take.motions["preset:other"].complete)
    np.testing.assert_array_equal(take.motions["preset:other"].read(), take.motion_m("model"))
    wait_until(lambda: take.listened.signals["preset:other"].complete)
    np.testing.assert_array_equal(take.listened.signals["preset:other"].read(), take.listened.signals["model"].read())
    worker.submit(request_of(small_preset, others=(other, broken)))
    wait_until(lambda: "preset:broken" in take.motions and take.motions["preset:broken"].complete)
    assert "broken.safetensors" in heard.others_failed[0]
    assert not take.motions["preset:broken"].read().any()
    assert not take.listened.signals["preset:broken"].read().any()
    assert all(started is take for started in heard.started)
    assert {id(finished) for finished in heard.finished} == {id(take)}


def test_another_pluck_does_not_wait_for_the_one_before(
    small_preset: Path, worker: RenderWorker, heard: Heard, monkeypatch: pytest.MonkeyPatch
) -> None:
    advance = SourceLine.advance

    def slow(line: SourceLine, samples: int) -> None:
        time.sleep(2 * samples / line.rate_hz)
        advance(line, samples)

    monkeypatch.setattr(SourceLine, "advance", slow)
    worker.submit(request_of(small_preset, seconds=30.0))
    wait_until(lambda: bool(heard.started))
    worker.submit(request_of(small_preset, pluck=Pluck(0.6, 3.0)))
    wait_until(lambda: len(heard.started) == 2)
    monkeypatch.undo()
    wait_until(lambda: bool(heard.finished))
    assert heard.finished[0] is heard.started[1]
    assert not heard.started[0].complete
