"""Samples that somebody else renders: as they are, converted, looped, and waited for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import soxr

from engine.kernels.constants import QUANTUM
from engine.levels import FULL_SCALE_M
from engine.values.ear import Ear
from engine.voices import Mixer, Program, Voice, plain_program, rendered_program
from tests.engine.sounds import RATE_HZ, Info, Rung, Samples, noise

MIDDLE = Ear((0.5,))


def band_limited(rate_hz: int, seconds: float) -> Samples:
    """Cosines up to 0.7 of half the rate: even about the first sample, as a string at rest is."""
    time_s = np.arange(round(seconds * rate_hz)) / rate_hz
    rates_hz = np.linspace(0.01, 0.35, 12) * rate_hz
    return (0.05 * np.cos(2 * np.pi * rates_hz * time_s[:, None]).sum(1, keepdims=True)).astype(np.float32)


def waiting(program: Program, seconds: float, source_rate_hz: int, ear: Ear = MIDDLE) -> Voice:
    """Without any samples yet."""
    voice = Voice(program, np.full(41, FULL_SCALE_M), ear, 1.0, seconds, source_rate_hz)
    voice.never_ends()
    return voice


@pytest.mark.parametrize("points", [1, 2])
def test_equal_rates_leave_each_sample_as_it_is(points: int, rung: Rung) -> None:
    samples = noise(5000, points)
    found = rung(6000, Voice.of_samples(plain_program(RATE_HZ), samples), attack=False)
    np.testing.assert_array_equal(found[:5000], np.broadcast_to(samples, (5000, 2)))
    assert not found[5100:].any()


@pytest.mark.parametrize(("source_rate_hz", "rate_hz"), [(4_000, 48_000), (16_000, 44_100), (48_000, 44_100)])
def test_other_rates_are_what_soxr_makes_of_them(
    source_rate_hz: int, rate_hz: int, small_info: Info, rung: Rung
) -> None:
    info, samples = replace(small_info(True), rate_hz=source_rate_hz), band_limited(source_rate_hz, 0.5)
    voice = waiting(rendered_program(info, rate_hz), 0.5, source_rate_hz)
    voice.append(samples)
    voice.end_here()
    found = rung(rate_hz // 2, voice, attack=False)[:, 0]
    expected = soxr.resample(samples[:, 0].astype(np.float64), source_rate_hz, rate_hz, "VHQ")
    inner = slice(rate_hz // 20, rate_hz * 9 // 20)  # both begin and end in their own way
    difference = np.sqrt(np.mean((found[inner] - expected[inner]) ** 2) / np.mean(expected[inner] ** 2))
    assert 20 * np.log10(difference) < -90


@pytest.mark.parametrize("pickup", ["displacement", "velocity"])
def test_what_starves_fades_stands_still_and_goes_on_where_it_was(pickup: str) -> None:
    ear = Ear((0.5,), pickup)
    samples = np.concatenate([band_limited(RATE_HZ, 0.1), np.zeros((100, 1), np.float32)])
    voice = waiting(plain_program(RATE_HZ), 0.1, RATE_HZ, ear)
    whole = waiting(plain_program(RATE_HZ), 0.1, RATE_HZ, ear)
    mixer, undisturbed = Mixer(RATE_HZ, limited=False), Mixer(RATE_HZ, limited=False)
    whole.append(samples)
    undisturbed.add(whole)
    expected = undisturbed.render(4096)[:, 0]
    voice.append(samples[:1500])
    mixer.add(voice)
    before = mixer.render(2048)[:, 0]
    assert voice.starved_s > 0
    assert [gap.cause for gap in mixer.new_gaps()] == ["rendering"]
    stood_at = round(voice.seconds * RATE_HZ)
    voice.append(samples[1500:])
    after = mixer.render(2048)[:, 0]
    quiet = stood_at + (2 * QUANTUM if pickup == "velocity" else 0)  # its filter looks back and ahead
    np.testing.assert_array_equal(before[: stood_at - 2 * QUANTUM], expected[: stood_at - 2 * QUANTUM])
    assert not before[quiet:].any()
    goes_on = after[3 * QUANTUM : 1024]
    shift = stood_at + 3 * QUANTUM
    np.testing.assert_allclose(goes_on, expected[shift : shift + len(goes_on)], atol=1e-6)
    assert mixer.new_gaps() == []
    mixer.render(8192)
    assert mixer.new_gaps() == []  # its samples have come to their end


def test_what_has_no_samples_yet_begins_when_it_has_them() -> None:
    voice, samples = waiting(plain_program(RATE_HZ), 0.1, RATE_HZ), noise(4801, 1)
    mixer = Mixer(RATE_HZ, limited=False)
    mixer.add(voice)
    assert not mixer.render(640).any()
    assert (voice.seconds, len(mixer.new_gaps())) == (0.0, 1)
    voice.append(samples)
    found = mixer.render(2048)[:, 0]
    assert voice.began_frame == 640
    np.testing.assert_array_equal(found[128:], samples[128:2048, 0])  # nothing was left out, and it has faded in


def test_a_loop_goes_round_without_a_seam(rung: Rung) -> None:
    samples = noise(1000, 2)
    voice = Voice.of_samples(plain_program(RATE_HZ), samples)
    voice.loop()
    np.testing.assert_array_equal(rung(3500, voice, attack=False), np.tile(samples, (4, 1))[:3500])
