"""The body of an instrument: an impulse response from the modes of `body_table`, or one that is given.

Above the lowest modes only the density and the loss of modes matter, as in J. Woodhouse, "On the synthesis of guitar
plucks", Acta Acustica 90 (2004) 928. Spacings are drawn from Rayleigh's distribution (neighbours avoid one another),
signs at random. A body that is smaller than a wave radiates alike to the left and to the right; the higher the
frequency, the less alike. `engine.kernels.bodies` computes the response.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from engine import bounds
from engine.effects.body_table import BODIES, Wood
from engine.kernels.constants import BODY_HIGHEST_HZ, CURVES_HZ, LOUDNESS_HIGH_HZ, LOUDNESS_LOW_HZ
from engine.kernels.records import BODY, slots

SOUND_M_S = 343.0
SUBSONIC = 0.55  # of the lowest mode: below it a body radiates next to nothing
MOST_PER_HZ = 0.06  # modes: where more overlap, fewer and stronger ones sound the same
LEAST_ALIKE = 0.2  # of left and right, at high frequencies
PEAK = (1e-6, 1e6)  # of an impulse response
LARGEST_GAIN = 1e3  # at any frequency, of a response that is as loud as what it is given
LARGEST_WHOLE = 2**31 - 1  # of a sample


@dataclass(frozen=True, eq=False)
class Impulse:
    """An impulse response from anywhere, (frames, 1 or 2).

    Raises:
        ValueError: it is too long, has too many channels, is silent or inaudible, or has samples that are no numbers.
    """

    samples: NDArray[np.float64]
    rate_hz: int

    def __post_init__(self) -> None:
        bounds.check("its rate", self.rate_hz, bounds.IMPULSE_RATE_HZ, "Hz")
        if self.samples.ndim != 2:
            raise ValueError(f"an impulse response is (frames, channels), not of {self.samples.ndim} dimensions")
        bounds.check("its channels", self.samples.shape[1], (1, bounds.MOST_IMPULSE_CHANNELS))
        bounds.check("its length", len(self.samples) / self.rate_hz, (0.0, bounds.LONGEST_IMPULSE_S), "s")
        if not np.isfinite(self.samples).all():
            raise ValueError("it has samples that are no numbers")
        peak = float(np.abs(self.samples).max(initial=0.0))
        if peak < PEAK[0]:
            raise ValueError("it is silent")
        bounds.check("its largest sample", peak, PEAK)
        from engine.effects.responses import as_loud  # brings the compiler

        size = 1 << (2 * len(self.samples) - 1).bit_length()
        if not np.abs(np.fft.rfft(as_loud(self.samples, self.rate_hz), size, axis=0)).max() <= LARGEST_GAIN:
            raise ValueError(f"it has next to nothing between {LOUDNESS_LOW_HZ:g} and {LOUDNESS_HIGH_HZ:g} Hz")


@dataclass(frozen=True)
class Body:
    """A body and how much of it is heard.

    Attributes:
        mix: 0: the strings alone, 1: the body alone.
        size: in lengths of the model: at 2 all is an octave lower.
        name: of `BODIES`.
        impulse: another response instead.

    Raises:
        ValueError: a value is out of its range; the message names it.
    """

    mix: float = 1.0
    size: float = 1.0
    name: str = "guitar"
    impulse: Impulse | None = None

    def __post_init__(self) -> None:
        bounds.check("mix", self.mix, (0.0, 1.0))
        bounds.check("size", self.size, bounds.BODY_SIZE)
        if self.name not in BODIES:
            raise ValueError(f"no body is named {bounds.brief(self.name)}; there are {', '.join(BODIES)}")

    @property
    def channels(self) -> int:
        """The channels of its response that differ."""
        return 2 if self.impulse is None else self.impulse.samples.shape[1]

    def response(self, rate_hz: int) -> NDArray[np.float64]:
        """The response of the body alone, (frames, 2), as loud as what it is given."""
        return _response(self.name, self.impulse, self.size, rate_hz)


@lru_cache(maxsize=8)
def _response(name: str, impulse: Impulse | None, size: float, rate_hz: int) -> NDArray[np.float64]:
    """The response (frames, 2) of a body by its name, or of an impulse instead; remembered, not to be written."""
    from engine.effects.responses import of_given, of_modes  # brings the compiler

    if impulse is None:
        wood = BODIES[name]
        response = of_modes(modes_of(wood), wood.seconds, subsonic_hz(wood), size, rate_hz)
    else:
        response = of_given(impulse.samples, impulse.rate_hz, size, rate_hz)
    response.setflags(write=False)
    return response


@lru_cache(maxsize=16)
def curves_of(body: Body) -> NDArray[np.float64]:
    """The effect of a body alone on a key's loudness, (BODY_SLOTS,), see `kernels.constants`.

    It takes some hundredths of a second, once: the array is remembered, and not to be written.
    """
    from engine.effects import responses

    curves = responses.curves_of(body.response(CURVES_HZ))
    curves.setflags(write=False)
    return curves


def subsonic_hz(wood: Wood) -> float:
    """The frequency below which a body radiates next to nothing, at a size of 1."""
    return SUBSONIC * wood.lowest[0].frequency_hz


@lru_cache(maxsize=8)
def modes_of(wood: Wood) -> NDArray[np.float64]:
    """All modes at a size of 1, the lowest first, (4, modes): Hz, decay in 1/s, amplitudes left and right."""
    draw, low = np.random.default_rng(wood.seed), len(wood.lowest)  # low: modes that are measured, one by one
    higher_hz = _higher_hz(wood, draw)
    frequency_hz = np.concatenate([[mode.frequency_hz for mode in wood.lowest], higher_hz])
    quality = np.concatenate([[mode.quality for mode in wood.lowest], np.full(len(higher_hz), wood.quality)])
    decay = np.pi * frequency_hz / quality
    # A mode a exp(−σt) sin ωt has its peak at a/2σ, and the power a²/8σ over frequency: n of them a hertz are n a²/8σ
    lowest = [mode.sign * 10 ** (mode.peak_db / 20) for mode in wood.lowest] * (2 * decay[:low])
    level = (1 + (higher_hz / wood.bright_hz) ** 2) ** (-wood.fall_db / 12)
    for hill in wood.hills:
        off = hill.quality * (higher_hz / hill.frequency_hz - hill.frequency_hz / higher_hz)
        level = level * (1 + (10 ** (hill.rise_db / 20) - 1) / np.sqrt(1 + off**2))
    higher = level * np.sqrt(8 * decay[low:] / _density(wood, higher_hz)) * draw.choice((-1.0, 1.0), len(higher_hz))
    amplitude = np.repeat(np.concatenate([lowest, higher])[:, None], 2, axis=1)
    wide_hz = SOUND_M_S / (2 * np.pi * wood.half_width_m)
    alike = LEAST_ALIKE + (1 - LEAST_ALIKE) / (1 + (higher_hz / wide_hz) ** 2)
    amplitude[low:, 1] *= np.where(draw.random(len(higher_hz)) < (1 + alike) / 2, 1.0, -1.0)
    return np.vstack([frequency_hz, decay, amplitude.T])


def _density(wood: Wood, frequency_hz: NDArray[np.float64]) -> NDArray[np.float64]:
    """Modes a hertz at frequencies (frequencies,), MOST_PER_HZ at most."""
    places, densities = zip(*wood.density, strict=True)
    return np.minimum(np.interp(frequency_hz, places, densities), MOST_PER_HZ)


def _higher_hz(wood: Wood, draw: np.random.Generator) -> NDArray[np.float64]:
    """Frequencies in Hz, (modes,), of the modes above the lowest, the same at any rate and size."""
    first_hz, last_hz = wood.lowest[-1].frequency_hz, BODY_HIGHEST_HZ * bounds.BODY_SIZE[1]
    grid_hz = np.arange(first_hz, last_hz, 1.0)
    counted = np.cumsum(_density(wood, grid_hz))  # modes from the first one up to a frequency
    count = int(counted[-1])
    return np.interp(np.cumsum(draw.rayleigh(math.sqrt(2 / math.pi), count)), counted, grid_hz, right=last_hz)


def body_memory(body: Body | None) -> NDArray[np.float64]:
    """A body at a size of 1 as plug-ins have it: the record `BODY`, then modes or samples; all 0: none."""
    memory, rows = np.zeros(slots(BODY)), np.zeros(0)
    record = memory.view(BODY)[0]
    record["longest_s"] = bounds.LONGEST_IMPULSE_S
    if body is not None and body.impulse is not None:
        samples = body.impulse.samples
        unit = float(np.abs(samples).max()) / LARGEST_WHOLE  # where it is loud, finer than single precision
        record["frames"], record["channels"] = samples.shape
        record["hz"], record["unit"] = body.impulse.rate_hz, unit
        whole = np.zeros(2 * -(-samples.size // 2), np.int32)
        whole[: samples.size] = np.rint(samples / unit).ravel()
        rows = whole.view(np.float64)
    elif body is not None:
        wood = BODIES[body.name]
        rows = modes_of(wood).ravel()
        record["modes"] = rows.size // 4
        record["seconds"] = wood.seconds
        record["subsonic_hz"] = subsonic_hz(wood)
    return np.concatenate([memory, rows])
