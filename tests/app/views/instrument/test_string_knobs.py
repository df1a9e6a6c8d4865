"""The string's knobs show a patch and ask for changes of its fields."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QFontMetrics
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.patches.library import SHIPPED, read_patch
from app.patches.patch import Patch, Pickup
from app.patches.tuning import TuningChoice
from app.views import theme
from app.views.controls.sideways import Sideways
from app.views.instrument.string_knobs import StringKnobs


@pytest.fixture
def knobs(qtbot: QtBot) -> StringKnobs:
    made = StringKnobs()
    qtbot.addWidget(made)
    made.resize(1200, 110)
    made.show()
    return made


def test_every_field_is_shown_and_can_be_turned_to_both_ends(knobs: StringKnobs, guitar: Patch) -> None:
    guitar = guitar.model_copy(update={"pickup": Pickup(points=(0.1, 0.6))})
    knobs.show_patch(guitar)
    for field, knob in knobs.knobs.items():
        if field.startswith("tuning."):
            continue
        assert knob.value == guitar.value(field)
        for value in knob.parameter.limits:
            if field not in ("pluck.softest_mm", "pluck.hardest_mm"):  # which bound each other
                assert guitar.with_value(field, value).value(field) == pytest.approx(value)
    assert knobs.knobs["tuning.a4_hz"].value == guitar.tuning.a4_hz


def test_every_name_fits_its_knob(knobs: StringKnobs) -> None:
    metrics = QFontMetrics(theme.small_font(9, grows=False))
    for knob in knobs.knobs.values():
        name = knob.accessibleName().upper()
        assert metrics.horizontalAdvance(name) <= knob.sizeHint().width(), name


def test_a_turn_is_reported_with_its_field(qtbot: QtBot, knobs: StringKnobs, guitar: Patch) -> None:
    knobs.show_patch(guitar)
    with qtbot.waitSignal(knobs.changed) as reported:
        qtbot.keyClick(knobs.knobs["knobs.gauge"], Qt.Key.Key_Up)
    assert reported.args == ["knobs.gauge", pytest.approx(1.03 * guitar.knobs.gauge)]
    with qtbot.waitSignals([knobs.drag_started, knobs.drag_ended], order="strict"):
        qtbot.mouseClick(knobs.knobs["knobs.decay"], Qt.MouseButton.LeftButton)


def test_a_double_click_goes_back_to_what_was_saved(qtbot: QtBot, knobs: StringKnobs, guitar: Patch) -> None:
    knobs.show_patch(guitar.with_value("pluck.position", 0.4), guitar)
    with qtbot.waitSignal(knobs.changed) as reported:
        qtbot.mouseDClick(knobs.knobs["pluck.position"], Qt.MouseButton.LeftButton)
    assert reported.args == ["pluck.position", guitar.pluck.position]


def test_it_is_transposed_by_whole_keys(qtbot: QtBot, knobs: StringKnobs) -> None:
    asked: list[float] = []
    knobs.changed.connect(lambda _, value: asked.append(value))
    knobs.knobs["tuning.transpose"].value_asked.emit(2.6)
    qtbot.keyClick(knobs.knobs["tuning.transpose"], Qt.Key.Key_Down, Qt.KeyboardModifier.ShiftModifier)
    assert asked == [3.0, 0.0]


def test_what_a_patch_does_not_have_cannot_be_turned(knobs: StringKnobs, guitar: Patch) -> None:
    mono = guitar.model_copy(
        update={
            "pluck": guitar.pluck.model_copy(update={"shape": "triangular"}),
            "damping": guitar.damping.model_copy(update={"let_ring": True}),
        }
    )
    knobs.show_patch(mono)
    off = {field for field, knob in knobs.knobs.items() if not knob.isEnabled()}
    assert off == {"pluck.width", "pluck.width_hard", "damping.release_t60_s"}
    assert "no width" in knobs.knobs["pluck.width"].toolTip()
    assert "ring" in knobs.knobs["damping.release_t60_s"].toolTip()
    gaussian = mono.model_copy(update={"pluck": mono.pluck.model_copy(update={"shape": "gaussian"})})
    knobs.show_patch(gaussian)
    assert knobs.knobs["pluck.width"].isEnabled()
    assert "no width" not in knobs.knobs["pluck.width"].toolTip()


def test_the_shape_of_the_pluck_is_chosen_in_words(qtbot: QtBot, knobs: StringKnobs, guitar: Patch) -> None:
    knobs.show_patch(guitar)
    box = knobs.shape
    assert box.currentText() == "Rounded"
    shapes = [box.itemText(row) for row in range(box.count())]
    assert shapes == ["Gaussian", "Triangle", "Raised cosine", "Rounded"]
    with qtbot.waitSignal(knobs.changed) as reported:
        box.activated.emit(box.findText("Triangle"))
    assert reported.args == ["pluck.shape", "triangular"]


def test_a_knob_shows_what_it_makes_of_the_string_and_asks_for_a_figure(
    qtbot: QtBot, knobs: StringKnobs, guitar: Patch
) -> None:
    knobs.show_patch(guitar.with_value("knobs.tension", 1.5))
    knobs.show_figures({"knobs.tension": "107 N"})
    tension = knobs.knobs["knobs.tension"]
    assert tension.accessibleDescription() == "107 N (× 1.50)"
    assert knobs.knobs["knobs.length"].accessibleDescription() == "× 1.00"
    qtbot.keyClicks(tension, "9")
    assert tension._editor is not None
    with qtbot.waitSignal(knobs.figure_asked) as reported:
        qtbot.keyClick(tension._editor, Qt.Key.Key_Return)
    assert reported.args == ["knobs.tension", 9.0]
    assert tension.value == 1.5


def test_the_facts_are_reported_in_their_units(knobs: StringKnobs) -> None:
    before = knobs.facts.grab().toImage()
    knobs.show_facts({"tension": "72.3 N", "length": "650 mm"})
    assert knobs.facts.accessibleDescription() == "tension 72.3 N, length 650 mm"
    assert knobs.facts.grab().toImage() != before


def test_a_keyboard_mapping_leaves_nothing_to_a4_and_the_tip_says_why(knobs: StringKnobs, guitar: Patch) -> None:
    a4 = knobs.knobs["tuning.a4_hz"]
    keymap = "12\n0\n127\n60\n69\n440\n12\n" + "".join(f"{n}\n" for n in range(12))
    knobs.show_patch(guitar.model_copy(update={"tuning": TuningChoice(keymap=keymap)}))
    assert not a4.isEnabled()
    assert "reference pitch of its own" in a4.toolTip()
    knobs.show_patch(guitar)
    assert a4.isEnabled()
    assert "reference pitch" not in a4.toolTip()


def test_knobs_that_were_hidden_while_text_grew_have_their_room(qtbot: QtBot, qapp: QApplication) -> None:
    row = Sideways(knobs := StringKnobs())
    qtbot.addWidget(row)
    row.resize(700, 200)
    row.show()
    row.hide()
    theme.apply_theme(qapp, "dark", 150)
    try:
        row.show()
        QApplication.processEvents()
        for knob in knobs.knobs.values():
            assert knob.width() >= knob.sizeHint().width()
        assert knobs.shape.geometry().right() < knobs.knobs["pluck.position"].geometry().left()
    finally:
        theme.apply_theme(qapp, "dark")


class Counted(Sideways):
    """Counts how often it is asked to lay out."""

    requests = 0

    def event(self, event: QEvent) -> bool:
        self.requests += event.type() == QEvent.Type.LayoutRequest
        return super().event(event)


def test_a_row_at_rest_is_not_laid_out_again(qtbot: QtBot) -> None:
    row = Counted(StringKnobs())
    qtbot.addWidget(row)
    row.show()
    qtbot.wait(100)
    row.requests = 0
    qtbot.wait(100)
    assert row.requests < 5


def test_drums_have_no_pluck_to_shape(knobs: StringKnobs, guitar: Patch) -> None:
    for patch, has in ((read_patch(SHIPPED / "timpani.json"), False), (guitar, True)):
        knobs.show_patch(patch)
        assert knobs.shape.isEnabled() == has
