"""Presets in memory, with the programs of their voices and where plucks start."""

from __future__ import annotations

import threading
from collections import OrderedDict
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from app.rendering.subject import Loaded, StringOf, Subject
from engine.pluck import Pluck
from engine.presets import Preset, load_preset
from engine.presets.of_string import of_string
from engine.resonators.sine_transform import project
from engine.voices import Program, model_program, truth_program

KINDS = ("truth", "model")
KEPT_PRESETS = 24  # the latest used, each string of one counted
KEPT_PLUCKS = 512

Array = NDArray[np.float64]


class Sources:
    """Presets in memory, with their programs, for any thread.

    The first caller loads what is missing; callers who need nothing of it do not wait.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()  # of the dictionaries, for a moment
        self._loading = threading.RLock()  # one load after the other
        self._presets: OrderedDict[Subject, Loaded] = OrderedDict()
        self._kept_begin = lru_cache(maxsize=KEPT_PLUCKS)(self._begin)

    def has(self, subject: Subject, rate_hz: int) -> bool:
        """Return True if it is loaded with both programs at this rate, so that a strike would not wait."""
        with self._lock:
            loaded = self._presets.get(subject)
        return loaded is not None and all((kind, rate_hz) in loaded.programs for kind in KINDS)

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
        if not isinstance(subject, StringOf):
            return load_preset(subject)
        return of_string(self.load(subject.path).preset, subject.string)

    def program(self, subject: Subject, source: str, rate_hz: int) -> Program:
        """The program of a voice: the truth's, or for any other `source` the model's. Raises PresetError.

        Args:
            rate_hz: of the device.
        """
        kind, loaded = "truth" if source == "truth" else "model", self.load(subject)
        if (program := loaded.programs.get((kind, rate_hz))) is not None:
            return program
        with self._loading:
            preset = loaded.preset
            if (program := loaded.programs.get((kind, rate_hz))) is None:
                program = truth_program(preset.info, rate_hz) if kind == "truth" else model_program(preset, rate_hz)
                loaded.programs[kind, rate_hz] = program
            return program

    def begin(self, subject: Subject, source: str, rate_hz: int, pluck: Pluck) -> tuple[Array, tuple[Array, Array]]:
        """A pluck's displacement (grid_points,) in m, and the start of a voice of the program. Both are kept.

        Raises PresetError.
        """
        return self._kept_begin(subject, source, rate_hz, pluck)

    def _begin(self, subject: Subject, source: str, rate_hz: int, pluck: Pluck) -> tuple[Array, tuple[Array, Array]]:
        info = self.load(subject).preset.info
        initial_m = project(pluck.displacement(info.grid_points), info.modes)
        return initial_m, self.program(subject, source, rate_hz).start(initial_m)

    def prepare(self, subject: Subject, rate_hz: int) -> None:
        """Load a preset with both programs. Raises PresetError."""
        for kind in KINDS:
            self.program(subject, kind, rate_hz)

    def _known(self, subject: Subject) -> Loaded | None:
        """The loaded preset, marked as used last; None: not loaded."""
        with self._lock:
            loaded = self._presets.get(subject)
            if loaded is not None:
                self._presets.move_to_end(subject)
            return loaded
