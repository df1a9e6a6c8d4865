"""Body and room together, for the mixer and for arrays; how loud they are."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from engine.effects import Body, Effects, Impulse
from engine.kernels.constants import LOUDNESS_HIGH_HZ, LOUDNESS_LOW_HZ
from engine.values.effects import Amp, Room
from engine.voices import Mixer
from tests.engine.sounds import RATE_HZ, apply, voice_of


def pink(frames: int) -> NDArray[np.float64]:
    """Noise of equal power in each octave, (frames, 1)."""
    frequency_hz = np.fft.rfftfreq(frames, 1 / RATE_HZ)
    draw = np.random.default_rng(0).standard_normal((2, len(frequency_hz)))
    heard = (frequency_hz > LOUDNESS_LOW_HZ) & (frequency_hz < LOUDNESS_HIGH_HZ)
    spectrum = np.where(heard, (draw[0] + 1j * draw[1]) / np.sqrt(np.maximum(frequency_hz, 1)), 0)
    found = np.fft.irfft(spectrum, frames)[:, None]
    return 0.1 * found / found.std()


CHOICES = [
    Effects(Body()),
    Effects(Body(0.5, 0.7)),
    Effects(room=Room(0.3, 0.4)),
    Effects(Body(0.8), Room(0.2, 0.8)),
    Effects(Body(0.1), Room(1.0, 3.0)),
]


@pytest.mark.parametrize("effects", [*CHOICES, Effects(amp=Amp(20.0)), Effects(Body(0.8), Room(0.2, 0.8), Amp(12.0))])
def test_the_mixer_gives_the_same_as_arrays_are_given(effects: Effects) -> None:
    sound = pink(60_000).astype(np.float32)
    voice = voice_of(sound)
    voice.sound_through_effects()
    mixer = Mixer(RATE_HZ, limited=False)
    mixer.set_effects(effects)
    mixer.add(voice)
    np.testing.assert_allclose(mixer.render(60_000), apply(effects, sound, RATE_HZ), atol=1e-6)


def test_what_has_no_mix_changes_nothing() -> None:
    sound = pink(1000)
    for effects in (None, Effects(), Effects(Body(0.0), Room(0.0), Amp(0.0))):
        np.testing.assert_array_equal(apply(effects, sound, RATE_HZ), np.repeat(sound, 2, 1))
    np.testing.assert_array_equal(Effects().impulse(RATE_HZ), [[1.0]])
    both, room = Effects(Body(0.0), Room(0.2, 0.8)).impulse(RATE_HZ), Effects(room=Room(0.2, 0.8)).impulse(RATE_HZ)
    np.testing.assert_array_equal(both, room)
    assert (np.abs(room).argmax(0) == 0).all() and np.ptp(room[0]) < 0.01 * room[0].mean()  # the direct sound
    assert apply(CHOICES[0], np.zeros((0, 1)), RATE_HZ).shape == (0, 2)


def test_it_rings_out_within_its_tail() -> None:
    effects = Effects(Body(0.5), Room(0.5, 0.5))
    tail = round(effects.tail_s(RATE_HZ) * RATE_HZ)
    sound = np.zeros((tail + 200, 1))
    sound[:100] = pink(100)
    found = apply(effects, sound, RATE_HZ)
    assert found[tail - 2000 : tail + 99].any()
    assert np.abs(found[tail + 100 :]).max() < 1e-12


@pytest.mark.parametrize("room", [None, Room(0.4, 0.5)])
def test_a_mono_body_is_one_whose_sides_are_the_same(room: Room | None) -> None:
    """A room is as wide behind it."""
    mono = np.random.default_rng(0).standard_normal((100, 1))
    one, two = (Effects(Body(0.7, impulse=Impulse(each, RATE_HZ)), room) for each in (mono, mono.repeat(2, 1)))
    found = one.impulse(RATE_HZ)
    np.testing.assert_allclose(np.broadcast_to(found, (len(found), 2)), two.impulse(RATE_HZ), atol=1e-12)
    assert found.shape[1] == (1 if room is None else 2)


def test_a_body_of_a_single_frame_is_heard_in_a_room() -> None:
    """Its balance of left and right, and its sign."""
    sample, silence = np.array([[-1.0, 0.2]]), np.zeros((1, 2))
    short, padded = (Impulse(samples, RATE_HZ) for samples in (sample, np.concatenate([sample, silence])))
    room = Room(0.2, 0.5)
    found, expected = (Effects(Body(1.0, impulse=each), room).impulse(RATE_HZ) for each in (short, padded))
    np.testing.assert_allclose(found, expected[: len(found)], atol=1e-9)
    assert found[0, 0] < 0 < found[0, 1]
