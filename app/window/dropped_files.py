"""The meaning of a dropped file: a preset is installed, the recipe of an exported sound restored.

Another sound is a string or a body.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from app.audio.impulse_file import LONGEST_FILE_S, ImpulseError, cut_words
from app.audio.note_file import NOTE_LENGTHS_S
from app.audio.sound_file import UnreadableSound, open_sound
from app.export.recipe import NoRecipe, RecipeError, SoundRecipe, changed_notices, preset_of, read_recipe
from app.instruments.instrument import Pickup
from app.player.bodies import ENDINGS, install_body
from app.presets.install import SUFFIX, install_preset
from app.presets.library import Library
from app.shared.parameters import OF_CHOICES
from app.shared.vocabulary import WRITTEN_ENDINGS
from engine.folders import user_folder
from engine.plain_text import name_text
from engine.presets import PresetError
from engine.whole_file import WriteError

SOUNDS = (*ENDINGS, ".ogg", ".oga", ".opus")


@dataclass(frozen=True)
class Dropped:
    """The results of a dropped file: new values of `Choices`, a notice for the user, a body for the instrument.

    Attributes:
        notice: "" for none.
        body: its name; "" for none.
        sound: it is a string or a body, and the user chooses.
    """

    choices: dict[str, Any] = field(default_factory=dict)
    notice: str = ""
    body: str = ""
    sound: bool = False


def receive(file: Path, library: Library) -> Dropped:
    """Take a dropped file: a preset is in the library afterwards. Errors become notices."""
    ending = file.suffix.lower()
    try:
        if ending == SUFFIX:
            return _preset(file, library)
        if ending in WRITTEN_ENDINGS:
            return _drop_recipe(file, library)
        if ending in SOUNDS:
            return _other_sound(file)
    except NoRecipe:
        return _other_sound(file)
    except (PresetError, RecipeError, WriteError) as error:
        return Dropped(notice=str(error))
    kinds = f"a preset ({SUFFIX}), an instrument, a string, a scale, a MIDI file, an exported sound, a note, a body"
    return Dropped(notice=f"{file}: not a file that is used here; drop one of these: {kinds}")


def _other_sound(file: Path) -> Dropped:
    """A sound as long as a note may be a string; any other is a body."""
    try:
        with open_sound(file) as sound:
            seconds = sound.frames / sound.samplerate
    except UnreadableSound:
        seconds = 0.0
    shortest_s, longest_s = NOTE_LENGTHS_S
    if seconds > longest_s:
        lengths = f"a note of at most {longest_s:g} s, or a body's response of at most {LONGEST_FILE_S:g} s"
        return Dropped(notice=f"{file}: lasts {seconds:.0f} s; cut out {lengths}, and drop that")
    return Dropped(sound=True) if shortest_s <= seconds <= longest_s else receive_body(file)


def receive_body(file: Path) -> Dropped:
    """Install an impulse response as a body, which the instrument then has. Errors become notices."""
    try:
        return Dropped(body=install_body(file), notice=cut_words(file))
    except (ImpulseError, WriteError) as error:
        return Dropped(notice=str(error))


def _preset(file: Path, library: Library) -> Dropped:
    """Copy a preset into the user's folder, unless its bytes are in the library already, and choose it."""
    path, was_there = install_preset(file, user_folder(), [entry.path for entry in library.entries])
    library.refresh()
    entry = library.find(name_text(path.stem))
    if entry is None:
        return Dropped(notice=f"{path}: cannot be used; check that the file still exists")
    whose = "your own" if path.parent == user_folder() else "the factory"
    notice = f"{file.name} is {whose} preset “{entry.info.title}” already; nothing was copied."
    return Dropped({"preset": entry.name}, notice if was_there else "")


def _drop_recipe(file: Path, library: Library) -> Dropped:
    """The choices of the recipe in an exported sound: how it was played and heard.

    The notice names what is not the same here: preset, instrument, or a duration out of range.
    """
    recipe = read_recipe(file)
    path, exact = preset_of(recipe, [entry.path for entry in library.entries])
    try:
        played: dict[str, Any] = (
            {"single": name_text(path.stem)} if recipe.event is None else {"played": recipe.find_instrument()[0]}
        )
        notices = changed_notices(recipe, exact)
    except ValueError as error:
        return Dropped(notice=f"{file}: {error}.")
    choices = {**played, **restored_choices(recipe)}
    if choices.get("seconds", recipe.seconds) != recipe.seconds:
        low, high = OF_CHOICES["seconds"].limits
        limits = f"the window's range ({low:g} … {high:g} s)"
        notices.append(f"its duration of {recipe.seconds:g} s is out of {limits}, shown are {choices['seconds']:g} s")
    notice = f"{file.name}: {'; '.join(notices)}." if notices else ""
    return Dropped(choices, notice)


def restored_choices(recipe: SoundRecipe) -> dict[str, Any]:
    """The fields of `Choices` that a recipe sets, without the instrument. A recipe of a key sets no pluck or pick-up.

    Of a single string, the instrument that is there and its pick-up stay as they are.
    A sound that ends by its decay has a longest duration alone, and leaves the chosen one.
    """
    fields: dict[str, Any] = {
        "solo": 0,
        "a": "difference" if recipe.source == "difference" else "model",
        "b": "truth",
        "heard": "b" if recipe.source == "truth" else "a",
    }
    if recipe.event is None:
        fields |= {
            "pluck": recipe.pluck,
            "string": recipe.string,
            "string_pickup": Pickup(points=recipe.ear.points, kind=recipe.ear.pickup),
        }
    if recipe.settings.decay_db is None:
        fields["seconds"] = OF_CHOICES["seconds"].clamped(recipe.seconds)
    if recipe.source == "difference":
        fields["difference_gain_db"] = OF_CHOICES["difference_gain_db"].clamped(recipe.settings.difference_gain_db)
    return fields
