"""The box for a key: names, numbers, and what is neither."""

from __future__ import annotations

from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot

from app.shared.key_names import note_name
from app.views.controls.note_box import NoteBox


def test_a_note_is_typed_and_one_out_of_range_is_not_taken(qtbot: QtBot) -> None:
    box = NoteBox("Lowest key", "")
    qtbot.addWidget(box)
    box.setRange(40, 76)
    box.setValue(52)
    assert box.text() == "E3"
    box.selectAll()
    qtbot.keyClicks(box, "bb2")
    assert box.value() == 52  # only when it is whole
    qtbot.keyClick(box, Qt.Key.Key_Return)
    assert (box.value(), box.text()) == (46, "A♯2")
    box.selectAll()
    qtbot.keyClicks(box, "C9")
    qtbot.keyClick(box, Qt.Key.Key_Return)
    assert 40 <= box.value() <= 76
    box.selectAll()
    qtbot.keyClicks(box, "x")
    assert box.text() != "x"
    qtbot.keyClick(box, Qt.Key.Key_Up)
    assert box.text() == note_name(box.value())
