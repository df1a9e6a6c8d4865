"""A drum in the window: a click on its picture strikes it, the picture moves, and a mark moves the listener."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from pytestqt.qtbot import QtBot

from app.instrument.events import TimedEvent
from app.instrument.offline import render_events
from app.patches.library import SHIPPED as PATCHES
from app.patches.library import read_patch
from app.playing.key_note import KeyNote
from app.rendering import BlowTake, blow
from app.shared.vocabulary import Face
from app.window.controller import Controller
from app.window.panels.base import Panel
from app.window.panels.drum import DrumPanel
from engine.presets import SHIPPED, load_preset
from engine.values.effects import Room

LEFT = Qt.MouseButton.LeftButton


@pytest.fixture
def face() -> Face:
    return "lab"


@pytest.fixture
def drummed(
    qtbot: QtBot, preset_folder: Path, controller: Controller, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Controller]:
    """A window in which tuned toms are played, in mono."""
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(tmp_path / "own"))
    shutil.copy(SHIPPED / "studio_any_string.safetensors", preset_folder)
    controller.library.refresh()
    patch = read_patch(PATCHES / "tuned_toms.json")
    patch = patch.model_copy(update={"pickup": patch.pickup.model_copy(update={"points": (0.5,)})})
    controller.session.update(instrument=patch, a="model", b="truth", heard="a", speed=0.02)
    qtbot.waitUntil(lambda: controller.performance.notes.keys.player is not None)
    yield controller


def strike(drum: DrumPanel, x: float, y: float) -> None:
    at = drum.view.axes.at(0, (x, y))
    QTest.mouseClick(drum.view, LEFT, pos=QPoint(round(at.x()), round(at.y())))


def note(controller: Controller) -> KeyNote:
    latest = controller.instruments.latest
    assert isinstance(latest, KeyNote)
    return latest


def shown(controller: Controller) -> BlowTake | None:
    return controller.performance.moment(0.0).blow


def peak(qtbot: QtBot, controller: Controller) -> float:
    """Of what the mixer gives to the device in the next moments."""
    found = [0.0]

    def look() -> bool:
        found[0] = max(found[0], controller.sound.mixer.take_peak())
        return found[0] > 1e-3

    qtbot.waitUntil(look)
    return found[0]


def panel_of(controller: Controller, key: str) -> Panel:
    return next(panel for panel in controller.panels if panel.key == key)


def drawn(panel: Panel, curve: str) -> int:
    """The number of points of a curve."""
    times, _ = panel._curves[curve].getData()  # type: ignore[attr-defined]
    return 0 if times is None else len(times)


def test_a_click_on_the_drum_sounds_and_its_picture_moves(qtbot: QtBot, drummed: Controller) -> None:
    drum = drummed.drum
    assert drum.isVisible()
    assert not panel_of(drummed, "string").isVisible()
    drummed._timer.stop()  # which reads the meter
    drummed.sound.mixer.take_peak()
    strike(drum, 0.4, -0.3)
    assert note(drummed).event.place == pytest.approx((0.4, -0.3), abs=0.02)
    assert note(drummed).event.velocity == drummed.session.choices.velocity
    assert peak(qtbot, drummed) > 1e-3
    assert drummed.performance.notes.ringing == 1
    drummed._timer.start()
    qtbot.waitUntil(lambda: drum.view.frame is not None)
    first = drum.view.frame
    assert first is not None
    assert set(first.pictures_m) == {"model", "truth"}

    def moved() -> bool:
        frame = drum.view.frame
        return frame is not None and bool((frame.pictures_m["model"] != first.pictures_m["model"]).any())

    qtbot.waitUntil(moved)
    second = drum.view.frame
    assert second is not None
    model, truth = second.pictures_m["model"], second.pictures_m["truth"]
    assert np.abs(truth).max() > 0
    assert np.abs(model - truth).max() < 1e-4 * np.abs(truth).max()
    take = shown(drummed)
    assert take is not None
    assert take.request.strike.place == note(drummed).event.place
    qtbot.waitUntil(lambda: "Error of this blow" in drummed.window.error_label.text())


def test_the_picture_is_of_the_blow_that_sounds(qtbot: QtBot, drummed: Controller) -> None:
    """Its signal is what the compiled player makes of the same event, times the gain of the key."""
    strike(drummed.drum, 0.2, 0.5)
    qtbot.waitUntil(lambda: (take := shown(drummed)) is not None and take.complete)
    take, struck, patch = shown(drummed), note(drummed), drummed.session.choices.patch
    assert take is not None
    assert patch is not None
    dry = patch.model_copy(update={"room": Room(mix=0.0)})
    preset = load_preset(SHIPPED / "studio_any_string.safetensors")
    played = render_events(dry, preset, [TimedEvent(0.0, struck.event)], blow.RATE_HZ, "truth", seconds=0.3)
    heard = np.concatenate(list(played))[:, 0]
    signal = take.listened.signals["truth"].read()[: len(heard), 0]
    lags = [np.corrcoef(heard[lag:12_000], signal[: 12_000 - lag])[0, 1] for lag in range(3)]
    assert max(lags) > 0.999


def test_a_dragged_mark_changes_the_sound(qtbot: QtBot, drummed: Controller) -> None:
    drum = drummed.drum
    strike(drum, 0.5, 0.0)
    qtbot.waitUntil(lambda: (take := shown(drummed)) is not None and take.complete)
    take = shown(drummed)
    assert take is not None
    above, motion = take.listened.signals["model"].read().copy(), take.motions["model"].size_m.copy()
    axes = drum.view.axes
    foot = QPoint(round(axes.x(0, 0.5)), round(axes.bottom) + 8)
    QTest.mousePress(drum.view, LEFT, pos=foot)
    QTest.mouseMove(drum.view, QPoint(round(axes.x(0, 0.97)), foot.y()))
    QTest.mouseRelease(drum.view, LEFT, pos=foot)
    assert drummed.session.choices.listen == pytest.approx(0.97, abs=0.02)
    assert drummed.session.choices.patch is not None
    assert drummed.session.choices.patch.pickup.points[0] == drummed.session.choices.listen
    ear = drummed.session.choices.ear
    qtbot.waitUntil(lambda: take.listened.ear == ear and take.listened.complete)
    aside = take.listened.signals["model"].read()
    assert np.abs(aside - above).max() > 0.1 * np.abs(above).max()
    assert (take.motions["model"].size_m == motion).all()
    player = drummed.performance.notes.keys.player
    assert player is not None
    qtbot.waitUntil(lambda: player.ear.points == ear.points)


def test_enter_strikes_where_the_keyboard_points(qtbot: QtBot, drummed: Controller) -> None:
    drummed.drum.view.setFocus()
    QTest.keyClick(drummed.drum.view, Qt.Key.Key_Right)
    QTest.keyClick(drummed.drum.view, Qt.Key.Key_Up)
    place = drummed.drum.place
    QTest.keyClick(drummed.drum.view, Qt.Key.Key_Return)
    assert note(drummed).event.place == pytest.approx(place)
    x, y = read_patch(PATCHES / "tuned_toms.json").strings.drums[0].place  # type: ignore[union-attr]
    assert place == pytest.approx((x + 0.05, y + 0.05))


def test_another_instrument_is_struck_at_its_own_place(drummed: Controller) -> None:
    strike(drummed.drum, 0.4, -0.3)
    timpani = read_patch(PATCHES / "timpani.json")
    drummed.session.update(instrument=timpani)
    assert drummed.drum.place == timpani.strings.drums[0].place  # type: ignore[union-attr]


def test_views_of_a_line_say_so_and_those_of_sound_and_error_go_on(qtbot: QtBot, drummed: Controller) -> None:
    window, session = drummed.window, drummed.session
    session.update(face="lab", left_view="partials", right_view="space_time")
    for key in ("partials", "space_time", "eigenvalues", "error_plane", "compare"):
        panel = panel_of(drummed, key)
        assert panel.covered
    cover = panel_of(drummed, "space_time").grab().toImage()
    left = {cover.pixelColor(3, y).name() for y in range(3, cover.height() - 3)}
    assert len(left) == 1, "nothing shines through"
    for key in ("waveform", "spectrum", "spectrogram", "error_time", "drum"):
        assert panel_of(drummed, key).covered == ""
    session.update(left_view="spectrum", right_view="error_time")
    strike(drummed.drum, 0.3, 0.3)
    errors = panel_of(drummed, "error_time")
    qtbot.waitUntil(lambda: drawn(errors, "rmse") > 3)
    _, decades = errors._curves["rmse"].getData()  # type: ignore[attr-defined]
    assert (np.asarray(decades) < -4).all(), "the model agrees with the truth"
    spectrum = panel_of(drummed, "spectrum")
    qtbot.waitUntil(lambda: bool(spectrum.levels_db(200.0)))  # type: ignore[attr-defined]
    session.update(left_view="spectrogram", right_view="waveform")
    wave = panel_of(drummed, "waveform")
    qtbot.waitUntil(lambda: drawn(wave, "model") > 10)
    gram = panel_of(drummed, "spectrogram")
    qtbot.waitUntil(lambda: gram._drawn > 0)  # type: ignore[attr-defined]
    session.update(preset="first")
    assert panel_of(drummed, "partials").covered == ""
    assert panel_of(drummed, "string").isVisible()
    assert not drummed.drum.isVisible()
    qtbot.waitUntil(lambda: "Error of this pluck" in window.error_label.text())


def test_controls_of_a_string_rest_while_drums_are_played(drummed: Controller) -> None:
    bar = drummed.window.transport
    of_string = [bar.knobs["position"], bar._pickup, bar._loop]
    assert not any(control.isEnabled() for control in of_string)
    assert bar.knobs["listen"].isEnabled()
    drummed.session.update(preset="first")
    assert all(control.isEnabled() for control in of_string)


def test_a_seek_and_stop_keep_the_picture(qtbot: QtBot, drummed: Controller) -> None:
    strike(drummed.drum, 0.3, 0.3)
    qtbot.waitUntil(lambda: (take := shown(drummed)) is not None and take.complete)
    drummed.performance.seek(0.2)
    assert drummed.performance.position_s == 0.2
    assert not drummed.performance.moving
    qtbot.waitUntil(lambda: drummed.drum.view.frame is not None and "0.200 s" in drummed.drum.view.frame.caption)
    drummed.performance.stop()
    assert drummed.performance.position_s == 0.2
    qtbot.waitUntil(lambda: drummed.performance.notes.ringing == 0)
    before = note(drummed)
    drummed.play_or_stop()
    assert note(drummed) is not before
    assert drummed.performance.notes.ringing == 1


def test_a_kit_shows_the_drum_that_is_struck(qtbot: QtBot, drummed: Controller) -> None:
    kit = read_patch(PATCHES / "concert_toms.json")
    drummed.session.update(instrument=kit)
    qtbot.waitUntil(lambda: (player := drummed.performance.notes.keys.player) is not None and player.patch == kit)
    for key in (47, 36):
        drummed.patches._press(key, 100, None)
        name = kit.strings.of_key(key).name  # type: ignore[union-attr]
        qtbot.waitUntil(lambda name=name: name in drummed.drum.view.accessibleDescription())  # type: ignore[misc]
    drummed.drum.view.setFocus()
    QTest.keyClick(drummed.drum.view, Qt.Key.Key_Return)
    assert note(drummed).event.key == 36
    qtbot.waitUntil(lambda: shown(drummed) is not None)
    drummed.session.update(instrument=read_patch(PATCHES / "tuned_toms.json"))
    assert shown(drummed) is None
    qtbot.waitUntil(lambda: drummed.drum.view.frame is None)
