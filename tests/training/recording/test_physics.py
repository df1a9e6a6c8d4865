from __future__ import annotations

import math
from dataclasses import replace

import pytest

from training.recording.fit import LearnedNote
from training.recording.glide import Glide
from training.recording.physics import corrections, physics_of, strung
from training.recording.refine import Pole

F0_HZ, SIGMA = 110.0, 2.0


def _note(first_cents: float) -> LearnedNote:
    """Ten partials of one decay; the first, off by so many cents, decays ten times as fast."""
    hz = [F0_HZ * number * (2 ** (first_cents / 1200) if number == 1 else 1) for number in range(1, 11)]
    sigma = [10 * SIGMA, *[SIGMA] * 9]
    poles = [
        Pole(complex(-s, 2 * math.pi * f), 0.1 + 0j, k) for k, (f, s) in enumerate(zip(hz, sigma, strict=True), 1)
    ]
    return LearnedNote(48_000, F0_HZ, 0.0, Glide.none(), tuple(poles))


@pytest.mark.parametrize(("first_cents", "lowest"), [(0.0, 10 * SIGMA), (-62.0, SIGMA)])
def test_other_keys_do_not_take_the_decay_of_a_partial_that_the_body_pulls(first_cents: float, lowest: float) -> None:
    found = physics_of(_note(first_cents))
    assert found.f0_hz == pytest.approx(F0_HZ, rel=1e-3)
    assert found.smooth_decay[0] == pytest.approx(lowest)
    assert found.smooth_decay[-1] == pytest.approx(SIGMA)


def test_a_slow_polarisation_that_the_fit_has_among_its_free_poles_is_the_strings() -> None:
    """Its partial's second pole went to a resonance of the body, as on a guitar's G."""
    note = _note(0.0)
    slow, body = Pole(complex(-0.5, 2 * math.pi * F0_HZ * 0.998), 0.02 + 0j, 0), F0_HZ * 0.96
    others = (slow, Pole(complex(-25.0, 2 * math.pi * body), 0.08 + 0j, 1))
    main = Pole(complex(-5.0, 2 * math.pi * F0_HZ), 0.1 + 0j, 1)
    physics = physics_of(replace(note, poles=(main, *note.poles[1:], *others)))
    assert {pole.hz for pole in physics.partials[0].poles} == {slow.hz, main.hz}
    own = corrections(physics, strung(physics, "guitar").string)
    assert own["second_share"][0] == pytest.approx(0.1 / 0.12)
    assert own["second_ratio"][0] == pytest.approx(10)


def test_a_partial_keeps_a_pole_of_the_body_where_it_has_no_other() -> None:
    note = _note(-62.0)
    assert physics_of(note).partials[0].poles == note.poles[:1]
