"""What the two slots of the A/B comparison hold, in words, and what it takes to render it."""

from __future__ import annotations

from pathlib import Path

from app.audio import Levels, Track
from app.library import Library
from app.rendering import DIFFERENCE, OTHER, RenderRequest
from app.session import Choices


def other_preset(source: str) -> str:
    """The name of the preset whose model "preset:NAME" is, or nothing."""
    return source.removeprefix(OTHER) if source.startswith(OTHER) else ""


def source_title(source: str, library: Library) -> str:
    """What a button says."""
    if name := other_preset(source):
        entry = library.find(name)
        return entry.title if entry else name
    return source


def render_request(choices: Choices, preset: Path, library: Library, sound_rate_hz: int) -> RenderRequest:
    """What the worker is asked for, other presets in the slots among it."""
    entries = [library.find(other_preset(source)) for source in (choices.a, choices.b)]
    others = tuple(dict.fromkeys(entry.path for entry in entries if entry is not None))
    return RenderRequest(
        preset,
        choices.pluck,
        choices.seconds,
        choices.listen,
        sound_rate_hz,
        listen_right=choices.listen_right if choices.stereo else None,
        pickup=choices.pickup,
        solo=choices.solo,
        others=others,
    )


def levels(choices: Choices) -> Levels:
    """How loud each source is played."""
    return Levels(choices.level_match, {DIFFERENCE: choices.difference_gain_db})


def gain_db(choices: Choices, track: Track | None, source: str) -> float | None:
    """The gain with which a source is heard; None while that is not known."""
    if track is None or (choices.level_match and source != DIFFERENCE and track.match_gains is None):
        return None
    return levels(choices).gain_db(track, source)


def missing_presets(choices: Choices, library: Library) -> dict[str, str]:
    """By slot, the preset that it holds and that is not there any more."""
    held = {"a": other_preset(choices.a), "b": other_preset(choices.b)}
    return {slot: name for slot, name in held.items() if name and library.find(name) is None}
