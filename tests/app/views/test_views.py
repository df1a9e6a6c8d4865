"""What spectrum and waveform draw of a signal, and that animated plots survive."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pyqtgraph as pg
import pytest
from numpy.typing import NDArray
from pytestqt.qtbot import QtBot

from app.analysis.moment import StringFrame
from app.presets.library import Library
from app.session.shown import DEFAULT_SOURCES
from app.stage.session import Session
from app.views.string.view import StringView
from app.window.panels.spectrum import COLUMNS, Analyser, SpectrumPanel
from app.window.panels.waveform import WaveformPanel, extremes


@pytest.mark.parametrize("rate_hz", [4_000, 16_000, 48_000])
@pytest.mark.parametrize("level_db", [0.0, -40.0])
def test_a_sine_shows_its_level_at_its_frequency(rate_hz: int, level_db: float) -> None:
    analyser = Analyser(rate_hz)
    time_s = np.arange(analyser.window_frames) / rate_hz
    signal = 10 ** (level_db / 20) * np.sin(2 * np.pi * 997 * time_s)
    shown_db = analyser.level_db(signal.astype(np.float32))
    assert shown_db.max() == pytest.approx(level_db, abs=0.2)
    assert analyser.column_hz[shown_db.argmax()] == pytest.approx(997, rel=0.02)
    assert (analyser.level_db(np.zeros(10, np.float32)) == -130).all()


def test_extremes_keep_every_peak_without_gaps_or_beats() -> None:
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


def test_a_waveform_is_strokes_where_a_pixel_has_many_samples_and_a_smooth_line_where_it_has_few(
    waveform: WaveformPanel,
) -> None:
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


def test_animated_plots_survive(qtbot: QtBot, waveform: WaveformPanel, show: Callable[..., Any]) -> None:
    """Some pairs of PySide6 and pyqtgraph abort within seconds of this ("deallocating None")."""
    spectrum, string = (show(view, 600, 240) for view in (SpectrumPanel(Session(), Library([])), StringView()))
    spectrum.set_rate(16_000)
    random = np.random.default_rng(0)
    for frame in range(150):
        noise = random.standard_normal(16_000).astype(np.float32)
        if frame % 4 == 0:
            spectrum.show_signal("model", noise, Analyser(16_000))
            waveform.show_signal("model", noise, 16_000)
        waveform.plot.show_playhead(frame / 150)
        shapes = {"model": noise[:101], "truth": noise[101:202]}
        string.show_frame(StringFrame(shapes, {name: (shape, shape) for name, shape in shapes.items()}))
        qtbot.wait(1)
    assert drawn(waveform).getData()[1].max() > 2
    levels = [curve.getData()[0] for curve in spectrum.plot.getPlotItem().listDataItems()]
    assert COLUMNS in {len(level) for level in levels if level is not None}
