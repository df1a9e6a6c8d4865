"""The rendering of plucks and blows to pictures and signals: the take, and the worker thread that renders it."""

from app.rendering.blow import BlowTake
from app.rendering.note_sound import NoteSound
from app.rendering.take import SOURCES, Sounding, Take
from app.rendering.worker import RenderWorker

__all__ = [
    "SOURCES",
    "BlowTake",
    "NoteSound",
    "RenderWorker",
    "Sounding",
    "Take",
]
