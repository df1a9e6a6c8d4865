"""The physics of notes: of strings that are known, and of partials that a body pulls."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from engine.resonators.string import resonator_of
from training.family.strings import string_of
from training.recording.fit import LearnedNote
from training.recording.glide import CENTS, Glide
from training.recording.physics import BUILDS, corrections, physics_of, pluck_place, strung
from training.recording.refine import Pole

F0_HZ, SIGMA = 110.0, 2.0


def pulled_note(first_cents: float) -> LearnedNote:
    """Ten partials of one decay; the first, off by so many cents, decays ten times as fast."""
    first, *others = (Pole(complex(-SIGMA, 2 * math.pi * F0_HZ * k), 0.1 + 0j, k) for k in range(1, 11))
    first = replace(first, s=complex(-10 * SIGMA, first.s.imag * 2 ** (first_cents / 1200)))
    return LearnedNote(48_000, F0_HZ, 0.0, Glide.none(), (first, *others))


@pytest.mark.parametrize(("first_cents", "lowest"), [(0.0, 10 * SIGMA), (-62.0, SIGMA)])
def test_other_keys_do_not_take_the_decay_of_a_partial_that_the_body_pulls(first_cents, lowest):
    note = pulled_note(first_cents)
    found = physics_of(note)
    assert found.partials[0].poles == note.poles[:1]  # a partial keeps a pole of the body where it has no other
    assert found.f0_hz == pytest.approx(F0_HZ, rel=1e-3)
    assert found.smooth_decay[0] == pytest.approx(lowest)
    assert found.smooth_decay[-1] == pytest.approx(SIGMA)


def test_a_slow_polarisation_that_the_fit_has_among_its_free_poles_is_the_strings():
    """Its partial's second pole went to a resonance of the body, as on a guitar's G."""
    note = pulled_note(0.0)
    slow, body = Pole(complex(-0.5, 2 * math.pi * F0_HZ * 0.998), 0.02 + 0j, 0), F0_HZ * 0.96
    others = (slow, Pole(complex(-25.0, 2 * math.pi * body), 0.08 + 0j, 1))
    main = Pole(complex(-5.0, 2 * math.pi * F0_HZ), 0.1 + 0j, 1)
    physics = physics_of(replace(note, poles=(main, *note.poles[1:], *others)))
    assert {pole.hz for pole in physics.partials[0].poles} == {slow.hz, main.hz}
    own = corrections(physics, strung(physics, "guitar").string)
    assert own["second_share"][0] == pytest.approx(0.1 / 0.12)
    assert own["second_ratio"][0] == pytest.approx(10)


@pytest.fixture(scope="module", params=range(6))
def heard(request: pytest.FixtureRequest) -> SimpleNamespace:
    """A random string's partials, as a fit has them where nothing else sounds."""
    random = np.random.default_rng(request.param)
    hz, stiffness = math.exp(random.uniform(math.log(60), math.log(500))), 10 ** random.uniform(-5, -3.5)
    string = string_of(hz, stiffness, random.uniform(4, 10), random.uniform(0.4, 1.5))
    resonator, place = resonator_of(string, min(30, int(8_000 / hz))), random.uniform(0.08, 0.45)
    poles = [
        Pole(complex(s), complex(0.1 * math.sin(math.pi * k * place) / k**2 * np.exp(1j * k)), k)
        for k, s in enumerate(resonator.eigenvalues(), 1)
    ]
    glide = Glide(random.uniform(0, 8, 3) * CENTS)
    note = LearnedNote(44_100, hz / math.sqrt(1 + stiffness), stiffness, glide, tuple(poles))
    return SimpleNamespace(resonator=resonator, stiffness=stiffness, place=place, physics=physics_of(note))


def test_a_string_gives_its_pitch_inharmonicity_losses_and_the_place_of_its_pluck(heard):
    physics, omega = heard.physics, heard.resonator.omega
    first_hz = float(physics.f0_hz * math.sqrt(1 + physics.stiffness))
    assert abs(1200 * math.log2(2 * math.pi * first_hz / omega[0])) < 0.01
    assert physics.stiffness == pytest.approx(heard.stiffness, rel=1e-3)
    assert physics.f0_error_hz < 1e-3 and physics.stiffness_error < 1e-2 * physics.stiffness
    sigma = np.interp(2 * math.pi * np.array(physics.smooth_hz), omega, heard.resonator.sigma)
    np.testing.assert_allclose(physics.smooth_decay, sigma, rtol=0.4)  # of windows that the ends cut
    assert pluck_place(physics) == pytest.approx(heard.place, abs=0.005)


@pytest.mark.parametrize("kind", BUILDS)
def test_in_every_gauge_the_string_sounds_and_glides_alike(heard, kind):
    modes = len(heard.resonator.omega)
    for own in (strung(heard.physics, kind), strung(heard.physics, kind, 0.9, 0.7)):
        resonator = resonator_of(own.string, modes)
        np.testing.assert_allclose(resonator.omega, heard.resonator.omega, rtol=1e-5)
        np.testing.assert_allclose(resonator.sigma, heard.resonator.sigma, rtol=0.25)
        x, many = np.linspace(0, 1, 401), resonator_of(own.string, 150, grid_points=401)
        pluck = own.amplitude_m * np.minimum(x / own.position, (1 - x) / (1 - own.position))
        rise = float(many.relative_tension_rise(many.to_modes(pluck)))
        assert rise == pytest.approx(4 * heard.physics.rise, rel=0.02)  # half over a period, half of it in pitch
        assert 1e-4 < own.amplitude_m <= 8e-3
    assert own.string.length_m == 0.9 and own.string.area_m2 == pytest.approx(math.pi * 0.35e-3**2)
    assert len(own.assumed) == len(strung(heard.physics, kind).assumed) - 2  # length and gauge were given
