"""The effects on the sum of all voices: a body, and a gentle room. Neither has part in any error or comparison.

impulse    an impulse response as a value: checked, at another rate, as loud as what it is given
body       from the modes of an instrument's body, or from a response that is given
body_table fifteen bodies: their modes, with sources
room       of a box of six walls
effects    both as one response; the same for arrays
partitions that response as the compiled convolver reads it
"""

from engine.effects.body import Body
from engine.effects.body_table import BODIES
from engine.effects.effects import Effects, apply
from engine.effects.impulse import Impulse
from engine.effects.room import Room

__all__ = ["BODIES", "Body", "Effects", "Impulse", "Room", "apply"]
