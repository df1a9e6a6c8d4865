"""Fits against notes whose poles and glide are known, cut anywhere, and of takes that share them."""

import json
import math
from typing import Any

import numpy as np
import pytest

from engine.schema import SchemaError
from engine.whole_file import WriteError
from tests.training.recording.synthetic import figures_at_rest, modelled_note
from training.recording.fit import LearnedNote, fit_note, fit_takes
from training.recording.report import errors_of


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


def test_a_fit_without_a_glide_has_none_and_fits_worse():
    _, note, series = modelled_note(0, 1)
    gliding, still = (fit_note(note, series, free=0, poles_a_partial=1, glides=each) for each in (True, False))
    samples, t = note.fitted(), np.arange(len(note.fitted())) / note.rate_hz
    assert not still.glide.shares.any()
    errors = [errors_of(samples, each.render(t), note.rate_hz).esr for each in (gliding, still)]
    assert errors[0] < 0.1 * errors[1]


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
