"""The records of voices and of their programs, and the numbers of the rows that follow a voice.

A *program* is what voices of one source share: a model's parameters, or a solver's. A *voice* is one pluck of it as
it rings. One thread writes a field while others may read it; what a command changes is read once a quantum.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

from engine.kernels.constants import BLOCKS, QUANTUM
from engine.kernels.fields import R, W, slots

# Records, as annotations of kernels
Voice: TypeAlias = Any
BankProgram: TypeAlias = Any
TruthProgram: TypeAlias = Any
TensionProgram: TypeAlias = Any
RenderedProgram: TypeAlias = Any

ATTACK_S = 0.002  # of a voice, the very start: a pluck has an attack, which a longer fade would swallow
FADE_S = 0.020  # another source, another gain
END_FADE_S = 0.25  # of a model that hums on where its string has long been silent
SILENT_DB = -100.0  # of full scale: a voice that has fallen below is over
LONGEST_S = 1e9  # of a voice that never ends
BRIGHTER = 10.0  # times as much of full scale a narrow pluck may be as velocity

# A voice's state
WAITING, SOUNDING, OVER, RUNAWAY = range(4)
# A voice's kind
BANK, TRUTH, RENDERED, TENSION = range(4)

JAVARI_EDGE = np.dtype(  # of the bridge, which a string may meet
    [
        ("steps", W),  # of a frame, in which it may; 0: there is no edge
        ("gap_m", R),  # from the string at rest to the edge
        ("stiffness", R),  # N/m
        ("loss", R),  # s/m
        ("mass_kg", R),  # of a mode
        ("give", R),  # m/N: how far it gives way to a force within a step; 0: the rows are not prepared
        ("heard", R),  # full scale over N: of that force
        ("force", R),  # N: in the frame before
    ]
)

VOICE = np.dtype(
    [
        ("state", W),
        ("kind", W),
        ("program", W),  # address
        ("frame", W),  # frames given out since the pluck, without those in which it stood still
        ("generated", W),  # frames generated since the pluck: one quantum more where the pick-up senses velocity
        ("points", W),  # listening points, 1 or 2
        ("velocity", W),  # whether the pick-up senses velocity
        ("wanted_gain", R),  # set by a command
        ("gain", R),  # as it is now
        ("fade_frames", W),  # that a change of gain takes
        ("release", W),  # above 0: fade out within so many frames, and end
        ("limit", R),  # the largest believable output, of full scale
        ("next_weights", W),  # 1: the second set of weights is to be faded to; back to 0 when it is the first
        ("weights_faded", W),  # frames of that fade
        ("struck_s", R),  # the device clock's time of the gesture
        ("began_s", R),  # and of the callback that gave the device its first samples
        ("starved", W),  # frames in which it should have sounded and had nothing to
        ("modes", W),  # latents, or modes, or 0
        ("moving", W),  # modes of the truth, or latents that share a tension, up to the highest that is not silent
        ("node", W),  # the node from which a bank's integral continues
        ("segment_valid", W),  # whether a bank knows where its last segment ended
        ("loudness", R),  # nepers below full scale that the loudest latent, or all of the string, has now
        ("gain_from", R),  # where the present change of gain began
        ("gain_to", R),  # and where it leads
        ("gain_done", W),  # frames of it
        ("silent", R),  # nepers of full scale: a voice whose loudness has fallen below is over
        ("modulated", W),  # whether a bank's modulation can still be heard
        ("samples", W),  # address of a rendered voice's samples, float32 (frames, points)
        ("ready", W),  # of them, set by the renderer
        ("length", W),  # of them in all; after the last the voice is over
        ("dry", W),  # whether it had nothing to play in the last quantum
        ("attack", W),  # frames of the fade-in at the pluck
        ("began_frame", W),  # the mixer's frame at which it began, after any samples it waited for; -1 until then
        ("refresh", W),  # quanta until it looks again: at a bank's modulation, a drum's modes, a string's nodes
        ("rows", W),  # latents whose modulation can be heard
        ("columns", W),  # latents that can be heard in others' modulation
        ("begin_at", W),  # the mixer's frame at which it begins; in the past: with the next quantum
        ("release_at", W),  # the mixer's frame from which it fades out; 0: none
        ("looped", W),  # whether a rendered voice, of the device's own rate, begins again after its last sample
        ("audible_count", W),  # latents up to the last that can be heard
        ("warm", W),  # quanta of its own displacement that a velocity voice has behind it, without an unheard one
        ("resonator", W),  # address of the latest WISH for other modes that is due; 0: none yet
        ("current_modes", W),  # address of the WISH that it is gliding to, or has reached; 0: none
        ("glide", W),  # quanta left of the way there
        ("previous_voice", W),  # address of the voice that has the string until this one begins; 0: none
        ("prepared", W),  # whether the rows that follow from its modes are there
        ("steps", W),  # nodes of a frame (TENSION), or its sub-steps (TRUTH), for which they were made
        ("decay", R),  # of the largest energy in a frame
        ("largest_energy", R),  # of latents that share a tension
        ("largest_stretch", R),  # of S, their stretch: see `kernels.tension`
        ("peak", R),  # m: of the displacement at its release, a least one
        ("joins", W),  # whether its fade-in is the complement of the other's fade
        ("ends_at", W),  # frames since the pluck, from which on it fades out whatever it still gives
        ("ends_in", W),  # frames of that fade
        ("stops_in", W),  # frames of the fade in which it stops the voice before; 0: it is added to that motion
        ("late", W),  # frames after the beginning of the mixer's quantum at which its own begins, below QUANTUM
        ("pending_modes", W),  # address of the first modes that it was to have; each names the next
        ("heard", W),  # modes that move and are heard, the first of the row ORDER
        ("felt", W),  # those and the next, which stretch a drum; the others, up to `moving`, rest
        ("rested", W),  # quanta in which those did not even decay
        ("rest_stretch", R),  # what they add to S on average, and
        ("rest_second", R),  # to R
        ("rest_decay", R),  # of both in a quantum
        ("nearness", R),  # full scale over the length in which a pick-up's flux grows e-fold; 0: it grows evenly
        ("nodes", W),  # since the rows were prepared, for which modes that rest have not turned, and
        ("stretched", R),  # the sum of S over them
        ("course", W),  # number of the strings with which it stands on one bridge; 0: none
        ("course_done", W),  # the mixer's frame, and 1, of the quantum that is already added
        ("bridged", W),  # its lowest modes, up to the last that has a part in the row BRIDGE
        ("of_instrument", W),  # whether it has part in sympathy, amplifier, body and room; else it is heard as it is
        ("javari", JAVARI_EDGE),
        ("bias", R, (2, 2)),  # of a set of weights, at a point
        ("history", R, (2, 3 * QUANTUM)),  # the last three quanta of displacement at a point, the latest last
        ("left_over", R, (QUANTUM, 2)),  # what reaches into the mixer's next quantum, of a voice that is late
    ]
)
"""Weights follow, (2 sets, 2 points, 2 parts, modes), real parts and imaginary ones; then rows (modes,)."""
WEIGHT_ROWS = 8

# Rows (modes,) of a bank
LEVEL_0, ANGLE_0, ENERGY_0 = range(3)
CONSTANT = 3  # two: what the linear term adds up to in the end
INTEGRAL = 5  # two: of the higher orders up to the node
AT_LEFT = 7
AT_MIDDLE = 9
AT_RIGHT = 11  # two each: the higher orders at the node, half-way and at the next
LEVEL, PHASE, LEVEL_RATE, PHASE_RATE = range(13, 17)  # where the last segment ended
ROW_LIST, COLUMN_LIST = 17, 18  # whole numbers: latents that are modulated, and those that modulate
CHANGE = 19  # of the level by the amplitude's share of the action, at the segment's left and right end: two
BANK_ROWS = 21

# Rows of a voice with modes (the truth, or latents that share a tension): two that move, amplitude and speed or x and
# y; five of its resonator as it is now; and what follows from them
OMEGA_SQUARED, SIGMA, COUPLING, STRETCH = range(2, 6)
BRIDGE = 6  # 1/s: what it loses to a bridge on which other strings of its course stand, beside SIGMA
FOLLOWING = 7
RESONATOR_ROWS = FOLLOWING - OMEGA_SQUARED
STAGES = 8  # exact rotations of a sub-step, a palindrome, with a kick between two
JAVARI = FOLLOWING + 16  # of a string with an edge: displacement there of an amplitude of 1, and what both change by
GIVEN, GIVEN_SPEED = JAVARI + 1, JAVARI + 2  # with a force of 1 N there within a step
TRUTH_ROWS = FOLLOWING + 19  # before these, the flows of half a palindrome, of four rows each
PHYSICAL = FOLLOWING + 7  # behind the rows of `kernels.tension.advance`: amplitudes and speeds for a moment
ORDER = PHYSICAL + 2  # whole numbers: modes
TENSION_ROWS = ORDER + 1

WISH = np.dtype(  # the modes that a voice is to have
    [
        ("quanta", W),  # of the way there
        ("next", W),  # address of the modes that were wished for next; 0: none yet
        ("at", W),  # the mixer's frame from which they count
    ]
)
"""Rows (modes,) follow, RESONATOR_ROWS of them."""

MOST_WIDTHS = 8
BANK_PROGRAM = np.dtype(
    [
        ("modes", W),
        ("ratio", R),  # trained samples a frame
        ("spacing", R),  # trained samples between nodes
        ("limit", R),  # the gain's limit in nepers
        ("second_order", W),
        ("higher", W),  # whether there are higher orders at all
        ("adiabatic", W),  # whether f follows the mean tension to all orders, and A is there
        ("layers", W),  # of the network g; 0: none
        ("modulates", W),  # whether M is there
        ("loudness", R),  # nepers: log of full scale's share of a latent of 1
        ("early", W),  # frames in which segments are short
        ("widths", W, MOST_WIDTHS),  # sizes of the network's layers, from the input on
        ("sigma", W),  # slots of what follows, from here on
        ("omega", W),
        ("coupling", W),
        ("largest", W),
        ("shares", W),
        ("energy_units", W),
        ("rate_units", W),
        ("at_zero", W),
        ("network", W),
        ("modulation", W),  # M
        ("largest_modulation", W),
        ("change", W),  # A, transposed
    ]
)
BANK_PARTS = BANK_PROGRAM.names[12:] if BANK_PROGRAM.names else ()

TRUTH_PROGRAM = np.dtype(
    [
        ("substeps", R),  # in a period of the highest mode
        ("silence", R),  # share of all modes' amplitude, below which the highest are laid to rest
        ("loudness", R),  # nepers: log of full scale's share of a metre
        ("rate_hz", R),
        ("rotations", R, STAGES // 2),  # shares of a sub-step, of the first half
        ("kicks", R, STAGES - 1),  # all
    ]
)

TENSION_PROGRAM = np.dtype(
    [
        ("coefficients", W),  # of each of the three curves, which follow
        ("node_phase", R),  # rad that the lowest mode may turn between two nodes, at most
        ("highest_phase", R),  # rad that the highest one may
        ("silence", R),  # share of all modes' amplitude, below which the highest are laid to rest
        ("loudness", R),  # nepers: log of full scale's share of a metre
        ("rate_hz", R),
        ("unheard", R),  # of the output: a mode that is quieter, and hardly stretches a drum, rests; 0: none does
    ]
)

RENDERED_PROGRAM = np.dtype(
    [
        ("taps", W),  # of the filter, to either side
        ("phases", W),  # places between two samples for which it is tabulated
        ("ratio", R),  # samples a frame
        ("filter", W),  # slot of (phases + 2, 2 taps), whose last row is there twice
    ]
)


def voice_bytes(modes: int) -> int:
    """The size of a player's voice with so many modes, and with the blocks of modes that it is to have."""
    return 8 * (_VOICE_SLOTS + BLOCKS * _WISH_SLOTS + (WEIGHT_ROWS + TRUTH_ROWS + BLOCKS * RESONATOR_ROWS) * modes)


_VOICE_SLOTS, _WISH_SLOTS = slots(VOICE), slots(WISH)
