"""The sound of a note: a pluck of a string or a key of an instrument, and where it is heard.

The window draws it, the listening test compares it, and files hold it: all read this one value.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path

from app.instruments.drums import Drums
from app.instruments.instrument import Instrument
from app.player.events import NoteOn
from app.presets.words import shape_word
from app.rendering.subject import Subject, load_subject, path_of, string_of
from app.shared.key_names import note_name
from engine.pluck import Pluck
from engine.presets import Preset, load_preset
from engine.values.ear import Ear


@dataclass(frozen=True)
class Struck:
    """A key of an instrument, held."""

    instrument: Instrument
    event: NoteOn

    @property
    def words(self) -> str:
        """The description for people."""
        stroke = f"at velocity {self.event.velocity}" if self.event.pluck is None else "plucked by hand"
        return f"{self.instrument.name}, {note_name(self.event.key)} {stroke}"


@dataclass(frozen=True)
class NoteSound:
    """A pluck and where it is heard, or a key of an instrument.

    Places on the string (pluck, width, listening points) are shares of its length, 0 … 1.

    Attributes:
        preset: the preset's file; for a model of many strings it can hold the plucked string too (`StringOf`).
        seconds: the duration; of a file that ends by its decay the longest.
        ear: listening points, pick-up and soloed mode; files and listening tests have all modes.
        speed: of the picture's slow motion; 1 is real time.
        others: presets that are drawn beside it for the same pluck, each as the source `OTHER` + its name.
        struck: a key of an instrument, without variation. Pluck and ear are then those of its string alone. None: no
            instrument has any part in the sound.
    """

    preset: Subject
    pluck: Pluck
    seconds: float
    ear: Ear
    speed: float = 1.0
    others: tuple[Path, ...] = ()
    struck: Struck | None = field(default=None, kw_only=True)

    @property
    def alone(self) -> NoteSound:
        """The string without its instrument; of a drum, which is no string, the same sound."""
        if self.struck is None or isinstance(self.struck.instrument.strings, Drums):
            return self
        return replace(self, struck=None)

    def same_motion(self, other: NoteSound | None) -> bool:
        """Return True if only listening points, slow motion or other presets differ: model and truth move alike."""
        return other is not None and self._motion == other._motion

    @property
    def _motion(self) -> tuple[object, ...]:
        """The values that the motion of model and truth depends on."""
        if self.struck is not None:
            return path_of(self.preset), self.struck, self.seconds
        return self.preset, self.pluck, self.seconds

    def load(self, rate_hz: int | None = None) -> Preset:
        """Load the preset, with its string.

        Args:
            rate_hz: of a preset of many strings, where the sound gives none; None: the preset's own.

        Raises:
            PresetError: it cannot be used.
        """
        return load_subject(self.preset, rate_hz) if self.struck is None else load_preset(path_of(self.preset))

    def words(self, title: str) -> str:
        """The description for people; `title`: of the preset.

        Places are shares of the string's length. The string's pitch is named only where `preset` holds a string.
        """
        remark = f". All modes, although mode {self.ear.solo} is soloed" if self.ear.solo else ""
        if self.struck is not None:
            return f"{self.struck.words}{remark}"
        pluck, points, string = self.pluck, self.ear.points, string_of(self.preset)  # None: `preset` is a file alone
        width = "" if pluck.shape == "triangular" else f" {pluck.width:.3f} wide"
        string_words = f", a string of {string.undamped_frequency(1) / math.tau:.1f} Hz" if string else ""
        pluck_words = f"{shape_word(pluck.shape)}{width}, at {pluck.position:.2f}, {pluck.amplitude_mm:.3g} mm"
        point_words = f"heard at {points[0]:.2f}"
        if len(points) == 2:
            point_words += f" (left) and {points[1]:.2f} (right)"
        if self.ear.pickup == "bridge":
            point_words = "heard at the bridge"
        kind = ", magnetic pick-up" if self.ear.pickup == "velocity" else ""
        return f"{title}{string_words}: {pluck_words}, {point_words}{kind}{remark}"
