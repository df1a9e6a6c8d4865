"""The effects on the sum of all voices: an amplifier, a body, and a gentle room.

None of them has part in any error or comparison.

impulse     an impulse response as a value that is checked
responses   what `engine.kernels` computes, with memory for it
amp         an amplifier, whose cabinet is a body
body        from the modes of an instrument's body, or from a response that is given
body_table  seventeen bodies: their modes, with sources
body_record a body as plug-ins have it
curves      what a body does to the loudness of a key
room        of a box of six walls
effects     the amplifier, then body and room as one response; the same for arrays
partitions  that response as the compiled convolver reads it
"""

from engine.effects.body import Body
from engine.effects.body_table import BODIES
from engine.effects.effects import Effects, apply
from engine.effects.impulse import Impulse

__all__ = ["BODIES", "Body", "Effects", "Impulse", "apply"]
