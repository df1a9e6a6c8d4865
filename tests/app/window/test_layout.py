"""The window as a place: walked through by keys, on two faces, in any size and text, with files over it."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from PySide6.QtCore import QMetaMethod, QMimeData, QPoint, QPointF, QRect, QSize, Qt, QTimer, QUrl
from PySide6.QtGui import QAction, QDragEnterEvent, QDragLeaveEvent, QDropEvent, QKeySequence
from PySide6.QtWidgets import (
    QAbstractButton,
    QApplication,
    QComboBox,
    QLabel,
    QLineEdit,
    QListWidget,
    QMenu,
    QTabBar,
    QWidget,
)

from app.shared.typed_number import typed_number
from app.views import theme
from app.views.controls.app_menu import ENTRIES
from app.views.controls.drop_sign import DropSign
from app.views.controls.focus_ring import FocusRing
from app.views.controls.knob import Knob
from app.views.controls.notice_bar import NoticeList
from app.views.controls.overflow import Overflow
from app.views.controls.sideways import Sideways
from app.window.main_window import COMPILING, LOADING, MainWindow
from tests.app.gestures import reported
from tests.app.places import choose_files
from tests.app.window.driver import CONTROL, KEY, LEFT, PLAIN, by_arrows, find, fits, names_of, tab_stops

ROOT = Path(__file__).parents[3]
LONG = "A fault in words that are long enough for two lines where the window is narrow. " * 2
COPY = Qt.DropAction.CopyAction
Theme = Callable[..., None]


def test_the_window_shows_without_the_engine(qtbot, monkeypatch):
    code = (
        "import sys, app.window.main, app.window.main_window\n"
        "assert not {'torch', 'scipy', 'numba', 'pyqtgraph'} & set(sys.modules), 'too much'"
    )
    if sys.platform != "win32":  # there torch must come before Qt
        subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)
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
def test_the_tab_key_visits_everything_as_the_eye_does_and_returns(opened, face):
    """All of it has a name for a screen reader, and a tip."""
    lab = opened("studio_any_string", face=face)
    lab.choose("steel_string_acoustic")
    window = lab.window
    window.notices.report("Something to dismiss.")
    first = find(window, QAbstractButton, "Menu")
    first.setFocus()
    visited: list[QWidget] = [first]
    for _ in range(len(tab_stops(window)) + 5):
        lab.key(KEY.Key_Tab, on=window.focusWidget())
        if window.focusWidget() is first:
            break
        visited.append(window.focusWidget())
    assert window.focusWidget() is first and len(visited) == len(set(visited)) > 15
    for missed in set(tab_stops(window)) - set(visited):
        assert by_arrows(missed), names_of(missed)
    for widget in visited:
        assert any(names_of(widget)) and (widget.toolTip() or isinstance(widget, QTabBar)), widget
    parts: list[QWidget] = [window.presets, window.notices.bell, window.notices, lab.controller.string]
    parts += [window.left, window.right, window.transport, window.instrument]
    met = [place for each in visited for place, part in enumerate(parts) if each is part or part.isAncestorOf(each)]
    assert met == sorted(met)
    assert {parts[place] for place in met} == {part for part in parts if part.isVisible()}


def test_enter_presses_what_tab_went_to_and_plucks_otherwise(lab):
    loop, plot = lab.find(QAbstractButton, "Loop"), lab.panel("waveform").plot
    lab.wait_for_take()
    lab.tab_to(loop)
    lab.key(KEY.Key_Return, on=loop)
    lab.wait(lambda: lab.choices.loop)
    box = lab.find(QComboBox, "Pick-up")
    lab.tab_to(box)
    lab.key(KEY.Key_Return, on=box)
    lab.wait(box.view().isVisible)
    box.hidePopup()
    assert not lab.struck
    (ring,) = lab.window.findChildren(FocusRing)
    plot.setFocus()  # as by a click
    lab.window.resize(lab.window.width() - 100, lab.window.height())
    lab.wait(lambda: ring.isVisible() and ring.size() == plot.size())
    loop.setFocus()
    lab.key(KEY.Key_Return, on=loop)
    assert lab.choices.loop
    lab.wait(lambda: lab.struck and not ring.isVisible())


def test_every_action_is_in_the_menu_by_its_key_and_the_look_is_chosen_there(lab, themed):
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
    actions["150 %"].trigger()
    assert lab.controller.settings().look.size_percent == 150


def test_each_face_shows_its_areas_and_low_windows_share_their_height(guitar):
    window, strip, stage = guitar.window, guitar.window.instrument, guitar.controller.string
    window.notices.report("A notice")
    guitar.key(KEY.Key_F8)
    (listed,) = window.findChildren(NoticeList)
    assert find(listed, QListWidget, "Notices since").count() == len(window.notices.notices)
    listed.close()
    window.activateWindow()
    guitar.wait(window.isActiveWindow)
    header = (window.presets, window.transport.slots, window.presets.card, guitar.find(QAbstractButton, "Listening"))
    areas = {"lab": (window.left, window.right, *header), "play": (strip.bar, strip.keys)}
    guitar.wait(lambda: guitar.session.stage.complete)
    window.resize(1280, 800)
    for face, other in (("lab", "play"), ("play", "lab"), ("lab", "play")):
        guitar.key(KEY.Key_F9)
        assert window.face == guitar.controller.settings().choices.face == face
        assert all(part.isVisible() for part in (*areas[face], stage, window.transport.meter))
        assert not any(part.isVisible() for part in areas[other] if part is not strip.keys)
    keys = guitar.find(QAbstractButton, "Keys")
    for switch, seen in ((lambda: guitar.key(KEY.Key_K, CONTROL), False), (keys.click, True)):
        switch()
        assert window.shows_keys == strip.isVisible() == seen
    for height, seen in ((640, (True, True, True)), (600, (False, True, True))):
        window.resize(1280, height)
        assert tuple(part.isVisible() for part in (window.left, window.presets.card, strip.keys)) == seen, height
    solo = guitar.find(QAbstractButton, "Play all modes")
    guitar.change(solo=3)
    for height in (700, 500):
        window.resize(1280, height)
        assert solo.isVisible(), "with the preset's facts, or without"
        assert window.presets.card.isVisible() == (height == 700)
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
    for height, seen in ((720, (True, True, True)), (500, (False, True, True))):
        window.resize(1280, height)
        assert tuple(part.isVisible() for part in (strip.keys, strip.bar, strip.knobs)) == seen, height


def test_files_are_dropped_and_opened_with_all_of_their_names(lab, monkeypatch):
    (sign,), taken, data = lab.window.findChildren(DropSign), list[Path](), QMimeData()
    lab.window.file_dropped.disconnect()
    lab.window.file_dropped.connect(taken.append)
    data.setUrls([QUrl.fromLocalFile("/tmp/song.mid"), QUrl.fromLocalFile("/tmp/other.wav")])
    over = QDragEnterEvent(QPoint(50, 50), COPY, data, LEFT, PLAIN)
    for end in (QDragLeaveEvent(), QDropEvent(QPointF(50, 50), COPY, data, LEFT, PLAIN)):
        QApplication.sendEvent(lab.window, over)
        assert sign.isVisible() and "song.mid and 1 more" in sign.text()
        QApplication.sendEvent(lab.window, end)
        assert not sign.isVisible()
    assert taken == [Path("/tmp/song.mid"), Path("/tmp/other.wav")]
    ours = QDragEnterEvent(QPoint(5, 5), COPY, data, LEFT, PLAIN)
    ours.ignore()
    ours.source = lambda: lab.window.transport.export  # type: ignore[method-assign]  # dragged out of the window
    lab.window.dragEnterEvent(ours)
    assert not ours.isAccepted()
    if sys.platform not in ("win32", "darwin"):
        data = QMimeData()
        data.setData("text/uri-list", b"file:///tmp/caf%E9/100%25%20caf%E9%20%C3%A9.mid\r\n")
        QApplication.sendEvent(lab.window, QDragEnterEvent(QPoint(5, 5), COPY, data, LEFT, PLAIN))
        QApplication.sendEvent(lab.window, QDropEvent(QPointF(5, 5), COPY, data, LEFT, PLAIN))
        assert os.fsencode(taken[-1]) == b"/tmp/caf\xe9/100% caf\xe9 \xc3\xa9.mid"
    choose_files(monkeypatch, Path("/tmp/a.mid"), Path("/tmp/b.scl"))
    lab.window.action["open"].trigger()
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
def test_no_control_is_lost_in_a_small_window(guitar, themed, face):
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
            guitar.wait(lambda: all(is_there(window, each) for each in roomy))
            if percent == 150 and size[0] == 1280:
                guitar.wait(lambda: fits(window))
                assert face == "play" or (window.left.isVisible() and window.right.isVisible())
                rows = [area for area in window.findChildren(Sideways) if area.isVisible()]
                guitar.wait(lambda: all(row.widget().minimumSizeHint().width() <= row.width() for row in rows))  # noqa: B023
        window.notices.report(LONG)
        guitar.wait(lambda: window.presets.geometry().bottom() < window.notices.y() or face == "play")
        label = next(each for each in window.notices.findChildren(QLabel) if each.wordWrap())
        guitar.wait(lambda: label.height() >= label.heightForWidth(label.width()))  # noqa: B023
        if face == "play":
            bar.show_velocity(127)
            for label in (bar.velocity, bar.octave, bar.voices):
                needed = label.fontMetrics().horizontalAdvance(label.text())
                guitar.wait(lambda at=label, px=needed: not at.isVisible() or at.width() >= px)


def test_the_overflow_menu_does_what_its_buttons_do(guitar, themed):
    window, bar = guitar.window, guitar.window.instrument.bar

    def entries(more: Overflow) -> dict[str, QAction]:
        more.menu().aboutToShow.emit()
        return {action.text(): action for action in more.menu().actions()}

    window.resize(1280, 720)
    themed("dark", 150)  # chosen in the menu: the window keeps its size
    guitar.controller.instruments.change("level_db", -3.5)
    assert bar.more.isVisible() and bar.more.focusPolicy() & Qt.FocusPolicy.TabFocus
    assert not entries(bar.more)["Rename …"].isEnabled()  # a factory instrument
    entries(bar.more)["Compare"].trigger()
    assert bar.compare.isChecked() and bar.compare.isVisible()
    entries(bar.more)["Revert"].trigger()
    assert guitar.instrument == guitar.controller.instruments.entry.instrument  # type: ignore[union-attr]
    guitar.change(face="lab")
    window.error_label.setText("Error of this pluck: 1.2 %")
    found, shown = entries(guitar.find(Overflow, "More of the Lab")), window.shows_keys
    assert {"ABX …", "Error of this pluck: 1.2 %"} <= found.keys()
    found["Keys"].trigger()
    assert window.shows_keys is not shown


def test_every_knob_reads_what_it_shows(guitar):
    guitar.change(face="lab")
    guitar.wait(lambda: guitar.choices.string is not None)
    knobs = [knob for knob in guitar.window.findChildren(Knob) if knob.isEnabled() and not knob.isHidden()]
    assert len(knobs) > 30
    for knob in knobs:
        asked, figures = reported(knob.value_asked), reported(knob.figure_asked)
        figure = knob.accessibleDescription().removesuffix(f" ({knob.text})")
        shown = figure if figure != knob.text else knob.text
        for text in (shown, shown.replace(".", ","), shown.replace("-", "\u2212"), shown + " and"):
            guitar.qtbot.keyClicks(knob, "0")  # typing begins with a digit; by keys other letters would play
            editor = next(each for each in knob.findChildren(QLineEdit) if not each.isHidden())
            editor.setText(text)
            guitar.key(KEY.Key_Return, on=editor)
            editor.hide()
        if figures:
            assert figures == [typed_number(shown, knob.parameter.figure_unit or "")] * 3 and asked == []
        else:
            assert [knob.parameter.shown(value) for value in asked] == [shown] * 3
