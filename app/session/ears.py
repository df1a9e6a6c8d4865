"""The chosen listening points and pick-up, as the engine takes them."""

from __future__ import annotations

from app.session.choices import Choices
from engine.voices import Ear


def heard_ear(choices: Choices) -> Ear:
    """Listening points, pick-up and soloed mode of `choices`; the first point, in stereo the left, is drawn."""
    points = (choices.listen, choices.listen_right) if choices.stereo else (choices.listen,)
    return Ear(points, choices.pickup, choices.solo)
