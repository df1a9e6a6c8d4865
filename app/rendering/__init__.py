"""From a pluck to what is seen and drawn of it: the take, and the worker thread that renders it."""

from app.rendering.request import RenderListener, RenderRequest
from app.rendering.take import SOURCES, Take
from app.rendering.worker import RenderWorker

__all__ = ["SOURCES", "RenderListener", "RenderRequest", "RenderWorker", "Take"]
