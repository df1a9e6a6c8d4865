"""The patch browser: what it lists, what its keys do, and that a deletion is asked twice."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QPoint, QRect, Qt
from PySide6.QtWidgets import QWidget
from pytestqt.qtbot import QtBot

from app.patches.library import SHIPPED, PatchEntry
from app.patches.patch import Patch
from app.views.controls.browser import REALLY, Browser
from app.views.controls.notice_bar import NoticeBar
from app.views.instrument.patch_card import patch_browser, patch_row

LEFT = Qt.MouseButton.LeftButton
KEY = Qt.Key


def entry(guitar: Patch, name: str, own: bool = False, **changes: object) -> PatchEntry:
    folder = Path("/own") if own else SHIPPED
    return PatchEntry(folder / f"{name}.json", guitar.model_copy(update={"name": name, **changes}))


def lines(browser: Browser) -> list[str]:
    """What stands in the list, from top to bottom."""
    model = browser.list.model()
    cells = ((model.index(row, column).data() for column in range(2)) for row in range(model.rowCount()))
    return [" ".join(filter(None, texts)) for texts in cells]


def place(browser: Browser, row: int) -> QRect:
    return browser.list.visualRect(browser.list.model().index(row, 1))


def current(browser: Browser) -> str:
    return str(browser.list.currentIndex().data())


@pytest.fixture
def browser(qtbot: QtBot, guitar: Patch) -> Iterator[Browser]:
    window = QWidget()
    qtbot.addWidget(window)
    window.resize(1280, 800)
    made = patch_browser(window)
    entries = [
        entry(guitar, "nylon"),
        entry(guitar, "steel", description="Bright and long"),
        entry(guitar, "mine", own=True),
        entry(guitar, "harp of brass", category="harp"),
    ]
    made.show_rows([patch_row(each) for each in entries], {"steel"}, "steel", "/own")
    window.show()
    made.show_over()
    yield made
    made.dismiss()


def test_all_are_listed_under_their_categories(browser: Browser) -> None:
    """Favourites first in each."""
    assert browser.listed == ["steel", "nylon", "mine", "harp of brass"]
    assert lines(browser) == ["GUITAR", "★ steel", "☆ nylon", "☆ mine   (own)", "HARP", "☆ harp of brass"]


@pytest.mark.parametrize(
    ("words", "found"),
    [("BRASS harp", ["harp of brass"]), ("long", ["steel"]), ("guitar mi", ["mine"]), ("tuba", [])],
)
def test_words_in_any_order_filter(qtbot: QtBot, browser: Browser, words: str, found: list[str]) -> None:
    with qtbot.waitSignal(browser.listed_changed):
        browser.search.setText(words)
    assert browser.listed == found
    browser.dismiss()
    assert browser.listed, "closed without any, next and previous would lead nowhere"


def test_category_owner_and_favourites_filter(qtbot: QtBot, browser: Browser) -> None:
    browser.filters["Category"].setCurrentIndex(browser.filters["Category"].findData("harp"))
    assert browser.listed == ["harp of brass"]
    browser.clear_filter()
    browser.filters["Bank"].setCurrentIndex(browser.filters["Bank"].findData("user"))
    assert browser.listed == ["mine"]
    browser.clear_filter()
    browser.starred.setChecked(True)
    assert browser.listed == ["steel"]


def test_arrows_pass_headings_load_and_play_when_they_rest(qtbot: QtBot, browser: Browser) -> None:
    chosen: list[str] = []
    browser.chosen.connect(chosen.append)
    with qtbot.waitSignal(browser.played) as heard:
        for _ in range(3):
            qtbot.keyClick(browser.search if not chosen else browser.list, KEY.Key_Down)
    assert chosen == ["nylon", "mine", "harp of brass"]
    assert heard.args == ["harp of brass"]
    qtbot.keyClick(browser.list, KEY.Key_PageUp)
    assert chosen[-1] == "steel"


def test_space_plays_and_is_a_blank_in_a_search(qtbot: QtBot, browser: Browser) -> None:
    with qtbot.waitSignal(browser.played) as heard:
        qtbot.keyClick(browser.search, KEY.Key_Space)
    assert heard.args == ["steel"]
    qtbot.keyClicks(browser.search, "of b")
    assert browser.search.text() == "of b"


def test_the_first_hit_is_selected_shown_and_what_keys_are_for(qtbot: QtBot, browser: Browser) -> None:
    chosen: list[str] = []
    browser.chosen.connect(chosen.append)
    browser.search.setText("guitar")
    assert browser.listed == ["steel", "nylon", "mine"]
    assert browser.selected == "steel" and "<b>steel</b>" in browser.card.text(), "what is loaded, if it is listed"
    browser.search.setText("harp")
    assert browser.selected == "harp of brass" and "<b>harp of brass</b>" in browser.card.text()
    assert current(browser) == "harp of brass"
    with qtbot.waitSignal(browser.favourite_asked) as reported:
        qtbot.mouseClick(browser.star, LEFT)
    assert reported.args == ["harp of brass"]
    assert chosen == [], "it is shown, not loaded"
    with qtbot.waitSignal(browser.played) as reported:
        qtbot.mouseClick(browser.play_button, LEFT)
    assert reported.args == chosen == ["harp of brass"]
    browser.search.setText("tuba")
    assert browser.selected == "" and browser.card.text().startswith("No matching instrument")
    browser.search.clear()
    assert browser.selected == "harp of brass"


def test_a_hit_by_its_name_is_better_than_one_by_its_description(
    qtbot: QtBot, browser: Browser, guitar: Patch
) -> None:
    sharp = entry(guitar, "bass", description="Starts sharp")
    entries = [sharp, entry(guitar, "nylon"), entry(guitar, "brass harp")]
    browser.show_rows([patch_row(each) for each in entries], (), "nylon", "/own")
    browser.search.setText("harp")
    assert (browser.listed, browser.selected) == (["bass", "brass harp"], "brass harp")
    browser.search.setText("starts")
    assert browser.selected == "bass"
    browser.set_chosen("bass")
    browser.search.setText("harp")
    assert browser.selected == "brass harp", "although the loaded one is listed too"
    qtbot.mouseClick(browser.list.viewport(), LEFT, pos=place(browser, 1).center())
    assert browser.selected == "bass" and "<b>bass</b>" in browser.card.text()


@pytest.mark.parametrize("loads", ["arrow", "click", "Enter"])
def test_the_first_hit_is_loaded_although_it_is_selected_already(qtbot: QtBot, browser: Browser, loads: str) -> None:
    chosen: list[str] = []
    browser.chosen.connect(chosen.append)
    browser.filters["Category"].setCurrentIndex(browser.filters["Category"].findData("harp"))
    if loads == "click":
        where = browser.list.visualRect(browser.list.currentIndex()).center()
        qtbot.mouseClick(browser.list.viewport(), LEFT, pos=where)
    else:
        qtbot.keyClick(browser.search, KEY.Key_Down if loads == "arrow" else KEY.Key_Return)
    assert chosen == ["harp of brass"]


def test_typing_searches_wherever_the_focus_is(qtbot: QtBot, browser: Browser) -> None:
    for focused in (browser.list, browser.filters["Category"], browser.starred, browser.play_button, browser.search):
        browser.search.clear()
        focused.setFocus()
        qtbot.keyClicks(focused, "h")
        assert browser.search.hasFocus()
        qtbot.keyClicks(browser.search, "arp")
        assert browser.search.text() == "harp"
        assert browser.filters["Category"].currentIndex() == 0
    browser.filters["Category"].setFocus()
    qtbot.keyClick(browser.filters["Category"], KEY.Key_Escape)
    assert not browser.isVisible()


def test_a_heading_is_not_selected(qtbot: QtBot, browser: Browser) -> None:
    chosen: list[str] = []
    browser.chosen.connect(chosen.append)
    qtbot.mouseClick(browser.list.viewport(), LEFT, pos=place(browser, 0).center())
    assert (browser.selected, chosen) == ("steel", [])
    assert current(browser) == "steel"


def test_an_entry_that_a_search_hides_is_revealed(browser: Browser) -> None:
    browser.search.setText("harp")
    browser.reveal("harp of brass")
    assert browser.search.text() == "harp"
    browser.reveal("mine")
    assert browser.search.text() == ""
    assert "mine" in browser.listed


def test_control_d_makes_a_favourite(qtbot: QtBot, browser: Browser) -> None:
    with qtbot.waitSignal(browser.favourite_asked) as reported:
        qtbot.keyClick(browser.list, KEY.Key_D, Qt.KeyboardModifier.ControlModifier)
    assert reported.args == ["steel"]


def test_enter_takes_the_first_that_was_found_and_closes(qtbot: QtBot, browser: Browser) -> None:
    browser.search.setText("harp")
    with qtbot.waitSignal(browser.chosen) as reported:
        qtbot.keyClick(browser.search, KEY.Key_Return)
    assert reported.args == ["harp of brass"]
    assert not browser.isVisible()


def test_only_ones_own_can_be_renamed_or_deleted_and_that_is_asked_twice(qtbot: QtBot, browser: Browser) -> None:
    assert not browser.rename.isVisible()
    assert not browser.delete.isVisible()
    browser.set_chosen("mine")
    with qtbot.waitSignal(browser.rename_asked) as reported:
        qtbot.mouseClick(browser.rename, LEFT)
    assert reported.args == ["mine"]
    deleted: list[str] = []
    browser.delete_asked.connect(deleted.append)
    qtbot.mouseClick(browser.delete, LEFT)
    assert (browser.delete.text(), deleted) == (REALLY, [])
    browser.set_chosen("steel")
    browser.set_chosen("mine")
    qtbot.mouseClick(browser.delete, LEFT)
    assert deleted == [], "another was looked at meanwhile"
    qtbot.mouseClick(browser.delete, LEFT)
    assert deleted == ["mine"]


def test_what_is_shown_does_not_load(browser: Browser, guitar: Patch) -> None:
    chosen: list[str] = []
    browser.chosen.connect(chosen.append)
    browser.set_chosen("nylon")
    browser.show_rows([patch_row(entry(guitar, name)) for name in ("nylon", "new")], (), "new", "/own")
    assert chosen == []
    assert current(browser) == "new"


def test_a_notice_is_not_hidden_behind_it(browser: Browser) -> None:
    notices = NoticeBar(browser.parentWidget())
    notices.place(QPoint(14, 50), 1200)
    browser.place()
    alone = browser.y()
    notices.report("No sound.")
    assert browser.y() > notices.geometry().bottom()
    notices.hide()
    assert browser.y() == alone == notices.y()


def test_it_is_named_after_what_it_lists(browser: Browser) -> None:
    assert browser.accessibleName() == "Browser of instruments"
    assert browser.search.placeholderText() == browser.search.accessibleName() == "Search instruments"
