"""Undo and redo of the choices that shape the sound.

A step is one gesture: all that changes between `hold` and `release` (a drag). Changes of the same fields that follow
each other within half a second are one as well (keys, wheel notches, a controller). Undo restores the fields that
the step changed and no others. Notes that are played (`Session.play`) are no steps: their changes stay.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

from app.session.choices import Choices, Session, ShownString
from app.session.listener import Listener
from app.session.step_words import step_words, turned_fields

# Not what belongs to looking and listening alone: views, speed, volume, loop, model or truth.
RECORDED = frozenset({"patch", "single", "seconds", *ShownString.model_fields, *Listener.model_fields} - {"solo"})
GATHER_S = 0.5
LARGEST_STEPS = 200

Values = dict[str, Any]  # of recorded fields


class History:
    """The record of a session's changes from now on.

    Args:
        now_s: a clock, replaced in tests.
        held: whether a gesture that has begun may still be under way. Its `release` may never come, as where a dialog
            or another window takes the mouse.
    """

    def __init__(
        self,
        session: Session,
        now_s: Callable[[], float] = time.monotonic,
        held: Callable[[], bool] = lambda: True,
    ) -> None:
        self._session = session
        self._still_held = held
        self._now_s = now_s
        self._undo: deque[Values] = deque(maxlen=LARGEST_STEPS)
        self._redo: list[Values] = []
        self._present = _recorded(session.choices)  # all of them
        self._held = self._restoring = False
        self._open_fields: frozenset[str] | None = None  # of the step that still gathers; None: the next is a new one
        self._changed_s = 0.0
        session.played.connect(self._take_played)
        session.changed.connect(self._choices_changed)

    @property
    def undo_words(self) -> str:
        """The step that `undo` would take back, in words; "" where there is nothing."""
        step = self._next(self._undo) or {}
        return step_words(step, {name: self._present[name] for name in step})

    @property
    def redo_words(self) -> str:
        """The step that `redo` would do again, in words; "" where there is nothing."""
        step = self._next(self._redo) or {}
        return step_words({name: self._present[name] for name in step}, step)

    def _next(self, steps: Sequence[Values]) -> Values | None:
        """The last step that would change something: a drag that came back to its start does not."""
        present = self._present
        return next((step for step in reversed(steps) if any(present[name] != step[name] for name in step)), None)

    def hold(self) -> None:
        """Begin a gesture: all changes until `release` are one step."""
        self._held = True
        self._open_fields = None

    def release(self) -> None:
        """The gesture has ended: the next change begins a step of its own."""
        self._held = False
        self._open_fields = None

    def undo(self) -> None:
        """Take the last step back; do nothing where there is none."""
        self._restore(self._undo, self._redo)

    def redo(self) -> None:
        """Do the step that was last undone again; do nothing where there is none."""
        self._restore(self._redo, self._undo)

    def _restore(self, source: deque[Values] | list[Values], target: deque[Values] | list[Values]) -> None:
        self.release()
        step = self._next(source)
        while source and source.pop() is not step:
            pass
        if step is not None:
            before, self._restoring = self._present, True
            try:
                self._session.update(**step)
            finally:
                self._restoring = False
                self._present = _recorded(self._session.choices)
            followed = {name for name, value in self._present.items() if value != before[name]}
            target.append({name: before[name] for name in {*step, *followed}})

    def _take_played(self, _: frozenset[str]) -> None:
        self._present = _recorded(self._session.choices)

    def _choices_changed(self, names: frozenset[str]) -> None:
        values = _recorded(self._session.choices)
        fields = names & RECORDED
        if self._restoring or not fields or values == self._present:  # the latter where a note was played
            return
        if self._held and not self._still_held():
            self.release()
        now_s, changed_fields = self._now_s(), turned_fields(fields, self._present, values)
        soon = changed_fields == self._open_fields and now_s - self._changed_s <= GATHER_S
        if self._open_fields is None or not (self._held or soon):
            self._undo.append({})
        step = self._undo[-1]
        fields |= {"patch"} if "single" in fields else set()  # for the step's words
        for name in fields - step.keys():
            step[name] = self._present[name]
        self._redo.clear()
        self._open_fields = changed_fields
        self._changed_s = now_s
        self._present = values


def _recorded(choices: Choices) -> Values:
    return {name: getattr(choices, name) for name in RECORDED}
