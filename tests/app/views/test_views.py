"""What the views compute, and that animated plots survive (a pair of Qt and pyqtgraph once did not)."""

from __future__ import annotations

import numpy as np
import pytest
from pytestqt.qtbot import QtBot

from app.analysis.moment import StringFrame
from app.presets.library import Library
from app.session.choices import Session
from app.shared.parameters import PARAMETERS
from app.views.string.ink import ShownPluck
from app.views.string.view import StringView
from app.window.panels.spectrum import COLUMNS, Analyser, SpectrumPanel
from app.window.panels.waveform import WaveformPanel, extremes


def nothing() -> tuple[Session, Library]:
    """What a panel is made of."""
    return Session(), Library([])


@pytest.mark.parametrize("rate_hz", [4_000, 16_000, 48_000])
@pytest.mark.parametrize("level_db", [0.0, -40.0])
def test_a_sine_shows_its_level_at_its_frequency(rate_hz: int, level_db: float) -> None:
    analyser = Analyser(rate_hz)
    time_s = np.arange(analyser.window_frames) / rate_hz
    signal = 10 ** (level_db / 20) * np.sin(2 * np.pi * 997 * time_s)
    found = analyser.level_db(signal.astype(np.float32))
    assert found.max() == pytest.approx(level_db, abs=0.2)
    assert analyser.column_hz[found.argmax()] == pytest.approx(997, rel=0.02)


def test_silence_lies_on_the_floor() -> None:
    assert (Analyser(16_000).level_db(np.zeros(10, np.float32)) == -130).all()


def test_extremes_keep_every_peak() -> None:
    signal = np.zeros(100_000, np.float32)
    signal[12_345], signal[67_890] = 1, -1
    values = extremes(signal, np.linspace(0, 100_000, 1001).astype(int))
    assert len(values) == 2000
    assert (values[2 * 123 + 1], values[2 * 678]) == (1, -1)
    assert np.count_nonzero(values) == 2


def test_strokes_of_a_steep_flank_have_no_gaps_between_them() -> None:
    values = extremes(np.linspace(0, 1, 10_000, dtype=np.float32), np.linspace(0, 10_000, 101).astype(int))
    lowest, highest = values[0::2], values[1::2]
    assert (highest[:-1] >= lowest[1:]).all()
    assert (lowest[:-1] < highest[:-1]).all()
    assert highest[-1] == 1


def test_a_period_of_a_few_pixels_does_not_beat_with_them(qtbot: QtBot) -> None:
    view = WaveformPanel(*nothing())
    qtbot.addWidget(view)
    view.resize(600, 240)
    view.show()
    period_s = 2.1 / view.plot.columns
    view.plot.set_times(1.0, 0.25)
    view._period_s = period_s
    view.show_signal("model", np.sin(np.arange(48_000) / (48_000 * period_s) * 2 * np.pi).astype(np.float32), 48_000)
    values = view._curves["model"].getData()[1]
    assert values[2:-2:2] == pytest.approx(-1, abs=0.01)
    assert values[3:-2:2] == pytest.approx(1, abs=0.01)


def test_a_waveform_is_strokes_where_a_pixel_has_many_samples_and_a_smooth_line_where_it_has_few(
    qtbot: QtBot,
) -> None:
    view = WaveformPanel(*nothing())
    qtbot.addWidget(view)
    view.resize(600, 240)
    view.show()
    view.plot.set_times(1.0, 0.25)
    signal = np.sin(np.arange(48_000, dtype=np.float32))
    view.show_signal("model", signal, 48_000)
    curve = view._curves["model"]
    assert len(curve.getData()[0]) == 2 * view.plot.columns
    assert (curve.opts["connect"], curve.opts["antialias"]) == ("pairs", False)
    view.show_signal("model", signal[:24_000], 48_000)  # rendered half-way: half of the columns
    time_s = curve.getData()[0]
    assert len(time_s) == pytest.approx(view.plot.columns, abs=2)
    pixels = np.diff(time_s[0::2]) * view.plot.columns
    assert pixels == pytest.approx(1), "no stroke beside the next pixel"
    view.plot.getPlotItem().setXRange(0.1, 0.102, padding=0)
    view.show_signal("model", signal, 48_000)
    assert (curve.opts["connect"], curve.opts["antialias"]) == ("all", True)
    assert len(curve.getData()[0]) == pytest.approx(96, abs=3)
    view.show_signal("model", signal[:10], 48_000)  # nothing of what is in view
    assert curve.getData()[0] is None or len(curve.getData()[0]) == 0


@pytest.mark.parametrize("id", PARAMETERS)
def test_a_parameter_goes_from_end_to_end(id: str) -> None:
    parameter = PARAMETERS[id]
    low, high = parameter.limits
    for share in (0, 0.3, 1):
        assert parameter.share(parameter.value(share)) == pytest.approx(share)
    assert parameter.value(-1) == pytest.approx(low)
    assert parameter.value(2) == pytest.approx(high)
    assert parameter.stepped(high, 5) == high
    step = parameter.stepped(parameter.default, -1)
    assert parameter.default == low or step < parameter.default
    assert parameter.default == low or parameter.stepped(step, 1) == pytest.approx(parameter.default)


def test_the_string_view_zooms_with_the_decay(qtbot: QtBot) -> None:
    view = StringView()
    qtbot.addWidget(view)
    view.resize(900, 300)
    view.set_pluck(ShownPluck(0.3, 4.0, np.zeros(101)))
    view.grab()
    spans = [view._span_mm]
    for peak_mm in (4.0, 1.5, 0.4, 0.05):
        shape = peak_mm * np.sin(np.pi * np.linspace(0, 1, 101)).astype(np.float32)
        both = {"model": shape, "truth": shape}
        view.show_frame(StringFrame(both, {k: -v for k, v in both.items()}, both, "0.1 s", True))
        view.grab()
        spans.append(view._span_mm)
        assert view._span_mm >= 1.15 * peak_mm
    assert spans == sorted(spans, reverse=True)
    assert spans[-1] < spans[0]


def test_the_axis_of_the_string_follows_the_pluck_at_rest(qtbot: QtBot) -> None:
    view = StringView()
    qtbot.addWidget(view)
    for amplitude_mm, span_mm in ((4.0, 5), (20.0, 20), (4.0, 5), (1.0, 2)):
        view.set_pluck(ShownPluck(0.3, amplitude_mm, np.zeros(101)))
        view.grab()
        assert view._span_mm == span_mm


def test_animated_plots_survive(qtbot: QtBot) -> None:
    """Some pairs of PySide6 and pyqtgraph abort within seconds of this ("deallocating None")."""
    spectrum, waveform, string = SpectrumPanel(*nothing()), WaveformPanel(*nothing()), StringView()
    for view in (spectrum, waveform, string):
        qtbot.addWidget(view)
        view.resize(600, 240)
        view.show()
    spectrum.set_rate(16_000)
    waveform.plot.set_times(1.0, 0.25)
    random = np.random.default_rng(0)
    for frame in range(300):
        noise = {name: random.standard_normal(16_000).astype(np.float32) for name in ("model", "truth")}
        if frame % 4 == 0:
            for name, signal in noise.items():
                spectrum.show_signal(name, signal, Analyser(16_000))
                waveform.show_signal(name, signal, 16_000)
        waveform.plot.show_playhead(frame / 300)
        shapes = {name: signal[:101] for name, signal in noise.items()}
        string.show_frame(StringFrame(shapes, shapes, shapes))
        qtbot.wait(1)
    assert spectrum._curves["model"].getData()[0].shape == (COLUMNS,)


def test_a_click_on_the_waveform_asks_to_seek(qtbot: QtBot) -> None:
    from PySide6.QtCore import Qt

    view = WaveformPanel(*nothing())
    qtbot.addWidget(view)
    view.resize(600, 240)
    view.plot.set_times(2.0, 0.25)
    with qtbot.waitExposed(view):
        view.show()
    with qtbot.waitSignal(view.seek_asked) as asked:
        viewport = view.plot.viewport()
        qtbot.mouseClick(viewport, Qt.MouseButton.LeftButton, pos=viewport.rect().center())
    assert 0.7 < asked.args[0] < 1.3
