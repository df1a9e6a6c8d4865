"""What the window shows of the latest note."""

from __future__ import annotations

from app.playing.key_note import KeyNote
from app.rendering.subject import string_of
from app.window.controller import Controller


def key_is_shown(controller: Controller) -> bool:
    """Whether the string of the key that was struck last is shown."""
    note, string = controller.instruments.latest, controller.session.choices.string
    if not isinstance(note, KeyNote) or note.request is None or string is None:
        return False
    return string_of(note.request.preset) == string
