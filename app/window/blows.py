"""The blow that is shown: of a drum's latest note, rendered by the worker, at the note's own time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from app.instrument.drum_keys import DrumKeys
from app.playing.key_note import KeyNote
from app.presets.library import Library
from app.rendering import BlowRequest, BlowTake
from app.session.choices import Session
from app.window.playhead import Playhead
from engine.strike import Strike


class Blows:
    """The blows on a drum, in the window's thread. Times are in s from the blow.

    Args:
        submit: hands a request to the render worker.

    Attributes:
        shown: the motion that is shown.
    """

    def __init__(self, session: Session, library: Library, submit: Callable[[BlowRequest], None]) -> None:
        self._session = session
        self._library = library
        self._submit = submit
        self._asked: tuple[BlowRequest, KeyNote] | None = None  # the latest blow, rendered or not
        self.shown: Playhead[BlowTake] = Playhead()

    @property
    def settled(self) -> bool:
        """Return True if motion and signals are complete, so that views need not look for more."""
        latest, take = self._asked, self.shown.take
        return latest is None or (
            take is not None and take.complete and take.request.same_motion(latest[0]) and take.listened.complete
        )

    def follow(self, note: KeyNote) -> None:
        """Show the latest blow, once its motion is rendered."""
        if self._asked is not None and self._asked[1] is note:
            return
        keys = note.player.keys
        drum_key = keys.of_key(note.event.key) if isinstance(keys, DrumKeys) else None
        entry, choices = self._library.find(note.patch.preset), self._session.choices
        if drum_key is None or entry is None:
            return
        strike = drum_key.strike(note.event.velocity, note.patch.pluck.curve)
        if note.event.place is not None:
            strike = Strike(note.event.place, strike.speed_m_s, strike.mallet)
        request = BlowRequest(entry.path, drum_key.modes, strike, choices.seconds, choices.ear)
        self._asked = request, note
        if self.shown.take is not None and request.same_motion(self.shown.take.request):
            self.shown = Playhead(self.shown.take, note)
        self._submit(request)

    def listen(self) -> None:
        """Render the shown blow again where its duration or the listening points have changed.

        That of another instrument is forgotten.
        """
        choices = self._session.choices
        if self._asked is not None and choices.patch is not None and self._asked[1].patch.name != choices.patch.name:
            self.forget()
        if self._asked is None:
            return
        before, note = self._asked
        if (before.seconds, before.ear) != (choices.seconds, choices.ear):
            request = replace(before, seconds=choices.seconds, ear=choices.ear)
            self._asked = request, note
            self._submit(request)

    def started(self, take: BlowTake) -> bool:
        """Take a motion that was begun; whether it is of the latest blow and not shown yet."""
        if self._asked is None or take is self.shown.take or not take.request.same_motion(self._asked[0]):
            return False
        note, before = self._asked[1], self.shown
        parked = before.note is None and before.take is not None and before.take.request.strike is take.request.strike
        self.shown = Playhead(take, None, before.parked_s) if parked else Playhead(take, note)
        return True

    def forget(self) -> None:
        """Forget the blow, as another instrument is played."""
        self._asked, self.shown = None, Playhead()
