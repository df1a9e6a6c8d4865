"""The preset bar and browser in the window: gestures and keys change the session, the session what they show."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from PySide6.QtCore import QMimeData, QPoint, QPointF, QRect, Qt, QUrl
from PySide6.QtGui import QDragEnterEvent, QDropEvent
from PySide6.QtWidgets import QAbstractButton, QComboBox, QLineEdit, QTreeView
from pytestqt.qtbot import QtBot

from app.export.files import export_sound
from app.export.sound import SoundRequest
from app.shared.vocabulary import Face
from app.views.controls.browser import Browser
from app.window.controller import Controller
from app.window.settings import FIRST_FAVOURITES, load_settings
from engine.pluck import Pluck
from engine.presets import load_preset, preset_digest, preset_files
from training.heard_file import Heard, add_heard

KEY = Qt.Key
CONTROL = Qt.KeyboardModifier.ControlModifier


@pytest.fixture
def face() -> Face:
    return "lab"


@pytest.fixture
def browser(qtbot: QtBot, controller: Controller) -> Browser:
    """Open, with the keyboard in its search."""
    qtbot.waitUntil(controller.window.isActiveWindow)
    qtbot.keyClick(controller.window, KEY.Key_P, CONTROL)
    found = controller.presets.browser
    assert found.isVisible()
    found.search.setFocus()
    return found


def listed(browser: Browser) -> list[str]:
    return browser.listed


def headings(browser: Browser) -> list[str]:
    lines = (browser.list.line(browser.list.model().index(row, 0)) for row in range(browser.list.model().rowCount()))
    return [line for line in lines if isinstance(line, str)]


def row_rect(browser: Browser, number: int) -> QRect:
    """Of a listed row, with its star."""
    title = browser.list.index_of(listed(browser)[number])
    return browser.list.visualRect(title.siblingAtColumn(0)).united(browser.list.visualRect(title))


def test_arrows_load_from_the_search_and_enter_closes(qtbot: QtBot, controller: Controller, browser: Browser) -> None:
    qtbot.keyClick(browser.search, KEY.Key_Down)
    assert controller.session.choices.preset == "second"
    assert browser.isVisible()
    assert not controller.performance.playing
    qtbot.keyClick(browser.search, KEY.Key_Down)
    assert controller.session.choices.preset == "second"
    qtbot.keyClick(browser.list, KEY.Key_Up)
    assert controller.session.choices.preset == "first"
    qtbot.keyClick(browser.search, KEY.Key_Return)
    assert not browser.isVisible()


def test_space_plucks_and_the_browser_stays(qtbot: QtBot, controller: Controller, browser: Browser) -> None:
    qtbot.keyClick(browser.search, KEY.Key_Space)
    assert browser.isVisible()
    assert browser.search.text() == ""
    qtbot.waitUntil(lambda: controller.performance.playing)


def test_space_between_two_words_is_typed_and_after_an_arrow_plucks(
    qtbot: QtBot, controller: Controller, browser: Browser
) -> None:
    asked: list[None] = []
    browser.played.connect(lambda name: asked.append(None))
    for key in "small sec":
        qtbot.keyClick(browser.search, key)
    assert (browser.search.text(), listed(browser), asked) == ("small sec", ["second"], [])
    qtbot.keyClick(browser.search, KEY.Key_Down)
    assert browser.list.hasFocus()
    qtbot.keyClick(browser.list, KEY.Key_Space)
    assert (browser.search.text(), len(asked)) == ("small sec", 1)
    qtbot.keyClick(browser.list, KEY.Key_Backspace)
    assert browser.search.hasFocus()
    assert browser.search.text() == "small se"
    browser.dismiss()
    controller.presets.toggle()  # with the words of last time, to be typed over
    qtbot.keyClick(browser.search, KEY.Key_Space)
    assert (browser.search.text(), len(asked)) == ("small se", 2)


def test_typing_filters_and_what_was_chosen_stays(qtbot: QtBot, controller: Controller, browser: Browser) -> None:
    qtbot.keyClicks(browser.list, "sec")
    assert browser.search.text() == "sec"
    assert listed(browser) == ["second"]
    assert controller.session.choices.preset == "first"
    assert "File</td><td style='padding: 3px 0'>second, " in browser.card.text(), "the card is that of the hit"
    qtbot.keyClicks(browser.search, "x")
    assert listed(browser) == []
    assert "No matching preset" in browser.card.text()
    qtbot.keyClick(browser.search, KEY.Key_Down)  # nothing to move to
    browser.search.setText("sec")
    qtbot.keyClick(browser.search, KEY.Key_Return)
    assert controller.session.choices.preset == "second"
    qtbot.keyClick(controller.window, KEY.Key_PageDown)  # goes round in the filtered list
    assert controller.session.choices.preset == "second"
    controller.session.update(preset="first")
    qtbot.keyClick(controller.window, KEY.Key_PageDown)
    assert controller.session.choices.preset == "second"


def test_keys_of_the_window_rest_while_the_search_is_typed_in(
    qtbot: QtBot, controller: Controller, browser: Browser
) -> None:
    qtbot.keyClick(browser.list, KEY.Key_X)
    assert controller.session.choices.heard == "a"
    assert browser.search.text() == "x"


def test_filters_by_kind(controller: Controller, browser: Browser) -> None:
    strings = browser.filters["String"]
    assert [strings.itemText(row) for row in range(strings.count())] == ["All strings", "With pitch glide"]
    browser.filters["Rate"].setCurrentIndex(browser.filters["Rate"].findData(4000))
    browser.filters["Model"].setCurrentIndex(browser.filters["Model"].findData("koopman_var"))
    assert listed(browser) == ["first", "second"]


def test_a_filter_is_reported_beside_the_preset_and_cleared_there(
    qtbot: QtBot, controller: Controller, browser: Browser
) -> None:
    """Previous and next go through what it leaves."""
    bar, session = controller.window.presets, controller.session
    assert not bar.filtered.isVisible()
    qtbot.keyClicks(browser.search, "second")
    browser.filters["Rate"].setCurrentIndex(1)
    browser.dismiss()
    assert bar.filtered.isVisible()
    assert bar.filtered.text() == "1 of 2  ✕"
    for _ in range(2):
        bar.step_asked.emit(1)
        assert session.choices.preset == "second"
    bar.filtered.click()
    assert not bar.filtered.isVisible()
    assert (browser.search.text(), browser.filters["Rate"].currentIndex(), len(listed(browser))) == ("", 0, 2)
    bar.step_asked.emit(1)
    assert session.choices.preset == "first"


def test_a_search_without_a_find_ends_with_the_browser(
    qtbot: QtBot, controller: Controller, browser: Browser
) -> None:
    qtbot.keyClicks(browser.search, "zzz")
    assert controller.window.presets.filtered.isVisible()
    qtbot.keyClick(browser.search, KEY.Key_Escape)
    assert not controller.window.presets.filtered.isVisible()
    qtbot.keyClick(controller.window, KEY.Key_PageDown)
    assert controller.session.choices.preset == "second"


def test_the_marked_row_is_the_chosen_preset_or_the_first_hit(controller: Controller, browser: Browser) -> None:
    controller.session.update(preset="second")
    for words, marked in (("first", ["first"]), ("", ["second"]), ("zzz", []), ("", ["second"])):
        browser.search.setText(words)
        rows = browser.list.selectionModel().selectedRows()
        assert [browser.list.line(row).name for row in rows] == marked


def test_the_card_and_the_keys_are_those_of_the_first_hit(
    qtbot: QtBot, controller: Controller, browser: Browser
) -> None:
    browser.search.setText("second")
    assert "File</td><td style='padding: 3px 0'>second, " in browser.card.text()
    with qtbot.waitSignal(browser.favourite_asked) as asked:
        qtbot.keyClick(browser.list, KEY.Key_D, CONTROL)
    assert asked.args == ["second"]
    assert controller.session.choices.preset == "first"
    qtbot.keyClick(browser.list, KEY.Key_Space)
    assert controller.session.choices.preset == "second"
    qtbot.waitUntil(lambda: controller.performance.playing)


def test_a_click_loads_the_first_hit(qtbot: QtBot, controller: Controller, browser: Browser) -> None:
    browser.search.setText("second")
    place = row_rect(browser, 0).center()
    qtbot.mouseClick(browser.list.viewport(), Qt.MouseButton.LeftButton, pos=place)
    assert controller.session.choices.preset == "second"


def test_an_old_search_does_not_hide_what_was_just_added(
    controller: Controller, preset_folder: Path, small_preset: Path
) -> None:
    browser = controller.presets.browser
    browser.search.setText("second")
    shutil.copy(small_preset, preset_folder / "third.safetensors")
    controller.presets.toggle()
    assert browser.search.text() == ""
    assert "third" in listed(browser)
    browser.search.setText("second")
    controller.presets.toggle()
    controller.presets.toggle()
    assert browser.search.text() == "second", "nothing was added since"


def test_favourites_are_on_top(controller: Controller, browser: Browser) -> None:
    browser.favourite_asked.emit("second")
    assert listed(browser) == ["second", "first"]
    browser.favourite_asked.emit("second")
    assert listed(browser) == ["first", "second"]


def test_studio_presets_are_a_group_of_their_own_before_the_research_ones(
    qtbot: QtBot, controller: Controller, browser: Browser, preset_folder: Path, small_preset: Path
) -> None:
    """The headings are passed over by arrows and page keys, which go through both groups in the listed order."""

    def groups() -> dict[str, int]:
        rows = browser.list.rows
        return {heading: sum(row.heading == heading for row in rows) for heading in headings(browser)}

    shutil.copy(small_preset, preset_folder / "studio_zither.safetensors")
    browser.favourite_asked.emit("second")
    browser.dismiss()
    controller.presets.toggle()
    assert groups() == {"STUDIO PRESETS": 1, "RESEARCH PRESETS": 2}
    assert listed(browser) == ["studio_zither", "second", "first"]  # a favourite is first of its group
    qtbot.keyClick(browser.list, KEY.Key_Up)
    assert controller.session.choices.preset == "second"
    qtbot.keyClick(browser.list, KEY.Key_Up)
    assert controller.session.choices.preset == "studio_zither"
    qtbot.keyClick(browser.list, KEY.Key_Up)
    assert controller.session.choices.preset == "studio_zither"
    heading = browser.list.visualRect(browser.list.model().index(2, 0)).center()
    qtbot.mouseClick(browser.list.viewport(), Qt.MouseButton.LeftButton, pos=heading)
    assert controller.session.choices.preset == "studio_zither"
    browser.search.setText("second")
    assert groups() == {"RESEARCH PRESETS": 1}
    browser.clear_filter()
    browser.dismiss()
    for name in ("second", "first", "studio_zither"):
        qtbot.keyClick(controller.window, KEY.Key_PageDown)
        assert controller.session.choices.preset == name


def test_favourites_are_kept(qtbot: QtBot, controller: Controller, browser: Browser, tmp_path: Path) -> None:
    qtbot.keyClick(browser.search, KEY.Key_D, CONTROL)
    assert controller.presets.favourites == {"first", *FIRST_FAVOURITES}
    assert "★" in controller.window.presets.name.text()
    browser.starred.click()
    assert listed(browser) == ["first"]
    place = row_rect(browser, 0).topLeft() + QPoint(6, 6)
    qtbot.mouseClick(browser.list.viewport(), Qt.MouseButton.LeftButton, pos=place)
    assert listed(browser) == []
    browser.starred.click()
    browser.favourite_asked.emit("second")
    controller.window.close()
    assert load_settings(tmp_path / "settings.json")[0].favourites == ("second", *sorted(FIRST_FAVOURITES))


def test_the_first_favourites_are_shipped() -> None:
    assert {path.stem for path in preset_files()} >= set(FIRST_FAVOURITES)


def test_the_card_reports_what_a_musician_wants_to_know(controller: Controller, browser: Browser) -> None:
    card = browser.card.text()
    for words in ("A small string", "4 kHz", "the first 0.1 s", "25 % of the motion", "Licence", "MIT", "kB"):
        assert words in card
    assert "To remake" not in card
    assert "A small string" in controller.window.presets.name.text()


def test_the_error_stays_in_the_header_where_there_is_little_room(controller: Controller) -> None:
    card = controller.window.presets.card
    for width in (1200, 400, 300):
        card.resize(width, 20)
        assert card.shown.endswith("validation error 25 %")
    assert "parameters" in card.text()


def test_every_control_of_bar_and_browser_has_a_name_and_a_tip(controller: Controller, browser: Browser) -> None:
    for part in (browser, controller.window.presets):
        for kind in (QAbstractButton, QComboBox, QLineEdit, QTreeView):
            for control in part.findChildren(kind):
                if control.focusPolicy() != Qt.FocusPolicy.NoFocus:
                    assert control.accessibleName(), control
                    assert control.toolTip(), control.accessibleName()


def test_presets_put_into_the_folder_appear_when_it_is_opened(
    controller: Controller, small_preset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(tmp_path / "own"))
    (tmp_path / "own").mkdir()
    shutil.copy(small_preset, tmp_path / "own" / "mine.safetensors")
    (tmp_path / "own" / "bad.safetensors").write_bytes(b"?")
    controller.presets.toggle()
    assert listed(controller.presets.browser) == ["first", "mine", "second"]
    assert "bad.safetensors" in controller.window.notices.text
    assert str(tmp_path / "own") in controller.presets.browser.state.text()


def drop(controller: Controller, *files: Path) -> None:
    """As from a file manager that proposes to move them."""
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(file)) for file in files])
    actions, button = Qt.DropAction.CopyAction | Qt.DropAction.MoveAction, Qt.MouseButton.LeftButton
    over = QDragEnterEvent(QPoint(50, 50), actions, data, button, Qt.KeyboardModifier.NoModifier)
    dropped = QDropEvent(QPointF(50, 50), actions, data, button, Qt.KeyboardModifier.NoModifier)
    for event, take in ((over, controller.window.dragEnterEvent), (dropped, controller.window.dropEvent)):
        event.setDropAction(Qt.DropAction.MoveAction)
        take(event)
        assert event.isAccepted()
        assert event.dropAction() == Qt.DropAction.CopyAction


def test_a_file_over_any_view_reaches_the_window(controller: Controller) -> None:
    window = controller.window
    for view in controller.panels:
        under = view.childAt(view.rect().center()) or view
        while under is not window:
            assert not under.acceptDrops(), under
            under = under.parentWidget()
    assert window.acceptDrops()


def test_dropped_files_are_taken_in(
    controller: Controller, preset_folder: Path, small_preset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(tmp_path / "own"))
    new = tmp_path / "new.safetensors"
    new.write_bytes(small_preset.read_bytes().replace(b"A small string", b"Another string"))
    drop(controller, new)
    assert controller.session.choices.preset == "new"
    assert controller.window.presets.name.text().startswith("Another string")
    assert (tmp_path / "own" / "new.safetensors").is_file()
    request = SoundRequest(load_preset(preset_folder / "first.safetensors"), Pluck(0.5, 2.0), 0.3, 0.6, "truth")
    export_sound(request, tmp_path / "a.wav")
    drop(controller, tmp_path / "a.wav")
    choices = controller.session.choices
    assert (choices.pluck, choices.listen, choices.seconds) == (Pluck(0.5, 2.0), 0.3, 0.6)
    assert (choices.preset, choices.source_heard) == ("first", "truth")
    monkeypatch.setattr("app.window.dropped_files.restored_choices", lambda recipe: {"listen": 3})
    drop(controller, tmp_path / "a.wav")
    assert "its choices cannot be restored here (listen: " in controller.window.notices.text
    drop(controller, tmp_path / "foreign.txt")
    assert "not a file that is used here" in controller.window.notices.text
    assert controller.session.choices == choices


def test_browser_and_card_say_how_true_a_preset_sounds(
    qtbot: QtBot, controller: Controller, browser: Browser, preset_folder: Path, small_preset: Path
) -> None:
    second = preset_folder / "second.safetensors"
    second.write_bytes(small_preset.read_bytes().replace(b"A small string", b"<i>sma</i> str"))
    digest = preset_digest(second)
    add_heard(preset_folder, [Heard("<b>bold</b>", digest, 4.0, 7.4, 5.2, 3.0, 13.0)])
    browser.dismiss()
    controller.presets.toggle()
    assert listed(browser) == ["second", "first"]  # what was not measured is last
    rows = [browser.list.index_of(name) for name in listed(browser)]
    assert [row.siblingAtColumn(4).data() for row in rows] == ["pitch 13 cents too high …", "not measured"]
    assert "&lt;i&gt;sma&lt;/i&gt; str" in rows[0].data(Qt.ItemDataRole.ToolTipRole)
    assert "evaluate first --heard --write" in browser.card.text()
    controller.session.update(preset="second")
    card = browser.card.text()
    assert "past training: pitch 13 cents too high; grows, +5 dB; spectra 7.4 dB apart over 4 s" in card
    assert "<b>bold</b>" not in card
    browser.order.setCurrentIndex(browser.order.findText("By name"))
    assert listed(browser) == ["first", "second"]
    browser.clear_filter()  # the order is no filter
    assert listed(browser) == ["first", "second"]
    qtbot.keyClicks(browser.search, "grows")
    assert listed(browser) == []
    browser.search.setText("13 cents")
    assert listed(browser) == ["second"]
