"""The patch browser: what it lists, what its keys do, and that a deletion is asked twice."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QMimeData, QPoint, Qt, QUrl
from PySide6.QtGui import QDropEvent
from PySide6.QtWidgets import QWidget
from pytestqt.qtbot import QtBot

from app.patches.library import SHIPPED, PatchEntry
from app.patches.patch import Patch
from app.views.instrument.patch_browser import REALLY, PatchBrowser

LEFT = Qt.MouseButton.LeftButton
KEY = Qt.Key


def entry(guitar: Patch, name: str, own: bool = False, **changes: object) -> PatchEntry:
    folder = Path("/own") if own else SHIPPED
    return PatchEntry(folder / f"{name}.json", guitar.model_copy(update={"name": name, **changes}))


@pytest.fixture
def browser(qtbot: QtBot, guitar: Patch) -> Iterator[PatchBrowser]:
    window = QWidget()
    qtbot.addWidget(window)
    window.resize(1280, 800)
    made = PatchBrowser(window)
    entries = [
        entry(guitar, "nylon"),
        entry(guitar, "steel", description="Bright and long"),
        entry(guitar, "mine", own=True),
        entry(guitar, "harp of brass", category="harp"),
    ]
    made.show_entries(entries, {"steel"}, "steel")
    window.show()
    made.show_over()
    yield made
    made.dismiss()


def test_all_are_listed_under_their_categories(browser: PatchBrowser) -> None:
    assert browser.listed == ("nylon", "steel", "mine", "harp of brass")
    texts = [browser.list.item(row).text() for row in range(browser.list.count())]
    assert texts == ["GUITAR", "☆   nylon", "★   steel", "☆   mine   (own)", "HARP", "☆   harp of brass"]


@pytest.mark.parametrize(
    ("words", "found"),
    [("BRASS harp", ("harp of brass",)), ("long", ("steel",)), ("guitar mi", ("mine",)), ("tuba", ())],
)
def test_words_in_any_order_filter(qtbot: QtBot, browser: PatchBrowser, words: str, found: tuple[str, ...]) -> None:
    with qtbot.waitSignal(browser.listed_changed):
        browser.search.setText(words)
    assert browser.listed == found
    browser.dismiss()
    assert browser.listed, "closed without any, next and previous would lead nowhere"


def test_category_owner_and_favourites_filter(qtbot: QtBot, browser: PatchBrowser) -> None:
    browser._category.setCurrentIndex(browser._category.findData("harp"))
    assert browser.listed == ("harp of brass",)
    browser.clear_filter()
    browser._whose.setCurrentIndex(browser._whose.findData("own"))
    assert browser.listed == ("mine",)
    browser.clear_filter()
    browser._starred.setChecked(True)
    assert browser.listed == ("steel",)


def test_arrows_pass_headings_load_and_play_when_they_rest(qtbot: QtBot, browser: PatchBrowser) -> None:
    chosen: list[str] = []
    browser.chosen.connect(chosen.append)
    with qtbot.waitSignal(browser.audition_asked) as heard:
        for _ in range(2):
            qtbot.keyClick(browser.search if not chosen else browser.list, KEY.Key_Down)
    assert chosen == ["mine", "harp of brass"]
    assert heard.args == ["harp of brass"]
    qtbot.keyClick(browser.list, KEY.Key_PageUp)
    assert chosen[-1] == "nylon"


def test_space_plays_and_is_a_blank_in_a_search(qtbot: QtBot, browser: PatchBrowser) -> None:
    with qtbot.waitSignal(browser.audition_asked) as heard:
        qtbot.keyClick(browser.search, KEY.Key_Space)
    assert heard.args == ["steel"]
    qtbot.keyClicks(browser.search, "of b")
    assert browser.search.text() == "of b"


def test_control_d_makes_a_favourite(qtbot: QtBot, browser: PatchBrowser) -> None:
    with qtbot.waitSignal(browser.favourite_asked) as told:
        qtbot.keyClick(browser.list, KEY.Key_D, Qt.KeyboardModifier.ControlModifier)
    assert told.args == ["steel"]


def test_enter_takes_the_first_that_was_found_and_closes(qtbot: QtBot, browser: PatchBrowser) -> None:
    browser.search.setText("harp")
    with qtbot.waitSignal(browser.chosen) as told:
        qtbot.keyClick(browser.search, KEY.Key_Return)
    assert told.args == ["harp of brass"]
    assert not browser.isVisible()


def test_only_ones_own_can_be_renamed_or_deleted_and_that_is_asked_twice(qtbot: QtBot, browser: PatchBrowser) -> None:
    assert not browser._rename.isVisible()
    assert not browser._delete.isVisible()
    browser.set_chosen("mine")
    with qtbot.waitSignal(browser.rename_asked) as told:
        qtbot.mouseClick(browser._rename, LEFT)
    assert told.args == ["mine"]
    deleted: list[str] = []
    browser.delete_asked.connect(deleted.append)
    qtbot.mouseClick(browser._delete, LEFT)
    assert (browser._delete.text(), deleted) == (REALLY, [])
    browser.set_chosen("steel")
    browser.set_chosen("mine")
    qtbot.mouseClick(browser._delete, LEFT)
    assert deleted == [], "another was looked at meanwhile"
    qtbot.mouseClick(browser._delete, LEFT)
    assert deleted == ["mine"]


def test_what_is_shown_does_not_load(browser: PatchBrowser, guitar: Patch) -> None:
    chosen: list[str] = []
    browser.chosen.connect(chosen.append)
    browser.set_chosen("nylon")
    browser.show_entries([entry(guitar, "nylon"), entry(guitar, "new")], (), "new")
    assert chosen == []
    assert browser.list.currentItem().text() == "☆   new"


def test_a_dropped_patch_is_told_and_left_where_it_is(qtbot: QtBot, browser: PatchBrowser) -> None:
    mime = QMimeData()
    mime.setUrls([QUrl.fromLocalFile("/x/a.json"), QUrl.fromLocalFile("/x/b.wav")])
    actions = Qt.DropAction.MoveAction | Qt.DropAction.CopyAction
    event = QDropEvent(QPoint(5, 5), actions, mime, LEFT, Qt.KeyboardModifier.NoModifier)
    with qtbot.waitSignal(browser.file_dropped) as told:
        browser.dropEvent(event)
    assert told.args == ["/x/a.json"]
    assert event.dropAction() == Qt.DropAction.CopyAction


def test_it_is_named_after_what_it_lists(browser: PatchBrowser) -> None:
    assert browser.accessibleName() == "Browser of patches"
    assert browser.search.placeholderText() == browser.search.accessibleName() == "Search patches"
