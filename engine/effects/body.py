"""The body of an instrument: the impulse response of a classical guitar by its modes, or one that is given.

The lowest modes are those of published measurements, in round numbers that are no particular guitar's: the coupled
pair of the air in the hole and the top (O. Christensen and B. B. Vistisen, "Simple model for low-frequency guitar
function", J. Acoust. Soc. Am. 68 (1980) 758), the back, and the next ones of the top (N. H. Fletcher and
T. D. Rossing, "The Physics of Musical Instruments", 2nd ed., chapter 9; T. J. W. Hill, B. E. Richardson and
S. J. Richardson, "Acoustical parameters for the characterisation of classical guitars", Acta Acustica 90 (2004) 335).

Above them single modes do not matter, only their density and loss do, as in J. Woodhouse, "On the synthesis of guitar
plucks", Acta Acustica 90 (2004) 928. The density is that of a thin orthotropic plate, √3 S / (h √(c_x c_y)) a hertz
(L. Cremer, M. Heckl, "Structure-Borne Sound"), with a spruce top's area, thickness and speeds of waves; spacings are
drawn from Rayleigh's distribution (neighbours avoid one another), signs at random.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from engine import bounds
from engine.effects.impulse import Impulse, as_loud, faded, resampled, without_subsonic


@dataclass(frozen=True)
class Mode:
    """A resonance: its frequency, quality factor, and peak over the mean level of the higher modes."""

    frequency_hz: float
    quality: float
    peak_db: float
    sign: int = 1


@dataclass(frozen=True)
class Plate:
    """What makes the higher modes.

    Attributes:
        speeds_m_s: of longitudinal waves along and across the grain.
        bright_hz: from here on the level falls by 6 dB an octave.
    """

    area_m2: float
    thickness_m: float
    speeds_m_s: tuple[float, float]
    quality: float
    bright_hz: float

    @property
    def modes_a_hertz(self) -> float:
        return math.sqrt(3) * self.area_m2 / (self.thickness_m * math.sqrt(math.prod(self.speeds_m_s)))


@dataclass(frozen=True)
class Wood:
    """A body: its lowest modes, and the plate above them."""

    lowest: tuple[Mode, ...]
    plate: Plate
    seconds: float
    seed: int


GUITAR = Wood(
    lowest=(
        Mode(100.0, 18, 4.0),  # the air in the hole with the top
        Mode(195.0, 25, 6.0, -1),  # the top against the air
        Mode(235.0, 30, 2.0),  # the back
        Mode(280.0, 30, 0.0, -1),  # the top's halves against one another: it radiates little
        Mode(395.0, 30, 4.0),  # the top along its length
        Mode(460.0, 30, 3.0, -1),
    ),
    plate=Plate(0.1, 0.0025, (5_200.0, 1_400.0), 30, 2_500.0),
    seconds=0.35,
    seed=49,  # of 300 the most even over the keys E2 to C6, body alone and mixed
)
BODIES: Mapping[str, Wood] = {"guitar": GUITAR}
SIZE = (0.5, 2.0)
SUBSONIC_HZ = 55.0  # below it a body radiates next to nothing
HIGHEST_HZ = 20_000.0
_BLOCK = 128  # frames


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
        bounds.check("size", self.size, SIZE)
        if self.name not in BODIES:
            raise ValueError(f"no body is named {bounds.brief(self.name)}; there are {', '.join(BODIES)}")

    def response(self, rate_hz: int) -> NDArray[np.float64]:
        """Of the body alone, (frames, 1 or 2), as loud as what it is given."""
        return _response(self.name, self.impulse, self.size, rate_hz)


@lru_cache(maxsize=8)
def _response(name: str, impulse: Impulse | None, size: float, rate_hz: int) -> NDArray[np.float64]:
    if impulse is None:
        found = _rung(BODIES[name], size, rate_hz)
    else:
        found = resampled(impulse.samples, impulse.rate_hz / size, rate_hz)
        longest = int(bounds.LONGEST_IMPULSE_S * rate_hz)
        found = found if len(found) <= longest else faded(found[:longest])
    found = as_loud(found, rate_hz)
    found.setflags(write=False)
    return found


def modes_of(wood: Wood, size: float, highest_hz: float) -> tuple[NDArray[np.float64], ...]:
    """Frequencies in Hz, decay rates in 1/s and amplitudes of all modes, (modes,) each, the lowest first."""
    plate, draw = wood.plate, np.random.default_rng(wood.seed)
    spacing_hz, first_hz = 1 / plate.modes_a_hertz, wood.lowest[-1].frequency_hz
    count = int((HIGHEST_HZ * SIZE[1] - first_hz) / spacing_hz)  # the same modes at any rate and size
    higher_hz = first_hz + np.cumsum(draw.rayleigh(spacing_hz / math.sqrt(math.pi / 2), count))
    frequency_hz = np.concatenate([[mode.frequency_hz for mode in wood.lowest], higher_hz])
    quality = np.concatenate([[mode.quality for mode in wood.lowest], np.full(count, plate.quality)])
    decay = np.pi * frequency_hz / quality
    # A mode a exp(−σt) sin ωt has its peak at a/2σ, and the power a²/8σ over frequency: n of them a hertz are n a²/8σ
    lowest = [mode.sign * 10 ** (mode.peak_db / 20) for mode in wood.lowest] * (2 * decay[: len(wood.lowest)])
    falling = 1 / np.sqrt(1 + (higher_hz / plate.bright_hz) ** 2)
    higher = draw.choice((-1.0, 1.0), count) * falling * np.sqrt(8 * decay[len(wood.lowest) :] * spacing_hz)
    frequency_hz, decay = frequency_hz / size, decay / size
    kept = frequency_hz < highest_hz
    return frequency_hz[kept], decay[kept], (np.concatenate([lowest, higher]) / size)[kept]


def _rung(wood: Wood, size: float, rate_hz: int) -> NDArray[np.float64]:
    """All modes after one blow, (frames, 1)."""
    frequency_hz, decay, amplitude = modes_of(wood, size, min(HIGHEST_HZ, 0.45 * rate_hz))
    eigenvalues = -decay + 2j * np.pi * frequency_hz
    blocks = math.ceil(wood.seconds * size * rate_hz / _BLOCK)
    begins = np.exp(np.multiply.outer(np.arange(blocks) * (_BLOCK / rate_hz), eigenvalues))
    within = np.exp(np.multiply.outer(eigenvalues, np.arange(_BLOCK) / rate_hz))
    rung = ((begins * amplitude) @ within).imag.reshape(-1, 1)
    return faded(without_subsonic(rung, SUBSONIC_HZ / size, rate_hz))
