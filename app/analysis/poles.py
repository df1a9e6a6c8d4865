"""A model's learned eigenvalues beside the string's own, as frequencies and decay times.

An eigenvalue determines a frequency up to its sign and multiples of the sample rate. It is assigned to the mode that
is nearest to one of these frequencies, and compared with it there. Decay counts a little there: it separates
a mode above half the rate from the one that it aliases to.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from engine.presets import Preset, PresetInfo
from engine.sources import array_model

NEPERS_OF_60_DB = math.log(1000)

VANISHED = 1e-12  # |λ| of a state that is gone after a sample: an unused mode of a fit
BELIEVABLE_S = (1e-3, 100.0)  # decay times are clipped to this range
DECAY_WEIGHT = 0.25  # an octave of decay time counts as this share of the fundamental's frequency

QUIET = "of a quiet string: louder, its network shifts them"
_NOTES = {  # by kind of model: a remark on its eigenvalues
    "koopman_integrated": QUIET,
    "koopman_var": "before the multiplier, which changes phases and levels with the energy",
    "lru": "layers follow one another: only the first one's need be the string's",
    "s5": "layers follow one another: only the first one's need be the string's",
}

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Poles:
    """Eigenvalues, one element each.

    Attributes:
        log: log λ per sample, one of each conjugate pair: the imaginary part lies in 0 … π.
        folded_hz: the frequency that is heard, 0 … half the rate.
        t60_s: the time of a decay by 60 dB; infinite where it does not decay.
        mode: the nearest of the string's modes, from 1.
        mode_hz: of the frequencies ±folded_hz + k · rate, which sound the same, the one nearest to that mode's.
        cents: the interval from the mode's own frequency to `mode_hz`.
        layer: of the model, from 0.
    """

    log: NDArray[np.complex128]
    folded_hz: Array
    t60_s: Array
    mode: NDArray[np.int64]
    mode_hz: Array
    cents: Array
    layer: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.log)


@dataclass(frozen=True)
class PoleFigure:
    """The poles of a preset. `learned` is empty where the model has no eigenvalues, and `note` says why."""

    rate_hz: int
    learned: Poles
    string: Poles
    layers: int
    note: str


def pole_figure(preset: Preset) -> PoleFigure:
    """The eigenvalues of a preset's model, and those of its string for small amplitudes."""
    info = preset.info
    string_logs = info.resonator.eigenvalues() / info.rate_hz
    layer_logs = array_model(preset).log_eigenvalues()
    note = _NOTES.get(info.model, "")
    if not layer_logs:
        note = f"a {info.model} has no eigenvalues: its whole field goes through a network at every sample"
    return PoleFigure(info.rate_hz, _poles(layer_logs, info), _poles([string_logs], info), len(layer_logs), note)


def _poles(layers: list[NDArray[np.complex128]], info: PresetInfo) -> Poles:
    """The poles of eigenvalues, each assigned to the nearest of the string's modes.

    Args:
        layers: log λ per sample, (eigenvalues,) of each layer.
    """
    kept = [_upper_half(log[log.real > math.log(VANISHED)]) for log in layers]
    log = np.concatenate([*kept, np.empty(0, complex)])
    layer = np.repeat(np.arange(len(kept)), [len(poles) for poles in kept])
    angle = np.abs(np.angle(np.exp(1j * log.imag)))
    folded_hz = angle * info.rate_hz / (2 * math.pi)
    with np.errstate(divide="ignore"):
        t60_s = np.where(log.real < 0, NEPERS_OF_60_DB / (-log.real * info.rate_hz), math.inf)
    modes_hz = info.resonator.eigenvalues().imag / (2 * math.pi)
    modes_s = NEPERS_OF_60_DB / info.resonator.sigma
    mode, mode_hz = _nearest(folded_hz, modes_hz, info.rate_hz, _octaves(t60_s)[:, None] - _octaves(modes_s))
    with np.errstate(divide="ignore"):
        cents = 1200 * np.log2(np.maximum(mode_hz, 0) / modes_hz[mode])
    return Poles(np.log(np.exp(log.real)) + 1j * angle, folded_hz, t60_s, mode + 1, mode_hz, cents, layer)


def _upper_half(log: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Select one of each pair λ, λ̄, with its angle in 0 … π; `log`: log λ per sample, (eigenvalues,)."""
    angles = np.angle(np.exp(1j * log.imag))
    upper = log.real + 1j * np.abs(angles)
    lower = angles < 0
    paired = np.array([bool(np.isclose(upper[~lower], pole, rtol=0, atol=1e-9).any()) for pole in upper], bool)
    return upper[~(lower & paired)]


def _octaves(t60_s: Array) -> Array:
    return np.log2(np.clip(t60_s, *BELIEVABLE_S))


def _nearest(folded_hz: Array, modes_hz: Array, rate_hz: int, octaves_off: Array) -> tuple[NDArray[np.int64], Array]:
    """Index of the nearest mode, and which of ±f + k · rate is nearest to it, (eigenvalues,) each.

    Args:
        folded_hz: f, (eigenvalues,).
        modes_hz: frequencies of the string's modes, (modes,).
        octaves_off: (eigenvalues, modes), the ratio of decay times in octaves.
    """
    candidates = []  # for +f and -f: the frequency nearest to each mode, (eigenvalues, modes) in Hz
    for signed in (folded_hz, -folded_hz):
        turns = np.round((modes_hz[None] - signed[:, None]) / rate_hz)
        candidates.append(signed[:, None] + turns * rate_hz)
    off = np.abs(np.stack(candidates) - modes_hz)
    side = off.argmin(0)
    alias_hz = np.where(side == 0, *candidates)
    place = np.hypot(off.min(0) / modes_hz[0], DECAY_WEIGHT * octaves_off).argmin(1)
    return place, alias_hz[np.arange(len(folded_hz)), place]
