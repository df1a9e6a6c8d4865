"""Presets in memory, with the programs of their voices."""

from __future__ import annotations

import threading
from collections import OrderedDict

from app.rendering import SOURCES
from app.rendering.subject import Loaded, StringOf, Subject
from engine.presets import Preset, load_preset
from engine.presets.of_string import of_string

KEPT_PRESETS = 24  # the latest used, each string of one counted


class Sources:
    """Presets in memory, with their programs, for any thread.

    The first caller loads what is missing; callers who need nothing of it do not wait.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()  # of the dictionaries, for a moment
        self._loading = threading.RLock()  # one load after the other
        self._presets: OrderedDict[Subject, Loaded] = OrderedDict()

    def has(self, subject: Subject, rate_hz: int) -> bool:
        """Return True if it is loaded with both programs at this rate, so that a strike would not wait."""
        with self._lock:
            loaded = self._presets.get(subject)
        return loaded is not None and loaded.sounds_at(rate_hz)

    def load(self, subject: Subject) -> Loaded:
        """The preset, or a string of it, from memory or from its file. Raises PresetError."""
        if (loaded := self._known(subject)) is not None:
            return loaded
        with self._loading:
            loaded = self._known(subject) or Loaded(self._read(subject))
            with self._lock:
                self._presets[subject] = loaded
                while len(self._presets) > KEPT_PRESETS:
                    self._presets.popitem(last=False)
            return loaded

    def _read(self, subject: Subject) -> Preset:
        """The preset from its file, or with another string from the loaded preset. Raises PresetError."""
        if not isinstance(subject, StringOf):
            return load_preset(subject)
        return of_string(self.load(subject.path).preset, subject.string)

    def prepare(self, subject: Subject, rate_hz: int) -> None:
        """Load a preset with both programs. Raises PresetError."""
        loaded = self.load(subject)
        for source in SOURCES:
            loaded.program(source, rate_hz)

    def _known(self, subject: Subject) -> Loaded | None:
        """The preset in memory, which becomes the latest used; None: not loaded."""
        with self._lock:
            loaded = self._presets.get(subject)
            if loaded is not None:
                self._presets.move_to_end(subject)
            return loaded
