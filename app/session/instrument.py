"""What choosing a patch chooses: the model that plays it, and where it is heard."""

from __future__ import annotations

from typing import Any

from app.patches.patch import Patch


def choices_of(patch: Patch) -> dict[str, Any]:
    """New values of `Choices`."""
    points = patch.pickup.points
    right = {"listen_right": points[1]} if len(points) > 1 else {}
    pickup = {"listen": points[0], "stereo": len(points) > 1, "pickup": patch.pickup.kind}
    return {"patch": patch, "preset": patch.preset, "keys_play": "pitch", **pickup, **right}
