"""The views over time and frequency show a take of known motion in its units, and gestures ask for what they name."""

from __future__ import annotations

import gc
import math
import weakref
from collections.abc import Callable
from typing import Any

import numpy as np
import pyqtgraph as pg
import pytest
from PySide6.QtCore import QPoint
from pytestqt.qtbot import QtBot

from app.analysis import heard as heard_module
from app.rendering import Take
from app.rendering.take import Pictures
from app.views.plots.axis_label import frequency_ticks
from app.views.string.view import StringView
from app.window.panels import Moment, Panel, StringPanel
from app.window.panels.error_time import ErrorTimePanel
from app.window.panels.space_time import SpaceTimePanel
from app.window.panels.spectrogram import SpectrogramPanel
from app.window.panels.spectrum import SpectrumPanel, analyser_at
from app.window.panels.waveform import WaveformPanel
from engine.resonators.string import undamped_frequencies
from engine.values.ear import Ear
from tests.app.gestures import drag, turn_wheel
from tests.app.takes import append_to
from tests.app.window.driver import KEY, LEFT, SHIFT, press
from tests.app.window.driver import choose as choose_in
from tests.app.window.panels.conftest import Hear, Make, at, bar_of, choose, curves, items, label_of

Watch = Callable[..., None]
MOMENTS = 12  # enough that every panel has looked at one


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


def test_the_map_shows_motion_and_error_in_mm_and_bar_and_readout_agree(make: Make, watch: Watch) -> None:
    panel = make(SpaceTimePanel)
    watch(panel, lambda: "without sign" in panel.readout.text() and image_of(panel).max() > 3)
    assert bar_of(panel.plot).levels() == (0, pytest.approx(panel.scale_mm)) and image_of(panel).min() >= 0
    panel.plot.hovered.emit(0.3, 0.5)
    assert panel.readout.text().endswith(" mm") and " peak " in panel.readout.text()
    panel.plot.hovered.emit(math.nan, 0.5)
    panel.plot.show_range(0.0, 0.02)
    watch(panel, lambda: panel.readout.text() == "every frame")
    assert image_of(panel).shape[0] == 101
    assert image_of(panel).max() == pytest.approx(1.01 * 4, rel=1e-3)
    assert bar_of(panel.plot).levels() == (-4, 4)
    assert panel.plot.line_at == 0.5
    press(panel, "Error")
    watch(panel, lambda: image_of(panel).max() < 0.05)
    assert image_of(panel).max() == pytest.approx(0.04, rel=1e-3)
    assert panel.scale_mm == pytest.approx(4 / 30)  # a gain of 30, of its own accord
    assert bar_of(panel.plot).levels() == pytest.approx((-4 / 30, 4 / 30))
    assert panel.gains.currentText() == "auto gain × 30"
    choose_in(panel.gains, 10_000)
    assert (bar_of(panel.plot).axis.labelText, bar_of(panel.plot).axis.scale) == ("µm", pytest.approx(1000))
    panel.plot.hovered.emit(0.0, 0.5)
    assert panel.readout.text() == "0.0000 s   position 0.50   +40 µm"


def test_a_click_on_the_map_seeks_and_with_shift_listens_there(qtbot: QtBot, make: Make) -> None:
    panel = make(SpaceTimePanel)
    plot, before = panel.plot, panel.session.choices.listen
    with qtbot.waitSignal(panel.seek_asked) as asked:
        qtbot.mouseClick(plot.viewport(), LEFT, pos=at(plot, 0.25, 0.8))
    assert asked.args[0] == pytest.approx(0.25, abs=0.01)
    assert panel.session.choices.listen == before
    qtbot.mouseClick(plot.viewport(), LEFT, SHIFT, pos=at(plot, 0.25, 0.8))
    assert panel.session.choices.listen == pytest.approx(0.8, abs=0.02)
    choose(panel, listen=0.1)
    assert [line.value() for line in items(plot, pg.InfiniteLine) if line.angle == 0] == [0.1]


def test_the_spectrogram_follows_the_listening_point_on_one_scale_for_all_sources(
    make: Make, take: Take, hear: Hear, watch: Watch
) -> None:
    panel = make(SpectrogramPanel)

    def peak_db() -> float:
        watch(panel, lambda: len(image_of(panel)) > 10 and not panel.background.busy)
        return (float(image_of(panel)[10].max()) / 255 - 1) * panel.range_db

    hear(take, Ear((0.5,)))
    loud_db = peak_db()
    assert loud_db == pytest.approx(20 * np.log10(1.01 * 4 / 10), abs=2)
    hear(take, Ear((1 / 6,)))
    watch(panel, lambda: len(image_of(panel)) > 10 and peak_db() < loud_db - 3)
    assert peak_db() - loud_db == pytest.approx(20 * np.log10(0.5), abs=0.5)
    press(panel, "Truth")
    truth_db = peak_db()
    press(panel, "Error")
    watch(panel, lambda: len(image_of(panel)) > 10 and peak_db() < truth_db - 20)
    assert truth_db - peak_db() == pytest.approx(40, abs=1)
    choose_in(panel.ranges, 60)
    assert bar_of(panel.plot).levels() == (-60, 0)
    assert bar_of(panel.plot).getAxis("left").labelText == "dB re 10 mm"
    choose(panel, pickup="velocity")
    assert bar_of(panel.plot).getAxis("left").labelText == "dB re 30 m/s"


def test_rows_of_the_spectrogram_are_linear_or_logarithmic_and_silence_is_named(
    make: Make, take: Take, watch: Watch
) -> None:
    panel = make(SpectrogramPanel)
    watch(panel, lambda: len(image_of(panel)) > 10)
    rows = image_of(panel).shape[1]
    assert 50 * 40 ** (int(image_of(panel)[10].argmax()) / rows) == pytest.approx(take.fundamental_hz, abs=30)
    logarithmic = image_of(panel)[10].argmax()
    press(panel, "Linear")
    watch(panel, lambda: len(image_of(panel)) > 10 and image_of(panel)[10].argmax() != logarithmic)
    assert int(image_of(panel)[10].argmax()) / rows * 2000 == pytest.approx(take.fundamental_hz, abs=30)
    assert panel.plot.getPlotItem().vb.viewRange()[1][1] == pytest.approx(2000)
    panel.begin_picture(2, 3, 0.1)
    panel.show_columns(np.full((2, 3), -95.0, np.float32))
    assert panel.readout.text() == "all levels are below −90 dB"
    choose_in(panel.ranges, 130)
    assert panel.readout.text() == ""


def test_the_error_over_time_is_one_per_cent_and_its_level_a_tenth_of_a_db(make: Make, watch: Watch) -> None:
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
    press(panel, "Render 10 s")
    assert panel.session.choices.seconds == 10
    panel.choices_changed(frozenset({"seconds"}))
    assert not panel.longer.isEnabled()


@pytest.mark.parametrize("error", [3e-8, 2e-4, 0.5, 40.0])
def test_an_error_of_any_size_is_in_view(make: Make, error: float) -> None:
    panel, time_s = make(ErrorTimePanel), np.linspace(0.0, 2.0, 9)
    panel.show_curves(time_s, {name: np.full(9, error) for name in ("rmse", "mae")} | {"level_db": np.zeros(9)})
    low, high = panel.plot.getPlotItem().vb.viewRange()[1]
    assert low < np.log10(error) < high


def test_the_spectrum_reports_level_and_nearest_partial_and_stays_at_the_end(
    make: Make, take: Take, watch: Watch
) -> None:
    panel = make(SpectrumPanel)
    watch(panel, lambda: len(drawn(panel, "truth")) > 0)
    second_hz = float(undamped_frequencies(take.info.string, 2)[1]) / (2 * np.pi)
    panel.point_at(second_hz * 2 ** (10 / 1200))
    assert f"partial 2: {second_hz:.1f} Hz (+10 cents)" in panel.readout.text()
    assert "A −" in panel.readout.text().replace("-", "−")
    (partial,) = items(panel.plot, pg.InfiniteLine)
    assert 10 ** partial.value() == pytest.approx(second_hz)
    panel.point_at(math.nan)
    assert panel.readout.text() == "" and not partial.isVisible()
    for position_s in (1.0, 0.9):  # both within the last window
        for _ in range(MOMENTS):
            panel.show_moment(Moment(take, position_s, False, 0.016))
        assert drawn(panel, "truth").max() > -60
    for source in ("model", "truth"):
        choose(panel, a=source, b=source)
        choose_in(panel.ranges, 60)
        assert panel.plot.getPlotItem().vb.viewRange()[1] == pytest.approx([-60, 0])


def test_the_spectrum_zooms_and_pans_and_its_cursor_reads_by_pointer_and_keys(
    qtbot: QtBot, make: Make, take: Take, watch: Watch
) -> None:
    panel = make(SpectrumPanel)
    plot, first_hz = panel.plot, take.fundamental_hz
    watch(panel, lambda: len(drawn(panel, "truth")) > 0)
    whole_hz, loudest_db = plot.view_hz, drawn(panel, "truth").max()
    turn_wheel(plot.viewport(), at(plot, math.log10(first_hz), -50), QPoint(0, 120 * 12))
    low_hz, high_hz = plot.view_hz
    assert low_hz < first_hz < high_hz < whole_hz[1] / 4
    watch(panel, lambda: curves(plot)["truth"][0].max() < math.log10(high_hz))
    assert len(drawn(panel, "truth")) == 480, "as many points in view as before"
    assert drawn(panel, "truth").max() == pytest.approx(loudest_db, abs=0.3)
    numbers = [float(text) for _, text in frequency_ticks(low_hz, high_hz)]
    assert 3 <= len(numbers) <= 7 and low_hz <= numbers[0] and numbers[-1] <= high_hz
    drag(plot.viewport(), QPoint(300, 100), QPoint(200, 100))
    assert plot.view_hz[0] > low_hz and plot.view_hz[1] / plot.view_hz[0] == pytest.approx(high_hz / low_hz)
    qtbot.mouseDClick(plot.viewport(), LEFT, pos=QPoint(300, 100))
    assert plot.view_hz == pytest.approx(whole_hz)
    watch(panel, lambda: curves(plot)["truth"][0].max() > math.log10(whole_hz[1]) - 0.01)
    second_hz = float(take.partials_hz[1])
    panel.point_at(second_hz)
    assert f"partial 2: {second_hz:.1f} Hz (+0 cents)" in plot.accessibleDescription()
    for key, side in ((KEY.Key_Right, 1), (KEY.Key_Left, -1)):
        before = plot.line_at
        qtbot.keyClick(plot, key)
        assert plot.line_at - before == pytest.approx(side * math.log10(whole_hz[1] / whole_hz[0]) / 20)
        assert f"{10**plot.line_at:.1f} Hz" in plot.accessibleDescription()
    plot.zoom(0.05)
    low_hz, high_hz = plot.view_hz
    for _ in range(40):
        qtbot.keyClick(plot, KEY.Key_Right)
    assert high_hz < plot.view_hz[1] == pytest.approx(10**plot.line_at), "the view goes with it"
    plot.show_all()
    watch(panel, lambda: curves(plot)["truth"][0].max() > math.log10(whole_hz[1]) - 0.01)
    for hz, words in ((440 * 2 ** (30 / 1200), "A4 +30 cents"), (261.6256 * 2 ** (-0.1 / 12), "C4 -10 cents")):
        plot.hovered.emit(math.log10(hz), -50.0)
        assert words in panel.readout.text() and "A " in panel.readout.text() and "B " in panel.readout.text()


def test_views_of_a_growing_take_show_what_is_there(make: Make, take: Take) -> None:
    """A waveform as far as it is ready, though nothing moves; a spectrum of a whole window, not past the end."""
    waveform, spectrum = make(WaveformPanel), make(SpectrumPanel)
    growing = Take("small", take.info, take.pluck, 1.0, take.listened.ear)
    for panel in (waveform, spectrum):
        panel.take_started(growing)
    for start in range(0, 2000, 1000):
        for name in ("model", "truth"):
            growing.listened.signals[name].append(take.listened.signals[name].read(start, start + 1000))
        for _ in range(MOMENTS):
            waveform.show_moment(Moment(growing, 0.0, False, 0.016))
        assert curves(waveform.plot)["truth"][0].max() == pytest.approx((start + 1000) / 4000, abs=0.01)
    for _ in range(MOMENTS):
        spectrum.show_moment(Moment(growing, 0.499, True, 0.016))
    edge_db = drawn(spectrum, "truth")
    for _ in range(MOMENTS):
        spectrum.show_moment(Moment(take, 0.5 - analyser_at(4000).window_frames / 4000, True, 0.016))
    assert edge_db == pytest.approx(drawn(spectrum, "truth"), abs=1e-6)


def test_waveform_and_spectrum_are_of_the_listening_point_in_the_pick_ups_unit(
    make: Make, take: Take, hear: Hear, watch: Watch
) -> None:
    waveform, spectrum = make(WaveformPanel), make(SpectrumPanel)
    for listen in (0.37, 0.8):
        hear(take, Ear((listen,)))
        signal_mm = 1000 * take.motion_m("model")[:, round(100 * listen)]
        peak = pytest.approx(signal_mm.max(), rel=1e-5)
        watch(waveform, lambda peak=peak: whole(waveform, "model") and drawn(waveform, "model").max() == peak)
        assert drawn(waveform, "model").min() == pytest.approx(signal_mm.min(), rel=1e-5)
    omega = 2 * np.pi * take.fundamental_hz
    for pickup, full, factor, unit, level in (
        ("velocity", "30 m/s", omega, "velocity (m/s)", omega / 30),
        ("displacement", "10 mm", 1000, "displacement (mm)", 1 / 0.01),
    ):
        for panel in (waveform, spectrum):
            choose(panel, pickup=pickup, listen=0.5)
        hear(take, waveform.session.choices.ear)
        loudest_db = pytest.approx(20 * np.log10(0.004 * np.exp(-1.5) * level), abs=2.5)  # at 0.5 s
        watch(spectrum, lambda db=loudest_db: len(drawn(spectrum, "truth")) and drawn(spectrum, "truth").max() == db)
        watch(waveform, lambda unit=unit: whole(waveform, "truth") and label_of(waveform.plot) == unit)
        assert drawn(waveform, "truth").max() == pytest.approx(0.004 * factor, rel=0.02)
        assert full in label_of(spectrum.plot)
    choose(waveform, pickup="velocity", listen=0.999)
    hear(take, waveform.session.choices.ear)
    watch(waveform, lambda: "mm/s" in label_of(waveform.plot))
    assert drawn(waveform, "truth").max() == pytest.approx(4 * omega * np.sin(0.001 * np.pi), rel=0.05)


def test_a_slot_with_the_difference_is_drawn_with_its_gain(make: Make, take: Take, hear: Hear, watch: Watch) -> None:
    waveform, spectrum = make(WaveformPanel), make(SpectrumPanel)
    for panel in (waveform, spectrum):
        choose(panel, b="difference", difference_gain_db=20.0, listen=0.5)
        assert curves(panel.plot).keys() == {"model", "difference"}
        assert panel.legend.text == "A  model · heard   B  difference +20 dB"
    hear(take, waveform.session.choices.ear)
    ten_times = pytest.approx(0.4, rel=1e-2)  # 1 % of 4 mm
    watch(waveform, lambda: whole(waveform, "difference") and drawn(waveform, "difference").max() == ten_times)
    watch(spectrum, lambda: len(drawn(spectrum, "difference")) > 0)
    gap_db = drawn(spectrum, "model").max() - drawn(spectrum, "difference").max()
    assert gap_db == pytest.approx(20.1, abs=0.1)
    choose(waveform, difference_gain_db=40.0)
    watch(waveform, lambda: drawn(waveform, "difference").max() > 3.9)
    for heard, kind in (("b", "difference"), ("a", "model")):
        choose(waveform, heard=heard)
        top = max(items(waveform.plot, pg.PlotDataItem), key=lambda item: item.zValue())
        assert (top.getData()[1] == drawn(waveform, kind)).all(), "the heard curve is on top"
    choose(waveform, a="truth", b="truth", solo=2, stereo=True)
    assert curves(waveform.plot).keys() == {"truth"}
    hear(take, waveform.session.choices.ear)
    watch(waveform, lambda: whole(waveform, "truth") and "(µm)" in label_of(waveform.plot))
    assert np.abs(drawn(waveform, "truth")).max() < 1e-3, "the take has the first mode alone"
    assert waveform.legend.text.startswith("mode 2, left   ")


def test_another_preset_is_drawn_at_its_rate_when_it_is_there(
    make: Make, take: Take, hear: Hear, watch: Watch
) -> None:
    waveform, spectrum, source = make(WaveformPanel), make(SpectrumPanel), "preset:other"
    for panel in (waveform, spectrum):
        choose(panel, b=source, heard="b", listen=0.5)
    hear(take, waveform.session.choices.ear)
    watch(waveform, lambda: whole(waveform, "model"))
    watch(spectrum, lambda: len(drawn(spectrum, "model")) > 0)
    (other,) = curves(waveform.plot).keys() - {"model"}
    assert len(drawn(waveform, other)) == 0
    time_s = np.arange(16_001)[:, None] / 16_000
    motion = 1e-3 * np.cos(2 * np.pi * 3_000 * time_s) * np.sin(np.pi * np.linspace(0, 1, 51))
    take.motions[source] = Pictures(16_000, 51, 1.0)
    take.motions[source].append(motion.astype(np.float32))
    hear(take, waveform.session.choices.ear)
    watch(waveform, lambda: whole(waveform, other))
    watch(spectrum, lambda: len(drawn(spectrum, other)) > 0)
    assert drawn(waveform, other).max() == pytest.approx(1.0, rel=1e-3)
    logarithms, levels_db = curves(spectrum.plot)[other]
    assert 10 ** logarithms[levels_db.argmax()] == pytest.approx(3_000, rel=0.02)
    assert set(spectrum.levels_db(3_000)) == {source}, "the model's rate ends before"


@pytest.mark.parametrize("kind", [StringPanel, SpectrumPanel, WaveformPanel])
def test_while_all_stands_still_nothing_is_looked_at(
    kind: type[Panel], make: Make, take: Take, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The window waits for its user most of the time, and should take no power for it."""
    panel, looks, held = make(kind), [], Moment(take, 0.5, False, 0.016)
    name = "HeardMotion" if kind is StringPanel else "HeardSignal"
    original = getattr(heard_module, name)
    monkeypatch.setattr(f"{kind.__module__}.{name}", lambda *which: looks.append(which) or original(*which))

    def looked() -> bool:
        looks.clear()
        for _ in range(MOMENTS):
            panel.show_moment(held)
        return bool(looks)

    assert looked() and not looked()
    panel.session.update(listen=0.2)
    assert looked() and not looked()
    panel.take_started(take)
    assert looked()


@pytest.mark.parametrize("kind", [SpaceTimePanel, SpectrogramPanel, ErrorTimePanel, SpectrumPanel, WaveformPanel])
def test_a_view_that_is_not_looked_at_lets_the_last_take_go(
    kind: type[Panel], make: Make, take: Take, qtbot: QtBot, hear: Hear
) -> None:
    """Takes have tens of megabytes."""
    panel = make(kind)
    last = Take("last", take.info, take.pluck, 1.0, Ear((0.5,)))
    append_to(last, take.motion_m("model"), take.motion_m("truth"))
    hear(last, Ear((0.5,)))
    panel.take_started(last)
    for _ in range(MOMENTS):
        panel.show_moment(Moment(last, 0.1, False, 0.016))
    gone = weakref.ref(last)
    del last
    panel.take_started(take)

    def collected() -> bool:
        gc.collect(1)
        return gone() is None

    qtbot.waitUntil(collected)


def test_the_string_shows_both_motions_at_one_moment_however_late_they_are(
    make: Make, take: Take, monkeypatch: pytest.MonkeyPatch
) -> None:
    frames: list[Any] = []
    monkeypatch.setattr(StringView, "show_frame", lambda view, frame: frames.append(frame))
    panel = make(StringPanel)
    for solo, words in ((0, ""), (2, "all modes, although mode 2 is soloed")):
        choose(panel, solo=solo)
        panel.show_moment(Moment(take, 0.5, False, 0.016))
        assert frames[-1].caption.startswith(words) and ("mode" in frames[-1].caption) == bool(solo)
    choose(panel, solo=0)
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
