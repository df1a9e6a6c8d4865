"""A recorded string's modes: its own at its pitch, the law and the smooth decay far from it."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from engine.kernels.constants import FADES_SEMITONES
from engine.models.base import Physics
from engine.pluck import Pluck
from engine.resonators.recorded import RecordedAttack, RecordedNote, RecordedString
from engine.resonators.string import resonator_of
from engine.schema import read, write
from engine.truth import ModalState, SplittingSolver, solve_dop853
from engine.values.string import Polarisations, StringParameters
from tests.engine.sounds import relative, shipped

STRING = StringParameters()
NOTE = RecordedNote(44_100, 44_100, 100, 453, (0.1,), (0.01,), (246.9,), (2.0,), (0.1,), (0.0,), (1,))


def recorded() -> RecordedString:
    return RecordedString(
        pitch_hz=STRING.undamped_frequency(1) / (2 * np.pi),
        smooth_hz=(200.0, 5_000.0),
        smooth_ratio=(2.0, 2.0),
        cents=(5.0, -3.0, 2.0),
        ratio=(0.5, 2.0, 1.0),
        second_cents=(1.0, 2.0, 3.0),
        second_ratio=(2.0, 1.0, 0.5),
        second_share=(0.2, 0.0, 0.5),
        note=NOTE,
        file="note.wav",
        digest="0" * 64,
    )


def test_at_its_pitch_it_has_the_notes_own_modes_far_away_the_law_and_the_smooth_decay():
    resonator, law = recorded().resonator(STRING, 6), resonator_of(STRING, 3)
    cents = 1200 * np.log2(resonator.omega / np.repeat(law.omega, 2))
    assert np.allclose(cents, [5, 6, -3, -1, 2, 5], atol=1e-6)
    assert np.allclose(resonator.sigma / np.repeat(law.sigma, 2), [1, 2, 4, 4, 2, 1])
    # an octave below, partials 2 and 4 lie at the note's first and second
    octave = replace(STRING, length_m=STRING.length_m * 2)
    ratios = recorded().resonator(octave, 8).sigma / np.repeat(resonator_of(octave, 4).sigma, 2)
    assert np.exp(-((12 / FADES_SEMITONES) ** 2)) < 1e-4
    assert np.allclose(ratios[[2, 3, 6, 7]], [1, 2, 4, 4], rtol=1e-4)
    far = replace(STRING, length_m=STRING.length_m / 4)
    resonator, law = recorded().resonator(far, 6), resonator_of(far, 3)
    assert np.allclose(resonator.omega[::2], law.omega, rtol=1e-9)
    assert np.allclose(resonator.sigma[::2], 2 * law.sigma, rtol=1e-6)


def test_no_partial_is_damped_by_more_than_half_its_frequency():
    lossy = replace(STRING, damping_d1_kg_m_s=0.03)
    fast = replace(recorded(), ratio=(20.0, 2.0, 20.0), second_ratio=(0.5, 1.0, 4.0))
    resonator, law = fast.resonator(lossy, 6), resonator_of(lossy, 3)
    bounded = resonator.sigma / resonator.omega[[0, 0, 2, 3, 4, 5]]
    assert bounded[[0, 1, 5]] == pytest.approx([0.5, 0.25, 0.5])
    assert resonator.sigma[2:5] / law.sigma[[1, 1, 2]] == pytest.approx([4, 4, 40], rel=1e-6)


def test_a_displacement_is_shared_by_both_polarisations_and_one_tension():
    """In the truth against DOP853, at velocities that glide; learned curves are as accurate as in one direction."""
    resonator, wide = (recorded().resonator(STRING, modes) for modes in (24, 120))
    shape, rate_hz = resonator.shapes[0], 48_000
    moving = Polarisations(angle_deg=40, second_heard=0.25)
    assert np.dot(moving.pulled, moving.heard) == pytest.approx(1)  # heard as high as it is pulled
    amplitudes = resonator.to_modes(shape)
    assert np.allclose(amplitudes, [0.8, 0.2, *[0] * 22], atol=1e-9)
    assert np.allclose(resonator.to_grid(amplitudes), shape, atol=1e-9)
    q = resonator.to_modes(Pluck(0.17, 8.0, "rounded", 0.2).displacement(101))[None]
    assert float(resonator.relative_tension_rise(q[0])) > 0.015
    state = ModalState(q, q[:, ::-1].copy())
    found = SplittingSolver(resonator, rate_hz).solve(state, 1_000)
    assert relative(found, solve_dop853(resonator, state, rate_hz, 1_000)) < 1e-7
    tuned = shipped("studio_any_string").model.for_resonator(Physics(wide, rate_hz, 1.0))
    heard = wide.shapes @ np.linspace(0, 1, 101)
    for amplitude_mm in (1.0, 6.0):
        displacement = Pluck(0.17, amplitude_mm, "rounded", 0.08).displacement(101)[None]
        moved = tuned.amplitudes(tuned.encode(torch.from_numpy(displacement)), rate_hz // 4).detach().numpy()
        start = ModalState.at_rest(wide.to_modes(displacement))
        true, _ = SplittingSolver(wide, rate_hz).advance(start, rate_hz // 4)
        assert relative(moved @ heard, true @ heard) ** 2 < 1e-6


def test_the_recorded_note_glides_to_its_pitch():
    sound = NOTE.sound()
    assert len(sound) == NOTE.frames and not sound[: NOTE.onset].any()
    assert np.isfinite(sound).all()

    def hz(first: int, last: int) -> float:
        crossings = np.flatnonzero(np.diff(np.signbit(sound[first:last])))
        return (len(crossings) - 1) / 2 / (crossings[-1] - crossings[0]) * NOTE.rate_hz

    assert hz(500, 3_000) > hz(30_000, 44_000) + 0.5
    assert hz(30_000, 44_000) == pytest.approx(246.9, abs=0.2)


def test_at_another_rate_it_is_the_same_sound_without_what_lies_above_half_of_it():
    hz, ones = (1_000.0, 5_000.0, 6_000.0, 10_000.0, 20_000.0), (1.0,) * 5

    def note(count: int) -> RecordedNote:
        parts = (each[:count] for each in (hz, (20.0,) * 5, ones, ones, (1, 2, 0, 3, 0)))
        return RecordedNote(44_100, 22_048, 100, 452, (0.1,), (0.01,), *parts)  # type: ignore[arg-type]

    low = note(2).sound()[::4]
    np.testing.assert_allclose(note(5).sound(11_025), low, atol=1e-9)
    assert np.abs(low).max() > 1 and np.abs(note(5).sound()[::4] - low).max() > 1


SAMPLES = np.random.default_rng(0).standard_normal(2_500)
ATTACK = RecordedAttack.of(SAMPLES, 48_000)


def test_it_is_written_and_read_and_an_attack_is_kept_whole():
    assert [len(row) for row in ATTACK.rows] == [1_000, 1_000, 500]
    assert np.corrcoef(ATTACK.samples, SAMPLES)[0, 1] > 0.9999
    assert np.sum(ATTACK.samples**2) / 48_000 == pytest.approx(1)
    for own in (recorded(), replace(recorded(), attack=ATTACK)):
        assert read(RecordedString, write(own), "metadata") == own
