"""The render worker: complete takes, latest request wins, sound made anew from kept motion, faults told."""

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

from app.audio import Track
from app.export import SoundRequest, render_sound
from app.rendering import RenderRequest, RenderWorker, Take
from app.rendering import job as job_module
from app.rendering import worker as worker_module
from app.rendering.line import Line
from app.rendering.velocity import Differentiator
from engine.metrics import ErrorSums
from engine.models import KoopmanVar
from engine.models.koopman_var import KoopmanState
from engine.pluck import FULL_SCALE_M_S, Pluck
from engine.preset import load_preset
from engine.sources import FULL_SCALE_M

DEADLINE_S = 30.0


class Heard:
    """Collects what the worker says."""

    def __init__(self) -> None:
        self.sounds = False  # what a started sound is told to do
        self.begun: list[Track] = []
        self.started: list[tuple[Take, Track]] = []
        self.replaced: list[tuple[Take, Track]] = []
        self.finished: list[tuple[Take, ErrorSums]] = []
        self.failed: list[str] = []
        self.others_failed: list[str] = []

    def sound_started(self, take: Take, track: Track) -> bool:
        self.begun.append(track)
        return self.sounds

    def take_started(self, take: Take, track: Track, sounds: bool) -> None:
        assert sounds == self.sounds
        self.started.append((take, track))

    def track_replaced(self, take: Take, track: Track) -> None:
        self.replaced.append((take, track))

    def take_finished(self, take: Take, errors: ErrorSums) -> None:
        self.finished.append((take, errors))

    def other_failed(self, preset: str, message: str) -> None:
        self.others_failed.append(f"{preset}: {message}")

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
    wait_until(lambda: not any(thread.name.startswith("render") for thread in threading.enumerate()))


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


def test_when_all_is_rendered_free_memory_is_given_back_once(
    small_preset: Path, worker: RenderWorker, heard: Heard, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[str] = []
    monkeypatch.setattr(worker_module, "return_free_pages", lambda: calls.append("returned"))
    monkeypatch.setattr(worker_module, "TIDY_AFTER_S", 0.05)
    time.sleep(0.2)
    assert calls == [], "nothing was rendered yet"
    worker.submit(request_of(small_preset))
    wait_until(lambda: calls != [])
    assert heard.finished
    time.sleep(0.2)
    assert calls == ["returned"]


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


def test_struck_plucks_sound_to_their_ends(small_preset: Path, worker: RenderWorker, heard: Heard) -> None:
    for position in (0.3, 0.4, 0.5):
        worker.submit(request_of(small_preset, pluck=Pluck(position, 3.0), seconds=3.0))
        worker.strike()
    wait_until(lambda: bool(heard.finished) and all(track.complete for _, track in heard.started))
    assert [take.pluck.position for take, _ in heard.started] == [0.3, 0.4, 0.5]
    assert [take.pluck.position for take, _ in heard.finished] == [0.5]  # the others have left the stage
    preset = load_preset(small_preset)
    for take, track in heard.started:
        assert track.ready_frames == pytest.approx(3 * 8_000, abs=8)
        expected = render_sound(SoundRequest(preset, take.pluck, 0.37, 3.0, "truth"))
        found = track.read("truth", 0, 2 * len(expected))[::2]
        late = slice(8_000, 11_900)  # rendered off stage
        assert found[late] == pytest.approx(expected[late], abs=3e-3 * np.abs(expected).max())


def slow_down(monkeypatch: pytest.MonkeyPatch) -> None:
    """To half the pace of the sound."""
    monkeypatch.setattr(job_module, "BLOCK_FRAMES", 512)
    advance = Line.advance

    def slow(line: Line, frames: int, readout: torch.Tensor | None = None) -> np.ndarray:
        time.sleep(2 * frames / line.rate_hz)
        return advance(line, frames, readout)

    monkeypatch.setattr(Line, "advance", slow)


def test_a_new_pluck_does_not_wait_for_a_late_one(
    small_preset: Path, worker: RenderWorker, heard: Heard, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(worker_module, "LOST_S", 1e9)
    slow_down(monkeypatch)
    worker.submit(request_of(small_preset))
    worker.strike()
    wait_until(lambda: bool(heard.started))
    worker.submit(request_of(small_preset, pluck=Pluck(0.6, 3.0)))
    worker.strike()
    wait_until(lambda: len(heard.started) == 2)
    assert not heard.started[0][1].complete
    monkeypatch.undo()
    wait_until(lambda: all(track.complete for _, track in heard.started))
    assert heard.started[0][1].ready_frames == pytest.approx(8_000, abs=8), "it goes on once there is time"


def test_a_pluck_that_sounds_is_told_when_there_is_time_to_draw_it(
    small_preset: Path, worker: RenderWorker, heard: Heard, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(job_module, "TELL_S", 0.5)
    heard.sounds = True
    ready: list[int] = []
    monkeypatch.setattr(heard, "take_started", lambda take, track, sounds: ready.append(track.ready_frames))
    for number, patience_s in enumerate((60.0, 0.0), 1):
        monkeypatch.setattr(job_module, "TELL_AFTER_S", patience_s)
        worker.submit(request_of(small_preset, pluck=Pluck(0.1 * number, 3.0), seconds=3.0, struck=True))
        wait_until(lambda number=number: len(ready) == number and heard.begun[-1].complete)
    assert ready[0] >= 0.5 * 8_000 > 1_000 > ready[1]


@pytest.mark.parametrize("lead_s", [0.4, 1e9])
def test_what_is_heard_goes_ahead_of_the_motion(
    small_preset: Path, worker: RenderWorker, heard: Heard, monkeypatch: pytest.MonkeyPatch, lead_s: float
) -> None:
    """For a while, so that the motion overtakes it, or to the end: it is the same sound."""
    monkeypatch.setattr(job_module, "LEAD_S", lead_s)
    monkeypatch.setattr(job_module, "BLOCK_FRAMES", 300)
    worker.submit(request_of(small_preset, seconds=3.0, struck=True, sound_rate_hz=4_000))
    wait_until(lambda: bool(heard.started))
    (take, track), *_ = heard.started
    wait_until(lambda: track.complete)
    if lead_s > 3:
        assert not take.complete
    monkeypatch.setattr(job_module, "LEAD_S", 0.0)
    wait_until(lambda: bool(heard.finished))
    assert take.complete
    for source in ("model", "truth"):
        expected = render_sound(SoundRequest(load_preset(small_preset), take.pluck, 0.37, 3.0, source))
        assert track.read(source, 0, len(expected)) == pytest.approx(expected, abs=2e-5)


def test_an_earlier_pluck_that_comes_too_late_ends(
    small_preset: Path, worker: RenderWorker, heard: Heard, monkeypatch: pytest.MonkeyPatch
) -> None:
    slow_down(monkeypatch)
    worker.submit(request_of(small_preset, seconds=3.0))
    worker.strike()
    wait_until(lambda: bool(heard.started))
    worker.submit(request_of(small_preset, pluck=Pluck(0.6, 3.0)))
    wait_until(lambda: heard.started[0][1].complete)
    assert heard.started[0][1].ready_frames < 2 * 8_000
    assert not worker._tails
    monkeypatch.undo()
    wait_until(lambda: bool(heard.finished))
    assert heard.started[1][1].ready_frames == pytest.approx(8_000, abs=8)


def test_the_error_that_is_told_is_that_of_the_take(small_preset: Path, worker: RenderWorker, heard: Heard) -> None:
    worker.submit(request_of(small_preset))
    wait_until(lambda: bool(heard.finished))
    take, errors = heard.finished[0]
    expected = ErrorSums(take.frames - 1)
    expected.add(*(torch.from_numpy(take.motion_m(name)[None, 1:].copy()) for name in ("model", "truth")))
    assert errors.total() == expected.total()
    assert errors.per_frame()[0] == pytest.approx(expected.per_frame()[0])


def test_a_tail_that_nobody_plays_is_given_up(small_preset: Path, worker: RenderWorker, heard: Heard) -> None:
    worker.submit(request_of(small_preset, seconds=12.0))
    worker.strike()
    wait_until(lambda: bool(heard.started))
    worker.submit(request_of(small_preset, pluck=Pluck(0.6, 3.0)))
    wait_until(lambda: len(heard.started) == 2)
    heard.started.clear()
    wait_until(lambda: bool(heard.finished) and not worker._tails)


def test_stereo_solo_and_velocity_are_other_sounds_of_one_motion(
    small_preset: Path, worker: RenderWorker, heard: Heard
) -> None:
    worker.submit(request_of(small_preset, sound_rate_hz=4_000))
    wait_until(lambda: bool(heard.finished))
    changes: list[dict[str, object]] = [{"listen_right": 0.63}, {"pickup": "velocity"}, {"solo": 2}]
    for count, change in enumerate(changes, 1):
        worker.submit(request_of(small_preset, sound_rate_hz=4_000, **change))
        wait_until(lambda count=count: len(heard.replaced) == count)  # type: ignore[misc]
    take = heard.started[0][0]
    stereo, velocity, solo = (track for _, track in heard.replaced)
    for side, listen in enumerate((0.37, 0.63)):
        expected = take.signal_m("model", listen) / FULL_SCALE_M
        assert stereo.read("model", 0, 4_000)[:, side] == pytest.approx(expected[:4_000], abs=1e-6)
    signal_m = take.signal_m("truth", 0.37)[:, np.newaxis]
    expected = Differentiator(4_000).feed(signal_m, last=True)[:4_000, 0] / FULL_SCALE_M_S
    assert velocity.read("truth", 0, 4_000) == pytest.approx(expected, abs=1e-5)
    spectrum = np.abs(np.fft.rfft(solo.read("truth", 0, 4_000) * np.hanning(4_000)))
    assert 480 < spectrum.argmax() < 510  # the second partial of B3
    assert spectrum[230:260].max() < 1e-3 * spectrum.max()


def test_the_difference_and_the_matched_levels(small_preset: Path, worker: RenderWorker, heard: Heard) -> None:
    worker.submit(request_of(small_preset))
    wait_until(lambda: bool(heard.finished))
    _, track = heard.started[0]
    model, truth, difference = (track.read(name, 0, 8_000) for name in ("model", "truth", "difference"))
    np.testing.assert_array_equal(difference, model - truth)
    assert track.match_gains is not None
    assert set(track.match_gains) == {"model", "truth"}
    level = np.sqrt(np.mean(np.square(model * track.match_gains["model"])))
    assert level == pytest.approx(np.sqrt(np.mean(np.square(truth))), rel=1e-4)


def test_another_presets_model_is_a_source_at_its_own_rate(
    small_preset: Path, tmp_path: Path, worker: RenderWorker, heard: Heard
) -> None:
    other = tmp_path / "other.safetensors"
    shutil.copy(small_preset, other)
    broken = tmp_path / "broken.safetensors"
    broken.write_bytes(b"damaged")
    worker.submit(request_of(small_preset, others=(other,)))
    wait_until(lambda: bool(heard.finished))
    take, track = heard.started[0]
    assert track.sources == ("model", "truth", "preset:other", "difference")
    np.testing.assert_array_equal(track.read("preset:other", 0, 8_000), track.read("model", 0, 8_000))
    worker.submit(request_of(small_preset, others=(other, broken)))
    wait_until(lambda: bool(heard.replaced))
    assert "broken.safetensors" in heard.others_failed[0]
    assert heard.replaced[0][0] is take
    assert not heard.replaced[0][1].read("preset:broken", 0, 8_000).any()
