"""The render worker: complete motions, the latest request wins, others come and go, faults are reported."""

import shutil
import threading
import time
from collections.abc import Callable, Iterator
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


def wait_until(done: Callable[[], object]) -> None:
    deadline = time.monotonic() + DEADLINE_S
    while not done():
        assert time.monotonic() < deadline, "nothing came"
        time.sleep(0.005)


class Heard:
    """A worker whose reports are kept. Plucks are heard while `hurried`; one would sound while `sounds`."""

    def __init__(self) -> None:
        self.started: list[Take] = []
        self.finished: list[Take] = []
        self.failed: list[str] = []
        self.hurried, self.sounds = False, True
        self.gate = threading.Event()
        self.gate.set()
        load = Sources().load
        self.worker = RenderWorker(
            self.say,
            lambda subject: self.gate.wait(DEADLINE_S) and load(subject),
            lambda: self.hurried,
            lambda: self.sounds,
        )

    def say(self, signal_name: str, value: Take | str, message: str = "") -> None:
        if isinstance(value, Take):
            assert value.ready_frames > 1, "there is something to draw"
            (self.started if signal_name == "started" else self.finished).append(value)
        else:
            self.failed.append(f"{signal_name}: {value}: {message}")

    def submit(self, preset: Path, position: float = 0.4, seconds: float = 1.0, *others: Path) -> None:
        self.worker.submit(
            NoteSound(preset, Pluck(position, 3.0), seconds, Ear((0.37,)), 0.004, others=tuple(others))
        )


@pytest.fixture
def heard() -> Iterator[Heard]:
    made = Heard()
    yield made
    made.worker.close()
    wait_until(lambda: not any(thread.name.startswith("render") for thread in threading.enumerate()))


def test_the_latest_request_wins_and_is_announced_again_when_asked_for(small_preset, heard):
    heard.gate.clear()  # or the first could be finished before the last is submitted
    for position in (0.3, 0.35, 0.4, 0.45, 0.5):
        heard.submit(small_preset, position)
    heard.gate.set()
    wait_until(lambda: heard.finished)
    assert [take.pluck.position for take in heard.finished] == [0.5]
    heard.submit(small_preset, 0.5)
    wait_until(lambda: len(heard.finished) == 2)
    assert heard.started[-2:] == heard.finished == 2 * heard.finished[:1]


def test_a_motion_waits_for_the_sound_and_keeps_step(small_preset, heard, monkeypatch):
    monkeypatch.setattr(worker_module, "IN_STEP_S", 600.0)  # not over before this is looked at
    heard.sounds, heard.hurried = False, True
    heard.submit(small_preset, seconds=8.0)
    time.sleep(0.1)
    assert not heard.started
    heard.sounds = True
    wait_until(lambda: heard.started)
    (take,) = heard.started
    time.sleep(0.1)
    assert not take.complete
    heard.hurried = False
    wait_until(lambda: take.complete)


def test_a_broken_preset_is_reported_and_work_continues(small_preset, tmp_path, heard):
    broken = tmp_path / "broken.safetensors"
    broken.write_bytes(small_preset.read_bytes()[:100])
    heard.submit(broken)
    wait_until(lambda: heard.failed)
    assert str(broken) in heard.failed[0]
    heard.submit(small_preset)
    wait_until(lambda: heard.finished)


def test_a_runaway_model_alone_is_silenced(small_preset, heard, monkeypatch):
    advance = KoopmanVar.advance

    def faulty(
        self: KoopmanVar, state: KoopmanState, steps: int, readout: torch.Tensor | None = None
    ) -> tuple[torch.Tensor, KoopmanState]:
        frames, after = advance(self, state, steps, readout)
        return (frames * float("nan") if state.step >= 256 else frames), after

    monkeypatch.setattr(KoopmanVar, "advance", faulty)
    heard.submit(small_preset)
    wait_until(lambda: heard.finished)
    (take,) = heard.started
    assert take.model_ends_s == pytest.approx(256 / 4_000)
    for model, silent_from in ((take.motion_m("model"), 300), (take.listened.signals["model"].read(), 3_000)):
        assert np.isfinite(model).all() and not model[silent_from:].any()
    assert np.abs(take.motion_m("truth")[1_000:]).max() > 1e-4


def test_another_presets_model_moves_beside_it(small_preset, tmp_path, heard):
    """It may come later: the motion is not rendered again. One that is damaged is reported, and at rest."""
    other, broken = (tmp_path / f"{name}.safetensors" for name in ("other", "broken"))
    shutil.copy(small_preset, other)
    broken.write_bytes(b"damaged")
    heard.submit(small_preset, 0.4, 1.0, other)
    wait_until(lambda: heard.finished)
    (take,) = heard.started
    for series in (take.motions, take.listened.signals):
        wait_until(lambda series=series: series["preset:other"].complete)
        np.testing.assert_array_equal(series["preset:other"].read(), series["model"].read())
    heard.submit(small_preset, 0.4, 1.0, other, broken)
    wait_until(lambda: "preset:broken" in take.motions and take.motions["preset:broken"].complete)
    assert heard.failed[0].startswith("other_refused: broken: ") and "broken.safetensors" in heard.failed[0]
    assert not any(series["preset:broken"].read().any() for series in (take.motions, take.listened.signals))
    assert {*map(id, heard.started), *map(id, heard.finished)} == {id(take)}


def test_another_pluck_waits_for_none(small_preset, heard, monkeypatch):
    advance = SourceLine.advance

    def slow(line: SourceLine, samples: int) -> None:
        time.sleep(2 * samples / line.rate_hz)
        advance(line, samples)

    monkeypatch.setattr(SourceLine, "advance", slow)
    heard.submit(small_preset, seconds=30.0)
    wait_until(lambda: heard.started)
    heard.submit(small_preset, 0.6)
    wait_until(lambda: len(heard.started) == 2)
    monkeypatch.undo()
    wait_until(lambda: heard.finished)
    assert heard.finished[0] is heard.started[1]
    assert not heard.started[0].complete
