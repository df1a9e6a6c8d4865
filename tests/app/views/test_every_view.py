"""The laws of every control, plot and dialog: a name, the keyboard alone, both themes, room, and no thread left.

Views are found in their modules; one that needs arguments has a maker here. Every test checks that no thread is left.
"""

from __future__ import annotations

import importlib
import inspect
import itertools
import pkgutil
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path

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
from app.views.controls import (
    browser,
    browser_rows,
    choosers,
    deck,
    drop_sign,
    elided_label,
    focus_ring,
    form,
    knob,
    notice_bar,
    number_box,
    overflow,
    plain,
    progress_strip,
    segments,
    sideways,
)
from app.views.dialogs import (
    abx_dialog,
    abx_pages,
    export_dialog,
    export_pages,
    help_dialog,
    learn_dialog,
)
from app.views.file_places import FilePlaces
from app.views.instrument import instrument_card
from app.views.plots import figures_table, kept_plot, legend, plots, time_plot
from app.views.plots import plot as plot_module
from tests.app.conftest import make_sound
from tests.app.gestures import picture
from tests.app.places import choose_files

BASES = {"ChoiceBar", "ExportPage", "Form", "Playable", "StageView", "WorkDialog", "ZoomPlot"}
SCREEN = 1280, 720
MATERIAL = AbxRecord(
    a=Candidate(label="Model", preset="small", preset_sha256="0f" * 32),
    b=Candidate(label="Truth", preset="small", preset_sha256="0f" * 32),
    pluck={"position": 0.4, "amplitude_mm": 4.0, "seconds": 0.1},
    through={"volume_db": 0.0},
    planned_trials=1,
    seed=0,
)


def made_deck() -> QWidget:
    made = deck.Deck("Views")
    for key in ("first", "second"):
        made.add(key, key, plain.Label(key))
    return made


def filtered() -> QWidget:
    made = choosers.FilterButton("presets", lambda: None)
    made.show_listed(2, 3)
    return made


def with_ring() -> QWidget:
    plot = time_plot.TimePlot("A plot", "A tip")
    focus_ring.FocusRing(plot)
    return plot


def notice() -> QWidget:
    made = notice_bar.NoticeBar()
    made.report("No sound.", "device 3")
    return made


def made_legend() -> QWidget:
    plot = time_plot.TimePlot("A plot", "A tip")
    plot.legend = legend.Legend(plot)
    return plot


def export_at(kind: export_pages.Kind) -> Callable[[], QWidget]:
    def make() -> QWidget:
        made = export_dialog.ExportDialog((ExportChoices(), SampledChoices()), FilePlaces())
        made.open_at(kind)
        return made

    return make


def learn() -> QWidget:
    sound = make_sound()
    made = learn_dialog.LearnDialog(Path(__file__), sound)
    made.finished.connect(sound.close)
    return made


def abx() -> QWidget:
    rendered: Future[dict[str, np.ndarray]] = Future()
    rendered.set_result({name: np.ones((480, 1), np.float32) for name in ("model", "truth")})
    sound = make_sound()
    made = abx_dialog.AbxDialog(sound, MATERIAL, AbxChoices(), lambda rate_hz: rendered, FilePlaces())
    made.finished.connect(sound.close)
    return made


def with_name(part: QWidget) -> QWidget:
    """A part, named as by its owner."""
    part.setAccessibleName("A part")
    part.setToolTip("A tip")
    return part


def with_text(label: QLabel) -> QLabel:
    label.setText("A text")
    return label


MAKERS: dict[type[QWidget], Callable[[], QWidget]] = {
    browser.Browser: instrument_card.instrument_browser,
    browser_rows.RowList: lambda: with_name(browser_rows.RowList((browser_rows.BrowserColumn("Name"),))),
    deck.Deck: made_deck,
    drop_sign.DropSign: lambda: with_text(drop_sign.DropSign(QWidget())),
    elided_label.ElidedLabel: lambda: with_text(elided_label.ElidedLabel()),
    choosers.FilterButton: filtered,
    focus_ring.FocusRing: with_ring,
    form.FilePicker: lambda: form.FilePicker(FilePlaces(), "note", "Where it is saved"),
    knob.Knob: lambda: knob.Knob(OF_CHOICES["position"]),
    choosers.NameButton: lambda: with_name(choosers.NameButton("A name", "A tip", print)),
    number_box.NoteBox: lambda: number_box.NoteBox("Lowest key", "The lowest"),
    notice_bar.NoticeBar: notice,
    number_box.NumberBox: lambda: number_box.NumberBox("Length", (0, 5), 1, "The length", " m", 2),
    number_box.CountBox: lambda: number_box.CountBox("Trials", 50, 16, "How many"),
    overflow.Overflow: lambda: overflow.Overflow("the row"),
    plain.Label: lambda: plain.Label("A text"),
    plain.SteadyLabel: lambda: with_text(plain.SteadyLabel("A wide text")),
    progress_strip.ProgressStrip: lambda: progress_strip.ProgressStrip("Progress"),
    elided_label.Readout: lambda: with_text(elided_label.Readout()),
    segments.Segments: lambda: segments.Segments("Surface", [("a", "A", "The first"), ("b", "B", "The second")]),
    sideways.Sideways: lambda: sideways.Sideways(plain.Label("A text")),
    figures_table.FiguresTable: lambda: figures_table.FiguresTable(
        "Figures", [figures_table.FigureColumn("name", "name", "a name")]
    ),
    kept_plot.KeptPlot: lambda: kept_plot.KeptPlot("A plot", "A tip"),
    legend.Legend: made_legend,
    plot_module.Plot: lambda: plot_module.Plot("A plot", "A tip"),
    time_plot.TimePlot: lambda: time_plot.TimePlot("A plot", "A tip"),
    abx_pages.SetupPage: lambda: abx_pages.SetupPage("A pluck", ("Model", "Truth"), AbxChoices()),
    abx_pages.TrialPage: lambda: abx_pages.TrialPage(("Model", "Truth")),
    abx_dialog.AbxDialog: abx,
    export_pages.WavForm: lambda: export_pages.WavForm(ExportChoices()),
    export_pages.NotePage: export_at("note"),
    export_pages.PerformancePage: export_at("performance"),
    export_pages.ModelsPage: export_at("models"),
    export_pages.SamplerPage: export_at("sampler"),
    export_pages.PluginPage: export_at("plugin"),
    export_dialog.ExportDialog: export_at("note"),
    help_dialog.HelpDialog: lambda: help_dialog.HelpDialog(
        [("F1", "Help")], [("A view", "All")], Path("log"), "About"
    ),
    learn_dialog.LearnDialog: learn,
}


def found_views() -> Iterator[type[QWidget]]:
    for module in pkgutil.walk_packages(app.views.__path__, "app.views."):
        for name, each in vars(importlib.import_module(module.name)).items():
            own = inspect.isclass(each) and issubclass(each, QWidget) and each.__module__ == module.name
            if own and name not in BASES and not name.startswith("_"):
                yield each


VIEWS = list(found_views())


@pytest.fixture(scope="module")
def themes(qapp: QApplication) -> Iterator[None]:
    """Plots follow the theme; afterwards all is as it was."""
    style, palette, font = qapp.styleSheet(), qapp.palette(), qapp.font()
    theme.apply_theme(qapp, "dark")
    plots.recolour(theme.present, theme.present)
    theme.changes.theme_changed.connect(plots.recolour)
    yield
    theme.changes.theme_changed.disconnect(plots.recolour)
    theme.use(theme.DARK)
    qapp.styleHints().setColorScheme(Qt.ColorScheme.Unknown)
    qapp.setStyleSheet(style)
    qapp.setPalette(palette)
    qapp.setFont(font)


@pytest.fixture
def size_percent() -> int:
    """The size of the text."""
    return 100


@contextmanager
def shown(kind: type[QWidget], qtbot: QtBot) -> Iterator[QWidget]:
    """An empty one: a dialog alone, another in the column of a window."""
    made = MAKERS.get(kind, kind)()
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
    if isinstance(made, learn_dialog.LearnDialog):
        qtbot.waitUntil(made.start.isEnabled)
    yield made
    made.abandon() if isinstance(made, abx_dialog.AbxDialog) else window.close()
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


def test_the_keyboard_alone_reaches_and_works_each_control(qtbot: QtBot, view: QWidget) -> None:
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


def test_all_have_names_tips_and_the_colours_of_the_theme(themes: None, qtbot: QtBot, qapp: QApplication) -> None:
    """All at once, as another theme takes as long for one."""
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
            theme.apply_theme(qapp, choice)  # type: ignore[arg-type]
            QApplication.processEvents()
            seen.append({name: picture(view) for name, view in views.items()})
    for name, dark, light, again in zip(views, *(pictures.values() for pictures in seen), strict=True):
        assert again == dark, name
        for image, other in ((dark, theme.LIGHT), (light, theme.DARK)):
            assert share_of(image, other.background, other.panel, other.raised, other.text) < 0.01, name
        assert light != dark or share_of(light, theme.LIGHT.text) == 0, name


@pytest.mark.parametrize("size_percent", [150])
def test_each_has_room_with_larger_text(view: QWidget) -> None:
    window = view.window()
    window.adjustSize() if isinstance(view, QDialog) else window.resize(*SCREEN)
    QApplication.processEvents()
    assert window.width() <= SCREEN[0] or window.minimumSizeHint().width() > SCREEN[0]
    assert window.height() <= SCREEN[1]
    for each in controls(view):
        area = QRect(each.mapTo(view, QPoint()), each.size())
        inside = each is view or any(isinstance(above, QScrollArea) for above in ancestors(each))
        assert inside or view.rect().contains(area), name_of(each)
        if isinstance(each, QAbstractButton):
            assert each.height() >= min(each.fontMetrics().height(), each.sizeHint().height()), name_of(each)
    assert not picture(view).isNull()


def ancestors(widget: QWidget) -> Iterator[QWidget]:
    while (widget := widget.parentWidget()) is not None:
        yield widget
