"""What a patch, when it is chosen, sets in the session: the preset that plays it, listening points and pick-up.

Where keys play the patch, its pick-up and these fields of the session are the same thing: `picked_up` goes back.
"""

from __future__ import annotations

from typing import Any

from app.patches.patch import Patch, Pickup
from app.shared.vocabulary import Pickup as PickupKind

EARS = ("listen", "listen_right", "stereo", "pickup")  # fields of `Choices`: where and how the string is heard
RIGHT_POINT = "pickup.points.1"  # of a patch in stereo


def choices_of(patch: Patch) -> dict[str, Any]:
    """Values for `Session.update` that choose `patch`."""
    return {"patch": patch, "preset": patch.preset, "keys_play": "pitch", **heard_at(patch)}


def heard_at(patch: Patch) -> dict[str, Any]:
    """Values for `Session.update`: the listening points and the pick-up of `patch`."""
    points = patch.pickup.points
    right = {"listen_right": points[1]} if len(points) > 1 else {}
    return {"listen": points[0], "stereo": len(points) > 1, "pickup": patch.pickup.kind, **right}


def picked_up(patch: Patch, listen: float, listen_right: float, stereo: bool, pickup: PickupKind) -> Patch:
    """The patch with the pick-up that these fields of `Choices` describe.

    Raises:
        ValueError: in mono one of its macros would have nothing to move.
    """
    heard = Pickup(points=(listen, listen_right) if stereo else (listen,), kind=pickup)
    if heard == patch.pickup:
        return patch
    if not stereo:
        for macro in patch.macros:
            if any(target.field == RIGHT_POINT for target in macro.targets):
                told = f"its macro {macro.name} moves the right listening point"
                raise ValueError(f"{patch.name} stays in stereo: {told}")
    return patch.model_copy(update={"pickup": heard})
