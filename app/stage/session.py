"""The session: the owner of the present stage, which reports changes, and undo.

A step of undo is one gesture: all that changes between `hold` and `release` (a drag). Changes of the same fields that
follow each other within half a second are one as well (keys, wheel notches, a controller). Undo restores the fields
that the step changed and no others. Notes that are played are no steps: their changes stay.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from psygnal import Signal

from app.session.choices import PLUCK, Choices
from app.shared.parameters import OF_CHOICES
from app.stage.stage import Chosen, Event, changed_names, first_stage, next_stage
from app.stage.step_words import step_words, turned_fields

# Fields that undo restores: not those of looking and listening alone (views, speed, volume, loop, model or truth).
RECORDED = frozenset({"instrument", "single", "seconds", "string_pickup", "right", "string", *PLUCK})
GATHER_S = 0.5  # changes of the same fields within it are one step
LARGEST_STEPS = 200


@dataclass(frozen=True)
class Step:
    """The changes of a gesture: names that `Choices.changed` takes, with their values before and after it."""

    before: Mapping[str, Any]
    after: Mapping[str, Any]

    def then(self, other: Step) -> Step:
        """Join with a change that came later."""
        return Step({**other.before, **self.before}, {**self.after, **other.after})


class Session:
    """The owner of the stage, in the window's thread; any thread may read it.

    `changed` carries the names of what has another value, of `stage.NAMES`.

    Args:
        now_s: a clock, replaced in tests.
        held: whether a gesture that has begun may still be under way. Its `release` may never come, as where a dialog
            or another window takes the mouse.
        brought: returns the further fields that change when the preset of a name is chosen, with their values.
    """

    changed = Signal(frozenset)

    def __init__(
        self,
        choices: Choices | None = None,
        now_s: Callable[[], float] = time.monotonic,
        held: Callable[[], bool] = lambda: True,
        brought: Callable[[Choices, str], Mapping[str, Any]] = lambda choices, preset: {},
    ) -> None:
        self.stage = first_stage(choices or Choices())
        self._now_s, self._still_held, self._brought = now_s, held, brought
        self._undo: deque[Step] = deque(maxlen=LARGEST_STEPS)  # the latest last
        self._redo: deque[Step] = deque()  # undone steps, reversed, the latest undone last
        self._held = False  # between `hold` and `release`
        self._turned: frozenset[str] | None = None  # fields of the step that still grows; None: the next is a new one
        self._turned_s = 0.0  # when it last grew, by `now_s`

    @property
    def choices(self) -> Choices:
        return self.stage.choices

    def send(self, event: Event) -> None:
        """Take the next stage.

        Raises:
            ValueError: as `next_stage`; nothing has changed then.
        """
        before, self.stage = self.stage, next_stage(self.stage, event)
        if names := changed_names(before, self.stage):
            if isinstance(event, Chosen) and event.by_user:
                self._record(before.choices, names & RECORDED)
            self.changed.emit(names)

    def update(self, **values: Any) -> None:
        """Take new values of `Choices`, as `Chosen`, and what a preset brings. Raise ValueError as `send`."""
        if "preset" in values:
            values = {**self._brought(self.choices, values["preset"]), **values}
        self.send(Chosen(values))

    def play(self, **values: Any) -> None:
        """Take the values that a note brings: as `update`, but no step of undo."""
        self.send(Chosen(values, by_user=False))

    def play_instrument(self) -> None:
        """Play the instrument that is there: keys are pitches."""
        if self.choices.instrument is not None:
            self.update(single=None)

    def play_string(self) -> None:
        """Play the string that is shown by itself: keys are places along it."""
        self.update(single=self.choices.preset, string=self.choices.string)

    def move_pluck(self, position: float, amplitude_mm: float) -> None:
        """Take the nearest allowed pluck: for gestures, which may go past the limits. `position` as in `Choices`."""
        self.update(
            position=OF_CHOICES["position"].clamped(position),
            amplitude_mm=OF_CHOICES["amplitude_mm"].clamped(amplitude_mm),
        )

    def move_listening_point(self, listen: float) -> None:
        self.update(listen=OF_CHOICES["listen"].clamped(listen))

    def switch_source(self) -> None:
        """Switch the sound from slot A to slot B, or back."""
        self.update(heard="b" if self.choices.heard == "a" else "a")

    # The way back

    @property
    def undo_words(self) -> str:
        """The step that `undo` would take back, in words; "" where there is nothing."""
        step = self._next(self._undo)
        return "" if step is None else step_words(step.before, step.after)

    @property
    def redo_words(self) -> str:
        """The step that `redo` would do again, in words; "" where there is nothing."""
        step = self._next(self._redo)
        return "" if step is None else step_words(step.after, step.before)

    def hold(self) -> None:
        """Begin a gesture: all changes until `release` are one step."""
        self._held, self._turned = True, None

    def release(self) -> None:
        """The gesture has ended: the next change begins a step of its own."""
        self._held, self._turned = False, None

    def undo(self) -> None:
        """Take the last step back; do nothing where there is none."""
        self._restore(self._undo, self._redo)

    def redo(self) -> None:
        """Do the step that was last undone again; do nothing where there is none."""
        self._restore(self._redo, self._undo)

    def _next(self, steps: deque[Step]) -> Step | None:
        """The last step that would change something: a drag that came back to its start does not."""
        present = self.choices
        return next((step for step in reversed(steps) if _values(present, step.before) != step.before), None)

    def _restore(self, source: deque[Step], target: deque[Step]) -> None:
        """Take back the last step of `source` that changes something, and put its reverse on `target`."""
        self.release()
        step = self._next(source)
        while source and source.pop() is not step:
            pass
        if step is not None:
            self.send(Chosen(step.before, by_user=False))
            target.append(Step(step.after, step.before))

    def _record(self, before: Choices, fields: frozenset[str]) -> None:
        """Record a step of undo: fields that the user has changed, which join the last step where that still grows.

        Args:
            before: the choices before the change.
        """
        if not fields:
            return
        if self._held and not self._still_held():
            self.release()
        fields |= {"instrument"} if "single" in fields else set()  # for the step's words
        step = Step(_values(before, fields), _values(self.choices, fields))
        now_s, turned = self._now_s(), turned_fields(step.before, step.after)
        soon = turned == self._turned and now_s - self._turned_s <= GATHER_S
        if self._turned is not None and (self._held or soon):
            step = self._undo.pop().then(step)
        self._undo.append(step)
        self._redo.clear()
        self._turned, self._turned_s = turned, now_s


def _values(choices: Choices, fields: Iterable[str]) -> Mapping[str, Any]:
    return {name: choices.value(name) for name in fields}
