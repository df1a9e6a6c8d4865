"""Relative errors and spectral distances by hand; what an ear finds on sums of decaying partials."""

import math

import numpy as np
import pytest
import torch

from engine.compare import audible, relative
from engine.compare.audible import audible_errors, heard_level_db
from engine.compare.relative import ErrorSums, ErrorWindows, RelativeError, error_to_signal, relative_error
from engine.compare.spectra import FLOOR_DB, log_spectral_distance, spectral_distances


@pytest.mark.parametrize(
    ("predicted", "truth", "rel_mse", "rel_mae"),
    [
        ([[1.0, -2.0], [2.0, 1.0]], [[1.0, -1.0], [2.0, 0.0]], 2 / 6, 2 / 4),
        ([[0.0, 0.0], [0.0, 0.0]], [[1.0, -1.0], [2.0, 0.5]], 1, 1),
        ([[0.0, 0.0]], [[0.0, 0.0]], 0, 0),
        ([[1.0, 1.0]], [[0.0, 0.0]], math.inf, math.inf),
    ],
)
def test_errors_by_hand(predicted, truth, rel_mse, rel_mae):
    error = relative_error(torch.tensor([predicted]), torch.tensor([truth]))
    assert (error.rel_mse, error.rel_mae) == pytest.approx((rel_mse, rel_mae))
    with pytest.raises(ValueError, match="differ in shape"):
        relative_error(torch.zeros(1, 4, 2), torch.zeros(1, 4, 3))


def motions(*shape: int) -> tuple[torch.Tensor, torch.Tensor, ErrorSums]:
    """A prediction, a truth with a loud trajectory and a silent frame, and their sums."""
    generator, sums = torch.Generator().manual_seed(1), ErrorSums(shape[1])
    truth, predicted = (torch.randn(*shape, generator=generator, dtype=torch.float64) for _ in range(2))
    truth[0] *= 10
    truth[:, 2] = predicted[:, 2] = 0
    sums.add(predicted, truth)
    return predicted, truth, sums


def same(found: RelativeError, predicted: torch.Tensor, truth: torch.Tensor) -> bool:
    expected = relative_error(predicted, truth)
    return (found.rel_mse, found.rel_mae) == pytest.approx((expected.rel_mse, expected.rel_mae))


def test_windows_frames_trajectories_and_batches_have_their_own_errors():
    predicted, truth, sums = motions(5, 50, 3)
    assert same(sums.total(), predicted, truth) and same(sums.of(range(5)), predicted, truth)
    assert same(sums.total(20), predicted[:, :20], truth[:, :20])
    assert same(sums.of([0, 2]), predicted[[0, 2]], truth[[0, 2]])
    first, second = sums.windows(100.0, [0, 0.25, 0.5, 2.0, 3.0])
    assert same(first, predicted[:, :25], truth[:, :25]) and same(second, predicted[:, 25:], truth[:, 25:])
    assert (second.start_s, second.stop_s) == (0.25, 0.5)
    wrong = (predicted - truth).square().sum((1, 2))
    assert sums.shares() == pytest.approx((wrong / wrong.sum()).numpy())
    own = [relative_error(predicted[rows], truth[rows]) for rows in (slice(0, 2), slice(2, 4), slice(4, 5))]
    found = sums.mean_of_batches(2)
    assert found.rel_mse == pytest.approx(np.mean([error.rel_mse for error in own]))
    assert found.rel_mae == pytest.approx(np.mean([error.rel_mae for error in own]))
    assert found.rel_mse != pytest.approx(sums.total().rel_mse, rel=0.01)
    frames, trajectories = sums.per_frame(), sums.per_trajectory()
    assert (frames[0].shape, trajectories[0].shape, frames[0][2]) == ((50,), (5,), 0)
    for index, each in enumerate(zip(*frames, strict=True)):
        assert same(RelativeError(*each), predicted[:, [index]], truth[:, [index]])
    for row, each in enumerate(zip(*trajectories, strict=True)):
        assert same(RelativeError(*each), predicted[[row]], truth[[row]])
    assert sums.spread().rel_mse == pytest.approx(np.std(trajectories[0]))
    assert sums.spread().rel_mae == pytest.approx(np.std(trajectories[1]))
    with pytest.raises(ValueError, match="steps must lie in 1 … 50, not 51"):
        sums.total(51)


def spoilt(shares: list[float], loudness: list[float] | None = None) -> ErrorSums:
    """Sums of trajectories of one frame that are wrong by these shares of their amplitude."""
    truth = torch.tensor(loudness or [1.0] * len(shares), dtype=torch.float64)[:, None, None]
    sums = ErrorSums(1)
    sums.add(truth * (1 + torch.tensor(shares, dtype=torch.float64)[:, None, None]), truth)
    return sums


def test_a_standard_error_is_that_of_a_ratio_of_sums():
    """A quarter is ten times as loud: the deviation of a ratio to first order, √Σ(eᵢ - R tᵢ)² / Σtᵢ."""
    shares, loudness = [0.01, 0.01, 0.01, 0.2] * 100, [1.0, 1.0, 1.0, 10.0] * 100
    sums = spoilt(shares, loudness)
    truth, wrong = np.array(loudness) ** 2, (np.array(shares) * loudness) ** 2
    expected = np.sqrt(((wrong - sums.total().rel_mse * truth) ** 2).sum()) / truth.sum()
    found = sums.standard_error(20_000)
    assert found.rel_mse == pytest.approx(expected, rel=0.05)
    assert found.rel_mse < sums.spread().rel_mse / 20 / 5  # what the plain deviation of a mean would tell
    # of equal trajectories it is that of a mean: a draw with replacement is binomial
    assert spoilt([0.1, 0.3] * 50).standard_error(20_000).rel_mae == pytest.approx(0.1 / 100**0.5, rel=0.02)
    assert spoilt([0.5]).standard_error() == RelativeError(0, 0)
    assert spoilt([0.1, math.inf]).standard_error() == RelativeError(math.inf, math.inf)
    assert spoilt([0.0, 0.0]).shares().tolist() == [0, 0]
    for rel_mse, depth_db in ((1e-3, -30), (0, relative.NULL_FLOOR_DB), (math.inf, math.inf)):
        assert RelativeError(rel_mse, 0).null_depth_db == pytest.approx(depth_db)


def test_the_standard_error_of_some_frames_is_that_of_sums_over_them_alone():
    predicted, truth = np.random.default_rng(3).normal(size=(2, 12, 30, 4))
    whole, alone = ErrorSums(30, edges=[20, 10, 90]), ErrorSums(10)
    for first in (0, 7, 14, 21, 28):  # blocks that cross the edges
        whole.add(predicted[:, first : first + 7], truth[:, first : first + 7], first)
    alone.add(predicted[:, 10:20], truth[:, 10:20])
    found, wanted = whole.standard_error(first=10, last=20), alone.standard_error()
    assert (found.rel_mse, found.rel_mae) == pytest.approx((wanted.rel_mse, wanted.rel_mae))
    with pytest.raises(ValueError, match="edges"):
        whole.standard_error(first=11, last=20)


@pytest.mark.parametrize("value", [math.nan, math.inf, 1e200])
def test_what_is_no_number_is_an_infinite_error_from_then_on(value):
    predicted, truth, _ = motions(3, 10, 2)
    predicted[1, 5:] = value
    sums = ErrorSums(10)
    sums.add(predicted, truth)
    assert sums.total().rel_mse == sums.spread().rel_mse == math.inf
    assert math.isfinite(sums.total(5).rel_mse)
    assert np.isinf(sums.per_frame()[0]).tolist() == [False] * 5 + [True] * 5
    assert np.isinf(sums.per_trajectory()[0]).tolist() == [False, True, False]
    windows, ones = ErrorWindows(20, 0.01, 1_000), np.ones((20, 3))
    windows.add(np.where(np.arange(20)[:, None] == 15, np.nan, ones), ones)
    assert windows.curves["rmse"].tolist() == windows.curves["mae"].tolist() == [0.0, math.inf]
    assert windows.rel_mse == math.inf


@pytest.mark.parametrize("of", [np.asarray, torch.tensor])
def test_an_error_to_signal_ratio(of):
    truth = of([3.0, -4.0])
    assert error_to_signal(truth, truth) == 0
    assert error_to_signal(of([3.0, -3.0]), truth) == pytest.approx(1 / 25)
    assert error_to_signal(truth, 0 * truth, least=50) == 0.5
    assert error_to_signal(of([math.nan, 0.0]), truth) == math.inf


def sine(hz: float, samples: int = 4000, phase: float = 0.0) -> np.ndarray:
    return np.sin(2 * math.pi * hz * np.arange(samples) / 4000 + phase)[None]


def test_spectra_hear_a_gain_exactly_a_frequency_and_no_phase():
    noise = np.random.default_rng(0).standard_normal((3, 5000), np.float32)
    convergence, log_db = spectral_distances(2 * noise, noise)
    assert convergence.tolist() == pytest.approx([1, 1, 1])
    assert log_db.tolist() == pytest.approx([20 * math.log10(2)] * 3, rel=1e-3)
    assert [values.tolist() for values in spectral_distances(noise, noise)] == [[0, 0, 0], [0, 0, 0]]
    assert float(spectral_distances(sine(500, phase=1), sine(500))[0][0]) < 0.01
    convergence, log_db = spectral_distances(sine(700), sine(500))
    assert float(convergence[0]) == pytest.approx(2**0.5, rel=0.01)
    assert float(log_db[0]) > 1
    for samples in (1, 2, 3, 100, 511, 600):
        sound = 1 + sine(500, samples)
        assert float(spectral_distances(3 * sound, sound)[0][0]) == pytest.approx(2)


def test_spectra_of_silence_and_of_what_is_no_number():
    silence = np.zeros((1, 600))
    assert [float(value[0]) for value in spectral_distances(silence, silence)] == [0, 0]
    assert float(spectral_distances(sine(500, 600), silence)[0][0]) == math.inf
    quiet = 10 ** (FLOOR_DB / 20) / 10 * sine(1500)
    assert float(spectral_distances(sine(500) + quiet, sine(500))[1][0]) < 0.01  # below the floor
    for shapes, words in (((3, 4), "differ in shape"), ((0, 0), "at least one sample")):
        with pytest.raises(ValueError, match=words):
            spectral_distances(*(np.zeros((1, samples)) for samples in shapes))
    for value in (math.nan, math.inf):
        assert [float(v[0]) for v in spectral_distances(silence + value, sine(500, 600))] == [math.inf, math.inf]


def test_a_log_spectral_distance_is_a_gain_above_the_floor():
    noise = np.random.default_rng(0).standard_normal(5000)
    assert log_spectral_distance(noise, 2 * noise) == pytest.approx(20 * math.log10(2))
    assert log_spectral_distance(noise[:100], noise[:100] / 2) == pytest.approx(20 * math.log10(2), rel=0.05)
    assert log_spectral_distance(noise, 2 * noise, noise_power=1e6) == 0
    assert log_spectral_distance(0 * noise, 0 * noise) == 0


RATE_HZ = 24_000
PARTIALS_HZ = tuple(247.0 * n for n in range(1, 9))
SECONDS = 4.0
TIME_S = np.arange(round(SECONDS * RATE_HZ)) / RATE_HZ


def string(cents: float = 0.0, decay_db_s: float = 6.0) -> np.ndarray:
    """Partials of 6 dB an octave that decay alike."""
    ratio = 2 ** (cents / 1200)
    partials = (np.cos(2 * np.pi * hz * ratio * TIME_S + n) / (n + 1) for n, hz in enumerate(PARTIALS_HZ))
    return 0.1 * sum(partials, np.zeros_like(TIME_S)) * 10 ** (-decay_db_s / 20 * TIME_S)


def drifting(change_db: float) -> np.ndarray:
    """A gain that changes between 1 and 2.5 s."""
    return 10 ** (change_db / 20 * np.interp(TIME_S, (1, 2.5), (0, 1)))


def errors(model: np.ndarray, truth: np.ndarray | None = None):
    return audible_errors(model, string() if truth is None else truth, RATE_HZ, PARTIALS_HZ, 0.25)


def test_the_truth_itself_has_no_errors_whatever_its_phase_and_level():
    for factor in (1, -1):
        found = errors(factor * string())
        assert (found.distance_db, found.level_db, found.pitch_cents) == pytest.approx((0, 0, 0), abs=1e-9)
        assert (found.rise_db, found.split_cents) == (0, None)
    assert errors(2 * string()).level_db == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("cents", (-40.0, -13.0, 3.0, 13.0))
def test_a_detuned_string_is_reported_in_cents_and_only_so(cents):
    found = errors(string(cents))
    assert found.pitch_cents == pytest.approx(cents, abs=0.1)
    assert (found.split_cents, found.rise_db) == (None, 0)
    assert abs(found.level_db) < 0.05
    assert found.distance_db > 1


@pytest.mark.parametrize("change_db", (-8.0, -2.0, 5.0))
def test_a_level_that_changes_is_reported_against_the_truths(change_db):
    """A rise is one of the model's own level: the string's own decay is faster, or there is none."""
    found = errors(drifting(change_db) * string())
    assert found.level_db == pytest.approx(change_db, abs=0.01)
    assert found.pitch_cents == pytest.approx(0, abs=0.05)
    assert found.rise_db == 0
    assert 0.4 < found.distance_db / abs(change_db) < 0.6
    rise_db = errors(drifting(change_db) * string(decay_db_s=0)).rise_db
    assert rise_db == pytest.approx(max(change_db, 0), abs=0.01)


@pytest.mark.parametrize("cents", (6.0, 22.0, 40.0))
def test_two_pitches_where_the_truth_has_one_are_reported_with_their_distance(cents):
    both = string() + 0.5 * string(cents)
    found = errors(both)
    assert found.split_cents == pytest.approx(cents, abs=0.5)
    assert found.pitch_cents == pytest.approx(0, abs=0.5)
    assert errors(string() + 0.05 * string(cents)).split_cents is None  # 26 dB below: its level swings by 0.9 dB
    assert errors(both, both).split_cents is None


def test_what_is_not_heard_does_not_count_and_silence_is_finite():
    """A string that rests beside its place, and what lies far below the loudest."""
    hiss, silent = 1e-6 * np.random.default_rng(0).standard_normal(len(TIME_S)), np.zeros_like(TIME_S)
    for beside in (0.05, hiss):
        found = errors(string() + beside)
        assert found.level_db == pytest.approx(0, abs=0.01)
        assert found.distance_db < 0.01
    assert errors(np.where(TIME_S < 1, string(), 0)).level_db == -audible.FLOOR_DB
    assert errors(silent).pitch_cents is None
    assert errors(silent, silent).distance_db == 0
    assert np.isfinite(errors(string(), silent).distance_db)


def test_a_level_is_a_sines_amplitude_whatever_it_rests_on():
    time_s = np.arange(RATE_HZ // 2) / RATE_HZ
    for hz in (247.0, 1003.3):
        assert heard_level_db(1e-3 * np.sin(2 * np.pi * hz * time_s) + 0.1, RATE_HZ) == pytest.approx(-60, abs=0.1)
    assert heard_level_db(0.5 * np.sin(2 * np.pi * 4 * time_s), RATE_HZ) < -60  # nobody hears it
    assert heard_level_db(np.zeros(RATE_HZ // 2), RATE_HZ) == -200
