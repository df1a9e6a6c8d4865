"""The family of strings that a model of many has learned, and the distance of others from it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from engine.values.string import StringParameters

BRIGHT_HZ = 3_000.0  # where the second decay time is given
NEAR = 1.03  # of a range's end: nothing changes there

Bounds = tuple[float, float]


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

    def warnings(self, string: StringParameters) -> list[str]:
        """The reason why a model of these plays a string less well, in words; empty where it plays it as well.

        Its error grows where high modes ring longer than in the training. With pitch, inharmonicity and the decay of
        the first mode it does not, as measured in `docs/many-strings.md`.
        """
        bright = max(2, round(BRIGHT_HZ / max(string.pitch_hz, 1.0)))
        t60_s = math.log(1000) / max(string.decay_rate(bright), 1e-9)
        low, high = self.bright_t60_s
        if t60_s <= high * NEAR:
            return []
        return [f"decay time near 3 kHz {t60_s:.3g} s is outside the trained {low:g} … {high:g} s"]


def inharmonicity(string: StringParameters) -> float:
    """B = EIπ²/(T₀ℓ²)."""
    stiffness = string.youngs_modulus_pa * string.second_moment_m4
    return stiffness * math.pi**2 / (string.tension_n * string.length_m**2)
