"""The origin of a WAV or FLAC file, as JSON in its comment tag.

A pluck has all choices that its sound follows from (its recipe). A performance on an instrument has its notes in a
MIDI file.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, model_validator

from app.audio.sound_file import UnreadableSound, open_sound
from app.export.sound import check_sources
from app.export.wav import LONGEST_S, RATE_RANGE_HZ, WavSettings
from app.instruments.fields import Name, String
from app.instruments.instrument import Instrument
from app.instruments.library import list_instruments
from app.player.bodies import body_digest
from app.player.events import NoteOn
from app.rendering.note_sound import NoteSound, Struck
from app.rendering.subject import StringOf
from app.shared.value import Value
from app.shared.version import PROGRAM, program_version
from app.shared.vocabulary import DIFFERENCE, Bits, PlayedSource, Source
from engine.bounds import HIGHEST_RATE_HZ, SIZES
from engine.levels import FULL_SCALE_M
from engine.plain_text import LineError, name_text
from engine.pluck import Pluck
from engine.presets import Preset, PresetError, preset_digest
from engine.schema import explained, parse_json
from engine.values.ear import Ear


class RecipeError(LineError):
    """A file has no usable recipe. The message, one line, names the file, what is wrong and the remedy."""


class NoRecipe(RecipeError):
    """A sound file without a recipe: not exported by this program, or its tags were removed."""


class NotesElsewhere(RecipeError):
    """The error that a file was played on an instrument: its notes are in a MIDI file."""


class Origin(Value):
    """The program and the preset that made a sound file."""

    program: str
    version: str
    preset: str
    preset_sha256: str

    @staticmethod
    def of_preset(preset: Preset) -> dict[str, Any]:
        """These fields of what this program makes of a preset.

        Raises:
            PresetError: its file cannot be read any more.
        """
        return {
            "program": PROGRAM,
            "version": program_version(),
            "preset": preset.name,
            "preset_sha256": preset_digest(preset.path),
        }


class InstrumentSound(Origin):
    """A performance on an instrument: recorded in the window, or rendered from a MIDI file.

    Attributes:
        instrument: its name, of a recording the one with which it began; of several, all.
        preset: that plays it, of several the first one's.
        source: that is heard.
        difference_gain_db: the gain of the difference.
        midi: the name of the MIDI file with the notes.
        recorded: when the recording began, in ISO 8601; None: it is none.
    """

    format: Literal[1] = 1
    kind: Literal["instrument"] = "instrument"
    instrument: str
    source: PlayedSource
    difference_gain_db: float = 0.0
    rate_hz: int = Field(ge=RATE_RANGE_HZ[0], le=RATE_RANGE_HZ[1])
    bits: Bits
    midi: str
    recorded: str | None = None

    @property
    def words(self) -> str:
        """The description for people."""
        what, when = ("rendering", "") if self.recorded is None else ("recording", f", {self.recorded[:10]}")
        return f"a {what} of {self.instrument} ({source_words(self.source, self.difference_gain_db)}{when})"


def source_words(source: str, difference_gain_db: float) -> str:
    """The source of what was played, for people."""
    if source != DIFFERENCE:
        return f"the {source}"
    return f"the difference of model and truth at {difference_gain_db:+g} dB"


def fields_of(sound: NoteSound) -> dict[str, Any]:
    """The fields of `SoundRecipe` that say what sounds, without preset and string; with all modes."""
    fields = {"pluck": sound.pluck, "ear": replace(sound.ear, solo=0), "seconds": sound.seconds}
    if (struck := sound.struck) is None:
        return fields
    digest = _digest(struck.instrument)
    return {**fields, "instrument": struck.instrument.name, "instrument_sha256": digest, "event": struck.event}


def _digest(instrument: Instrument) -> str:
    """The SHA-256 of an instrument's content and of the file of its body."""
    content = instrument.model_dump_json() + body_digest(instrument.body.name)
    return hashlib.sha256(content.encode()).hexdigest()


class SoundRecipe(Origin):
    """A `NoteSound` and its `WavSettings`, as a file has them; a field that is absent has its default.

    Attributes:
        string: the string that a preset of many played, with so many `modes`; None: the preset's own.
        event: how a key of `instrument` is struck, which is named as the library has it; None: no instrument plays.
        preset_rate_hz: the rate at which the model played.
        horizon_s: the training horizon, past which the model extrapolates.
        full_scale_m: the displacement that is 0 dBFS, of a string alone.
    """

    format: Literal[2] = 2
    pluck: Pluck
    ear: Ear
    seconds: float = Field(gt=0, le=LONGEST_S)
    string: String | None = None
    modes: int | None = Field(None, ge=1, le=SIZES["grid_points"][1])
    instrument: Name | None = None
    instrument_sha256: str = ""
    event: NoteOn | None = None
    source: Source
    settings: WavSettings
    preset_rate_hz: int = Field(ge=1, le=HIGHEST_RATE_HZ)
    horizon_s: float
    full_scale_m: float

    @classmethod
    def of(cls, sound: NoteSound, preset: Preset, source: Source, settings: WavSettings) -> SoundRecipe:
        """The recipe of a sound that `preset` plays, and that is written with these settings.

        Raises:
            PresetError: the preset's file cannot be read any more.
        """
        info, gain_db = preset.info, settings.difference_gain_db if source == DIFFERENCE else 0.0
        many = info.family is not None and sound.struck is None
        return cls(
            **cls.of_preset(preset),
            **fields_of(sound),
            string=info.string if many else None,
            modes=info.modes if many else None,
            source=source,
            settings=replace(settings, rate_hz=settings.rate_hz or info.rate_hz, difference_gain_db=gain_db),
            preset_rate_hz=info.rate_hz,
            horizon_s=info.horizon_s,
            full_scale_m=FULL_SCALE_M,
        )

    @model_validator(mode="before")
    @classmethod
    def _take_old(cls, data: Any) -> Any:
        return _composed(data) if isinstance(data, dict) and data.get("format") == 1 else data

    def find_instrument(self) -> tuple[Instrument, bool]:
        """The instrument named by this recipe, and True if it has not changed since, to the last value.

        Raises:
            ValueError: there is none.
        """
        for entry in list_instruments()[0]:
            if entry.instrument.name == self.instrument:
                return entry.instrument, _digest(entry.instrument) == self.instrument_sha256
        raise ValueError(f"the instrument {self.instrument} is not here; get its file and add it")

    def sound(self, preset: Path, file: Path) -> NoteSound:
        """The sound that it describes, checked.

        Args:
            preset: the file that plays it.
            file: that has this recipe.

        Raises:
            RecipeError: values do not go together, or the instrument is not here.
        """
        subject = preset if self.string is None else StringOf(preset, self.string, self.preset_rate_hz, self.modes)
        try:
            if self.event is not None and self.event.velocity == 0:
                raise ValueError("event: velocity 0 strikes no key; it must lie in 1 … 127")
            struck = None if self.event is None else Struck(self.find_instrument()[0], self.event)
            sound = NoteSound(subject, self.pluck, self.seconds, replace(self.ear, solo=0), struck=struck)
            check_sources(sound, (self.source,), sound.load().info.rate_hz)
        except ValueError as error:
            raise _unusable_error(file, str(error)) from error
        return sound


def _composed(data: dict[str, Any]) -> dict[str, Any]:
    """The fields of a recipe of format 1, which had those of ear and settings itself, and `struck` for the key."""
    data = {name: value for name, value in data.items() if name != "through"}
    points = [data.pop(name, None) for name in ("listen", "listen_right")]
    ear = {"points": [point for point in points if point is not None], "pickup": data.pop("pickup", "displacement")}
    settings = {field.name: data.pop(field.name) for field in fields(WavSettings) if field.name in data}
    data |= {"format": 2, "ear": ear, "settings": settings}
    if isinstance(event := data.pop("struck", None), dict):
        names = ("instrument", "instrument_sha256")
        data |= {name: event[name] for name in names if name in event}
        event = {name: value for name, value in event.items() if name not in names}
    return {**data, "event": event}


def read_origin(path: Path) -> SoundRecipe | InstrumentSound:
    """Read the origin that a sound file carries.

    Raises:
        NoRecipe: it is a sound file without that.
        RecipeError: the file is missing or no sound file, or what it carries is damaged or of a newer version.
    """
    try:
        with open_sound(path) as file:
            text = file.comment
    except UnreadableSound as error:
        raise RecipeError(
            f"{path}: no sound file that can be read ({error}); give a WAV or FLAC that was exported"
        ) from error
    if not text.lstrip().startswith("{"):
        raise NoRecipe(
            f"{path}: has no recipe; it was not exported by {PROGRAM}, or another program has removed its tags"
        )
    try:
        data = parse_json(text, "the text")
        on_instrument = isinstance(data, dict) and "kind" in data
        return InstrumentSound.model_validate(data) if on_instrument else SoundRecipe.model_validate(data)
    except ValueError as error:
        raise _unusable_error(path, explained(error)) from error
    except OverflowError as error:  # raised for numbers that are too long
        raise _unusable_error(path, str(error)) from error


def read_recipe(path: Path) -> SoundRecipe:
    """The recipe that a sound file carries.

    Raises:
        NotesElsewhere: it was played on an instrument.
        NoRecipe, RecipeError: as `read_origin`.
    """
    origin = read_origin(path)
    if isinstance(origin, InstrumentSound):
        raise NotesElsewhere(
            f"{path}: is {origin.words}. It has no recipe to render again:"
            f" its notes are in the MIDI file {origin.midi}, beside it unless it was moved or renamed"
        )
    return origin


def _unusable_error(path: Path, why: str) -> RecipeError:
    return RecipeError(
        f"{path}: its recipe cannot be used ({why}); it is damaged, of another program, or of a newer version"
    )


def preset_of(recipe: SoundRecipe | InstrumentSound, presets: Iterable[Path]) -> tuple[Path, bool]:
    """The preset file of a sound, found by content, else by name; and True if it was found by content.

    Raises:
        RecipeError: there is none.
    """
    paths = list(presets)
    for path in paths:
        try:
            if preset_digest(path) == recipe.preset_sha256:
                return path, True
        except PresetError:
            continue  # the list of presets reports those that cannot be read
    for path in paths:
        if name_text(path.stem) == recipe.preset:
            return path, False
    raise RecipeError(
        f"the preset {recipe.preset} of this recipe is not here; get its file and add it, then try again"
    )


def changed_notices(recipe: SoundRecipe, exact: bool) -> list[str]:
    """Warnings for a preset and an instrument that were found by their names alone.

    Args:
        exact: whether the preset is the same.

    Raises:
        ValueError: the instrument is not here.
    """
    others = {f"the preset {recipe.preset}": exact}
    if recipe.event is not None:
        others[f"the instrument {recipe.instrument}"] = recipe.find_instrument()[1]
    return [
        f"{name} is not the one that made this file (another version of it): the sound differs"
        for name, same in others.items()
        if not same
    ]
