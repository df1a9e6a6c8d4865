"""From a pluck to motion and sound: the take, and the worker thread that renders it."""

from app.rendering.take import SOURCES, Take
from app.rendering.worker import RenderRequest, RenderWorker

__all__ = ["SOURCES", "RenderRequest", "RenderWorker", "Take"]
