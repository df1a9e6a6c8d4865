"""The noise of what touches strings: pulses and bursts for `engine.kernels.contact`.

Mechanisms have sources; levels and bands are estimates, chosen by the energy between and below partials that sampled
instruments have in their first 50 ms.

- Finger and nail stick to the string, slip for milliseconds, and let it ring: D. Chadefaux, J.-L. Le Carrou,
  B. Fabre, L. Daudet, "Experimentally based description of harp plucking", J. Acoust. Soc. Am. 131, 2012. A nail is
  hard and rubs, a finger is soft and knocks.
- A plectrum's edge slides off in a few milliseconds: G. Evangelista, F. Eckerholm, "Player-instrument interaction
  models for digital waveguide synthesis of guitar", IEEE Trans. Audio Speech Lang. Process. 18, 2010.
- The jack of a harpsichord knocks as it falls back, at the same level for every velocity, and its plectrum touches
  the string again: V. Välimäki, H. Penttinen, J. Knif, M. Laurson, C. Erkut, "Sound synthesis of the harpsichord
  using a computationally efficient physical model", EURASIP J. Adv. Signal Process. 2004.
- A piano's key strikes its bed, and the impact rings in key bed and soundboard, mostly below 1 kHz: A. Askenfelt,
  "Observations on the transient components of the piano tone", STL-QPSR 34 (4), 1993. The damper's felt follows.
- A finger or a damper that lands on a string hits what moves, and so follows its motion: an estimate.
- A stick's tip and a skin scrape and slap; a soft mallet does so less and lower: an estimate.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Exciter = Literal["finger", "nail", "plectrum", "quill", "hammer", "stick", "recorded"]


@dataclass(frozen=True)
class Contact:
    """The noise of one contact, at a stroke of velocity 100; all numbers are estimates.

    Attributes:
        pulse_s: length of a pulse of force, which the body answers with its knock.
        pulse_share: of the energy; the rest is the burst's.
        burst_hz, burst_q: middle of the burst's band, and that over its width.
        attack_s, fall_s: in which the burst rises, and in which its amplitude falls by a factor of e.
        follows: dB per dB of the stroke, or of the motion on which a release lands; 0: alike for all, as a mechanism.
    """

    pulse_s: float
    pulse_share: float
    burst_hz: float
    burst_q: float
    attack_s: float
    fall_s: float
    follows: float


_FINGER = (
    Contact(0.006, 0.7, 900, 0.6, 0.002, 0.012, 1.0),
    Contact(0.010, 0.3, 1_200, 0.6, 0.008, 0.020, 1.0),
)
CONTACTS: Mapping[Exciter, tuple[Contact, Contact]] = {  # of the stroke, of the release
    "finger": _FINGER,
    "nail": (
        Contact(0.004, 0.5, 3_200, 0.7, 0.001, 0.007, 1.0),
        Contact(0.010, 0.3, 1_600, 0.6, 0.006, 0.018, 1.0),
    ),
    "plectrum": (
        Contact(0.004, 0.55, 1_800, 0.5, 0.001, 0.018, 1.0),
        Contact(0.010, 0.3, 1_800, 0.6, 0.006, 0.020, 1.0),
    ),
    "quill": (
        Contact(0.005, 0.6, 2_600, 0.6, 0.0005, 0.008, 0.0),
        Contact(0.006, 0.6, 1_400, 0.6, 0.002, 0.022, 0.0),
    ),
    "hammer": (
        Contact(0.004, 0.7, 700, 0.6, 0.001, 0.018, 1.0),
        Contact(0.012, 0.4, 500, 0.6, 0.006, 0.030, 1.0),
    ),
    "stick": (Contact(0.002, 0.0, 4_500, 0.5, 0.0005, 0.010, 1.0), _FINGER[1]),
    "recorded": _FINGER,  # where a preset has no recorded attack
}
