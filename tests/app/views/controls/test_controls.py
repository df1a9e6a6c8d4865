"""Controls without a file of their own: what they say, report and paint."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtWidgets import QApplication, QLabel, QMenu, QPushButton
from pytestqt.qtbot import QtBot

from app.presets.library import PresetEntry
from app.session.choices import Choices
from app.views.controls.app_menu import ENTRIES, MENUS, AppMenu
from app.views.controls.elided_label import ElidedLabel
from app.views.controls.meter import LIMIT_HOLD_TICKS, Meter
from app.views.controls.notice_bar import MOST_KEPT, NoticeBar
from app.views.controls.slot_buttons import NARROW_WIDTH, WIDTH, SlotButtons
from engine.presets import read_info
from tests.app.gestures import Paints, picture


def test_every_entry_is_in_its_menu_and_undo_says_what_it_would_change(qtbot: QtBot) -> None:
    made = AppMenu()
    qtbot.addWidget(made)
    menus = {action.text(): action.menu() for action in made.actions()}
    assert list(menus) == list(MENUS)
    for title, entries in MENUS.items():
        menu = menus[title]
        assert isinstance(menu, QMenu)
        assert [made.action[entry.name] for entry in entries] == menu.actions()[: len(entries)]
    assert len(made.action) == len(ENTRIES)
    made.show_steps("tension & length", "")
    assert (made.action["undo"].text(), made.action["redo"].text()) == ("Undo: tension && length", "Redo")


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


def test_the_meter_is_painted_when_it_looks_another_way_and_not_sixty_times_a_second(qtbot: QtBot) -> None:
    meter = Meter()
    qtbot.addWidget(meter)
    meter.resize(meter.sizeHint())
    with qtbot.waitExposed(meter):
        meter.show()
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


@pytest.fixture
def bar(qtbot: QtBot) -> NoticeBar:
    made = NoticeBar()
    qtbot.addWidget(made)
    qtbot.addWidget(made.bell)
    return made


def test_a_notice_is_reported_once_counted_when_it_repeats_and_kept(bar: NoticeBar) -> None:
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


def test_the_slots_say_what_they_hold_with_much_room_and_with_little(qtbot: QtBot, small_preset: Path) -> None:
    slots = SlotButtons()
    qtbot.addWidget(slots)
    info = replace(read_info(small_preset), title="Steel E4")
    slots.set_entries([PresetEntry("studio_steel_e4", small_preset, info)])
    slots.show_choices(Choices(a="preset:studio_steel_e4", b="difference"))
    slots.show_gains({"a": -1.2, "b": 20.0})

    def shown() -> list[str]:
        return [button.text() for button in slots.findChildren(QPushButton) if button.text()[:1] in "AB"]

    first, second = (each for each in slots.findChildren(QPushButton) if each.text()[:1] in "AB")
    assert first.text().startswith("A  Steel E4") and "studio_steel_e4" not in first.accessibleName()
    assert (second.width(), second.text()) == (WIDTH, "B  DIFF.  +20 dB")
    slots.set_narrow(True)
    assert second.width() == NARROW_WIDTH and second.text().endswith("+20")
    slots.set_narrow(False)
    assert (second.width(), second.text()) == (WIDTH, "B  DIFF.  +20 dB")
    slots.show_choices(Choices(a="model", b="truth"))
    slots.show_gains({"a": 0.1, "b": -12.3})
    assert shown() == ["A  MODEL  +0.1 dB", "B  TRUTH  -12.3 dB"]
    slots.show_gains({})
    slots.set_narrow(True, tight=True)
    assert shown() == ["A  MODEL", "B  TRUTH"]
