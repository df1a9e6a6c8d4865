"""From gestures to sound: keys and MIDI, what is plucked, and the notes that ring.

keyboard, midi, midi_port   gestures of instruments, as plucks or choices
midi_backend                the system's MIDI
chosen                      from what is chosen to what is plucked, heard and drawn
stroke                      what is plucked and how it is mixed: values
sources                     presets in memory, and the programs of their voices
notes, ahead                the notes that ring; models that are rendered before they are heard
live                        a patch that is played: events of keys and MIDI become notes
playback, due               a MIDI file, played in its time
pair                        two sounds side by side, for the listening test

Nothing is imported here: settings name a MIDI port before the engine is loaded.
"""
