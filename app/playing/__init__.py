"""Sound from events: keys, MIDI and plucks at places become notes that ring.

keyboard, midi, midi_port   what keys and controllers mean
midi_backend                the system's MIDI
notes, note                 events become notes of the instrument; which ring, and how they are heard
keys                        what the keys of a patch sound with, prepared in the background
sources                     presets in memory, and the programs of their voices
ahead, levels               models that are rendered before they are heard; the level match
recorder                    events as they are played, with their times
playback, due               a MIDI file, played in its time
pair                        two sounds side by side, for the listening test

Nothing is imported here: settings name a MIDI port before the engine is loaded.
"""
