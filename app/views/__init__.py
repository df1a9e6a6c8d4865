"""Widgets: gestures become calls of the session, changes of the session become pixels."""
