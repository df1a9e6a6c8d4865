"""The MIDI settings, and what the controllers that are assigned turn."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, field_validator

from app.instruments.instrument import Instrument
from app.player.events import ControlChange, fixed_function
from app.shared.parameters import LEARNABLE, MACROS, OF_CHOICES
from app.shared.value import Value

LARGEST_VALUE = 127

NoteMode = Literal["pitch", "position", "preset"]


ControllerNumber = Annotated[int, Field(ge=0, le=LARGEST_VALUE)]


def _learnable(field: str) -> str:
    if field not in LEARNABLE:
        raise ValueError(f"is no field that a controller can turn; try {', '.join(LEARNABLE)}")
    return field


class MidiChoices(Value):
    """The MIDI settings, to be saved.

    Attributes:
        port: the input's name; "": none.
        notes: whether a note plays a key of the instrument, sets the pluck position, or selects the preset.
        controllers: field -> number of the controller that is assigned to it; other fields are absent. Those with a
            function of their own are left out, which earlier versions let be assigned.
    """

    port: str = ""
    notes: NoteMode = "pitch"
    controllers: dict[Annotated[str, AfterValidator(_learnable)], ControllerNumber] = Field(default_factory=dict)

    @field_validator("controllers")
    @classmethod
    def _leave_fixed(cls, controllers: dict[str, int]) -> dict[str, int]:
        return {field: number for field, number in controllers.items() if not fixed_function(number)}

    def learned(self, field: str, controller: int) -> MidiChoices:
        """Copy these choices with `controller`, which has no `fixed_function`, assigned to `field` alone."""
        others = {f: c for f, c in self.controllers.items() if f != field and c != controller}
        return MidiChoices.model_validate({**self.model_dump(), "controllers": {**others, field: controller}})

    def forgotten(self, field: str) -> MidiChoices:
        """Copy these choices with no controller assigned to `field`."""
        others = {f: c for f, c in self.controllers.items() if f != field}
        return self.model_copy(update={"controllers": others})


def turned(instrument: Instrument, field: str, value: float) -> Instrument:
    """The instrument with a parameter or a macro turned.

    Where it has none, or the value is impossible in it, the instrument stays as it is.
    """
    try:
        if field in MACROS:
            number = list(MACROS).index(field)
            return instrument.turned(number, value) if number < len(instrument.macros) else instrument
        return instrument.with_knob(field, value)
    except ValueError:
        return instrument


def turns_of(event: ControlChange, choices: MidiChoices, instrument: Instrument | None) -> dict[str, Any]:
    """New values for `Choices.changed`, of all that a controller is assigned to.

    Args:
        instrument: whose parameters and macros it turns; None: it turns none of them.
    """
    turns: dict[str, Any] = {}
    for field, controller in choices.controllers.items():
        if controller != event.number:
            continue
        value = LEARNABLE[field].value(event.value / LARGEST_VALUE)
        if field in OF_CHOICES:
            turns[field] = value
        elif instrument is not None:
            turns["instrument"] = instrument = turned(instrument, field, value)
    return turns
