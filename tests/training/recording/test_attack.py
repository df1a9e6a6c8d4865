"""The attack against a force that is known, through a body that is known."""

import numpy as np
import pytest
from scipy import signal

from tests.training.recording.synthetic import modelled_note
from training.recording.attack import FADED_S, WHOLE_S, attack_force, first_distance_db
from training.recording.fit import LearnedNote
from training.recording.note import Note


class Rendered:
    """A learned note as `RecordedNote` renders it."""

    def __init__(self, learned: LearnedNote, seconds: float) -> None:
        self.learned, self.seconds = learned, seconds

    def sound(self, rate_hz: int) -> np.ndarray:
        return self.learned.render(np.arange(round(self.seconds * rate_hz)) / rate_hz)


@pytest.mark.parametrize(("seed", "impulse_hz"), [(0, 22_050), (1, 44_100), (2, 44_100)])
def test_a_knock_through_the_body_is_found_again_without_the_body(seed, impulse_hz):
    learned, note, _ = modelled_note(seed, 1, seconds=0.4)
    rate, random = note.rate_hz, np.random.default_rng(seed)
    t = np.arange(rate // 20) / rate
    body = 0.3 * np.exp(-600 * t) * np.sin(2 * np.pi * random.uniform(150, 400) * t)
    body[0] = 1.0
    knock = signal.sosfilt(signal.butter(2, 2_000, fs=rate, output="sos"), random.standard_normal(rate // 50))
    string = Rendered(learned, 0.4)
    samples = string.sound(rate)
    samples[: len(t) + len(knock) - 1] += 0.05 * np.convolve(knock, body)
    impulse = signal.resample_poly(body, impulse_hz, rate) * rate / impulse_hz
    force = attack_force(Note(samples, rate, 0, 1e-12), string, impulse, impulse_hz)
    assert force is not None and len(force) == round(FADED_S * rate)
    whole = slice(0, len(knock))
    assert np.corrcoef(force[whole], knock)[0, 1] > 0.95
    assert float(np.linalg.norm(force[whole])) == pytest.approx(0.05 * float(np.linalg.norm(knock)), rel=0.2)
    assert np.abs(force[round(WHOLE_S * rate) :]).max() < 0.1 * np.abs(force).max()
    assert force[-1] == pytest.approx(0, abs=1e-9)
    assert attack_force(Note(string.sound(rate), rate, 0, 0.0), string, impulse, impulse_hz) is None


def test_the_distance_of_attacks_is_of_their_spectra_and_of_no_gain():
    random = np.random.default_rng(0)
    knock = random.standard_normal(2_000) * np.exp(-np.arange(2_000) / 300)
    other = signal.lfilter([1, -0.9], [1], knock)
    assert first_distance_db(knock, 0.3 * knock, 44_100) == pytest.approx(0, abs=1e-9)
    assert first_distance_db(knock, other, 44_100) > 3
