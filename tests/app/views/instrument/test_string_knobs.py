"""The string's knobs show an instrument and ask for changes of its fields."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QFontMetrics
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.instruments.instrument import Instrument, Pickup
from app.instruments.library import SHIPPED, read_instrument
from app.views import theme
from app.views.controls.sideways import Sideways
from app.views.instrument.string_knobs import StringKnobs
from tests.app.gestures import LEFT, SHIFT, press_keys, reported

Key = Qt.Key


@pytest.fixture
def knobs(show: Callable[..., StringKnobs], guitar: Instrument) -> StringKnobs:
    made = show(StringKnobs(), 1200, 110)
    made.show_instrument(guitar)
    return made


def test_every_field_is_shown_can_be_turned_to_both_ends_and_its_name_fits(
    knobs: StringKnobs, guitar: Instrument
) -> None:
    stereo = guitar.model_copy(update={"pickup": Pickup(points=(0.1, 0.6))})
    knobs.show_instrument(stereo)
    metrics = QFontMetrics(theme.small_font(9, grows=False))
    for field, knob in knobs.knobs.items():
        assert metrics.horizontalAdvance(knob.accessibleName().upper()) <= knob.sizeHint().width(), field
        if field.startswith("tuning."):
            continue
        assert knob.value == stereo.value(field)
        for value in knob.parameter.limits:
            if field not in ("pluck.softest_mm", "pluck.hardest_mm"):  # which bound each other
                assert stereo.with_value(field, value).value(field) == pytest.approx(value)
    assert knobs.knobs["tuning.a4_hz"].value == guitar.tuning.a4_hz


def test_gestures_are_reported_with_their_field(qtbot: QtBot, knobs: StringKnobs, guitar: Instrument) -> None:
    asked = reported(knobs.changed)
    press_keys(knobs.knobs["knobs.gauge"], Key.Key_Up)
    knobs.knobs["tuning.transpose"].value_asked.emit(2.6)  # by whole keys
    press_keys(knobs.knobs["tuning.transpose"], Key.Key_Down, held=SHIFT)
    knobs.shape.activated.emit(knobs.shape.findText("Triangle"))
    qtbot.mouseClick(knobs.knobs["knobs.decay"], LEFT)
    knobs.show_instrument(guitar.with_value("pluck.position", 0.4), guitar)
    qtbot.mouseDClick(knobs.knobs["pluck.position"], LEFT)  # back to what was saved
    assert asked == [
        ("knobs.gauge", pytest.approx(1.03 * guitar.knobs.gauge)),
        ("tuning.transpose", 3.0),
        ("tuning.transpose", 0.0),
        ("pluck.shape", "triangular"),
        ("pluck.position", guitar.pluck.position),
    ]
    assert knobs.shape.currentText() == "Rounded"
    shapes = [knobs.shape.itemText(row) for row in range(knobs.shape.count())]
    assert shapes == ["Gaussian", "Triangle", "Raised cosine", "Rounded"]


def test_what_a_instrument_does_not_have_cannot_be_turned_and_the_tip_says_why(
    knobs: StringKnobs, guitar: Instrument
) -> None:
    keymap = "12\n0\n127\n60\n69\n440\n12\n" + "".join(f"{n}\n" for n in range(12))
    changes = {"pluck.shape": "triangular", "damping.let_ring": True, "tuning.keymap": keymap}
    dead = guitar.model_dump()
    for (part, _, name), value in ((field.partition("."), value) for field, value in changes.items()):
        dead[part][name] = value
    widths = dict.fromkeys(("pluck.width", "pluck.width_hard"), "no width")
    why = {**widths, "damping.release_t60_s": "ring", "tuning.a4_hz": "reference pitch of its own"}
    for instrument, barred in ((Instrument.model_validate(dead), set(why)), (guitar, set())):
        knobs.show_instrument(instrument)
        assert {field for field, knob in knobs.knobs.items() if not knob.isEnabled()} == barred
        for field, words in why.items():
            assert (words in knobs.knobs[field].toolTip()) == (field in barred)
    knobs.show_instrument(read_instrument(SHIPPED / "timpani.json"))
    assert not knobs.shape.isEnabled(), "drums have no pluck to shape"


def test_knobs_that_were_hidden_while_text_grew_have_their_room(
    show: Callable[..., Sideways], own_look: QApplication
) -> None:
    knobs = StringKnobs()
    row = show(Sideways(knobs), 700, 200)
    row.hide()
    theme.apply_theme(own_look, "dark", 150)
    row.show()
    QApplication.processEvents()
    assert all(knob.width() >= knob.sizeHint().width() for knob in knobs.knobs.values())
    assert knobs.shape.geometry().right() < knobs.knobs["pluck.position"].geometry().left()
    theme.apply_theme(own_look, "dark")
