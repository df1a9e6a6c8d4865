"""Fits against notes whose poles and glide are known, cut anywhere; their intervals hold the truth."""

import json
import math
from typing import Any

import numpy as np
import pytest

from engine.schema import SchemaError
from engine.whole_file import WriteError
from tests.training.recording.synthetic import figures_at_rest, modelled_note, synthetic_note
from training.recording.fit import LearnedNote, fit_note, fit_takes
from training.recording.glide import CENTS, Glide, rate_basis
from training.recording.intervals import at_rest, covariance, share_of_tension
from training.recording.note import note_of
from training.recording.numbering import number_note
from training.recording.physics import physics_of
from training.recording.refine import Pole, real_rows
from training.recording.report import errors_of, partials_in


def poles_of(learned: LearnedNote, number: int) -> list[Any]:
    return [pole for pole in learned.poles if pole.partial == number]


@pytest.mark.parametrize("polarisations", [1, 2])
@pytest.mark.parametrize("seed", range(2))
def test_a_fit_has_the_pitch_decay_and_level_of_every_partial(seed, polarisations):
    """A glide and the frequencies at rest trade against each other: their sum is what sounds."""
    cents, decay, level_db = {1: (0.6, 0.02, 0.03), 2: (1.2, 0.2, 0.3)}[polarisations]
    truth, note, series = modelled_note(seed, polarisations)
    found = fit_note(note, series, free=0, poles_a_partial=polarisations)
    t = np.linspace(0.1, 0.7, 50)
    for number in range(1, 9):
        own, other = (figures_at_rest(poles_of(each, number)) for each in (truth, found))
        pitch = [1200 * math.log2(hz) + each.glide.cents(t) for hz, each in ((own[0], truth), (other[0], found))]
        assert float(np.abs(pitch[1] - pitch[0]).max()) < cents
        assert other[1] == pytest.approx(own[1], rel=decay)
        assert other[2] == pytest.approx(own[2], abs=level_db)
    samples = note.fitted()
    error = errors_of(samples, found.render(np.arange(len(samples)) / note.rate_hz), note.rate_hz)
    assert error.esr < (5e-4 if polarisations == 1 else 1e-2)


def test_a_fit_that_is_cut_after_any_step_ends_bit_for_bit_as_the_whole(tmp_path):
    notes = [modelled_note(1, 2, seconds=0.3, loudness=each)[1:] for each in (1.0, 0.5)]
    settings: dict[str, Any] = {"free": 1, "seconds": 0.25}
    whole = fit_takes(notes, **settings)
    path, steps = tmp_path / "fits" / "one.json", [0]

    def cut(share: float) -> None:
        steps.append(json.loads(path.read_text())["steps"])
        if len(steps) % 4 == 0:
            raise KeyboardInterrupt

    while True:
        try:
            found = fit_takes(notes, **settings, checkpoint=path, progress=cut)
            break
        except KeyboardInterrupt:
            assert steps[-1] == steps[-2] + 1
    assert steps == list(range(steps[-1] + 1)) and len(steps) > 12
    assert [each.poles for each in found] == [each.poles for each in whole]
    assert all(np.array_equal(a.glide.shares, b.glide.shares) for a, b in zip(found, whole, strict=True))
    assert [each.spreads for each in found] == [each.spreads for each in whole]

    state = json.loads(path.read_text())
    takes = state["takes"]
    for damaged in (
        {"steps": 10_000},
        {"steps": 0},
        {"damping": state["damping"][1:]},
        {"takes": takes[1:]},
        {"takes": [{**takes[0], "glide": [0.0]}, takes[1]]},
        {"takes": [{**takes[0], "poles": [{**takes[0]["poles"][0], "partial": 99}]}, takes[1]]},
        {"colour": 3},
    ):
        path.write_text(json.dumps({**state, **damaged}))
        with pytest.raises(SchemaError, match=r"one.json: damaged checkpoint .*; delete it to start again"):
            fit_takes(notes, **settings, checkpoint=path)
    with pytest.raises(WriteError):
        fit_takes(notes, **settings, checkpoint=path / "inside a file.json")


@pytest.mark.parametrize("cents", [-4.0, 3.0])
def test_soft_and_loud_takes_share_their_poles_but_not_pitch_glide_and_level(cents):
    made = [modelled_note(2, 1), modelled_note(2, 1, cents=cents, loudness=0.3)]
    first, second = fit_takes([(note, series) for _, note, series in made], free=0)
    assert [pole.partial for pole in first.poles] == [pole.partial for pole in second.poles]
    apart = np.array([b.s / a.s for a, b in zip(first.poles, second.poles, strict=True)])
    assert np.ptp(np.abs(apart)) < 1e-9
    t = np.linspace(0.02, 0.7, 50)
    for (truth, note, _), learned in zip(made, (first, second), strict=True):
        pitch = [1200 * math.log2(poles_of(each, 1)[0].hz) + each.glide.cents(t) for each in (truth, learned)]
        assert float(np.abs(pitch[1] - pitch[0]).max()) < 1.5
        samples = note.fitted()
        found = learned.render(np.arange(len(samples)) / note.rate_hz)
        assert errors_of(samples, found, note.rate_hz).esr < 1e-3
    assert first.glide.shares.sum() > 3 * second.glide.shares.sum()


FIGURES = ("hz", "decay", "level_db")


def test_intervals_of_random_strings_hold_the_truth_and_are_narrow():
    """Strings with a body, noise and a second polarisation; `bench recordings --synthetic 200` is the whole of it."""
    held, widths = [], []
    for seed in (11, 3_002):
        made = synthetic_note(seed, seconds=1.2)
        note = note_of(made.samples, made.rate_hz)
        series = number_note(note)
        assert series is not None
        learned = fit_note(note, series, free=4)
        physics = physics_of(learned)
        assert abs(1200 * math.log2(physics.f0_hz / made.f0_hz)) < 3
        assert physics.stiffness == pytest.approx(made.stiffness, rel=0.1)
        reported = {each.number: each for each in partials_in(learned, physics)}
        loudest = max(each.level_db for each in made.partials)
        for truth in made.partials:
            if truth.level_db < loudest - 50:
                continue
            own = learned.spreads[truth.number]
            ends = [getattr(own, name) for name in FIGURES]
            inside = zip(ends, FIGURES, strict=True)
            held.append([low <= getattr(truth, name) <= high for (low, high), name in inside])
            widths.append([1200 * math.log2(own.hz[1] / own.hz[0]), math.log(own.decay[1] / own.decay[0])])
            assert reported[truth.number].level_db == pytest.approx(truth.level_db - loudest, abs=1.5)
    assert len(held) > 40 and np.mean(held, axis=0).min() > 0.85
    assert np.median(widths, axis=0)[0] < 4  # cents: not by being wide
    assert np.median(widths, axis=0)[1] < 0.3


def test_the_covariance_of_white_noise_is_that_of_least_squares():
    random = np.random.default_rng(0)
    columns = random.standard_normal((400, 3, 2)) @ np.array([1, 1j])
    draws = [covariance(columns, 0.1 * (random.standard_normal((400, 2)) @ np.array([1, 1j]))) for _ in range(60)]
    rows = real_rows(columns)
    expected = 0.01 * np.linalg.inv(rows.T @ rows)
    np.testing.assert_allclose(np.diag(np.mean(draws, axis=0)), np.diag(expected), rtol=0.1)


@pytest.mark.parametrize("seed", range(3))
def test_figures_of_beating_poles_are_those_of_their_sound(seed):
    random = np.random.default_rng(seed)
    drawn = [(2 * math.pi * hz, random.uniform(2, 6), random.uniform(0.2, 1, 2)) for hz in (200.0, 200.7)]
    poles = [Pole(complex(-decay, omega), complex(*a)) for omega, decay, a in drawn]
    t = np.linspace(0, 5, 500_001)
    z, slope = (sum(p.a * p.s**power * np.exp(p.s * t) for p in poles) for power in (0, 1))
    energy, step = np.abs(z) ** 2, t[1]
    total = float(energy.sum()) * step
    found = figures_at_rest(poles)
    turned = float((slope * z.conj()).imag.sum()) * step / total
    assert found[0] == pytest.approx(turned / (2 * math.pi), rel=1e-6)
    assert found[1] == pytest.approx(0.5 * total / (float((t * energy).sum()) * step), rel=1e-3)
    assert found[2] == pytest.approx(10 * math.log10(total), abs=0.01)


def test_the_energy_gives_the_end_of_a_glide():
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
    assert sum(share_of_tension(k)[0] for k in range(1, 100)) == pytest.approx(1, abs=0.02)

    # a pitch that rises is not taken for a law, nor a partial that hardly decays for the end of a glide
    rising = at_rest(Glide(np.array([-12.0, -7.0, -6.0]) * CENTS), poles)
    assert max(abs(each.cents) for each in rising.values()) < 4
    rings = {1: [Pole(complex(-0.05, 628.0), 1 + 0j, 1)]}
    assert at_rest(Glide(np.array([5.0, 5.0, 5.0]) * CENTS), rings)[1].cents == 0
