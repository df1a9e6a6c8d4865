"""What the test plays: A and B of equal level, sample by sample side by side, never loud enough for the limiter.

A limiter that acts on one of the two, or a level that differs, would give X away.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from app.analysis.abx.trials import Identity
from engine.kernels.limiter import CEILING
from engine.spectra import spectral_distances

LARGEST_PEAK = CEILING / 2  # where a sound begins anew, the end of the old one is still under it
END_S = 0.008  # the fade at the end of each turn
TRIVIAL_CONVERGENCE = 0.5  # half of the spectrum differs: nobody needs a test to hear that


@dataclass(frozen=True)
class Candidate:
    """What can be A or B.

    Attributes:
        source: its name among the sounds of a pluck.
        label: its name for people.
        preset, preset_sha256: what made it; of the truth, the preset whose string it is.
    """

    source: str
    label: str
    preset: str
    preset_sha256: str


@dataclass(frozen=True)
class Stimuli:
    """A and B, ready to be played.

    Attributes:
        rate_hz: of the samples.
        samples: of "A" and "B", (frames, channels).
        gains_db: of A and B, ≤ 0: what they were turned down by.
        same: not one sample differs.
        trivial: the spectra differ so much that the test would say nothing.
    """

    rate_hz: int
    samples: Mapping[Identity, NDArray[np.float32]]
    gains_db: tuple[float, float]
    same: bool
    trivial: bool


def make_stimuli(
    sounds: Mapping[str, NDArray[np.float32]], rate_hz: int, sources: Sequence[str], volume_db: float = 0.0
) -> Stimuli:
    """Two sources of a pluck, levelled by their RMS over all of it, and faded at their ends: they are looped.

    Args:
        sounds: samples by source, (frames, channels), of one length.
        volume_db: with which they are played; it counts for the limiter.

    Raises:
        ValueError: one of them is silent.
    """
    a, b = (sounds[source].astype(np.float64) for source in sources)
    rms = [math.sqrt(float(np.mean(np.square(samples)))) if samples.size else 0.0 for samples in (a, b)]
    if min(rms) == 0:
        raise ValueError(f"{sources[rms.index(0)].capitalize()} is silent with this pluck and listening point.")
    gains = [min(rms) / level for level in rms]
    peak = max(gain * float(np.abs(samples).max()) for gain, samples in zip(gains, (a, b), strict=True))
    peak *= 10 ** (volume_db / 20)
    room = min(1.0, LARGEST_PEAK / peak)
    gains = [gain * room for gain in gains]
    fade = min(round(END_S * rate_hz), len(a))
    falling = (0.5 + 0.5 * np.cos(np.pi * (np.arange(fade) + 0.5) / fade))[:, None]
    made: dict[Identity, NDArray[np.float32]] = {}
    identities: tuple[Identity, Identity] = ("A", "B")
    for identity, gain, samples in zip(identities, gains, (a, b), strict=True):
        levelled = gain * samples
        levelled[len(levelled) - fade :] *= falling
        made[identity] = levelled.astype(np.float32)
    return Stimuli(
        rate_hz,
        made,
        (min(0.0, 20 * math.log10(gains[0])), min(0.0, 20 * math.log10(gains[1]))),  # not a rounding above 0
        same=bool(np.array_equal(made["A"], made["B"])),
        trivial=_convergence(gains[0] * a.mean(axis=1), gains[1] * b.mean(axis=1)) > TRIVIAL_CONVERGENCE,
    )


def _convergence(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """How far apart the spectra are, relative to their strength: of phases alone nobody hears much."""
    return float(spectral_distances(torch.from_numpy(a)[None], torch.from_numpy(b)[None])[0])
