"""The origin of a WAV file, as JSON in its comment tag.

A pluck has all choices that its sound follows from (its recipe). A performance on an instrument has its notes in a
MIDI file.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Literal

from pydantic import Field

from app.audio.sound_file import UnreadableSound, open_sound
from app.export.sound import LONGEST_S, SoundRequest
from app.export.struck import StruckKey
from app.export.wav import RATE_RANGE_HZ, WavSettings
from app.patches.fields import String
from app.shared.value import Value
from app.shared.version import PROGRAM, program_version
from app.shared.vocabulary import DIFFERENCE, Bits, PlayedSource, Source
from engine.bounds import HIGHEST_RATE_HZ, SIZES
from engine.levels import FULL_SCALE_M
from engine.plain_text import LineError, name_text
from engine.pluck import Pluck
from engine.presets import Preset, PresetError, of_string, preset_digest
from engine.schema import explained, parse_json
from engine.values.ear import Pickup

# fields of `SoundRequest`
REQUESTED = ("pluck", "listen", "listen_right", "pickup", "seconds", "decay_db", "source")


class RecipeError(LineError):
    """A file has no usable recipe. The message, one line, names the file, what is wrong and the remedy."""


class NoRecipe(RecipeError):
    """A sound file without a recipe: not exported by this program, or its tags were removed."""


class NotesElsewhere(RecipeError):
    """The error that a file was played on an instrument: its notes are in a MIDI file."""


class InstrumentSound(Value):
    """A performance on an instrument: recorded in the window, or rendered from a MIDI file.

    Attributes:
        instrument: the name of the patch, of a recording the one with which it began.
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


class SoundRecipe(Value):
    """Fields as in `SoundRequest` and `WavSettings`; a field that is absent has its default.

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
    string: String | None = None
    modes: int | None = Field(None, ge=1, le=SIZES["grid_points"][1])
    through: None = None
    struck: StruckKey | None = None

    @classmethod
    def of(cls, request: SoundRequest, settings: WavSettings) -> SoundRecipe:
        """The recipe of a request that is written with these settings.

        Raises:
            PresetError: the preset's file cannot be read any more.
        """
        info = request.preset.info
        many = info.family is not None and request.struck is None
        return cls(
            program=PROGRAM,
            version=program_version(),
            preset=request.preset.name,
            preset_sha256=preset_digest(request.preset.path),
            **{name: getattr(request, name) for name in REQUESTED},
            difference_gain_db=request.difference_gain_db if request.source == "difference" else 0.0,
            preset_rate_hz=info.rate_hz,
            horizon_s=info.horizon_s,
            full_scale_m=FULL_SCALE_M,
            rate_hz=settings.rate_hz or info.rate_hz,
            bits=settings.bits,
            normalise=settings.normalise,
            fade_out_s=settings.fade_out_s,
            string=info.string if many else None,
            modes=info.modes if many else None,
            struck=None if request.struck is None else StruckKey.of(request.struck),
        )

    @property
    def settings(self) -> WavSettings:
        return WavSettings(self.bits, self.rate_hz, self.normalise, self.fade_out_s)


def read_origin(path: Path) -> SoundRecipe | InstrumentSound:
    """Read the origin that a WAV file carries.

    Raises:
        NoRecipe: it is a sound file without that.
        RecipeError: the file is missing or no sound file, or what it carries is damaged or of a newer version.
    """
    try:
        with open_sound(path) as file:
            text = file.comment
    except UnreadableSound as error:
        raise RecipeError(
            f"{path}: no sound file that can be read ({error}); give a WAV that was exported"
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
    """The recipe that a WAV file carries.

    Raises:
        NotesElsewhere: it was played on an instrument.
        NoRecipe, RecipeError: as `read_origin`.
    """
    origin = read_origin(path)
    if isinstance(origin, InstrumentSound):
        raise NotesElsewhere(
            f"{path}: is {origin.words}. It has no recipe to render again:"
            f" its notes are in the MIDI file {origin.midi}, beside it unless it was moved"
        )
    return origin


def request_of(recipe: SoundRecipe, preset: Preset, path: Path) -> SoundRequest:
    """The request that renders the sound of the file at `path` again.

    Args:
        preset: as loaded from its file; if it is of many strings, the recipe's string is chosen here.

    Raises:
        RecipeError: values do not go together, or the instrument is not here.
    """
    try:
        if recipe.string is not None:
            preset = of_string(preset, recipe.string, recipe.preset_rate_hz, recipe.modes)
        requested = {name: getattr(recipe, name) for name in REQUESTED}
        struck = None if recipe.struck is None else recipe.struck.found()[0]
        return SoundRequest(preset, **requested, difference_gain_db=recipe.difference_gain_db, struck=struck)
    except ValueError as error:
        raise _unusable_error(path, str(error)) from error


def _unusable_error(path: Path, why: str) -> RecipeError:
    return RecipeError(
        f"{path}: its recipe cannot be used ({why}); it is damaged, of another program, or of a newer version"
    )


def preset_of(recipe: SoundRecipe | InstrumentSound, presets: Iterable[Path]) -> tuple[Path, bool]:
    """The preset file of a WAV, found by content, else by name, and whether its content is the same.

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
