"""The choices of the user, as one immutable, validated value."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, fields, replace
from typing import Any

from pydantic import Field, ValidationError, model_validator

from app.instruments.drums import Drums
from app.instruments.fields import String, parameter
from app.instruments.instrument import Instrument, Pickup
from app.session.monitor import Monitor
from app.session.pickup import POINTS, TURNED, turned_pickup, with_pickup
from app.shared.parameters import OF_CHOICES
from app.shared.vocabulary import Face
from engine import bounds
from engine.pluck import Pluck
from engine.schema import explained
from engine.values.ear import Ear

PLUCK = tuple(field.name for field in fields(Pluck))
HIGHEST_MODE = 9_999  # of any grid that a preset may have


class Choices(Monitor):
    """The choices that are restored at the next start.

    Attributes:
        instrument: what is there to be played, even if it is not; None: there is none.
        single: the preset whose string is played instead, at places along it; None: the instrument is played.
        string: that is shown, of the latest note, for a preset of many strings; None: the preset's own.
        pluck: as it is shown, of the latest note or as drawn.
        string_pickup: where a single string is heard; an instrument has its own pick-up.
        right: the right listening point that stereo gives to a pick-up in mono.
        solo: above 0: this mode is heard alone.
        seconds: how long the pluck is rendered.
        octave: by how many octaves the computer's keys are transposed.
        velocity: with which the computer's keys are struck, as in MIDI.
    """

    instrument: Instrument | None = None
    single: str | None = ""
    string: String | None = None
    pluck: Pluck = Pluck()
    string_pickup: Pickup = Pickup()
    right: float = parameter("listen_right")
    solo: int = Field(0, ge=0, le=HIGHEST_MODE)
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
        """The name of the preset that is played; "": none."""
        return self.single or (self.played.preset if self.played else "")

    @property
    def played(self) -> Instrument | None:
        """The instrument, if it is played: keys are pitches. None: they are places along a single string."""
        return self.instrument if self.single is None else None

    @property
    def plays_instrument(self) -> bool:
        """Return True if the instrument is played."""
        return self.played is not None

    @property
    def drums(self) -> Drums | None:
        """The drums that are played; None: a string or an instrument of strings is."""
        return self.played.strings if self.played and isinstance(self.played.strings, Drums) else None

    @property
    def pickup(self) -> Pickup:
        """The pick-up of what is played."""
        return self.played.pickup if self.played else self.string_pickup

    @property
    def ear(self) -> Ear:
        """The ear as the engine takes it; the first point, in stereo the left, is drawn."""
        return replace(self.pickup.ear, solo=self.solo)

    @property
    def stereo(self) -> bool:
        return len(self.pickup.points) > 1

    @property
    def listen(self) -> float:
        """The listening point, in stereo the left."""
        return self.pickup.points[0]

    @property
    def listen_right(self) -> float:
        """The right listening point; in mono the one that stereo would have."""
        return self.pickup.points[1] if self.stereo else self.right

    def value(self, name: str) -> Any:
        """A value by a name of OBSERVED, or of a parameter of the choices."""
        return getattr(self.pluck if name in PLUCK else self, name)

    def changed(self, changes: Mapping[str, Any]) -> Choices:
        """Copy these choices with other values: the one way to change them.

        Another preset resets `string`, and another slot or its source `difference`, unless given. A string that is
        played by itself after an instrument is heard where that was, unless given.

        Args:
            changes: fields. Also `preset`, the name of one whose single string is played from now on, and
                `played`, an instrument that is. Also PLUCK, and TURNED of the pick-up of what is played then.

        Raises:
            ValueError: a value is out of its range, a field is unknown, or the instrument cannot be heard so.
        """
        plucked, turns = ({name: changes[name] for name in names if name in changes} for names in (PLUCK, TURNED))
        changes = {name: value for name, value in changes.items() if name not in (*PLUCK, *TURNED)}
        if "played" in changes:
            changes |= {"instrument": changes.pop("played"), "single": None}
        if "preset" in changes:
            changes["single"] = changes.pop("preset")
        if {"a", "b", "heard"} & changes.keys():
            changes.setdefault("difference", False)
        if plucked:
            changes["pluck"] = asdict(changes.get("pluck", self.pluck)) | plucked
        if unknown := changes.keys() - Choices.model_fields.keys():
            raise ValueError(f"unknown field {bounds.brief(unknown.pop())}")
        instrument = changes.get("instrument")
        valid = {"instrument": instrument} if isinstance(instrument, Instrument) else {}
        unchecked = {name: value for name, value in changes.items() if name not in valid}
        try:  # with `a`, `b` and `single` they are not taken for choices of earlier versions
            checked = Choices.model_validate({"a": self.a, "b": self.b, "single": self.single, **unchecked})
        except ValidationError as error:
            raise ValueError(explained(error)) from error
        choices = self.model_copy(update=valid | {name: getattr(checked, name) for name in unchecked})
        if choices.preset != self.preset and "string" not in changes:
            choices = choices.model_copy(update={"string": None})
        if self.plays_instrument and not choices.plays_instrument and "string_pickup" not in changes:
            choices = choices.model_copy(update={"string_pickup": self.pickup})
        return choices._turned(turns) if turns else choices

    def _turned(self, turns: Mapping[str, Any]) -> Choices:
        """The choices with new values, by name of TURNED, in the pick-up of what is played. Raises ValueError."""
        pickup, right = turned_pickup(self.pickup, turns, self.listen_right), self.right
        if {"listen_right", "stereo"} & turns.keys():
            right = turns.get("listen_right", self.listen_right)
        if self.played is None:
            return self.model_copy(update={"string_pickup": pickup, "right": right})
        return self.model_copy(update={"instrument": with_pickup(self.played, pickup), "right": right})


OBSERVED = (*Choices.model_fields, "preset", "ear", *PLUCK)  # names of what may change


def migrated(data: dict[str, Any]) -> dict[str, Any]:
    """The fields of these choices, read from those of earlier versions.

    Before there were slots, `heard` named the source itself. In the last version `instrument` had the name `patch`.
    Before there was `single`, `instrument` could be a preset alone: what is `instrument` today was then in `kept`.
    Still earlier, `keys_play` said if `patch` was played or the string of `preset`. What is the pluck and
    the pick-up today were fields of the choices, those of an instrument that was played too.
    """
    data = dict(data)
    if data.keys() & {*PLUCK}:
        data["pluck"] = {name: data.pop(name) for name in PLUCK if name in data}
    if data.keys() & {*POINTS, "stereo", "pickup"}:
        points = [data.pop(name, OF_CHOICES[name].default) for name in POINTS]
        count, kind = 2 if data.pop("stereo", False) else 1, data.pop("pickup", Pickup().kind)
        data |= {"string_pickup": {"points": points[:count], "kind": kind}, "right": points[1]}
    if data.get("heard") in ("model", "truth") and not {"a", "b"} & data.keys():
        data |= {"a": "model", "b": "truth", "heard": "a" if data["heard"] == "model" else "b"}
    if "single" in data:
        if "patch" in data:
            data["instrument"] = data.pop("patch")
    elif "instrument" in data:
        instrument, kept = data.pop("instrument"), data.pop("kept", None)
        if isinstance(instrument, dict) and not instrument.keys() - {"preset"}:
            data |= {"instrument": kept, "single": instrument.get("preset", "")}
        else:
            data |= {"instrument": instrument, "single": None}
    elif data.keys() & {"preset", "patch", "keys_play"}:
        preset = data.pop("preset", "")
        place = data.pop("keys_play", "") == "place"
        instrument = data["instrument"] = data.pop("patch", None)
        data["single"] = preset if instrument is None or place else None
        default = Instrument.model_fields["preset"].default
        model = instrument.get("preset", default) if isinstance(instrument, dict) else preset
        if data["single"] is None and preset not in ("", model):
            data["string"] = None  # it is of another preset
    return data
