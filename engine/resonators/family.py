"""The family of strings that a model of many has learned, and the distance of others from it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from engine.values.string import StringParameters

BRIGHT_HZ = 3_000.0  # where the second decay time is given
NEAR = 1.03  # of a range's end: nothing changes there

Bounds = tuple[float, float]


class Beyond(NamedTuple):
    """A difference of a string from a family; `error_grows`: it is known to be played less well."""

    words: str
    error_grows: bool


@dataclass(frozen=True)
class StringFamily:
    """Ranges (low, high) of a string's audible properties; two of them where the middle is left out.

    Attributes:
        pitch_hz: of the quiet first mode.
        inharmonicity: B: mode n of a string without damping has the frequency n f √(1 + B n²).
        t60_s, bright_t60_s: decay by 60 dB of the first mode and of the one nearest 3 kHz, the shorter of the two.
        tension_rise: ΔT/T₀ of a pluck.
        half_width: of a raised cosine or a Gaussian, in lengths.
        position: of the pluck, in lengths.
    """

    pitch_hz: tuple[Bounds, ...]
    inharmonicity: tuple[Bounds, ...]
    t60_s: Bounds
    bright_t60_s: Bounds
    tension_rise: Bounds
    half_width: Bounds = (0.04, 0.15)
    position: Bounds = (0.06, 0.94)

    @property
    def width(self) -> dict[str, Bounds]:
        """The width by shape, as a pluck counts it."""
        low, high = self.half_width
        return {"gaussian": (low, high), "raised_cosine": (2 * low, 2 * high)}

    def outside(self, string: StringParameters) -> list[Beyond]:
        """The differences of a string from these; empty where there are none.

        The error of a model grows where high modes ring longer than in the training. With pitch, inharmonicity and
        the decay of the first mode it does not, as measured in `docs/many-strings.md`.
        """
        sigma, pitch_hz = string.decay_rate(1), string.pitch_hz
        bright = max(2, round(BRIGHT_HZ / max(pitch_hz, 1.0)))
        bright_t60_s = math.log(1000) / max(string.decay_rate(bright), 1e-9)
        facts = (
            ("pitch", pitch_hz, self.pitch_hz, " Hz", False),
            ("inharmonicity", inharmonicity(string), self.inharmonicity, "", False),
            ("decay time", math.log(1000) / max(sigma, 1e-9), (self.t60_s,), " s", False),
            ("decay time near 3 kHz", bright_t60_s, (self.bright_t60_s,), " s", bright_t60_s > self.bright_t60_s[1]),
        )
        return [
            Beyond(
                f"{name} {value:.3g}{unit} is outside the trained "
                + " and ".join(f"{low:g} … {high:g}{unit}" for low, high in trained),
                error_grows,
            )
            for name, value, trained, unit, error_grows in facts
            if not any(low / NEAR <= value <= high * NEAR for low, high in trained)
        ]

    def warnings(self, string: StringParameters) -> list[str]:
        """The differences of `outside` in words, where the error of a model is known to grow."""
        return [one.words for one in self.outside(string) if one.error_grows]


def inharmonicity(string: StringParameters) -> float:
    """B = EIπ²/(T₀ℓ²)."""
    stiffness = string.youngs_modulus_pa * string.second_moment_m4
    return stiffness * math.pi**2 / (string.tension_n * string.length_m**2)
