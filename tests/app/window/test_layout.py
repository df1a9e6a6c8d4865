"""The window as a place: walked through by keys, on two faces, in any size and text, with files over it."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest
from PySide6.QtCore import QMetaMethod, QMimeData, QPoint, QPointF, QRect, QSize, Qt, QTimer, QUrl
from PySide6.QtGui import QDragEnterEvent, QDragLeaveEvent, QDropEvent, QKeySequence
from PySide6.QtWidgets import (
    QAbstractButton,
    QApplication,
    QComboBox,
    QLabel,
    QListWidget,
    QMenu,
    QTabBar,
    QWidget,
)
from pytestqt.qtbot import QtBot

from app.views import theme
from app.views.controls.app_menu import ENTRIES
from app.views.controls.drop_sign import DropSign
from app.views.controls.focus_ring import FocusRing
from app.views.controls.knob import Knob
from app.views.controls.notice_bar import NoticeList
from app.views.controls.overflow import Overflow
from app.views.controls.sideways import Sideways
from app.window.main_window import COMPILING, LOADING, MainWindow
from tests.app.places import choose_files
from tests.app.window.conftest import Open
from tests.app.window.driver import CONTROL, KEY, LEFT, PLAIN, Window, find, names_of

ROOT = Path(__file__).parents[3]
LONG = "A fault in words that are long enough for two lines where the window is narrow. " * 2
COPY = Qt.DropAction.CopyAction
Theme = Callable[..., None]


def stops(window: MainWindow) -> set[QWidget]:
    """What the Tab key can reach, as far as it can be seen; in a group of buttons it is the checked one."""
    return {
        each
        for each in window.findChildren(QWidget)
        if each.focusPolicy() & Qt.FocusPolicy.TabFocus
        and each.focusProxy() is None
        and each.isEnabled()
        and each.isVisibleTo(window)
        and each.window() is window
    }


def fits(window: MainWindow) -> bool:
    """Return True if the window is no smaller than its parts need."""
    return window.centralWidget().minimumSizeHint().expandedTo(window.size()) == window.size()


def test_the_window_shows_without_the_engine_and_waits_for_its_parts(
    qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = (
        "import sys, app.window.main, app.window.main_window\n"
        "assert not {'torch', 'scipy', 'numba', 'pyqtgraph'} & set(sys.modules), 'too much'"
    )
    if sys.platform != "win32":  # there torch must come before Qt
        done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    for whole, words in ((True, LOADING), (False, COMPILING)):
        monkeypatch.setattr("engine.kernels.cache.is_whole", lambda whole=whole: whole)
        window = MainWindow()
        qtbot.addWidget(window)
        with qtbot.waitSignal(window.first_painted):
            window.show()
        assert words in [label.text() for label in window.findChildren(QLabel)]
        assert not window.transport.isEnabled()
        assert window.presets.name.text() == "Reading presets …"  # nobody has looked yet whether there are any
    window.show_stage(QWidget())
    assert window.transport.isEnabled()
    room = window.screen().availableSize()
    for saved in ("", window.geometry_text()):
        window.resize(room + QSize(200, 100))
        window.restore_geometry(saved)
        assert window.width() <= room.width() and window.height() < room.height()


@pytest.mark.parametrize("face", ["play", "lab"])
def test_the_tab_key_visits_everything_as_the_eye_does_and_returns(opened: Open, face: str) -> None:
    """All of it has a name for a screen reader, and a tip."""
    lab = opened("studio_any_string", face=face)
    lab.choose("steel_string_acoustic")
    window = lab.window
    window.notices.report("Something to dismiss.")
    first = find(window, QAbstractButton, "Menu")
    first.setFocus()
    visited: list[QWidget] = [first]
    for _ in range(len(stops(window)) + 5):
        lab.key(KEY.Key_Tab, on=window.focusWidget())
        if window.focusWidget() is first:
            break
        visited.append(window.focusWidget())
    assert window.focusWidget() is first and len(visited) == len(set(visited)) > 15
    for missed in stops(window) - set(visited):
        assert isinstance(missed, QAbstractButton) and missed.group() and not missed.isChecked(), names_of(missed)
    for widget in visited:
        assert any(names_of(widget)) and (widget.toolTip() or isinstance(widget, QTabBar)), widget
    parts: list[QWidget] = [window.presets, window.notices.bell, window.notices, lab.controller.string]
    parts += [window.left, window.right, window.transport, window.instrument]
    met = [place for each in visited for place, part in enumerate(parts) if each is part or part.isAncestorOf(each)]
    assert met == sorted(met)
    assert {parts[place] for place in met} == {part for part in parts if part.isVisible()}


def test_enter_presses_what_tab_went_to_and_plucks_otherwise_and_a_plot_with_the_keyboard_is_ringed(
    lab: Window,
) -> None:
    window, plucked = lab.window, list[bool]()
    window.pluck_asked.connect(lambda: plucked.append(True))
    loop, box = lab.find(QAbstractButton, "Loop"), next(each for each in stops(window) if isinstance(each, QComboBox))
    lab.tab_to(loop)
    lab.key(KEY.Key_Return, on=loop)
    lab.wait(lambda: lab.choices.loop)
    lab.tab_to(box)
    lab.key(KEY.Key_Return, on=box)
    lab.wait(box.view().isVisible)
    box.hidePopup()
    assert not plucked
    (ring,) = window.findChildren(FocusRing)
    plot = lab.panel("waveform").plot
    plot.setFocus()  # as by a click
    lab.wait(lambda: ring.isVisible() and ring.size() == plot.size())
    window.resize(window.width() - 100, window.height())
    lab.wait(lambda: ring.size() == plot.size())
    loop.setFocus()
    lab.key(KEY.Key_Return, on=loop)
    assert plucked and lab.choices.loop
    lab.wait(lambda: not ring.isVisible())
    for face in ("play", "lab"):
        lab.change(face=face, loop=True)
        assert loop.isVisible() and loop.isChecked()
        loop.click()
        assert not lab.choices.loop


def test_every_action_is_in_the_menu_by_its_key_and_the_look_is_chosen_there(lab: Window, themed: Theme) -> None:
    window = lab.window
    window.menu.aboutToShow.connect(lambda: QTimer.singleShot(0, window.menu.close))
    with lab.qtbot.waitSignal(window.menu.aboutToHide):
        lab.key(KEY.Key_F10)
    keys = [entry.key for entry in ENTRIES.values() if entry.key]
    assert len(set(keys)) == len(keys)
    for name, entry in ENTRIES.items():
        action = window.action[name]
        assert entry.does or not entry.key
        assert action.text().startswith(entry.text.removesuffix(" …"))
        assert action.isSignalConnected(QMetaMethod.fromSignal(action.triggered)), name
        if entry.key not in ("", "Return"):
            assert action.shortcut() == QKeySequence(entry.key)
            assert action in window.actions(), "its shortcut works while no menu is open"
    actions = {action.text(): action for menu in window.menu.findChildren(QMenu) for action in menu.actions()}
    actions["Light"].trigger()
    assert lab.controller.settings().look.theme == "light" and theme.present == theme.LIGHT
    assert actions["Light"].isChecked()
    sized = window.transport.knobs["volume_db"], window.findChild(QWidget, "brand")
    small = [each.sizeHint() for each in sized]
    actions["150 %"].trigger()
    assert lab.controller.settings().look.size_percent == 150
    for before, each in zip(small, sized, strict=True):
        assert each.sizeHint().width() > before.width()
        assert each.sizeHint().height() == pytest.approx(1.5 * before.height(), rel=0.15)
    actions["100 %"].trigger()
    assert [each.sizeHint() for each in sized] == small


def test_each_face_shows_its_areas_and_low_windows_share_their_height(guitar: Window) -> None:
    window, strip, stage = guitar.window, guitar.window.instrument, guitar.controller.string
    areas: dict[str, list[QWidget]] = {
        "lab": [window.presets, window.left, window.right, window.transport.slots, window.presets.card],
        "play": [strip.bar, strip.keys],
    }
    areas["lab"].append(guitar.find(QAbstractButton, "Listening test"))
    window.resize(1280, 800)
    for face, other in (("lab", "play"), ("play", "lab"), ("lab", "play")):
        guitar.key(KEY.Key_F9)
        assert window.face == guitar.controller.settings().choices.face == face
        assert all(part.isVisible() for part in (*areas[face], stage, window.transport.meter))
        assert not any(part.isVisible() for part in areas[other] if part is not strip.keys)
    keys = guitar.find(QAbstractButton, "Keys")
    for shown in (False, True):
        guitar.key(KEY.Key_K, CONTROL)
        assert window.shows_keys == strip.isVisible() == shown
    guitar.qtbot.mouseClick(keys, LEFT)
    assert not strip.isVisible()
    guitar.qtbot.mouseClick(keys, LEFT)
    for height, seen in ((800, (True, True, True)), (640, (True, True, True)), (600, (False, True, True))):
        window.resize(1280, height)
        assert tuple(part.isVisible() for part in (window.left, window.presets.card, strip.keys)) == seen, height
    solo = guitar.find(QAbstractButton, "Play all modes")
    guitar.change(solo=3)
    for height in (500, 700, 500):
        window.resize(1280, height)
        assert solo.isVisible(), "with the preset's facts, or without"
        assert window.presets.card.isVisible() == (height == 700)
    guitar.key(KEY.Key_Escape)
    assert not solo.isVisible()
    window.show_keys(False)
    assert window.left.isVisible()
    for face, fault, seen in (("play", False, False), ("lab", False, True), ("play", True, True)):
        guitar.change(face=face)
        window.show_rate(f"48 kHz {face} {fault}", "", fault)
        assert window.rate_label.isVisible() == seen, "in Play with a fault alone"
    assert not window.growth_sign.isVisible()
    window.show_growth("The error grew.")
    assert window.growth_sign.isVisible() and "grew" in window.growth_sign.toolTip()
    guitar.press("Face: Lab")
    assert window.face == "lab" and not window.growth_sign.isVisible()
    guitar.press("Face: Play")
    strip.set_unfolded(True)
    for height, seen in ((720, (True, True, True)), (600, (False, True, True)), (500, (False, True, True))):
        window.resize(1280, height)
        assert tuple(part.isVisible() for part in (strip.keys, strip.bar, strip.knobs)) == seen, height


def test_files_are_dropped_and_opened_with_all_of_their_names(
    qtbot: QtBot, lab: Window, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = MainWindow()
    qtbot.addWidget(window)
    window.show()
    (sign,), taken, data = window.findChildren(DropSign), list[Path](), QMimeData()
    window.file_dropped.connect(taken.append)
    data.setUrls([QUrl.fromLocalFile("/tmp/song.mid"), QUrl.fromLocalFile("/tmp/other.wav")])
    over = QDragEnterEvent(QPoint(50, 50), COPY, data, LEFT, PLAIN)
    for end in (QDragLeaveEvent(), QDropEvent(QPointF(50, 50), COPY, data, LEFT, PLAIN)):
        QApplication.sendEvent(window, over)
        assert sign.isVisible() and "song.mid and 1 more" in sign.text()
        QApplication.sendEvent(window, end)
        assert not sign.isVisible()
    assert taken == [Path("/tmp/song.mid"), Path("/tmp/other.wav")]
    ours = QDragEnterEvent(QPoint(5, 5), COPY, data, LEFT, PLAIN)
    ours.ignore()
    ours.source = lambda: window.transport.export  # type: ignore[method-assign]  # dragged out of the window
    window.dragEnterEvent(ours)
    assert not ours.isAccepted()
    if sys.platform not in ("win32", "darwin"):
        bare = QMimeData()
        bare.setData("text/uri-list", b"file:///tmp/caf%E9/100%25%20caf%E9%20%C3%A9.mid\r\n")
        for event in (
            QDragEnterEvent(QPoint(5, 5), COPY, bare, LEFT, PLAIN),
            QDropEvent(QPointF(5, 5), COPY, bare, LEFT, PLAIN),
        ):
            QApplication.sendEvent(window, event)
        assert os.fsencode(taken[-1]) == b"/tmp/caf\xe9/100% caf\xe9 \xc3\xa9.mid"
    choose_files(monkeypatch, Path("/tmp/a.mid"), Path("/tmp/b.scl"))
    window.action["open"].trigger()
    assert taken[-2:] == [Path("/tmp/a.mid"), Path("/tmp/b.scl")]
    for panel in lab.panels:
        under = panel.childAt(panel.rect().center()) or panel
        while under is not lab.window:
            assert not under.acceptDrops(), "it would keep a file from the window"
            under = under.parentWidget()


def controls(window: MainWindow) -> list[QWidget]:
    """What is operated or read in the rows, as far as it is there; the plots make room for the keys as a whole."""
    apart = [window.left, window.right, window.notices, *window.findChildren(QWidget, "brand")]
    apart += [*window.findChildren(QWidget, "hint"), *window.findChildren(QAbstractButton, "chip")]
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
    """Return True if a control is seen, scrolled to, or in an overflow menu."""
    menus = [each for each in window.findChildren(Overflow) if each.isVisible() and each.visibleRegion()]
    if any(control in menu.parts for menu in menus) or not control.isVisible():
        return control.isVisible() or any(control in menu.parts for menu in menus)
    areas = [each for each in window.findChildren(Sideways) if each.isAncestorOf(control)]
    if areas:  # it scrolls
        return QRect(areas[0].widget().rect()).contains(control.mapTo(areas[0].widget(), control.rect().center()))
    return window.rect().contains(QRect(control.mapTo(window, control.rect().topLeft()), control.size()))


@pytest.mark.parametrize("face", ["play", "lab"])
def test_no_control_is_lost_nor_cut_in_a_small_window_with_large_text(
    guitar: Window, themed: Theme, face: str
) -> None:
    """Nor does a notice cover the header, nor a neighbour the words beside the octave."""
    window, bar = guitar.window, guitar.window.instrument.bar
    window.show_keys(False)
    guitar.change(face=face)
    guitar.controller.instruments.change("level_db", -3.5)
    if face == "lab":
        guitar.wait_for_take()
    window.error_label.setText("Error of this pluck: 1.2 % in the training range, 3.4 % beyond")
    window.resize(1920, 1080)
    wide = [bar.rename, bar.revert, bar.compare]
    wide = wide if face == "play" else [guitar.find(QAbstractButton, "Listening test")]
    guitar.wait(lambda: all(each.isVisible() for each in wide))
    roomy = controls(window)
    assert set(wide) <= set(roomy)
    for percent in (150, 125):
        themed("dark", percent)
        for size in ((1280, 800), (1280, 720), (1024, 640), (958, 600)):
            window.resize(*size)
            guitar.wait_for(lambda: [each for each in roomy if not is_there(window, each)], [])
            if percent == 150 and size[0] == 1280:
                guitar.wait(lambda: fits(window))
                assert face == "play" or (window.left.isVisible() and window.right.isVisible())
                rows = [area for area in window.findChildren(Sideways) if area.isVisible()]
                guitar.wait(lambda: all(row.widget().minimumSizeHint().width() <= row.width() for row in rows))  # noqa: B023
        window.notices.report("A notice")
        guitar.wait(lambda: window.presets.geometry().bottom() < window.notices.y() or face == "play")
        if face == "play":
            bar.show_velocity(127)
            for label in (bar.velocity, bar.octave, bar.voices):
                needed = label.fontMetrics().horizontalAdvance(label.text())
                guitar.wait(lambda at=label, px=needed: not at.isVisible() or at.width() >= px)
    window.resize(760, 600)
    header = window.presets
    header.name.setText("★  Nylon B3, random shapes, 16 kHz — Integrated phase, blind   ▾")

    def apart() -> bool:
        header.filtered.show_listed(1, 21)  # again: a list that is read meanwhile is not filtered
        parts = [header.layout().itemAt(place).geometry() for place in range(4)]
        return all(left.right() < right.left() for left, right in pairwise(parts))

    guitar.wait(lambda: face == "play" or (apart() and header.geometry().right() < window.width()))


def entries(more: Overflow) -> dict[str, object]:
    more.menu().aboutToShow.emit()
    return {action.text(): action for action in more.menu().actions()}


def test_the_overflow_menu_does_what_its_buttons_do(guitar: Window, themed: Theme) -> None:
    window, bar = guitar.window, guitar.window.instrument.bar
    more = guitar.find(Overflow, "More of the Lab")
    window.resize(1280, 720)
    themed("dark", 150)  # chosen in the menu: the window keeps its size
    guitar.controller.instruments.change("level_db", -3.5)
    assert bar.more.isVisible() and bar.more.focusPolicy() & Qt.FocusPolicy.TabFocus
    found = entries(bar.more)
    assert {"Rename …", "Revert", "Compare"} <= found.keys()
    assert not found["Rename …"].isEnabled()  # type: ignore[attr-defined]  # a factory instrument
    found["Compare"].trigger()  # type: ignore[attr-defined]
    assert bar.compare.isChecked() and bar.compare.isVisible()
    entries(bar.more)["Revert"].trigger()  # type: ignore[attr-defined]
    assert guitar.instrument == guitar.controller.instruments.entry.instrument  # type: ignore[union-attr]
    guitar.change(face="lab")
    window.error_label.setText("Error of this pluck: 1.2 %")
    found = entries(more)
    assert {"ABX …", "Keys", "Error of this pluck: 1.2 %"} <= found.keys()
    shown = window.shows_keys
    found["Keys"].trigger()  # type: ignore[attr-defined]
    assert window.shows_keys is not shown
    window.resize(1920, 1200)
    guitar.wait(lambda: not more.isVisible())
    guitar.change(face="play")
    guitar.wait(bar.rename.isVisible)
    assert not {bar.rename, bar.revert, bar.compare} & set(bar.more.parts)


def test_a_notice_is_read_whole_over_the_window_moves_nothing_and_is_dismissed_by_keys(
    themed: Theme, lab: Window
) -> None:
    """A browser opens beneath it, and has room for a search."""
    window, notices, stage = lab.window, lab.window.notices, lab.controller.string
    parts = (stage, window.left, window.right, window.transport)

    def settled() -> list[int]:
        """The heights of the parts once they stay."""
        found: list[list[int]] = []

        def stay() -> bool:
            found.append([part.height() for part in parts])
            return len(found) > 3 and found[-1] == found[-4]

        lab.wait(stay)
        return found[-1]

    for size in ((1920, 1080), (1280, 640), (853, 480)):
        window.resize(*size)
        notices.hide()
        lab.wait(lambda: fits(window) and window.size().toTuple() == size)  # noqa: B023
        bare = settled()
        for text in ("Saved.", LONG):
            notices.report(text)
            label = next(each for each in notices.findChildren(QLabel) if each.wordWrap())
            lab.wait(lambda: label.height() >= label.heightForWidth(label.width()))  # noqa: B023
            lab.wait(lambda: window.presets.geometry().bottom() < notices.y())
            assert 0 < notices.geometry().left() < notices.geometry().right() < size[0]
            assert notices.visibleRegion().boundingRect().size() == notices.size()
        assert settled() == bare and fits(window)
        for part in parts[:3]:
            assert not part.isVisible() or part.height() >= part.minimumSizeHint().height()
        for desk in (lab.controller.presets, lab.controller.instruments):
            desk.toggle()
            browser = desk.browser
            lab.wait(lambda: browser.y() > notices.geometry().bottom())  # noqa: B023
            assert browser.geometry().bottom() <= window.height()
            lab.wait_for(lambda: max(browser.layout().minimumSize().width() - browser.width(), 0), 0)  # noqa: B023
            assert browser.search.width() >= browser.search.minimumWidth() > 100
            desk.toggle()
    dismiss = find(notices, QAbstractButton, "Dismiss")
    lab.tab_to(dismiss)
    lab.key(KEY.Key_Return, on=dismiss)
    lab.wait(lambda: not notices.isVisible())
    lab.key(KEY.Key_F8)
    (listed,) = window.findChildren(NoticeList)
    assert find(listed, QListWidget, "Notices since").count() == len(notices.notices)
    listed.close()
