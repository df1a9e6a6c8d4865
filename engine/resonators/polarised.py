"""A string that moves in two directions across its length: normal to the soundboard, and along it.

Kirchhoff's and Carrier's tension acts on both alike, S = Σ η² (y² + z²) (C. E. Gough, "The nonlinear free vibration
of a damped elastic string", JASA 75, 1984). To a resonator they are modes of one shape, side by side, that share one
stretch: solvers and models need no other equation.

The bridge treats the directions differently. A conductance G at the end of a string adds T G/ℓ to its decay rates:
a round trip of 2ℓ/c leaves 1 - 2 Z G of a wave, with Z = T/c (Fletcher and Rossing, "The Physics of Musical
Instruments", section 2.12). Along the board it is stiffer: that motion rings longer, and two-stage decay follows
(G. Weinreich, "Coupled piano strings", JASA 62, 1977; J. Woodhouse, "A necessary condition for double-decay
envelopes in stringed instruments", JASA 150, 2021). Slightly different frequencies beat. The lowest `MOST_PAIRS`
partials have two modes; above them neither beats nor stages are heard, which is an estimate.

`engine.kernels.strings.rows` has the modes: pairs, then single ones.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from engine import bounds


@dataclass(frozen=True)
class Polarisations:
    """The two directions of polarisation, the first normal to the board.

    Attributes:
        angle_deg: of the pluck, from the first direction.
        second_heard: what the second is heard with, of the first.
        second_cents: pitch of the second, above the first.
        conductance_s_kg, second_conductance_s_kg: real part of the bridge's admittance in both directions.
    """

    angle_deg: float = 45.0
    second_heard: float = 0.3
    second_cents: float = 1.0
    conductance_s_kg: float = 0.01
    second_conductance_s_kg: float = 0.001

    def __post_init__(self) -> None:
        for name, (low_high, unit) in bounds.POLARISATIONS.items():
            bounds.check(name, getattr(self, name), low_high, unit)

    @property
    def pulled(self) -> tuple[float, float]:
        """Parts of a pluck in both directions."""
        angle = math.radians(self.angle_deg)
        return math.cos(angle), math.sin(angle)

    @property
    def heard(self) -> tuple[float, float]:
        """The weights with which both are heard: a pluck is heard as high as it is pulled."""
        first, second = self.pulled
        whole = first + self.second_heard * second
        return 1 / whole, self.second_heard / whole

    @property
    def detuning(self) -> float:
        """ω² of the second over that of the first."""
        return float(2 ** (2 * self.second_cents / 1200))
