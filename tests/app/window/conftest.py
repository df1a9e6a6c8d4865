"""Windows with a controller: of the Lab, of an instrument, and others as a test asks for them."""

import shutil
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import pytest

from app.audio.devices import AudioDevice
from app.audio.sound import Sound
from app.export.choices import ExportChoices
from app.export.sampled.choices import SampledChoices
from app.instruments.library import SHIPPED as INSTRUMENTS
from app.instruments.library import read_instrument
from app.player.events import Event, NoteOn, message_of
from app.playing.midi_port import MidiInput
from app.session.choices import Choices
from app.views import theme
from app.views.dialogs.midi_dialog import MidiDialog
from app.window import midi_control
from app.window.controller import Controller
from app.window.main_window import MainWindow
from app.window.settings import InstrumentChoice, Settings
from engine.presets.finding import SHIPPED
from tests.app.conftest import make_sound
from tests.app.places import files_in
from tests.app.window.driver import CONTROL, KEY, Window

Open = Callable[..., Window]
SPEAKERS = AudioDevice("Speakers", "Test API", 48_000)
INPUTS = KEYBOARD, PADS = "Keys:Keys 20:0", "Pads:Pads 24:0"
BRIEFLY = ExportChoices(until_decayed=False, seconds=0.3, normalise=False)


class FakeBackend:
    """A MIDI system of two inputs; `send` speaks in a thread of its own, as the system's does."""

    def __init__(self) -> None:
        self.names = list(INPUTS)
        self.busy = False
        self.open_name = ""
        self.callback: Callable[[Sequence[int]], None] | None = None

    def get_input_names(self) -> list[str]:
        return self.names

    def open_input(self, name: str, *, callback: Callable[[Sequence[int]], None]) -> "FakeBackend":
        if self.busy:
            raise OSError("resource busy")
        self.open_name, self.callback = name, callback
        return self

    def close(self) -> None:
        self.open_name, self.callback = "", None

    def connected(self) -> bool:
        return self.open_name in self.names

    def send(self, *events: Event | Sequence[int]) -> None:
        """Send events, or the bytes of a message."""
        assert self.callback is not None
        for event in events:
            message = event if isinstance(event, bytes) else message_of(event)  # type: ignore[arg-type]
            thread = threading.Thread(target=self.callback, args=(message,))
            thread.start()
            thread.join()

    def play(self, w: Window, notes: str, *events: NoteOn) -> None:
        """Choose an input in the window's dialog, and what notes do; then send some."""
        w.key(KEY.Key_M, CONTROL)
        (dialog,) = w.window.findChildren(MidiDialog)
        dialog.port_chosen.emit(PADS)
        dialog.notes_chosen.emit(notes)
        self.send(*events)


@pytest.fixture
def backend(monkeypatch) -> FakeBackend:
    """The MIDI system of every window."""
    made = FakeBackend()
    made_with = lambda receive, load, release: MidiInput(receive, lambda: made, release)  # noqa: E731
    monkeypatch.setattr(midi_control, "MidiInput", made_with)
    return made


@pytest.fixture
def opened(qtbot, backend, preset_folder, tmp_path, monkeypatch, threads_begun) -> Iterator[Open]:
    """Opens windows with the presets `first` and `second` and these shipped ones; none leaves a thread.

    `settings`: fields of `Settings`; the other words are `choices`. Exports are short, and go to `tmp_path`.
    """
    monkeypatch.setenv("LEARNED_STRINGS_RECORDINGS", str(tmp_path / "unsaved recordings"))
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(tmp_path / "own"))
    sampled = SampledChoices(keys=(60, 61), layers=1, seconds=0.2)
    usual = {"instrument": InstrumentChoice(shown=True), "export": BRIEFLY, "sampled": sampled}
    usual["files"] = files_in(tmp_path)  # type: ignore[assignment]
    windows: list[Window] = []

    def made(
        *presets: str, sound: Any = make_sound, settings: dict[str, Any] | None = None, **choices: Any
    ) -> Window:
        for name in presets:
            shutil.copy(SHIPPED / f"{name}.safetensors", preset_folder)
        window = MainWindow()
        qtbot.addWidget(window, before_close_func=lambda closed: setattr(closed, "may_close", lambda: True))
        chosen = Settings(choices=Choices(**{"seconds": 0.5, **choices}), **{**usual, **(settings or {})})
        windows.append(Window(qtbot, Controller(window, chosen, tmp_path / "settings.json", sound)))
        with qtbot.waitExposed(window):
            window.show()
        return windows[-1]

    yield made
    for each in windows:
        each.close()
    assert threads_begun() == []


@pytest.fixture
def lab(opened) -> Window:
    """A window that shows the Lab."""
    return opened(face="lab")


@pytest.fixture
def guitar(opened) -> Window:
    """A window in which keys play a guitar."""
    made = opened("studio_any_string", instrument=read_instrument(INSTRUMENTS / "steel_string_acoustic.json"))
    made.wait_for_keys()
    made.window.setFocus()
    return made


@pytest.fixture
def speakers(numb_output) -> Callable[[Any], Sound]:
    """A sound with a device that takes frames at the pace of time and makes none."""
    return lambda on_problem: Sound(on_problem, look_up=lambda *_: SPEAKERS, open_output=numb_output)


@pytest.fixture
def themed(qapp) -> Iterator[Callable[..., None]]:
    """Puts on a theme, by default the dark one, as users see it; afterwards the look is as before."""
    sheet, font, palette = qapp.styleSheet(), qapp.font(), qapp.palette()

    def put_on(name: Any = "dark", percent: int = 100) -> None:
        theme.apply_theme(qapp, name, percent)

    put_on()
    yield put_on
    put_on()
    qapp.setStyleSheet(sheet)
    qapp.setFont(font)
    qapp.setPalette(palette)
