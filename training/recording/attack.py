"""The attack of a recording beyond the learned note: contact, knock, and all that is no free vibration.

An instrument plays it as the noise of a stroke, before the body. So the body is taken out of it, by Wiener's filter.
No error against the recording is stated with it.
"""

from __future__ import annotations

import math

import numpy as np
from scipy import fft

from engine.effects.responses import resampled
from engine.resonators.base import Array
from engine.resonators.recorded import RecordedNote
from training.recording.note import Note

WHOLE_S, FADED_S = 0.05, 0.1  # it is whole until the first, and fades until the second
FIRST_S, FIRST_FLOOR_DB = 0.03, -60.0
LEAST_DB = -30.0  # of the body's largest gain: what lies deeper is not amplified any more


def attack_force(note: Note, learned: RecordedNote, impulse: Array, impulse_hz: int) -> Array | None:
    """The force that the body turns into the attack, at the note's rate, (frames,); None: there is nothing.

    Args:
        impulse: of the body that it is played through.
    """
    rate = note.rate_hz
    sound = learned.sound(rate)[: len(note.samples)]
    end = min(len(sound), note.onset + round(FADED_S * rate))
    attack = (note.samples[: len(sound)] - sound)[note.onset : end]
    body = resampled(impulse[:, None], impulse_hz, rate)[:, 0] * impulse_hz / rate
    size = fft.next_fast_len(len(attack) + len(body), real=True)
    gain = fft.rfft(body, size)
    least = float(np.abs(gain).max()) ** 2 * 10 ** (LEAST_DB / 10)
    force = fft.irfft(fft.rfft(attack, size) * gain.conj() / (np.abs(gain) ** 2 + least), size)[: len(attack)]
    whole = min(len(force), round(WHOLE_S * rate))
    force[whole:] *= np.cos(np.linspace(0, math.pi / 2, len(force) - whole)) ** 2
    return force if np.abs(force).max() > 0 else None


def first_distance_db(truth: Array, model: Array, rate_hz: int) -> float:
    """Log spectral distance of the first 30 ms of two notes of one length, made equally loud, by one Hann window."""
    model = model * math.sqrt(float(truth @ truth) / max(float(model @ model), 1e-30))
    size = min(len(truth), round(FIRST_S * rate_hz))
    theirs, ours = (np.abs(fft.rfft(sound[:size] * np.hanning(size))) for sound in (truth, model))
    floor = float(theirs.max()) * 10 ** (FIRST_FLOOR_DB / 20)
    return float(np.sqrt(np.mean((20 * np.log10(np.maximum(theirs, floor) / np.maximum(ours, floor))) ** 2)))
