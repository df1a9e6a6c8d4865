"""A fault is reported once, counted when it comes again, and found later."""

from __future__ import annotations

import pytest
from PySide6.QtGui import QGuiApplication
from pytestqt.qtbot import QtBot

from app.views.controls.notice_bar import MOST_KEPT, NoticeBar


@pytest.fixture
def bar(qtbot: QtBot) -> NoticeBar:
    made = NoticeBar()
    qtbot.addWidget(made)
    qtbot.addWidget(made.bell)
    return made


def test_a_repeated_notice_counts_up(bar: NoticeBar) -> None:
    bar.report("No sound.", "device 3")
    bar.report("Disk full.")
    for _ in range(100):
        bar.report("No sound.", "device 4")
    assert [(each.message, each.details) for each in bar.notices] == [("Disk full.", ""), ("No sound.", "device 4")]
    assert bar.text == "No sound."
    assert bar._label.text() == "No sound.  (×101)"
    assert bar.bell.unseen == 2


def test_a_withdrawn_notice_is_still_kept(bar: NoticeBar) -> None:
    bar.report("No sound.")
    bar.withdraw("Something else.")
    assert bar.text == "No sound."
    bar.withdraw("No sound.")
    assert bar.text == ""
    assert [(each.message, each.details) for each in bar.notices] == [("No sound.", "")]


def test_information_is_not_shown_as_a_fault(bar: NoticeBar) -> None:
    bar.report("Broken.")
    assert bar._label.objectName() == "warning"
    bar.inform("Saved.")
    assert bar._label.objectName() == ""
    assert [notice.error for notice in bar.notices] == [True, False]


def test_details_are_offered_where_they_add_something(bar: NoticeBar) -> None:
    for message, details, offered in (
        ("No sound.", "code -9996", True),
        ("Broken.", "", False),
        ("x: y", "y", False),
    ):
        bar.report(message, details)
        assert bar._details.isHidden() is not offered


def test_the_bell_opens_the_list_with_the_details(qtbot: QtBot, bar: NoticeBar) -> None:
    bar.report("No sound.", "what the driver said")
    bar.inform("Saved.")
    bar.bell.click()
    shown = bar._list
    assert shown is not None
    assert bar.bell.unseen == 0
    assert "none unread" in bar.bell.accessibleName()
    assert [shown._list.item(row).text().split("   ")[1:] for row in range(2)] == [
        ["note", "Saved."],
        ["error", "No sound."],
    ]
    shown._list.setCurrentRow(1)
    assert "what the driver said" in shown._details.toPlainText()
    bar.report("Later.")
    assert "Later." in shown._list.item(0).text()
    assert "No sound.\nwhat the driver said" in shown.report()
    assert QGuiApplication.clipboard() is not None
    shown.close()


def test_the_list_is_bounded(bar: NoticeBar) -> None:
    for number in range(MOST_KEPT + 5):
        bar.report(f"Fault {number}.")
    assert len(bar.notices) == MOST_KEPT
    assert bar.text == f"Fault {MOST_KEPT + 4}."
