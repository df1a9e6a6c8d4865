"""A key of an instrument, struck and held, and how a file names it."""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass, fields
from typing import Annotated

from pydantic import Field

from app.instrument.bodies import body_digest
from app.instrument.events import KEYS, NoteOn
from app.patches.drums import Drums
from app.patches.fields import Name
from app.patches.library import list_patches
from app.patches.patch import Patch
from app.shared.key_names import note_name
from app.shared.value import Value
from engine.pluck import Pluck

Side = Annotated[float, Field(ge=-1, le=1)]


class StruckKey(Value):
    """Names the instrument, as the library has it, and says how its key is struck.

    Attributes:
        instrument_sha256: of its content and of the file of its body.
        channel: of MIDI, which chooses the string of a guitar; `KEYS`: none.
        place, pluck: of a drum and of a string, as in `NoteOn`.
    """

    instrument: Name
    instrument_sha256: str
    key: int = Field(ge=0, le=127)
    velocity: int = Field(ge=1, le=127)
    channel: int = Field(KEYS, ge=0, le=KEYS)
    place: tuple[Side, Side] | None = None
    string: int | None = Field(None, ge=0, le=127)
    pluck: Pluck | None = None

    @classmethod
    def of(cls, struck: Struck) -> StruckKey:
        patch = struck.patch
        return cls(instrument=patch.name, instrument_sha256=_digest(patch), **asdict(struck.event))

    def found(self) -> tuple[Struck, bool]:
        """The instrument of that name with this key, and whether it is the same to the last value.

        Raises:
            ValueError: there is none.
        """
        for entry in list_patches()[0]:
            if entry.patch.name == self.instrument:
                event = NoteOn(**{field.name: getattr(self, field.name) for field in fields(NoteOn)})
                return Struck(entry.patch, event), _digest(entry.patch) == self.instrument_sha256
        raise ValueError(f"the instrument {self.instrument} is not here; get its file and add it")


def _digest(patch: Patch) -> str:
    content = patch.model_dump_json() + body_digest(patch.body.name)
    return hashlib.sha256(content.encode()).hexdigest()


@dataclass(frozen=True)
class Struck:
    """A key of an instrument, held."""

    patch: Patch
    event: NoteOn

    @property
    def of_drum(self) -> bool:
        return isinstance(self.patch.strings, Drums)

    @property
    def words(self) -> str:
        """The description for people."""
        stroke = f"at velocity {self.event.velocity}" if self.event.pluck is None else "plucked by hand"
        return f"{self.patch.name}, {note_name(self.event.key)} {stroke}"
