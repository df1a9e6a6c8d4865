"""The pick-up as it is turned in the window: listening points, mono or stereo, and kind."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from app.instruments.instrument import Instrument, Pickup
from app.shared.parameters import OF_CHOICES
from engine import bounds

POINTS = ("listen", "listen_right")  # listening points: in stereo left and right
TURNED = (*POINTS, "stereo", "pickup_kind")  # names of what is turned on a pick-up
RIGHT_POINT = "pickup.points.1"  # of an instrument in stereo


def turned_pickup(pickup: Pickup, turns: Mapping[str, Any], right: float) -> Pickup:
    """The pick-up after `turns`.

    Args:
        turns: values by name of TURNED.
        right: the right point in stereo, where it is not turned.

    Raises:
        ValueError: a value is out of its range; the message names it.
    """
    for name in POINTS:
        if name in turns:
            bounds.check(name, turns[name], OF_CHOICES[name].limits)
    points = turns.get("listen", pickup.points[0]), turns.get("listen_right", right)
    count = 1 + turns.get("stereo", len(pickup.points) > 1)
    kind = turns.get("pickup_kind", pickup.kind)
    return Pickup.model_validate({**dict(pickup), "points": points[:count], "kind": kind})


def with_pickup(instrument: Instrument, pickup: Pickup) -> Instrument:
    """The instrument with this pick-up.

    Raises:
        ValueError: in mono one of its macros would have nothing to move.
    """
    if len(pickup.points) == 1:
        for macro in instrument.macros:
            if any(target.field == RIGHT_POINT for target in macro.targets):
                reason = f"its macro {macro.name} moves the right listening point"
                raise ValueError(f"{instrument.name} stays in stereo: {reason}")
    return instrument.model_copy(update={"pickup": pickup})
