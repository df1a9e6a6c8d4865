"""The records of playing: events, an instrument's table, a player with its notes, and its reports.

Each is a NumPy record of eight-byte fields, real (R) or whole (W), which the kernels read by the same names. A player
and a table hold no reference to Python: a table is written by the thread that prepares it, then handed over by its
address, and only read from then on. `kernels.memory` gives the record at an address.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

from engine.kernels import constants as of
from engine.kernels.fields import R, W, slots
from engine.kernels.mixer_records import MOST_LATENTS
from engine.kernels.voice_records import voice_bytes

# Records, as annotations of kernels
Event: TypeAlias = Any
Channel: TypeAlias = Any
Note: TypeAlias = Any
Report: TypeAlias = Any
Noise: TypeAlias = Any
Sympathy: TypeAlias = Any
Player: TypeAlias = Any
Table: TypeAlias = Any
Drum: TypeAlias = Any
Recorded: TypeAlias = Any
Attack: TypeAlias = Any
Body: TypeAlias = Any
Responses: TypeAlias = Any
Needs: TypeAlias = Any

EVENT = np.dtype(
    [
        ("frame", W),  # of the mixer, at which it counts; 0: at once
        ("kind", W),  # NOTE_ON … CHOKE, or NOTHING
        ("channel", W),  # 0 … 16
        ("key", W),  # of a note; the number of a controller, or of one of the values
        ("value", R),  # velocity, bend in -1 … 1, value of a controller or a parameter, semitones, seconds of a fade
        ("id", W),  # which reports of a note carry; of the notes that are tuned, choked or cancelled; 0: any
        ("position", R),  # of a pluck by hand, as amplitude, width and shape; 0: of one by instrument and velocity
        ("amplitude_mm", R),
        ("table", W),  # address
        ("struck_s", R),  # the device clock's time of the gesture
        ("width", R),
        ("struck", W),  # address of the speeds (modes,) that 1 N s gives a drum at another place; 0: its own place
        ("struck_modes", W),  # how many they are
        ("chord", W),  # the chord in which a note waits for its turn; 0: none
        ("came", W),  # the frame at which it would have begun alone
        ("string", W),  # of a note: string n of a set from the highest, as n + 1; 0: the channel or the key chooses
        ("shape", W),
    ]
)

CONTACT = np.dtype(  # the fields of `engine.contact.Contact`
    [
        ("pulse_s", R),
        ("pulse_share", R),
        ("burst_hz", R),
        ("burst_q", R),
        ("attack_s", R),
        ("fall_s", R),
        ("follows", R),
        ("spare", R),
    ]
)

OPEN = np.dtype(  # a string of a set
    [
        ("note", R),  # key of the whole string
        ("pitch_hz", R),
        ("string", R, of.STRING),
    ]
)

TABLE = np.dtype(
    [
        ("serial", W),  # rises from table to table
        ("instrument", W),  # the same where only knobs were turned
        ("mode", W),  # POLY, GUITAR or MPE
        ("low", W),  # lowest key
        ("high", W),
        ("strings", W),  # of a set; 0: one string is fretted for all keys
        ("shape", W),  # of plucks
        ("stops", W),  # whether a pluck stops its string, or is added to its motion
        ("let_ring", W),  # whether strings ring on when their keys are released
        ("bend_by", W),  # BY_TENSION or BY_LENGTH
        ("points", W),  # listening points, 1 or 2
        ("level", R),  # of the whole instrument, a factor
        ("body", W),  # slot of the body's curves; 0: it has none
        ("velocity", W),  # whether the pick-up senses velocity
        ("solo", W),  # the mode that alone is heard; 0: all are
        ("wheel", W),  # which of the values the modulation wheel turns; -1: none
        ("wheel_goal", R),  # where it leads
        ("grid", W),  # points of the grid on which plucks have their shape
        ("sines", W),  # slot of sin(π k / (grid - 1)), k below 2 (grid - 1)
        ("sources", W),  # of sound, a model or a solver each: a note has one voice of each
        ("kinds", W, of.MOST_SOURCES),  # of their voices: BANK, TRUTH, RENDERED or TENSION
        ("programs", W, of.MOST_SOURCES),  # addresses of what the voices of each share
        ("pairs", W),  # partials with a second mode, of the other polarisation; 0: there is one direction
        ("pulled", R, 2),  # parts of a pluck in both directions
        ("heard", R, 2),  # factors with which both directions are heard
        ("detuning", R),  # ω² of the second over that of the first
        ("conductance", R, 2),  # of the bridge, in s/kg
        ("variation", R),  # of plucks from stroke to stroke, 0 … 1
        ("sympathy", W),  # which strings ring with those that are played
        ("sympathy_s_kg", R),  # conductance of the bridge that drives them
        ("losses", R, 3),  # to the air, by friction, by bending
        ("drums", W),  # slot of the slots of drums of all keys (KEYS,), 0 where a key has none; 0: strings are played
        ("recorded", W),  # slot of what a recording adds to the law of strings; 0: nothing
        ("noise_level", R),  # energy of a noise of 0 dB, in s of full scale squared
        ("attack", W),  # slot of a recorded attack, the noise of strokes; 0: they have that of a contact
        ("strikes", W),  # whether a key strikes its string, which sets out with speeds, or plucks it
        ("aperture_m", R),  # length of string over which a pick-up averages
        ("nearness", R),  # full scale over the length in which the flux grows e-fold; 0: it grows evenly
        ("course", W),  # strings of a key that sound together
        ("octaves", W),  # of a set, the lowest strings, whose courses have an octave string
        ("apart_cents", R),  # between strings of a course
        ("apart_s", R),  # from the stroke of one to that of the next
        ("bridge", R),  # share of the bridge's losses that strings of a course have in common, 0 … 1
        ("javari", R, 3),  # from the end to the edge of its bridge in m, 0 for none; its stiffness and loss
        ("contacts", CONTACT, 2),  # noise of the stroke and of the release
        ("values", R, of.VALUES),
        ("pitches_hz", R, of.KEYS),  # of keys; 0: silent
        ("open", OPEN, of.MOST_STRINGS),  # the highest string first
    ]
)
"""Slots count from its beginning; what they point to follows the record."""

DRUM = np.dtype(  # of a key
    [
        ("modes", W),
        ("mallet_kg", R),
        ("contact_s", R),  # at 1 m/s
        ("softest_m_s", R),  # speed of the softest blow
        ("hardest_m_s", R),
        ("mass_kg", R),  # of each mode
        ("spare", R, 2),
    ]
)
DRUM_ROWS = 7  # (modes,), which follow: ω², σ, k, η², the speed that 1 N s gives, two points' weights

RECORDED = np.dtype(  # what a recording adds to strings
    [
        ("pitch_hz", R),  # of the recorded note
        ("smooth", W),  # points of the decay over that of the law
        ("partials", W),  # of the note
        ("modes", W),  # at most
        ("rest", R, 5),  # what each fades to with the distance in pitch
    ]
)
"""Then log of frequencies and of ratios (points,), then five rows (partials,), in the order of `RecordedString`."""

ATTACK = np.dtype(
    [
        ("rate_hz", R),  # of its samples
        ("frames", W),
    ]
)
"""Then samples (frames,) of an energy of 1 s of full scale squared."""

CHANNEL = np.dtype(
    [
        ("bend", R),  # of the pitch wheel, -1 … 1
        ("slide", W),  # 0 … 127; -1: never moved
        ("range_semitones", R),  # below 0: the instrument's
        ("plays", W),  # whether a note has come
        ("coarse", W),  # number of the registered parameter that is chosen, upper part
        ("fine", W),  # and lower part
        ("mute", R),  # 0 … 1
        ("slide_time", W),  # 0 … 127
        ("held", W, of.KEYS),  # whether each key is down
        ("switches", W, of.SWITCHES),  # whether the pedal and each footswitch are down
        ("volume", W),  # 0 … 127
        ("expression", W),  # 0 … 127
        ("coarse_tuning", W),  # semitones
        ("fine_tuning", W),  # steps of a semitone over TUNING_STEPS
        ("strokes", W, of.KEYS),  # of each key whose release is to come, of those that give no string
    ]
)

NOTE = np.dtype(
    [
        ("number", W),  # its own, of the player's notes
        ("state", W),  # FREE or RINGS
        ("id", W),  # of its event
        ("age", W),  # rises from note to note
        ("channel", W),
        ("key", W),
        ("place", W),  # which string of the instrument it is: a number of `playing.channels.place_of`
        ("string", W),  # on which of a set it is played, from the highest, 0; -1: the key chooses
        ("held", W),  # whether its key is down
        ("kept", W),  # whether the pedal was down as it was released
        ("damped", W),  # whether the damper lies on it
        ("has_place", W),  # whether it is the latest of its place
        ("released", W),  # whether it fades out: it made room, or was stopped
        ("drum", W),  # whether it is a drum's
        ("modes", W),
        ("gain", R),  # the factor that makes its key as loud as others
        ("by_hand", W),  # whether its pluck came with its event
        ("points", W),  # of the points where it is heard, or goes to be heard
        ("point", R, 2),
        ("solo", W),
        ("voices", W, of.MOST_SOURCES),  # addresses; 0: none
        ("frame", W),  # at which it was to begin; 0: at once
        ("pairs", W),  # its first partials that have two modes
        ("heard", R, 2),  # what both polarisations are heard with
        ("detuning", R),  # as in the table it was struck by
        ("conductance", R, 2),
        ("tuned", R),  # semitones, beside what wheels bend it
        ("losses", R, 3),
        ("mute", R),  # 0 … 1
        ("position", R),  # of its pluck
        ("amplitude_mm", R),
        ("width", R),
        ("touched", W),  # at 1 over how much of its length a finger touches it; 0: none does
        ("lifted", W),  # frame of the mixer at which the finger leaves
        ("began", W),  # frame of the mixer
        ("velocity", R),
        ("aperture_m", R),  # as in the table it was struck by
        ("member", W),  # which string of a course it is, from 0, whose reports are those of all
        ("apart", R),  # semitones above that one
        ("octave", W),  # whether it is an octave string
        ("vibrato", R),  # semitones
        ("bridge", R),  # share of its losses at the bridge that others of its course have a part in
        ("shortened", R),  # share of the whole string
        ("highest_m", R),  # point of its pluck
        ("stroke", W),  # with the key, it chooses the noise
        ("strength", R),  # amplitude of the stroke over that at REFERENCE_VELOCITY
        ("hardness", R),  # of what touches
        ("swing_m", R),  # how far its string swings after a stroke of REFERENCE_VELOCITY
        ("own", R, of.STRING),  # its string as its key had it when it was struck
        ("string_now", R, of.STRING),  # with bends, slides, dampers and knobs
    ]
)

REPORT = np.dtype(
    [
        ("kind", W),  # BEGAN, ENDED or REFUSED
        ("id", W),  # of the note
        ("channel", W),
        ("key", W),
        ("frame", W),  # of the mixer
        ("velocity", R),
        ("string", W),
        ("table", W),  # serial of the table
        ("position", R),  # of the pluck
        ("amplitude_mm", R),
        ("width", R),
        ("gain", R),
        ("modes", W),
        ("note", W),  # which of the notes it is
        ("own", R, of.STRING),  # its string
    ]
)

NOISE = np.dtype(
    [
        ("left", W),  # frames to come; 0: it is over
        ("frame", W),  # of the mixer at which it begins
        ("done", W),  # frames so far
        ("seed", W),
        ("pulse", R),  # amplitude of its pulse, or of the recorded attack
        ("pulse_frames", R),
        ("burst", R),  # amplitude of its burst
        ("attack_frames", R),
        ("shrinks", R),  # what is left of the burst in a frame
        ("envelope", R),
        ("b0", R),  # band-pass of the burst …
        ("a1", R),
        ("a2", R),
        ("past", R, 4),  # … its last two inputs and outputs
        ("stops", W),  # quanta in which it fades out; 0: it does not
        ("recorded", W),  # whether it is the recorded attack
    ]
)

SYMPATHY = np.dtype(
    [
        ("owner", W, of.MOST_SYMPATHETIC),  # key or string of each partial
        ("cosine", R, of.MOST_SYMPATHETIC),  # of its turn in a frame, times what decay leaves of it
        ("sine", R, of.MOST_SYMPATHETIC),
        ("gain", R, of.MOST_SYMPATHETIC),  # from x to its force on the bridge
        ("x", R, of.MOST_SYMPATHETIC),  # its motion, x + iy
        ("y", R, of.MOST_SYMPATHETIC),
        ("played", R, of.MOST_SYMPATHETIC),  # 1 for partials of strings that are played, which are stopped, else 0
        ("partials", W),  # of strings that ring with those that are played
        ("instrument", W),  # for which they were tuned, …
        ("kind", W),  # … and its kind
        ("rings", W),  # whether any can be heard
        ("stops", W),  # quanta in which all of them are still touched
    ]
)

PLAYER = np.dtype(
    [
        ("table", W),  # address; 0: nothing is played
        ("serial", W),  # of that table: all before are free
        ("most", W),  # notes that ring at once; the oldest makes room
        ("modes", W),  # a voice has at most, `MOST_PAIRS` above the partials
        ("pushed", W),  # events that were handed over
        ("taken", W),  # and taken
        ("queued", W),  # of them, whose frame is to come
        ("reported", W),  # reports so far
        ("wheel", W),  # the modulation wheel, 0 … 127
        ("wheel_by", W),  # the channel that moved it
        ("age", W),  # of the youngest note
        ("cut", W),  # notes that were cut, for all places of notes were taken
        ("rate_hz", R),
        ("here", W),  # its own address
        ("chord", W),  # the latest chord that is strummed, from 1; 0: none was
        ("chord_began", W),  # frame of the mixer
        ("source_gains", R, of.MOST_SOURCES),  # factors of the table's sources; 0: not heard
        ("chord_begun", W),  # notes of it that have begun
        ("chord_up", W),  # whether it goes from the highest to the lowest
        ("next_up", W),  # whether the next does, where strokes alternate
        ("spares", W),  # whether notes begin without voices of sources that are not heard
        ("values", R, of.VALUES),
        ("channels", CHANNEL, of.CHANNELS),
        ("events", EVENT, of.EVENTS),
        ("queue", EVENT, of.QUEUED),
        ("reports", REPORT, of.REPORTS),
        ("notes", NOTE, of.MOST_NOTES),
        ("sympathy", SYMPATHY),
        ("noise_gain", R),  # at the end of the quantum before
        ("noises", NOISE, of.MOST_NOISES),
        ("limit", R),  # of all gains, for peaks; 0: not computed yet
        ("gains", R, (of.KEYS, of.GAINS)),  # of keys; 0: not computed since a value changed
        ("swings_m", R, (of.KEYS, of.GAINS)),  # of their strings at REFERENCE_VELOCITY
        ("reference", R, of.MOST_MODES),  # amplitudes of the pluck that is as loud for all keys
        # Rooms for a moment: strings, …
        ("whole", R, of.STRING),
        ("knobs", R, of.KNOBS),
        ("bent", R, of.STRING),
        ("own", R, of.STRING),
        ("draft", NOTE),  # … a note that begins, …
        ("again", EVENT),  # … a tremolo's stroke, …
        ("kept_event", EVENT),  # … an event while two are exchanged, …
        ("amplitudes", R, MOST_LATENTS),  # … a pluck's modes, …
        ("pulled", R, of.MOST_GRID),  # … its shape on its grid, …
        ("sound", R, of.SOUND_ROWS * of.MOST_DRUM_MODES),  # … and the modes of a key
    ]
)
"""Its voices follow."""

BODY = np.dtype(
    [
        ("modes", W),  # which follow, (4, modes): Hz, 1/s, amplitudes left and right; 0: it has none
        ("seconds", R),  # for which they ring
        ("subsonic_hz", R),  # below it the body radiates next to nothing
        ("frames", W),  # of a body that is a response, whose samples follow, (frames, channels) of 32 bits
        ("channels", W),  # 1 or 2
        ("hz", R),  # their rate
        ("unit", R),  # of the samples
        ("longest_s", R),  # of a response that is stretched
    ]
)
"""A body of a plug-in, at a size of 1; without modes and frames there is none."""

RESPONSES = np.dtype(
    [
        ("part", W),  # slots of each response that follows, as the convolver reads them: body, room, both
        ("powers", R, (4, 4, 4)),  # see `responses.all_powers`
        ("curves", R, of.BODY_SLOTS),  # of the body, for the loudness of keys
    ]
)

NEEDS = np.dtype(
    [
        ("frames", W),  # of the longest response
        ("part", W),  # slots of one as the convolver reads it
        ("found", W),  # slots of RESPONSES, with what follows
        ("memory", W),  # slots in which they are computed
        ("convolver", W),  # slots of the convolver
    ]
)


def player_slots(modes: int) -> int:
    """The memory of a player whose voices have at most so many modes."""
    return slots(PLAYER) + of.MOST_NOTES * of.MOST_SOURCES * voice_bytes(modes) // 8
