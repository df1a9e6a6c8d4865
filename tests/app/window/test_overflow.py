"""With large text in a small window no control is lost: it is seen, scrolled to, or in an overflow menu."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from PySide6.QtCore import QRect, Qt
from PySide6.QtWidgets import QAbstractButton, QApplication, QComboBox, QLabel, QWidget
from pytestqt.qtbot import QtBot

from app.shared.vocabulary import Face
from app.views import theme
from app.views.controls.knob import Knob
from app.views.controls.overflow import Overflow
from app.views.controls.sideways import Sideways
from app.window.controller import Controller
from app.window.main_window import MainWindow

SIZES = [(1280, 720), (1024, 640)]


@pytest.fixture
def sized(qapp: QApplication) -> Iterator[None]:
    """Puts the text back as it was."""
    sheet, font = qapp.styleSheet(), qapp.font()
    yield
    theme.apply_theme(qapp, "dark")
    qapp.setStyleSheet(sheet)
    qapp.setFont(font)


def controls(window: MainWindow) -> list[QWidget]:
    """What is operated or read in the rows, as far as it is there; the plots make room for the keys as a whole."""
    apart = (window.left, window.right, window._shown, window.notices, window._brand, window.instrument._hint)
    return [
        each
        for each in window.findChildren(QWidget)
        if (isinstance(each, QAbstractButton | QComboBox | Knob) or (isinstance(each, QLabel) and each.text()))
        and not isinstance(each, Overflow)
        and each.window() is window
        and each.isVisible()
        and not any(part is each or part.isAncestorOf(each) for part in apart)
    ]


def is_there(window: MainWindow, control: QWidget) -> bool:
    menus = [each for each in window.findChildren(Overflow) if each.isVisible() and each.visibleRegion()]
    if any(control in menu.parts for menu in menus):
        return True
    if not control.isVisible():
        return False
    areas = [each for each in window.findChildren(Sideways) if each.isAncestorOf(control)]
    if areas:  # it scrolls
        return QRect(areas[0].widget().rect()).contains(control.mapTo(areas[0].widget(), control.rect().center()))
    return window.rect().contains(QRect(control.mapTo(window, control.rect().topLeft()), control.size()))


@pytest.mark.usefixtures("sized")
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("percent", [100, 125, 150])
@pytest.mark.parametrize("face", ["play", "lab"])
def test_no_control_is_lost(
    qtbot: QtBot, qapp: QApplication, played: Controller, face: Face, percent: int, size: tuple[int, int]
) -> None:
    window = played.window
    theme.apply_theme(qapp, "dark", 100)
    window.show_keys(face == "play")
    played.session.update(face=face)
    played.patches.change("level_db", -3.5)
    window.error_label.setText("Error of this pluck: 1.2 % in the training range, 3.4 % beyond")
    window.resize(1920, 1080)
    qtbot.waitUntil(window.instrument.bar.rename.isVisible if face == "play" else window._test_button.isVisible)
    roomy = controls(window)
    wanted = ["bar.rename", "bar.revert", "bar.compare"] if face == "play" else []
    assert {getattr(window.instrument.bar, name.removeprefix("bar.")) for name in wanted} <= set(roomy)
    theme.apply_theme(qapp, "dark", percent)
    window.resize(*size)
    qtbot.waitUntil(lambda: window.size().toTuple() == size)
    qtbot.wait(50)
    lost = [each for each in roomy if not is_there(window, each)]
    assert lost == [], [each.accessibleName() or each.property("text") for each in lost]


@pytest.mark.usefixtures("sized")
def test_the_overflow_menu_does_what_its_buttons_do(qtbot: QtBot, qapp: QApplication, played: Controller) -> None:
    window, bar = played.window, played.window.instrument.bar
    window.resize(1280, 720)
    theme.apply_theme(qapp, "dark", 150)  # chosen in the menu: the window keeps its size
    played.patches.change("level_db", -3.5)
    assert bar.more.isVisible() and bar.more.focusPolicy() & Qt.FocusPolicy.TabFocus

    def entries(more: Overflow) -> dict[str, object]:
        more.menu().aboutToShow.emit()
        return {action.text(): action for action in more.menu().actions()}

    found = entries(bar.more)
    assert {"Rename …", "Revert", "Compare"} <= found.keys()
    assert not found["Rename …"].isEnabled()  # type: ignore[attr-defined]  # a factory instrument
    found["Compare"].trigger()  # type: ignore[attr-defined]
    assert bar.compare.isChecked() and bar.compare.isVisible()
    entries(bar.more)["Revert"].trigger()  # type: ignore[attr-defined]
    patch, entry = played.session.choices.patch, played.patches.entry
    assert patch is not None and entry is not None and patch == entry.patch
    assert "Compare" in entries(bar.more)
    played.session.update(face="lab")
    window.error_label.setText("Error of this pluck: 1.2 %")
    found = entries(window._more)
    assert {"ABX …", "Keys", "Error of this pluck: 1.2 %"} <= found.keys()
    shown = window.shows_keys
    found["Keys"].trigger()  # type: ignore[attr-defined]
    assert window.shows_keys is not shown
    window.resize(1920, 1200)
    qtbot.waitUntil(window._test_button.isVisible)
    assert not window._more.isVisible()
    played.session.update(face="play")
    qtbot.waitUntil(bar.rename.isVisible)
    assert not {bar.rename, bar.revert, bar.compare} & set(bar.more.parts)


@pytest.mark.usefixtures("sized")
@pytest.mark.parametrize("face", ["play", "lab"])
def test_larger_text_covers_nothing(qtbot: QtBot, qapp: QApplication, played: Controller, face: Face) -> None:
    """Neither does a notice cover the header, nor does a neighbour cut the words beside the octave."""
    window, bar = played.window, played.window.instrument.bar
    window.resize(1024, 640)
    theme.apply_theme(qapp, "dark", 100)
    played.session.update(face=face)
    window.notices.report("A notice")
    qtbot.waitUntil(window.notices.isVisible)
    for percent in (150, 100, 125):
        theme.apply_theme(qapp, "dark", percent)
        head, notice = window._head, window.notices
        qtbot.waitUntil(lambda head=head, notice=notice: head.geometry().bottom() < notice.y())
        if face == "play":
            bar.show_velocity(127)
            for label in (bar.velocity, bar.octave, bar.voices):
                needed = label.fontMetrics().horizontalAdvance(label.text())
                qtbot.waitUntil(lambda label=label, needed=needed: not label.isVisible() or label.width() >= needed)
