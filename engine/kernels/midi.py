"""The numbers of MIDI controllers, for the compiled player and for Python, which has no other list of them."""

from __future__ import annotations

MOD_WHEEL = 1
SLIDE_TIME = 5
VOLUME = 7
EXPRESSION = 11
SUSTAIN = 64
PORTAMENTO = 65
SOFT = 67
LEGATO = 68
SLIDE = 74
HARMONICS = 80  # this and the next two: MIDI's general-purpose buttons
TREMOLO = 81
STRUM = 82
SOUND_OFF = 120
RESET = 121
NOTES_OFF = 123
LAST_MODE = 127  # messages from NOTES_OFF on choose a mode, and release all keys as well
PEDAL_DOWN = 64  # from this value on
# Controllers that choose a parameter, a registered one (RPN) or another, and set it
FINE_OTHER = 98
OTHER = 99
FINE_REGISTERED = 100
REGISTERED = 101
VALUE = 6
FINE_VALUE = 38
INCREMENT = 96
DECREMENT = 97
# Registered parameters
BEND_RANGE = 0
FINE_TUNING = 1
COARSE_TUNING = 2
NO_PARAMETER = 127
