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
def learned(synthetic: SyntheticNote) -> Learned:
    source = Source("note.wav", "0" * 64, synthetic.rate_hz, 80_000)
    found = examined(synthetic.samples[:80_000], synthetic.rate_hz)
    return learn([(found, source)], kind="guitar", length_m=0.65)[0]
