"""What is learned and reported of a note against its truth, its baselines, and its recording."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import signal

from engine.presets import load_preset
from tests.training.recording.synthetic import modelled_note
from training.recording.attack import FADED_S, WHOLE_S, attack_force, first_distance_db
from training.recording.learn import Learned, combined
from training.recording.note import Note
from training.recording.physics import Partial
from training.recording.preset import recorded_note, recorded_string, write_preset
from training.recording.report import bands_of, errors_of, figures

RATE_HZ = 44_100
T60_S = {125.0: 1.5, 500.0: 1.0, 2_000.0: 0.6, 8_000.0: 0.3}
T = np.arange(2 * RATE_HZ) / RATE_HZ


def test_an_octave_decays_as_its_tone_and_one_that_is_noise_has_no_decay():
    tones = [np.exp(-math.log(1000) / t60 * T) * np.sin(2 * math.pi * hz * T) for hz, t60 in T60_S.items()]
    noise = 1e-4 * np.random.default_rng(0).standard_normal(len(T))
    found = {band.hz: band for band in bands_of(np.sum(tones, axis=0) + noise, 0.1 * tones[1], RATE_HZ, 1e-8)}
    assert {hz: found[hz].recorded_t60_s for hz in T60_S} == pytest.approx(T60_S, rel=0.02)
    assert found[500.0].learned_t60_s == pytest.approx(T60_S[500.0], rel=0.02)
    assert bands_of(noise, noise, RATE_HZ, 1e-8) == ()


@pytest.mark.parametrize("frames", [-30.0, 0.0, 20.5])
def test_errors_ignore_one_gain_and_one_delay_and_nothing_else(frames):
    def sound(shift: float) -> np.ndarray:
        t = T[:30_000] - shift / RATE_HZ
        return np.exp(-3 * t) * np.sin(2 * math.pi * 200 * t) * (1 - np.exp(-200 * np.maximum(t, 0)))

    truth = sound(40.0)
    errors = errors_of(truth, 0.5 * sound(40.0 + frames), RATE_HZ)
    assert errors.esr < 1e-3 and errors.log_spectral_distance_db < 1
    assert errors.delay_s == pytest.approx(-frames / RATE_HZ, abs=2e-6)
    assert errors.gain_db == pytest.approx(20 * math.log10(2), abs=0.05)
    noise = 0.1 * float(np.std(truth)) * np.random.default_rng(0).standard_normal(len(truth))
    assert errors_of(truth, truth + noise, RATE_HZ).esr == pytest.approx(0.01, rel=0.1)
    assert errors_of(truth, truth, RATE_HZ).log_spectral_distance_db == 0


@pytest.mark.parametrize(("seed", "impulse_hz"), [(0, 22_050), (1, 44_100), (2, 44_100)])
def test_a_knock_through_the_body_is_found_again_without_the_body(seed, impulse_hz):
    learned, note, _ = modelled_note(seed, 1, seconds=0.4)
    rate, random = note.rate_hz, np.random.default_rng(seed)
    t = np.arange(rate // 20) / rate
    body = 0.3 * np.exp(-600 * t) * np.sin(2 * np.pi * random.uniform(150, 400) * t)
    body[0] = 1.0
    knock = signal.sosfilt(signal.butter(2, 2_000, fs=rate, output="sos"), random.standard_normal(rate // 50))
    string = SimpleNamespace(sound=lambda rate_hz: learned.render(np.arange(round(0.4 * rate_hz)) / rate_hz))
    samples = string.sound(rate)
    samples[: len(t) + len(knock) - 1] += 0.05 * np.convolve(knock, body)
    impulse = signal.resample_poly(body, impulse_hz, rate) * rate / impulse_hz
    force = attack_force(Note(samples, rate, 0, 1e-12), string, impulse, impulse_hz)
    assert force is not None and len(force) == round(FADED_S * rate)
    whole = slice(0, len(knock))
    assert np.corrcoef(force[whole], knock)[0, 1] > 0.95
    assert float(np.linalg.norm(force[whole])) == pytest.approx(0.05 * float(np.linalg.norm(knock)), rel=0.2)
    assert np.abs(force[round(WHOLE_S * rate) :]).max() < 0.1 * np.abs(force).max()
    assert force[-1] == pytest.approx(0, abs=1e-9)
    assert attack_force(Note(string.sound(rate), rate, 0, 0.0), string, impulse, impulse_hz) is None
    assert first_distance_db(knock, 0.3 * knock, rate) == pytest.approx(0, abs=1e-9)  # of spectra, and of no gain
    assert first_distance_db(knock, signal.lfilter([1, -0.9], [1], knock), rate) > 3


@pytest.fixture
def recorded(learned: Learned):
    note = recorded_note(learned.note, learned.fitted, learned.source)
    return recorded_string(note, learned.physics, learned.strung, learned.source, {}, figures(learned.report))


def test_a_note_is_met_far_better_than_by_linear_poles_and_survives_its_preset(learned, recorded, tmp_path):
    errors = learned.report.errors
    assert errors.esr < 2e-3 and errors.log_spectral_distance_db < 4
    assert errors.esr < 0.5 * learned.verdict.linear_esr
    write_preset(tmp_path / "own.safetensors", "Own", learned.strung, recorded)
    kept = load_preset(tmp_path / "own.safetensors").info.recorded
    assert kept == recorded and kept.digest == "0" * 64
    sound, samples = kept.note.sound(), learned.note.samples
    assert len(sound) == len(samples)
    begin = learned.note.onset + round(0.008 * learned.note.rate_hz)
    truth, found = samples[begin : begin + 100_000], sound[begin : begin + 100_000]
    assert float(np.sum((truth - found) ** 2) / np.sum(truth**2)) == pytest.approx(errors.esr, rel=0.3)


def test_modes_of_the_recorded_pitch_are_the_notes(learned, recorded):
    hz = recorded.resonator(learned.strung.string, 2 * len(recorded.cents)).omega / (2 * math.pi)
    for each in learned.physics.partials[:6]:
        assert abs(1200 * math.log2(hz[2 * (each.number - 1)] / each.poles[0].hz)) < 0.5


def test_one_recording_alone_combines_to_itself_and_takes_to_their_medians(learned, recorded):
    own = combined([learned], {"kind": "guitar"})
    assert own == replace(recorded, settings={"kind": "guitar"})
    physics = learned.physics
    takes = [
        replace(learned, physics=replace(physics, partials=tuple(shifted(each, factor) for each in physics.partials)))
        for factor in (1.001, 1.003)
    ]
    together = combined([learned, *takes], {})
    assert together.note == own.note and together.digest == own.digest
    above = np.array(together.cents) - np.array(own.cents)
    np.testing.assert_allclose(above, 1200 * math.log2(1.001), atol=0.02)  # the median of none, one and three
    np.testing.assert_allclose(together.smooth_ratio, own.smooth_ratio, rtol=1e-9)


def shifted(partial: Partial, factor: float) -> Partial:
    poles = tuple(replace(pole, s=complex(pole.s.real, factor * pole.s.imag)) for pole in partial.poles)
    return replace(partial, hz=factor * partial.hz, poles=poles)
