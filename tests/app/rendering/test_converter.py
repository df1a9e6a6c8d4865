"""The converter is soxr's, and prompt."""

from __future__ import annotations

import numpy as np
import pytest
import soxr
from app.rendering.converter import GUARD_FRAMES, QUALITY, PromptConverter


def pluck(rate_hz: int, channels: int) -> np.ndarray:
    time_s = np.arange(rate_hz)[:, np.newaxis] / rate_hz
    partials = np.arange(1, int(rate_hz / 2 / 260))
    sound = (np.cos(2 * np.pi * 247 * partials * time_s) / partials * np.exp(-3 * time_s)).sum(1)
    return np.stack([sound / np.abs(sound).max()] * channels, axis=1).astype(np.float32)


@pytest.mark.parametrize(("rate_hz", "sound_rate_hz"), [(4_000, 48_000), (16_000, 44_100), (48_000, 48_000)])
@pytest.mark.parametrize("channels", [1, 2])
def test_it_is_soxrs_conversion_and_comes_at_once(rate_hz: int, sound_rate_hz: int, channels: int) -> None:
    signal = pluck(rate_hz, channels)
    converter = PromptConverter(rate_hz, sound_rate_hz, channels)
    out = [converter.feed(signal[:257])]
    assert len(out[0]) >= (257 - GUARD_FRAMES) * sound_rate_hz // rate_hz
    out += [converter.feed(signal[k : k + 512], k + 512 >= len(signal)) for k in range(257, len(signal), 512)]
    expected = soxr.resample(signal, rate_hz, sound_rate_hz, QUALITY)
    np.testing.assert_allclose(np.concatenate(out), expected, atol=6e-5)
