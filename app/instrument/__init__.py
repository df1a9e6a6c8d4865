"""A patch that is played: events come in, voices go out.

events     what a player does: keys, bends, pedals, plucks at a place; with their time, where they come from a file
strings    which string a key is: its length for the pitch, and how a bend, a slide or a damper changes it
glide      by how many cents a key starts above its resting pitch
loudness   the gain that makes all keys of a patch equally loud
player     events to voices: which strings ring, are held, are plucked again
bodies     which bodies there are: the engine's, and impulse responses of the user's own
effects    body and room of a patch, as the mixer takes them
offline    events to samples, without a device
midi_file  a MIDI file as events
"""
