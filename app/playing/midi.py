"""What MIDI messages mean for the string: notes pluck, controllers turn what they were taught. No port, no widget."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from app.playing.keyboard import Reach
from app.session.choices import SECONDS_RANGE, SPEED_RANGE, VOLUME_RANGE_DB
from engine.pluck import LARGEST_AMPLITUDE_MM, POSITION_RANGE, WIDTH_RANGE

LOWEST_NOTE, HIGHEST_NOTE = 36, 96  # of a keyboard of 61 keys
LARGEST_VALUE = 127

NoteMode = Literal["position", "preset"]


@dataclass(frozen=True)
class Turned:
    """What a controller can turn: the label of a field of `Choices` and its range."""

    label: str
    low: float
    high: float
    logarithmic: bool = False

    def value(self, controller_value: int) -> float:
        share = min(max(controller_value, 0), LARGEST_VALUE) / LARGEST_VALUE
        if self.logarithmic:
            return min(self.low * (self.high / self.low) ** share, self.high)
        return min(self.low + share * (self.high - self.low), self.high)


TURNED = {  # field of `Choices` -> what it is
    "position": Turned("position", *POSITION_RANGE),
    "amplitude_mm": Turned("amplitude", 0.0, LARGEST_AMPLITUDE_MM),
    "width": Turned("width", *WIDTH_RANGE, logarithmic=True),
    "listen": Turned("listening point", 0.0, 1.0),
    "listen_right": Turned("right listening point", 0.0, 1.0),
    "seconds": Turned("duration", *SECONDS_RANGE),
    "speed": Turned("slow motion", *SPEED_RANGE, logarithmic=True),
    "volume_db": Turned("volume", *VOLUME_RANGE_DB),
}
TurnedField = Literal["position", "amplitude_mm", "width", "listen", "listen_right", "seconds", "speed", "volume_db"]
Controller = Annotated[int, Field(ge=0, le=LARGEST_VALUE)]


class MidiChoices(BaseModel):
    """What is remembered of MIDI.

    Attributes:
        port: the input's name; "": none.
        notes: whether a note says where the string is plucked, or which preset is.
        controllers: the number of the controller that turns a field; a field that was taught none is absent.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    port: str = ""
    notes: NoteMode = "position"
    controllers: dict[TurnedField, Controller] = {}

    def learned(self, field: str, controller: int) -> MidiChoices:
        """With `controller` turning `field`, and nothing else any more."""
        others = {f: c for f, c in self.controllers.items() if f != field and c != controller}
        return MidiChoices.model_validate({**self.model_dump(), "controllers": {**others, field: controller}})

    def forgotten(self, field: str) -> MidiChoices:
        others = {f: c for f, c in self.controllers.items() if f != field}
        return self.model_copy(update={"controllers": others})


@dataclass(frozen=True)
class Note:
    """A key goes down; velocity 1 … 127."""

    note: int
    velocity: int


@dataclass(frozen=True)
class Control:
    """A controller moves to 0 … 127."""

    controller: int
    value: int


Message = Note | Control


@dataclass(frozen=True)
class Meaning:
    """New values of `Choices`, and whether the string is plucked then."""

    changes: dict[str, Any]
    plucks: bool = False


def read_message(message: Any) -> Message | None:
    """A message of mido's as one of ours; None for what the string does not answer: releases, clocks and others."""
    if message.type == "note_on" and message.velocity > 0:
        return Note(message.note, message.velocity)
    if message.type == "control_change":
        return Control(message.control, message.value)
    return None


def meaning_of(message: Message, choices: MidiChoices, reach: Reach, presets: list[str]) -> Meaning:
    """What a message asks for; a controller that was taught nothing asks for nothing."""
    if isinstance(message, Control):
        fields = [field for field, controller in choices.controllers.items() if controller == message.controller]
        return Meaning({field: TURNED[field].value(message.value) for field in fields})
    changes: dict[str, Any] = {"amplitude_mm": reach.amplitude_of(message.velocity)}
    if choices.notes == "position":
        changes["position"] = reach.place((message.note - LOWEST_NOTE) / (HIGHEST_NOTE - LOWEST_NOTE))
    elif presets:
        changes["preset"] = presets[(message.note - LOWEST_NOTE) % len(presets)]
    return Meaning(changes, plucks=True)
