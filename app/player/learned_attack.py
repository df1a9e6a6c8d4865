"""The attack of a learned instrument: the noise of its strokes.

It is on where it brings the own key nearer to the note.

Nearness is measured over the first 30 ms of the own key, as the instrument plays it, through its body.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve

from app.instruments.instrument import Instrument, Noise
from app.player.effects import effects_of
from app.player.events import NoteOn, TimedEvent
from app.player.offline import render_events
from engine.effects.responses import resampled
from engine.kernels.constants import CURVES_HZ as RESPONSE_HZ
from engine.kernels.constants import PART_S, REFERENCE_VELOCITY, WANTED_DB
from engine.kernels.loudness import k_weight
from engine.parameters import NOISE_DB
from engine.presets import Preset
from engine.resonators.recorded import RecordedAttack, RecordedNote
from training.recording.attack import attack_force, first_distance_db
from training.recording.note import Note

Array = NDArray[np.float64]

LEAST_GAIN_DB = 0.2  # an attack is on if it brings the sound nearer to the recording by more


def attack_of(instrument: Instrument, note: Note, recorded: RecordedNote) -> tuple[RecordedAttack, float] | None:
    """The attack of a note and its energy, in dB re that of the note's first 0.4 s.

    None: the instrument has no body, or the note no attack.
    """
    body = _body_impulse(instrument)
    if body is None:
        return None
    force = attack_force(note, recorded, body, RESPONSE_HZ)
    if force is None:
        return None
    part = note.part(0, PART_S)
    energy = len(part) * _mean_square(part, note.rate_hz)
    level_db = 10 * math.log10(float(force @ force) / max(energy, 1e-30))
    return RecordedAttack.of(force, note.rate_hz), level_db


def with_attack(instrument: Instrument, preset: Preset, note: Note, f0_hz: float, level_db: float) -> Instrument:
    """The instrument whose strokes have the recorded attack: on where that is nearer to the note, else off.

    Args:
        preset: with the attack in it.
        note, f0_hz: the recording and its pitch.
        level_db: energy of the attack, as of `attack_of`.
    """
    body = _body_impulse(instrument)
    recorded = preset.info.recorded
    assert body is not None and recorded is not None and recorded.attack is not None
    key = round(69 + 12 * math.log2(f0_hz / 440))
    tuning = instrument.tuning.model_copy(update={"a4_hz": f0_hz * 2 ** ((69 - key) / 12)})  # as the note was
    tuned = instrument.model_copy(update={"tuning": tuning})
    truth = resampled(note.part(0, PART_S)[:, None], note.rate_hz, RESPONSE_HZ)[:, 0]
    events, seconds = [TimedEvent(0.0, NoteOn(key, REFERENCE_VELOCITY))], len(truth) / RESPONSE_HZ
    blocks = render_events(tuned, preset, events, RESPONSE_HZ, seconds=seconds, limited=False, varied=False, dry=True)
    dry = np.concatenate(list(blocks))
    sound = fftconvolve(dry[:, 0].astype(np.float64), body)[: len(truth)]
    attack = recorded.attack
    force = resampled(attack.samples[:, None], attack.rate_hz, RESPONSE_HZ)[: len(truth), 0]
    loudness_db = 10 * math.log10(max(_mean_square(sound, RESPONSE_HZ), 1e-30))
    onset_db = level_db + loudness_db - WANTED_DB - instrument.level_db  # keys are softer where their peaks are high
    onset_db = round(min(max(onset_db, NOISE_DB[0]), NOISE_DB[1]), 2)
    gain = math.sqrt(PART_S * 10 ** ((WANTED_DB + instrument.level_db + onset_db) / 10))
    stroke = np.zeros(len(truth))
    stroke[: len(force)] = gain * force
    whole = sound + fftconvolve(stroke, body)[: len(truth)]
    gained_db = first_distance_db(truth, sound, RESPONSE_HZ) - first_distance_db(truth, whole, RESPONSE_HZ)
    noise = Noise(kind="recorded", onset_db=onset_db if gained_db > LEAST_GAIN_DB else NOISE_DB[0])
    return instrument.model_copy(update={"noise": noise})


def _body_impulse(instrument: Instrument) -> Array | None:
    """The impulse response of the body alone, (frames,) at RESPONSE_HZ; None: it has none."""
    effects = effects_of(instrument)
    return None if effects is None else replace(effects, room=None).impulse(RESPONSE_HZ)[:, 0]


def _mean_square(sound: Array, rate_hz: int) -> float:
    """The mean square of a sound after K-weighting."""
    hz = np.fft.rfftfreq(2 * len(sound), 1 / rate_hz)
    power = k_weight(np.maximum(hz, 1.0)) * np.abs(np.fft.rfft(sound, 2 * len(sound))) ** 2
    return float(power.sum()) / len(sound) / len(sound)
