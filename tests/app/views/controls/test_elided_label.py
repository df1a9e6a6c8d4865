"""What a line says where there is little room."""

from __future__ import annotations

from pytestqt.qtbot import QtBot

from app.views.controls.elided_label import ElidedLabel
from app.views.controls.readout import Readout


def test_the_longest_wording_that_fits_is_shown(qtbot: QtBot) -> None:
    label = ElidedLabel()
    qtbot.addWidget(label)
    wordings = ("1.305 s   106 Hz   -63.2 dB", "106 Hz   -63.2 dB", "-63.2 dB")
    label.say(*wordings)
    for words in wordings:
        label.resize(label.fontMetrics().horizontalAdvance(words), 20)
        assert label.shown == words
    label.resize(20, 20)
    assert label.shown.endswith("…")
    assert label.text() == wordings[0]
    label.setText("another")
    assert label.text() == "another"


def test_a_readout_rests_on_its_own_words(qtbot: QtBot) -> None:
    readout = Readout()
    qtbot.addWidget(readout)
    readout.resize(400, 20)
    readout.rest("every frame")
    readout.report("1.305 s   106 Hz", "106 Hz")
    assert readout.shown == readout.toolTip() == "1.305 s   106 Hz"
    readout.report("")
    assert readout.shown == "every frame"
