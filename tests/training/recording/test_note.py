"""The note of a recording: its channel, rate and onset; what is none is refused with the reason and the remedy."""

import numpy as np
import pytest

from training.recording.note import RecordingError, note_of


@pytest.mark.parametrize(
    ("samples", "rate_hz", "words"),
    [
        (np.zeros(44_100), 44_100, "silent"),
        (np.full(44_100, np.nan), 44_100, "NaN"),
        (np.ones(8_000 * 600), 8_000, "cut out one note"),
        (np.ones(1_000), 44_100, "let the note ring"),
        (np.ones(44_100), 4_000, "record at 44100"),
    ],
)
def test_reasons_are_given(samples, rate_hz, words):
    with pytest.raises(RecordingError, match=words):
        note_of(samples, rate_hz)


def test_high_rates_are_converted_channels_combined_and_the_louder_of_unlike_ones_is_taken(synthetic):
    twice = np.repeat(synthetic.samples, 4)  # a crude 176.4 kHz
    note = note_of(np.stack([twice, twice], 1), 4 * synthetic.rate_hz)
    assert note.rate_hz == synthetic.rate_hz
    assert note.onset == pytest.approx(0.1 * note.rate_hz, abs=0.005 * note.rate_hz)
    noise = 1e-3 * np.random.default_rng(0).standard_normal(len(synthetic.samples))
    note = note_of(np.stack([noise, synthetic.samples], 1), synthetic.rate_hz)
    assert np.allclose(note.samples, synthetic.samples - synthetic.samples.mean())


@pytest.mark.parametrize("rate_hz", [88_200, 96_000, 64_000])
def test_a_high_rate_has_the_tones_of_a_low_one_and_nothing_folded(rate_hz):
    def recorded(hz: float, at_hz: int) -> np.ndarray:
        time_s = np.arange(at_hz // 2) / at_hz
        return np.sin(2 * np.pi * hz * time_s) * np.hanning(len(time_s) + 1)[:-1]

    tone, above = 18_000.0, 29_000.0  # the second is above half the rate that is fitted
    note = note_of(recorded(tone, rate_hz) + recorded(above, rate_hz), rate_hz)
    expected = recorded(tone, note.rate_hz)[: len(note.samples)]
    assert np.linalg.norm(note.samples[: len(expected)] - expected) < 1e-4 * np.linalg.norm(expected)
