"""A track grows block by block; what is ready is finite, complete and final."""

import threading

import numpy as np
import pytest

from app.audio import Track

RATE_HZ = 48_000


def make_track(length_frames: int = 1000) -> Track:
    return Track(RATE_HZ, length_frames, ("model", "truth"))


def test_appended_blocks_are_read_back() -> None:
    track = make_track()
    model, truth = np.random.default_rng(0).uniform(-1, 1, (2, 1000)).astype(np.float32)
    for start, stop in ((0, 1), (1, 65), (65, 1000)):
        track.append({"model": model[start:stop], "truth": truth[start:stop]})
        assert track.ready_frames == stop
    assert track.complete
    np.testing.assert_array_equal(track.read("model", 0, 1000), model)
    np.testing.assert_array_equal(track.read("truth", 60, 70), truth[60:70])


def test_reading_stops_at_what_is_ready() -> None:
    track = make_track()
    track.append({"model": np.ones(10), "truth": np.zeros(10)})
    assert track.read("model", 5, 50).shape == (5,)
    assert track.read("model", 50, 60).shape == (0,)
    with pytest.raises(ValueError, match="read-only"):
        track.read("model", 0, 5)[0] = 2


def test_finish_ends_a_track_early() -> None:
    track = make_track()
    track.append({"model": np.ones(10), "truth": np.zeros(10)})
    assert not track.complete
    track.finish()
    assert track.complete
    assert track.ready_frames == 10
    with pytest.raises(ValueError, match="finished"):
        track.append({"model": np.ones(1), "truth": np.ones(1)})


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e300])
def test_a_sample_that_is_not_finite_is_named_and_nothing_is_added(value: float) -> None:
    track = make_track(RATE_HZ)
    track.append({"model": np.zeros(24_000), "truth": np.zeros(24_000)})
    wrong = np.zeros(100)
    wrong[48] = value
    with pytest.raises(ValueError, match=r"'truth' is not finite at 0\.501000 s"):
        track.append({"model": np.zeros(100), "truth": wrong})
    assert track.ready_frames == 24_000


@pytest.mark.parametrize(
    ("blocks", "message"),
    [
        ({"model": np.zeros(5)}, "needs the sources"),
        ({"model": np.zeros(5), "truth": np.zeros(5), "other": np.zeros(5)}, "needs the sources"),
        ({"model": np.zeros(5), "truth": np.zeros(6)}, "one shape"),
        ({"model": np.zeros((5, 2)), "truth": np.zeros((5, 2))}, "one shape"),
        ({"model": np.zeros(1001), "truth": np.zeros(1001)}, "do not fit"),
    ],
)
def test_wrong_blocks_are_refused(blocks: dict[str, np.ndarray], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make_track().append(blocks)


def test_wrong_tracks_are_refused() -> None:
    with pytest.raises(ValueError, match="sample rate"):
        Track(0, 10, ("model",))
    with pytest.raises(ValueError, match="different source names"):
        Track(RATE_HZ, 10, ("model", "model"))
    with pytest.raises(ValueError, match="no source 'other'"):
        make_track().read("other", 0, 1)


def test_a_reader_in_another_thread_sees_only_complete_samples() -> None:
    frames = 20_000
    track = make_track(frames)
    ramp = np.arange(1, frames + 1, dtype=np.float32)

    def write() -> None:
        for start in range(0, frames, 50):
            block = ramp[start : start + 50]
            track.append({"model": block, "truth": block})

    writer = threading.Thread(target=write)
    writer.start()
    while not track.complete:
        ready = track.ready_frames
        np.testing.assert_array_equal(track.read("truth", 0, ready), ramp[:ready])
    writer.join()


def test_a_stereo_track_takes_pairs_only() -> None:
    track = Track(RATE_HZ, 100, ("model",), channels=2)
    pairs = np.random.default_rng(0).uniform(-1, 1, (100, 2)).astype(np.float32)
    with pytest.raises(ValueError, match=r"\(frames, 2\)"):
        track.append({"model": pairs[:, 0]})
    broken = pairs.copy()
    broken[48, 1] = np.nan
    with pytest.raises(ValueError, match=r"0\.001000 s"):
        track.append({"model": broken})
    track.append({"model": pairs})
    np.testing.assert_array_equal(track.read("model", 10, 20), pairs[10:20])
    with pytest.raises(ValueError, match="1 or 2 channels"):
        Track(RATE_HZ, 100, ("model",), channels=3)
