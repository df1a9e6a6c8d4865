"""What a patch, when it is chosen, sets in the session: the preset that plays it, listening points and pick-up."""

from __future__ import annotations

from typing import Any

from app.patches.patch import Patch


def choices_of(patch: Patch) -> dict[str, Any]:
    """Values for `Session.update` that choose `patch`."""
    return {"patch": patch, "preset": patch.preset, "keys_play": "pitch", **heard_at(patch)}


def heard_at(patch: Patch) -> dict[str, Any]:
    """Values for `Session.update`: the listening points and the pick-up of `patch`."""
    points = patch.pickup.points
    right = {"listen_right": points[1]} if len(points) > 1 else {}
    return {"listen": points[0], "stereo": len(points) > 1, "pickup": patch.pickup.kind, **right}
