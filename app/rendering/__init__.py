"""From a pluck to the pictures and signals that the window shows: the take, and the worker thread that renders it."""

from app.rendering.request import RenderListener, RenderRequest
from app.rendering.take import SOURCES, Take
from app.rendering.worker import RenderWorker

__all__ = ["SOURCES", "RenderListener", "RenderRequest", "RenderWorker", "Take"]
