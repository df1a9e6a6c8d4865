"""The box that chooses the shape of a pluck, and why a triangle leaves the knobs of the width grey."""

from __future__ import annotations

from PySide6.QtWidgets import QComboBox

from app.views.controls.parts import combo_box
from engine.pluck import SHAPES, Shape

NO_WIDTH = "A triangle has no width: choose another shape to turn it"
_NAMES: dict[Shape, str] = {"gaussian": "Gaussian", "triangular": "Triangle", "raised_cosine": "Raised cosine"}
_WIDTH = 106  # pixels: the longest name, with the padding of _TIGHT
_TIGHT = "QComboBox { padding: 5px 0 5px 6px; } QComboBox::drop-down { border: none; width: 17px; }"


def shape_box() -> QComboBox:
    """A narrow combo box of the names in words; its rows are SHAPES, and so is its data."""
    box = combo_box("Pluck shape", [(_NAMES[shape], shape) for shape in SHAPES])
    box.setToolTip("The shape of the pluck")
    box.setStyleSheet(_TIGHT)
    box.setFixedWidth(_WIDTH)
    return box
