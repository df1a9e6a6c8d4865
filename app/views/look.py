"""The theme and the UI scale, as chosen."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict


class Look(BaseModel):
    """`face` is the theme; `size_percent`, the UI scale, takes effect at the next start."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    face: Literal["system", "dark", "light"] = "system"
    size_percent: Literal[100, 115, 125, 150] = 100
