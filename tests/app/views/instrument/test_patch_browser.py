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


def test_the_first_hit_is_selected_shown_and_what_keys_are_for(qtbot: QtBot, browser: PatchBrowser) -> None:
    chosen: list[str] = []
    browser.chosen.connect(chosen.append)
    browser.search.setText("guitar")
    assert browser.listed == ("nylon", "steel", "mine")
    assert (browser.selected, browser._title.text()) == ("steel", "steel"), "what is loaded, if it is listed"
    browser.search.setText("harp")
    assert (browser.selected, browser._title.text()) == ("harp of brass", "harp of brass")
    assert browser.list.currentItem().text().endswith("harp of brass")
    with qtbot.waitSignal(browser.favourite_asked) as told:
        qtbot.mouseClick(browser._star, LEFT)
    assert told.args == ["harp of brass"]
    with qtbot.waitSignal(browser.audition_asked) as told:
        qtbot.mouseClick(browser._play, LEFT)
    assert told.args == ["harp of brass"]
    assert chosen == [], "it is shown, not loaded"
    browser.search.setText("tuba")
    assert (browser.selected, browser._title.text()) == ("", "No matching patch")
    browser.search.clear()
    assert browser.selected == "steel"


def test_a_hit_by_its_name_is_better_than_one_by_its_description(
    qtbot: QtBot, browser: PatchBrowser, guitar: Patch
) -> None:
    sharp = entry(guitar, "bass", description="Starts sharp")
    browser.show_entries([sharp, entry(guitar, "nylon"), entry(guitar, "brass harp")], (), "nylon")
    browser.search.setText("harp")
    assert (browser.listed, browser.selected) == (("bass", "brass harp"), "brass harp")
    browser.search.setText("starts")
    assert browser.selected == "bass"
    browser.set_chosen("bass")
    browser.search.setText("harp")
    assert browser.selected == "brass harp", "although the loaded one is listed too"
    place = browser.list.visualItemRect(browser.list.item(1)).center()
    qtbot.mouseClick(browser.list.viewport(), LEFT, pos=place)
    assert browser.selected == browser._title.text() == "bass"


@pytest.mark.parametrize("loads", ["arrow", "click", "Enter"])
def test_the_first_hit_is_loaded_although_it_is_selected_already(
    qtbot: QtBot, browser: PatchBrowser, loads: str
) -> None:
    chosen: list[str] = []
    browser.chosen.connect(chosen.append)
    browser._category.setCurrentIndex(browser._category.findData("harp"))
    if loads == "click":
        place = browser.list.visualItemRect(browser.list.currentItem()).center()
        qtbot.mouseClick(browser.list.viewport(), LEFT, pos=place)
    else:
        qtbot.keyClick(browser.search, KEY.Key_Down if loads == "arrow" else KEY.Key_Return)
    assert chosen == ["harp of brass"]


def test_typing_searches_wherever_the_focus_is(qtbot: QtBot, browser: PatchBrowser) -> None:
    for focused in (browser.list, browser._category, browser._starred, browser._play, browser.search):
        browser.search.clear()
        focused.setFocus()
        qtbot.keyClicks(focused, "h")
        assert browser.search.hasFocus()
        qtbot.keyClicks(browser.search, "arp")
        assert browser.search.text() == "harp"
        assert browser._category.currentIndex() == 0
    browser._category.setFocus()
    qtbot.keyClick(browser._category, KEY.Key_Escape)
    assert not browser.isVisible()


def test_a_heading_is_not_selected(qtbot: QtBot, browser: PatchBrowser) -> None:
    chosen: list[str] = []
    browser.chosen.connect(chosen.append)
    heading = browser.list.visualItemRect(browser.list.item(0)).center()
    qtbot.mouseClick(browser.list.viewport(), LEFT, pos=heading)
    assert (browser.selected, chosen) == ("steel", [])
    assert browser.list.currentItem().text().endswith("steel")


def test_an_entry_that_a_search_hides_is_revealed(browser: PatchBrowser) -> None:
    browser.search.setText("harp")
    browser.reveal("harp of brass")
    assert browser.search.text() == "harp"
    browser.reveal("mine")
    assert browser.search.text() == ""
    assert "mine" in browser.listed


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
