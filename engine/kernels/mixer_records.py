"""The records of a mixer, its amplifier, its convolver and the responses of that.

One thread writes a field while others may read it; what a command changes is read once a quantum.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

from engine.kernels.constants import AHEAD, QUANTUM
from engine.kernels.fields import R, W

# Records, as annotations of kernels
Mixer: TypeAlias = Any
CourseString: TypeAlias = Any
Amplifier: TypeAlias = Any
Convolver: TypeAlias = Any
Impulse: TypeAlias = Any

MOST_VOICES = 256
RING = 1024
GAPS = 64
CAUSE_DEVICE, CAUSE_STARVED, CAUSE_RUNAWAY = range(1, 4)
MOST_COURSE = 3  # strings of a key
MOST_EARS = 4  # two sets of weights at two points
REACH = 32  # frames of the differentiator to either side
MOST_LATENTS = 512  # of a bank
SCRATCH_ROWS = 40
SCRATCH_SLOTS = SCRATCH_ROWS * MOST_LATENTS + 4 * QUANTUM * MOST_LATENTS

OVERSAMPLING = 12  # of the amplifier
LAGS = 52  # of its filters to the higher rate and back, in frames
SHAPED_FRAMES = LAGS + QUANTUM

LARGEST = 1e6  # of an effect's input, times full scale: beyond, or where it is no number, a frame is taken as silence
SMALLEST = 1e-20  # and below it as well: what dies away comes to an end, and never is denormal
WINDOW = 1024  # frames of a late partition; QUANTUM times a power of 4
WINDOW_QUANTA = WINDOW // QUANTUM
EARLY = 2 * WINDOW_QUANTA  # partitions of a quantum each; what is later can wait for a window to be computed

AMPLIFIER = np.dtype(
    [
        ("wanted_drive", R),  # factor before the shape; 0: it is off
        ("wanted_gain", R),  # factor behind it
        ("wanted_tone", R),  # factor of what lies above its pivot, and 1 over that of what lies below
        ("drive", R),  # these three as they are now
        ("gain", R),
        ("tone", R),
        ("share", R),  # 0 … 1: how far it is switched on
        ("on", W),  # whether its filter is there, and its memory is of the latest input
        ("quiet", W),  # quanta without input
        ("low", R),  # the input's low part
        ("last", R),  # input of the shape
        ("mean", R),  # of the shape's output
        ("low_out", R),  # the output's low part
        ("filter", R, LAGS * OVERSAMPLING),
        ("input", R, SHAPED_FRAMES),
        ("shaped", R, (OVERSAMPLING, SHAPED_FRAMES)),
        ("out", R, QUANTUM),
    ]
)

GAP = np.dtype([("frame", R), ("milliseconds", R), ("cause", R)])

COURSE_STRING = np.dtype(  # of those on one bridge, while a quantum of them is generated
    [
        ("address", W),  # of its voice
        ("parts", W),  # slot in the scratch of its modes' parts in the bridge, …
        ("first", W),  # … and of its modes, in blocks
        ("near", W),  # blocks of them
        ("moving", W),
        ("nodes", W),  # of a frame
        ("ears", W),  # sets of weights that are heard
        ("apart", W),  # rows from the output of one to that of the next
        ("sub_steps", W),  # of one that is solved
        ("stretch", R),  # S and R of `kernels.tension`, at the present node
        ("second", R),
        ("total", R),  # Σ |z|², computed every 16 frames
        ("silence", R),  # of its program
        ("heard", R, 2 * MOST_EARS),  # two sums for each set of weights: see `kernels.lanes`
    ]
)

MIXER = np.dtype(
    [
        ("rate_hz", R),
        ("frames", W),  # given to the device
        ("calls", W),  # of the callback
        ("now_s", R),  # the device clock at the last call
        ("dac_s", R),  # and when its first sample is heard
        ("underflows", W),  # that the device reported
        ("active", W),  # voices that have a place in `voices`
        ("pushed", W),  # voices that were handed over
        ("taken", W),  # and taken up
        ("wanted_volume", R),  # a factor
        ("volume", R),  # as it is now
        ("limiter", R),  # the level that it holds
        ("release", R),  # its factor a frame
        ("reduction", R),  # the least gain since it was read, 1: none
        ("peak", R),  # the highest sample since it was read
        ("non_finite", W),  # samples that were replaced by silence
        ("left", W),  # frames of the last quantum that are still to be given
        ("tone_frame", W),  # of the test tone; beyond its length: none
        ("tone_length", W),
        ("tone_side", W),  # 1 left, 2 right, 3 both
        ("gap_count", W),  # so far
        ("channels", W),  # of the device, 1 or 2
        ("smoothing", R),  # what is left a frame of a change of volume
        ("limiting", W),  # whether the limiter is at work: not where a file is made
        ("convolver", W),  # address of its memory, where there are effects; it stays
        ("effects", W),  # address of the impulse response that is wanted; 0: none
        ("effects_now", W),  # of the one that is heard
        ("effects_next", W),  # of the one that is being faded to; 0: none is, or to none
        ("player", W),  # address of the player whose events are played; 0: none
        ("player_before", W),  # address of the player before, whose notes ring on; 0: none
        ("voices", W, MOST_VOICES),  # addresses of those that are active
        ("ring", W, RING),  # addresses of those that were handed over, from `taken` to `pushed`
        ("gaps", GAP, GAPS),
        ("course", COURSE_STRING, MOST_COURSE),
        ("generated", W, MOST_COURSE),  # which of these are generated now
        ("mix", R, (QUANTUM, 2)),
        ("out", R, (MOST_COURSE, MOST_EARS, QUANTUM)),  # two sets of weights at two points
        ("taps", R, 2 * REACH + 1),  # the differentiator's
        ("waiting", R, (AHEAD + QUANTUM, 2)),  # what the limiter has not given yet, and the mix
        ("peaks", R, AHEAD + QUANTUM),  # the levels of these
        ("gains", R, AHEAD + QUANTUM),  # the gains that were held since
        ("scratch", R, SCRATCH_SLOTS),
        ("amplifier", AMPLIFIER),
    ]
)

IMPULSE = np.dtype(  # a response, over the length of the transforms
    [
        ("channels", W),  # 1 or 2
        ("early", W),  # partitions
        ("late", W),
        ("spare", W),
    ]
)
"""Then spectra, (early, channels, 2, QUANTUM + 1) and (late, channels, 2, WINDOW + 1), real parts first."""

CONVOLVER = np.dtype(  # the input's spectra, and two lanes, of the response that is heard and of the next one
    [
        ("capacity", W),  # late partitions, at most
        ("fade_windows", W),  # that a change of the response takes
        ("active", W),  # whether there is any input, or an echo of it
        ("quiet", W),  # quanta without input
        ("phase", W),  # the quantum of its window
        ("windows", W),  # that have begun since it woke
        ("lane", W),  # 0 or 1: of the response that is heard
        ("step", W),  # of a change: the window in which it is prepared, 0, and those in which it fades; -1: none
        ("early_place", W),  # of the latest spectrum in its ring
        ("early_filled", W),  # spectra since it woke, at most EARLY
        ("late_place", W),
        ("late_filled", W),
        ("half", W),  # which half of what was computed is given now
        ("spare", W, 3),
        ("cosines", R, 2 * WINDOW),
        ("sines", R, 2 * WINDOW),
        ("early_input", R, (2, 2 * QUANTUM)),
        ("late_input", R, (2, 2 * WINDOW)),
        ("work", R, (4, 2 * WINDOW)),
        ("late_sums", R, (2, 2, 2, WINDOW + 1)),  # a window's spectrum of either lane, …
        ("early_sums", R, (2, 2, QUANTUM + 1)),  # … and a quantum's
        ("given", R, (2, 2, 2, WINDOW)),  # of a lane, in a half, on a side
        ("wet", R, (2, 2, QUANTUM)),  # of a lane, on a side
        ("early", R, (EARLY, 2, 2, QUANTUM + 1)),
    ]
)
"""Then the late spectra (capacity, 2, 2, WINDOW + 1)."""
