"""Closing the window: first a question about each thing that it would end or lose."""

from __future__ import annotations

from PySide6.QtCore import QObject

from app.views.dialogs.question import ask
from app.window.exports import Exports
from app.window.main_window import MainWindow
from app.window.recordings import Recordings

FINISH = "Finish first"
STOP = "Cancel export"
STAY = "Stay"
SAVE = "Save"
DISCARD = "Discard"
CANCEL = "Cancel"


class Leaving(QObject):
    """The answer to `MainWindow.may_close`. After what the user finishes or saves first, the window closes."""

    def __init__(self, window: MainWindow, recordings: Recordings, exports: Exports) -> None:
        super().__init__(window)
        self._window = window
        self._recordings = recordings
        self._exports = exports
        self._waits = False  # for an export or a recording to be saved, to close the window then
        self._asking = False  # a question is open
        window.may_close = self.may_close
        exports.ended.connect(self._end_wait)
        recordings.written.connect(self._end_wait)

    def may_close(self) -> bool:
        """Return True if the window may be closed now; ask where work would be lost."""
        if self._asking:  # closed once more under the question
            return False
        self._asking = True
        try:
            self._waits = False
            return self._may_end_export() and self._may_lose_recordings()
        finally:
            self._asking = False

    def _may_end_export(self) -> bool:
        """Return True if no export is under way, or the user cancels it; where it is to finish first, wait."""
        if not self._exports.busy:
            return True
        question = "An export is under way. Closing the app ends it; only whole files are kept."
        answer = ask(self._window, "Export under way", question, STAY, STOP, FINISH)
        if answer == STOP:
            self._exports.close()
            return True
        if answer == STAY:
            return False
        self._waits = self._exports.busy
        return not self._waits  # it has ended well or not while the question was open

    def _may_lose_recordings(self) -> bool:
        """Return True if no recording is unsaved, or the user discards it; saving it closes the window later."""
        if not self._recordings.unsaved:
            return True
        question = "What was played is not saved. Save the recording before the app closes?"
        answer = ask(self._window, "Recording not saved", question, CANCEL, DISCARD, SAVE)
        if answer == DISCARD:
            self._recordings.forget_all()
            return True
        if answer == SAVE:
            self._recordings.end()
            self._waits = self._recordings.unsaved  # else nothing was played
            if self._waits:
                self._recordings.save()
            return not self._waits
        return False

    def _end_wait(self, well: bool) -> None:
        """Close the window if it waits for this export or recording, and the file was written (`well`).

        After a failure the window stays, and waits no more.
        """
        waited, self._waits = self._waits, False
        if waited and well:
            self._window.close()
