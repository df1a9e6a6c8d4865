"""The views over time and frequency show a take of known motion in its units, and gestures ask for what they name."""

import gc
import math
import weakref
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pyqtgraph as pg
import pytest
from PySide6.QtCore import QPoint

from app.analysis import heard as heard_module
from app.rendering import Take
from app.session.choices import Choices
from app.views.string.view import StringView
from app.window.panels import Moment, Panel, StringPanel
from app.window.panels.error_time import ErrorTimePanel
from app.window.panels.space_time import SpaceTimePanel
from app.window.panels.spectrogram import SpectrogramPanel
from app.window.panels.spectrum import SpectrumPanel
from app.window.panels.waveform import WaveformPanel
from engine.pluck import SHAPES
from engine.values.ear import Ear
from tests.app.gestures import drag, reported, turn_wheel
from tests.app.takes import append_to
from tests.app.window.driver import KEY, LEFT, SHIFT, press
from tests.app.window.driver import choose as choose_in
from tests.app.window.panels.conftest import at, bar_of, choose, curves, items, label_of

Watch = Callable[..., None]
MOMENTS = 12  # enough that every panel has looked at one
PLOTTED = (SpectrumPanel, WaveformPanel)


def drawn(panel: Any, kind: str) -> np.ndarray:
    """The values of a source's curve."""
    return curves(panel.plot).get(kind, np.zeros((2, 0)))[1]


def image_of(panel: Any) -> np.ndarray:
    """The drawn values; none is there yet: nothing."""
    (item,) = items(panel.plot, pg.ImageItem)
    return np.zeros((0, 0)) if item.image is None else item.image


def whole(panel: Any, kind: str) -> bool:
    """Return True if a waveform reaches the end of the take."""
    times = curves(panel.plot)[kind][0]
    return len(times) > 0 and times[-1] > 1 - 1.5 / panel.plot.columns


def look(panel: Panel, take: Take, position_s: float, moving: bool = False) -> None:
    for _ in range(MOMENTS):
        panel.show_moment(Moment(take, position_s, moving, 0.016))


def test_the_map_shows_motion_and_error_in_mm(qtbot, make, watch):
    panel = make(SpaceTimePanel)
    plot, bar = panel.plot, bar_of(panel.plot)
    watch(panel, lambda: "without sign" in panel.readout.text() and image_of(panel).max() > 3)
    assert bar.levels() == (0, pytest.approx(panel.scale_mm)) and image_of(panel).min() >= 0
    before = panel.session.choices.listen
    with qtbot.waitSignal(panel.seek_asked) as asked:
        qtbot.mouseClick(plot.viewport(), LEFT, pos=at(plot, 0.25, 0.8))
    assert asked.args[0] == pytest.approx(0.25, abs=0.01) and panel.session.choices.listen == before
    qtbot.mouseClick(plot.viewport(), LEFT, SHIFT, pos=at(plot, 0.25, 0.8))
    assert panel.session.choices.listen == pytest.approx(0.8, abs=0.02)
    choose(panel, listen=0.1)
    assert [line.value() for line in items(plot, pg.InfiniteLine) if line.angle == 0] == [0.1]
    plot.hovered.emit(math.nan, 0.5)
    plot.show_range(0.0, 0.02)
    watch(panel, lambda: panel.readout.text() == "every frame")
    assert image_of(panel).shape[0] == 101 and plot.line_at == 0.5
    assert image_of(panel).max() == pytest.approx(1.01 * 4, rel=1e-3) and bar.levels() == (-4, 4)
    press(panel, "Error")
    watch(panel, lambda: image_of(panel).max() < 0.05)
    assert image_of(panel).max() == pytest.approx(0.04, rel=1e-3)
    assert panel.gains.currentText() == "auto gain × 30"
    assert bar.levels() == pytest.approx((-4 / 30, 4 / 30)) and panel.scale_mm == pytest.approx(4 / 30)
    choose_in(panel.gains, 10_000)
    assert (bar.axis.labelText, bar.axis.scale) == ("µm", pytest.approx(1000))
    plot.hovered.emit(0.0, 0.5)
    assert panel.readout.text() == "0.0000 s   position 0.50   +40 µm"


def test_the_spectrogram_has_one_scale(make, take, hear, watch):
    panel = make(SpectrogramPanel)

    def column() -> np.ndarray:
        watch(panel, lambda: len(image_of(panel)) > 10 and not panel.background.busy)
        return image_of(panel)[10]

    def peak_db() -> float:
        return (float(column().max()) / 255 - 1) * panel.range_db

    hear(take, Ear((0.5,)))
    loud_db, highest, rows = peak_db(), int(column().argmax()), len(column())
    assert loud_db == pytest.approx(20 * np.log10(1.01 * 4 / 10), abs=2)
    assert 50 * 40 ** (highest / rows) == pytest.approx(take.fundamental_hz, abs=30)
    hear(take, Ear((1 / 6,)))
    watch(panel, lambda: peak_db() < loud_db - 3)
    assert peak_db() - loud_db == pytest.approx(20 * np.log10(0.5), abs=0.5)
    press(panel, "Truth")
    truth_db = peak_db()
    press(panel, "Error")
    watch(panel, lambda: peak_db() < truth_db - 20)
    assert truth_db - peak_db() == pytest.approx(40, abs=1)
    press(panel, "Linear")
    watch(panel, lambda: column().argmax() != highest)
    assert int(column().argmax()) / rows * 2000 == pytest.approx(take.fundamental_hz, abs=30)
    assert panel.plot.getPlotItem().vb.viewRange()[1][1] == pytest.approx(2000)
    for time_s, words in ((0.5, "0.500 s   300 Hz   -"), (99.0, "")):
        panel.plot.hovered.emit(time_s, 300.0)
        assert panel.readout.text().startswith(words) and bool(panel.readout.text()) == bool(words)
    for pickup, label in (("displacement", "dB re 10 mm"), ("velocity", "dB re 30 m/s")):
        choose(panel, pickup_kind=pickup)
        assert bar_of(panel.plot).getAxis("left").labelText == label


def test_the_error_over_time_is_one_per_cent_and_its_level_a_tenth_of_a_db(make, watch):
    panel = make(ErrorTimePanel)
    watch(panel, lambda: len(drawn(panel, "model")) > 0 and not panel.background.busy)
    for kind in ("model", "difference"):  # the colours of RMSE and MAE
        assert drawn(panel, kind) == pytest.approx(-2, abs=1e-3)
    stored = curves(panel.plot, dotted=True)["difference"]
    assert (stored[0][-1], stored[1][0]) == (0.1, pytest.approx(np.log10(0.25))), "as far as training reached"
    panel.plot.hovered.emit(0.5, -1.0)
    assert "MAE 1 %" in panel.readout.text()
    press(panel, "Level")
    watch(panel, lambda: len(drawn(panel, "model")) > 0)
    assert drawn(panel, "model") == pytest.approx(20 * np.log10(1.01), abs=1e-3)
    panel.plot.hovered.emit(0.5, 0.0)
    assert "+0.09 dB" in panel.readout.text()
    panel.plot.hovered.emit(math.nan, 0.0)
    assert panel.readout.text() == ""
    press(panel, "MAE and RMSE")
    assert "validation 70.7 %, 25.0 %" in panel.readout.text()


def test_the_spectrum_is_read_by_pointer_and_keys(qtbot, make, take, watch):
    panel = make(SpectrumPanel)
    plot, first_hz, second_hz = panel.plot, take.fundamental_hz, float(take.partials_hz[1])
    watch(panel, lambda: len(drawn(panel, "truth")) > 0)
    whole_hz, loudest_db = plot.view_hz, drawn(panel, "truth").max()
    turn_wheel(plot.viewport(), at(plot, math.log10(first_hz), -50), QPoint(0, 120 * 12))
    low_hz, high_hz = plot.view_hz
    assert low_hz < first_hz < high_hz < whole_hz[1] / 4
    watch(panel, lambda: curves(plot)["truth"][0].max() < math.log10(high_hz))
    assert len(drawn(panel, "truth")) == 480, "as many points in view as before"
    assert drawn(panel, "truth").max() == pytest.approx(loudest_db, abs=0.3)
    drag(plot.viewport(), QPoint(300, 100), QPoint(200, 100))
    assert plot.view_hz[0] > low_hz and plot.view_hz[1] / plot.view_hz[0] == pytest.approx(high_hz / low_hz)
    qtbot.mouseDClick(plot.viewport(), LEFT, pos=QPoint(300, 100))
    assert plot.view_hz == pytest.approx(whole_hz)
    watch(panel, lambda: curves(plot)["truth"][0].max() > math.log10(whole_hz[1]) - 0.01)
    (partial,) = items(plot, pg.InfiniteLine)
    panel.point_at(second_hz * 2 ** (10 / 1200))
    assert f"partial 2: {second_hz:.1f} Hz (+10 cents)" in plot.accessibleDescription()
    assert 10 ** partial.value() == pytest.approx(second_hz)
    for key, side in ((KEY.Key_Right, 1), (KEY.Key_Left, -1)):
        before = plot.line_at
        qtbot.keyClick(plot, key)
        assert plot.line_at - before == pytest.approx(side * math.log10(whole_hz[1] / whole_hz[0]) / 20)
        assert f"{10**plot.line_at:.1f} Hz" in plot.accessibleDescription()
    panel.point_at(math.nan)
    assert panel.readout.text() == "" and not partial.isVisible()
    look(panel, take, 1.0)  # the end of the last window
    assert drawn(panel, "truth").max() > -60
    choose(panel, a="truth", b="truth")
    choose_in(panel.ranges, 60)
    assert plot.getPlotItem().vb.viewRange()[1] == pytest.approx([-60, 0])


def test_waveform_and_spectrum_have_the_unit(make, take, hear, watch):
    spectrum, waveform = (make(kind) for kind in PLOTTED)
    hear(take, Ear((0.37,)))
    signal_mm = 1000 * take.motion_m("model")[:, 37]
    watch(waveform, lambda: whole(waveform, "model"))
    for extreme in (np.max, np.min):
        assert extreme(drawn(waveform, "model")) == pytest.approx(extreme(signal_mm), rel=1e-5)
    omega = 2 * np.pi * take.fundamental_hz
    for pickup, full, factor, unit, level in (
        ("velocity", "30 m/s", omega, "velocity (m/s)", omega / 30),
        ("displacement", "10 mm", 1000, "displacement (mm)", 1 / 0.01),
    ):
        for panel in (waveform, spectrum):
            choose(panel, pickup_kind=pickup, listen=0.5)
        hear(take, waveform.session.choices.ear)
        loudest_db = pytest.approx(20 * np.log10(0.004 * np.exp(-1.5) * level), abs=2.5)  # at 0.5 s
        watch(spectrum, lambda db=loudest_db: len(drawn(spectrum, "truth")) and drawn(spectrum, "truth").max() == db)
        watch(waveform, lambda unit=unit: whole(waveform, "truth") and label_of(waveform.plot) == unit)
        assert drawn(waveform, "truth").max() == pytest.approx(0.004 * factor, rel=0.02)
        assert full in label_of(spectrum.plot)
    for panel in (waveform, spectrum):
        choose(panel, pickup_kind="displacement", b="difference", heard="b", difference_gain_db=20.0, listen=0.5)
    hear(take, waveform.session.choices.ear)
    ten_times = pytest.approx(0.4, rel=1e-2)  # 1 % of 4 mm
    watch(waveform, lambda: whole(waveform, "difference") and drawn(waveform, "difference").max() == ten_times)
    watch(spectrum, lambda: len(drawn(spectrum, "difference")) > 0)
    gap_db = drawn(spectrum, "model").max() - drawn(spectrum, "difference").max()
    assert gap_db == pytest.approx(20.1, abs=0.1)
    choose(waveform, a="truth", b="truth", solo=2, stereo=True)
    assert curves(waveform.plot).keys() == {"truth"} and waveform.legend.text.startswith("mode 2, left   ")


@pytest.mark.parametrize("kind", [StringPanel, *PLOTTED])
def test_a_still_take_is_not_looked_at(kind, make, take, monkeypatch):
    """The window waits for its user most of the time, and should take no power for it."""
    panel, looks = make(kind), list[object]()
    name = "HeardMotion" if kind is StringPanel else "HeardSignal"
    original = getattr(heard_module, name)
    monkeypatch.setattr(f"{kind.__module__}.{name}", lambda *which: looks.append(which) or original(*which))

    def looked() -> bool:
        looks.clear()
        look(panel, take, 0.5)
        return bool(looks)

    assert looked() and not looked()
    panel.session.update(listen=0.2)
    assert looked() and not looked()
    panel.take_started(take)
    assert looked()


@pytest.mark.parametrize("kind", [SpaceTimePanel, SpectrogramPanel, ErrorTimePanel, *PLOTTED])
def test_a_view_lets_the_last_take_go(kind, make, take, qtbot, hear):
    """Takes have tens of megabytes."""
    panel = make(kind)
    last = Take("last", take.info, take.pluck, 1.0, Ear((0.5,)))
    append_to(last, take.motion_m("model"), take.motion_m("truth"))
    hear(last, Ear((0.5,)))
    panel.take_started(last)
    look(panel, last, 0.1)
    gone = weakref.ref(last)
    del last
    panel.take_started(take)
    qtbot.waitUntil(lambda: gc.collect(1) < 0 or gone() is None)


def test_gestures_on_the_string_choose_its_pluck_and_where_it_is_heard(make):
    panel, usual = make(StringPanel), Choices()
    plucked = reported(panel.pluck_asked)
    panel.session.update(position=0.2, amplitude_mm=9.0, shape="gaussian", width=0.1)
    panel.view.width_stepped.emit(1.0)
    panel.view.shape_stepped.emit(-1)
    chosen = panel.session.choices.pluck
    assert chosen.width == pytest.approx(0.105) and chosen.shape == SHAPES[SHAPES.index("gaussian") - 1]
    panel.view.pluck_reset.emit()
    assert panel.session.choices.pluck == replace(usual.pluck, shape=chosen.shape)
    panel.view.listening_point_moved.emit("right", 0.9)
    panel.view.listening_point_reset.emit("left")
    assert (panel.session.choices.listen, panel.session.choices.listen_right) == (usual.listen, 0.9)
    assert len(plucked) == 1


def test_the_string_shows_one_moment(make, take, monkeypatch):
    frames: list[Any] = []
    monkeypatch.setattr(StringView, "show_frame", lambda view, frame: frames.append(frame))
    panel = make(StringPanel)
    for solo, words in ((2, "all modes, although mode 2 is soloed"), (0, "")):
        choose(panel, solo=solo)
        panel.show_moment(Moment(take, 0.5, False, 0.016))
        assert frames[-1].caption.startswith(words) and ("mode" in frames[-1].caption) == bool(solo)
    assert frames[-1].envelopes
    press(panel, "Envelope")
    panel.show_moment(Moment(take, 0.5, False, 0.016))
    assert not frames[-1].envelopes
    late = Take(take.preset_name, take.info, take.pluck, take.seconds, take.listened.ear)
    model, truth = take.motion_m("model"), take.motion_m("truth")
    append_to(late, model[:400], truth[:400])
    late.motions["model"].append(model[400:900])  # the truth's half of a block is on its way
    panel.take_started(late)
    panel.show_moment(Moment(late, take.seconds, True, 0.016))
    assert frames[-1].caption.startswith(f"{399 / take.info.rate_hz:.3f} s")
    shapes = frames[-1].shapes
    assert np.abs(shapes["truth"]).max() > 0.1
    assert shapes["model"] == pytest.approx(1.01 * shapes["truth"], rel=1e-4, abs=1e-6)
