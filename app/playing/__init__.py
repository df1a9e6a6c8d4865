"""Sound from events: keys, MIDI and plucks at places become notes that ring.

Nothing is imported here: settings name a MIDI port before the engine is loaded.
"""
