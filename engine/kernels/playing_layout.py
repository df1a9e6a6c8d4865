"""What lies where in what is played: events, an instrument's table, a player with its notes, and its reports.

Flat arrays of eight-byte numbers as in `layout`. A player and a table hold no reference to Python: a table is
written by the thread that prepares it, then handed over by its address, and only read from then on.
"""

from __future__ import annotations

from engine.kernels import layout as at

HIGHEST_HZ = 20_000.0  # of modes: those above are inaudible
MOST_MODES = 99  # partials of a key's string: the shipped model's grid holds no more
MOST_PAIRS = 24  # of them that have a second mode, of the other polarisation
MOST_SLACKENED = 5  # keys that a guitar's string may be tuned below the set's

AIR_VISCOSITY_PA_S, AIR_DENSITY_KG_M3 = 1.8e-5, 1.2  # at 20 °C
HIGHEST_SIGMA = 0.5  # of ω: the most damping that bridge and losses by mode give one

# A string: the fields of `StringParameters`, in their order
LENGTH, AREA, MOMENT, DENSITY, MODULUS, D1, D3, TENSION = range(8)
STRING = 8
# Multipliers of a string, the first of an instrument's values
STIFFNESS, DECAY, BRIGHTNESS_DECAY, MODULUS_FACTOR, DENSITY_FACTOR, GAUGE, TENSION_FACTOR, LENGTH_FACTOR = range(8)
KNOBS = 8
# An instrument's values, which events and the modulation wheel may change
POSITION, WIDTH, WIDTH_HARD, SOFTEST_MM, HARDEST_MM, CURVE, RELEASE_S, BEND_SEMITONES = range(KNOBS, KNOBS + 8)
ONSET_DB, DAMPER_DB = range(KNOBS + 8, KNOBS + 10)  # noise of the stroke and of the release
MUTE = KNOBS + 10  # 0 … 1: palm mute
HARMONIC = KNOBS + 11  # which partial is the lowest that a touch leaves; 1: there is no touch
STRUM_MS = KNOBS + 12  # from one string of a chord to the next; 0: all at once
STROKES = KNOBS + 13  # of strums: one of the three below
TREMOLO_HZ = KNOBS + 14  # strokes of a key that is held; 0: one
VIBRATO_CENTS = KNOBS + 15  # how far a finger rolls the pitch up and down
VIBRATO_HZ = KNOBS + 16
CONTACT_MS, CONTACT_HARD_MS = range(KNOBS + 17, KNOBS + 19)  # of the softest and the hardest pluck; a 0: at once
JAVARI_UM = KNOBS + 19  # from the string at rest to the edge of its bridge
BODY_MIX = KNOBS + 20  # as far as keys are as loud through it
POINT = KNOBS + 21  # two: listening points
VALUES = KNOBS + 23
DOWN, UP, ALTERNATE = range(3)
REFERENCE_VELOCITY = 100  # at which keys are equally loud, and levels of noise hold
# The level of such a note over its first part. Six of the classical guitar, strummed, peak at -9 dBFS
WANTED_DB, PART_S = -29.0, 0.4  # a loudness meter's block
HIGHEST_PEAK_DB = WANTED_DB + 15.0  # of such a note of any key
GAIN_RANGE_DB = (WANTED_DB - 6.0, WANTED_DB + 66.0)

# Kinds of events
NOTE_ON, NOTE_OFF, BEND, CONTROLLER, TUNE, PARAMETER, TABLE, CANCEL, STOP, CHOKE = range(10)
NOTHING = -1  # of an event that was forgotten
ANY = -1  # channel or key of the notes that are tuned or choked
# Slots of an event (W: whole number, R: real)
EVENT_FRAME = 0  # W of the mixer, at which it counts; 0: at once
EVENT_KIND = 1  # W
EVENT_CHANNEL = 2  # W 0 … 16
EVENT_KEY = 3  # W of a note; the number of a controller, or of one of the values
EVENT_VALUE = 4  # R velocity, bend in -1 … 1, value of a controller or a parameter, semitones, seconds of a fade
EVENT_ID = 5  # W which reports of a note carry; of the notes that are tuned, choked or cancelled; 0: any
EVENT_POSITION = 6  # R of a pluck by hand, as amplitude, width and shape; 0: of one by instrument and velocity
EVENT_AMPLITUDE_MM = 7  # R
EVENT_TABLE = 8  # W address of a table
EVENT_STRUCK_S = 9  # R the device clock's time of the gesture
EVENT_WIDTH = 10  # R
EVENT_STRUCK = 11  # W address of the speeds (modes,) that 1 N s gives a drum at another place; 0: its own place
EVENT_STRUCK_MODES = 12  # W how many they are
EVENT_CHORD = 13  # W the chord in which a note waits for its turn; 0: none
EVENT_CAME = 14  # W the frame at which it would have begun alone
EVENT_STRING = 15  # W of a note: string n of a set from the highest, as n + 1; 0: the channel or the key chooses
EVENT_SHAPE = 16  # W
EVENT_SLOTS = 17
MOST_SOURCES = 4

# Slots of an instrument's table
POLY, GUITAR, MPE = 0, 1, 2
GAUSSIAN, TRIANGULAR, RAISED_COSINE, ROUNDED = 0, 1, 2, 3  # as in `engine.pluck.SHAPES`
BRIDGE = -1.0  # a listening point that is none: the force on the end at 0
BY_TENSION, BY_LENGTH = 0, 1
KEYS = 128
GUITAR_STRINGS = 8  # at most, of a guitar that sends MIDI
GAINS = 1 + GUITAR_STRINGS  # of a key: on the string that it chooses, and on each of the first strings
TABLE_SERIAL = 0  # W rises from table to table
TABLE_INSTRUMENT = 1  # W the same where only knobs were turned
TABLE_MODE = 2  # W
TABLE_LOW = 3  # W lowest key
TABLE_HIGH = 4  # W
TABLE_STRINGS = 5  # W of a set; 0: one string is fretted for all keys
TABLE_SHAPE = 6  # W of plucks
TABLE_STOPS = 7  # W whether a pluck stops its string, or is added to its motion
TABLE_LET_RING = 8  # W
TABLE_BEND_BY = 9  # W
TABLE_POINTS = 10  # W listening points, 1 or 2
TABLE_LEVEL = 11  # R of the whole instrument, a factor
TABLE_BODY = 12  # W slot of the body's curves; 0: it has none
TABLE_VELOCITY = 13  # W whether the pick-up senses velocity
TABLE_SOLO = 14  # W the mode that alone is heard; 0: all are
TABLE_WHEEL = 15  # W which of the values the modulation wheel turns; -1: none
TABLE_WHEEL_GOAL = 16  # R where it leads
TABLE_GRID = 17  # W points of the grid on which plucks have their shape
TABLE_SOURCES = 18  # W voices of a note
TABLE_KINDS = 19  # W four
TABLE_PROGRAMS = 23  # W four addresses
TABLE_PAIRS = 27  # W partials with a second mode, of the other polarisation; 0: there is one direction
TABLE_PULLED = 28  # R two: parts of a pluck in both directions
TABLE_HEARD = 30  # R two: what they are heard with
TABLE_DETUNING = 32  # R ω² of the second over that of the first
TABLE_CONDUCTANCE = 33  # R two: of the bridge, in s/kg
TABLE_VARIATION = 37  # R of plucks from stroke to stroke, 0 … 1
TABLE_SYMPATHY = 38  # W which strings ring with those that are played
NO_SYMPATHY, EVERY_KEY, OPEN_STRINGS = 0, 1, 2
TABLE_SYMPATHY_S_KG = 39  # R conductance of the bridge that drives them
TABLE_LOSSES = 40  # R three: to the air, by friction, by bending
TABLE_DRUMS = 43  # W slot of the slots of drums of all keys (KEYS,), 0 where a key has none; 0: strings are played
TABLE_RECORDED = 44  # W slot of what a recording adds to the law of strings; 0: nothing
TABLE_NOISE_LEVEL = 45  # R energy of a noise of 0 dB, in s of full scale squared
TABLE_ATTACK = 46  # W slot of a recorded attack, the noise of strokes; 0: they have that of a contact
TABLE_STRIKES = 47  # W whether a key strikes its string, which sets out with speeds, or plucks it
TABLE_APERTURE_M = 48  # R length of string over which a pick-up averages
TABLE_NEARNESS = 49  # R full scale over the length in which the flux grows e-fold; 0: it grows evenly
TABLE_COURSE = 50  # W strings of a key that sound together
TABLE_OCTAVES = 51  # W of a set, the lowest strings, whose courses have an octave string
TABLE_APART_CENTS = 52  # R between strings of a course
TABLE_APART_S = 53  # R from the stroke of one to that of the next
TABLE_BRIDGE = 54  # R share of the bridge's losses that strings of a course have in common, 0 … 1
TABLE_JAVARI = 55  # R three: from the end to the edge of its bridge in m, 0 for none; its stiffness and loss
TABLE_CONTACTS = 58  # R (2, CONTACT): noise of the stroke and of the release, in the order of `Contact`
STROKE, RELEASE = 0, 1
PULSE_S, PULSE_SHARE, BURST_HZ, BURST_Q, ATTACK_S, FALL_S, FOLLOWS = range(7)
CONTACT = 8
TABLE_VALUES = TABLE_CONTACTS + 2 * CONTACT  # R
TABLE_PITCHES = TABLE_VALUES + VALUES  # R of keys in Hz; 0: silent
TABLE_OPEN = TABLE_PITCHES + KEYS  # R (strings, OPEN_SLOTS), the highest string first
OPEN_NOTE = 0  # R key of the whole string
OPEN_HZ = 1  # R its pitch
OPEN_STRING = 2  # R
OPEN_SLOTS = OPEN_STRING + STRING
MOST_STRINGS = 128
TABLE_SINES = TABLE_OPEN + MOST_STRINGS * OPEN_SLOTS  # R sin(π k / (grid - 1)), k below 2 (grid - 1)

# Slots of the drum of a key; then seven rows (modes,): ω², σ, k, η², the speed that 1 N s gives, two points' weights
DRUM_MODES = 0  # W
DRUM_MALLET_KG = 1  # R
DRUM_CONTACT_S = 2  # R at 1 m/s
DRUM_SOFTEST_M_S = 3  # R speed of the softest blow
DRUM_HARDEST_M_S = 4  # R
DRUM_MASS_KG = 5  # R of each mode
DRUM_HEADER = 8
DRUM_ROWS = 7
MOST_DRUM_MODES = 1_600

# Slots of a body's curves; then three rows (BODY_POINTS,): of its gain at frequencies, 2^(1/BODY_STEPS) apart
BODY_CROSS = 0  # R what noise through it has in common with that noise
BODY_STEP = 1  # R the highest sample that a step of 1 becomes
BODY_HEADER = 2
BODY_REAL, BODY_IMAGINARY, BODY_POWER = range(3)  # the mean of the channels; of the squares
BODY_LOWEST_HZ, BODY_STEPS = 16.0, 96  # steps an octave: the third of a half-width of a resonance of Q 50
BODY_POINTS = 992
BODY_SLOTS = BODY_HEADER + 3 * BODY_POINTS

# Rows (modes,) of a sound, see `loudness`
SOUND_OMEGA, SOUND_SIGMA, SOUND_LEFT, SOUND_RIGHT, SOUND_X, SOUND_Y, SOUND_COSINE, SOUND_SINE = range(8)
SOUND_ROWS = 8

# Slots of what a recording adds to strings: the fields of `RecordedString`, of which five are of each partial
RECORDED_HZ = 0  # R pitch of the recorded note
RECORDED_SMOOTH = 1  # W points of the decay over that of the law
RECORDED_PARTIALS = 2  # W of the note
RECORDED_MODES = 3  # W at most
RECORDED_REST = 4  # R five: what each fades to with the distance in pitch
CENTS, RATIO, SECOND_CENTS, SECOND_RATIO, SECOND_SHARE = range(5)
RECORDED_HEADER = RECORDED_REST + 5  # R log of frequencies and of ratios (points,), then five rows (partials,)

# Slots of a recorded attack
ATTACK_RATE = 0  # R of its samples
ATTACK_FRAMES = 1  # W
ATTACK_HEADER = 2  # R samples (frames,) of an energy of 1 s of full scale squared


def table_slots(grid_points: int) -> int:
    """Of a table for plucks on a grid of so many points."""
    return TABLE_SINES + 2 * (grid_points - 1)


# Slots of a channel
CHANNELS = 17  # of MIDI, then the keys of the computer and the screen
FIRST, ON_SCREEN = 0, 16
TUNING_STEPS = 8192  # of fine tuning, of a semitone
USUAL_VOLUME = 100  # General MIDI's: at this volume an instrument is as loud as it is without one
CHANNEL_BEND = 0  # R
CHANNEL_PEDAL = 1  # W
CHANNEL_SLIDE = 2  # W 0 … 127; -1: never moved
CHANNEL_RANGE = 3  # R semitones; below 0: the instrument's
CHANNEL_PLAYS = 4  # W whether a note has come
CHANNEL_COARSE = 5  # W the registered parameter that is chosen
CHANNEL_FINE = 6  # W
CHANNEL_MUTE = 7  # R 0 … 1
CHANNEL_LEGATO = 8  # W whether a key moves the note of the one that is held
CHANNEL_SLIDES = 9  # W whether it does in CHANNEL_TIME, else at once
CHANNEL_TIME = 10  # W 0 … 127
CHANNEL_HARMONICS = 11  # W whether its footswitch is down, as the next two
CHANNEL_HELD = 12  # W two: keys that are down, a bit each
CHANNEL_TREMOLO = 14  # W
CHANNEL_STRUMS = 15  # W
CHANNEL_VOLUME = 16  # W 0 … 127
CHANNEL_EXPRESSION = 17  # W 0 … 127
CHANNEL_COARSE_TUNING = 18  # W semitones
CHANNEL_FINE_TUNING = 19  # W steps of a semitone over TUNING_STEPS
CHANNEL_STRUCK = 20  # W (KEYS,) strokes of each key whose release is to come, of those that give no string
CHANNEL_SLOTS = CHANNEL_STRUCK + KEYS

# Slots of a note
FREE, RINGS = 0, 1
NOTE_STATE = 0  # W
NOTE_ID = 1  # W of its event
NOTE_AGE = 2  # W rises from note to note
NOTE_CHANNEL = 3  # W
NOTE_KEY = 4  # W
NOTE_PLACE = 5  # W which string of the instrument it is
NOTE_STRING = 6  # W on which of a set it is played, from the highest, 0; -1: the key chooses
NOTE_HELD = 7  # W whether its key is down
NOTE_KEPT = 8  # W whether the pedal was down as it was released
NOTE_DAMPED = 9  # W
NOTE_HAS_PLACE = 10  # W whether it is the latest of its place
NOTE_RELEASED = 11  # W whether it fades out: it made room, or was stopped
NOTE_DRUM = 12  # W whether it is a drum's
NOTE_MODES = 13  # W
NOTE_GAIN = 14  # R
NOTE_BY_HAND = 15  # W whether its pluck came with its event
NOTE_POINTS = 16  # W of the points where it is heard, or goes to be heard
NOTE_POINT = 17  # R two
NOTE_SOLO = 19  # W
NOTE_VOICES = 20  # W four addresses; 0: none
NOTE_FRAME = 24  # W at which it was to begin; 0: at once
NOTE_PAIRS = 25  # W its first partials that have two modes
NOTE_HEARD = 26  # R two: what both polarisations are heard with
NOTE_DETUNING = 28  # R as in the table it was struck by
NOTE_CONDUCTANCE = 29  # R two
NOTE_TUNED = 31  # R semitones, beside what wheels bend it
NOTE_LOSSES = 32  # R three
NOTE_MUTE = 35  # R 0 … 1
NOTE_PLUCK = 36  # R three: position, amplitude in mm and width
NOTE_TOUCHED = 39  # W at 1 over how much of its length a finger touches it; 0: none does
NOTE_LIFTED = 40  # W frame of the mixer at which the finger leaves
NOTE_BEGAN = 41  # W frame of the mixer
NOTE_VELOCITY = 42  # R
NOTE_APERTURE_M = 43  # R as in the table it was struck by
NOTE_MEMBER = 44  # W which string of a course it is, from 0, whose reports are those of all
NOTE_APART = 45  # R semitones above that one
NOTE_OCTAVE = 46  # W whether it is an octave string
NOTE_VIBRATO = 47  # R semitones
NOTE_BRIDGE = 48  # R share of its losses at the bridge that others of its course have a part in
NOTE_SWING_M = 49  # R how far its string swings after a stroke of REFERENCE_VELOCITY
NOTE_OWN = 50  # R its string as its key had it when it was struck
NOTE_STRING_NOW = NOTE_OWN + STRING  # R with bends, slides, dampers and knobs
NOTE_SLOTS = NOTE_STRING_NOW + STRING
MOST_NOTES = 128

# Slots of a report
BEGAN, ENDED, REFUSED = 0, 1, 2
REPORT_KIND = 0  # W
REPORT_ID = 1  # W
REPORT_CHANNEL = 2  # W
REPORT_KEY = 3  # W
REPORT_FRAME = 4  # W of the mixer
REPORT_VELOCITY = 5  # R
REPORT_STRING = 6  # W
REPORT_TABLE = 7  # W serial of the table
REPORT_POSITION = 8  # R of the pluck
REPORT_AMPLITUDE_MM = 9  # R
REPORT_WIDTH = 10  # R
REPORT_GAIN = 11  # R
REPORT_MODES = 12  # W
REPORT_NOTE = 13  # W which of the notes it is
REPORT_OWN = 16  # R its string
REPORT_SLOTS = REPORT_OWN + STRING

# Slots of a player; its voices follow
EVENTS = 1024
QUEUED = 1024
REPORTS = 512
PLAYER_TABLE = 0  # W address; 0: nothing is played
PLAYER_SERIAL = 1  # W of that table: all before are free
PLAYER_MOST = 2  # W notes that ring at once; the oldest makes room
PLAYER_MODES = 3  # W a voice has at most, `MOST_PAIRS` above the partials
PLAYER_PUSHED = 4  # W events that were handed over
PLAYER_TAKEN = 5  # W and taken
PLAYER_QUEUED = 6  # W of them, whose frame is to come
PLAYER_REPORTED = 7  # W reports so far
PLAYER_WHEEL = 8  # W the modulation wheel, 0 … 127
PLAYER_WHEEL_BY = 9  # W the channel that moved it
PLAYER_AGE = 10  # W of the youngest note
PLAYER_CUT = 11  # W notes that were cut, for all places of notes were taken
PLAYER_RATE = 12  # R frames a second
PLAYER_HERE = 13  # W its own address
PLAYER_CHORD = 14  # W the latest chord that is strummed, from 1; 0: none was
PLAYER_CHORD_BEGAN = 15  # W frame of the mixer
PLAYER_SOURCE_GAINS = 16  # R four
PLAYER_CHORD_BEGUN = 20  # W notes of it that have begun
PLAYER_CHORD_UP = 21  # W whether it goes from the highest to the lowest
PLAYER_NEXT_UP = 22  # W whether the next does, where strokes alternate
PLAYER_SPARES = 23  # W whether notes begin without voices of sources that are not heard
PLAYER_VALUES = 24  # R
PLAYER_CHANNELS = PLAYER_VALUES + VALUES
PLAYER_EVENTS = PLAYER_CHANNELS + CHANNELS * CHANNEL_SLOTS
PLAYER_QUEUE = PLAYER_EVENTS + EVENTS * EVENT_SLOTS
PLAYER_REPORTS = PLAYER_QUEUE + QUEUED * EVENT_SLOTS
PLAYER_NOTES = PLAYER_REPORTS + REPORTS * REPORT_SLOTS
PLAYER_STRINGS = PLAYER_NOTES + MOST_NOTES * NOTE_SLOTS  # R four, for a moment
PLAYER_AMPLITUDES = PLAYER_STRINGS + 4 * STRING  # R of a pluck's modes, for a moment
PLAYER_PULLED = PLAYER_AMPLITUDES + at.MOST_MODES  # R of a pluck on its grid, for a moment
MOST_GRID = 1024
PLAYER_SYMPATHETIC = PLAYER_PULLED + MOST_GRID  # W partials of strings that ring with those that are played
PLAYER_TUNED = PLAYER_SYMPATHETIC + 1  # W instrument and kind for which they were tuned
PLAYER_TUNED_BY = PLAYER_SYMPATHETIC + 2  # W
PLAYER_SYMPATHY_RINGS = PLAYER_SYMPATHETIC + 3  # W whether any can be heard
PLAYER_SYMPATHY_STOPS = PLAYER_SYMPATHETIC + 4  # W quanta in which all of them are still touched
MOST_SYMPATHETIC = 512
SYMPATHY_OWNER, SYMPATHY_COSINE, SYMPATHY_SINE, SYMPATHY_GAIN, SYMPATHY_X, SYMPATHY_Y, SYMPATHY_PLAYED = range(7)
PLAYER_SYMPATHY = PLAYER_SYMPATHETIC + 5  # rows (MOST_SYMPATHETIC,), as above
MOST_NOISES = 24  # of contact, that sound at once
NOISE_LEFT = 0  # W frames to come; 0: it is over
NOISE_FRAME = 1  # W of the mixer at which it begins
NOISE_DONE = 2  # W frames so far
NOISE_SEED = 3  # W
NOISE_PULSE = 4  # R amplitude of its pulse
NOISE_PULSE_FRAMES = 5  # R
NOISE_BURST = 6  # R amplitude of its burst
NOISE_ATTACK_FRAMES = 7  # R
NOISE_SHRINKS = 8  # R what is left of the burst in a frame
NOISE_ENVELOPE = 9  # R
NOISE_B0, NOISE_A1, NOISE_A2 = range(10, 13)  # R band-pass of the burst
NOISE_PAST = 13  # R two inputs and two outputs of it
NOISE_STOPS = 17  # W quanta in which it fades out; 0: it does not
NOISE_RECORDED = 18  # W whether it is the recorded attack; NOISE_PULSE is its amplitude then
NOISE_SLOTS = 19
PLAYER_NOISE_GAIN = PLAYER_SYMPATHY + 7 * MOST_SYMPATHETIC  # R at the end of the quantum before
PLAYER_NOISES = PLAYER_NOISE_GAIN + 1
PLAYER_AGAIN = PLAYER_NOISES + MOST_NOISES * NOISE_SLOTS  # W the event of a tremolo's stroke, for a moment
PLAYER_LIMIT = PLAYER_AGAIN + EVENT_SLOTS  # R of all gains, for peaks; 0: not computed yet
PLAYER_GAINS = PLAYER_LIMIT + 1  # R (KEYS, GAINS) of keys; 0: not computed since a value changed
PLAYER_SWINGS_M = PLAYER_GAINS + KEYS * GAINS  # R (KEYS, GAINS) of their strings at REFERENCE_VELOCITY
PLAYER_REFERENCE = PLAYER_SWINGS_M + KEYS * GAINS  # R (MOST_MODES,) of the pluck that is as loud for all keys
PLAYER_SOUND = PLAYER_REFERENCE + MOST_MODES  # R of a key, for a moment
PLAYER_VOICES = PLAYER_SOUND + SOUND_ROWS * MOST_DRUM_MODES
BLOCKS = 4  # of modes that a voice is to have


def block_slots(modes: int) -> int:
    return at.B_HEADER + at.RESONATOR_ROWS * modes


def voice_slots(modes: int) -> int:
    """Of a voice with so many modes, and of the blocks of modes that it is to have."""
    return at.HEADER + 8 * modes + 4 + 8 * at.QUANTUM + at.TRUTH_ROWS * modes + BLOCKS * block_slots(modes)


def player_slots(modes: int) -> int:
    """Of a player whose voices have at most so many modes."""
    return PLAYER_VOICES + MOST_NOTES * MOST_SOURCES * voice_slots(modes)
