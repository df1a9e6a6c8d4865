"""The listening test in the window: it has the sound for itself, nothing gives it away, and all is restored."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySide6.QtWidgets import QLabel, QPushButton, QWidget

from app.analysis.abx.trials import AbxChoices
from app.player import events
from app.player.events import PluckAt, TimedEvent
from app.player.offline import render_events
from app.views.controls.number_box import CountBox
from app.views.dialogs.abx_dialog import AbxDialog
from app.window import controller
from app.window.settings import load_settings
from engine.kernels import midi
from engine.pluck import Pluck
from engine.presets import load_preset
from tests.app.window.conftest import Open
from tests.app.window.driver import CONTROL, KEY, Window, find, press


@pytest.fixture
def heard(opened: Open, speakers: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Window:
    """A window whose pluck is rendered, with a device that makes no sound."""
    monkeypatch.setattr("app.views.dialogs.abx_dialog.default_folder", lambda: tmp_path / "records")
    made = opened(sound=speakers, settings={"abx": AbxChoices(trials=2)}, volume_db=-6)
    made.wait_for_take()
    return made


def open_test(w: Window) -> AbxDialog:
    """The dialog, once its sounds are rendered."""
    w.key(KEY.Key_T, CONTROL)
    dialog = next(each for each in w.window.findChildren(AbxDialog) if each.isVisible())
    w.wait(find(dialog, QPushButton, "Start the test").isEnabled)
    return dialog


def sounds(w: Window) -> bool:
    """Return True if the mixer has a voice that is not silent."""
    return any(voice.sounding for voice in w.controller.sound.mixer.voices)


def volume(w: Window) -> float:
    return float(w.controller.sound.mixer.record["wanted_volume"])


def test_nothing_behind_reports_the_sound_and_an_ended_window_keeps_the_record(
    heard: Window, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    levels: list[tuple[float, bool]] = []
    monkeypatch.setattr(heard.window.transport.meter, "show_level", lambda *level: levels.append(level))
    heard.pluck()
    heard.wait(lambda: levels and levels[-1][0] > -60)
    dialog = open_test(heard)
    assert dialog.isModal() and not heard.performance.playing
    press(dialog, "Start the test")
    trial, before = find(dialog, QWidget, "Trial"), heard.choices
    for key in (KEY.Key_X, KEY.Key_A, KEY.Key_B, KEY.Key_X):
        heard.key(key, on=trial)
        heard.wait(lambda: sounds(heard))
        del levels[:]
        heard.wait(lambda: len(levels) > 1)
        assert set(levels) == {(-float("inf"), False)}
    assert heard.choices == before
    heard.key(KEY.Key_1, on=trial)
    heard.close()
    (path,) = (tmp_path / "records").iterdir()
    assert '"p_value": null' in path.read_text()


def test_the_test_keeps_its_pluck_and_volume_and_all_comes_back_as_it_was(
    heard: Window, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Keys are silent meanwhile; a pedal that is lifted then is up afterwards, a fader moves the sound afterwards."""
    heard.change(preset="second")  # it waits for no picture
    heard.pluck()
    heard.wait(lambda: sounds(heard))
    dialog = open_test(heard)
    assert not heard.performance.playing
    heard.wait(lambda: not sounds(heard))
    before, count = heard.choices, len(heard.struck)
    taken: list[object] = []
    handle = heard.notes.handle
    monkeypatch.setattr(heard.notes, "handle", lambda event, due=None: taken.append(event) or handle(event, due))
    released = [events.NoteOff(52), events.ControlChange(midi.SUSTAIN, 0)]
    for event in (PluckAt(Pluck(0.6, 8.0)), events.NoteOn(60, 90), *released):
        heard.controller.inputs.play(event)  # a MIDI keyboard
    heard.key(KEY.Key_Space)
    assert taken == released and heard.choices == before and len(heard.struck) == count and not sounds(heard)
    heard.controller.inputs.midi.performed.emit({"volume_db": 12.0})
    assert heard.choices.volume_db == 12.0 and volume(heard) == pytest.approx(10 ** (-6 / 20))
    press(dialog, "▶  Hear B")
    heard.wait(lambda: sounds(heard))
    find(dialog, CountBox, "Number of trials").setValue(25)
    heard.key(KEY.Key_Escape, on=dialog)
    heard.wait(lambda: not sounds(heard))
    heard.wait(lambda: volume(heard) == pytest.approx(10 ** (12 / 20)))
    heard.pluck()
    heard.wait(lambda: heard.performance.position_s > 0.3)
    heard.close()
    assert load_settings(tmp_path / "settings.json")[0].abx.trials == 25


@pytest.mark.parametrize("name", ["steel_string_acoustic", "concert_toms"])
def test_a_key_is_compared_as_the_instrument_plays_it(
    guitar: Window, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """With its noise and the neighbours of its string; before a string's key, the pluck that is shown."""
    made: list[Any] = []
    monkeypatch.setattr(controller, "AbxDialog", lambda *given: made.append(given) or AbxDialog(*given))
    guitar.choose(name)
    guitar.change(solo=2, stereo=True)
    guitar.wait(lambda: guitar.choices.drums or guitar.choices.string is not None)
    for velocity in (None, 70) if name != "concert_toms" else (70,):
        if velocity:
            guitar.play(38 if guitar.choices.drums else 52, velocity, hold=True)
            guitar.wait(lambda: guitar.struck[-1].known)
        guitar.controller.listening_test()
        dialog, (_, material, _, render, *_) = guitar.window.findChildren(AbxDialog)[-1], made[-1]
        struck, entry = guitar.session.stage.struck, guitar.controller.library.find("studio_any_string")
        assert struck is not None and entry is not None and (struck.event.pluck is None) == bool(velocity)
        assert (material.pluck["instrument"], material.pluck["key"]) == (guitar.instrument.name, struck.event.key)
        words = [each.text() for each in dialog.findChildren(QLabel)]
        assert f"{struck.words}. All modes, although mode 2 is soloed" in words
        rate_hz = guitar.controller.sound.rate_hz
        found = render(rate_hz).result(60)
        for source in ("model", "truth"):
            alone = render_events(
                struck.instrument,
                load_preset(entry.path),
                [TimedEvent(0.0, struck.event)],
                rate_hz,
                source,
                0.5,
                limited=False,
                varied=False,
                dry=True,
            )
            assert (np.concatenate(list(alone)) == found[source]).all()
        assert 0 < np.abs(found["model"] - found["truth"]).max() < np.abs(found["model"]).max()
        dialog.abandon()
