"""A patch that is played: what comes in are events, what goes out are voices.

events     what a player does: keys, bends, pedals; with their time, where they come from a file
strings    which string a key is: its length for the pitch, and how a bend, a slide or a damper changes it
loudness   the gain that makes all keys of a patch equally loud
player     events to voices: who rings, what is held, what is plucked again
bodies     which bodies there are: the engine's, and impulse responses of the user's own
effects    body and room of a patch, as the mixer takes them
offline    events to samples, as fast as they can be had
midi_file  a MIDI file as events
"""
