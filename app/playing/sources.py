"""Presets in memory, with what their voices and pictures are made of."""

from __future__ import annotations

import threading
from collections import OrderedDict
from pathlib import Path

from app.rendering.loaded import Loaded
from engine.preset import load_preset
from engine.voices import Program, bank_program, rendered_program, truth_program

KEPT_PRESETS = 8  # the latest used


class Sources:
    """Any thread. What is not there yet is loaded by whoever asks first."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._presets: OrderedDict[Path, Loaded] = OrderedDict()
        self._programs: dict[tuple[Path, str, int], Program] = {}

    def has(self, path: Path, rate_hz: int) -> bool:
        """Whether a strike of it would not have to wait."""
        return (path, "model", rate_hz) in self._programs

    def load(self, path: Path) -> Loaded:
        """Raises PresetError."""
        with self._lock:
            loaded = self._presets.pop(path, None) or Loaded(load_preset(path))
            self._presets[path] = loaded
            while len(self._presets) > KEPT_PRESETS:
                oldest, _ = self._presets.popitem(last=False)
                for key in [key for key in self._programs if key[0] == oldest]:
                    del self._programs[key]
            return loaded

    def program(self, path: Path, kind: str, rate_hz: int) -> Program:
        """Of a preset's "model" or "truth" at a device's rate. Raises PresetError."""
        with self._lock:
            key = (path, kind, rate_hz)
            found = self._programs.get(key)
            if found is None:
                preset = self.load(path).preset
                if kind == "truth":
                    found = truth_program(preset.info, rate_hz)
                else:
                    bank = bank_program(preset.model, preset.info, rate_hz)
                    found = rendered_program(preset.info, rate_hz) if bank is None else bank
                self._programs[key] = found
            return found

    def prepare(self, path: Path, rate_hz: int) -> None:
        """Loads it with both programs. Raises PresetError."""
        for kind in ("truth", "model"):
            self.program(path, kind, rate_hz)
