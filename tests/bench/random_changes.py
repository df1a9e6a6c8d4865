"""Random changes of the session's choices, repeatable by a seed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from random import Random
from typing import Any

from app.patches.instrument import SingleString
from app.patches.patch import Fretted, Patch, StringSet
from app.session.choices import Choices
from app.shared.parameters import OF_CHOICES
from app.shared.vocabulary import DIFFERENCE_GAIN_RANGE_DB
from engine.bounds import LARGEST_AMPLITUDE_MM, POSITION_RANGE, WIDTH_RANGE
from engine.pluck import SHAPES
from engine.values.string import StringParameters

SECONDS_RANGE = (0.5, 4.0)
VOLUME_RANGE_DB = (-40.0, 6.0)
HIGHEST_SOLO = 10


@dataclass(frozen=True)
class Repertoire:
    """What is chosen from: names of presets, names of panels, patches."""

    presets: tuple[str, ...]
    left_views: tuple[str, ...]
    right_views: tuple[str, ...]
    patches: tuple[Patch, ...] = ()


def random_change(random: Random, choices: Choices, repertoire: Repertoire) -> Mapping[str, Any]:
    """New values of one field of `Choices`, or the instrument."""
    return random.choice(_CHANGES)(random, choices, repertoire)


def _strings(patch: Patch) -> list[StringParameters | None]:
    found = patch.strings
    if isinstance(found, StringSet):
        return [None, *(each.string for each in found.strings)]
    return [None, found.string] if isinstance(found, Fretted) else [None]


def _held(random: Random, repertoire: Repertoire) -> str:
    return random.choice(("model", "truth", "difference", f"preset:{random.choice(repertoire.presets)}"))


_Change = Callable[[Random, Choices, Repertoire], Mapping[str, Any]]
_CHANGES: tuple[_Change, ...] = (
    lambda r, c, of: {"preset": r.choice(of.presets)},
    lambda r, c, of: {"position": r.uniform(*POSITION_RANGE)},
    lambda r, c, of: {"amplitude_mm": r.uniform(0, LARGEST_AMPLITUDE_MM)},
    lambda r, c, of: {"shape": r.choice(SHAPES)},
    lambda r, c, of: {"width": r.uniform(*WIDTH_RANGE)},
    lambda r, c, of: {"listen": r.random()},
    lambda r, c, of: {"listen_right": r.random()},
    lambda r, c, of: {"seconds": r.uniform(*SECONDS_RANGE)},
    lambda r, c, of: {"stereo": not c.stereo},
    lambda r, c, of: {"pickup": "displacement" if c.pickup == "velocity" else "velocity"},
    lambda r, c, of: {"solo": 0 if c.solo else r.randint(1, HIGHEST_SOLO)},
    lambda r, c, of: {"a": _held(r, of)},
    lambda r, c, of: {"b": _held(r, of)},
    lambda r, c, of: {"heard": "b" if c.heard == "a" else "a"},
    lambda r, c, of: {"level_match": not c.level_match},
    lambda r, c, of: {"difference_gain_db": r.uniform(*DIFFERENCE_GAIN_RANGE_DB)},
    lambda r, c, of: {"loop": not c.loop},
    lambda r, c, of: {"volume_db": r.uniform(*VOLUME_RANGE_DB)},
    lambda r, c, of: {"speed": r.uniform(*OF_CHOICES["speed"].limits)},
    lambda r, c, of: {"left_view": r.choice(of.left_views)},
    lambda r, c, of: {"right_view": r.choice(of.right_views)},
    lambda r, c, of: {"motion": not c.motion},
    lambda r, c, of: {"envelope": not c.envelope},
    lambda r, c, of: {"instrument": r.choice(of.patches)} if of.patches else {},
    lambda r, c, of: {"face": r.choice(("play", "lab"))},
    lambda r, c, of: {"octave": r.randint(-4, 4)},
    lambda r, c, of: {"velocity": r.randint(1, 127)},
    lambda r, c, of: {"instrument": r.choice((SingleString(preset=c.preset), c.patch or c.instrument))},
    lambda r, c, of: {"string": None if c.patch is None else r.choice(_strings(c.patch))},
)
