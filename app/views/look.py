"""How the window looks, as chosen."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict


class Look(BaseModel):
    """The window's face and the size of everything in it; the size counts from the next start on."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    face: Literal["system", "dark", "light"] = "system"
    size_percent: Literal[100, 115, 125, 150] = 100
