"""What space–time map, spectrogram and error course show of a take, and what their gestures ask for."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import QPointF, Qt
from pytestqt.qtbot import QtBot

from app.analysis import heard as heard_module
from app.presets.library import Library
from app.rendering import Take
from app.rendering.take import Motion
from app.session.choices import Choices, Session
from app.session.shown import ShownSource
from app.window.controller import Controller
from app.window.panels import Moment, Panel, StringPanel
from app.window.panels.error_time import ErrorTimePanel
from app.window.panels.space_time import AUTO, SpaceTimePanel
from app.window.panels.spectrogram import SpectrogramPanel
from app.window.panels.spectrum import EVERY, SpectrumPanel
from app.window.panels.waveform import WaveformPanel
from engine.pluck import Pluck
from engine.presets import read_info
from engine.resonators.string import undamped_frequencies
from engine.values.ear import Ear
from tests.app.takes import append_to

LEFT = Qt.MouseButton.LeftButton
FRAMES = 4001  # a second
Make = Callable[[type[Panel]], Any]
Hear = Callable[[Take, Ear], None]
Choose = Callable[..., None]


@pytest.fixture
def take(small_preset: Path, hear: Hear) -> Take:
    """A decaying first mode of 4 mm; the model is 1 % too loud."""
    made = Take("small", read_info(small_preset), Pluck(0.5, 4.0, "gaussian", 0.06), 1.0, Choices().ear)
    time_s = np.arange(FRAMES)[:, None] / 4000
    shape = np.sin(np.pi * np.linspace(0, 1, 101))
    truth = (0.004 * np.exp(-3 * time_s) * np.cos(2 * np.pi * made.fundamental_hz * time_s) * shape).astype(
        np.float32
    )
    append_to(made, np.float32(1.01) * truth, truth)
    hear(made, Choices().ear)
    return made


@pytest.fixture
def make(qtbot: QtBot, take: Take, threads_begun: Callable[[], list[str]]) -> Iterator[Make]:
    """A panel that can be seen, with the take."""
    panels: list[Panel] = []

    def made(kind: type[Panel]) -> Panel:
        panel = kind(Session(Choices(face="lab")), Library([]))
        panels.append(panel)
        panel.choices_changed(frozenset(Choices.model_fields))
        qtbot.addWidget(panel)
        panel.resize(700, 300)
        with qtbot.waitExposed(panel):
            panel.show()
        panel.take_started(take)
        return panel

    yield made
    for panel in panels:
        panel.end()
    assert threads_begun() == []


def watch(qtbot: QtBot, panel: Panel, take: Take, until: Callable[[], bool]) -> None:
    """Moments until it is so."""

    def tick() -> bool:
        panel.show_moment(Moment(take, 0.5, False, 0.016))
        return until()

    qtbot.waitUntil(tick)


def test_the_map_shows_motion_and_error_in_mm(qtbot: QtBot, make: Make, take: Take) -> None:
    panel = make(SpaceTimePanel)
    view: Any = panel
    watch(qtbot, panel, take, lambda: panel._made is not None and panel._made.complete)
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
    assert view.gains.currentText() == "auto gain × 30"


def test_bar_colours_and_readout_agree_on_the_sign(qtbot: QtBot, make: Make, take: Take) -> None:
    panel = make(SpaceTimePanel)
    view: Any = panel
    watch(qtbot, panel, take, lambda: "without sign" in view.readout.text())
    assert view._bar.levels() == (0, pytest.approx(view.scale_mm))
    assert view._image.image.min() >= 0
    panel._hover(0.3, 0.5)
    assert view.readout.text().endswith(f"peak {panel._picture.at(0.3, 0.5) * 1000:.4g} mm")
    view.plot.show_times(0.0, 0.02)
    panel._hover(float("nan"), 0.5)
    watch(qtbot, panel, take, lambda: view.readout.text() == "every frame")
    assert view._bar.levels() == (-view.scale_mm, view.scale_mm)


def test_small_errors_have_a_scale_of_their_own(make: Make) -> None:
    view = make(SpaceTimePanel)
    view.gains.setCurrentIndex(view.gains.findData(10_000))
    view.gains.activated.emit(0)
    axis = view._bar.axis
    assert (axis.labelText, axis.scale) == ("µm", pytest.approx(1000))
    assert view._wordings(0.1, 0.5, 0.3e-6)[0] == "0.1000 s   position 0.50   +0.3 µm"


def test_levels_below_the_range_are_reported(make: Make) -> None:
    view = make(SpectrogramPanel)
    view.begin_picture(2, 3, 0.1)
    view.show_columns(np.full((2, 3), -95.0, np.float32))
    assert view.readout.text() == "all levels are below −90 dB"
    view.ranges.setCurrentIndex(view.ranges.findData(130))
    view.ranges.activated.emit(0)
    assert view.readout.text() == ""


def test_each_quantity_keeps_its_gain(make: Make) -> None:
    view = make(SpaceTimePanel)
    view.gains.setCurrentIndex(view.gains.findData(10))
    view.gains.activated.emit(0)
    assert view.scale_mm == 0.4
    for key, gain in (("error", AUTO), ("truth", 10)):
        view.quantities.show_key(key)
        view.quantities.chosen.emit(key)
        assert view.gains.currentData() == gain


def test_a_click_on_the_map_seeks_and_with_shift_listens_there(qtbot: QtBot, make: Make) -> None:
    panel = make(SpaceTimePanel)
    plot = panel.plot
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
    assert panel._listening.value() == 0.1


@pytest.mark.parametrize("kind", [StringPanel, SpectrumPanel, WaveformPanel])
def test_while_all_stands_still_nothing_is_looked_at(
    kind: type[Panel], make: Make, take: Take, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The window waits for its user most of the time, and should take no power for it."""
    panel, looks = make(kind), []
    held = Moment(take, 0.5, False, 0.016)
    for _ in range(8 * EVERY):
        panel.show_moment(held)

    name = "HeardMotion" if kind is StringPanel else "HeardSignal"
    original = getattr(heard_module, name)

    class Looked(original):  # type: ignore[misc, valid-type]
        def __init__(self, *which: Any) -> None:
            looks.append(which)
            super().__init__(*which)

    monkeypatch.setattr(f"{kind.__module__}.{name}", Looked)

    def looked(moment: Moment) -> bool:
        looks.clear()
        for _ in range(2 * EVERY):
            panel.show_moment(moment)
        return bool(looks)

    assert not looked(held)
    panel.session.update(listen=0.2)
    assert looked(held)
    assert not looked(held)
    panel.take_started(take)
    assert looked(held)


def test_a_take_at_rest_is_drawn_on_as_it_grows(make: Make, take: Take) -> None:
    panel = make(WaveformPanel)
    growing = Take("small", take.info, take.pluck, 1.0, take.listened.ear)
    panel.take_started(growing)
    for start in range(0, FRAMES, 1000):
        for name in ("model", "truth"):
            growing.listened.signals[name].append(take.listened.signals[name].read(start, start + 1000))
        for _ in range(2 * EVERY):
            panel.show_moment(Moment(growing, 0.0, False, 0.016))
        assert panel._drawn["truth"].ready == growing.listened.signals["truth"].ready_frames


def test_the_spectrogram_follows_the_listening_point(qtbot: QtBot, make: Make, take: Take, hear: Hear) -> None:
    panel = make(SpectrogramPanel)
    peaks_db = []
    for listen in (0.5, 1 / 6):
        hear(take, Ear((listen,)))

        def drawn(listen: float = listen) -> bool:
            made = panel._shown[0] if panel._shown else None
            return made is not None and made.listened.ear == Ear((listen,)) and panel._drawn == made.columns

        watch(qtbot, panel, take, drawn)
        peaks_db.append(panel._levels_db[10].max())
    assert peaks_db[0] == pytest.approx(20 * np.log10(1.01 * 4 / 10), abs=2)
    assert panel._bar.getAxis("left").labelText == "dB re 10 mm"
    choose(panel, pickup="velocity")
    assert panel._bar.getAxis("left").labelText == "dB re 30 m/s"
    assert peaks_db[1] - peaks_db[0] == pytest.approx(20 * np.log10(0.5), abs=0.1)


def test_the_spectrograms_scale_is_one_for_all_sources(qtbot: QtBot, make: Make, take: Take, hear: Hear) -> None:
    panel = make(SpectrogramPanel)
    hear(take, Ear((0.5,)))
    view: Any = panel
    seen = {}
    for key in ("truth", "error"):
        view.quantities.show_key(key)
        watch(qtbot, panel, take, lambda key=key: panel._shown[1:2] == (key,) and panel._drawn > 10)
        seen[key] = int(view._pixels[10].max())
    assert (seen["truth"] - seen["error"]) / 255 * 90 == pytest.approx(40, abs=1)  # dB
    view.ranges.setCurrentIndex(view.ranges.findData(60))
    view.ranges.activated.emit(0)
    assert view._bar.levels() == (-60, 0)
    assert int(view._pixels[10].max()) < seen["error"]


def test_linear_and_logarithmic_rows(qtbot: QtBot, make: Make, take: Take) -> None:
    panel = make(SpectrogramPanel)
    view: Any = panel
    watch(qtbot, panel, take, lambda: panel._drawn > 10)
    logarithmic = int(view._levels_db[10].argmax())
    qtbot.mouseClick(view.scales._group.button(1), LEFT)
    watch(qtbot, panel, take, lambda: panel._shown[2:] == (False,) and panel._drawn > 10)
    linear = int(view._levels_db[10].argmax())
    rows = view._levels_db.shape[1]
    assert linear / rows * 2000 == pytest.approx(take.fundamental_hz, abs=30)
    assert 50 * 40 ** (logarithmic / rows) == pytest.approx(take.fundamental_hz, abs=30)
    assert view.frequency_hz(view.plot.getPlotItem().vb.viewRange()[1][1]) == pytest.approx(2000)


def test_the_error_over_time(qtbot: QtBot, make: Make, take: Take) -> None:
    panel = make(ErrorTimePanel)
    view: Any = panel
    watch(qtbot, panel, take, lambda: panel._made is not None and panel._made.complete)
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
    assert "validation 70.7 %, 25.0 %" in view.readout.text()


def test_ten_seconds_are_asked_for_with_a_button(qtbot: QtBot, make: Make) -> None:
    panel = make(ErrorTimePanel)
    qtbot.mouseClick(panel.longer, LEFT)
    assert panel.session.choices.seconds == 10
    panel.choices_changed(frozenset({"seconds"}))
    assert not panel.longer.isEnabled()


def test_the_spectrum_reports_level_and_nearest_partial(qtbot: QtBot, make: Make, take: Take) -> None:
    panel = make(SpectrumPanel)
    watch(qtbot, panel, take, lambda: bool(panel._levels_db))
    second_hz = float(undamped_frequencies(take.info.string, 2)[1]) / (2 * np.pi)
    panel.hover(second_hz * 2 ** (10 / 1200))
    assert f"partial 2: {second_hz:.1f} Hz (+10 cents)" in panel.readout.text()
    assert "A −" in panel.readout.text().replace("-", "−")
    assert 10 ** panel._partial.value() == pytest.approx(second_hz)
    panel.hover(float("nan"))
    assert panel.readout.text() == ""
    assert not panel._partial.isVisible()


def test_at_the_end_the_spectrum_stays(qtbot: QtBot, make: Make, take: Take) -> None:
    panel = make(SpectrumPanel)
    for position_s in (1.0, 0.9):  # both within the last window
        panel.show_moment(Moment(take, position_s, False, 0.016))
        qtbot.waitUntil(
            lambda at=position_s: panel.show_moment(Moment(take, at, False, 0.016)) or panel._shown[2:3] == (at,)
        )
        assert panel._levels_db["truth"].max() > -60


def test_while_a_take_grows_the_spectrum_is_of_a_whole_window(make: Make, take: Take) -> None:
    panel = make(SpectrumPanel)
    growing = Take("small", take.info, take.pluck, 1.0, take.listened.ear)
    for name in ("model", "truth"):
        growing.listened.signals[name].append(take.listened.signals[name].read(0, 2000))
    panel.take_started(growing)
    for _ in range(EVERY):
        panel.show_moment(Moment(growing, 0.499, True, 0.016))
    edge_db = panel._levels_db["truth"]
    for _ in range(EVERY):
        panel.show_moment(Moment(take, 0.5 - panel._analysers["truth"].window_frames / 4000, True, 0.016))
    assert edge_db == pytest.approx(panel._levels_db["truth"], abs=1e-6)


def test_the_spectrums_range_is_one_for_both_sources(make: Make, take: Take) -> None:
    view = make(SpectrumPanel)
    view.ranges.setCurrentIndex(0)
    view.ranges.activated.emit(0)
    for source in ("model", "truth"):
        view.set_sources((ShownSource(source, "A B", source, heard=True),))
        view.set_rate(16_000)
        assert view.plot.getPlotItem().vb.viewRange()[1] == pytest.approx([-60, 0])


def test_the_waveform_is_that_of_the_listening_point(qtbot: QtBot, make: Make, take: Take, hear: Hear) -> None:
    panel = make(WaveformPanel)
    for listen in (0.37, 0.8):
        hear(take, Ear((listen,)))
        all_of_it = (take.listened, {"model": FRAMES, "truth": FRAMES})
        watch(qtbot, panel, take, lambda all_of_it=all_of_it: panel._shown[:2] == all_of_it)
        time_s, drawn_mm = panel._curves["model"].getData()
        signal_mm = 1000 * take.motion_m("model")[:, round(100 * listen)]
        assert drawn_mm.max() == pytest.approx(signal_mm.max(), rel=1e-5)
        assert drawn_mm.min() == pytest.approx(signal_mm.min(), rel=1e-5)
        assert time_s[-1] == pytest.approx(1.0, abs=1.5 / panel.plot.columns)


def drawn(view: Any, source: str) -> Any:
    """The values of a source's curve, or nothing."""
    values = view._curves[source].getData()[1]
    return np.zeros(0) if values is None else values


@pytest.fixture
def choose_and_hear(take: Take, hear: Hear) -> Choose:
    """As the worker, which listens to the take as it is chosen."""

    def chosen(panel: Panel, **choices: Any) -> None:
        choose(panel, **choices)
        hear(take, panel.session.choices.ear)

    return chosen


def choose(panel: Panel, **choices: Any) -> None:
    panel.session.update(**choices)
    panel.choices_changed(frozenset(choices))


def test_a_velocity_is_drawn_in_m_s(
    qtbot: QtBot, make: Make, take: Take, choose_and_hear: Callable[..., None]
) -> None:
    waveform, spectrum = make(WaveformPanel), make(SpectrumPanel)
    choose_and_hear(waveform, pickup="velocity", listen=0.5)
    choose_and_hear(spectrum, pickup="velocity", listen=0.5)
    watch(qtbot, waveform, take, lambda: waveform._shown[1:2] == ({"model": FRAMES, "truth": FRAMES},))
    watch(qtbot, spectrum, take, lambda: bool(spectrum._levels_db))
    omega = 2 * np.pi * take.fundamental_hz
    assert drawn(waveform, "truth").max() == pytest.approx(0.004 * omega, rel=0.02)
    assert waveform.plot.getPlotItem().getAxis("left").labelText == "velocity (m/s)"
    choose_and_hear(waveform, amplitude_mm=4.0, listen=0.999)
    watch(qtbot, waveform, take, lambda: "mm/s" in waveform.plot.getPlotItem().getAxis("left").labelText)
    assert drawn(waveform, "truth").max() == pytest.approx(4 * omega * np.sin(0.001 * np.pi), rel=0.05)
    # The spectrum at 0.5 s: a sine of 0.004·e^−1.5·ω, in units of 30 m/s
    expected_db = 20 * np.log10(0.004 * np.exp(-1.5) * omega / 30)
    assert spectrum._levels_db["truth"].max() == pytest.approx(expected_db, abs=2.5)
    assert "30 m/s" in spectrum.plot.getPlotItem().getAxis("left").labelText
    choose_and_hear(spectrum, pickup="displacement")
    watch(qtbot, spectrum, take, lambda: spectrum._shown[:1] == (take.listened,))
    assert spectrum._levels_db["truth"].max() == pytest.approx(20 * np.log10(0.004 * np.exp(-1.5) / 0.01), abs=2.5)
    assert "10 mm" in spectrum.plot.getPlotItem().getAxis("left").labelText


def test_a_slot_with_the_difference_is_drawn_with_its_gain(
    qtbot: QtBot, make: Make, take: Take, choose_and_hear: Callable[..., None]
) -> None:
    waveform, spectrum = make(WaveformPanel), make(SpectrumPanel)
    for panel in (waveform, spectrum):
        choose_and_hear(panel, b="difference", difference_gain_db=20.0, listen=0.5)
        assert set(panel._curves) == {"model", "difference"}
        assert panel.legend.text == "A  model · heard   B  difference +20 dB"
    watch(qtbot, waveform, take, lambda: waveform._shown[1:2] == ({"model": FRAMES, "difference": FRAMES},))
    watch(qtbot, spectrum, take, lambda: set(spectrum._levels_db) == {"model", "difference"})
    assert drawn(waveform, "difference").max() == pytest.approx(0.4, rel=1e-2)  # 1 % of 4 mm, ten times
    levels_db = spectrum._levels_db
    assert levels_db["model"].max() - levels_db["difference"].max() == pytest.approx(20.1, abs=0.1)
    choose(waveform, difference_gain_db=40.0)
    watch(qtbot, waveform, take, lambda: drawn(waveform, "difference").max() > 3.9)
    choose(waveform, heard="b")
    top = max(waveform._curves.items(), key=lambda pair: pair[1].zValue())
    assert top[0] == "difference"
    choose(waveform, a="truth", b="truth")
    assert set(waveform._curves) == {"truth"}
    watch(qtbot, waveform, take, lambda: len(drawn(waveform, "truth")) > 0)


def test_another_preset_is_drawn_at_its_rate_when_it_is_there(
    qtbot: QtBot, make: Make, take: Take, choose_and_hear: Callable[..., None]
) -> None:
    waveform, spectrum = make(WaveformPanel), make(SpectrumPanel)
    source = "preset:other"
    for panel in (waveform, spectrum):
        choose_and_hear(panel, b=source, heard="b", listen=0.5)
    watch(qtbot, waveform, take, lambda: waveform._shown[1:2] == ({"model": FRAMES},))
    watch(qtbot, spectrum, take, lambda: "model" in spectrum._levels_db)
    assert len(drawn(waveform, source)) == 0
    time_s = np.arange(16_001)[:, None] / 16_000
    motion = 1e-3 * np.cos(2 * np.pi * 3_000 * time_s) * np.sin(np.pi * np.linspace(0, 1, 51))
    take.motions[source] = Motion(16_000, 51, 1.0)
    take.motions[source].append(motion.astype(np.float32))
    choose_and_hear(waveform)
    watch(qtbot, waveform, take, lambda: len(drawn(waveform, source)) > 0)
    watch(qtbot, spectrum, take, lambda: source in spectrum._levels_db)
    assert drawn(waveform, source).max() == pytest.approx(1.0, rel=1e-3)
    assert waveform._curves[source].getData()[0][-1] == pytest.approx(1.0, abs=1.5 / waveform.plot.columns)
    loudest_hz = spectrum._curves[source].getData()[0][spectrum._levels_db[source].argmax()]
    assert loudest_hz == pytest.approx(np.log10(3_000), abs=0.01) or loudest_hz == pytest.approx(3_000, rel=0.02)
    assert set(spectrum.levels_db(3_000)) == {source}  # the model's rate ends before


def test_a_mode_alone_and_the_ear_are_reported(
    qtbot: QtBot, make: Make, take: Take, choose_and_hear: Callable[..., None]
) -> None:
    panel = make(WaveformPanel)
    choose_and_hear(panel, solo=2, stereo=True)
    watch(qtbot, panel, take, lambda: panel._shown[1:2] == ({"model": FRAMES, "truth": FRAMES},))
    assert "(µm)" in panel.plot.getPlotItem().getAxis("left").labelText
    assert np.abs(drawn(panel, "truth")).max() < 1e-3  # the take has the first mode alone
    assert panel.legend.text.startswith("mode 2, left   A  model")
    choose_and_hear(panel, solo=0, stereo=False)
    watch(qtbot, panel, take, lambda: drawn(panel, "truth").max() > 1)
    assert panel.legend.text.startswith("A  model")


def test_in_the_window_they_follow_one_playhead(qtbot: QtBot, controller: Controller) -> None:
    session = controller.session
    panels = {panel.key: panel for panel in controller.panels}
    for left, right in (("spectrogram", "space_time"), ("spectrogram", "error_time")):
        session.update(left_view=left, right_view=right)
        plots = [panels[key].plot for key in (left, right)]
        qtbot.waitUntil(lambda: controller.performance.take is not None)  # else there is nothing to seek in
        with qtbot.waitSignal(panels[right].seek_asked):
            plots[1].seek_asked.emit(0.3)
        qtbot.waitUntil(lambda plots=plots: all(plot.line_at == pytest.approx(0.3, abs=1e-3) for plot in plots))
        plots[1].seek_asked.emit(0.1)
        qtbot.waitUntil(lambda: controller.performance.position_s < 0.2)


@pytest.mark.parametrize(
    "kind", [SpaceTimePanel, SpectrogramPanel, ErrorTimePanel, SpectrumPanel, WaveformPanel], ids=lambda k: k.key
)
def test_a_view_that_is_not_looked_at_lets_the_last_take_go(
    kind: type[Panel], make: Make, take: Take, qtbot: QtBot, hear: Hear
) -> None:
    """Takes have tens of megabytes."""
    panel = make(kind)
    last = Take("last", take.info, take.pluck, 1.0, Ear((0.5,)))
    append_to(last, take.motion_m("model"), take.motion_m("truth"))
    hear(last, Ear((0.5,)))
    panel.take_started(last)
    for _ in range(20):
        panel.show_moment(Moment(last, 0.1, False, 0.016))
        qtbot.wait(5)
    gone = weakref.ref(last)
    del last
    panel.take_started(take)
    gc.collect()
    qtbot.waitUntil(lambda: gone() is None)


def test_the_string_says_that_it_shows_all_modes(make: Make, take: Take) -> None:
    panel = make(StringPanel)
    panel.show_moment(Moment(take, 0.5, False, 0.016))
    assert "mode" not in panel.view._frame.caption
    choose(panel, solo=2)
    panel.show_moment(Moment(take, 0.5, False, 0.016))
    assert panel.view._frame.caption.startswith("all modes, although mode 2 is soloed")


def test_the_string_shows_both_motions_at_one_moment_however_late_they_are(make: Make, take: Take) -> None:
    late = Take(take.preset_name, take.info, take.pluck, take.seconds, take.listened.ear)
    model, truth = take.motion_m("model"), take.motion_m("truth")
    append_to(late, model[:400], truth[:400])
    late.motions["model"].append(model[400:900])  # the truth's half of a block is on its way
    panel = make(StringPanel)
    panel.take_started(late)
    panel.show_moment(Moment(late, take.seconds, True, 0.016))
    assert panel.view._frame.caption.startswith(f"{399 / take.info.rate_hz:.3f} s")
    shapes = panel.view._frame.shapes
    assert np.abs(shapes["truth"]).max() > 0.1
    assert shapes["model"] == pytest.approx(1.01 * shapes["truth"], rel=1e-4, abs=1e-6)
