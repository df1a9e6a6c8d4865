"""Pictures, flashes, errors and signals of a pluck against its sources in one piece, however a take grows."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from app.playing.sources import Sources
from app.rendering import SOURCES, BlowTake, NoteSound, Take
from app.rendering.job import RenderJob
from app.rendering.strobe import FLASH_HZ, Flashes, Strobe
from engine.compare.relative import ErrorSums
from engine.pluck import Pluck
from engine.presets import SHIPPED, read_info
from engine.resonators.sine_transform import project
from engine.sources import StringSource
from engine.values.ear import Ear
from engine.voices.ear import weights_of
from tests.app.takes import append_to

random = np.random.default_rng(3)
TRUTH = random.standard_normal((1501, 101)).astype(np.float32)
MODEL = TRUTH + 0.1 * random.standard_normal((1501, 101)).astype(np.float32)
HZ = 247.0


@pytest.fixture
def take(small_preset: Path) -> Take:
    """A take at 4 kHz, without a frame."""
    return Take("small", read_info(small_preset), Pluck(0.35, 4.0), 1500 / 4000, Ear((0.5,)))


def test_windows_are_the_engines_however_the_take_grows(take):
    course = take.error_course
    for stop in (1, 7, 33, 34, 900, 1501):
        append_to(take, MODEL[take.ready_frames : stop], TRUTH[take.ready_frames : stop])
    assert course.ready == course.windows
    sums = ErrorSums(1500)
    sums.add(*(motion[None, 1:] for motion in (MODEL, TRUTH)))
    expected = sums.windows(take.info.rate_hz, list(np.arange(course.windows + 1) * course.window_s))
    assert course.curves["mae"] == pytest.approx([window.rel_mae for window in expected])
    assert course.curves["rmse"] == pytest.approx([window.rel_mse**0.5 for window in expected])
    assert course.middle_s[-1] < take.seconds


@pytest.mark.parametrize(("gain", "level_db"), [(2, 20 * np.log10(2)), (0, np.nan)])
def test_a_louder_or_a_silent_model(take, gain, level_db):
    append_to(take, gain * TRUTH, TRUTH)
    curves = take.error_course.curves
    assert curves["level_db"][0] == pytest.approx(level_db, nan_ok=True)
    assert curves["rmse"][0] == curves["mae"][0] == pytest.approx(1)


def test_slow_motion_stays_within_a_period_of_the_playhead_and_moves_slowly():
    places_s = np.arange(FLASH_HZ + 1) / FLASH_HZ
    times_s = Strobe(0.004, HZ, 1.0).times_s
    assert np.abs(times_s - places_s).max() <= 1 / HZ
    turns = np.diff(np.unwrap(2 * np.pi * (times_s[:-1] * HZ % 1.0))) / (2 * np.pi)
    assert turns == pytest.approx(np.full(len(turns), 0.004 * HZ / FLASH_HZ), abs=1e-6)
    assert Strobe(1.0, HZ, 1.0).times_s == pytest.approx(places_s), "in real time the playhead itself"


@pytest.mark.parametrize("block", [1, 7, 100, 5_000])
def test_flashes_lie_between_the_frames_around_them_however_they_come(block):
    rate_hz, frames, ready = 1_000, 1_001, [0]
    strobe = Strobe(0.01, HZ, 1.0)
    places_s = (-1.0, 0.0, 1.4 / FLASH_HZ, 0.999, 1.0, 9.0)
    assert [strobe.flash(place_s) for place_s in places_s] == [0, 0, 1, FLASH_HZ - 1, FLASH_HZ, FLASH_HZ]
    flashes = Flashes(strobe, rate_hz, frames, 101)
    for first in range(0, frames, block):
        stop = min(first + block, frames)
        numbers = flashes.needed(first, stop)
        flashes.take(stop, numbers, TRUTH[numbers])
        ready.append(flashes.ready)
        assert strobe.times_s[: flashes.ready].max(initial=0) * rate_hz <= stop
    assert ready == sorted(ready) and ready[-1] == len(strobe.times_s)
    for index, time_s in enumerate(strobe.times_s):
        before = min(int(time_s * rate_hz), frames - 2)
        share = time_s * rate_hz - before
        assert flashes.shape_m(index) == pytest.approx(
            TRUTH[before] * (1 - share) + TRUTH[before + 1] * share, abs=1e-5
        )
    assert flashes.shape_m(flashes.ready) is None


STUDIO = SHIPPED / "studio_nylon_b3.safetensors"  # a bank, of which any frame can be had
ANY_STRING = SHIPPED / "studio_any_string.safetensors"  # steps that cost little
NETWORK = SHIPPED / "nylon_linear_gaussian_16k_koopman_var.safetensors"  # no bank: every frame
STEPS = SHIPPED / "nylon_linear_gaussian_16k_lru.safetensors"  # nor here, which steps
STRIDES = {STUDIO: 8, ANY_STRING: 8, NETWORK: 1, STEPS: 1}
PRESETS = pytest.mark.parametrize("preset", STRIDES, ids=lambda path: path.stem)
EARS = (Ear((0.37,)), Ear((0.2, 0.7), "velocity"), Ear((0.3,), solo=2))
PLUCK = Pluck(0.3, 3.0)
Render = Callable[..., RenderJob]


class Heard:
    """A listener that takes one end of a complete take."""

    finished: Take | BlowTake | None = None

    def say(self, signal_name: str, take: Take | BlowTake, *_: str) -> None:
        assert signal_name in ("started", "finished") and take.ready_frames > 1
        if signal_name == "finished":
            assert take.complete and take.listened.complete and self.finished is None
            self.finished = take


@pytest.fixture(scope="module")
def sources() -> Sources:
    return Sources()


@pytest.fixture
def job(sources: Sources) -> Iterator[Render]:
    """A job of a preset for a quarter of a second, nothing of it done."""
    with ThreadPoolExecutor(1) as helper:

        def made(preset: Any, **changes: Any) -> RenderJob:
            request = replace(NoteSound(preset, PLUCK, 0.25, EARS[0], 0.004), **changes)
            return RenderJob(request, sources.load, Heard().say, helper)

        yield made


def finished(job: RenderJob) -> Take:
    while not job.idle:
        job.advance()
    assert isinstance(job.take, Take)
    return job.take


def frames_m(source: StringSource, take: Take) -> NDArray[np.float64]:
    """Every frame in one piece, float64 (frames, grid_points)."""
    initial_m = project(PLUCK.displacement(source.grid_points), take.info.modes)[None]
    following, _ = source.advance(source.start(initial_m), round(take.seconds * take.info.rate_hz))
    return np.concatenate([initial_m[:, None], following], axis=1)[0]


@PRESETS
def test_pictures_and_flashes_are_frames_of_the_motion(preset, job, sources):
    take, loaded = finished(job(preset)), sources.load(preset)
    assert take.stride == STRIDES[preset]
    for name, source in (("model", loaded.model), ("truth", loaded.truth)):
        every, motion = frames_m(source, take), take.motions[name]
        near = 1e-5 * np.abs(every).max()
        assert motion.complete and motion.flashes is not None
        np.testing.assert_allclose(motion.read(), every[:: take.stride], atol=near)
        strobe = motion.flashes.strobe
        for position_s in (0.0, 0.0613, 0.1871, 0.25):
            shown = strobe.times_s[strobe.flash(position_s)] * take.info.rate_hz
            before = min(int(shown), len(every) - 2)
            expected = every[before] * (before + 1 - shown) + every[before + 1] * (shown - before)
            np.testing.assert_allclose(motion.shape_m(position_s), expected, atol=near)


@PRESETS
@pytest.mark.parametrize("ear", EARS, ids=["one", "stereo velocity", "solo"])
def test_a_signal_is_that_of_the_motion_also_where_a_point_moves_to(preset, ear, job, sources, derivative):
    """Up to what the truth's voice leaves out, 108 dB below the rest. It moves half-way and afterwards."""
    there, loaded = finished(job(preset, ear=ear)), sources.load(preset)
    for name, source in (("model", loaded.model), ("truth", loaded.truth)):
        expected = frames_m(source, there) @ weights_of(ear, source.grid_points)
        if ear.pickup == "velocity":
            expected = derivative(expected, there.info.rate_hz)
        found = there.listened.signals[name].read()
        assert found.shape == expected.shape
        # frame 0 of a model is what it makes of the displacement; beyond the end a voice continues
        inner = slice(40, len(expected) - 40) if ear.pickup == "velocity" else slice(1, None)
        error = np.square(found[inner] - expected[inner]).mean() / np.square(expected[inner]).mean()
        assert np.sqrt(error) < 4e-5
    moved = job(preset)
    for _ in range(2):
        moved.advance()
    for _ in range(2):
        moved.ask_again(replace(moved.request, ear=ear))
        take = finished(moved)
        for name in SOURCES:
            signal, expected = (each.listened.signals[name].read() for each in (take, there))
            np.testing.assert_allclose(signal, expected, atol=1e-6 * np.abs(expected).max())
            np.testing.assert_array_equal(take.motion_m(name), there.motion_m(name))
        moved.ask_again(replace(moved.request, ear=EARS[0]))
        assert finished(moved) is take


@PRESETS
@pytest.mark.parametrize("blocks", [2, 1_000])
def test_another_speed_shows_what_it_would_have_shown(preset, blocks, job):
    there, slower = finished(job(preset, speed=0.02)), job(preset)
    while not slower.idle and blocks:
        slower.advance()
        blocks -= 1
    for speed in (1.0, 0.02):
        slower.ask_again(replace(slower.request, speed=speed))
        slower.advance()
        for name in SOURCES:  # what was shown is, until the other is there
            motion = slower.take.motions[name]  # type: ignore[union-attr]
            flashes, middle_s = motion.flashes, 0.5 * motion.ready_frames / motion.rate_hz
            assert flashes is not None and flashes.ready > flashes.strobe.flash(middle_s)
    take = finished(slower)
    for name in SOURCES:
        for position_s in np.linspace(0, take.seconds, 20):
            shown, expected = (each.motions[name].shape_m(position_s) for each in (take, there))
            np.testing.assert_allclose(shown, expected, atol=1e-6 * np.abs(there.motion_m(name)).max())


def test_the_error_that_is_reported_is_that_of_every_frame(job, sources):
    take, loaded = finished(job(STUDIO)), sources.load(STUDIO)
    model, truth = (frames_m(source, take)[None, 1:] for source in (loaded.model, loaded.truth))
    sums = ErrorSums(model.shape[1])
    sums.add(model, truth)
    every, found = sums.total(), take.errors.total()
    assert every.rel_mse < 2e-7
    assert found.rel_mse == pytest.approx(every.rel_mse, rel=0.06)
    assert found.rel_mae == pytest.approx(every.rel_mae, rel=0.03)


def test_ten_seconds_take_few_megabytes(job):
    made = job(STUDIO, seconds=10.0, ear=EARS[1])
    made.advance()
    for name in SOURCES:
        series = (made.take.motions[name], made.take.listened.signals[name])  # type: ignore[union-attr]
        assert sum(np.dtype(np.float32).itemsize * each.frames * each.places for each in series) < 30e6
