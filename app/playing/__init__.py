"""Plucks as they are played: notes, each a group of voices of one pluck, one voice a source.

sources   presets in memory, and the programs of their voices
stroke    what is plucked and how it is mixed: values
ahead     models that are rendered before they are heard
notes     who rings: strikes, switches, moves, ends
"""

from app.playing.notes import Note, Notes
from app.playing.sources import Sources
from app.playing.stroke import Mix, Stroke

__all__ = ["Mix", "Note", "Notes", "Sources", "Stroke"]
