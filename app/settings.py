"""What is remembered between two starts: one validated JSON file. A broken one is set aside, not fatal."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Literal

from platformdirs import user_config_path
from pydantic import BaseModel, ConfigDict, ValidationError

from app.session import Choices
from app.sound import Source
from engine.whole_file import whole_file


class BatchChoices(BaseModel):
    """The batch page's last state; lists as they were typed."""

    model_config = ConfigDict(extra="forbid")

    presets: tuple[str, ...] = ()
    positions: str = ""
    amplitudes: str = ""
    sources: tuple[Source, ...] = ("model",)
    folder: str = ""


class ExportChoices(BaseModel):
    """The export dialog's last state. rate_hz 0: the model's own rate; source "files": both, a file each."""

    model_config = ConfigDict(extra="forbid")

    folder: str = ""
    source: Literal["model", "truth", "difference", "both", "files"] = "model"
    rate_hz: int = 48_000
    bits: Literal["16", "24", "32f"] = "24"
    until_decayed: bool = True
    decay_db: float = 60.0
    longest_s: float = 30.0
    seconds: float = 4.0
    normalise: bool = False
    difference_gain_db: float = 20.0
    batch: BatchChoices = BatchChoices()


class DeviceChoice(BaseModel):
    """An output device by name and host API, never by index: indices drift."""

    model_config = ConfigDict(extra="forbid")

    name: str
    host_api: str


class Settings(BaseModel):
    """The whole file."""

    model_config = ConfigDict(extra="forbid")

    version: Literal[1] = 1
    choices: Choices = Choices()
    export: ExportChoices = ExportChoices()
    device: DeviceChoice | None = None
    favourites: tuple[str, ...] = ()  # names of presets
    window_geometry: str = ""  # Qt's, in base64


def settings_file() -> Path:
    """LEARNED_STRINGS_SETTINGS, else the platform's place for a user's configuration."""
    given = os.environ.get("LEARNED_STRINGS_SETTINGS")
    return Path(given) if given else user_config_path("learned-strings", appauthor=False) / "settings.json"


def load_settings(path: Path) -> tuple[Settings, str]:
    """The settings and a notice: empty, or why the defaults were taken and where the broken file went."""
    try:
        return Settings.model_validate_json(path.read_bytes()), ""
    except FileNotFoundError:
        return Settings(), ""
    except OSError as error:
        return Settings(), f"The settings {path} cannot be read ({error.strerror}); starting with defaults."
    except ValidationError as error:
        first = error.errors()[0]
        aside = path.with_suffix(".broken.json")
        try:
            path.replace(aside)
        except OSError:
            aside = path
        field = ".".join(map(str, first["loc"])) or "the file"
        return Settings(), f"The settings were not usable ({field}: {first['msg']}); set aside as {aside}."


def save_settings(path: Path, settings: Settings) -> None:
    """Writes whole or not at all. Raises OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as unfinished:
        unfinished.write_text(settings.model_dump_json(indent=2), encoding="utf-8")
