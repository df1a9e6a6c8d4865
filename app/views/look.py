"""The theme and the text size, as chosen."""

from __future__ import annotations

from typing import Literal

from pydantic import AliasChoices, Field

from app.shared.value import Value


class Look(Value):
    """Theme and size of text in percent. Settings of version 0.1 call the theme `face`."""

    theme: Literal["system", "dark", "light"] = Field("system", validation_alias=AliasChoices("theme", "face"))
    size_percent: Literal[100, 115, 125, 150] = 100
