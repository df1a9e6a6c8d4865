"""What is learned of a note against its truth, its baselines, and its recording."""

import math
from dataclasses import replace

import numpy as np
import pytest

from engine.presets import load_preset
from training.recording.learn import Learned, combined, examined, learn
from training.recording.physics import Partial
from training.recording.preset import Source, recorded_note, recorded_string, write_preset
from training.recording.report import figures


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


def test_progress_may_cancel(synthetic):
    def stop(share: float) -> None:
        if share > 0.05:
            raise InterruptedError

    with pytest.raises(InterruptedError):
        learn([(examined(synthetic.samples, synthetic.rate_hz), Source("a", "0", 44_100, 1))], progress=stop)


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
    damped = tuple(4 * each for each in physics.smooth_decay)
    octave = replace(learned, physics=replace(physics, f0_hz=2 * physics.f0_hz, smooth_decay=damped))
    apart = combined([learned, octave], {})
    assert apart.cents == own.cents
    assert np.median(np.array(apart.smooth_ratio) / own.smooth_ratio) == pytest.approx(2, rel=0.3)


def shifted(partial: Partial, factor: float) -> Partial:
    poles = tuple(replace(pole, s=complex(pole.s.real, factor * pole.s.imag)) for pole in partial.poles)
    return replace(partial, hz=factor * partial.hz, poles=poles)
