"""The memory of voices, programs and mixers: flat arrays of eight-byte numbers, real or whole.

A *program* is what voices of one source share: a model's parameters, or a solver's. A *voice* is one pluck of it as
it rings. Slots are counted in eight-byte numbers. Whole numbers and real ones share the memory; each slot is always
one or the other. One thread writes a slot while others may read it; what a command changes is read once a quantum.
"""

from __future__ import annotations

from numba import njit

from engine.kernels.compiled import COMPILED

QUANTUM = 64  # frames that are rendered at a time, whatever the device asks for
AHEAD = 32  # frames that the limiter looks ahead, its delay; even, and a quantum at most

ATTACK_S = 0.002  # of a voice, the very start: a pluck has an attack, which a longer fade would swallow
FADE_S = 0.020  # another source, another gain
END_FADE_S = 0.25  # of a model that hums on where its string has long been silent
SILENT_DB = -100.0  # of full scale: a voice that has fallen below is over
LONGEST_S = 1e9  # of a voice that never ends
BRIGHTER = 10.0  # times as much of full scale a narrow pluck may be as velocity

# A voice's state
WAITING, SOUNDING, OVER, RUNAWAY = 0, 1, 2, 3
# A voice's kind
TRUTH, RENDERED, TENSION = 1, 2, 3

# Slots of a voice (W: whole number, R: real)
STATE = 0  # W
KIND = 1  # W
PROGRAM = 2  # W address
FRAME = 3  # W frames given out since the pluck, without those in which it stood still
GENERATED = 4  # W frames generated since the pluck: one quantum more where the pick-up senses velocity
POINTS = 5  # W listening points, 1 or 2
VELOCITY = 6  # W whether the pick-up senses velocity
WANTED_GAIN = 7  # R set by a command
GAIN = 8  # R as it is now
FADE_FRAMES = 9  # W that a change of gain takes
RELEASE = 10  # W above 0: fade out within so many frames, and end
LIMIT = 11  # R the largest believable output, of full scale
NEXT_WEIGHTS = 12  # W 1: the second set of weights is to be faded to; back to 0 when it is the first
WEIGHTS_FADED = 13  # W frames of that fade
STRUCK_S = 14  # R the device clock's time of the gesture
BEGAN_S = 15  # R and of the callback that gave the device its first samples
STARVED = 16  # W frames in which it should have sounded and had nothing to
MODES = 17  # W modes, 0 of a rendered voice
MOVING = 18  # W modes of the truth, or latents that share a tension, up to the highest that is not silent
LOUDNESS = 21  # R nepers below full scale that the loudest latent, or all of the string, has now
GAIN_FROM = 22  # R where the present change of gain began
GAIN_TO = 23  # R and where it leads
GAIN_DONE = 24  # W frames of it
SILENT = 25  # R nepers of full scale: a voice whose loudness has fallen below is over
SAMPLES = 27  # W address of a rendered voice's samples, float32 (frames, points)
READY = 28  # W of them, set by the renderer
LENGTH = 29  # W of them in all; after the last the voice is over
DRY = 30  # W whether it had nothing to play in the last quantum
ATTACK = 31  # W frames of the fade-in at the pluck
BEGAN_FRAME = 32  # W the mixer's frame at which it began, after any samples it waited for; -1 until then
REFRESH = 33  # W quanta until it looks again: at a drum's modes, at a string's nodes
BEGIN_AT = 36  # W the mixer's frame at which it begins; in the past: with the next quantum
RELEASE_AT = 37  # W the mixer's frame from which it fades out; 0: none
LOOPED = 38  # W whether a rendered voice, of the device's own rate, begins again after its last sample
WARM = 40  # W quanta of its own displacement that a velocity voice has behind it, without one that was unheard
RESONATOR = 41  # W address of the latest of these that are due; the kernel glides there
CURRENT_MODES = 42  # W the one that it is gliding to, or has reached
GLIDE = 43  # W quanta left of the way
PREVIOUS_VOICE = (
    44  # W address of the voice that has the string until this one begins; 0: none has, or it is taken over
)
PREPARED = 45  # W whether the rows that follow from its modes are there
STEPS = 46  # W nodes, or sub-steps, of a frame, for which they were made
DECAY = 47  # R of the largest energy in a frame
LARGEST_ENERGY = 48  # R of latents that share a tension
LARGEST_STRETCH = 49  # R
PEAK = 50  # R m: of the displacement at its release, a least one
JOINS = 51  # W whether its fade-in is the complement of the other's fade
ENDS_AT = 52  # W frames since the pluck, from which on it fades out whatever it still gives
ENDS_IN = 53  # W frames of that fade
STOPS_IN = 54  # W frames of the fade in which it stops the voice before; 0: it is added to that motion
LATE = 55  # W frames after the beginning of the mixer's quantum at which its own begins, below QUANTUM
PENDING_MODES = 56  # W address of the first modes that it was to have; each names the next
HEARD = 57  # W modes that move and are heard, the first of the row ORDER
FELT = 58  # W those and the next, which stretch a drum; the others, up to MOVING, rest
RESTED = 59  # W quanta in which those did not even decay
REST_STRETCH = 60  # R what they add to S on average, and
REST_SECOND = 61  # R to R
REST_DECAY = 62  # R of both in a quantum
NEARNESS = 63  # R full scale over the length in which a pick-up's flux grows e-fold; 0: it grows evenly
NODES = 64  # W since the rows were prepared, for which modes that rest have not turned, and
STRETCHED = 65  # R the sum of S over them
COURSE = 66  # W number of the strings with which it stands on one bridge; 0: none
COURSE_DONE = 67  # W the mixer's frame, and 1, of the quantum that is already added
BRIDGED = 68  # W its lowest modes, up to the last that has a part in the row BRIDGE
JAVARI_STEPS = 69  # W of a frame, in which it may meet the edge of its bridge; 0: there is no edge
JAVARI_GAP = 70  # R m: from the string at rest to the edge
JAVARI_STIFFNESS = 71  # R N/m: of the edge
JAVARI_LOSS = 72  # R s/m
JAVARI_MASS = 73  # R kg: of a mode
JAVARI_GIVE = 74  # R m/N: how far it gives way to a force within a step; 0: the rows are not prepared
JAVARI_HEARD = 75  # R full scale over N: of that force
JAVARI_FORCE = 76  # R N: in the frame before
OF_INSTRUMENT = 77  # W whether it has part in sympathy, amplifier, body and room; else it is heard as it is
HEADER = 78


@njit(**COMPILED)
def weights(modes: int, which: int, point: int, part: int) -> int:
    """First slot of the weights (modes,) of a set, a point, and of the real (0) or imaginary (1) parts."""
    return HEADER + ((which * 2 + point) * 2 + part) * modes


@njit(**COMPILED)
def bias(modes: int, which: int, point: int) -> int:
    return HEADER + 8 * modes + which * 2 + point


@njit(**COMPILED)
def history(modes: int, point: int) -> int:
    """First slot of the last three quanta of displacement at a point, the latest last."""
    return HEADER + 8 * modes + 4 + point * 3 * QUANTUM


@njit(**COMPILED)
def left_over(modes: int) -> int:
    """First slot of what reaches into the mixer's next quantum, (QUANTUM, 2), of a voice that is late."""
    return HEADER + 8 * modes + 4 + 6 * QUANTUM


@njit(**COMPILED)
def state(modes: int) -> int:
    """First slot of what a kind keeps for itself."""
    return HEADER + 8 * modes + 4 + 8 * QUANTUM


# Rows of the state of a voice with modes (the truth, or latents that share a tension): two that move, amplitude and
# speed or x and y; five of its resonator as it is now; and what follows from them
OMEGA_SQUARED, SIGMA, COUPLING, STRETCH = 2, 3, 4, 5
BRIDGE = 6  # 1/s: what it loses to a bridge on which other strings of its course stand, beside SIGMA
FOLLOWING = 7
RESONATOR_ROWS = FOLLOWING - OMEGA_SQUARED
JAVARI = FOLLOWING + 16  # of a string with an edge: displacement there of an amplitude of 1, and what both change by
GIVEN, GIVEN_SPEED = JAVARI + 1, JAVARI + 2  # with a force of 1 N there within a step
TRUTH_ROWS = FOLLOWING + 19  # before these, the flows of half a palindrome, of four rows each
PHYSICAL = FOLLOWING + 7  # behind the rows of `kernels.tension.advance`: amplitudes and speeds for a moment
ORDER = PHYSICAL + 2  # whole numbers: modes
TENSION_ROWS = ORDER + 1

# Slots of the modes that a voice is to have, then the five rows above
B_QUANTA = 0  # W of the way there
B_NEXT = 1  # W address of the modes that were wished for next; 0: none yet
B_AT = 2  # W the mixer's frame from which they count
B_HEADER = 3

# Slots of the truth's program
T_SUBSTEPS = 0  # R in a period of the highest mode
T_SILENCE = 1  # R
T_LOUDNESS = 2  # R nepers: log of full scale's share of a metre
T_RATE = 3  # R frames a second
STAGES = 8  # exact rotations of a sub-step, a palindrome, with a kick between two
T_ROTATIONS = 4  # R shares of a sub-step, of the first half
T_KICKS = T_ROTATIONS + STAGES // 2  # R all
T_HEADER = T_KICKS + STAGES - 1

# Slots of the program of latents that share a tension; then three curves of so many coefficients
S_COEFFICIENTS = 0  # W
S_NODE_PHASE = 1  # R
S_HIGHEST_PHASE = 2  # R
S_SILENCE = 3  # R
S_LOUDNESS = 4  # R nepers: log of full scale's share of a metre
S_RATE = 5  # R frames a second
S_UNHEARD = 6  # R of the output: a mode that is quieter, and hardly stretches a drum, rests; 0: none does
S_HEADER = 7

# Slots of a rendered voice's program
R_TAPS = 0  # W of the filter, to either side
R_PHASES = 1  # W
R_RATIO = 2  # R samples a frame
R_FILTER = 3  # W slot of (phases + 1, 2 taps)
R_HEADER = 8

# Slots of a mixer
MOST_VOICES = 256
RING = 1024
GAPS = 64
GAP_FIELDS = 3  # frame, milliseconds, cause
CAUSE_DEVICE, CAUSE_STARVED, CAUSE_RUNAWAY = 1, 2, 3
M_RATE = 0  # R frames a second
M_FRAMES = 1  # W given to the device
M_CALLS = 2  # W of the callback
M_NOW_S = 3  # R the device clock at the last call
M_DAC_S = 4  # R and when its first sample is heard
M_UNDERFLOWS = 5  # W that the device reported
M_ACTIVE = 6  # W voices
M_PUSHED = 7  # W voices that were handed over
M_TAKEN = 8  # W and taken up
M_WANTED_VOLUME = 9  # R
M_VOLUME = 10  # R
M_LIMITER = 11  # R the level that it holds
M_RELEASE = 12  # R its factor a frame
M_REDUCTION = 13  # R the least gain since it was read, 1: none
M_PEAK = 14  # R the highest sample since it was read
M_NON_FINITE = 15  # W samples that were replaced by silence
M_LEFT = 16  # W frames of the last quantum that are still to be given
M_TONE_FRAME = 17  # W of the test tone; beyond its length: none
M_TONE_LENGTH = 18  # W
M_TONE_SIDE = 19  # W 1 left, 2 right, 3 both
M_GAPS = 20  # W gaps so far
M_CHANNELS = 21  # W of the device, 1 or 2
M_SMOOTHING = 22  # R what is left a frame of a change of volume
M_LIMITING = 24  # W whether the limiter is at work: not where a file is made
M_CONVOLVER = 25  # W address of its memory, where there are effects; it stays
M_EFFECTS = 26  # W address of the impulse response that is wanted; 0: none
M_EFFECTS_NOW = 27  # W of the one that is heard
M_EFFECTS_NEXT = 28  # W of the one that is being faded to; 0: none is, or to none
M_PLAYER = 29  # W address of the player whose events are played; 0: none
M_ADDRESS = 30  # W its own address
M_PLAYER_BEFORE = 31  # W address of the player before, whose notes ring on; 0: none
M_VOICES = 32  # W addresses
M_RING = M_VOICES + MOST_VOICES  # W addresses
M_GAP_LIST = M_RING + RING  # R
MOST_COURSE = 3  # strings of a key
M_COURSE = M_GAP_LIST + GAPS * GAP_FIELDS  # W addresses of strings on one bridge, and of those generated now, or 0
M_MIX = M_COURSE + 2 * MOST_COURSE  # R (QUANTUM, 2)
M_OUT = M_MIX + 2 * QUANTUM  # R (MOST_COURSE, 4, QUANTUM): two sets of weights at two points
M_TAPS = M_OUT + 4 * QUANTUM * MOST_COURSE  # R the differentiator's, (2 REACH + 1)
REACH = 32  # frames of the differentiator to either side
M_WAITING = M_TAPS + 2 * REACH + 2  # R (AHEAD + QUANTUM, 2): what the limiter has not given yet, and the mix
M_PEAKS = M_WAITING + 2 * (AHEAD + QUANTUM)  # R (AHEAD + QUANTUM,): the levels of these
M_GAINS = M_PEAKS + AHEAD + QUANTUM  # R (AHEAD + QUANTUM,): the gains that were held since
M_SCRATCH = M_GAINS + AHEAD + QUANTUM
MOST_MODES = 512
SCRATCH_ROWS = 40
SCRATCH_SLOTS = SCRATCH_ROWS * MOST_MODES + 4 * QUANTUM * MOST_MODES
M_AMPLIFIER = M_SCRATCH + SCRATCH_SLOTS

# Slots of the mixer's amplifier
OVERSAMPLING = 12
A_TAPS = 52 * OVERSAMPLING  # of the filter to the higher rate, and of that back
A_WANTED_DRIVE = 0  # R factor before the shape; 0: it is off
A_WANTED_GAIN = 1  # R factor behind it
A_WANTED_TONE = 2  # R factor of what lies above its pivot, and 1 over that of what lies below
A_DRIVE = 3  # R these three as they are now
A_GAIN = 4  # R
A_TONE = 5  # R
A_SHARE = 6  # R 0 … 1: how far it is switched on
A_ON = 7  # W whether its filter is there, and its memory is of the latest input
A_QUIET = 8  # W quanta without input
A_STATE = 10  # R input's low part, last input of the shape, its mean, the output's low part
A_FILTER = A_STATE + 4  # R (A_TAPS,)
A_INPUT = A_FILTER + A_TAPS  # R (A_TAPS / OVERSAMPLING + QUANTUM,)
A_SHAPED = A_INPUT + A_TAPS // OVERSAMPLING + QUANTUM  # R (OVERSAMPLING, A_TAPS / OVERSAMPLING + QUANTUM)
A_OUT = A_SHAPED + A_TAPS + OVERSAMPLING * QUANTUM  # R (QUANTUM,)
MIXER_SLOTS = M_AMPLIFIER + A_OUT + QUANTUM

# An impulse response for the convolver: then its spectra, (early, channels, 2, QUANTUM + 1) and (late, channels, 2,
# WINDOW + 1), real parts before imaginary ones, over the length of their transforms
WINDOW = 1024  # frames of a late partition; QUANTUM times a power of 4
WINDOW_QUANTA = WINDOW // QUANTUM
LARGEST = 1e6  # of its input, times full scale: beyond it, or where it is no number, a frame is taken as silence
SMALLEST = 1e-20  # and below it as well: what dies away comes to an end, and never is denormal
EARLY = 2 * WINDOW_QUANTA  # partitions of a quantum each; what is later can wait for a window to be computed
I_CHANNELS = 0  # W 1 or 2
I_EARLY = 1  # W partitions
I_LATE = 2  # W partitions
I_HEADER = 4

# Slots of a convolver: the input's spectra, and two lanes, of the response that is heard and of the next one
C_CAPACITY = 0  # W late partitions, at most
C_FADE_WINDOWS = 1  # W that a change of the response takes
C_ACTIVE = 2  # W whether there is any input, or an echo of it
C_QUIET = 3  # W quanta without input
C_PHASE = 4  # W the quantum of its window
C_WINDOWS = 5  # W that have begun since it woke
C_LANE = 6  # W 0 or 1: of the response that is heard
C_STEP = 7  # W of a change: the window in which it is prepared, 0, and those in which it fades; -1: none
C_EARLY_PLACE = 8  # W of the latest spectrum in its ring
C_EARLY_FILLED = 9  # W spectra since it woke, at most EARLY
C_LATE_PLACE = 10  # W
C_LATE_FILLED = 11  # W
C_HALF = 12  # W which half of what was computed is given now
C_COSINES = 16  # R (2 WINDOW,)
C_SINES = C_COSINES + 2 * WINDOW
C_EARLY_INPUT = C_SINES + 2 * WINDOW  # R (2, 2 QUANTUM)
C_LATE_INPUT = C_EARLY_INPUT + 4 * QUANTUM  # R (2, 2 WINDOW)
C_WORK = C_LATE_INPUT + 4 * WINDOW  # R (4, 2 WINDOW)
C_SUMS = C_WORK + 8 * WINDOW  # R (3, 2, 2, WINDOW + 1): a window's spectrum of either lane, a quantum's
C_GIVEN = C_SUMS + 12 * (WINDOW + 1)  # R (2 lanes, 2 halves, 2, WINDOW)
C_WET = C_GIVEN + 8 * WINDOW  # R (2 lanes, 2, QUANTUM)
C_EARLY = C_WET + 4 * QUANTUM  # R (EARLY, 2, 2, QUANTUM + 1)
C_LATE = C_EARLY + EARLY * 4 * (QUANTUM + 1)  # R (capacity, 2, 2, WINDOW + 1)
