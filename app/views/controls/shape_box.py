"""The boxes that choose the shape of a pluck and the pick-up, and why a triangle leaves its width grey."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from PySide6.QtWidgets import QComboBox

from app.shared.vocabulary import PICKUP_TITLES
from app.views.controls.parts import combo_box
from app.views.theme import fix_size
from engine.pluck import SHAPES, Shape

AT_BRIDGE = "The bridge hears the whole string: choose Point or Magnetic to listen at a place"
NO_WIDTH = "A triangle has no width: choose another shape to turn it"
SHAPE_TIP = "The shape of the pluck"
_NAMES: dict[Shape, str] = {
    "gaussian": "Gaussian",
    "triangular": "Triangle",
    "raised_cosine": "Raised cosine",
    "rounded": "Rounded",
}
_WIDTH, _PICKUP_WIDTH = 106, 74  # pixels: the longest name, with the padding of _TIGHT
_TIGHT = "QComboBox {{ padding: 5px 0 5px 6px; }} QComboBox::drop-down {{ border: none; width: {}px; }}"
_ARROW, _PICKUP_ARROW = 17, 9  # pixels


def shape_box(picked: Callable[[Any], object]) -> QComboBox:
    """A narrow combo box of the names in words; its rows are SHAPES, and so is its data."""
    box = combo_box("Pluck shape", [(_NAMES[shape], shape) for shape in SHAPES], tip=SHAPE_TIP, picked=picked)
    return _tight(box, _WIDTH, _ARROW)


def pickup_box(tip: str, picked: Callable[[Any], object]) -> QComboBox:
    """A narrow combo box of the pick-ups; its data is that of `Choices.pickup.kind`."""
    box = combo_box("Pick-up", [(title, kind) for kind, title in PICKUP_TITLES.items()], tip=tip, picked=picked)
    return _tight(box, _PICKUP_WIDTH, _PICKUP_ARROW)


def _tight(box: QComboBox, width: int, arrow: int) -> QComboBox:
    box.setStyleSheet(_TIGHT.format(arrow))
    fix_size(box, width)
    return box
