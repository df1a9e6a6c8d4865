"""The gate keeps one note of a string, and refuses all else with its kind of reason."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import fftconvolve

from tests.bench.recordings.synthetic import SyntheticNote, synthetic_note
from training.recording.gate import examine
from training.recording.learn import Refused, examined, learn
from training.recording.note import note_of
from training.recording.numbering import number_note
from training.recording.preset import Source

RATE_HZ = 44_100
Change = Callable[[np.ndarray], np.ndarray]


def kinds(samples: np.ndarray) -> set[str]:
    note = note_of(samples, RATE_HZ)
    series, peaks = number_note(note)
    return {each.kind for each in examine(samples, note, series, peaks)}


def looped(x: np.ndarray) -> np.ndarray:
    return np.concatenate([x[:20_000], *[x[20_000:31_000]] * 7])


def reverberated(x: np.ndarray) -> np.ndarray:
    t = np.arange(2 * RATE_HZ) / RATE_HZ
    room = np.random.default_rng(0).standard_normal(len(t)) * np.exp(-3 * t)
    room[0] = 1
    return 0.02 * fftconvolve(x, room)[: len(x)]


@pytest.mark.parametrize("seed", range(4))
def test_one_note_is_kept(seed: int) -> None:
    assert kinds(synthetic_note(seed).samples) == set()


@pytest.mark.parametrize(
    ("change", "kind"),
    [
        (lambda x: np.clip(4 * x, -0.5, 0.5), "clipped"),
        (lambda x: x[::-1].copy(), "edited"),
        (lambda x: np.concatenate([x[:40_000], x]), "onsets"),
        (looped, "looped"),
        (lambda x: x[: RATE_HZ // 3], "short"),
        (lambda x: x + 0.05 * np.random.default_rng(0).standard_normal(len(x)), "noisy"),
        (reverberated, "edited"),  # so much of a room that the level rises for long
    ],
)
def test_reasons(synthetic: SyntheticNote, change: Change, kind: str) -> None:
    assert kind in kinds(change(synthetic.samples))


@pytest.mark.parametrize("level_db", [0, -5, -10])
def test_a_second_note_is_heard(synthetic: SyntheticNote, level_db: float) -> None:
    other = synthetic_note(1).samples  # 148 Hz
    assert kinds(synthetic.samples + 10 ** (level_db / 20) * other) & {"chord", "no_series"}


def test_drums_and_noise_are_no_strings() -> None:
    random = np.random.default_rng(0)
    t = np.arange(2 * RATE_HZ) / RATE_HZ
    lead = np.zeros(4_000)
    burst = np.concatenate([lead, 0.3 * random.standard_normal(len(t)) * np.exp(-6 * t)])
    drum = sum(np.sin(2 * np.pi * 110 * m * t) * np.exp(-(6 + m) * t) for m in (1, 1.59, 2.14, 2.30, 2.65, 2.92))
    drum = np.concatenate([lead, 0.1 * drum]) + 1e-4 * random.standard_normal(len(t) + len(lead))
    assert "no_series" in kinds(burst)
    assert kinds(drum)


def test_a_refusal_says_what_to_do_and_can_be_overruled(synthetic: SyntheticNote) -> None:
    clipped = np.clip(4 * synthetic.samples, -0.5, 0.5)
    source = Source("clipped.wav", "0" * 64, RATE_HZ, len(clipped))
    with pytest.raises(Refused, match="lower the input gain"):
        learn([(examined(clipped, RATE_HZ), source)])
