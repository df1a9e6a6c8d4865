"""Where the string is listened to, as chosen."""

from __future__ import annotations

from app.session.choices import Choices
from engine.voices import Ear


def heard_ear(choices: Choices) -> Ear:
    """How a string is listened to; the first point is the one that is drawn, in stereo the left."""
    points = (choices.listen, choices.listen_right) if choices.stereo else (choices.listen,)
    return Ear(points, choices.pickup, choices.solo)
