"""What space–time map, spectrogram and error course show of a take, and what their gestures ask for."""

from __future__ import annotations

import gc
import threading
import weakref
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import QPointF, Qt
from pytestqt.qtbot import QtBot

from app.controller import Controller
from app.library import Library
from app.panels import ErrorTimePanel, Moment, Panel, SpaceTimePanel, SpectrogramPanel, SpectrumPanel, WaveformPanel
from app.rendering import Take
from app.session import Choices, Session
from app.views.space_time_view import AUTO
from engine.pluck import Pluck
from engine.preset import read_info

LEFT = Qt.MouseButton.LeftButton
FRAMES = 4001  # a second
Make = Callable[[type[Panel]], Any]


@pytest.fixture
def take(small_preset: Path) -> Take:
    """A decaying first mode of 4 mm; the model is 1 % too loud."""
    made = Take("small", read_info(small_preset), Pluck(0.5, 4.0, "gaussian", 0.06), 1.0)
    time_s = np.arange(FRAMES)[:, None] / 4000
    shape = np.sin(np.pi * np.linspace(0, 1, 101))
    truth = (0.004 * np.exp(-3 * time_s) * np.cos(2 * np.pi * made.fundamental_hz * time_s) * shape).astype(
        np.float32
    )
    made.append(np.float32(1.01) * truth, truth)
    return made


@pytest.fixture
def make(qtbot: QtBot, take: Take) -> Iterator[Make]:
    """A panel that can be seen, with the take."""
    panels: list[Panel] = []

    def made(kind: type[Panel]) -> Panel:
        panel = kind(Session(), Library([]))
        panels.append(panel)
        panel.choices_changed(frozenset(Choices.model_fields))
        qtbot.addWidget(panel.view)
        panel.view.resize(700, 300)
        panel.view.show()
        qtbot.waitExposed(panel.view)
        panel.take_started(take)
        return panel

    yield made
    for panel in panels:
        panel.close()
    names = {"space-time", "spectrogram", "error-course"}
    assert not names & {thread.name for thread in threading.enumerate()}


def watch(qtbot: QtBot, panel: Panel, take: Take, until: Callable[[], bool]) -> None:
    """Moments until it is so."""

    def tick() -> bool:
        panel.show_moment(Moment(take, 0.5, False, 0.016))
        return until()

    qtbot.waitUntil(tick, timeout=10_000)


def test_the_map_shows_motion_and_error_in_mm(qtbot: QtBot, make: Make, take: Take) -> None:
    panel = make(SpaceTimePanel)
    view = panel.view
    watch(qtbot, panel, take, lambda: panel._envelopes is not None and panel._envelopes.complete)
    view.plot.show_times(0.0, 0.02)
    watch(qtbot, panel, take, lambda: view.readout.text() == "every frame")
    assert view._image.image.shape[0] == 101
    assert view._image.image.max() == pytest.approx(1.01 * 4, rel=1e-3)
    assert view._bar.levels() == (-4, 4)
    assert view.plot.line_at == 0.5
    qtbot.mouseClick(view.quantities._group.button(2), LEFT)
    watch(qtbot, panel, take, lambda: view._image.image.max() < 0.05)
    assert view._image.image.max() == pytest.approx(0.04, rel=1e-3)
    assert view.scale_mm == pytest.approx(4 / 30)  # a gain of 30, of its own accord
    assert view._bar.levels() == pytest.approx((-4 / 30, 4 / 30))
    assert view.gains.currentText() == "auto (× 30)"


def test_each_quantity_keeps_its_gain(make: Make) -> None:
    view = make(SpaceTimePanel).view
    view.gains.setCurrentIndex(view.gains.findData(10))
    view.gains.activated.emit(0)
    assert view.scale_mm == 0.4
    for key, gain in (("error", AUTO), ("truth", 10)):
        view.quantities.show_key(key)
        view.quantities.chosen.emit(key)
        assert view.gains.currentData() == gain


def test_a_click_on_the_map_seeks_and_with_shift_listens_there(qtbot: QtBot, make: Make) -> None:
    panel = make(SpaceTimePanel)
    plot = panel.view.plot
    place = plot.mapFromScene(plot.getPlotItem().vb.mapViewToScene(QPointF(0.25, 0.8)))
    before = panel.session.choices.listen
    with qtbot.waitSignal(panel.seek_asked) as asked:
        qtbot.mouseClick(plot.viewport(), LEFT, pos=place)
    assert asked.args[0] == pytest.approx(0.25, abs=0.01)
    assert panel.session.choices.listen == before
    qtbot.mouseClick(plot.viewport(), LEFT, Qt.KeyboardModifier.ShiftModifier, pos=place)
    assert panel.session.choices.listen == pytest.approx(0.8, abs=0.02)
    panel.session.update(listen=0.1)
    panel.choices_changed(frozenset({"listen"}))
    assert panel.view._listening.value() == 0.1


def test_the_spectrogram_follows_the_listening_point(qtbot: QtBot, make: Make, take: Take) -> None:
    panel = make(SpectrogramPanel)
    peaks_db = []
    for listen in (0.5, 1 / 6):
        panel.session.update(listen=listen)

        def drawn(listen: float = listen) -> bool:
            made = panel._drawn_of[0] if panel._drawn_of else None
            return made is not None and made.listen == listen and panel._drawn == made.columns

        watch(qtbot, panel, take, drawn)
        peaks_db.append(panel.view._levels_db[10].max())
    assert peaks_db[0] == pytest.approx(20 * np.log10(1.01 * 4 / 10), abs=2)
    assert peaks_db[1] - peaks_db[0] == pytest.approx(20 * np.log10(0.5), abs=0.1)


def test_the_spectrograms_scale_is_one_for_all_sources(qtbot: QtBot, make: Make, take: Take) -> None:
    panel = make(SpectrogramPanel)
    panel.session.update(listen=0.5)
    view = panel.view
    seen = {}
    for key in ("truth", "error"):
        view.quantities.show_key(key)
        watch(qtbot, panel, take, lambda key=key: panel._drawn_of[1:2] == (key,) and panel._drawn > 10)
        seen[key] = int(view._pixels[10].max())
    assert (seen["truth"] - seen["error"]) / 255 * 90 == pytest.approx(40, abs=1)  # dB
    view.ranges.setCurrentIndex(view.ranges.findData(60))
    view.ranges.activated.emit(0)
    assert view._bar.levels() == (-60, 0)
    assert int(view._pixels[10].max()) < seen["error"]


def test_linear_and_logarithmic_rows(qtbot: QtBot, make: Make, take: Take) -> None:
    panel = make(SpectrogramPanel)
    view = panel.view
    watch(qtbot, panel, take, lambda: panel._drawn > 10)
    logarithmic = int(view._levels_db[10].argmax())
    qtbot.mouseClick(view.scales._group.button(1), LEFT)
    watch(qtbot, panel, take, lambda: panel._drawn_of[2:] == (False,) and panel._drawn > 10)
    linear = int(view._levels_db[10].argmax())
    rows = view._levels_db.shape[1]
    assert linear / rows * 2000 == pytest.approx(take.fundamental_hz, abs=30)
    assert 50 * 40 ** (logarithmic / rows) == pytest.approx(take.fundamental_hz, abs=30)
    assert view.frequency_hz(view.plot.getPlotItem().vb.viewRange()[1][1]) == pytest.approx(2000)


def test_the_error_over_time(qtbot: QtBot, make: Make, take: Take) -> None:
    panel = make(ErrorTimePanel)
    view = panel.view
    watch(qtbot, panel, take, lambda: panel._course is not None and panel._course.complete)
    watch(qtbot, panel, take, lambda: view._curves["mae"].getData()[0] is not None)
    for name in ("mae", "rmse"):
        assert view._curves[name].getData()[1] == pytest.approx(-2, abs=1e-3)  # 1 %
    assert view._stored["mae"].getData()[1][0] == pytest.approx(np.log10(0.25))
    assert view._stored["mae"].getData()[0][-1] == 0.1  # the validation reaches as far as training
    view.plot.hovered.emit(0.5, -1.0)
    assert "MAE 1 %" in view.readout.text()
    qtbot.mouseClick(view.quantities._group.button(1), LEFT)
    watch(qtbot, panel, take, lambda: view._curves["level_db"].getData()[0] is not None)
    assert view._curves["level_db"].getData()[1] == pytest.approx(20 * np.log10(1.01), abs=1e-3)
    view.plot.hovered.emit(0.5, 0.0)
    assert "+0.09 dB" in view.readout.text()
    view.plot.hovered.emit(float("nan"), 0.0)
    assert view.readout.text() == ""
    view.quantities.show_key("relative")
    view.quantities.chosen.emit("relative")
    assert "validation 70.7 %, 25 %" in view.readout.text()


def test_ten_seconds_are_asked_for_with_a_button(qtbot: QtBot, make: Make) -> None:
    panel = make(ErrorTimePanel)
    qtbot.mouseClick(panel.view.longer, LEFT)
    assert panel.session.choices.seconds == 10
    panel.choices_changed(frozenset({"seconds"}))
    assert not panel.view.longer.isEnabled()


def test_the_spectrum_tells_level_and_nearest_partial(qtbot: QtBot, make: Make, take: Take) -> None:
    panel = make(SpectrumPanel)
    watch(qtbot, panel, take, lambda: bool(panel.view._levels_db))
    second_hz = float(take.info.string.undamped_frequencies(2)[1]) / (2 * np.pi)
    panel.view.hovered.emit(second_hz * 2 ** (10 / 1200))
    assert f"partial 2: {second_hz:.1f} Hz (+10 cents)" in panel.view.readout.text()
    assert "model" in panel.view.readout.text()
    assert 10 ** panel.view._partial.value() == pytest.approx(second_hz)
    panel.view.hovered.emit(float("nan"))
    assert panel.view.readout.text() == ""
    assert not panel.view._partial.isVisible()


def test_the_spectrums_range_is_one_for_both_sources(make: Make, take: Take) -> None:
    view = make(SpectrumPanel).view
    view.ranges.setCurrentIndex(0)
    view.ranges.activated.emit(0)
    for source in ("model", "truth"):
        view.set_heard(source)
        view.set_rate(16_000)
        assert view.plot.getPlotItem().vb.viewRange()[1] == pytest.approx([-60, 0])


def test_the_waveform_is_that_of_the_listening_point(qtbot: QtBot, make: Make, take: Take) -> None:
    panel = make(WaveformPanel)
    for listen in (0.37, 0.8):
        panel.session.update(listen=listen)
        watch(qtbot, panel, take, lambda listen=listen: panel._shown[1:3] == (FRAMES, listen))
        time_s, drawn_mm = panel.view._curves["model"].getData()
        signal_mm = 1000 * take.signal_m("model", listen)
        assert drawn_mm.max() == pytest.approx(signal_mm.max(), rel=1e-5)
        assert drawn_mm.min() == pytest.approx(signal_mm.min(), rel=1e-5)
        assert time_s[-1] == pytest.approx(1.0, abs=0.001)


def test_in_the_window_they_follow_one_playhead(qtbot: QtBot, controller: Controller) -> None:
    session = controller.session
    panels = {panel.key: panel for panel in controller.panels}
    for left, right in (("spectrogram", "space_time"), ("spectrogram", "error_time")):
        session.update(left_view=left, right_view=right)
        plots = [panels[key].view.plot for key in (left, right)]
        qtbot.waitUntil(
            lambda: controller.performance.take is not None, timeout=20_000
        )  # else there is nothing to seek in
        with qtbot.waitSignal(panels[right].seek_asked):
            plots[1].seek_asked.emit(0.3)
        qtbot.waitUntil(
            lambda plots=plots: all(plot.line_at == pytest.approx(0.3, abs=1e-3) for plot in plots),
            timeout=20_000,
        )
        plots[1].seek_asked.emit(0.1)
        qtbot.waitUntil(lambda: controller.player.status().position_s < 0.2, timeout=5_000)


@pytest.mark.parametrize(
    "kind", [SpaceTimePanel, SpectrogramPanel, ErrorTimePanel, SpectrumPanel, WaveformPanel], ids=lambda k: k.key
)
def test_a_view_that_is_not_looked_at_lets_the_last_take_go(
    kind: type[Panel], make: Make, take: Take, qtbot: QtBot
) -> None:
    """Takes have tens of megabytes."""
    panel = make(kind)
    last = Take("last", take.info, take.pluck, 1.0)
    last.append(take.motion_m("model"), take.motion_m("truth"))
    panel.take_started(last)
    for _ in range(20):
        panel.show_moment(Moment(last, 0.1, False, 0.016))
        qtbot.wait(5)
    gone = weakref.ref(last)
    del last
    panel.take_started(take)
    gc.collect()
    qtbot.waitUntil(lambda: gone() is None, timeout=10_000)
