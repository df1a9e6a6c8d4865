"""What is remembered between two starts: one validated JSON file.

A broken one is set aside, not fatal; where only some fields are wrong, the others are kept.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any, Literal

from platformdirs import user_config_path
from pydantic import BaseModel, ConfigDict, ValidationError

from app.analysis.abx.choices import AbxChoices
from app.audio.choices import DeviceChoice, SoundChoice
from app.export.choices import ExportChoices
from app.playing.midi import MidiChoices
from app.session.choices import Choices
from app.views.look import Look
from engine.whole_file import whole_file

# what a first start finds at the top: strings at full bandwidth, plucked anywhere
FIRST_FAVOURITES = ("studio_any_string", "studio_nylon_b3", "studio_nylon_g3", "studio_steel_e4", "studio_steel_ds3")


class Settings(BaseModel):
    """The whole file."""

    model_config = ConfigDict(extra="forbid")

    version: Literal[1] = 1
    choices: Choices = Choices()
    export: ExportChoices = ExportChoices()
    abx: AbxChoices = AbxChoices()
    device: DeviceChoice | None = None
    sound: SoundChoice = SoundChoice()
    look: Look = Look()
    midi: MidiChoices = MidiChoices()
    favourites: tuple[str, ...] = FIRST_FAVOURITES  # names of presets
    window_geometry: str = ""  # Qt's, in base64


def settings_file() -> Path:
    """LEARNED_STRINGS_SETTINGS, else the platform's place for a user's configuration."""
    given = os.environ.get("LEARNED_STRINGS_SETTINGS")
    return Path(given) if given else user_config_path("learned-strings", appauthor=False) / "settings.json"


def load_settings(path: Path) -> tuple[Settings, str]:
    """The settings and a notice: empty, or what was not usable and where the broken file went."""
    try:
        text = path.read_bytes()
    except FileNotFoundError:
        return Settings(), ""
    except OSError as error:
        return Settings(), f"The settings {path} cannot be read ({error.strerror}); starting with defaults."
    try:
        return Settings.model_validate_json(text), ""
    except ValidationError as error:
        first = error.errors()[0]
        aside = path.with_suffix(".broken.json")
        try:
            path.replace(aside)
        except OSError:
            aside = path
        field = ".".join(map(str, first["loc"])) or "the file"
        kept = _without(text, error)
        return (
            kept or Settings(),
            f"{'Some' if kept else 'The'} settings were not usable ({field}: {first['msg']}) and have their defaults "
            f"again; the file was set aside as {aside}.",
        )


def _without(text: bytes, error: ValidationError) -> Settings | None:
    """The settings less the fields that `error` names; None where nothing is left to keep."""
    fields = [[str(part) for part in fault["loc"]] for fault in error.errors()]
    if any(field[:1] in ([], ["version"]) for field in fields):  # no settings, or those of another version
        return None
    data: dict[str, Any] = json.loads(text)
    for field in fields:
        _drop(data, field)
    try:
        return Settings.model_validate(data)
    except ValidationError:
        return None


def _drop(data: dict[str, Any], field: list[str]) -> None:
    """Takes the value at a path of keys out; what lacks a necessary key goes as a whole."""
    key, *rest = field
    inner = data.get(key)
    if rest and isinstance(inner, dict) and rest[0] in inner:
        _drop(inner, rest)
    else:
        data.pop(key, None)


def save_settings(path: Path, settings: Settings) -> None:
    """Writes whole or not at all. Raises OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as unfinished:
        unfinished.write_text(settings.model_dump_json(indent=2), encoding="utf-8")
