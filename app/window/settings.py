"""The settings that are remembered between two starts: one validated JSON file.

A broken one is set aside, not fatal; where only some fields are wrong, the others are kept.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Literal

from platformdirs import user_config_path
from pydantic import ValidationError

from app.analysis.abx.trials import AbxChoices
from app.audio.choices import DeviceChoice, SoundChoice
from app.export.choices import ExportChoices
from app.export.sampled.choices import SampledChoices
from app.player.events import Meter
from app.playing.midi import MidiChoices
from app.session.choices import Choices, migrated
from app.shared.value import Value
from app.views.file_places import FileChoices
from app.views.look import Look
from engine import bounds
from engine.plain_text import one_line
from engine.schema import SchemaError, explained, parse_json
from engine.whole_file import read_bounded, whole_file

# at the top of the browser at a first start: strings at full bandwidth, trained on plucks anywhere
MOST_FAULTS = 50  # of a file that is kept for the rest of it
FIRST_FAVOURITES = ("studio_any_string", "studio_nylon_b3", "studio_nylon_g3", "studio_steel_e4", "studio_steel_ds3")


class InstrumentChoice(Value):
    """The look of the instrument's strip: in the Lab too, as keys or strings, with the string's knobs."""

    shown: bool = False
    surface: Literal["keys", "neck"] = "keys"
    unfolded: bool = False


class Settings(Value):
    """The content of the file."""

    version: Literal[1] = 1
    choices: Choices = Choices()
    export: ExportChoices = ExportChoices()
    sampled: SampledChoices = SampledChoices()
    abx: AbxChoices = AbxChoices()
    files: FileChoices = FileChoices()
    record: Meter = Meter()
    device: DeviceChoice | None = None
    sound: SoundChoice = SoundChoice()
    look: Look = Look()
    midi: MidiChoices = MidiChoices()
    favourites: tuple[str, ...] = FIRST_FAVOURITES  # names of presets
    instrument_favourites: tuple[str, ...] = ()  # names of their files
    instrument: InstrumentChoice = InstrumentChoice()
    window_geometry: str = ""  # Qt's, in base64


def settings_file() -> Path:
    """LEARNED_STRINGS_SETTINGS, else the platform's place for a user's configuration."""
    path = os.environ.get("LEARNED_STRINGS_SETTINGS")
    return Path(path) if path else user_config_path("learned-strings", appauthor=False) / "settings.json"


def load_settings(path: Path) -> tuple[Settings, str]:
    """The settings and a notice: empty, or what was not usable and where the broken file went."""
    try:
        text = read_bounded(path, bounds.LARGEST_TEXT_BYTES)
    except FileNotFoundError:
        return Settings(), ""
    except OSError as error:
        reason = error.strerror or error
        return Settings(), one_line(f"The settings {path} cannot be read ({reason}); starting with defaults.")
    try:
        return Settings.model_validate(_migrated(parse_json(text, "the file"))), ""
    except (ValueError, OverflowError) as error:  # the latter of integers where numbers belong
        aside = path.with_suffix(".broken.json")
        try:
            path.replace(aside)
        except OSError:
            aside = path
        usable = _usable_settings(text) if isinstance(error, ValidationError) else None
        why = explained(error) if isinstance(error, ValueError) else str(error)
        reason = (
            f"{'Some' if usable else 'The'} settings were not usable ({why}) and have their defaults "
            f"again; the file was set aside as {aside}."
        )
        return usable or Settings(), one_line(reason)


def _migrated(data: Any) -> Any:
    """The content of the file under the names of today, so that a fault is found under them."""
    if isinstance(data, dict):
        if "patch_favourites" in data:
            data["instrument_favourites"] = data.pop("patch_favourites")
        if isinstance(data.get("choices"), dict):
            data["choices"] = migrated(data["choices"])
    return data


def _usable_settings(text: bytes) -> Settings | None:
    """The settings less what is wrong in them; None where nothing is left to keep.

    One fault at a time: what is dropped for one may end others, or lack in what holds it.
    """
    try:
        data: dict[str, Any] = _migrated(parse_json(text, "settings"))
        for _ in range(MOST_FAULTS):
            try:
                return Settings.model_validate(data)
            except ValidationError as error:
                location = error.errors(include_url=False, include_input=False)[0]["loc"]
                path = [str(part) for part in location]
            if path[:1] in ([], ["version"]):  # no settings, or those of another version
                return None
            _drop(data, path)
    except (SchemaError, OverflowError):
        pass
    return None


def _drop(data: dict[str, Any], field: list[str]) -> None:
    """Remove the value at a path of keys; where a necessary key is missing, the object that lacks it."""
    key, *rest = field
    inner = data.get(key)
    if rest and isinstance(inner, dict) and rest[0] in inner:
        _drop(inner, rest)
    else:
        data.pop(key, None)


def save_settings(path: Path, settings: Settings) -> None:
    """Write whole or not at all. Raises OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as unfinished, unfinished.open("wb") as file:
        file.write(settings.model_dump_json(indent=2).encode())
        file.flush()
        os.fsync(file.fileno())  # or a loss of power may leave an empty file of this name
