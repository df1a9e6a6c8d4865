"""The sounds of the test: A and B at equal level, aligned sample by sample, below the limiter's threshold.

A difference in level, or a limiter that acts on one of the two, would give X away.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.analysis.abx.trials import Identity
from engine.compare.spectra import spectral_distances
from engine.kernels.limiter import CEILING

SOURCES = ("model", "truth")  # of A and B
LARGEST_PEAK = CEILING / 2  # at a restart two sounds overlap: the new beginning and the end of the old one
END_S = 0.008  # the fade at the end of each repetition
TRIVIAL_CONVERGENCE = 0.5  # spectral distance above which the difference is obvious without a test


@dataclass(frozen=True)
class Stimuli:
    """A and B, ready to be played.

    Attributes:
        rate_hz: of the samples.
        samples: of "A" and "B", (frames, channels).
        gains_db: of A and B, ≤ 0.
        same: whether all samples are equal.
        trivial: whether the spectra differ so much that a test is pointless.
    """

    rate_hz: int
    samples: Mapping[Identity, NDArray[np.float32]]
    gains_db: tuple[float, float]
    same: bool
    trivial: bool


def make_stimuli(sounds: Mapping[str, NDArray[np.float32]], rate_hz: int, volume_db: float = 0.0) -> Stimuli:
    """Model (A) and truth (B) of a pluck or a blow with equal RMS.

    They are faded at their ends, because they are looped.

    Args:
        sounds: samples by source, (frames, channels), of one length; ±1 is full scale.
        volume_db: with which they are played, as it counts for the limiter.

    Raises:
        ValueError: one of them is silent.
    """
    a, b = (sounds[source].astype(np.float64) for source in SOURCES)
    rms = [math.sqrt(float(np.mean(np.square(samples)))) if samples.size else 0.0 for samples in (a, b)]
    if min(rms) == 0:
        raise ValueError(f"{SOURCES[rms.index(0)].capitalize()} is silent at this listening point.")
    gains = [min(rms) / level for level in rms]
    peak = max(gain * float(np.abs(samples).max()) for gain, samples in zip(gains, (a, b), strict=True))
    peak *= 10 ** (volume_db / 20)
    room = min(1.0, LARGEST_PEAK / peak)  # the factor that keeps both below the limiter
    gains = [gain * room for gain in gains]
    fade = min(round(END_S * rate_hz), len(a))
    falling = (0.5 + 0.5 * np.cos(np.pi * (np.arange(fade) + 0.5) / fade))[:, None]
    stimuli: dict[Identity, NDArray[np.float32]] = {}
    identities: tuple[Identity, Identity] = ("A", "B")
    for identity, gain, samples in zip(identities, gains, (a, b), strict=True):
        levelled = gain * samples
        levelled[len(levelled) - fade :] *= falling
        stimuli[identity] = levelled.astype(np.float32)
    # differences in phase alone are hardly heard
    convergence, _ = spectral_distances(gains[0] * a.mean(axis=1)[None], gains[1] * b.mean(axis=1)[None])
    return Stimuli(
        rate_hz,
        stimuli,
        (min(0.0, 20 * math.log10(gains[0])), min(0.0, 20 * math.log10(gains[1]))),  # not a rounding above 0
        same=bool(np.array_equal(stimuli["A"], stimuli["B"])),
        trivial=bool(convergence[0] > TRIVIAL_CONVERGENCE),
    )
