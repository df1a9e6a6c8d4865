"""Pictures, flashes and signals of a pluck against its sources in one piece."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from app.playing.sources import Sources
from app.rendering import SOURCES, BlowTake, NoteSound, Take
from app.rendering.job import RenderJob
from engine.compare.relative import ErrorSums
from engine.pluck import Pluck
from engine.presets import SHIPPED
from engine.resonators.sine_transform import project
from engine.sources import StringSource
from engine.values.ear import Ear
from engine.voices.ear import weights_of

STUDIO = SHIPPED / "studio_nylon_b3.safetensors"  # a bank, of which any frame can be had
ANY_STRING = SHIPPED / "studio_any_string.safetensors"  # steps that cost little
NETWORK = SHIPPED / "nylon_linear_gaussian_16k_koopman_var.safetensors"  # no bank: every frame
STEPS = SHIPPED / "nylon_linear_gaussian_16k_lru.safetensors"  # nor here, which steps
PRESETS = pytest.mark.parametrize("preset", [STUDIO, ANY_STRING, NETWORK, STEPS], ids=lambda path: path.stem)
EARS = pytest.mark.parametrize(
    "ear", [Ear((0.37,)), Ear((0.2, 0.7), "velocity"), Ear((0.3,), solo=2)], ids=["one", "stereo velocity", "solo"]
)
PLUCK = Pluck(0.3, 3.0)
Render = Callable[..., RenderJob]


class Heard:
    """Hears what a job says."""

    def __init__(self) -> None:
        self.finished: Take | None = None

    def say(self, signal_name: str, take: Take | BlowTake, *_: str) -> None:
        assert signal_name in ("started", "finished")
        assert take.ready_frames > 1
        if signal_name == "finished":
            assert isinstance(take, Take)
            assert take.complete
            assert take.listened.complete
            assert self.finished is None
            self.finished = take


@pytest.fixture(scope="module")
def sources() -> Sources:
    return Sources()


@pytest.fixture
def job(sources: Sources) -> Iterator[Callable[..., RenderJob]]:
    """A job of a preset for a quarter of a second, nothing of it done."""
    helper = ThreadPoolExecutor(1)

    def made(preset: Any, **changes: Any) -> RenderJob:
        request = replace(NoteSound(preset, PLUCK, 0.25, Ear((0.37,)), 0.004), **changes)
        return RenderJob(request, sources.load, Heard().say, helper)

    yield made
    helper.shutdown()


def finished(job: RenderJob) -> Take:
    while not job.idle:
        job.advance()
    assert job.take is not None
    return job.take


def frames_m(source: StringSource, take: Take) -> NDArray[np.float64]:
    """Every frame in one piece, float64 (frames, grid_points)."""
    initial_m = project(PLUCK.displacement(source.grid_points), take.info.modes)[None]
    following, _ = source.advance(source.start(initial_m), round(take.seconds * take.info.rate_hz))
    return np.concatenate([initial_m[:, None], following], axis=1)[0]


@PRESETS
def test_pictures_and_flashes_are_frames_of_the_motion(preset: Any, job: Render, sources: Sources) -> None:
    take, loaded = finished(job(preset)), sources.load(preset)
    assert take.stride == {STUDIO: 8, ANY_STRING: 8, NETWORK: 1, STEPS: 1}[preset]
    for name, source in (("model", loaded.model), ("truth", loaded.truth)):
        every = frames_m(source, take)
        near = 1e-5 * np.abs(every).max()
        motion = take.motions[name]
        assert motion.complete
        np.testing.assert_allclose(motion.read(), every[:: take.stride], atol=near)
        for position_s in (0.0, 0.0613, 0.1871, 0.25):
            assert motion.flashes is not None
            strobe = motion.flashes.strobe
            shown = strobe.times_s[strobe.flash(position_s)] * take.info.rate_hz
            before = min(int(shown), len(every) - 2)
            expected = every[before] * (before + 1 - shown) + every[before + 1] * (shown - before)
            np.testing.assert_allclose(motion.shape_m(position_s), expected, atol=near)


@PRESETS
@EARS
def test_a_signal_is_what_is_heard_of_the_motion(
    preset: Any, ear: Ear, job: Render, sources: Sources, derivative: Callable[..., np.ndarray]
) -> None:
    """From the first frame to the last, except the truth's voice, which leaves out what is 108 dB below the rest."""
    take, loaded = finished(job(preset, ear=ear)), sources.load(preset)
    rate_hz = take.info.rate_hz
    for name, source in (("model", loaded.model), ("truth", loaded.truth)):
        expected = frames_m(source, take) @ weights_of(ear, source.grid_points)
        if ear.pickup == "velocity":
            expected = derivative(expected, rate_hz)
        found = take.listened.signals[name].read()
        assert found.shape == expected.shape
        # frame 0 of a model is what it makes of the displacement; beyond the end a voice continues
        inner = slice(40, len(expected) - 40) if ear.pickup == "velocity" else slice(1, None)
        error = np.square(found[inner] - expected[inner]).mean() / np.square(expected[inner]).mean()
        assert np.sqrt(error) < 4e-5


@PRESETS
@EARS
def test_a_listening_point_that_moves_hears_what_one_there_would_have_heard(
    preset: Any, ear: Ear, job: Render
) -> None:
    """Half-way and afterwards; the pictures stay."""
    there = finished(job(preset, ear=ear))
    moved = job(preset)
    for _ in range(2):
        moved.advance()
    take = moved.take
    assert take is not None
    for _ in range(2):
        moved.ask_again(replace(moved.request, ear=ear))
        assert finished(moved) is take
        for name in SOURCES:
            signal = take.listened.signals[name].read()
            expected = there.listened.signals[name].read()
            np.testing.assert_allclose(signal, expected, atol=1e-6 * np.abs(expected).max())
            np.testing.assert_array_equal(take.motion_m(name), there.motion_m(name))
        moved.ask_again(replace(moved.request, ear=Ear((0.37,))))
        finished(moved)


def test_while_a_point_is_dragged_what_is_drawn_is_whole(job: Render) -> None:
    """And it follows, though no point stays long enough."""
    made = job(NETWORK)
    take = finished(made)
    seen = []
    for number in range(40):
        made.ask_again(replace(made.request, ear=Ear((0.1 + 0.02 * number,))))
        made.advance()
        assert take.listened.complete
        seen.append(take.listened.ear.points[0])
    assert len(set(seen)) > 5
    assert finished(made).listened.ear == Ear((0.1 + 0.02 * 39,))


@PRESETS
@pytest.mark.parametrize("blocks", [2, 1_000])
def test_another_speed_shows_what_it_would_have_shown(preset: Any, blocks: int, job: Render) -> None:
    """Half-way and afterwards."""
    there = finished(job(preset, speed=0.02))
    slower = job(preset)
    while not slower.idle and blocks:
        slower.advance()
        blocks -= 1
    assert slower.take is not None
    for speed in (1.0, 0.02):
        slower.ask_again(replace(slower.request, speed=speed))
        slower.advance()
        for name in SOURCES:  # what was shown is, until the other is there
            motion = slower.take.motions[name]
            flashes, middle_s = motion.flashes, 0.5 * motion.ready_frames / motion.rate_hz
            assert flashes is not None and flashes.ready > flashes.strobe.flash(middle_s)
    take = finished(slower)
    for name in SOURCES:
        near = 1e-6 * np.abs(there.motion_m(name)).max()
        for position_s in np.linspace(0, take.seconds, 20):
            expected = there.motions[name].shape_m(position_s)
            np.testing.assert_allclose(take.motions[name].shape_m(position_s), expected, atol=near)


def test_the_error_that_is_reported_is_that_of_every_frame(job: Render, sources: Sources) -> None:
    """Of a model whose relative MSE is 1e-8: far below what a voice keeps."""
    made = job(STUDIO, pluck=PLUCK)
    take, loaded = finished(made), sources.load(STUDIO)
    model, truth = (frames_m(source, take)[None, 1:] for source in (loaded.model, loaded.truth))
    every = ErrorSums(model.shape[1])
    every.add(model, truth)
    assert every.total().rel_mse < 2e-7
    reported = take.errors.total()
    assert reported.rel_mse == pytest.approx(every.total().rel_mse, rel=0.06)
    assert reported.rel_mae == pytest.approx(every.total().rel_mae, rel=0.03)


def test_ten_seconds_take_few_megabytes(job: Render) -> None:
    made = job(STUDIO, seconds=10.0, ear=Ear((0.2, 0.7)))
    made.advance()
    take = made.take
    assert take is not None
    for name in SOURCES:
        series = (take.motions[name], take.listened.signals[name])
        assert sum(np.dtype(np.float32).itemsize * each.frames * each.places for each in series) < 30e6
