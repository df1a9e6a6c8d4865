"""The origin of a WAV or FLAC file, as JSON in its comment tag.

A pluck has all choices that its sound follows from (its recipe). A performance on an instrument has its notes in a
MIDI file.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from app.audio.sound_file import UnreadableSound, open_sound
from app.export.sound import LONGEST_S, check_sources
from app.export.wav import RATE_RANGE_HZ, WavSettings
from app.instruments.fields import Name, String
from app.instruments.instrument import Instrument
from app.instruments.library import list_instruments
from app.player.bodies import body_digest
from app.player.events import KEYS, NoteOn
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
from engine.values.ear import Ear, Pickup

Side = Annotated[float, Field(ge=-1, le=1)]


class RecipeError(LineError):
    """A file has no usable recipe. The message, one line, names the file, what is wrong and the remedy."""


class NoRecipe(RecipeError):
    """A sound file without a recipe: not exported by this program, or its tags were removed."""


class NotesElsewhere(RecipeError):
    """The error that a file was played on an instrument: its notes are in a MIDI file."""


class InstrumentSound(Value):
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
    program: str
    version: str
    instrument: str
    preset: str
    preset_sha256: str
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
        instrument = struck.instrument
        return cls(instrument=instrument.name, instrument_sha256=_digest(instrument), **asdict(struck.event))

    def found(self) -> tuple[Struck, bool]:
        """The instrument of that name with this key, and whether it is the same to the last value.

        Raises:
            ValueError: there is none.
        """
        for entry in list_instruments()[0]:
            if entry.instrument.name == self.instrument:
                event = NoteOn(**{field.name: getattr(self, field.name) for field in fields(NoteOn)})
                return Struck(entry.instrument, event), _digest(entry.instrument) == self.instrument_sha256
        raise ValueError(f"the instrument {self.instrument} is not here; get its file and add it")


def _digest(instrument: Instrument) -> str:
    content = instrument.model_dump_json() + body_digest(instrument.body.name)
    return hashlib.sha256(content.encode()).hexdigest()


class SoundRecipe(Value):
    """A `NoteSound` and its `WavSettings`, as a file has them; a field that is absent has its default.

    Attributes:
        preset_rate_hz: the rate at which the model played.
        string: the string that a preset of many played, with so many `modes`; None: the preset's own.
        horizon_s: the training horizon, past which the model extrapolates.
        full_scale_m: the displacement that is 0 dBFS, of a string alone.
        through: always null.
    """

    format: Literal[1] = 1
    program: str
    version: str
    preset: str
    preset_sha256: str
    pluck: Pluck
    listen: float = Field(ge=0, le=1)
    listen_right: float | None = Field(None, ge=0, le=1)
    pickup: Pickup = "displacement"
    seconds: float = Field(gt=0, le=LONGEST_S)
    decay_db: float | None = None
    source: Source
    difference_gain_db: float = 0.0
    preset_rate_hz: int = Field(ge=1, le=HIGHEST_RATE_HZ)
    horizon_s: float
    full_scale_m: float
    rate_hz: int = Field(ge=RATE_RANGE_HZ[0], le=RATE_RANGE_HZ[1])
    bits: Bits
    normalise: bool
    fade_out_s: float = Field(0.010, ge=0, le=LONGEST_S)
    level_match: bool = False
    string: String | None = None
    modes: int | None = Field(None, ge=1, le=SIZES["grid_points"][1])
    through: None = None
    struck: StruckKey | None = None

    @classmethod
    def of(cls, sound: NoteSound, preset: Preset, source: Source, settings: WavSettings) -> SoundRecipe:
        """The recipe of a sound that `preset` plays, and that is written with these settings.

        Raises:
            PresetError: the preset's file cannot be read any more.
        """
        info, ear = preset.info, sound.ear
        many = info.family is not None and sound.struck is None
        gain_db = settings.difference_gain_db if source == DIFFERENCE else 0.0
        return cls(
            program=PROGRAM,
            version=program_version(),
            preset=preset.name,
            preset_sha256=preset_digest(preset.path),
            pluck=sound.pluck,
            listen=ear.points[0],
            listen_right=ear.points[1] if len(ear.points) > 1 else None,
            pickup=ear.pickup,
            seconds=sound.seconds,
            source=source,
            preset_rate_hz=info.rate_hz,
            horizon_s=info.horizon_s,
            full_scale_m=FULL_SCALE_M,
            **asdict(replace(settings, rate_hz=settings.rate_hz or info.rate_hz, difference_gain_db=gain_db)),
            string=info.string if many else None,
            modes=info.modes if many else None,
            struck=None if sound.struck is None else StruckKey.of(sound.struck),
        )

    @model_validator(mode="after")
    def _check_settings(self) -> SoundRecipe:
        assert self.settings  # which checks their ranges
        return self

    @property
    def settings(self) -> WavSettings:
        """The settings of its file."""
        return WavSettings(**{field.name: getattr(self, field.name) for field in fields(WavSettings)})

    @property
    def points(self) -> tuple[float, ...]:
        """The listening points, one a channel."""
        return (self.listen,) if self.listen_right is None else (self.listen, self.listen_right)

    def sound(self, preset: Path, file: Path) -> NoteSound:
        """The sound that it describes, checked.

        Args:
            preset: the file that plays it.
            file: that has this recipe.

        Raises:
            RecipeError: values do not go together, or the instrument is not here.
        """
        string, rate_hz = self.string, self.preset_rate_hz
        subject = preset if string is None else StringOf(preset, string, rate_hz, self.modes)
        try:
            struck = None if self.struck is None else self.struck.found()[0]
            sound = NoteSound(subject, self.pluck, self.seconds, Ear(self.points, self.pickup), struck=struck)
            check_sources(sound, (self.source,), sound.load().info.rate_hz)
        except ValueError as error:
            raise _unusable_error(file, str(error)) from error
        return sound


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
    """The preset file of a sound, found by content, else by name, and whether its content is the same.

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
    struck = recipe.struck
    others = {"the preset " + recipe.preset: exact}
    if struck is not None:
        others["the instrument " + struck.instrument] = struck.found()[1]
    return [
        f"{name} is not the one that made this file (another version of it): the sound differs"
        for name, same in others.items()
        if not same
    ]
