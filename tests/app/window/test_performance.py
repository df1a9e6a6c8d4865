"""What is played and what is shown: notes at once and in their own time, pictures when they are there."""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import torch
from pytestqt.qtbot import QtBot

from app.audio.devices import AudioDevice
from app.audio.output import Output
from app.audio.sound import Sound
from app.instrument.events import PluckAt
from app.patches.instrument import SingleString
from app.playing.note import Note
from app.session.choices import Choices
from app.window.controller import Controller
from app.window.main_window import MainWindow
from app.window.performance import Performance, growth_words
from app.window.settings import Settings
from engine.kernels.constants import QUANTUM
from engine.models.koopman_var import KoopmanState, KoopmanVar
from engine.pluck import Pluck
from engine.presets import SHIPPED
from engine.voices import Mixer

RATE_HZ = 48_000
TURN_S = 1.0  # of a loop; it is handed over by so much early, so that a busy computer does not come too late
SPEAKERS = AudioDevice("Speakers", "Test API", RATE_HZ)


@pytest.fixture
def window(
    qtbot: QtBot,
    small_preset: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    numb_output: Callable[[AudioDevice, float, Mixer], Output],
) -> Iterator[Controller]:
    """With a device that makes no sound, a preset that sounds at once and one that is rendered first."""
    folder = tmp_path / "presets"
    folder.mkdir()
    shutil.copy(SHIPPED / "nylon_nonlinear_gaussian_4k_koopman_integrated.safetensors", folder / "bank.safetensors")
    shutil.copy(small_preset, folder / "rendered.safetensors")
    monkeypatch.setattr("app.presets.library.SHIPPED", folder)
    monkeypatch.setattr("app.playing.notes.LOOP_AHEAD_S", TURN_S)
    made = MainWindow()
    qtbot.addWidget(made)
    controller = Controller(
        made,
        Settings(choices=Choices(instrument=SingleString(preset="bank"), seconds=1.0)),
        tmp_path / "settings.json",
        lambda on_problem: Sound(on_problem, look_up=lambda *_: SPEAKERS, open_output=numb_output),
    )
    made.show()
    qtbot.waitUntil(lambda: "Error of this pluck" in made.error_label.text())
    qtbot.waitUntil(lambda: controller.sound.status().device == SPEAKERS)
    yield controller
    made.close()


@pytest.fixture
def performance(window: Controller) -> Performance:
    return window.performance


def ringing(performance: Performance) -> list[Note]:
    return [note for note in performance.notes._notes if not note.over and not note.released]


def pluck_chosen(performance: Performance) -> None:
    performance.notes.handle(PluckAt(performance._session.choices.pluck))
    performance.follow()


def pluck(qtbot: QtBot, performance: Performance) -> Note:
    """One that sounds."""
    pluck_chosen(performance)
    note = ringing(performance)[-1]
    qtbot.waitUntil(lambda: note.seconds > 0)
    return note


def test_the_position_is_that_of_the_note(qtbot: QtBot, window: Controller, performance: Performance) -> None:
    assert not performance.playing
    assert performance.position_s == 0
    note = pluck(qtbot, performance)
    assert performance.playing
    assert performance.moving or note.seconds >= 1.0
    for _ in range(5):
        late_s = window.sound.mixer.output_latency_s  # the picture is of the sound by now
        before_s, shown_s, after_s = note.seconds, performance.position_s, note.seconds
        assert min(max(before_s - late_s, 0.0), 1.0) <= shown_s <= max(after_s - late_s, 0.0)
        qtbot.wait(20)
    mixer = window.sound.mixer
    qtbot.waitUntil(lambda: note.seconds == pytest.approx(mixer.seconds - note.began_frame / RATE_HZ, abs=0.05))
    qtbot.waitUntil(lambda: not performance.moving)
    assert performance.position_s == 1.0, "the picture ends there"
    assert performance.playing, "the string rings on"


def test_stop_keeps_the_playhead_whatever_else_is_chosen(
    qtbot: QtBot, window: Controller, performance: Performance
) -> None:
    note = pluck(qtbot, performance)
    qtbot.waitUntil(lambda: performance.position_s > 0.5)
    performance.stop()
    stopped_s = performance.position_s
    assert not performance.playing
    qtbot.waitUntil(lambda: note.over)
    for changes in ({"volume_db": -6.0}, {"listen": 0.2}, {"heard": "b"}):
        window.session.update(**changes)
        assert performance.position_s == stopped_s
    assert not performance.moving
    pluck_chosen(performance)
    assert performance.playing
    assert performance.position_s < stopped_s


def test_a_seek_goes_on_from_there_alone(qtbot: QtBot, performance: Performance) -> None:
    first = pluck(qtbot, performance)
    performance.seek(0.5)
    assert first.released
    assert performance.position_s >= 0.5, "at once"
    (note,) = ringing(performance)
    qtbot.waitUntil(lambda: performance.position_s > 0.55)
    qtbot.waitUntil(lambda: performance.position_s == pytest.approx(min(note.seconds, 1.0), abs=0.05))
    performance.seek(9.0)
    assert performance.position_s == 1.0


def test_a_seek_where_nothing_rings_moves_the_playhead_alone(
    qtbot: QtBot, window: Controller, performance: Performance
) -> None:
    performance.seek(0.25)
    assert performance.position_s == 0.25
    note = pluck(qtbot, performance)
    for voice in note.voices.values():
        voice.release(0.01)  # it ends by itself
    qtbot.waitUntil(lambda: not performance.playing)
    performance.seek(0.7)
    assert performance.position_s == 0.7
    window.session.update(volume_db=-3.0)
    assert performance.position_s == 0.7
    assert ringing(performance) == []


def loop(qtbot: QtBot, window: Controller, seconds: float = TURN_S) -> Note:
    """The first turn."""
    window.session.update(seconds=seconds, loop=True)
    qtbot.waitUntil(lambda: window.performance.ready)
    return pluck(qtbot, window.performance)


def next_turn(qtbot: QtBot, performance: Performance, before: Note) -> Note:
    qtbot.waitUntil(lambda: performance._shown.note is not before)
    assert performance._shown.note is not None
    return performance._shown.note


@pytest.mark.parametrize("preset", ["bank", "rendered"])
def test_a_loop_begins_each_turn_at_its_frame(
    qtbot: QtBot, window: Controller, performance: Performance, preset: str
) -> None:
    window.session.update(preset=preset)
    note = loop(qtbot, window)
    for _ in range(3):
        turn = next_turn(qtbot, performance, note)
        assert turn.began_frame == note.began_frame + round(TURN_S * RATE_HZ)
        qtbot.waitUntil(lambda note=note: note.over)  # type: ignore[misc]
        note = turn
    assert len(ringing(performance)) <= 2
    assert performance.position_s <= TURN_S


def test_a_seek_in_a_loop_shortens_its_turn(qtbot: QtBot, window: Controller, performance: Performance) -> None:
    loop(qtbot, window, seconds=2.0)
    performance.seek(1.25)
    note = performance._shown.note
    assert note is not None
    turn = next_turn(qtbot, performance, note)
    assert turn.began_frame - note.began_frame == pytest.approx(0.75 * RATE_HZ, abs=QUANTUM)


def test_a_loop_goes_on_with_the_pluck_that_is_chosen_meanwhile(
    qtbot: QtBot, window: Controller, performance: Performance
) -> None:
    loop(qtbot, window)
    qtbot.waitUntil(lambda: performance._next_turn is not None)  # with the former pluck
    for position in (0.42, 0.44):
        window.session.update(position=position)
        for _ in range(2):
            before = performance._shown.note
            qtbot.waitUntil(lambda before=before: performance._shown.note not in (None, before))  # type: ignore[misc]
    assert performance._shown.note is not None
    assert performance._shown.note.request.pluck.position == 0.44
    assert len(ringing(performance)) <= 3


def test_a_loop_that_is_switched_off_rings_out(qtbot: QtBot, window: Controller, performance: Performance) -> None:
    note = loop(qtbot, window)
    qtbot.waitUntil(lambda: performance._next_turn is not None)
    waiting = performance._next_turn
    assert waiting is not None
    window.session.update(loop=False)
    qtbot.waitUntil(lambda: note.seconds > TURN_S + 0.05)
    assert waiting.over
    assert waiting.seconds == 0
    assert not note.over


def test_a_loop_goes_on_where_its_note_has_fallen_silent(
    qtbot: QtBot, window: Controller, performance: Performance
) -> None:
    note = loop(qtbot, window)
    for voice in note.voices.values():
        voice.release(0.01)
    qtbot.waitUntil(lambda: note.over)
    turn = next_turn(qtbot, performance, note)
    assert turn.began_frame - note.began_frame == pytest.approx(TURN_S * RATE_HZ, abs=QUANTUM)


def test_a_pluck_in_a_loop_is_what_goes_on(qtbot: QtBot, window: Controller, performance: Performance) -> None:
    loop(qtbot, window)
    qtbot.waitUntil(lambda: performance._next_turn is not None)
    waiting = performance._next_turn
    assert waiting is not None
    struck = pluck(qtbot, performance)
    assert performance._shown.note is struck
    turn = next_turn(qtbot, performance, struck)
    assert turn.began_frame - struck.began_frame == pytest.approx(TURN_S * RATE_HZ, abs=QUANTUM)
    assert waiting.seconds == 0


def test_the_picture_follows_the_latest_note(qtbot: QtBot, window: Controller, performance: Performance) -> None:
    first = pluck(qtbot, performance)
    window.session.update(position=0.6)
    second = pluck(qtbot, performance)
    qtbot.waitUntil(lambda: performance.ready and performance._shown.note is second)
    assert performance.take is not None
    assert performance.take.pluck.position == 0.6
    third = pluck(qtbot, performance)  # the same again: its motion is there
    assert performance._shown.note is third
    assert ringing(performance) == [first, second, third]


def test_another_listening_point_and_speed_are_of_the_same_take(
    qtbot: QtBot, window: Controller, performance: Performance
) -> None:
    """Nothing that is seen of it is rendered again; signals and slow motion follow."""
    session, take = window.session, performance.take
    assert take is not None
    session.update(face="lab")
    pictures = take.motion_m("truth").copy()
    for choices in ({"listen": 0.8}, {"pickup": "velocity", "stereo": True}, {"solo": 2}, {"speed": 0.1}):
        session.update(**choices)
        qtbot.waitUntil(lambda: take.listened.ear == session.choices.ear and take.listened.complete)
    qtbot.waitUntil(lambda: take.motions["model"].flashes.strobe.speed == 0.1)
    performance.seek(0.3)
    string = next(panel.view for panel in window.panels if panel.key == "string")
    shape_m = take.motions["model"].shape_m(0.3)
    qtbot.waitUntil(
        lambda: string._frame is not None and abs(string._frame.shapes["model"] / 1000 - shape_m).max() < 1e-9
    )
    session.update(speed=0.37)
    qtbot.waitUntil(lambda: take.motions["model"].flashes.strobe.speed == 0.37)
    other_m = take.motions["model"].shape_m(0.3)
    assert abs(other_m - shape_m).max() > 1e-5
    qtbot.waitUntil(lambda: abs(string._frame.shapes["model"] / 1000 - other_m).max() < 1e-9)
    session.update(face="play")  # where the string is at rest unless it moves
    qtbot.waitUntil(lambda: string._frame is None)
    assert performance.take is take
    assert (take.motion_m("truth") == pictures).all()


def test_a_note_of_an_instrument_is_in_the_mixer_before_the_window_knows(
    qtbot: QtBot, window: Controller, performance: Performance
) -> None:
    """The window's thread is busy here until it waits."""
    qtbot.waitUntil(lambda: window.sound.mixer.voices == [])
    before = window.session.choices
    for number, position in enumerate((0.4, 0.6), 1):
        event = PluckAt(Pluck(position, 5.0))
        player = threading.Thread(target=window.instruments.play, args=(event,))
        player.start()
        player.join()
        assert len({voice.program for voice in window.sound.mixer.voices}) == 2  # model and truth
        assert len(ringing(performance)) == number
    until_s = time.monotonic() + 60
    while not all(note.seconds > 0 for note in ringing(performance)) and time.monotonic() < until_s:
        time.sleep(0.01)
    assert all(note.seconds > 0 for note in ringing(performance)), "it sounds"
    assert window.session.choices == before
    reported: list[Choices] = []
    window.instruments.played.connect(lambda: reported.append(window.session.choices))
    plucks = [note.request.pluck for note in ringing(performance)]
    assert [(each.position, each.amplitude_mm) for each in plucks] == [(0.4, 5.0), (0.6, 5.0)]
    qtbot.waitUntil(lambda: reported != [])
    assert (reported[-1].position, reported[-1].amplitude_mm) == (0.6, 5.0)
    qtbot.waitUntil(lambda: performance._shown.note is ringing(performance)[-1])
    qtbot.waitUntil(lambda: bool(performance.notes.latencies_s))


def test_another_rate_of_the_device_leaves_what_rings_and_what_is_shown(
    qtbot: QtBot, window: Controller, performance: Performance
) -> None:
    window.session.update(seconds=10.0)  # the playhead does not come to its end before the device is there
    qtbot.waitUntil(lambda: performance.ready)
    note = pluck(qtbot, performance)
    mixer, other = window.sound.mixer, AudioDevice("Other", "Test API", 44_100)
    window.sound._look_up = lambda *_: other
    window.sound.open(other)
    qtbot.waitUntil(lambda: window.sound.mixer is not mixer)
    qtbot.waitUntil(lambda: note.mixer is window.sound.mixer)
    here_s = performance.position_s
    assert here_s > 0
    qtbot.waitUntil(lambda: performance.position_s > here_s)
    performance.stop()
    assert not performance.playing


@pytest.fixture
def slow_model(monkeypatch: pytest.MonkeyPatch) -> None:
    advance = KoopmanVar.advance

    def slow(
        self: KoopmanVar, state: KoopmanState, steps: int, readout: torch.Tensor | None = None
    ) -> tuple[torch.Tensor, KoopmanState]:
        if readout is not None:  # for the ear, not for the picture
            time.sleep(steps / 2_000)
        return advance(self, state, steps, readout)

    monkeypatch.setattr(KoopmanVar, "advance", slow)


def test_how_long_a_model_is_waited_for_is_reported_and_then_its_error(
    qtbot: QtBot, window: Controller, performance: Performance, slow_model: None
) -> None:
    window.session.update(preset="rendered", seconds=0.8)
    label = window.window.error_label
    qtbot.waitUntil(lambda: performance.ready and performance.settled and "Error of this pluck" in label.text())
    pluck_chosen(performance)
    qtbot.waitUntil(lambda: label.text().startswith("Koopman, variable: buffering, starts in 0."))
    (note,) = ringing(performance)
    assert performance.position_s == 0 or not note.pending
    qtbot.waitUntil(lambda: not note.pending)
    qtbot.waitUntil(lambda: "Error of this pluck" in label.text())


def test_space_stops_what_has_not_sounded_yet(
    qtbot: QtBot, window: Controller, performance: Performance, slow_model: None
) -> None:
    window.session.update(preset="rendered", seconds=10.0)
    qtbot.waitUntil(lambda: performance.ready)
    window.play_or_stop()
    assert performance.playing
    (note,) = ringing(performance)
    window.play_or_stop()
    assert not performance.playing
    assert note.over
    qtbot.waitUntil(lambda: "buffering" not in window.window.error_label.text())


@pytest.mark.parametrize(
    ("errors", "own", "words"),
    [
        ([0.001, 0.004], 0.001, ""),  # grown, but too small to be noticed
        ([0.02, 0.05], 0.028, ""),  # as large as ever
        ([0.03, 1.16], 0.028, "116 % past the end of its training"),
        ([0.2, 0.05], 0.01, "20 % on this pluck"),
        ([0.2], None, "20 % on this pluck"),
        ([float("nan")], 0.01, ""),
        ([], None, ""),
    ],
)
def test_an_error_that_grew_is_put_into_words(errors: list[float], own: float | None, words: str) -> None:
    said = growth_words(errors, own)
    assert words in said
    assert bool(said) == bool(words)
