"""Controls without a file of their own: what they say, report and paint."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from PySide6.QtWidgets import QApplication, QLabel, QMenu
from pytestqt.qtbot import QtBot

from app.views.controls.app_menu import ENTRIES, MENUS, AppMenu
from app.views.controls.elided_label import ElidedLabel
from app.views.controls.meter import LIMIT_HOLD_TICKS, Meter
from app.views.controls.notice_bar import MOST_KEPT, NoticeBar
from tests.app.gestures import Paints, picture


def test_every_entry_is_in_its_menu_and_undo_says_what_it_would_change(show: Callable[..., Any]) -> None:
    made = show(AppMenu())
    menus = {action.text(): action.menu() for action in made.actions()}
    assert list(menus) == list(MENUS)
    for title, entries in MENUS.items():
        menu = menus[title]
        assert isinstance(menu, QMenu)
        assert [made.action[entry.name] for entry in entries] == menu.actions()[: len(entries)]
    assert len(made.action) == len(ENTRIES)
    made.show_steps("tension & length", "")
    assert (made.action["undo"].text(), made.action["redo"].text()) == ("Undo: tension && length", "Redo")


def test_the_longest_wording_that_fits_is_shown(show: Callable[..., Any]) -> None:
    label = show(ElidedLabel())
    wordings = ("1.305 s   106 Hz   -63.2 dB", "106 Hz   -63.2 dB", "-63.2 dB")
    label.say(*wordings)
    for words in wordings:
        label.resize(label.fontMetrics().horizontalAdvance(words), 20)
        assert label.shown == words
    label.resize(20, 20)
    assert label.shown.endswith("…")
    assert label.text() == wordings[0]


def test_the_meter_is_painted_when_it_looks_another_way_and_not_sixty_times_a_second(
    show: Callable[..., Any],
) -> None:
    meter = show(Meter())
    meter.resize(meter.sizeHint())
    QApplication.processEvents()
    paints = Paints(meter)

    def painted(*levels: tuple[float, bool]) -> int:
        paints.rects.clear()
        for level_db, limiting in levels:
            meter.show_level(level_db, limiting)
            QApplication.processEvents()
        return len(paints.rects)

    assert painted((-10.0, False)) == 1
    assert 10 < painted(*((-10 - 0.11 * step, False) for step in range(91))) < 20, "once a pixel"
    painted((-60.0, False))
    dark = picture(meter)
    assert painted((-60.0, True), (-60.0, True)) == 1
    assert meter.limit_light and picture(meter) != dark
    assert painted(*[(-60.0, False)] * (2 * LIMIT_HOLD_TICKS)) == 1
    assert not meter.limit_light and picture(meter) == dark


def test_a_notice_is_reported_once_counted_when_it_repeats_and_kept(qtbot: QtBot) -> None:
    bar = NoticeBar()
    for widget in (bar, bar.bell):
        qtbot.addWidget(widget)
    bar.report("No sound.", "device 3")
    bar.inform("Disk full.")
    for _ in range(100):
        bar.report("No sound.", "device 4")
    assert [(each.message, each.details, each.error) for each in bar.notices] == [
        ("Disk full.", "", False),
        ("No sound.", "device 4", True),
    ]
    assert bar.bell.unseen == 2
    label = bar.findChild(QLabel)
    assert (label.text(), label.objectName()) == ("No sound.  (×101)", "warning")
    bar.withdraw("Something else.")
    assert bar.text == "No sound."
    bar.withdraw("No sound.")
    assert (bar.text, len(bar.notices)) == ("", 2)
    for number in range(MOST_KEPT + 5):
        bar.inform(f"Fact {number}.")
    assert (len(bar.notices), label.objectName()) == (MOST_KEPT, "")
