"""Plots: their line, axes and table, and what spectrum and waveform draw."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pyqtgraph as pg
import pytest
from numpy.typing import NDArray
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QColor, QFont, QFontMetrics, QGuiApplication, QImage
from PySide6.QtWidgets import QApplication

from app.presets.library import Library
from app.session.shown import DEFAULT_SOURCES, ShownSource
from app.stage.session import Session
from app.views import theme
from app.views.plots.axis_label import sparse
from app.views.plots.figures_table import FigureColumn, FiguresTable, TableRow
from app.views.plots.legend import _texts
from app.views.plots.time_plot import TimePlot
from app.window.panels.spectrum import Analyser, SpectrumPanel
from app.window.panels.waveform import WaveformPanel, extremes
from tests.app.gestures import CONTROL, LEFT, RIGHT, SHIFT, move, press_keys, reported, turn_wheel

Key = Qt.Key
Show = Callable[..., Any]
FIGURES = (FigureColumn("name", "name", "a name"), FigureColumn("level", "level", "in dB", lambda v: f"{v:.1f}"))


@pytest.fixture
def plot(show: Show) -> TimePlot:
    """Four seconds, of which a quarter of one is trained; a curve from corner to corner."""
    made = show(TimePlot("A plot", "A tip"), 640, 240)
    made.set_times(4.0, 0.25)
    made.getPlotItem().setYRange(0, 1, padding=0)
    made.plot([0, 4], [0, 1], pen=pg.mkPen(theme.MODEL, width=1))
    QApplication.processEvents()
    return made


def place_of(plot: TimePlot, time_s: float, height: float) -> QPoint:
    return plot.mapFromScene(plot.getPlotItem().vb.mapViewToScene(QPointF(time_s, height)))


def pixels(plot: TimePlot) -> NDArray[np.uint32]:
    image = plot.grab().toImage().convertToFormat(QImage.Format.Format_RGB32)
    return np.frombuffer(image.constBits(), np.uint32).reshape(image.height(), -1)[:, : image.width()].copy()


def line_columns(plot: TimePlot) -> list[int]:
    """The columns in which the playhead is seen."""
    return list(np.flatnonzero((pixels(plot) == QColor(theme.TEXT).rgb()).sum(axis=0) > 100))


def test_the_line_is_where_it_was_put_and_a_new_curve_is_seen(plot):
    plot.move_line(9.0)
    without, places = pixels(plot), []
    for at in (0.8, 2.0, 3.2):
        plot.move_line(at)
        (column,) = line_columns(plot)
        places.append(column)
    assert np.diff(places, n=2) == pytest.approx(0, abs=1)
    plot.plot([0, 4], [1, 0], pen=pg.mkPen(theme.TRUTH, width=1))
    changed = pixels(plot)
    assert (changed != without).any()
    plot.move_line(9.0)
    assert line_columns(plot) == []


def test_the_keyboard_seeks_and_zooms_and_a_click_reports_its_place(qtbot, plot):
    asked = reported(plot.seek_asked)
    plot.show_playhead(1.0)
    press_keys(plot, Key.Key_Right, Key.Key_Left, Key.Key_Home)
    assert asked == pytest.approx([1.1, 0.9, 0.0])
    press_keys(plot, Key.Key_Plus)
    low, high = plot.times_s
    assert low < 1.0 < high and high - low == pytest.approx(4.0 / 1.25**2)
    press_keys(plot, Key.Key_Minus)
    assert plot.times_s == pytest.approx((0, 4), abs=1e-6)
    plot.show_range(1.0, 1.02)
    press_keys(plot, Key.Key_Right)
    assert asked[-1] == pytest.approx(1.001)  # no more than a little of the view
    press_keys(plot, Key.Key_0)
    assert plot.times_s == pytest.approx((0, 4))
    seeks, points = reported(plot.seek_asked), reported(plot.pointed)
    place = place_of(plot, 2.0, 0.25)
    qtbot.mouseClick(plot.viewport(), LEFT, pos=place)
    assert points == []
    qtbot.mouseClick(plot.viewport(), LEFT, SHIFT, pos=place)
    assert seeks == pytest.approx([2.0, 2.0], abs=0.02)
    assert points[0] == pytest.approx((2.0, 0.25), abs=0.02)


def test_the_wheel_zooms_about_the_mouse_and_the_right_button_pans_to_the_ends(qtbot, plot):
    place, view = place_of(plot, 3.0, 0.5), plot.viewport()
    for steps, length_s in ((4, 4 / 1.25**4), (60, 0.002), (-100, 4)):
        turn_wheel(view, place, QPoint(0, 120 * steps))
        low, high = plot.times_s
        assert high - low == pytest.approx(length_s)
        assert steps != 4 or (3.0 - low) / (high - low) == pytest.approx(0.75, abs=0.01)
    plot.show_range(1.0, 2.0)
    QApplication.processEvents()
    start, end = place_of(plot, 1.5, 0.5), place_of(plot, 1.25, 0.5)
    qtbot.mousePress(view, RIGHT, pos=start)
    for to, times_s in ((start, (1, 2)), (end, (1.25, 2.25)), (end - QPoint(5000, 0), (3, 4))):
        move(view, to, RIGHT)
        assert plot.times_s == pytest.approx(times_s, abs=0.01)
    qtbot.mouseRelease(view, RIGHT, pos=end)


def test_the_view_stays_for_a_take_of_the_same_length(plot):
    assert (plot.horizon.isVisible(), plot.horizon.value()) == (True, 0.25)
    plot.show_range(0.5, 0.7)
    plot.set_times(4.0, 0.5)
    assert plot.times_s == pytest.approx((0.5, 0.7))
    plot.set_times(0.2, 0.25)
    assert plot.times_s == pytest.approx((0, 0.2))
    assert not plot.horizon.isVisible()


@pytest.mark.parametrize(
    ("room", "kept"), [(1, range(11)), (2, (0, 2, 4, 6, 8, 10)), (4, (0, 4, 10)), (10, (0, 10)), (99, (0,))]
)
def test_where_numbers_give_way_the_ends_go_last(room, kept):
    assert sparse([(float(place), f"{place}") for place in range(11)], room) == [(each, f"{each}") for each in kept]


@pytest.fixture
def table(show: Show) -> FiguresTable:
    made = show(FiguresTable("Figures", FIGURES))
    made.show_rows([TableRow("b", ("b", 2.12345)), TableRow("a", ("a", None)), TableRow("c", ("c", -10.0))])
    return made


def test_figures_are_sorted_as_numbers_none_last_and_copied_so(table):
    for column, order, keys in ((0, "Ascending", "abc"), (1, "Ascending", "cba"), (1, "Descending", "bca")):
        table.sortByColumn(column, getattr(Qt.SortOrder, f"{order}Order"))
        assert "".join(row.key for row in table.rows) == keys
    press_keys(table, Key.Key_C, held=CONTROL)
    assert QGuiApplication.clipboard().text() == "name\tlevel\nb\t2.12345\nc\t-10.0\na\t\n"


def test_rows_are_chosen_by_keys_and_clicks_and_stay_chosen(qtbot, table):
    asked = reported(table.row_entered, table.row_deleted, table.escaped, table.row_clicked, table.row_double_clicked)
    table.choose("a")
    press_keys(table, Key.Key_Down, Key.Key_Return, Key.Key_Delete, Key.Key_Escape)
    assert asked == ["b", "b", ()]
    place = table.visualRect(table.model().index(2, 0)).center()
    qtbot.mouseClick(table.viewport(), LEFT, pos=place)
    qtbot.mouseDClick(table.viewport(), LEFT, pos=place)
    assert asked[3:] == ["c", "c"]
    for rows, chosen in ((("c", "d"), "c"), (("d",), None)):
        table.show_rows([TableRow(key, (key, 3.0)) for key in rows])
        assert table.chosen_key == chosen


@pytest.mark.parametrize("rate_hz", [4_000, 16_000, 48_000])
@pytest.mark.parametrize("level_db", [0.0, -40.0])
def test_a_sine_shows_its_level_at_its_frequency(rate_hz, level_db):
    analyser = Analyser(rate_hz)
    time_s = np.arange(analyser.window_frames) / rate_hz
    signal = 10 ** (level_db / 20) * np.sin(2 * np.pi * 997 * time_s)
    shown_db = analyser.level_db(signal.astype(np.float32))
    assert shown_db.max() == pytest.approx(level_db, abs=0.2)
    assert analyser.column_hz[shown_db.argmax()] == pytest.approx(997, rel=0.02)
    assert (analyser.level_db(np.zeros(10, np.float32)) == -130).all()


def test_extremes_keep_every_peak_without_gaps_or_beats():
    signal = np.zeros(100_000, np.float32)
    signal[12_345], signal[67_890] = 1, -1
    values = extremes(signal, np.linspace(0, 100_000, 1001).astype(int))
    assert (len(values), values[247], values[1356], np.count_nonzero(values)) == (2000, 1, -1, 2)
    flank = extremes(np.linspace(0, 1, 10_000, dtype=np.float32), np.linspace(0, 10_000, 101).astype(int))
    lowest, highest = flank[0::2], flank[1::2]
    assert (highest[:-1] >= lowest[1:]).all() and (lowest[:-1] < highest[:-1]).all() and highest[-1] == 1
    sine = np.sin(2 * np.pi * np.arange(48_000) * 480 / 2.1 / 48_000).astype(np.float32)  # of 2.1 columns
    edges = np.linspace(0, 48_000, 481).astype(np.int64)
    values = extremes(sine, edges, around=3)
    assert values[2:-2:2] == pytest.approx(-1, abs=0.01) and values[3:-2:2] == pytest.approx(1, abs=0.01)
    assert np.ptp(extremes(sine, edges)[3:-2:2]) > 0.1, "or the test tests nothing"


@pytest.fixture
def waveform(show: Callable[..., WaveformPanel]) -> WaveformPanel:
    """A second of the model alone."""
    made = show(WaveformPanel(Session(), Library([])), 600, 240)
    made.plot.set_times(1.0, 0.25)
    made.set_sources(DEFAULT_SOURCES[:1])
    return made


def drawn(panel: WaveformPanel | SpectrumPanel) -> pg.PlotDataItem:
    return panel.plot.getPlotItem().listDataItems()[0]


def test_a_waveform_is_strokes_or_where_a_pixel_has_few_samples_a_smooth_line(waveform):
    signal, columns = np.sin(np.arange(48_000, dtype=np.float32)), waveform.plot.columns

    def shown(frames: int) -> tuple[NDArray[np.float64], object]:
        waveform.show_signal("model", signal[:frames], 48_000)
        time_s = drawn(waveform).getData()[0]
        return np.empty(0) if time_s is None else time_s, drawn(waveform).opts["connect"]

    time_s, connect = shown(48_000)
    assert (len(time_s), connect) == (2 * columns, "pairs")
    time_s, _ = shown(24_000)  # rendered half-way: half of the columns
    assert len(time_s) == pytest.approx(columns, abs=2)
    assert np.diff(time_s[0::2]) * columns == pytest.approx(1), "no stroke beside the next pixel"
    waveform.plot.getPlotItem().setXRange(0.1, 0.102, padding=0)
    time_s, connect = shown(48_000)
    assert (len(time_s), connect) == (pytest.approx(96, abs=3), "all")
    assert len(shown(10)[0]) == 0, "nothing of what is in view"


def test_a_legend_without_room_cuts_its_longest_title(qapp):
    metrics, sources = QFontMetrics(QFont()), (DEFAULT_SOURCES[1], ShownSource("b", "B", 9 * "wide ", heard=True))
    assert _texts(sources, metrics, 9_999)[1].endswith(" · heard")
    short, long = _texts(sources, metrics, 200)
    assert short == "B  truth" and "…" in long and sum(map(metrics.horizontalAdvance, (short, long))) < 200
