"""What choosing a patch chooses: the model that plays it, and where it is heard."""

from __future__ import annotations

from typing import Any

from app.patches.patch import Patch


def choices_of(patch: Patch) -> dict[str, Any]:
    """New values of `Choices`."""
    return {"patch": patch, "preset": patch.preset, "keys_play": "pitch", **heard_at(patch)}


def heard_at(patch: Patch) -> dict[str, Any]:
    """Those of them that say where and how it is picked up."""
    points = patch.pickup.points
    right = {"listen_right": points[1]} if len(points) > 1 else {}
    return {"listen": points[0], "stereo": len(points) > 1, "pickup": patch.pickup.kind, **right}
