"""What the two slots of the A/B comparison hold, in words, and what it takes to hear and to draw it."""

from __future__ import annotations

from pathlib import Path

from app.library import Library
from app.playing import Mix, Stroke
from app.rendering import RenderRequest
from app.session import Choices
from app.sound_names import DIFFERENCE, OTHER
from engine.voices import Ear


def other_preset(source: str) -> str:
    """The name of the preset whose model "preset:NAME" is, or nothing."""
    return source.removeprefix(OTHER) if source.startswith(OTHER) else ""


def source_title(source: str, library: Library) -> str:
    """What a button says."""
    if name := other_preset(source):
        entry = library.find(name)
        return entry.title if entry else name
    return source


def ear_of(choices: Choices) -> Ear:
    """How a string is listened to."""
    points = (choices.listen, choices.listen_right) if choices.stereo else (choices.listen,)
    return Ear(points, choices.pickup, choices.solo)


def mix_of(choices: Choices) -> Mix:
    """What is heard of a note."""
    return Mix(choices.source_heard, choices.level_match, choices.difference_gain_db)


def stroke_of(choices: Choices, preset: Path, library: Library) -> Stroke:
    """What is plucked, with voices for both slots."""
    others = _others(choices, library)
    sources: list[str] = []
    for held in (choices.source_heard, choices.a, choices.b):
        sources += ("model", "truth") if held == DIFFERENCE else (held,)
    known = dict.fromkeys(source for source in sources if source in ("model", "truth") or source in others)
    return Stroke(preset, choices.pluck, ear_of(choices), choices.seconds, tuple(known) or ("model",), others)


def render_request(choices: Choices, preset: Path, library: Library) -> RenderRequest:
    """What the worker is asked for, other presets in the slots among it."""
    return RenderRequest(
        preset, choices.pluck, choices.seconds, tuple(dict.fromkeys(_others(choices, library).values()))
    )


def missing_presets(choices: Choices, library: Library) -> dict[str, str]:
    """By slot, the preset that it holds and that is not there any more."""
    held = {"a": other_preset(choices.a), "b": other_preset(choices.b)}
    return {slot: name for slot, name in held.items() if name and library.find(name) is None}


def _others(choices: Choices, library: Library) -> dict[str, Path]:
    entries = {source: library.find(other_preset(source)) for source in (choices.a, choices.b)}
    return {source: entry.path for source, entry in entries.items() if entry is not None}
