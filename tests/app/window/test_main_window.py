"""The window as a place: it fits small screens, is walked through with Tab, and needs no engine to be seen."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest
from PySide6.QtCore import QSize, Qt, QTimer
from PySide6.QtWidgets import QAbstractButton, QApplication, QComboBox, QMenu, QTabBar, QWidget
from pytestqt.qtbot import QtBot

from app.views import theme
from app.views.controls.focus_ring import FocusRing
from app.views.look import Look
from app.window.appearance import Appearance
from app.window.controller import Controller
from app.window.main_window import KEYS, MainWindow

ROOT = Path(__file__).parents[3]


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
    window.show_string(QWidget())
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
    window.notices.tell("Something to dismiss.")
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
    window.notices.tell("Something to dismiss.")
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
    window.notices.tell(LONG)
    middle = window.centralWidget()
    for size in (QSize(1024, 560), QSize(820, 490)):
        window.resize(size)
        qtbot.waitUntil(lambda size=size: middle.minimumSizeHint().expandedTo(size) == size)
        assert window.size() == size


@pytest.mark.usefixtures("themed")
def test_in_a_narrow_window_the_controls_stand_closer_and_all_are_seen(qtbot: QtBot, controller: Controller) -> None:
    window = controller.window
    transport = window.transport
    for width, words in ((1000, "Export …"), (1280, "Export WAV …"), (958, "Export …")):
        window.resize(width, 600)
        qtbot.waitUntil(lambda words=words: transport._export.text() == words)
        qtbot.waitUntil(lambda: transport.minimumSizeHint().width() <= transport.parentWidget().width())
        right = transport._export.mapTo(window, transport._export.rect().topRight()).x()
        assert right < width


@pytest.mark.usefixtures("themed")
def test_in_a_small_window_with_a_filter_the_header_does_not_overlap(qtbot: QtBot, controller: Controller) -> None:
    window = controller.window
    bar = window.presets
    bar.set_listed(1, 21)
    bar.name.setText("★  Nylon B3, random shapes, 16 kHz — Integrated phase, blind   ▾")

    def apart() -> bool:
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


def test_every_key_has_its_signal_and_words() -> None:
    assert len({key for key, _, _ in KEYS}) == len(KEYS)
    for _, signal, what in KEYS:
        assert hasattr(MainWindow, signal)
        assert what


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
        actions["150 %"].trigger()
        assert made.look.size_percent == 150
        assert "restart" in window.notices.text
    finally:
        theme.apply_theme(qapp, "dark")
        qapp.styleHints().setColorScheme(Qt.ColorScheme.Unknown)
        qapp.setStyleSheet(style)
        qapp.setPalette(palette)


@pytest.fixture
def alive(qtbot: QtBot) -> MainWindow:
    window = MainWindow()
    qtbot.addWidget(window)
    window.show_string(QWidget())
    with qtbot.waitExposed(window):
        window.show()
    return window


def test_the_instrument_is_folded_away_and_comes_back(qtbot: QtBot, alive: MainWindow) -> None:
    alive.resize(1280, 720)
    assert alive.shows_instrument
    assert alive.instrument.isVisible()
    for shown in (False, True):
        alive.instrument_asked.emit()  # Ctrl+K, and the menu
        assert alive.shows_instrument == alive.instrument.isVisible() == shown
    qtbot.mouseClick(alive._instrument_button, Qt.MouseButton.LeftButton)
    assert not alive.instrument.isVisible()


def test_in_a_low_window_the_knobs_take_the_place_of_the_keys_and_the_views_go_last(alive: MainWindow) -> None:
    parts = (alive.left, alive._facts, alive.instrument.keys, alive.instrument.bar, alive.instrument.knobs)
    alive.instrument.set_unfolded(True)
    for height, seen in (
        (800, (True, True, True, True, True)),
        (720, (True, True, False, True, True)),
        (640, (True, True, False, True, True)),  # of 720 with a title bar and a task bar
        (600, (False, True, False, True, True)),
        (500, (False, False, False, True, True)),
    ):
        alive.resize(1280, height)
        assert tuple(part.isVisible() for part in parts) == seen, height
    alive.show_solo(3)
    for height in (500, 700, 500):
        alive.resize(1280, height)
        assert alive._solo.isVisible(), "with the preset's facts, or without"
    alive.show_solo(0)
    alive.resize(1280, 700)
    assert not alive._solo.isVisible()
    alive.show_instrument(False)
    assert alive.left.isVisible()


LONG = "A fault in words that are long enough for two lines where the window is narrow. " * 2


def heights(window: MainWindow) -> list[int]:
    return [part.height() for part in (window._string, window.left, window.right, window.transport)]


@pytest.mark.usefixtures("themed")
@pytest.mark.parametrize("size", [(1280, 720), (1280, 800), (1920, 1080), (1280, 640), (1000, 640)])
def test_neither_a_notice_nor_the_knobs_of_the_string_remove_the_views(
    qtbot: QtBot, controller: Controller, size: tuple[int, int]
) -> None:
    window, middle = controller.window, controller.window.centralWidget()
    window.resize(*size)
    window.notices.hide()
    qtbot.wait(50)
    bare = heights(window)
    window.notices.tell(LONG)
    qtbot.wait(50)
    assert heights(window) == bare, "it lies over the window"
    window.instrument.set_unfolded(True)
    qtbot.waitUntil(lambda: middle.minimumSizeHint().height() <= window.height())
    assert window.instrument.knobs.isVisible()
    for view, least in (
        (window._string, window._string.minimumSizeHint().height()),
        (window.left, window.left.minimumSizeHint().height()),
        (window.right, window.right.minimumSizeHint().height()),
    ):
        assert view.isVisible()
        assert view.height() >= least > 0
    if not window.instrument.keys.isVisible():
        assert heights(window) == bare


@pytest.mark.usefixtures("themed")
@pytest.mark.parametrize("height", [480, 533])  # of 1280 × 720 and 1280 × 800 at 150 %
def test_the_knobs_of_the_string_work_at_150_percent(qtbot: QtBot, played: Controller, height: int) -> None:
    window, strip = played.window, played.window.instrument
    middle = window.centralWidget()
    window.notices.tell(LONG)
    window.resize(853, height)
    for part in (strip.bar, strip.keys):
        qtbot.waitUntil(part.isVisible)
    qtbot.mouseClick(strip._fold, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: middle.minimumSizeHint().height() <= window.height())
    assert window._string.height() >= window._string.minimumHeight()
    transport = window.transport
    transport._pickup.activated.emit(transport._pickup.findData("velocity"))  # the bridge has no listening place
    knob = strip.knobs.knobs["pickup.points.0"]  # one of the last
    tab_to(qtbot, window, knob)
    qtbot.waitUntil(lambda: knob.visibleRegion().boundingRect().size() == knob.size())
    patch = played.session.choices.patch
    qtbot.keyClick(knob, Qt.Key.Key_Up)
    changed = played.session.choices.patch
    assert patch is not None and changed is not None
    assert changed.pickup.points[0] == pytest.approx(patch.pickup.points[0] + 0.01)
    qtbot.mouseClick(strip._choice.findChildren(QAbstractButton)[0], Qt.MouseButton.LeftButton)
    assert strip.keys.isVisible()


@pytest.mark.usefixtures("themed")
def test_a_notice_is_read_whole_over_the_window_and_dismissed_by_keys(qtbot: QtBot, controller: Controller) -> None:
    window, notices = controller.window, controller.window.notices
    for width in (1280, 853):
        window.resize(width, 700)
        for text in ("Saved.", LONG * 3):
            notices.tell(text)
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
def test_a_browser_covers_a_notice_below_the_header_and_has_room_for_a_search(
    qtbot: QtBot, controller: Controller, size: tuple[int, int]
) -> None:
    window = controller.window
    window.resize(*size)
    window.notices.tell(LONG)
    for desk in (controller.presets, controller.patches.desk):
        desk.toggle()
        browser = desk.browser
        qtbot.waitUntil(lambda: window.presets.geometry().bottom() < window.notices.y())
        qtbot.waitUntil(lambda browser=browser: browser.y() == window.notices.y())
        qtbot.waitUntil(lambda browser=browser: browser.layout().minimumSize().width() <= browser.width())
        assert browser.search.width() >= browser.search.minimumWidth() > 100
        desk.toggle()
