"""The session: what the user has chosen, without any widget.

All choices are one immutable, validated value; the session replaces it and signals which fields have changed.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from psygnal import Signal
from pydantic import Field, ValidationError, model_validator

from app.patches.drums import Drums
from app.patches.fields import String, parameter
from app.patches.instrument import Instrument, SingleString
from app.patches.patch import Patch
from app.session.listener import Listener, points_of
from app.session.monitor import Monitor
from app.shared.parameters import OF_CHOICES
from app.shared.value import Value
from app.shared.vocabulary import Face
from engine.pluck import Pluck, Shape
from engine.schema import explained


class ShownString(Value):
    """The string that is shown and how it is plucked: of the latest note, or as drawn.

    Attributes:
        string: for a preset of many strings; None: the preset's own.
        position, width: as fractions of the string's length.
        amplitude_mm: in mm.
    """

    string: String | None = None
    position: float = parameter("position")
    amplitude_mm: float = parameter("amplitude_mm")
    shape: Shape = "gaussian"
    width: float = parameter("width")

    @property
    def pluck(self) -> Pluck:
        return Pluck(self.position, self.amplitude_mm, self.shape, self.width)


class Choices(Monitor, Listener, ShownString):
    """The choices that are restored at the next start.

    Attributes:
        instrument: what is played.
        kept: the patch that is there, while a single string is played.
        seconds: how long the pluck is rendered.
        octave: by how many octaves the computer's keys are transposed.
        velocity: with which the computer's keys are struck, as in MIDI.
    """

    instrument: Instrument = SingleString()
    kept: Patch | None = None
    seconds: float = parameter("seconds")
    loop: bool = False
    volume_db: float = parameter("volume_db")
    speed: float = parameter("speed")
    face: Face = "play"
    left_view: str = "spectrum"  # names of panels
    right_view: str = "waveform"
    motion: bool = True  # whether the string's picture shows its motion, and the envelope of it
    envelope: bool = True
    octave: int = Field(0, ge=-4, le=4)
    velocity: int = Field(90, ge=1, le=127)

    @model_validator(mode="before")
    @classmethod
    def _take_old(cls, data: Any) -> Any:
        return migrated(data) if isinstance(data, dict) else data

    @property
    def preset(self) -> str:
        """The name of the instrument's preset; "": none."""
        return self.instrument.preset

    @property
    def patch(self) -> Patch | None:
        """The patch that is there, played or not."""
        return self.instrument if isinstance(self.instrument, Patch) else self.kept

    @property
    def plays_patch(self) -> bool:
        """Return True if the instrument is a patch, whose keys are pitches; else keys are places along a string."""
        return isinstance(self.instrument, Patch)

    @property
    def drums(self) -> Drums | None:
        """The drums that are played; None: a string or an instrument of strings is."""
        patch = self.instrument
        return patch.strings if isinstance(patch, Patch) and isinstance(patch.strings, Drums) else None

    def changed(self, changes: Mapping[str, Any]) -> Choices:
        """Copy these choices with other values: the one way to change them.

        Another preset resets `string`, unless given.

        Args:
            changes: fields. Also `preset`, the name of one whose single string becomes the instrument, and `patch`,
                which replaces the present one, played or not.

        Raises:
            ValueError: a value is out of its range, a field is unknown, or the patch cannot be heard so.
        """
        changes = dict(changes)
        if "preset" in changes:
            changes["instrument"] = SingleString(preset=changes.pop("preset"))
        if "patch" in changes:
            changes["instrument" if self.plays_patch else "kept"] = changes.pop("patch")
        elif self.plays_patch and "instrument" in changes:
            changes.setdefault("kept", self.instrument)
        try:  # of the other fields, which are valid, only the slots: without them `heard` is read as an old one
            checked = Choices.model_validate({"a": self.a, "b": self.b, **changes})
        except ValidationError as error:
            raise ValueError(explained(error)) from error
        choices = self.model_copy(update={name: getattr(checked, name) for name in changes})
        follow: dict[str, Any] = {"kept": None} if choices.plays_patch else {}
        if choices.preset != self.preset and "string" not in changes:
            follow["string"] = None
        return _with_one_pickup(choices.model_copy(update=follow), changes)


OBSERVED = (*Choices.model_fields, "preset", "patch")  # names that `Session.changed` carries


def migrated(data: dict[str, Any]) -> dict[str, Any]:
    """The fields of these choices, read from those of an earlier version."""
    return _with_instrument(_without_slots(data))


def _without_slots(data: dict[str, Any]) -> dict[str, Any]:
    """Convert choices from before there were slots, when `heard` named the source itself."""
    if data.get("heard") in ("model", "truth") and not {"a", "b"} & data.keys():
        return {**data, "a": "model", "b": "truth", "heard": "a" if data["heard"] == "model" else "b"}
    return data


def _with_instrument(data: dict[str, Any]) -> dict[str, Any]:
    """Convert choices from before there were instruments.

    Then `keys_play` said if `patch` was played or the string of `preset`.
    """
    old = {name: data[name] for name in ("preset", "patch", "keys_play") if name in data}
    if not old or "instrument" in data:
        return data
    rest = {name: value for name, value in data.items() if name not in old}
    preset, patch = old.get("preset", ""), old.get("patch")
    if patch is None or old.get("keys_play", "pitch") == "place":
        return {**rest, "instrument": {"preset": preset}, "kept": patch}
    model = patch.get("preset", "studio_any_string") if isinstance(patch, dict) else getattr(patch, "preset", "")
    string = rest.pop("string", None)
    return {**rest, "instrument": patch, "string": string if preset in ("", model) else None}


class Session:
    """The present choices.

    Signals carry the set of the names of the fields that have new values, of `OBSERVED`. `changed` is emitted after
    every change, `played` just before it where a note has brought the change (`play`), so that undo can leave it out.

    While a patch is played, its pick-up and `listen`, `listen_right`, `stereo` and `pickup` agree: each follows the
    other. So the sound is saved, recorded and exported as it is heard.
    """

    changed = Signal(frozenset)
    played = Signal(frozenset)

    def __init__(self, choices: Choices | None = None) -> None:
        self._choices = _with_one_pickup(choices or Choices(), ())

    @property
    def choices(self) -> Choices:
        return self._choices

    def update(self, **changes: Any) -> None:
        """Take new values, all or none, as `Choices.changed`; the preset of the patch chooses the patch.

        Raises:
            ValueError: a value is out of its range or a field is unknown; nothing has changed then.
        """
        patch = self._choices.patch
        if patch is not None and changes.get("preset") == patch.preset:
            changes = {"instrument": patch, **changes}
            del changes["preset"]
        if names := self._take(changes):
            self.changed.emit(names)

    def play(self, **changes: Any) -> None:
        """Take the values that a note brings: as `update`, but no step of undo."""
        if names := self._take(changes):
            self.played.emit(names)
            self.changed.emit(names)

    def _take(self, changes: Mapping[str, Any]) -> frozenset[str]:
        """Return the names that have new values."""
        before, self._choices = self._choices, self._choices.changed(changes)
        return frozenset(name for name in OBSERVED if getattr(before, name) != getattr(self._choices, name))

    def play_patch(self) -> None:
        """Make the patch that is there the instrument: keys are pitches."""
        if (patch := self._choices.patch) is not None:
            self.update(instrument=patch)

    def play_string(self) -> None:
        """Make the string that is shown the instrument: keys are places along it."""
        choices = self._choices
        self.update(instrument=SingleString(preset=choices.preset), string=choices.string)

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
        self.update(heard="b" if self._choices.heard == "a" else "a")


def _with_one_pickup(choices: Choices, asked: Collection[str]) -> Choices:
    """The choices in which a patch that is played is heard where its own pick-up says.

    Args:
        asked: the fields that were asked to change. Of these the patch counts before listening points and pick-up,
            which otherwise become those of the patch.

    Raises:
        ValueError: the patch cannot be heard so.
    """
    patch = choices.instrument
    if not isinstance(patch, Patch):
        return choices
    if "instrument" not in asked and any(name in asked for name in Listener.model_fields if name != "solo"):
        return choices.model_copy(update={"instrument": choices.picked_up(patch)})
    return choices.model_copy(update=points_of(patch.pickup))
