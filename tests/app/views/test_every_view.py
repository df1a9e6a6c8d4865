"""The laws of every control, plot and dialog: a name, the keyboard alone, both themes, room, and no thread left.

Views are found in their modules, and given arguments by their annotations; a few have a maker here.
"""

import importlib
import inspect
import itertools
import pkgutil
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from PySide6.QtCore import QPoint, QRect, Qt
from PySide6.QtGui import QAccessible, QColor, QImage
from PySide6.QtTest import QTest
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractSpinBox,
    QApplication,
    QComboBox,
    QDialog,
    QLabel,
    QLineEdit,
    QMenu,
    QPushButton,
    QScrollArea,
    QTabBar,
    QToolButton,
    QVBoxLayout,
    QWidget,
)
from pytestqt.qtbot import QtBot

import app.views
from app.analysis.abx.record import AbxRecord, Candidate
from app.analysis.abx.trials import AbxChoices
from app.export.choices import ExportChoices
from app.export.sampled.choices import SampledChoices
from app.shared.parameters import OF_CHOICES
from app.views import theme
from app.views.controls.browser_rows import BrowserColumn
from app.views.controls.choosers import FilterButton
from app.views.controls.deck import Deck
from app.views.controls.notice_bar import NoticeBar
from app.views.controls.plain import Label
from app.views.dialogs.abx_dialog import AbxDialog
from app.views.dialogs.export_dialog import ExportDialog
from app.views.dialogs.export_pages import Kind
from app.views.dialogs.learn_dialog import LearnDialog
from app.views.file_places import FilePlaces
from app.views.instrument.instrument_card import instrument_browser
from app.views.plots import plots
from app.views.plots.figures_table import FigureColumn
from app.views.plots.time_plot import TimePlot
from tests.app.conftest import make_sound
from tests.app.gestures import picture
from tests.app.places import choose_files

BASES = {"ChoiceBar", "ExportPage", "Form", "Playable", "StageView", "WorkDialog", "ZoomPlot"}
SCREEN = 1280, 720
SEGMENTS = [("a", "A", "The first"), ("b", "B", "The second")]
ARGUMENTS: dict[str, Callable[[], Any]] = {
    "str": lambda: "A text",
    "int": lambda: 16,
    "float": lambda: 1,
    "tuple[float, float]": lambda: (0, 5),
    "Handler": lambda: print,
    "Path": lambda: Path(__file__),
    "QWidget": lambda: TimePlot("A plot", "A tip"),
    "pg.PlotWidget": lambda: TimePlot("A plot", "A tip"),
    "Parameter": lambda: OF_CHOICES["position"],
    "FilePlaces": FilePlaces,
    "FileKind": lambda: "note",
    "AbxChoices": AbxChoices,
    "ExportChoices": ExportChoices,
    "SampledChoices": SampledChoices,
    "Remembered": lambda: (ExportChoices(), SampledChoices()),
    "Sequence[str]": lambda: ("Model", "Truth"),
    "Sequence[tuple[str, str]]": lambda: [("A view", "All")],
    "Iterable[tuple[str, str]]": lambda: [("F1", "Help")],
    "Iterable[tuple[str, str, str]]": lambda: SEGMENTS,
    "Sequence[BrowserColumn]": lambda: (BrowserColumn("Name"),),
    "Sequence[FigureColumn]": lambda: [FigureColumn("name", "name", "a name")],
}
PAGES = {"ExportDialog": "note", **{f"{page.title()}Page": page for page in get_args(Kind)}}


def learn() -> QWidget:
    sound = make_sound()
    made = LearnDialog(Path(__file__), sound)
    made.finished.connect(sound.close)
    return made


def abx() -> QWidget:
    rendered: Future[dict[str, np.ndarray]] = Future()
    rendered.set_result({name: np.ones((480, 1), np.float32) for name in ("model", "truth")})
    a, b = (Candidate(label=label, preset="small", preset_sha256="0f" * 32) for label in ("Model", "Truth"))
    pluck = {"position": 0.4, "amplitude_mm": 4.0, "seconds": 0.1}
    material = AbxRecord(a=a, b=b, pluck=pluck, through={"volume_db": 0.0}, planned_trials=1, seed=0)
    sound = make_sound()
    made = AbxDialog(sound, material, AbxChoices(), lambda rate_hz: rendered, FilePlaces())
    made.finished.connect(sound.close)
    return made


def make(kind: type[QWidget]) -> QWidget:
    """An empty one; a page within its dialog, and a part of a plot on one."""
    if maker := {"LearnDialog": learn, "AbxDialog": abx, "Browser": instrument_browser}.get(kind.__name__):
        return maker()
    if page := PAGES.get(kind.__name__):
        dialog = ExportDialog((ExportChoices(), SampledChoices()), FilePlaces())
        dialog.open_at(page)
        return dialog
    needed = [each for each in inspect.signature(kind).parameters.values() if each.default is each.empty]
    values = [ARGUMENTS[each.annotation]() for each in needed if each.kind is each.POSITIONAL_OR_KEYWORD]
    made = kind(*values)
    if kind.__name__ in ("Legend", "FocusRing"):
        return values[0]
    if kind.__name__ in ("NameButton", "RowList"):
        made.setAccessibleName("A part")  # as its owner does
    if isinstance(made, QLabel):
        made.setText("A text")
    if isinstance(made, FilterButton):
        made.show_listed(2, 3)
    if isinstance(made, NoticeBar):
        made.report("No sound.", "device 3")
    if isinstance(made, Deck):
        for key in ("first", "second"):
            made.add(key, key, Label(key))
    return made


def found_views() -> Iterator[type[QWidget]]:
    for module in pkgutil.walk_packages(app.views.__path__, "app.views."):
        for name, each in vars(importlib.import_module(module.name)).items():
            own = inspect.isclass(each) and issubclass(each, QWidget) and each.__module__ == module.name
            if own and name not in BASES and not name.startswith("_"):
                yield each


VIEWS = list(found_views())


@pytest.fixture(scope="module")
def themes(own_look: QApplication) -> Iterator[None]:
    theme.apply_theme(own_look, "dark")
    plots.recolour(theme.present, theme.present)
    theme.changes.theme_changed.connect(plots.recolour)
    yield
    theme.changes.theme_changed.disconnect(plots.recolour)


@pytest.fixture
def size_percent() -> int:
    return 100


@contextmanager
def shown(kind: type[QWidget], qtbot: QtBot) -> Iterator[QWidget]:
    """An empty one: a dialog alone, another in the column of a window."""
    made = make(kind)
    window = made if isinstance(made, QDialog) else QWidget()
    qtbot.addWidget(window)
    if window is not made:
        window.resize(*SCREEN)
        column = QVBoxLayout(window)
        column.addWidget(made)
        column.addStretch()
    window.show()
    made.show()
    window.activateWindow()
    qtbot.waitUntil(window.isActiveWindow)
    if isinstance(made, LearnDialog):
        qtbot.waitUntil(made.start.isEnabled)
    yield made
    made.abandon() if isinstance(made, AbxDialog) else window.close()
    assert not window.isVisible()


@pytest.fixture(params=VIEWS, ids=lambda kind: kind.__name__)
def view(
    request: pytest.FixtureRequest,
    themes: None,
    size_percent: int,
    qtbot: QtBot,
    qapp: QApplication,
    monkeypatch: pytest.MonkeyPatch,
) -> Iterator[QWidget]:
    choose_files(monkeypatch)
    if theme.present != replace(theme.DARK, scale=size_percent / 100):
        theme.apply_theme(qapp, "dark", size_percent)
    with shown(request.param, qtbot) as made:
        yield made


def controls(root: QWidget) -> list[QWidget]:
    """What the Tab key should reach."""
    parts = [root, *root.findChildren(QWidget)]
    return [
        each
        for each in parts
        if each.isVisible()
        and each.isEnabled()
        and each.focusPolicy() & Qt.FocusPolicy.TabFocus
        and each.focusProxy() is None
        and not (isinstance(each, QLineEdit) and isinstance(each.parent(), QAbstractSpinBox | QComboBox))
        and not isinstance(each, QMenu)
    ]


def name_of(widget: QWidget) -> str:
    return str(QAccessible.queryAccessibleInterface(widget).text(QAccessible.Text.Name))


def test_the_keyboard_alone_reaches_and_works_each_control(qtbot, view):
    wanted, reached = set(controls(view)), set[QWidget]()
    for _ in range(2 * len(wanted) + 4):
        here = QApplication.focusWidget() or view.window()
        reached.add(here)
        if isinstance(here, QAbstractButton) and here.group():
            for key in (Qt.Key.Key_Right, Qt.Key.Key_Down) * len(
                here.group().buttons()
            ):  # arrows pass through a group
                QTest.keyClick(QApplication.focusWidget(), key)
                reached.add(QApplication.focusWidget())
        QTest.keyClick(QApplication.focusWidget() or here, Qt.Key.Key_Tab)
    wanted &= {each for each in wanted if each.isVisible()}  # a choice may have hidden what it is not of
    assert wanted <= reached, [name_of(each) for each in wanted - reached]
    arrows = (Qt.Key.Key_Up, Qt.Key.Key_Down, Qt.Key.Key_Left, Qt.Key.Key_Right, Qt.Key.Key_Home, Qt.Key.Key_End)
    for each in wanted:
        for key in (*arrows, Qt.Key.Key_PageUp, Qt.Key.Key_PageDown, Qt.Key.Key_Delete):
            QTest.keyClick(each, key)
        if isinstance(each, QToolButton) and each.menu() is None and each.isEnabled() and each.isVisible():
            with qtbot.waitSignal(each.clicked):
                QTest.keyClick(each, Qt.Key.Key_Space)
    if isinstance(view, QDialog):
        view.show()
        QTest.keyClick(view, Qt.Key.Key_Escape)
        assert not view.isVisible()


def share_of(image: QImage, *colours: str) -> float:
    """The share of the pixels that have one of these colours."""
    image = image.convertToFormat(QImage.Format.Format_RGB32)
    pixels = np.frombuffer(image.constBits(), np.uint32).reshape(image.height(), -1)[:, : image.width()]
    return float(np.isin(pixels & 0xFFFFFF, [QColor(colour).rgb() & 0xFFFFFF for colour in colours]).mean())


def test_all_have_names_tips_and_the_colours_of_the_theme(themes, qtbot, qapp):
    with ExitStack() as stack:
        views = {kind.__name__: stack.enter_context(shown(kind, qtbot)) for kind in VIEWS}
        for each in itertools.chain.from_iterable(map(controls, views.values())):
            assert name_of(each), each
            ends = isinstance(each, QPushButton) and (each.isDefault() or name_of(each) in ("Close", "Cancel"))
            if isinstance(each, QAbstractButton | QComboBox | QAbstractSpinBox) and not ends:
                assert each.toolTip() or isinstance(each.parent(), QTabBar), name_of(each)
        for view in views.values():
            view.window().setFocus()
        seen = []
        for choice in ("dark", "light", "dark"):
            if theme.present != getattr(theme, choice.upper()):
                theme.apply_theme(qapp, choice)  # type: ignore[arg-type]
            QApplication.processEvents()
            seen.append({name: picture(view) for name, view in views.items()})
    for name, dark, light, again in zip(views, *(pictures.values() for pictures in seen), strict=True):
        assert again == dark, name
        for image, other in ((dark, theme.LIGHT), (light, theme.DARK)):
            assert share_of(image, other.background, other.panel, other.raised, other.text) < 0.01, name
        assert light != dark or share_of(light, theme.LIGHT.text) == 0, name


@pytest.mark.parametrize("size_percent", [150])
def test_each_has_room_with_larger_text(view):
    window = view.window()
    QApplication.processEvents()
    for text in view.findChildren(QLabel):
        if text.wordWrap() and text.isVisible():
            assert text.height() >= text.heightForWidth(text.width()), text.text()
    for button in view.findChildren(QPushButton):
        needed = min(button.minimumSizeHint().height(), button.maximumHeight())
        assert not button.isVisible() or button.height() >= needed, button.text()
    window.adjustSize() if isinstance(view, QDialog) else window.resize(*SCREEN)
    QApplication.processEvents()
    assert window.width() <= SCREEN[0] or window.minimumSizeHint().width() > SCREEN[0]
    assert window.height() <= SCREEN[1]
    for each in controls(view):
        area = QRect(each.mapTo(view, QPoint()), each.size())
        inside = each is view or any(above.isAncestorOf(each) for above in view.window().findChildren(QScrollArea))
        assert inside or view.rect().contains(area), name_of(each)
        if isinstance(each, QAbstractButton):
            assert each.height() >= min(each.fontMetrics().height(), each.sizeHint().height()), name_of(each)
    assert not picture(view).isNull()
