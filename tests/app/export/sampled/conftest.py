"""A patch that is rendered without a model: decaying sines at the patch's own levels."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from app.patches.patch import Fretted, Patch, PhysicalString
from engine.resonators.string import StringParameters

T60_S = 2.0


@pytest.fixture
def patch_of() -> Callable[..., Patch]:
    """A patch of keys 45 … 64; fields as given."""

    def made(**fields: object) -> Patch:
        own = StringParameters()
        string = PhysicalString(**{name: getattr(own, name) for name in PhysicalString.model_fields})
        defaults = {"name": "Any string", "category": "guitar", "range": (45, 64)}
        return Patch.model_validate({**defaults, "strings": Fretted(string=string), **fields})

    return made


@pytest.fixture
def patch(patch_of: Callable[..., Patch]) -> Patch:
    return patch_of()


@pytest.fixture
def render() -> Callable[..., NDArray[np.float32]]:
    """A sine of the key's pitch, and the softer the wider the pluck; a right channel is 6 dB softer."""

    def rendered(
        patch: Patch, key: int, velocity: int, held_s: float, seconds: float, rate_hz: int
    ) -> NDArray[np.float32]:
        time_s = np.arange(round(seconds * rate_hz)) / rate_hz
        decay = 10 ** (-3 * time_s / T60_S)
        if held_s < seconds:
            decay *= 10 ** (-3 * np.maximum(0, time_s - held_s) / patch.damping.release_t60_s)
        pluck = patch.pluck.pluck(velocity)
        level = pluck.amplitude_mm / 10 * 10 ** (patch.level_db / 20) * 1.6 / (1 + 10 * pluck.width)
        sound = level * decay * np.sin(2 * math.pi * 440 * 2 ** ((key - 69) / 12) * time_s)
        return np.stack([sound / 2**side for side in range(len(patch.pickup.points))], axis=1).astype(np.float32)

    return rendered


@pytest.fixture
def pitch_cents() -> Callable[[NDArray[np.floating], int, int], float]:
    """How far a sound is from a key's pitch of equal temperament: its strongest partial, by a parabola."""

    def found(sound: NDArray[np.floating], rate_hz: int, key: int) -> float:
        bins = 2**19
        spectrum = np.abs(np.fft.rfft(sound * np.hanning(len(sound)), bins))
        peak = int(spectrum[1:-1].argmax()) + 1
        below, top, above = np.log(spectrum[peak - 1 : peak + 2])
        hz = (peak + 0.5 * (below - above) / (below - 2 * top + above)) * rate_hz / bins
        return float(1200 * np.log2(hz / (440 * 2 ** ((key - 69) / 12))))

    return found


@pytest.fixture
def level_db() -> Callable[[NDArray[np.floating]], float]:
    """Root mean square in dB."""
    return lambda sound: float(10 * np.log10(np.mean(np.square(sound.astype(np.float64)))))
