"""What is learned of a note against its truth, its baselines, and its recording."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from engine.presets import load_preset
from tests.bench.recordings.coverage import coverage
from tests.training.recording.conftest import SEED
from tests.training.recording.synthetic import SyntheticNote, synthetic_note
from training.recording.fit import fit_note, fit_takes
from training.recording.glide import CENTS, Glide, rate_basis
from training.recording.learn import Learned, examined, learn
from training.recording.note import note_of
from training.recording.numbering import number_note
from training.recording.preset import Source, body_response, recorded_note, recorded_string, write_preset
from training.recording.refine import Pole
from training.recording.report import errors_of, figures
from training.recording.rest import at_rest, share_of_tension
from training.recording.table import as_data, as_text

RECORDINGS = Path(__file__).parents[4] / "shared" / "recordings"


def recorded_of(learned: Learned):  # type: ignore[no-untyped-def]
    note = recorded_note(learned.note, learned.fitted, learned.source)
    return recorded_string(note, learned.physics, learned.strung, learned.source, {}, figures(learned.report))


def test_the_own_note_is_met_far_better_than_by_linear_poles(learned: Learned) -> None:
    note, errors = learned.note, learned.report.errors
    assert errors.esr < 2e-3
    assert errors.distance_db < 4
    series = number_note(note)
    linear = fit_note(note, series, free=0, glides=False)
    truth = note.fitted()
    found = linear.render(np.arange(len(truth)) / note.rate_hz)
    assert errors.esr < 0.5 * errors_of(truth, found, note.rate_hz).esr


def test_soft_and_loud_takes_share_their_poles(synthetic: SyntheticNote) -> None:
    """Each with its own amplitudes, glide and pitch: one of them was recorded three cents higher."""
    higher = 2 ** (3 / 1200)
    soft = synthetic_note(SEED, rise_cents=5.0).samples
    at = np.arange(len(soft)) * higher
    soft = 0.2 * CubicSpline(np.arange(len(soft)), soft)(at[at < len(soft)])
    takes = [note_of(samples, synthetic.rate_hz) for samples in (synthetic.samples, soft)]
    notes = [(note, number_note(note)) for note in takes]
    first, second = fit_takes(notes)
    assert [pole.partial for pole in first.poles] == [pole.partial for pole in second.poles]
    apart = [b.s / a.s for a, b in zip(first.poles, second.poles, strict=True) if a.partial]
    assert np.ptp(np.abs(apart)) < 1e-9
    assert 1200 * math.log2(abs(apart[0])) == pytest.approx(3, abs=1.5)
    assert first.glide.shares.sum() > 1.5 * second.glide.shares.sum()
    for note, learned in zip(takes, (first, second), strict=True):
        truth = note.fitted()
        assert errors_of(truth, learned.render(np.arange(len(truth)) / note.rate_hz), note.rate_hz).esr < 0.01


def test_pitch_and_stiffness_are_the_strings(learned: Learned, synthetic: SyntheticNote) -> None:
    assert abs(1200 * math.log2(learned.physics.f0_hz / synthetic.f0_hz)) < 3
    assert learned.physics.stiffness == pytest.approx(synthetic.stiffness, rel=0.1)


def test_intervals_hold_the_truth() -> None:
    found = coverage((11, 12))  # `bench recordings --synthetic 200` is the whole of it
    assert found["misnumbered"] == 0 and found["partials"] > 30
    assert min(found["hz"], found["decay"], found["level_db"]) > 0.85
    assert found["hz half width"] < 1.5  # cents: not by being wide


def test_the_energy_gives_the_end_of_a_glide() -> None:
    """A slow glide that a fit took for a part of the frequency belongs to the rest again."""
    poles = {k: [Pole(complex(-k, 2 * math.pi * 100 * k), 1 / k**2 + 0j, k)] for k in range(1, 7)}
    t = np.linspace(0, 2.5, 500)
    truth, weight = 1e-2 * np.exp(-2 * t), np.exp(-t)  # as the first partial's energy, and its amplitude
    rows = rate_basis(t) * weight[:, None]
    shares, *_ = np.linalg.lstsq(rows, (truth - 2e-3) * weight, rcond=None)  # the rest 3.5 cents too high
    rests = at_rest(Glide(shares), poles)
    expected = -2e-3 / CENTS - 0.5 * share_of_tension(6)[0] * 1e-2 / CENTS
    assert rests[6].cents < 0.4 * expected  # nearer than without
    assert abs(rests[6].cents - expected) < 3 * rests[6].error
    assert rests[1].cents < rests[6].cents and rests[1].error > rests[6].error


def test_a_pitch_that_rises_is_not_taken_for_a_law() -> None:
    """Nor is a partial that hardly decays taken for the end of a glide."""
    falls = {k: [Pole(complex(-k, 2 * math.pi * 100 * k), 1 / k**2 + 0j, k)] for k in range(1, 7)}
    rising = at_rest(Glide(np.array([-12.0, -7.0, -6.0]) * CENTS), falls)
    assert max(abs(each.cents) for each in rising.values()) < 4
    rings = {1: [Pole(complex(-0.05, 628.0), 1 + 0j, 1)]}
    assert at_rest(Glide(np.array([5.0, 5.0, 5.0]) * CENTS), rings)[1].cents == 0


def test_shares_of_tension_add_up() -> None:
    assert sum(share_of_tension(k)[0] for k in range(1, 100)) == pytest.approx(1, abs=0.02)


def test_a_note_survives_its_preset(learned: Learned, tmp_path: Path) -> None:
    recorded = recorded_of(learned)
    write_preset(tmp_path / "own.safetensors", "Own", learned.strung, recorded)
    info = load_preset(tmp_path / "own.safetensors").info
    assert info.recorded == recorded
    assert info.recorded.digest == "0" * 64
    sound = info.recorded.note.sound()
    samples = learned.note.samples
    assert len(sound) == len(samples)
    begin = learned.note.onset + round(0.008 * learned.note.rate_hz)
    truth, found = samples[begin : begin + 100_000], sound[begin : begin + 100_000]
    assert float(np.sum((truth - found) ** 2) / np.sum(truth**2)) == pytest.approx(learned.report.errors.esr, rel=0.3)


def test_modes_of_the_recorded_pitch_are_the_notes(learned: Learned) -> None:
    recorded = recorded_of(learned)
    resonator = recorded.resonator(learned.strung.string, 2 * len(recorded.cents))
    hz = resonator.omega / (2 * math.pi)
    for each in learned.physics.partials[:6]:
        lower = each.poles[0]
        assert abs(1200 * math.log2(hz[2 * (each.number - 1)] / lower.hz)) < 0.5


def test_a_body_is_finite_and_begins_at_once(learned: Learned) -> None:
    response = body_response(learned.physics, learned.strung, 30, 48_000)
    assert np.isfinite(response).all() and int(np.argmax(np.abs(response))) < 100


def test_reports_are_plain(learned: Learned) -> None:
    data = as_data(learned)
    assert data["errors"]["esr"] == learned.report.errors.esr
    assert any("density" in words for words in data["assumed"])
    assert "error-to-signal ratio" in "\n".join(as_text(learned))


def test_progress_may_cancel(synthetic: SyntheticNote) -> None:
    class Cancelled(Exception):
        pass

    def stop(share: float) -> None:
        if share > 0.2:
            raise Cancelled

    with pytest.raises(Cancelled):
        learn([(examined(synthetic.samples, synthetic.rate_hz), Source("a", "0", 44_100, 1))], progress=stop)


def test_errors_ignore_one_gain_and_one_delay(synthetic: SyntheticNote) -> None:
    sound = synthetic.samples[5_000:80_000]
    moved = 0.5 * np.roll(sound, 20)
    moved[:20] = 0
    errors = errors_of(sound, moved, synthetic.rate_hz)
    assert errors.esr < 1e-3
    assert errors.delay_s == pytest.approx(-20 / synthetic.rate_hz, abs=1e-6)
    assert errors_of(sound, sound, synthetic.rate_hz).distance_db == 0


def test_a_real_note() -> None:
    path = RECORDINGS / "guitar_wood_d4.flac"
    if not path.is_file():
        pytest.skip("the shared recordings are not here")
    soundfile = pytest.importorskip("soundfile")
    samples, rate_hz = soundfile.read(path)
    (learned,) = learn([(examined(samples, rate_hz), Source(path.name, "0" * 64, rate_hz, len(samples)))])
    assert learned.report.errors.esr < 0.05
    assert learned.report.errors.distance_db < 5
