"""The sum of all voices, and what is done to it: volume, channels, tone, guards, and the safety limiter."""

import ctypes

import numpy as np
import pytest

from engine.kernels.constants import AHEAD
from engine.kernels.limiter import CEILING, STEEPEST
from engine.kernels.mixer import TONE_HZ, TONE_LEVEL, UNDERFLOW, call
from engine.kernels.mixer_records import GAPS, MOST_VOICES, RING
from engine.voices import Mixer
from engine.voices.mixer import LIMITER_RELEASE_S, VOLUME_SMOOTHING_S
from tests.engine.sounds import RATE_HZ, Samples, Signal, mixer_of, noise, voice_of

POINTER, COUNT = ctypes.c_void_p, ctypes.c_uint64
CALL = ctypes.CFUNCTYPE(ctypes.c_int32, POINTER, POINTER, COUNT, POINTER, COUNT, POINTER)


def ask(mixer: Mixer, frames: int, flags: int = 0, now_s: float = 0.0) -> Samples:
    """What a device does: it calls the compiled callback with its own memory."""
    out = np.full(frames * mixer.channels, np.nan, np.float32)
    times = np.array([0.0, now_s, now_s + 0.01])
    assert CALL(call.address)(None, out.ctypes.data, frames, times.ctypes.data, flags, mixer.address) == 0
    return out.reshape(frames, mixer.channels)


def test_below_the_ceiling_every_sample_is_as_it_was_given_and_late_by_the_limiter():
    one, other = noise(5000), noise(5000)[::-1].copy()
    mixer = mixer_of(voice_of(one), voice_of(other, 0.5), limited=True)
    expected = one.astype(np.float64) + 0.5 * other
    found = mixer.render(5000 + AHEAD)
    assert not found[:AHEAD].any()
    np.testing.assert_array_equal(found[AHEAD:], expected.astype(np.float32))
    assert mixer.take_reduction_db() == 0.0
    assert mixer.take_peak() == np.abs(expected).max()
    assert mixer.take_peak() == 0.0


@pytest.mark.parametrize("channels", [1, 2, 4])
def test_a_file_is_not_limited_and_channels_are_the_mean_or_the_first_two(channels):
    samples, mixer = 10 * noise(1000), Mixer(RATE_HZ, channels, limited=False)
    mixer.add(voice_of(samples))
    found = mixer.render(1000)
    expected = samples.astype(np.float64).mean(1, keepdims=True).astype(np.float32) if channels == 1 else samples
    np.testing.assert_array_equal(found[:, :2], expected)
    assert found.shape == (1000, channels) and not found[:, 2:].any()
    assert mixer.output_latency_s == 0.0


def test_the_volume_glides_and_arrives():
    mixer = mixer_of(voice_of(np.full((48_000, 2), 0.5, np.float32)))
    mixer.render(640)
    mixer.set_volume(0.2)
    found = mixer.render(20_000)[:, 0]
    glide = 0.2 + 0.8 * np.exp(-np.arange(1, 3001) / (VOLUME_SMOOTHING_S * RATE_HZ))
    np.testing.assert_allclose(found[:3000], 0.5 * glide, atol=1e-6)
    assert (found[15_000:] == np.float32(0.1)).all()
    mixer.set_volume(0.0)
    mixer.render(20_000)
    assert not mixer.render(1000).any()


@pytest.mark.parametrize("rate_hz", [44_100, 192_000])
@pytest.mark.parametrize(("side", "sounds"), [("left", (1, 0)), ("right", (0, 1)), ("both", (1, 1))])
def test_the_tone_sounds_on_its_side_for_a_second(side, sounds, rate_hz):
    """Its fades last 20 ms at any rate."""
    mixer = Mixer(rate_hz, limited=False)
    mixer.sound_tone(side)
    frame = np.arange(rate_hz + 1000)
    envelope = np.clip(np.minimum(frame, rate_hz - frame) / (0.02 * rate_hz), 0, 1)
    tone = TONE_LEVEL * envelope * np.sin(2 * np.pi * TONE_HZ * frame / rate_hz)
    np.testing.assert_allclose(mixer.render(len(frame)), tone[:, None] * sounds, atol=1e-6)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e7])
def test_what_is_no_number_is_silence(value):
    """A gain that is not a number gets past the voices' own guard."""
    other = noise(1000)
    mixer = mixer_of(voice_of(noise(64), value), voice_of(other), limited=True)
    found = mixer.render(1000)
    assert np.isfinite(found).all()
    assert mixer.non_finite > 0
    np.testing.assert_array_equal(found[64 + 960 + AHEAD :], other[64 + 960 : -AHEAD])


def test_voices_of_one_hand_over_begin_with_one_frame_and_say_when_the_device_had_it():
    mixer, voices = Mixer(RATE_HZ), [voice_of(noise(3000, level=0.1)) for _ in range(5)]
    for voice in voices:
        voice.set_struck(2.0)
        assert voice.struck_to_began_s is None
    ask(mixer, 100, now_s=1.99)
    mixer.add(*voices)
    ask(mixer, 28, now_s=2.002)
    ask(mixer, 64, now_s=2.004)
    ask(mixer, 64, now_s=2.006)
    assert [voice.began_frame for voice in voices] == [128] * 5
    # the limiter's delay is part of it
    assert [voice.struck_to_began_s for voice in voices] == [pytest.approx(0.004 + AHEAD / RATE_HZ)] * 5
    assert voices[0].seconds == 128 / RATE_HZ


def test_an_underflow_counts_as_a_gap_where_something_sounds_and_the_latest_are_reported():
    mixer = Mixer(RATE_HZ)
    ask(mixer, 480, UNDERFLOW)  # the very first call: nothing was missed
    ask(mixer, 480, UNDERFLOW, now_s=0.01)
    assert (mixer.underflows, mixer.new_gaps()) == (1, [])
    mixer.add(voice_of(noise(48_000)))
    ask(mixer, 480, now_s=0.02)
    ask(mixer, 480, UNDERFLOW, now_s=0.045)
    (gap,) = mixer.new_gaps()
    assert (gap.cause, gap.time_s) == ("device", 3 * 480 / RATE_HZ)
    assert gap.milliseconds == pytest.approx(15.0, abs=1e-6)
    for number in range(GAPS + 20):
        ask(mixer, 64, UNDERFLOW, now_s=1 + number / 100)
    assert (len(mixer.new_gaps()), mixer.new_gaps()) == (GAPS, [])


def test_beyond_the_last_place_and_in_a_full_ring_voices_are_refused_and_over():
    voices = [voice_of(noise(2000, level=0.001)) for _ in range(MOST_VOICES + 3)]
    mixer = mixer_of(*voices)
    mixer.render(64)
    assert [voice.over for voice in voices] == [False] * MOST_VOICES + [True] * 3
    assert len(mixer.voices) == MOST_VOICES
    mixer.render(4000)
    assert mixer.voices == []
    mixer.add(*(waiting := [voice_of(noise(64)) for _ in range(RING + 2)]))  # and nobody takes any
    assert [voice.over for voice in waiting] == [False] * RING + [True] * 2
    assert mixer.render(64).any()
    mixer.add(again := voice_of(noise(64)))
    assert not again.over
    with pytest.raises(ValueError, match="48000 Hz, the mixer 44100 Hz"):
        Mixer(44_100).add(again)


ROUNDING = 1e-6  # of a gain that is read off single-precision samples


def limited(sound: Samples) -> Samples:
    """As a device is given it, without the delay."""
    return mixer_of(voice_of(sound), limited=True).render(len(sound) + AHEAD)[AHEAD:]


def swell(seed: int = 0) -> Samples:
    """Half a second of noise that swells and fades, up to +12 dB."""
    level = 4 * np.sin(np.linspace(0, np.pi, RATE_HZ // 2)) ** 2
    return noise(RATE_HZ // 2, level=1.0, seed=seed) * level[:, None].astype(np.float32)


def burst(begin: int) -> Samples:
    """0.9, and for 200 frames twenty times as much, at once."""
    sound = np.full((RATE_HZ, 2), 0.9, np.float32)
    sound[begin : begin + 200] *= 20
    sound[::2] *= -1
    return sound


LOUD = {
    "noise": swell(),
    "tone": np.outer(np.sin(2 * np.pi * 220 * np.arange(RATE_HZ // 2) / RATE_HZ), [3.0, 1.5]).astype(np.float32),
    # wherever in a quantum the peak is; the first frames had no frame before them to fall in
    **{f"burst in frame {frame}": burst(64 * 100 + frame) for frame in (0, 1, 31, 32, 63)},
}


def gain_of(found: Samples, sound: Samples) -> Signal:
    """Its factor, frame by frame, where it is loud enough to tell."""
    rows, side = np.arange(len(sound)), np.abs(sound).argmax(axis=1)
    given = sound.astype(float)[rows, side]
    return np.where(np.abs(given) > 0.1, found[rows, side] / np.where(given == 0, 1.0, given), np.nan)


@pytest.mark.parametrize("name", LOUD)
def test_nothing_exceeds_the_ceiling_and_the_gain_of_both_sides_has_neither_jumps_nor_corners(name):
    """Its slope changes by a small part of itself from frame to frame, down to the peak and up again."""
    sound = LOUD[name]
    found = limited(sound)
    assert np.abs(found).max() <= np.float32(CEILING)
    gain = gain_of(found, sound)
    reduction = 1 - np.nanmin(gain)
    assert np.nanmax(np.abs(np.diff(gain))) <= reduction * STEEPEST + ROUNDING
    if name.startswith("burst"):
        assert np.abs(np.diff(gain, 2)).max() <= reduction * STEEPEST**2 + 3 * ROUNDING
    if name == "tone":  # the image does not move
        loud = np.abs(sound[:, 1]) > 0.1
        np.testing.assert_allclose(*(found.astype(float)[loud] / sound[loud]).T, rtol=1e-5)


def test_it_begins_no_earlier_than_it_looks_reports_what_it_did_and_the_gain_returns():
    begin, sound = 6400, burst(6400)
    mixer = mixer_of(voice_of(sound), limited=True)
    first = mixer.render(6000)
    assert mixer.take_reduction_db() == 0.0
    found = np.concatenate([first, mixer.render(len(sound) + AHEAD - 6000)])[AHEAD:]
    assert mixer.take_reduction_db() == pytest.approx(20 * np.log10(18.0 / CEILING), abs=1e-5)
    assert mixer.take_peak() == pytest.approx(CEILING)
    np.testing.assert_array_equal(found[: begin - AHEAD], sound[: begin - AHEAD])
    np.testing.assert_array_equal(found[-2000:], sound[-2000:])
    gain = gain_of(found, sound)
    np.testing.assert_allclose(gain[begin : begin + 200], CEILING / 18.0, rtol=1e-5)
    after = gain[begin + 200 + AHEAD : begin + 200 + 8 * AHEAD]
    growth = np.exp(1 / (LIMITER_RELEASE_S * RATE_HZ))
    np.testing.assert_allclose(after[1:] / after[:-1], growth, rtol=1e-5)
    assert (np.diff(gain[begin + 200 :]) > -ROUNDING).all()
    # soft ones are as they were to the last bit: no average is left that lacks a rounding error of being 1
    sound = np.concatenate([burst(600)[:4000], swell(1)[:2000], np.zeros((48_000, 2), np.float32), 0.2 * swell(2)])
    np.testing.assert_array_equal(limited(sound)[-RATE_HZ // 2 :], sound[-RATE_HZ // 2 :])


def test_a_device_is_given_what_a_file_is_in_blocks_of_any_size():
    called, rendered = (mixer_of(voice_of(LOUD["noise"][6000:9000]), limited=True) for _ in range(2))
    sizes = [256, 1, 63, 480, *[1] * 65, 935]
    blocks = [ask(called, frames, now_s=number / 100) for number, frames in enumerate(sizes)]
    np.testing.assert_array_equal(np.concatenate(blocks), rendered.render(1800))
    assert (called.calls, called.seconds) == (len(sizes), 1800 / RATE_HZ)
    assert called.output_latency_s == pytest.approx(0.01 + AHEAD / RATE_HZ)
