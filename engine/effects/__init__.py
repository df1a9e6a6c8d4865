"""The effects on the sum of all voices: an amplifier, a body, and a gentle room.

None of them has part in any error or comparison.

responses   what `engine.kernels` computes, with memory for it
body        from the modes of an instrument's body, or from a response that is given
body_table  seventeen bodies: their modes, with sources
room        of a box of six walls
effects     the amplifier, then body and room as one response
"""

from engine.effects.body import Body, Impulse
from engine.effects.body_table import BODIES
from engine.effects.effects import Effects

__all__ = ["BODIES", "Body", "Effects", "Impulse"]
