"""The session: what the user has chosen, without any widget.

All choices are one immutable, validated value; the session replaces it and signals which fields have changed.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any, Literal

from psygnal import Signal
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from app.patches.patch import Patch, PhysicalString
from app.session.instrument import EARS, heard_at, picked_up
from app.shared.parameters import OF_CHOICES
from app.shared.vocabulary import Pickup
from engine.pluck import Pluck, Shape

Slot = Literal["a", "b"]  # two sources to compare; each holds "model", "truth", "difference" or "preset:NAME"
SLOT_PATTERN = r"^(model|truth|difference|preset:.+)$"

HIGHEST_MODE = 9_999  # of any grid that a preset may have


def _parameter(name: str) -> Any:
    """A field with range and default of the table of parameters."""
    low, high = OF_CHOICES[name].limits
    return Field(OF_CHOICES[name].default, ge=low, le=high)


class Choices(BaseModel):
    """Everything that is restored at the next start.

    Attributes:
        preset: the name of its file without the suffix; "": none.
        position, width, listen, listen_right: as fractions of the string's length.
        amplitude_mm: of the pluck, in mm.
        seconds: how long the pluck is rendered.
        string: the string that a preset of many strings is plucked as; None: the preset's own.
        patch: what keys play; None: they pluck the preset's own string.
        keys_play: whether keys are pitches of the patch, or places on the string.
        octave: by how many octaves the computer's keys are transposed.
        velocity: with which the computer's keys are struck, as in MIDI.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    preset: str = ""
    position: float = _parameter("position")
    amplitude_mm: float = _parameter("amplitude_mm")
    shape: Shape = "gaussian"
    width: float = _parameter("width")
    listen: float = _parameter("listen")
    seconds: float = _parameter("seconds")
    listen_right: float = _parameter("listen_right")  # used in stereo, where `listen` is the left one
    stereo: bool = False
    pickup: Pickup = "displacement"
    solo: int = Field(0, ge=0, le=HIGHEST_MODE)  # above 0: this mode is heard alone
    a: str = Field("model", pattern=SLOT_PATTERN)
    b: str = Field("truth", pattern=SLOT_PATTERN)
    heard: Slot = "a"
    level_match: bool = True
    difference_gain_db: float = _parameter("difference_gain_db")
    loop: bool = False
    volume_db: float = _parameter("volume_db")
    speed: float = _parameter("speed")
    left_view: str = "spectrum"  # names of panels
    right_view: str = "waveform"
    motion: bool = True  # whether the string's picture shows its motion, and the envelope of it
    envelope: bool = True
    string: PhysicalString | None = None
    patch: Patch | None = None
    keys_play: Literal["pitch", "place"] = "pitch"
    octave: int = Field(0, ge=-4, le=4)
    velocity: int = Field(90, ge=1, le=127)

    @model_validator(mode="before")
    @classmethod
    def _take_old_heard(cls, data: Any) -> Any:
        """Reads settings of versions without slots, in which `heard` named the source itself."""
        if isinstance(data, dict) and data.get("heard") in ("model", "truth") and not {"a", "b"} & data.keys():
            return {**data, "a": "model", "b": "truth", "heard": "a" if data["heard"] == "model" else "b"}
        return data

    @property
    def pluck(self) -> Pluck:
        return Pluck(self.position, self.amplitude_mm, self.shape, self.width)

    @property
    def source_heard(self) -> str:
        return self.a if self.heard == "a" else self.b

    @property
    def plays_pitches(self) -> bool:
        """Whether keys are pitches of the patch; otherwise they pluck at ten places."""
        return self.keys_play == "pitch" and self.patch is not None

    def changed(self, changes: Mapping[str, Any]) -> Choices:
        """These choices with other values: the one way to change them. Another preset resets `string`, unless given.

        Raises:
            ValueError: a value is out of its range, a field is unknown, or the patch cannot be heard so.
        """
        if changes.get("preset", self.preset) != self.preset:
            changes = {"string": None, **changes}
        try:  # of the other fields, which are valid, only the slots: without them `heard` is read as an old one
            checked = Choices.model_validate({"a": self.a, "b": self.b, **changes})
        except ValidationError as error:
            first = error.errors()[0]
            raise ValueError(f"{'.'.join(map(str, first['loc']))}: {first['msg']}") from error
        return _with_one_ear(self.model_copy(update={name: getattr(checked, name) for name in changes}), changes)


class Session:
    """The present choices.

    Signals carry the set of the names of the fields that have new values. `changed` is emitted after every change,
    `played` just before it where a note has brought the change (`play`), so that undo can leave it out.

    While keys play the patch, its pick-up is what `listen`, `listen_right`, `stereo` and `pickup` say: whichever of
    the two changes, the other follows, so that the sound is also saved, recorded and exported so.
    """

    changed = Signal(frozenset)
    played = Signal(frozenset)

    def __init__(self, choices: Choices | None = None) -> None:
        self._choices = _with_one_ear(choices or Choices(), ())

    @property
    def choices(self) -> Choices:
        return self._choices

    def update(self, **changes: Any) -> None:
        """Takes new values, all or none. A preset sets `keys_play` too, unless given: "pitch" if it is the patch's.

        Raises:
            ValueError: a value is out of its range or a field is unknown; nothing has changed then.
        """
        if "preset" in changes and "keys_play" not in changes:
            patch = changes.get("patch", self._choices.patch)
            plays = "pitch" if patch is not None and patch.preset == changes["preset"] else "place"
            changes = {**changes, "keys_play": plays}
        if names := self._take(changes):
            self.changed.emit(names)

    def play(self, **changes: Any) -> None:
        """Takes the values that a note brings: as `update`, but no step of undo, and `keys_play` stays."""
        if names := self._take(changes):
            self.played.emit(names)
            self.changed.emit(names)

    def _take(self, changes: Mapping[str, Any]) -> frozenset[str]:
        """Returns the fields that have new values."""
        before, self._choices = self._choices, self._choices.changed(changes)
        return frozenset(n for n in Choices.model_fields if getattr(before, n) != getattr(self._choices, n))

    def move_pluck(self, position: float, amplitude_mm: float) -> None:
        """Takes the nearest allowed pluck: for gestures, which may go past the limits. `position` as in `Choices`."""
        self.update(
            position=OF_CHOICES["position"].clamped(position),
            amplitude_mm=OF_CHOICES["amplitude_mm"].clamped(amplitude_mm),
        )

    def move_listening_point(self, listen: float) -> None:
        self.update(listen=OF_CHOICES["listen"].clamped(listen))

    @property
    def source_heard(self) -> str:
        """The source in the slot that is heard."""
        return self._choices.source_heard

    def switch_source(self) -> None:
        """Switches the sound from slot A to slot B, or back."""
        self.update(heard="b" if self._choices.heard == "a" else "a")


def _with_one_ear(choices: Choices, asked: Collection[str]) -> Choices:
    """`choices` in which the patch that keys play is heard where its own pick-up says.

    Args:
        asked: the fields that were asked to change. Of these the patch counts before listening points and pick-up,
            which otherwise become those of the patch.

    Raises:
        ValueError: the patch cannot be heard so.
    """
    patch = choices.patch
    if patch is None or not choices.plays_pitches:
        return choices
    if "patch" not in asked and any(name in asked for name in EARS):
        heard = picked_up(patch, choices.listen, choices.listen_right, choices.stereo, choices.pickup)
        return choices.model_copy(update={"patch": heard})
    return choices.model_copy(update=heard_at(patch))
