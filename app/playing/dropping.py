"""A note whose handling failed: it is dropped and reported, and all others play on."""

from __future__ import annotations

import contextlib
from collections.abc import Callable

from app.playing.key_note import KeyNote
from app.playing.note import PluckVoices
from app.shared.log import log_fault

DROPPED = "A note was dropped because of an internal error. All others play on; please report the details."
DROPPED_S = 0.03  # of its fade


def drop(note: PluckVoices | KeyNote | None, error: Exception, report: Callable[[str, str], None]) -> None:
    """End a note, as far as it was made; the report has always the same message, which is shown once."""
    report(DROPPED, log_fault(error, "while a note was played"))
    if note is not None:
        note.cut = True
        with contextlib.suppress(Exception):  # what has failed may be this
            note.release(DROPPED_S)
