"""Synthetic notes, made once: the solver's string with a body, noise and a second polarisation."""

import pytest

from tests.training.recording.synthetic import SyntheticNote, synthetic_note
from training.recording.learn import Learned, examined, learn
from training.recording.preset import Source

SEED = 2  # 95 Hz


@pytest.fixture(scope="session")
def synthetic() -> SyntheticNote:
    return synthetic_note(SEED)


@pytest.fixture(scope="session")
def learned() -> Learned:
    """A short note of 317 Hz, which has few partials to fit."""
    made = synthetic_note(4, seconds=0.8)
    source = Source("note.wav", "0" * 64, made.rate_hz, len(made.samples))
    found = examined(made.samples, made.rate_hz)
    return learn([(found, source)], kind="guitar", length_m=0.65)[0]
