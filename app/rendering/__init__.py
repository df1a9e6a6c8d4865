"""From a pluck to motion and sound: the take, and the worker thread that renders it."""

from app.rendering.listening import Listening
from app.rendering.request import OTHER, RenderListener, RenderRequest
from app.rendering.sound import DIFFERENCE
from app.rendering.take import SOURCES, Take
from app.rendering.worker import RenderWorker

__all__ = [
    "DIFFERENCE",
    "OTHER",
    "SOURCES",
    "Listening",
    "RenderListener",
    "RenderRequest",
    "RenderWorker",
    "Take",
]
