"""What MIDI messages mean for one string: notes pluck it, controllers set the fields that they are assigned to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, field_validator

from app.instrument.events import Controller, Event, NoteOn, fixed_function
from app.playing.keyboard import Reach
from app.shared.parameters import OF_CHOICES

LOWEST_NOTE, HIGHEST_NOTE = 36, 96  # of a keyboard of 61 keys
LARGEST_VALUE = 127

NoteMode = Literal["pitch", "position", "preset"]


TURNED = tuple(field for field, parameter in OF_CHOICES.items() if parameter.allows("learn"))
ControllerNumber = Annotated[int, Field(ge=0, le=LARGEST_VALUE)]


def _learnable(field: str) -> str:
    if field not in TURNED:
        raise ValueError(f"is no field that a controller can turn; try {', '.join(TURNED)}")
    return field


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
    controllers: dict[Annotated[str, AfterValidator(_learnable)], ControllerNumber] = {}

    @field_validator("controllers")
    @classmethod
    def _leave_fixed(cls, controllers: dict[str, int]) -> dict[str, int]:
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
        return Meaning({field: OF_CHOICES[field].value(event.value / LARGEST_VALUE) for field in fields})
    if not isinstance(event, NoteOn):
        return Meaning({})
    changes: dict[str, Any] = {"amplitude_mm": reach.amplitude_of(event.velocity)}
    if choices.notes == "preset" and presets:
        changes["preset"] = presets[(event.key - LOWEST_NOTE) % len(presets)]
    elif choices.notes != "preset":
        changes["position"] = reach.place((event.key - LOWEST_NOTE) / (HIGHEST_NOTE - LOWEST_NOTE))
    return Meaning(changes, plucks=True)
