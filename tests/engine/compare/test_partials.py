"""Partials of decaying sinusoids whose errors are known."""

import math

import numpy as np
import pytest

from engine.compare import partials
from engine.compare.partials import Array, PartialErrors, partial_errors, segment_frames, track_partials
from engine.resonators.string import resonator_of
from engine.truth import ModalState, SplittingSolver
from engine.values.string import StringParameters

RATE_HZ = 4000.0
STRING = StringParameters()
LINEAR_HZ = (resonator_of(STRING, 10).eigenvalues().imag / (2 * math.pi)).tolist()  # 9 and 10 lie above half the rate
RESOLVED = [0, 1, 2, 3, 4, 5, 6, 8, 9]  # mode 8 is at 1994 Hz


def partial(time_s: Array, hz: Array, sigma: Array, level: float = 1.0, cycles: float = 0.1) -> Array:
    """Phasors (1, frames, modes)."""
    return (level * np.exp(-sigma * time_s + 2j * math.pi * (hz * time_s + cycles)))[None]


def errors(predicted: Array, truth: Array, *windows_s: tuple[float, float]) -> PartialErrors:
    track = track_partials(predicted, truth, segment_frames(RATE_HZ, LINEAR_HZ[0]))
    return partial_errors(track, RATE_HZ, LINEAR_HZ, windows_s)


def ten_modes(seconds: float = 2.0) -> tuple[Array, Array, Array]:
    """Times, frequencies, and decay rates so low that every mode is there throughout."""
    time_s = np.arange(1, round(seconds * RATE_HZ) + 1)[:, None] / RATE_HZ
    return time_s, np.array(LINEAR_HZ), np.linspace(1, 3, 10)


def test_detuning_level_and_decay_are_what_they_were_made():
    time_s, hz, sigma = ten_modes()
    cents, level_db = 2.0, 1.5
    detuned = hz * 2 ** (cents / 1200)
    predicted = partial(time_s, detuned, 0.9 * sigma, 10 ** (level_db / 20)).real
    found = errors(predicted, partial(time_s, hz, sigma), (0, 0.02), (0, 1), (1, 2), (0, 2))
    assert np.isnan(found.cents[0, :, 7]).all()  # not resolved
    whole = {name: getattr(found, name)[0, 3, RESOLVED] for name in ("frequency_hz", "cents", "t60_s")}
    assert whole["frequency_hz"] == pytest.approx(hz[RESOLVED], rel=1e-6)
    assert whole["cents"] == pytest.approx(cents, abs=0.002)
    assert whole["t60_s"] == pytest.approx(3 * math.log(10) / sigma[RESOLVED], rel=1e-6)
    assert found.t60_error_percent[0, 3, RESOLVED] == pytest.approx(100 / 0.9 - 100, abs=0.05)
    # at the start the level is what it was made; it rises by 0.1σ · 8.69 dB a second
    assert found.level_db[0, 0, RESOLVED] == pytest.approx(level_db, abs=0.05)
    # the phase runs ahead by the detuning in Hz each second: the mean is that of the middle
    for window, middle_s in ((1, 0.5), (2, 1.5), (3, 1.0)):
        expected = (detuned - hz)[RESOLVED] * middle_s
        assert found.phase_cycles[0, window, RESOLVED] == pytest.approx(expected, rel=2e-3)
    # a row of the summary holds magnitudes
    (row, *_) = found.by_mode(3)
    assert (row.mode, row.trajectories, row.cents) == (1, 1, pytest.approx(cents, abs=0.002))
    assert found.weighted(3).cents == pytest.approx(cents, abs=0.002)


@pytest.mark.parametrize("cycles", [-0.4, -0.25, 0.125, 0.45])
def test_a_phase_is_reported_with_its_sign_below_and_above_half_the_rate(cycles):
    time_s, hz, sigma = ten_modes(0.5)
    truth = partial(time_s, hz, sigma)
    found = errors(partial(time_s, hz, sigma, 0.5, 0.1 + cycles).real, truth, (0, 0.5))
    assert found.phase_cycles[0, 0, RESOLVED] == pytest.approx(cycles, abs=1e-9)
    assert found.cents[0, 0, RESOLVED] == pytest.approx(0, abs=1e-6)
    assert found.level_db[0, 0, RESOLVED] == pytest.approx(20 * math.log10(0.5), abs=1e-9)
    flat = errors(partial(time_s, hz * 2 ** (-3 / 1200), sigma).real, truth, (0, 0.5))
    assert flat.cents[0, 0, RESOLVED] == pytest.approx(-3, abs=0.005)  # although its alias is sharp


def test_a_glide_is_reported_of_truth_and_prediction():
    """Frequencies that fall in a straight line, the prediction's further: between the thirds' middles two thirds."""
    time_s, hz, sigma = ten_modes(1)

    def gliding(fall: float) -> Array:  # relative, in the whole second
        fallen_s = time_s - fall * time_s**2 / 2
        return np.exp(-sigma * time_s + 2j * math.pi * hz * fallen_s)[None]

    found = errors(gliding(0.02).real, gliding(0.01), (0, 1), (0, 0.05))
    true, predicted = (1200 * math.log2((1 - fall / 6) / (1 - 5 * fall / 6)) for fall in (0.01, 0.02))
    # segments of 5 ms: the thirds are 66 and 67 of 200
    assert found.glide_cents[0, 0, RESOLVED] == pytest.approx(true, rel=5e-3)
    assert found.glide_error_cents[0, 0, RESOLVED] == pytest.approx(predicted - true, rel=0.02)
    assert np.isnan(found.glide_cents[0, 1]).all()  # ten segments have no thirds of four
    assert np.isnan(found.glide_error_cents[0, 1]).all()
    assert found.weighted(0).glide_error_cents == pytest.approx(predicted - true, rel=0.02)


def test_predictions_that_are_silent_weak_not_numbers_or_grow():
    time_s, hz, sigma = ten_modes(1)
    sigma[4] = 0.1  # 0.9 dB a second: too little for a T60
    truth, growing = partial(time_s, hz, sigma), partial(time_s, hz, -sigma).real
    broken = truth.real.copy()
    broken[:, :, 0], broken[:, :, 1], broken[:, 2000:, 2] = 0, 0.01 * truth.real[:, :, 1], math.nan
    broken[:, :, 3:] = growing[:, :, 3:]
    found = errors(broken, truth, (0, 0.4), (0.6, 1), (0, 1))
    assert found.level_db[0, :2, 0].tolist() == [-math.inf, -math.inf]
    assert found.level_db[0, :2, 1] == pytest.approx(-40)
    assert found.level_db[0, 0, 2] == pytest.approx(0, abs=1e-9)
    assert found.level_db[0, 1, 2] == math.inf
    assert np.isnan(found.phase_cycles[0, 1, :3]).all()
    assert np.isnan(found.cents[0, 0, :2]).all()
    assert found.weighted(1).level_db == math.inf
    assert np.isnan(found.t60_s[0, 2, 4]) and np.isnan(found.t60_error_percent[0, 2, 4])
    assert found.by_mode(2)[3].t60_error_percent == math.inf


def test_the_phasors_of_a_linear_string_are_exact_and_those_of_a_tense_one_circles():
    eigenvalues, spacing_s = resonator_of(STRING, 10).eigenvalues(), 1 / 16_000
    expected = np.linspace(1, 2, 10) * np.exp(eigenvalues * np.linspace(0, 0.1, 50)[:, None])
    around = [(expected * np.exp(eigenvalues * offset)).real for offset in (-spacing_s, 0, spacing_s)]
    found = partials.phasors(*around, spacing_s, resonator_of(STRING, 10, tension_modulated=False))
    assert np.allclose(found, expected, rtol=0, atol=1e-12)
    # one mode alone, whose tension rises by 5 %: ellipses, if its frequency were taken to be that at rest
    state = ModalState.at_rest(np.array([[0.0137]]))
    assert resonator_of(STRING, 1).relative_tension_rise(state.amplitude) == pytest.approx(0.05, abs=0.01)
    samples = SplittingSolver(resonator_of(STRING, 1), 16_000).solve(state, 4000)
    around, roundness = [samples[:, :-2], samples[:, 1:-1], samples[:, 2:]], []
    for modulated in (True, False):
        z = partials.phasors(*around, spacing_s, resonator_of(STRING, 1, tension_modulated=modulated))
        roundness.append(float(np.linalg.norm(z.imag) / np.linalg.norm(z.real)))
    assert roundness[0] == pytest.approx(1, abs=0.002)
    assert roundness[1] > 1.01


def test_a_partial_is_reported_of_while_it_is_there():
    """None where it never was, is under the floor, or where there is no whole segment."""
    time_s, hz, sigma = ten_modes(2)
    levels = np.ones(10)
    sigma[:] = 1.0
    levels[2:5] = 0, 0.9e-3, 1.1e-3
    sigma[5] = 30.0  # 60 dB below the others, which lose 3 dB or so, after a quarter of a second
    truth = partial(time_s, hz, sigma) * levels
    found = errors(truth.real, truth, (0, 1), (1, 2))
    assert np.isnan(found.level_db[0, 0]).tolist() == [n in (2, 3, 7) for n in range(10)]
    assert (found.by_mode(0)[2].level_db, found.by_mode(0)[2].trajectories) == (None, 0)
    assert found.t60_s[0, 0, 5] == pytest.approx(3 * math.log(10) / 30, rel=1e-6)
    assert found.level_db[0, 0, 5] == pytest.approx(0, abs=1e-4)
    assert np.isnan(found.t60_s[0, 1]).tolist()[5:7] == [True, False]
    short, silence = partial(*ten_modes(0.004)), np.zeros((2, 400, 10))
    for predicted, true in ((short.real, short), (silence, silence.astype(complex))):
        nothing = errors(predicted, true, (0, 1))
        assert np.isnan(nothing.level_db).all() and nothing.weighted(0).level_db is None
    with pytest.raises(ValueError, match="differ in shape"):
        track_partials(np.zeros((1, 40, 2)), np.zeros((1, 40, 3), complex), 20)
