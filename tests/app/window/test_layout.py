"""The window as a place: walked through by keys, on two faces, in any size and text, with files over it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from PySide6.QtCore import QMetaMethod, QMimeData, QPoint, QPointF, Qt, QTimer, QUrl
from PySide6.QtGui import QAction, QDragEnterEvent, QDragLeaveEvent, QDropEvent, QKeySequence
from PySide6.QtWidgets import (
    QAbstractButton,
    QApplication,
    QComboBox,
    QLabel,
    QMenu,
    QTabBar,
    QWidget,
)

from app.views import theme
from app.views.controls.app_menu import ENTRIES
from app.views.controls.drop_sign import DropSign
from app.views.controls.overflow import Overflow
from app.window.main_window import COMPILING, LOADING, MainWindow
from tests.app.places import choose_files
from tests.app.window.driver import KEY, LEFT, PLAIN, by_arrows, find, fits, names_of, tab_stops

ROOT = Path(__file__).parents[3]
COPY = Qt.DropAction.CopyAction


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
    loop = lab.find(QAbstractButton, "Loop")
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
    loop.setFocus()
    lab.key(KEY.Key_Return, on=loop)
    assert lab.choices.loop
    lab.wait(lambda: lab.struck)


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
    header = (window.presets, window.transport.slots, window.presets.card, guitar.find(QAbstractButton, "Listening"))
    areas = {"lab": (window.left, window.right, *header), "play": (strip.bar, strip.keys)}
    guitar.wait(lambda: guitar.session.stage.complete)
    window.resize(1280, 800)
    for face, other in (("lab", "play"), ("play", "lab"), ("lab", "play")):
        guitar.key(KEY.Key_F9)
        assert window.face == guitar.controller.settings().choices.face == face
        assert all(part.isVisible() for part in (*areas[face], stage, window.transport.meter))
        assert not any(part.isVisible() for part in areas[other] if part is not strip.keys)
    for height, seen in ((640, (True, True, True)), (600, (False, True, True))):
        window.resize(1280, height)
        assert tuple(part.isVisible() for part in (window.left, window.presets.card, strip.keys)) == seen, height

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
    if sys.platform not in ("win32", "darwin"):
        data = QMimeData()
        data.setData("text/uri-list", b"file:///tmp/caf%E9/100%25%20caf%E9%20%C3%A9.mid\r\n")
        QApplication.sendEvent(lab.window, QDragEnterEvent(QPoint(5, 5), COPY, data, LEFT, PLAIN))
        QApplication.sendEvent(lab.window, QDropEvent(QPointF(5, 5), COPY, data, LEFT, PLAIN))
        assert os.fsencode(taken[-1]) == b"/tmp/caf\xe9/100% caf\xe9 \xc3\xa9.mid"
    choose_files(monkeypatch, Path("/tmp/a.mid"), Path("/tmp/b.scl"))
    lab.window.action["open"].trigger()
    assert taken[-2:] == [Path("/tmp/a.mid"), Path("/tmp/b.scl")]


def test_no_control_is_lost_in_a_small_window_and_the_overflow_menu_does_what_buttons_do(guitar, themed):
    window, bar = guitar.window, guitar.window.instrument.bar

    def entries(more: Overflow) -> dict[str, QAction]:
        more.menu().aboutToShow.emit()
        return {action.text(): action for action in more.menu().actions()}

    window.resize(1280, 720)
    themed("dark", 150)  # chosen in the menu: the window keeps its size
    guitar.controller.instruments.change("level_db", -3.5)
    guitar.wait(lambda: fits(window))
    for control in (bar.rename, bar.revert, bar.compare):
        assert control.isVisible() or control in bar.more.parts
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
