"""The render worker: complete takes, latest request wins, sound made anew from kept motion, faults told."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from app.audio import Track
from app.export import SoundRequest, render_sound
from app.rendering import RenderRequest, RenderWorker, Take
from engine.metrics import ErrorSums
from engine.models import KoopmanVar
from engine.models.koopman_var import KoopmanState
from engine.pluck import Pluck
from engine.preset import load_preset

DEADLINE_S = 30.0


class Heard:
    """Collects what the worker says."""

    def __init__(self) -> None:
        self.started: list[tuple[Take, Track]] = []
        self.replaced: list[tuple[Take, Track]] = []
        self.finished: list[tuple[Take, ErrorSums]] = []
        self.failed: list[str] = []

    def take_started(self, take: Take, track: Track) -> None:
        self.started.append((take, track))

    def track_replaced(self, take: Take, track: Track) -> None:
        self.replaced.append((take, track))

    def take_finished(self, take: Take, errors: ErrorSums) -> None:
        self.finished.append((take, errors))

    def render_failed(self, message: str, detail: str) -> None:
        self.failed.append(message)


def wait_until(done: Callable[[], bool]) -> None:
    deadline = time.monotonic() + DEADLINE_S
    while not done():
        assert time.monotonic() < deadline, "nothing came"
        time.sleep(0.005)


@pytest.fixture
def heard() -> Heard:
    return Heard()


@pytest.fixture
def worker(heard: Heard) -> Iterator[RenderWorker]:
    made = RenderWorker(heard)
    yield made
    made.close()
    assert "render-worker" not in [t.name for t in threading.enumerate()]


def request_of(preset: Path, **changes: object) -> RenderRequest:
    return replace(RenderRequest(preset, Pluck(0.4, 3.0), 1.0, 0.37, 8_000), **changes)  # type: ignore[arg-type]


def test_a_take_is_what_an_export_renders(small_preset: Path, worker: RenderWorker, heard: Heard) -> None:
    worker.submit(request_of(small_preset, sound_rate_hz=4_000))
    wait_until(lambda: bool(heard.finished))
    take, track = heard.started[0]
    assert take.complete
    assert track.complete
    preset = load_preset(small_preset)
    for source in ("model", "truth"):
        expected = render_sound(SoundRequest(preset, Pluck(0.4, 3.0), 0.37, 1.0, source))  # type: ignore[arg-type]
        found = track.read(source, 0, len(expected))
        assert found == pytest.approx(expected, abs=2e-5)


def test_the_sound_has_the_devices_rate_and_the_takes_length(
    small_preset: Path, worker: RenderWorker, heard: Heard
) -> None:
    worker.submit(request_of(small_preset, sound_rate_hz=44_100))
    wait_until(lambda: bool(heard.finished))
    _, track = heard.started[0]
    assert track.rate_hz == 44_100
    assert track.ready_frames == pytest.approx(44_100, abs=32)


def test_the_latest_request_wins(small_preset: Path, worker: RenderWorker, heard: Heard) -> None:
    for position in (0.3, 0.35, 0.4, 0.45, 0.5):
        worker.submit(request_of(small_preset, pluck=Pluck(position, 3.0), seconds=4.0))
    wait_until(lambda: bool(heard.finished))
    assert heard.finished[-1][0].pluck.position == 0.5
    assert len(heard.finished) < 5


def test_another_listening_point_keeps_the_motion(small_preset: Path, worker: RenderWorker, heard: Heard) -> None:
    worker.submit(request_of(small_preset))
    wait_until(lambda: bool(heard.finished))
    worker.submit(request_of(small_preset, listen=0.2))
    wait_until(lambda: bool(heard.replaced))
    take, track = heard.replaced[0]
    assert take is heard.started[0][0]
    assert len(heard.started) == 1
    assert np.abs(track.read("truth", 0, 999) - heard.started[0][1].read("truth", 0, 999)).max() > 0.01


def test_another_listening_point_while_rendering(small_preset: Path, worker: RenderWorker, heard: Heard) -> None:
    worker.submit(request_of(small_preset, seconds=10.0))
    wait_until(lambda: bool(heard.started))
    worker.submit(request_of(small_preset, seconds=10.0, listen=0.2))
    wait_until(lambda: bool(heard.replaced))
    wait_until(lambda: bool(heard.finished))
    assert heard.replaced[0][1].complete
    assert heard.finished[0][0] is heard.replaced[0][0]


def test_a_broken_preset_is_told_and_the_worker_lives_on(
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
    take, track = heard.started[0]
    assert take.model_ends_s == pytest.approx(256 / 4_000)
    assert np.abs(track.read("model", 2_000, 8_000)).max() < 1e-3
    assert np.abs(track.read("truth", 2_000, 8_000)).max() > 0.01
    assert np.isfinite(take.motion_m("model")).all()
