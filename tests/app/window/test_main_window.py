"""The window as a place: it fits small screens, is walked through with Tab, and needs no engine to be seen."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from itertools import pairwise
from operator import attrgetter
from pathlib import Path

import pytest
from PySide6.QtCore import QMetaMethod, QMimeData, QPoint, QPointF, QSize, Qt, QTimer, QUrl
from PySide6.QtGui import QDragEnterEvent, QDragLeaveEvent, QDropEvent, QKeySequence
from PySide6.QtWidgets import QAbstractButton, QApplication, QComboBox, QFileDialog, QMenu, QTabBar, QWidget
from pytestqt.qtbot import QtBot

from app.shared.vocabulary import Face
from app.views import theme
from app.views.controls.app_menu import ENTRIES
from app.views.controls.focus_ring import FocusRing
from app.views.controls.sideways import Sideways
from app.views.look import Look
from app.window.appearance import Appearance
from app.window.controller import Controller
from app.window.main_window import MainWindow

ROOT = Path(__file__).parents[3]


@pytest.fixture
def face() -> Face:
    return "lab"


def stops(window: MainWindow) -> list[QWidget]:
    """What the Tab key can reach, as far as it can be seen."""
    return [
        widget
        for widget in window.findChildren(QWidget)
        if widget.focusPolicy() & Qt.FocusPolicy.TabFocus
        and widget.focusProxy() is None
        and widget.isEnabled()
        and widget.isVisibleTo(window)
        and widget.window() is window
    ]


def walk(window: MainWindow, start: QWidget) -> list[QWidget]:
    """Where Tab leads from `start` until it comes back, or to a place where it has been."""
    wanted = set(stops(window))
    visited = [start]
    widget = start.nextInFocusChain()
    while widget not in visited:
        if widget in wanted:
            visited.append(widget)
        widget = widget.nextInFocusChain()
        if widget is start:
            break
    return visited


def test_the_window_shows_without_the_engine() -> None:
    code = (
        "import sys, app.window.main, app.window.main_window, app.window.appearance\n"
        "assert not {'torch', 'scipy', 'numba', 'pyqtgraph'} & set(sys.modules), 'too much'"
    )
    if sys.platform != "win32":  # there torch must come before Qt
        done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr


def test_it_waits_until_its_parts_are_there(qtbot: QtBot) -> None:
    window = MainWindow()
    qtbot.addWidget(window)
    with qtbot.waitSignal(window.first_painted):
        window.show()
    assert not window.transport.isEnabled()
    assert window.presets.name.text() == "Reading presets …"  # nobody has looked yet whether there are any
    window.show_stage(QWidget())
    assert window.transport.isEnabled()


def test_everything_that_tab_reaches_has_a_name(controller: Controller) -> None:
    found = stops(controller.window)
    assert len(found) > 15
    for widget in found:
        text = widget.text() if isinstance(widget, QAbstractButton) else ""
        assert widget.accessibleName() or text, widget
        assert widget.toolTip() or isinstance(widget, QTabBar), widget


def test_tab_visits_everything_and_returns(controller: Controller) -> None:
    window = controller.window
    window.notices.report("Something to dismiss.")
    visited = walk(window, window.presets.findChildren(QAbstractButton)[0])
    assert set(visited) == set(stops(window))
    assert len(visited) == len(set(visited))


def test_the_tab_key_itself_comes_round(qtbot: QtBot, controller: Controller) -> None:
    """The chain of focus alone does not tell it: a view may send the focus back."""
    window = controller.window
    first = next(b for b in window.presets.findChildren(QAbstractButton) if b in stops(window))
    first.setFocus()
    qtbot.waitUntil(lambda: window.focusWidget() is first)
    for _ in range(len(stops(window)) + 5):
        qtbot.keyClick(window.focusWidget(), Qt.Key.Key_Tab)
        if window.focusWidget() is first:
            return
    pytest.fail("it never came back")


def tab_to(qtbot: QtBot, window: MainWindow, aim: QWidget) -> None:
    """Presses the Tab key until `aim` has the keyboard."""
    for _ in range(len(stops(window)) + 5):
        qtbot.keyClick(window.focusWidget(), Qt.Key.Key_Tab)
        if window.focusWidget() is aim:
            return
    pytest.fail(f"Tab never came to {aim}")


def test_a_loop_can_be_seen_and_ended_on_both_faces(controller: Controller) -> None:
    loop = controller.window.transport._loop
    for face in ("lab", "play"):
        controller.session.update(face=face, loop=True)
        assert loop.isVisible() and loop.isChecked()
        loop.click()
        assert not controller.session.choices.loop


def test_enter_presses_what_tab_went_to_and_plucks_otherwise(qtbot: QtBot, controller: Controller) -> None:
    window, session = controller.window, controller.session
    plucked: list[bool] = []
    window.pluck_asked.connect(lambda: plucked.append(True))
    loop = next(button for button in window.findChildren(QAbstractButton) if button.accessibleName() == "Loop")
    looped = session.choices.loop
    tab_to(qtbot, window, loop)
    qtbot.keyClick(loop, Qt.Key.Key_Return)
    qtbot.waitUntil(lambda: session.choices.loop is not looped)
    assert not plucked
    box = next(box for box in window.findChildren(QComboBox) if box in stops(window))
    tab_to(qtbot, window, box)
    qtbot.keyClick(box, Qt.Key.Key_Return)
    qtbot.waitUntil(box.view().isVisible)
    box.hidePopup()
    assert not plucked
    window.right.currentWidget().plot.setFocus()  # type: ignore[attr-defined]  # as by a click
    loop.setFocus()
    qtbot.keyClick(loop, Qt.Key.Key_Return)
    assert plucked
    assert session.choices.loop is not looped


def test_f10_opens_the_menu(qtbot: QtBot, controller: Controller) -> None:
    window = controller.window
    window.menu.aboutToShow.connect(lambda: QTimer.singleShot(0, window.menu.close))
    with qtbot.waitSignal(window.menu.aboutToHide):
        qtbot.keyClick(window, Qt.Key.Key_F10)


def test_tab_goes_as_the_eye_does(controller: Controller) -> None:
    window = controller.window
    window.notices.report("Something to dismiss.")
    visited = walk(window, window.presets.findChildren(QAbstractButton)[0])
    string = next(panel.view for panel in controller.panels if panel.key == "string")
    parts = [window.presets, window.notices.bell, window.notices, string, window.left, window.right, window.transport]
    met = [
        number
        for widget in visited
        for number, part in enumerate(parts)
        if widget is part or part.isAncestorOf(widget)
    ]
    assert met == sorted(met)
    assert set(met) == set(range(len(parts)))


def test_the_plot_that_has_the_keyboard_is_ringed(qtbot: QtBot, controller: Controller) -> None:
    window = controller.window
    (ring,) = window.findChildren(FocusRing)
    plot = window.right.currentWidget().plot  # type: ignore[attr-defined]
    plot.setFocus()
    qtbot.waitUntil(ring.isVisible)
    assert ring.geometry().size() == plot.size()
    window.resize(window.width() - 100, window.height())
    qtbot.waitUntil(lambda: ring.geometry().size() == plot.size())
    window.transport.knobs["width"].setFocus()
    qtbot.waitUntil(lambda: not ring.isVisible())


@pytest.fixture
def themed(qapp: QApplication) -> Iterator[None]:
    """As users see it: the theme's parts are larger than the bare style's."""
    sheet = qapp.styleSheet()
    theme.apply_theme(qapp, "dark")
    yield
    qapp.setStyleSheet(sheet)


@pytest.mark.usefixtures("themed")
def test_it_fits_a_small_screen_with_a_notice(qtbot: QtBot, controller: Controller) -> None:
    window = controller.window
    window.notices.report(LONG)
    middle = window.centralWidget()
    for size in (QSize(1024, 560), QSize(820, 490)):
        window.resize(size)
        qtbot.waitUntil(lambda size=size: middle.minimumSizeHint().expandedTo(size) == size)
        assert window.size() == size


@pytest.mark.usefixtures("themed")
def test_in_a_narrow_window_the_controls_stand_closer_and_all_are_seen(qtbot: QtBot, controller: Controller) -> None:
    window = controller.window
    transport = window.transport
    for width in (1000, 1280, 958):
        window.resize(width, 600)
        qtbot.waitUntil(lambda: transport.minimumSizeHint().width() <= transport.parentWidget().width())
        right = transport._export.mapTo(window, transport._export.rect().topRight()).x()
        assert right < width


@pytest.mark.usefixtures("themed")
def test_in_a_small_window_with_a_filter_the_header_does_not_overlap(qtbot: QtBot, controller: Controller) -> None:
    window = controller.window
    bar = window.presets
    bar.name.setText("★  Nylon B3, random shapes, 16 kHz — Integrated phase, blind   ▾")

    def apart() -> bool:
        bar.filtered.show_listed(1, 21)  # again: a list that is read meanwhile is not filtered
        parts = [bar.layout().itemAt(at).geometry() for at in range(4)]
        return all(left.right() < right.left() for left, right in pairwise(parts))

    for width in (760, 1000, 1280):
        window.resize(width, 600)
        qtbot.waitUntil(lambda width=width: bar.geometry().right() < width == window.width())
        qtbot.waitUntil(apart)
        assert bar.minimumSizeHint().width() <= bar.width()
        assert bar.name.text().endswith("▾")


def test_it_opens_no_larger_than_the_screen(qtbot: QtBot) -> None:
    window = MainWindow()
    qtbot.addWidget(window)
    room = window.screen().availableSize()
    window.resize(room + QSize(200, 100))
    for saved in ("", window.geometry_text()):
        window.resize(room + QSize(200, 100))
        window.restore_geometry(saved)
        assert window.width() <= room.width()
        assert window.height() < room.height()


def test_every_action_is_in_the_menu_and_does_something(controller: Controller) -> None:
    keys = [entry.key for entry in ENTRIES.values() if entry.key]
    assert len(set(keys)) == len(keys)
    for name, entry in ENTRIES.items():
        action = controller.window.action[name]
        assert entry.does or not entry.key
        assert action.text().startswith(entry.text.removesuffix(" …"))
        assert action.isSignalConnected(QMetaMethod.fromSignal(action.triggered)), name
        if entry.key not in ("", "Return"):
            assert action.shortcut() == QKeySequence(entry.key)
            assert action in controller.window.actions(), "its shortcut works while no menu is open"


def test_the_look_is_chosen_in_the_menu(qtbot: QtBot, qapp: QApplication) -> None:
    window = MainWindow()
    qtbot.addWidget(window)
    style, palette = qapp.styleSheet(), qapp.palette()
    made = Appearance(window, Look(theme="dark"))
    try:
        actions = {action.text(): action for menu in window.menu.findChildren(QMenu) for action in menu.actions()}
        assert actions["Dark"].isChecked()
        actions["Light"].trigger()
        assert made.look.theme == "light"
        assert theme.present == theme.LIGHT
        assert actions["Light"].isChecked()
        knob, brand = window.transport.knobs["volume_db"], window._brand
        small = knob.sizeHint(), brand.sizeHint(), theme.small_font(10).pixelSize()
        actions["150 %"].trigger()
        assert made.look.size_percent == 150
        large = knob.sizeHint(), brand.sizeHint(), theme.small_font(10).pixelSize()
        for before, after in zip(small[:2], large[:2], strict=True):
            assert after.width() > before.width()
            assert after.height() == pytest.approx(1.5 * before.height(), rel=0.15)
        assert large[2] == 1.5 * small[2]
        actions["100 %"].trigger()
        assert (knob.sizeHint(), theme.small_font(10).pixelSize()) == (small[0], small[2])
    finally:
        theme.apply_theme(qapp, "dark")
        qapp.styleHints().setColorScheme(Qt.ColorScheme.Unknown)
        qapp.setStyleSheet(style)
        qapp.setPalette(palette)


@pytest.fixture
def alive(qtbot: QtBot) -> MainWindow:
    window = MainWindow()
    qtbot.addWidget(window)
    window.show_stage(QWidget())
    window.show_face("lab")
    window.show_keys(True)
    with qtbot.waitExposed(window):
        window.show()
    return window


def test_in_the_lab_the_keys_are_folded_away_and_come_back(qtbot: QtBot, alive: MainWindow) -> None:
    alive.resize(1280, 720)
    assert alive.shows_keys
    assert alive.instrument.isVisible()
    for shown in (False, True):
        alive.action["keys"].trigger()  # Ctrl+K, and the menu
        assert alive.shows_keys == alive.instrument.isVisible() == shown
    qtbot.mouseClick(alive._keys_button, Qt.MouseButton.LeftButton)
    assert not alive.instrument.isVisible()
    alive.show_face("play")
    assert alive.instrument.isVisible()


def test_in_a_low_lab_the_plots_make_room_for_the_keys(alive: MainWindow) -> None:
    parts = (alive.left, alive._facts, alive.instrument.keys)
    for height, seen in ((800, (True, True, True)), (640, (True, True, True)), (600, (False, True, True))):
        alive.resize(1280, height)
        assert tuple(part.isVisible() for part in parts) == seen, height
    alive.resize(1280, 500)
    assert not alive._facts.isVisible()
    alive.show_solo(3)
    for height in (500, 700, 500):
        alive.resize(1280, height)
        assert alive._solo.isVisible(), "with the preset's facts, or without"
    alive.show_solo(0)
    alive.resize(1280, 700)
    assert not alive._solo.isVisible()
    alive.resize(1280, 500)
    alive.show_keys(False)
    assert alive.left.isVisible()


def test_in_a_low_play_face_the_knobs_take_the_place_of_the_keys(alive: MainWindow) -> None:
    alive.show_face("play")
    strip = alive.instrument
    strip.set_unfolded(True)
    for height, seen in ((720, (True, True, True)), (600, (False, True, True)), (500, (False, True, True))):
        alive.resize(1280, height)
        assert tuple(part.isVisible() for part in (strip.keys, strip.bar, strip.knobs)) == seen, height


AREAS = {  # by face: what is shown of it, and what is not
    "play": ("instrument.bar", "instrument.keys", "_shown", "transport.meter"),
    "lab": ("presets", "left", "right", "transport.slots", "_facts", "_test_button", "_shown", "transport.meter"),
}


@pytest.mark.parametrize(("face", "other"), [("play", "lab"), ("lab", "play")])
def test_each_face_shows_its_areas(alive: MainWindow, face: Face, other: Face) -> None:
    alive.resize(1280, 800)
    alive.show_face(other)
    alive.show_face(face)
    for name in AREAS[face]:
        assert attrgetter(name)(alive).isVisible(), name
    for name in set(AREAS[other]) - set(AREAS[face]) - {"instrument.keys"}:
        assert not attrgetter(name)(alive).isVisible(), name


def test_one_key_changes_the_face_and_the_choice_is_kept(qtbot: QtBot, controller: Controller) -> None:
    window = controller.window
    assert window.face == controller.session.choices.face == "lab"
    qtbot.keyClick(window, Qt.Key.Key_F9)
    assert window.face == controller.settings().choices.face == "play"
    buttons = {button.text(): button for button in window.faces.findChildren(QAbstractButton)}
    qtbot.mouseClick(buttons["Lab"], Qt.MouseButton.LeftButton)
    assert window.face == "lab"


@pytest.mark.parametrize("face", ["play", "lab"])
@pytest.mark.parametrize("unfolded", [False, True])
def test_every_value_has_one_knob_in_a_face(played: Controller, face: Face, unfolded: bool) -> None:
    """Macros with one target are the knob of that target."""
    window, patch = played.window, played.session.choices.patch
    assert patch is not None
    window.resize(1600, 1000)
    played.session.update(face=face)
    window.instrument.set_unfolded(unfolded)
    strip, same = window.instrument, {"listen": "pickup.points.0", "listen_right": "pickup.points.1"}
    shown = [same.get(field, field) for field, knob in window.transport.knobs.items() if knob.isVisible()]
    shown += [field for knobs in (strip.bar.knobs, strip.knobs.knobs) for field, k in knobs.items() if k.isVisible()]
    for macro, knob in zip(patch.macros, strip.bar.macros, strict=False):
        shown += [macro.targets[0].field] if knob.isVisible() and len(macro.targets) == 1 else []
    assert len(shown) == len(set(shown)) >= 6
    assert len({"position", "pluck.position"} & set(shown)) <= 1


def test_nothing_is_red_in_play_until_the_error_grew_and_then_a_sign_shows(alive: MainWindow) -> None:
    alive.show_face("play")
    assert not alive.growth_sign.isVisible()
    alive.show_growth("The error grew.")
    assert alive.growth_sign.isVisible()
    assert "grew" in alive.growth_sign.toolTip()
    alive.show_face("lab")
    assert not alive.growth_sign.isVisible()


def test_in_play_the_rate_shows_only_with_a_fault(alive: MainWindow) -> None:
    for face, fault, seen in (("play", False, False), ("lab", False, True), ("play", True, True)):
        alive.show_face(face)
        alive.show_rate(f"48 kHz {face}", "", fault)
        assert alive.rate_label.isVisible() == seen


def test_a_sign_shows_while_files_hover_over_the_window(alive: MainWindow) -> None:
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile("/tmp/song.mid"), QUrl.fromLocalFile("/tmp/other.wav")])
    buttons, mods = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
    copy = Qt.DropAction.CopyAction
    QApplication.sendEvent(alive, QDragEnterEvent(QPoint(50, 50), copy, data, buttons, mods))
    assert alive._drop_sign.isVisible()
    assert "song.mid and 1 more" in alive._drop_sign.text()
    QApplication.sendEvent(alive, QDragLeaveEvent())
    assert not alive._drop_sign.isVisible()
    QApplication.sendEvent(alive, QDragEnterEvent(QPoint(50, 50), copy, data, buttons, mods))
    dropped: list[Path] = []
    alive.file_dropped.connect(dropped.append)
    QApplication.sendEvent(alive, QDropEvent(QPointF(50, 50), copy, data, buttons, mods))
    assert not alive._drop_sign.isVisible()
    assert dropped == [Path("/tmp/song.mid"), Path("/tmp/other.wav")]


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="this system has no such names")
def test_a_dropped_file_keeps_the_bytes_of_its_name(alive: MainWindow) -> None:
    data = QMimeData()
    data.setData("text/uri-list", b"file:///tmp/caf%E9/100%25%20caf%E9%20%C3%A9.mid\r\n")
    dropped: list[Path] = []
    alive.file_dropped.connect(dropped.append)
    copy, left, none = Qt.DropAction.CopyAction, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
    alive.dropEvent(QDropEvent(QPointF(50, 50), copy, data, left, none))
    assert [os.fsencode(path) for path in dropped] == [b"/tmp/caf\xe9/100% caf\xe9 \xc3\xa9.mid"]


def test_files_are_opened_from_the_menu(alive: MainWindow, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(QFileDialog, "getOpenFileNames", lambda *_: (["/tmp/a.mid", "/tmp/b.scl"], ""))
    opened: list[Path] = []
    alive.file_dropped.connect(opened.append)
    alive.action["open"].trigger()
    assert opened == [Path("/tmp/a.mid"), Path("/tmp/b.scl")]


@pytest.fixture
def larger(qapp: QApplication) -> Iterator[None]:
    """Text of 150 %."""
    sheet, font = qapp.styleSheet(), qapp.font()
    theme.apply_theme(qapp, "dark", 150)
    yield
    theme.apply_theme(qapp, "dark")
    qapp.setStyleSheet(sheet)
    qapp.setFont(font)


@pytest.mark.usefixtures("larger")
@pytest.mark.parametrize("height", [720, 800])
@pytest.mark.parametrize("face", ["play", "lab"])
def test_nothing_is_cut_off_with_text_of_150_percent(
    qtbot: QtBot, played: Controller, face: Face, height: int
) -> None:
    window = played.window
    played.session.update(face=face)
    window.show_keys(False)
    window.resize(1280, height)
    qtbot.waitUntil(lambda: window.centralWidget().minimumSizeHint().height() <= height)
    assert window.centralWidget().minimumSizeHint().width() <= 1280
    for area in window.findChildren(Sideways):
        if area.isVisible():
            qtbot.waitUntil(lambda area=area: area.widget().minimumSizeHint().width() <= area.width())
    if face == "lab":
        assert window.left.isVisible() and window.right.isVisible()


LONG = "A fault in words that are long enough for two lines where the window is narrow. " * 2


def heights(window: MainWindow) -> list[int]:
    return [part.height() for part in (window._shown, window.left, window.right, window.transport)]


@pytest.mark.usefixtures("themed")
@pytest.mark.parametrize("size", [(1280, 720), (1280, 800), (1920, 1080), (1280, 640), (1000, 640)])
def test_neither_a_notice_nor_the_knobs_of_the_string_remove_what_is_seen(
    qtbot: QtBot, controller: Controller, size: tuple[int, int]
) -> None:
    window, middle = controller.window, controller.window.centralWidget()
    window.resize(*size)
    window.notices.hide()
    qtbot.wait(50)
    bare = heights(window)
    window.notices.report(LONG)
    qtbot.wait(50)
    assert heights(window) == bare, "it lies over the window"
    qtbot.waitUntil(lambda: middle.minimumSizeHint().height() <= window.height())
    for view, least in (
        (window._shown, window._shown.minimumSizeHint().height()),
        (window.left, window.left.minimumSizeHint().height()),
        (window.right, window.right.minimumSizeHint().height()),
    ):
        assert view.isVisible()
        assert view.height() >= least > 0
    controller.session.update(face="play")
    window.instrument.set_unfolded(True)
    qtbot.waitUntil(lambda: middle.minimumSizeHint().height() <= window.height())
    assert window.instrument.knobs.isVisible()
    assert window._shown.height() >= window._shown.minimumSizeHint().height()


@pytest.mark.usefixtures("themed")
@pytest.mark.parametrize("height", [480, 533])  # of 1280 × 720 and 1280 × 800 at 150 %
def test_the_knobs_of_the_string_work_at_150_percent(qtbot: QtBot, played: Controller, height: int) -> None:
    window, strip = played.window, played.window.instrument
    middle = window.centralWidget()
    played.session.update(face="play")
    window.notices.report(LONG)
    window.resize(853, height)
    for part in (strip.bar, strip.keys):
        qtbot.waitUntil(part.isVisible)
    qtbot.mouseClick(strip._fold, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: middle.minimumSizeHint().height() <= window.height())
    assert window._shown.height() >= window._shown.minimumHeight()
    knob = strip.knobs.knobs["pluck.curve"]  # the last
    tab_to(qtbot, window, knob)
    qtbot.waitUntil(lambda: knob.visibleRegion().boundingRect().size() == knob.size())
    patch = played.session.choices.patch
    qtbot.keyClick(knob, Qt.Key.Key_Up)
    changed = played.session.choices.patch
    assert patch is not None and changed is not None
    assert changed.pluck.curve == pytest.approx(patch.pluck.curve + 0.05)
    qtbot.mouseClick(strip._choice.findChildren(QAbstractButton)[0], Qt.MouseButton.LeftButton)
    assert strip.keys.isVisible()


@pytest.mark.usefixtures("themed")
def test_a_notice_is_read_whole_over_the_window_and_dismissed_by_keys(qtbot: QtBot, controller: Controller) -> None:
    window, notices = controller.window, controller.window.notices
    for width in (1280, 853):
        window.resize(width, 700)
        for text in ("Saved.", LONG * 3):
            notices.report(text)
            label = notices._label
            qtbot.waitUntil(lambda label=label: label.height() >= label.heightForWidth(label.width()))
            qtbot.waitUntil(lambda: window.presets.geometry().bottom() < notices.geometry().top())
            place = notices.geometry()
            assert 0 < place.left() < place.right() < width
            assert notices.visibleRegion().boundingRect().size() == notices.size()
    (dismiss,) = (each for each in notices.findChildren(QAbstractButton) if each.text() == "Dismiss")
    tab_to(qtbot, window, dismiss)
    qtbot.keyClick(dismiss, Qt.Key.Key_Return)
    qtbot.waitUntil(lambda: not notices.isVisible())
    qtbot.keyClick(window, Qt.Key.Key_F8)
    assert notices._list is not None
    assert notices._list._list.count() == len(notices.notices)
    notices._list.close()


@pytest.mark.usefixtures("themed")
@pytest.mark.parametrize("size", [(853, 480), (1280, 720), (1280, 800)])
def test_a_browser_opens_under_a_notice_and_has_room_for_a_search(
    qtbot: QtBot, controller: Controller, size: tuple[int, int]
) -> None:
    window = controller.window
    window.resize(*size)
    window.notices.report(LONG)
    for desk in (controller.presets, controller.patches.desk):
        desk.toggle()
        browser = desk.browser
        qtbot.waitUntil(lambda: window.presets.geometry().bottom() < window.notices.y())
        qtbot.waitUntil(lambda browser=browser: browser.y() > window.notices.geometry().bottom())
        assert browser.geometry().bottom() <= window.height()
        qtbot.waitUntil(lambda browser=browser: browser.layout().minimumSize().width() <= browser.width())
        assert browser.search.width() >= browser.search.minimumWidth() > 100
        desk.toggle()
