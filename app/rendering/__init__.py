"""From a pluck to its motion, for pictures: the take, and the worker thread that renders it. Sound has no part in it."""

from app.rendering.request import RenderListener, RenderRequest
from app.rendering.take import SOURCES, Take
from app.rendering.worker import RenderWorker

__all__ = ["SOURCES", "RenderListener", "RenderRequest", "RenderWorker", "Take"]
