"""The convolver in the mixer: against SciPy, while it is exchanged, at rest, and with what is no sound."""

from __future__ import annotations

import threading

import numpy as np
import pytest
from scipy.signal import fftconvolve

from engine.effects import Body, Effects, Impulse
from engine.kernels.constants import AHEAD, QUANTUM
from engine.kernels.mixer_records import WINDOW
from engine.values.effects import Room
from engine.voices import Mixer, Voice
from tests.engine.sounds import RATE_HZ, Samples, Signal, apply, noise, voice_of


def wet(samples: Samples, gain: float = 1.0) -> Voice:
    """A voice that sounds through the effects."""
    voice = voice_of(samples, gain)
    voice.sound_through_effects()
    return voice


def response(frames: int, channels: int = 1, seed: int = 2) -> Effects:
    """Noise that decays by 60 dB."""
    samples = np.random.default_rng(seed).standard_normal((frames, channels))
    return Effects(Body(1.0, impulse=Impulse(samples * np.geomspace(1, 1e-3, frames)[:, None], RATE_HZ)))


def mixer_with(effects: Effects | None, samples: Samples | None = None) -> Mixer:
    mixer = Mixer(RATE_HZ, limited=False)
    mixer.set_effects(effects)
    if samples is not None:
        mixer.add(wet(samples))
    return mixer


EDGES = [1, 63, 64, 65, 2 * WINDOW - 1, 2 * WINDOW, 2 * WINDOW + 1, 3 * WINDOW, 3 * WINDOW + 1, 20_000]


@pytest.mark.parametrize("channels", [1, 2])
@pytest.mark.parametrize("frames", EDGES)
def test_it_is_the_convolution_without_delay(frames: int, channels: int) -> None:
    samples, effects = noise(30_000), response(frames, channels)
    expected = fftconvolve(samples.astype(np.float64), effects.impulse(RATE_HZ), axes=0)[:30_000]
    np.testing.assert_allclose(mixer_with(effects, samples).render(30_000), expected, atol=1e-6)


@pytest.mark.parametrize("block", [1, 63, 64, 65, 4097])
def test_blocks_of_any_size_are_the_same_samples(block: int) -> None:
    samples, effects = noise(8000), response(5000, 2)
    whole, parts = mixer_with(effects, samples), mixer_with(effects, samples)
    found = np.concatenate([parts.render(min(block, 8000 - first)) for first in range(0, 8000, block)])
    np.testing.assert_array_equal(found, whole.render(8000))


def test_the_longest_response_fits() -> None:
    longest = Impulse(noise(3 * RATE_HZ).astype(np.float64), RATE_HZ)
    samples, effects = noise(320_000), Effects(Body(1.0, impulse=longest), Room(1.0, 3.0))
    assert len(effects.impulse(RATE_HZ)) == 6 * RATE_HZ - 1
    found = mixer_with(effects, samples).render(len(samples))
    np.testing.assert_allclose(found, apply(effects, samples, RATE_HZ), atol=1e-6)


@pytest.mark.parametrize("effects", [None, Effects(), Effects(Body(0.0), Room(0.0))])
def test_without_effects_every_sample_is_as_it_was_given(effects: Effects | None) -> None:
    samples = noise(5000)
    np.testing.assert_array_equal(mixer_with(effects, samples).render(5000), samples)


def way(frames: int, begin: int) -> Signal:
    """Of a fade that begins at a frame: the share of what is faded to, (frames, 1)."""
    share = np.clip((np.arange(frames) - begin + 1) / WINDOW, 0, 1)
    return (share * share * (3 - 2 * share))[:, None]


@pytest.mark.parametrize("at_frame", [WINDOW, 10_000, 10_048, 10_239])
def test_another_response_is_faded_to_and_what_was_played_rings_on(at_frame: int) -> None:
    samples, frames = noise(20_000), 30_000
    one, other = response(9000, 1, 3), response(12_000, 2, 4)
    mixer = mixer_with(one, samples)
    first = mixer.render(at_frame)
    mixer.set_effects(other)
    found = np.concatenate([first, mixer.render(frames - at_frame)])
    next_quantum = -(-at_frame // QUANTUM) * QUANTUM
    begin = -(-next_quantum // WINDOW) * WINDOW + WINDOW
    padded = np.pad(samples, ((0, frames - len(samples)), (0, 0)))
    before, after = apply(one, padded, RATE_HZ), apply(other, padded, RATE_HZ)
    np.testing.assert_allclose(found, before + (after - before) * way(frames, begin), atol=1e-6)


def test_effects_come_and_go_by_a_fade_and_leave_every_sample_as_it_was() -> None:
    samples, frames = noise(60_000), 60_000
    mixer = mixer_with(None, samples)
    first = mixer.render(1000)
    mixer.set_effects(response(3000))
    middle = mixer.render(29_000)
    mixer.set_effects(None)
    found = np.concatenate([first, middle, mixer.render(frames - 30_000)])
    begin = 1024  # the quantum after the first thousand frames
    heard = samples * way(frames, begin)  # the convolver was not there, and begins softly
    through = apply(response(3000), heard, RATE_HZ)
    # its windows are counted from when it came: 28 of them are over at frame 29 696, the next at 30 720
    share = way(frames, begin + WINDOW) - way(frames, begin + 30 * WINDOW)
    np.testing.assert_allclose(found, samples + (through - samples) * share, atol=1e-6)
    np.testing.assert_array_equal(found[: begin + WINDOW], samples[: begin + WINDOW])
    np.testing.assert_array_equal(found[begin + 31 * WINDOW :], samples[begin + 31 * WINDOW :])


def kept(mixer: Mixer) -> int:
    """The responses in memory: the one that is heard, faded to, or wanted."""
    return len(mixer._impulses)


@pytest.mark.parametrize("sounding", [True, False])
def test_of_many_wishes_the_last_alone_is_heard_and_kept(sounding: bool) -> None:
    samples = noise(60_000)
    mixer = mixer_with(response(500, 1, 0), samples if sounding else None)
    mixer.render(640)
    impulses = [response(500, 1, seed).impulse(RATE_HZ) for seed in range(9)]
    for seed in range(1, 9):
        mixer.set_effects(response(500, 1, seed))
    assert kept(mixer) <= 3
    found = np.concatenate([mixer.render(WINDOW) for _ in range(10)])
    mixer.forget_ended()
    assert mixer.effects is not None and kept(mixer) == 1
    np.testing.assert_array_equal(mixer.effects.impulse(RATE_HZ), impulses[-1])
    if sounding:
        expected = apply(mixer.effects, samples, RATE_HZ)[640 : 640 + len(found)]
        np.testing.assert_allclose(found[6 * WINDOW :], expected[6 * WINDOW :], atol=1e-6)


def test_after_the_end_there_is_silence_and_rest_and_then_it_begins_again() -> None:
    """At rest, other effects and none are there at once."""
    samples, effects, other = noise(5000), response(7000, 2), response(100, 1, 9)
    mixer = mixer_with(effects, samples)
    first = mixer.render(12_032)
    assert first[11_900:11_998].any()
    silence = mixer.render(40_000)
    assert np.abs(silence).max() < 1e-15 and not silence[10_000:].any()
    mixer.add(wet(samples))
    np.testing.assert_allclose(mixer.render(12_032), first, atol=1e-7)
    for exchanged, expected in (
        (other, apply(other, np.pad(noise(640), ((0, 384), (0, 0))), RATE_HZ)),
        (None, np.pad(noise(640), ((0, 384), (0, 0)))),
    ):
        mixer.render(40_000)
        mixer.set_effects(exchanged)
        mixer.render(64)
        mixer.add(wet(noise(640)))
        np.testing.assert_allclose(mixer.render(1024), expected, atol=1e-6)
    mixer.forget_ended()
    assert kept(mixer) == 0


@pytest.mark.parametrize("gain", [1e-25, 1e-310])
def test_what_is_too_soft_to_be_sound_is_silence(gain: float) -> None:
    mixer = mixer_with(response(5000))
    mixer.add(wet(noise(40_000), gain))
    assert not mixer.render(20_000).any()


@pytest.mark.parametrize("value", [np.nan, -np.inf, 1e9])
def test_what_is_no_sound_does_not_stay_in_it(value: float) -> None:
    samples, effects = noise(20_000), response(4000, 2)
    mixer = mixer_with(effects, samples)
    first = mixer.render(640)
    mixer.add(wet(np.full((64, 2), 0.3, np.float32), value))  # which gets past the voices' own guard
    found = np.concatenate([first, mixer.render(19_360)])
    assert 60 < mixer.non_finite < 1100
    heard = samples.copy()
    heard[640 : 640 + mixer.non_finite] = 0.0
    np.testing.assert_allclose(found, apply(effects, heard, RATE_HZ), atol=1e-6)


def test_effects_are_exchanged_while_a_thread_renders() -> None:
    mixer = mixer_with(response(3000), noise(2 * RATE_HZ))
    over, found = threading.Event(), []

    def play() -> None:
        while not over.is_set():
            found.append(mixer.render(256))

    thread = threading.Thread(target=play)
    thread.start()
    choices = [response(3000, 2, seed) for seed in range(5)]
    for number in range(100):
        mixer.set_effects(choices[number % 5] if number % 11 else None)
        mixer.forget_ended()
    over.set()
    thread.join()
    assert np.isfinite(np.concatenate(found)).all() and np.abs(np.concatenate(found)).max() < 10


def test_volume_and_limiter_come_after_it_and_one_channel_is_the_mean_of_both() -> None:
    samples, effects = noise(20_000), response(2000, 2)
    expected = 0.25 * apply(effects, samples, RATE_HZ)
    for channels in (1, 2):
        mixer = Mixer(RATE_HZ, channels)
        mixer.set_effects(effects)
        mixer.set_volume(0.25)
        mixer.record["volume"] = 0.25
        mixer.add(wet(samples))
        found = mixer.render(20_000)
        assert mixer.take_reduction_db() == 0.0
        mean = expected.mean(1, keepdims=True) if channels == 1 else expected
        np.testing.assert_allclose(found[AHEAD:], mean[:-AHEAD], atol=1e-6)
