"""The instrument that is played: a patch, whose keys are pitches, or a string, whose keys are places along it."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Discriminator, Tag

from app.patches.patch import Patch
from app.shared.value import Value


class SingleString(Value):
    """A preset that is plucked at places along its string, which rings until it is silent.

    Attributes:
        preset: the name of its file without the suffix; "": none.
    """

    preset: str = ""


PATCH, SINGLE = "Patch", "SingleString"  # in the paths of faults


def _kind(value: Any) -> str:
    more = value.keys() - {"preset"} if isinstance(value, dict) else isinstance(value, Patch)
    return PATCH if more else SINGLE


Instrument = Annotated[
    Annotated[Patch, Tag(PATCH)] | Annotated[SingleString, Tag(SINGLE)],
    Discriminator(_kind),
]
