"""From a pluck to motion and sound: the take, and the worker thread that renders it."""

from app.rendering.listening import FULL_SCALE_M_S, PICKUPS, Listening, Pickup
from app.rendering.request import OTHER, RenderListener, RenderRequest
from app.rendering.sound import DIFFERENCE
from app.rendering.take import SOURCES, Take
from app.rendering.worker import RenderWorker

__all__ = [
    "DIFFERENCE",
    "FULL_SCALE_M_S",
    "OTHER",
    "PICKUPS",
    "SOURCES",
    "Listening",
    "Pickup",
    "RenderListener",
    "RenderRequest",
    "RenderWorker",
    "Take",
]
