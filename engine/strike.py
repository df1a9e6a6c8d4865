"""A blow on a surface: the force of a mallet over milliseconds, at a place, spread over the mallet's face.

The force is a raised cosine of the time of contact. After a symmetrical pulse a mode moves as if it had been kicked
at the pulse's middle with the pulse's spectrum at its own frequency. So a blow is a start with speeds alone. The
time of contact falls with the speed as v^(-1/5), Hertz's law for an elastic ball (Johnson, Contact
Mechanics (1985), 11.4). It is a period of the lowest mode at most, in which the surface throws the mallet off: an
estimate, without which soft blows on small drums would be silent. Sticks touch drums for 3 to 6 ms (Wagner, Analysis
of Drumbeats, KTH (2006)). What the head does to the mallet while they touch, and the change of tension meanwhile, are
left out; but the impulse J is that for which energy and momentum balance: a mallet of mass m and speed v gives
J = v / (e + 1/2m), where e J² is the energy of the modes. It rebounds from what is heavy, and stays on what is light.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from engine import bounds
from engine.resonators.base import Array
from engine.values.drum import Mallet

if TYPE_CHECKING:
    from engine.resonators.drum import DrumModes


@dataclass(frozen=True)
class Strike:
    """A mallet that arrives at a place with a speed.

    Attributes:
        place: from the centre, in half-lengths of the surface.

    Raises:
        ValueError: a value is out of its range; the message names it.
    """

    place: tuple[float, float] = (0.3, 0.1)
    speed_m_s: float = 2.0
    mallet: Mallet = field(default_factory=Mallet)

    def __post_init__(self) -> None:
        bounds.check("strike speed_m_s", self.speed_m_s, bounds.STRIKE_SPEED_M_S, "m/s")
        for side in self.place:
            bounds.check("strike place", side, (-1.0, 1.0))

    def speeds(self, modes: DrumModes) -> Array:
        """The speeds of the modes in m/s at amplitude 0, float64 (modes,).

        Raises:
            ValueError: the place is not on the surface.
        """
        if not modes.surface.inside(np.array([self.place])):
            raise ValueError(f"strike place {self.place} is not on the drum; choose one nearer the centre")
        mallet = self.mallet
        struck = modes.struck(self.place, mallet.radius_m)
        return modes.blow(struck, mallet.contact_s, mallet.mass_kg, self.speed_m_s)
