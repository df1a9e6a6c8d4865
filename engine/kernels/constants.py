"""Kinds, counts and limits of what is played, and the places of values in its arrays."""

from __future__ import annotations

from collections import namedtuple
from typing import Any

from engine.parameters import PLAYED

QUANTUM = 64  # frames that are rendered at a time, whatever the device asks for
AHEAD = 32  # frames that the limiter looks ahead, its delay; even, and a quantum at most

HIGHEST_HZ = 20_000.0  # of modes: those above are inaudible
MOST_MODES = 99  # partials of a key's string: the shipped model's grid holds no more
MOST_PAIRS = 24  # of them that have a second mode, of the other polarisation
MOST_SLACKENED = 5  # keys that a guitar's string may be tuned below the set's

AIR_VISCOSITY_PA_S, AIR_DENSITY_KG_M3 = 1.8e-5, 1.2  # at 20 °C
HIGHEST_SIGMA = 0.5  # of ω: the most damping that bridge and losses by mode give one

# A string: the fields of `StringParameters`, in their order
LENGTH, AREA, MOMENT, DENSITY, MODULUS, D1, D3, TENSION = range(8)
STRING = 8
# An instrument's values, which events and the modulation wheel may change: `VALUE.part_field` is the place of one
VALUE: Any = namedtuple("VALUE", (id.replace(".", "_") for id in PLAYED))(*range(len(PLAYED)))
VALUES = len(PLAYED)
_parts = [id.partition(".")[0] for id in PLAYED]
KNOBS = _parts.count("knobs")  # the multipliers of a string, which are the first
# Keys are made as loud again when a value before this one is turned, or one of body or pick-up
LOUD = KNOBS + _parts.count("pluck")
DOWN, UP, ALTERNATE = range(3)  # strokes
REFERENCE_VELOCITY = 100  # at which keys are equally loud, and levels of noise hold
# The level of such a note over its first part. Six of the classical guitar, strummed, peak at -9 dBFS
WANTED_DB, PART_S = -29.0, 0.4  # a loudness meter's block
HIGHEST_PEAK_DB = WANTED_DB + 15.0  # of such a note of any key
GAIN_RANGE_DB = (WANTED_DB - 6.0, WANTED_DB + 66.0)

# Kinds of events
NOTE_ON, NOTE_OFF, BEND, CONTROLLER, TUNE, PARAMETER, TABLE, CANCEL, STOP, CHOKE = range(10)
NOTHING = -1  # of an event that was forgotten
ANY = -1  # channel or key of the notes that are tuned or choked
MOST_SOURCES = 4  # of a note

# An instrument's table
POLY, GUITAR, MPE = range(3)
GAUSSIAN, TRIANGULAR, RAISED_COSINE, ROUNDED = range(4)  # as in `engine.pluck.SHAPES`
BRIDGE = -1.0  # a listening point that is none: the force on the end at 0
BY_TENSION, BY_LENGTH = 0, 1
KEYS = 128
GUITAR_STRINGS = 8  # at most, of a guitar that sends MIDI
GAINS = 1 + GUITAR_STRINGS  # of a key: on the string that it chooses, and on each of the first strings
NO_SYMPATHY, EVERY_KEY, OPEN_STRINGS = range(3)
STROKE, RELEASE = 0, 1
MOST_STRINGS = 128

MOST_DRUM_MODES = 1_600

# Slots of a body's curves; then three rows (BODY_POINTS,): of its gain at frequencies, 2^(1/BODY_STEPS) apart
BODY_CROSS = 0  # R what noise through it has in common with that noise
BODY_STEP = 1  # R the highest sample that a step of 1 becomes
BODY_HEADER = 2
BODY_REAL, BODY_IMAGINARY, BODY_POWER = range(3)  # the mean of the channels; of the squares
BODY_LOWEST_HZ, BODY_STEPS = 16.0, 96  # steps an octave: the third of a half-width of a resonance of Q 50
BODY_POINTS = 992
BODY_SLOTS = BODY_HEADER + 3 * BODY_POINTS
CURVES_HZ = 48_000  # rate of the response from which they are taken; keys are as loud at other rates

# Responses of bodies and rooms
LOUDNESS_LOW_HZ, LOUDNESS_HIGH_HZ = 80.0, 3_000.0  # of the noise that keeps its level: most of a plucked string
BODY_HIGHEST_HZ = 20_000.0  # of its modes
ROOM_HZ = 48_000.0  # at which a room is made, so that it is the same room at any rate

# Rows (modes,) of a sound, see `loudness`
SOUND_OMEGA, SOUND_SIGMA, SOUND_LEFT, SOUND_RIGHT, SOUND_X, SOUND_Y, SOUND_COSINE, SOUND_SINE = range(8)
SOUND_ROWS = 8

# What a recording adds to each partial of a string: fields of `RecordedString`
FADES_SEMITONES = 3.0  # a note's own corrections fall as a Gaussian of this width
CENTS, RATIO, SECOND_CENTS, SECOND_RATIO, SECOND_SHARE = range(5)

# Channels
CHANNELS = 17  # of MIDI, then the keys of the computer and the screen
FIRST, ON_SCREEN = 0, 16
TUNING_STEPS = 8192  # of fine tuning, of a semitone
USUAL_VOLUME = 100  # General MIDI's: at this volume an instrument is as loud as it is without one
PEDAL, LEGATO, SLIDES, HARMONICS, TREMOLO, STRUMS = range(6)  # the pedal that sustains, and footswitches
SWITCHES = 6

# Notes
FREE, RINGS = 0, 1
MOST_NOTES = 128

# Reports
BEGAN, ENDED, REFUSED = range(3)

# A player
EVENTS = 1024
QUEUED = 1024
REPORTS = 512
MOST_GRID = 1024
MOST_SYMPATHETIC = 512
MOST_NOISES = 24  # of contact, that sound at once
BLOCKS = 4  # of modes that a voice is to have
