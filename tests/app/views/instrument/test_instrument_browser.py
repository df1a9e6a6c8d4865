"""The instrument browser: what it lists, what its keys do, and that a deletion is asked twice."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QRect, Qt
from PySide6.QtWidgets import QWidget
from pytestqt.qtbot import QtBot

from app.instruments.instrument import Instrument
from app.instruments.library import SHIPPED, InstrumentEntry
from app.views.controls.browser import REALLY, Browser
from app.views.instrument.instrument_card import instrument_browser, instrument_row
from tests.app.gestures import LEFT, press_keys, reported

Key = Qt.Key


def entry(guitar: Instrument, name: str, own: bool = False, **changes: object) -> InstrumentEntry:
    folder = Path("/own") if own else SHIPPED
    return InstrumentEntry(folder / f"{name}.json", guitar.model_copy(update={"name": name, **changes}))


def show(browser: Browser, entries: list[InstrumentEntry], chosen: str) -> None:
    browser.show_rows([instrument_row(each) for each in entries], {"steel"}, chosen, "/own")


def place(browser: Browser, row: int) -> QRect:
    return browser.list.visualRect(browser.list.model().index(row, 1))


def state(browser: Browser) -> tuple[str, str]:
    """What is selected, and what the list has as its current row."""
    return browser.selected, str(browser.list.currentIndex().data())


@pytest.fixture
def browser(qtbot: QtBot, guitar: Instrument) -> Iterator[Browser]:
    """Of nylon, steel, which is a favourite and loaded, one's own and a harp."""
    window = QWidget()
    qtbot.addWidget(window)
    window.resize(1280, 800)
    made = instrument_browser(window)
    entries = [
        entry(guitar, "nylon"),
        entry(guitar, "steel", description="Bright and long"),
        entry(guitar, "mine", own=True),
        entry(guitar, "harp of brass", category="harp"),
    ]
    show(made, entries, "steel")
    window.show()
    made.show_over()
    yield made
    made.dismiss()


@pytest.fixture
def chosen(browser: Browser) -> list[str]:
    return reported(browser.chosen)


def test_words_in_any_order_category_owner_and_favourites_filter(browser: Browser) -> None:
    for words, name, key, listed in (
        ("BRASS harp", "", "", ["harp of brass"]),
        ("long", "", "", ["steel"]),
        ("guitar mi", "", "", ["mine"]),
        ("", "Category", "harp", ["harp of brass"]),
        ("", "Bank", "user", ["mine"]),
        ("", "starred", "", ["steel"]),
    ):
        browser.search.setText(words)
        browser.starred.setChecked(name == "starred")
        if key:
            browser.filters[name].setCurrentIndex(browser.filters[name].findData(key))
        assert browser.listed == listed
        browser.clear_filter()
        assert len(browser.listed) == 4
    browser.search.setText("tuba")
    assert browser.listed == []
    browser.dismiss()
    assert browser.listed, "closed without any, next and previous would lead nowhere"


def test_arrows_pass_headings_load_and_play_when_they_rest(qtbot: QtBot, browser: Browser, chosen: list[str]) -> None:
    with qtbot.waitSignal(browser.played) as heard:
        for _ in range(3):
            press_keys(browser.search if not chosen else browser.list, Key.Key_Down)
    assert chosen == ["nylon", "mine", "harp of brass"]
    assert heard.args == ["harp of brass"]
    press_keys(browser.list, Key.Key_PageUp)
    assert chosen[-1] == "steel"


def test_the_first_hit_is_selected_shown_and_what_buttons_are_for(
    qtbot: QtBot, browser: Browser, chosen: list[str]
) -> None:
    asked = reported(browser.favourite_asked, browser.played)
    browser.search.setText("guitar")
    assert browser.selected == "steel" and "<b>steel</b>" in browser.card.text(), "what is loaded, if it is listed"
    browser.search.setText("harp")
    assert state(browser) == ("harp of brass", "harp of brass") and "<b>harp of brass</b>" in browser.card.text()
    qtbot.mouseClick(browser.star, LEFT)
    assert (asked, chosen) == (["harp of brass"], []), "it is shown, not loaded"
    qtbot.mouseClick(browser.play_button, LEFT)
    assert asked[1:] == chosen == ["harp of brass"]
    browser.search.setText("tuba")
    assert browser.selected == "" and browser.card.text().startswith("No matching instrument")
    browser.search.clear()
    assert browser.selected == "harp of brass"


def test_a_hit_by_its_name_is_better_than_one_by_its_description(
    qtbot: QtBot, browser: Browser, guitar: Instrument
) -> None:
    entries = [entry(guitar, "bass", description="Starts sharp"), entry(guitar, "nylon"), entry(guitar, "brass harp")]
    show(browser, entries, "nylon")
    for words, selected in (("harp", "brass harp"), ("starts", "bass")):
        browser.search.setText(words)
        assert browser.selected == selected
    browser.set_chosen("bass")
    browser.search.setText("harp")
    assert (browser.listed, browser.selected) == (["bass", "brass harp"], "brass harp"), "although bass is loaded"
    qtbot.mouseClick(browser.list.viewport(), LEFT, pos=place(browser, 1).center())
    assert browser.selected == "bass" and "<b>bass</b>" in browser.card.text()


def test_only_ones_own_can_be_renamed_or_deleted_and_that_is_asked_twice(qtbot: QtBot, browser: Browser) -> None:
    renamed, deleted = reported(browser.rename_asked), reported(browser.delete_asked)
    assert not browser.rename.isVisible() and not browser.delete.isVisible()
    browser.set_chosen("mine")
    qtbot.mouseClick(browser.rename, LEFT)
    assert renamed == ["mine"]
    qtbot.mouseClick(browser.delete, LEFT)
    assert (browser.delete.text(), deleted) == (REALLY, [])
    browser.set_chosen("steel")
    browser.set_chosen("mine")
    for asked in ([], ["mine"]):  # first: another was looked at meanwhile
        qtbot.mouseClick(browser.delete, LEFT)
        assert deleted == asked


def test_it_fits_a_small_window_wherever_the_folder_lies(browser: Browser, guitar: Instrument) -> None:
    browser.parentWidget().resize(853, 480)  # 1280 × 720 at 150 %
    rows = [instrument_row(each) for each in (entry(guitar, "steel"), entry(guitar, "mine", own=True))]
    for name in ("steel", "mine"):
        browser.show_rows(rows, {"steel"}, name, "/home/musician" + "/a long name" * 30)
        browser.select(name)
        browser.place()
        assert browser.rename.isVisible() == (name == "mine")
        assert browser.layout().minimumSize().width() <= browser.width()
        assert browser.state.text().endswith("/a long name")
