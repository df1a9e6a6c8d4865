"""What MIDI messages mean for one string: notes pluck it, controllers set the fields that they are assigned to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator

from app.instrument.events import Controller, Event, NoteOn, fixed_function
from app.playing.keyboard import Reach
from app.session.choices import SECONDS_RANGE, SPEED_RANGE, VOLUME_RANGE_DB
from engine.pluck import LARGEST_AMPLITUDE_MM, POSITION_RANGE, WIDTH_RANGE

LOWEST_NOTE, HIGHEST_NOTE = 36, 96  # of a keyboard of 61 keys
LARGEST_VALUE = 127

NoteMode = Literal["pitch", "position", "preset"]


@dataclass(frozen=True)
class Turned:
    """What a controller can be assigned to: the label of a field of `Choices`, and its range in the field's unit."""

    label: str
    low: float
    high: float
    logarithmic: bool = False

    def value(self, controller_value: int) -> float:
        """The field's value for a controller at 0 … 127."""
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
ControllerNumber = Annotated[int, Field(ge=0, le=LARGEST_VALUE)]


class MidiChoices(BaseModel):
    """The MIDI settings, to be saved.

    Attributes:
        port: the input's name; "": none.
        notes: whether a note plays a pitch of the patch, sets the pluck position, or selects the preset.
        controllers: field -> number of the controller that is assigned to it; other fields are absent. Those with a
            function of their own are left out, which earlier versions let be assigned.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    port: str = ""
    notes: NoteMode = "pitch"
    controllers: dict[TurnedField, ControllerNumber] = {}

    @field_validator("controllers")
    @classmethod
    def _leave_fixed(cls, controllers: dict[TurnedField, ControllerNumber]) -> dict[TurnedField, ControllerNumber]:
        return {field: number for field, number in controllers.items() if not fixed_function(number)}

    def learned(self, field: str, controller: int) -> MidiChoices:
        """These choices with `controller`, which has no `fixed_function`, assigned to `field`, and to no other."""
        others = {f: c for f, c in self.controllers.items() if f != field and c != controller}
        return MidiChoices.model_validate({**self.model_dump(), "controllers": {**others, field: controller}})

    def forgotten(self, field: str) -> MidiChoices:
        """These choices with no controller assigned to `field`."""
        others = {f: c for f, c in self.controllers.items() if f != field}
        return self.model_copy(update={"controllers": others})


@dataclass(frozen=True)
class Meaning:
    """New values of `Choices`, and whether the string is then plucked."""

    changes: dict[str, Any]
    plucks: bool = False


def meaning_of(event: Event, choices: MidiChoices, reach: Reach, presets: list[str]) -> Meaning:
    """What an event means; for a controller that is not assigned, and for a release, nothing.

    `presets`: the names that notes select, in their order.
    """
    if isinstance(event, Controller):
        fields = [field for field, controller in choices.controllers.items() if controller == event.number]
        return Meaning({field: TURNED[field].value(event.value) for field in fields})
    if not isinstance(event, NoteOn):
        return Meaning({})
    changes: dict[str, Any] = {"amplitude_mm": reach.amplitude_of(event.velocity)}
    if choices.notes == "preset" and presets:
        changes["preset"] = presets[(event.key - LOWEST_NOTE) % len(presets)]
    elif choices.notes != "preset":
        changes["position"] = reach.place((event.key - LOWEST_NOTE) / (HIGHEST_NOTE - LOWEST_NOTE))
    return Meaning(changes, plucks=True)
