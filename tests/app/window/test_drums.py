"""Drums in the window: chosen, struck by keys, pads and at places, seen moving, heard, recorded and exported."""

from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import QPoint
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QComboBox, QPushButton, QToolButton

from app.instruments.library import SHIPPED as INSTRUMENTS
from app.instruments.library import read_instrument
from app.player.events import NoteOn, TimedEvent
from app.player.offline import render_events
from app.playing.key_note import KeyNote
from app.rendering import blow
from app.window.controller import DRUMS_PLAYED
from engine.presets import SHIPPED, load_preset
from engine.values.effects import Room
from tests.app.window.driver import LEFT, Window
from tests.app.window.panels.conftest import curves

PADS = range(36, 52)
DRUMS = sorted(path.stem for path in INSTRUMENTS.glob("*.json") if read_instrument(path).strings.kind == "drums")
KIT, TOMS = read_instrument(INSTRUMENTS / "concert_toms.json"), read_instrument(INSTRUMENTS / "tuned_toms.json")


@pytest.fixture
def kit(opened) -> Window:
    made = opened("studio_any_string", instrument=KIT)
    made.wait_for_keys()
    return made


@pytest.fixture
def toms(opened) -> Window:
    """The Lab with tuned toms, in mono and in slow motion."""
    mono = TOMS.model_copy(update={"pickup": TOMS.pickup.model_copy(update={"points": (0.5,)})})
    made = opened("studio_any_string", face="lab", instrument=mono, a="model", b="truth", heard="a", speed=0.02)
    made.wait_for_keys()
    return made


def strike(w: Window, x: float, y: float) -> Any:
    """Click on the picture of the drum; the note."""
    view = w.controller.drum.view
    place = view.axes.at(0, (x, y))
    QTest.mouseClick(view, LEFT, pos=QPoint(round(place.x()), round(place.y())))
    return w.struck[-1]


def test_pads_keys_and_channel_ten_strike(backend, kit, monkeypatch):
    assert len(DRUMS) == 7 and set(DRUMS) <= set(kit.controller.instruments.browser.listed)
    for key in (38, 45, 60):  # the last is no pad
        kit.play(key, 110)
    kit.wait(lambda: {38, 45} <= kit.keys.sounding().keys())
    kit.wait(lambda: kit.window.instrument.keys.level(45) > 0.1)
    assert kit.session.stage.drum_key == 45 and kit.notes.ringing == 2
    kit.controller.inputs.strike(0.1, -0.2, 100.0)
    event = kit.struck[-1].event
    assert (event.key, event.velocity, event.place) == (45, 100, (0.1, -0.2))
    count = len(kit.struck)
    backend.play(kit, "pitch", *(NoteOn(key, 90, 9) for key in PADS))
    struck = kit.struck[count:]
    assert [isinstance(note, KeyNote) and note.event.key for note in struck] == list(PADS)
    kit.wait(lambda: all(note.known and not note.cut for note in struck))  # they may have rung out by then
    assert struck[-1].of_drum and struck[-1].request is None
    player: Any = kit.keys.player
    kit.change(a="model", b="truth", heard="b")
    assert [player.compiled.source_gain(source) for source in (0, 1)] == [0.0, 1.0]
    kit.change(b="difference")
    assert player.compiled.source_gain(0) == -player.compiled.source_gain(1) > 0
    assert kit.said == []


def test_strings_and_drums_follow_one_another_without_a_leftover(kit):
    """Each has a player and controls of its own; views of a string say that drums are played."""
    window, panel = kit.window, kit.window.instrument
    kit.change(face="lab")
    assert {each.covered for each in kit.panels if each.of_strings} == {DRUMS_PLAYED}
    assert not kit.performance.ready, "no string is plucked"
    of_string = [window.transport.knobs["position"], kit.find(QComboBox, "Pick-up"), kit.find(QToolButton, "Loop")]
    assert not any(each.isEnabled() for each in of_string) and window.transport.knobs["listen"].isEnabled()
    kit.change(face="play", loop=True, solo=3, pickup_kind="bridge", listen=0.7)
    play, fold = kit.find(QPushButton, "Strike or stop"), kit.find(QToolButton, "Drum knobs")
    assert play.text() == "▶  Strike"
    panel.show_surface("neck")
    assert panel.keys.isVisible() and not panel.neck.isVisible(), "drums have no strings"
    kit.play(36, 127, hold=True)
    kit.sounds(36)
    for _ in range(3):
        kit.controller.instruments.choose("steel_string_acoustic")
        kit.controller.instruments.choose("concert_toms")
    kit.choose("steel_string_acoustic")
    assert (play.accessibleName(), fold.text(), panel.neck.isVisible()) == ("Pluck or stop", "String knobs", True)
    assert all(each.isEnabled() for each in of_string[:2]) and not any(each.covered for each in kit.panels)
    kit.wait(lambda: kit.performance.ready and kit.performance.settled)
    kit.change(loop=False)
    kit.play(52, hold=True)
    kit.wait(lambda: 52 in kit.keys.sounding())
    kit.performance.stop()
    kit.wait(lambda: kit.controller.sound.mixer.active == 0)
    kit.choose("thin_bars")
    assert kit.performance.take is None
    kit.pluck()
    kit.wait(lambda: kit.session.stage.drum_key in kit.keys.sounding())
    assert kit.said == []


def test_a_click_on_the_drum_sounds_and_its_picture_is_of_the_blow_that_sounds(toms):
    """Its signal is what the compiled player makes of the same event, times the gain of the key; views show it."""
    view: Any = toms.controller.drum.view
    assert view.isVisible() and not toms.controller.string.isVisible()
    note = strike(toms, 0.4, -0.3)
    assert note.event.place == pytest.approx((0.4, -0.3), abs=0.02)
    assert note.event.velocity == toms.choices.velocity and toms.notes.ringing == 1
    toms.wait(lambda: view.frame is not None)
    first = view.frame.pictures_m["model"]
    toms.wait(lambda: view.frame is not None and (view.frame.pictures_m["model"] != first).any())
    model, truth = (view.frame.pictures_m[name] for name in ("model", "truth"))
    assert np.abs(truth).max() > 0 and np.abs(model - truth).max() < 1e-4 * np.abs(truth).max()
    toms.wait(lambda: "Error of this blow" in toms.window.error_label.text())
    toms.wait(lambda: (blow := toms.performance.moment(0.0).blow) is not None and blow.complete)
    take: Any = toms.performance.moment(0.0).blow
    assert take.request.struck.event.place == note.event.place
    dry = toms.instrument.model_copy(update={"room": Room(mix=0.0)})
    preset = load_preset(SHIPPED / "studio_any_string.safetensors")
    played = render_events(dry, preset, [TimedEvent(0.0, note.event)], blow.RATE_HZ, "truth", seconds=0.3)
    heard = np.concatenate(list(played))[:, 0]
    signal = take.listened.signals["truth"].read()[: len(heard), 0]
    assert max(np.corrcoef(heard[lag:12_000], signal[: 12_000 - lag])[0, 1] for lag in range(3)) > 0.999
    for key in ("error_time", "spectrum", "waveform"):
        panel = toms.panel(key)
        toms.wait(lambda panel=panel: len(curves(panel.plot)["model"][0]) > 3)
        assert key != "error_time" or (curves(panel.plot)["model"][1] < -4).all(), "the model agrees with the truth"
    table = toms.controller.drum.columns().values
    assert np.abs(table["x (half-lengths)"]).max() == 1
    assert any(np.abs(values).max() > 0 for name, values in table.items() if name.endswith("(m)"))
    above, motion = take.listened.signals["model"].read().copy(), take.motions["model"].size_m.copy()
    foot = QPoint(round(view.axes.x(0.5)), round(view.axes.bottom) + 8)
    toms.drag(view, foot, QPoint(round(view.axes.x(0.97)), foot.y()))
    assert toms.choices.listen == pytest.approx(0.97, abs=0.02) == toms.instrument.pickup.points[0]
    ear = toms.choices.ear
    toms.wait(lambda: take.listened.ear == ear and take.listened.complete)
    assert np.abs(take.listened.signals["model"].read() - above).max() > 0.1 * np.abs(above).max()
    assert (take.motions["model"].size_m == motion).all()
    toms.wait(lambda: toms.keys.player.ear.points == ear.points)  # type: ignore[union-attr]
    toms.performance.seek(0.2)
    assert toms.performance.position_s == 0.2 and not toms.performance.moving
    toms.wait(lambda: view.frame is not None and "0.200 s" in view.frame.caption)
    toms.performance.stop()
    toms.wait(lambda: toms.notes.ringing == 0)
    assert toms.performance.position_s == 0.2
    toms.controller.play_or_stop()
    assert toms.notes.ringing == 1
