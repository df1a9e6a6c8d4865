"""The life of a pluck: asked for, rendered, heard, shown, measured; and the next one that takes its place.

Everything here runs in the window's thread, but for a struck pluck's first sound (`app/strikes.py`).
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence

from PySide6.QtCore import QObject

from app.audio import Player, PlayerStatus, Track
from app.library import Library, PresetEntry
from app.main_window import MainWindow
from app.panels import Panel, StringPanel
from app.preset_words import percent
from app.render_mail import RenderMail
from app.rendering import RenderRequest, RenderWorker, Take
from app.session import Session
from app.silence import why_ran_away
from app.slots import render_request
from app.strikes import MotionKey, Strikes, motion_key
from engine.metrics import ErrorSums

AT_FIRST_S = 0.3  # of a pluck, in which the window draws all of its views anew

HearTrack = Callable[[Track], None]


class Performance(QObject):
    """What is on stage, and the render worker that puts it there.

    Attributes:
        take, track: what is shown, and its sound.
    """

    def __init__(
        self, window: MainWindow, session: Session, library: Library, player: Player, panels: Sequence[Panel]
    ) -> None:
        super().__init__(window)
        self.take: Take | None = None
        self.track: Track | None = None
        self.strikes = Strikes(player, lambda: session.source_heard)
        self._window, self._session, self._library, self._player = window, session, library, player
        self._panels = panels
        self._string = next(panel for panel in panels if isinstance(panel, StringPanel))
        self._asked: RenderRequest | None = None
        self._play_when_ready = False  # the next take shall sound as soon as it is there
        self._borrower: HearTrack | None = None
        mail = self._mail = RenderMail(self.strikes)
        mail.started.connect(self._take_started)
        mail.replaced.connect(self._track_replaced)
        mail.finished.connect(self._take_finished)
        mail.other_refused.connect(self._other_refused)
        mail.failed.connect(self._render_failed)
        self._worker = RenderWorker(mail)

    @property
    def entry(self) -> PresetEntry | None:
        """The chosen preset."""
        return self._library.find(self._session.choices.preset)

    @property
    def ready(self) -> bool:
        """Whether what is on stage is what was chosen."""
        return self.take is not None and motion_key(self.take) == self._wanted_key()

    @property
    def starting(self) -> bool:
        """Whether a pluck waits for its first sound, or has begun and is not on stage yet."""
        return self._play_when_ready or bool(self.strikes.awaited)

    def hurried(self, status: PlayerStatus, comfortable_s: float) -> bool:
        """Whether what is on stage is heard while little more of it is rendered."""
        track = self.track
        if track is None or track.complete or not status.playing:
            return False
        return track.ready_frames / track.rate_hz < status.position_s + comfortable_s

    def watch(self, status: PlayerStatus) -> None:
        """Says so where the playhead waits for rendering: the sound has a gap then."""
        if status.waiting and status.position_s > AT_FIRST_S and self.track is not None and not self.track.complete:
            self._window.error_label.setText("rendering, slower than it sounds: gaps …")

    # Intents

    def pluck(self) -> None:
        """Lets the string go: from the start, with sound, beside the plucks that still ring."""
        if not self.ready or self.track is None:
            self._play_when_ready = True  # the rendering is on its way, and begins to sound when it starts
            if (key := self._wanted_key()) is not None:
                self.strikes.expect(key)
            self._worker.strike()
            return
        self._worker.strike()
        if self._load(self.track, ring=True):
            self._begin()

    def play_or_stop(self) -> None:
        if self._player.status().playing:
            self._play_when_ready = False
            self.strikes.forget()
            self._player.stop()
        else:
            self.pluck()

    def render(self) -> None:
        """Asks for what is chosen."""
        self._asked = self._request()
        if self._asked is None:
            self._window.notices.tell("No preset was found: train one, or get the presets again.")
        else:
            self._worker.submit(self._asked)

    def choices_changed(self) -> None:
        """Asks anew where something else is wanted."""
        asked, request = self._asked, self._request()
        if request is not None and request != asked:
            if not request.same_motion(asked) and not self._string.drawing:
                self._play_when_ready |= self._player.status().playing
            self.render()

    def rate_shown(self, rate_hz: int) -> None:
        """The rate that the player needs now."""
        if self._asked is not None and rate_hz != self._asked.sound_rate_hz:
            self.render()

    def select(self) -> None:
        """Lets the chosen slot be heard, as soon as there is a track that has what it holds."""
        if self._borrower is None and self._player.track is not None:
            with contextlib.suppress(ValueError):
                self._player.select(self._session.source_heard)

    def lend_player(self, hear: HearTrack) -> None:
        """Until `take_player_back` the sound on stage, now and when it changes, goes to `hear` instead."""
        self._borrower = hear
        self.strikes.held = True
        if self.track is not None:
            hear(self.track)

    def take_player_back(self) -> None:
        self._borrower = None
        self.strikes.held = False
        self._play_when_ready = False
        self._player.set_loop(self._session.choices.loop)
        if self.track is not None:
            self._load(self.track)

    def close(self) -> None:
        """Ends the worker; may be called again."""
        self._worker.close()

    # What the worker says

    def _take_started(self, take: Take, track: Track, sounds: bool) -> None:
        sounds = sounds or self.strikes.begin(take, track)  # it was struck while this was on its way
        if motion_key(take) != self._wanted_key():  # a quick pluck, overtaken by the next one: it sounds too
            self.select()
            return
        self.take, self.track = take, track
        if sounds:
            self._play_when_ready = False
            self.select()
        # While the string is drawn the last pluck rings on until this one is let go. The sound comes first.
        elif not self._string.drawing and self._load(track) and self._play_when_ready:
            self._begin()
        for panel in self._panels:
            panel.take_started(take)
        self._window.error_label.setText("rendering …")

    def _track_replaced(self, take: Take, track: Track) -> None:
        if take is self.take:
            self.track = track
            if self._load(track, keep_position=True) and self._play_when_ready and self.ready:
                self._begin()  # it could not when it started: the device had changed its rate

    def _take_finished(self, take: Take, errors: ErrorSums) -> None:
        if take is not self.take:
            return
        for panel in self._panels:
            panel.take_finished(take, errors)
        if reason := why_ran_away(take):
            self._window.notices.tell(reason)
        windows = errors.windows(
            take.info.rate_hz, (0.0, take.info.horizon_s, max(take.seconds, take.info.horizon_s))
        )
        parts = [
            f"{percent(w.rel_mae)} {place}" for w, place in zip(windows, ("as trained", "past it"), strict=False)
        ]
        self._window.error_label.setText("error of this pluck: " + ", ".join(parts))

    def _other_refused(self, preset: str, message: str) -> None:
        self._window.notices.tell(f"{preset} cannot be heard beside this preset: {message}")

    def _render_failed(self, message: str, detail: str) -> None:
        self._play_when_ready = False
        self.strikes.forget()
        self._window.error_label.setText("")
        self._window.notices.tell(message, detail)

    # Helpers

    def _begin(self) -> None:
        self._play_when_ready = False
        self._player.play()

    def _load(self, track: Track, keep_position: bool = False, ring: bool = False) -> bool:
        """False where the device changed its rate meanwhile: the sound is then made again at the new one."""
        if self._borrower is not None:
            self._borrower(track)
            return False
        try:
            self._player.load(track, keep_position, ring)
        except ValueError:
            self.render()
            return False
        self.select()
        return True

    def _request(self) -> RenderRequest | None:
        entry = self.entry
        if entry is None:
            return None
        return render_request(self._session.choices, entry.path, self._library, self._player.rate_hz)

    def _wanted_key(self) -> MotionKey | None:
        entry, choices = self.entry, self._session.choices
        if entry is None:
            return None
        return entry.name, choices.pluck, round(choices.seconds * entry.info.rate_hz) + 1
