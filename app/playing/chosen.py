"""From what is chosen to what is plucked, how it is heard, and what is drawn of it."""

from __future__ import annotations

from pathlib import Path

from app.playing.stroke import Mix, Stroke
from app.presets.library import Library
from app.rendering import RenderRequest
from app.rendering.subject import StringOf, Subject
from app.session.choices import Choices
from app.session.ears import heard_ear
from app.session.slots import other_preset
from app.shared.vocabulary import DIFFERENCE


def mix_of(choices: Choices) -> Mix:
    """The sound of a note."""
    return Mix(choices.source_heard, choices.level_match, choices.difference_gain_db)


def subject_of(choices: Choices, preset: Path) -> Subject:
    """The string that is plucked: the preset's own, or the one that is chosen for a preset of many."""
    return preset if choices.string is None else StringOf(preset, choices.string.parameters)


def stroke_of(choices: Choices, preset: Path, library: Library) -> Stroke:
    """The chosen pluck, with voices for both slots."""
    others = _others(choices, library)
    sources: list[str] = []
    for held in (choices.source_heard, choices.a, choices.b):
        sources += ("model", "truth") if held == DIFFERENCE else (held,)
    known = dict.fromkeys(source for source in sources if source in ("model", "truth") or source in others)
    subject = subject_of(choices, preset)
    return Stroke(subject, choices.pluck, heard_ear(choices), choices.seconds, tuple(known) or ("model",), others)


def render_request(choices: Choices, preset: Path, library: Library) -> RenderRequest:
    """The chosen pluck for the render worker, with the other presets that slots hold."""
    others = tuple(dict.fromkeys(_others(choices, library).values()))
    subject = subject_of(choices, preset)
    return RenderRequest(subject, choices.pluck, choices.seconds, heard_ear(choices), choices.speed, others)


def _others(choices: Choices, library: Library) -> dict[str, Path]:
    entries = {source: library.find(other_preset(source)) for source in (choices.a, choices.b)}
    return {source: entry.path for source, entry in entries.items() if entry is not None}
