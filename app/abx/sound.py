"""What the test plays: A and B of equal level, sample by sample side by side, never loud enough for the limiter.

A limiter that acts on one of the two, or a level that differs, would give X away.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from app.audio import Track
from app.audio.limiter import CEILING
from engine.spectra import spectral_distances

LARGEST_PEAK = CEILING / 2  # where a sound begins anew, the end of the old one is still under it
TRIVIAL_CONVERGENCE = 0.5  # half of the spectrum differs: nobody needs a test to hear that


@dataclass(frozen=True)
class Candidate:
    """What can be A or B.

    Attributes:
        source: its name in the track.
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
        track: with the sources "A" and "B".
        gains_db: of A and B, ≤ 0: what they were turned down by.
        same: not one sample differs.
        trivial: the spectra differ so much that the test would say nothing.
    """

    track: Track
    gains_db: tuple[float, float]
    same: bool
    trivial: bool


def make_stimuli(track: Track, sources: Sequence[str], volume_db: float = 0.0) -> Stimuli:
    """Two sources of a finished track, levelled by their RMS over all of it.

    Args:
        volume_db: of the player, which comes after the track and counts for the limiter.

    Raises:
        ValueError: one of them is silent, or the track is not finished.
    """
    if not track.complete:
        raise ValueError("The sound is still being rendered.")
    a, b = (track.read(source, 0, track.ready_frames).astype(np.float64) for source in sources)
    rms = [math.sqrt(float(np.mean(np.square(samples)))) if samples.size else 0.0 for samples in (a, b)]
    if min(rms) == 0:
        raise ValueError(f"{sources[rms.index(0)].capitalize()} is silent with this pluck and listening point.")
    gains = [min(rms) / level for level in rms]
    peak = max(gain * float(np.abs(samples).max()) for gain, samples in zip(gains, (a, b), strict=True))
    peak *= 10 ** (volume_db / 20)
    room = min(1.0, LARGEST_PEAK / peak)
    gains = [gain * room for gain in gains]
    levelled = {"A": gains[0] * a, "B": gains[1] * b}
    frames = len(a)
    made = Track(track.rate_hz, frames, ("A", "B"), track.channels)
    made.append(levelled)
    return Stimuli(
        made,
        (min(0.0, 20 * math.log10(gains[0])), min(0.0, 20 * math.log10(gains[1]))),  # not a rounding above 0
        same=bool(np.array_equal(made.read("A", 0, frames), made.read("B", 0, frames))),
        trivial=_convergence(_mono(levelled["A"]), _mono(levelled["B"])) > TRIVIAL_CONVERGENCE,
    )


def _mono(samples: NDArray[np.float64]) -> NDArray[np.float64]:
    return samples if samples.ndim == 1 else samples.mean(axis=1)


def _convergence(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """How far apart the spectra are, relative to their strength: of phases alone nobody hears much."""
    return float(spectral_distances(torch.from_numpy(a)[None], torch.from_numpy(b)[None])[0])
