"""Notes: struck, switched, listened to, matched, ended; and sent to no device, but to a mixer that the test turns."""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from app.audio.devices import AudioDevice
from app.audio.output import ClockOutput
from app.audio.sound import Sound
from app.instrument.events import NoteOff, NoteOn, PluckAt
from app.patches.instrument import SingleString
from app.playing import notes as module
from app.playing.ahead import LEAST_S
from app.playing.due import Due
from app.playing.keyboard import HIGHEST_PLACE, LOWEST_PLACE, PluckRange
from app.playing.note import Note
from app.playing.notes import Notes
from app.playing.sources import Sources
from app.presets.library import PresetEntry
from app.rendering import RenderRequest
from engine.kernels.constants import AHEAD, QUANTUM
from engine.models.koopman_var import KoopmanState, KoopmanVar
from engine.pluck import Pluck
from engine.presets import load_preset, read_info, save_preset
from engine.values.ear import Ear
from engine.voices import Mixer, Voice
from tests.app.monitors import hears

RATE_HZ = 48_000
QUANTUM_S = QUANTUM / RATE_HZ
Wait = Callable[[Callable[[], bool]], None]
EAR = Ear((0.37,))
PluckOf = Callable[..., RenderRequest]
Strike = Callable[..., Note]
Reports = list[tuple[str, str]]


def gains(note: Note) -> dict[str, float]:
    """With which its voices sound, or fade to."""
    return {source: float(voice.record["wanted_gain"]) for source, voice in note.voices.items()}


def seconds_of(mixer: Mixer, seconds: float) -> np.ndarray:
    """(frames,), left."""
    return mixer.render(round(seconds * mixer.rate_hz))[:, 0]


def alone(sources: Sources, pluck: RenderRequest, seconds: float, source: str = "model") -> np.ndarray:
    """What one source of a pluck sounds like in a mixer of its own, (frames,)."""
    mixer = Mixer(RATE_HZ)
    initial_m, begin = sources.begin(pluck.preset, source, RATE_HZ, pluck.pluck)
    mixer.add(Voice(sources.program(pluck.preset, source, RATE_HZ), initial_m, pluck.ear, begin=begin))
    return seconds_of(mixer, seconds)


def test_a_strike_sounds_with_the_next_frame(
    notes: Notes, sound: Any, bank: Path, pluck_of: PluckOf, strike: Strike, wait: Wait
) -> None:
    note = strike(pluck_of(bank))
    assert not note.pending, "nobody was waited for"
    assert notes.ringing == 1
    began_s = sound.mixer.seconds
    out = seconds_of(sound.mixer, 0.05)
    assert np.abs(out).max() > 0.01
    assert out[:96].any()
    assert note.began_frame == round(began_s * RATE_HZ)
    assert note.seconds == pytest.approx(0.05, abs=QUANTUM_S)


def test_all_voices_of_a_note_begin_with_one_frame_and_one_is_heard(
    notes: Notes, sound: Any, bank: Path, pluck_of: PluckOf, strike: Strike
) -> None:
    note = strike(pluck_of(bank))
    seconds_of(sound.mixer, 0.01)
    assert {voice.began_frame for voice in note.voices.values()} == {note.began_frame}
    assert {voice.seconds for voice in note.voices.values()} == {note.seconds}
    assert gains(note) == {"model": 1.0, "truth": 0.0}


def test_a_switch_sounds_as_if_the_other_had_been_heard_all_along(
    notes: Notes, sound: Any, sources: Sources, bank: Path, pluck_of: PluckOf, strike: Strike
) -> None:
    model, truth = (alone(sources, pluck_of(bank, 0.35, amplitude_mm=8.0), 0.4, name) for name in ("model", "truth"))
    note = strike(pluck_of(bank, amplitude_mm=8.0))
    before, fade, after = (
        slice(round(a * RATE_HZ), round(b * RATE_HZ)) for a, b in ((0, 0.2), (0.2, 0.25), (0.25, 0.4))
    )
    np.testing.assert_allclose(seconds_of(sound.mixer, 0.2), model[before], atol=1e-6)
    notes.set_monitor(hears("truth"))
    between = seconds_of(sound.mixer, 0.05)
    lowest, highest = np.minimum(model[fade], truth[fade]), np.maximum(model[fade], truth[fade])
    assert (between > lowest - 1e-6).all()
    assert (between < highest + 1e-6).all()
    np.testing.assert_allclose(seconds_of(sound.mixer, 0.15), truth[after], atol=1e-6)
    assert np.abs(model[after] - truth[after]).max() > 5e-6
    notes.set_monitor(hears("difference", difference_gain_db=20.0))
    assert gains(note) == pytest.approx({"model": 10.0, "truth": -10.0})
    notes.set_monitor(hears("model"))
    assert gains(note) == {"model": 1.0, "truth": 0.0}


def test_plucks_ring_beside_each_other(
    notes: Notes, sound: Any, sources: Sources, bank: Path, pluck_of: PluckOf, strike: Strike
) -> None:
    plucks = [pluck_of(bank, position=position) for position in (0.3, 0.5)]
    for pluck in plucks:
        strike(pluck)
    out = seconds_of(sound.mixer, 0.1)
    np.testing.assert_allclose(out, sum(alone(sources, pluck, 0.1) for pluck in plucks), atol=1e-6)


def test_the_oldest_notes_end_where_there_are_too_many(
    notes: Notes, sound: Any, bank: Path, pluck_of: PluckOf, strike: Strike, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MOST_NOTES", 3)
    struck = []
    for number in range(5):
        struck.append(strike(pluck_of(bank, position=0.3 + 0.05 * number)))
        seconds_of(sound.mixer, 0.01)
    assert [note.released for note in struck] == [True, True, False, False, False]
    assert notes.ringing == 3
    seconds_of(sound.mixer, 0.1)
    assert [note.over for note in struck] == [True, True, False, False, False]
    notes.poll()
    assert len(notes._notes) == 3


def look(sound: Any) -> None:
    """The sound's thread looks at the load of a device that has taken a quantum since."""
    sound.mixer.render(QUANTUM)
    sound.take_care()


def test_where_the_device_has_no_time_left_notes_end(
    notes: Notes, sound: Any, bank: Path, pluck_of: PluckOf, strike: Strike
) -> None:
    struck = [strike(pluck_of(bank)) for _ in range(6)]
    sound.take_care()
    assert notes.ringing == 6
    sound.load = 0.9
    for _ in range(module.LOOKS):
        assert notes.ringing == 6
        look(sound)
    assert [note.released for note in struck] == [True, True, False, False, False, False]
    for _ in range(6 * module.LOOKS):
        look(sound)
    assert not struck[-1].released, "one always rings"


def test_the_more_is_asked_of_the_device_the_more_notes_end_at_once(
    notes: Notes, sound: Any, bank: Path, pluck_of: PluckOf, strike: Strike
) -> None:
    struck = [strike(pluck_of(bank)) for _ in range(16)]
    sound.load = 1.5
    for _ in range(module.LOOKS):
        look(sound)
    assert [note.released for note in struck] == [True] * 8 + [False] * 8


def test_bursts_of_other_programs_end_no_note(
    notes: Notes, sound: Any, bank: Path, pluck_of: PluckOf, strike: Strike
) -> None:
    """A callback that waits for a processor raises the load far above 1; the next ones lower its mean again."""
    struck = [strike(pluck_of(bank)) for _ in range(6)]
    for load in (*[0.3, 12.0, 4.0, 1.1, 0.8] * 8, 0.3, *[7.0] * (module.LOOKS - 1), 0.3):
        sound.load = load
        look(sound)
    sound.load = 7.0
    look(sound)
    for _ in range(3 * module.LOOKS):
        sound.take_care()  # while the device is not called, this is no new load
    assert not any(note.released for note in struck)


def test_notes_end_under_load_while_the_window_hangs(
    sources: Sources, bank: Path, pluck_of: PluckOf, wait: Wait
) -> None:
    """Nothing but the sound's own thread is at work: nobody polls."""

    class Laden(ClockOutput):
        device = AudioDevice("Speakers", "ALSA", RATE_HZ)

        def load(self) -> float:
            return laden

    laden = 0.2
    with Sound(look_up=lambda *_: Laden.device, open_output=lambda _device, _buffer_s, mixer: Laden(mixer)) as sound:
        sound.open()
        wait(lambda: sound.status().changes_done > 0)
        notes = Notes(sound, sources, lambda name: None, lambda message, detail: None)
        try:
            notes.choose(pluck_of(bank))
            struck = [note for _ in range(6) if (note := notes.ring()) is not None]
            wait(lambda: sound.status().load == laden)
            assert notes.ringing == 6
            laden = 0.9
            wait(lambda: notes.ringing == 1)
            wait(lambda: all(note.over for note in struck[:-1]))
            laden = 0.2
            assert not struck[-1].over
        finally:
            notes.close()


def test_stop_ends_all_without_a_click(
    notes: Notes, sound: Any, bank: Path, pluck_of: PluckOf, strike: Strike
) -> None:
    struck = [strike(pluck_of(bank, amplitude_mm=5.0)) for _ in range(2)]
    loud = seconds_of(sound.mixer, 0.1)
    notes.stop()
    assert notes.ringing == 0
    end = seconds_of(sound.mixer, 0.1)
    assert np.abs(np.diff(np.concatenate([loud[-10:], end]))).max() <= 1.2 * np.abs(np.diff(loud)).max()
    assert not end[round((module.STOP_S + 2 * QUANTUM_S) * RATE_HZ) :].any()
    assert all(note.over for note in struck)
    notes.poll()
    sound.mixer.forget_ended()
    assert sound.mixer.voices == []


def test_a_note_rings_until_it_is_silent(
    notes: Notes, sound: Any, bank: Path, pluck_of: PluckOf, strike: Strike
) -> None:
    """Not until some number of seconds."""
    note = strike(pluck_of(bank, seconds=0.1))
    assert np.abs(seconds_of(sound.mixer, 1.0)[-1_000:]).max() > 1e-3
    for _ in range(60):
        if note.over:
            break
        out = seconds_of(sound.mixer, 1.0)
    assert note.over
    assert np.abs(out).max() < 1e-3


def test_a_preset_that_is_not_there_yet_is_loaded_and_sounds(
    notes: Notes, sound: Any, bank: Path, tmp_path: Path, pluck_of: PluckOf, strike: Strike, wait: Wait
) -> None:
    path = Path(shutil.copy(bank, tmp_path))
    note = strike(pluck_of(path))
    assert notes.ringing == 1
    assert note.seconds == 0
    wait(lambda: not note.pending)
    assert np.abs(seconds_of(sound.mixer, 0.05)).max() > 0.01
    again = strike(pluck_of(path, position=0.6))
    assert not again.pending


def test_what_is_prepared_is_not_waited_for(
    notes: Notes, sources: Sources, bank: Path, tmp_path: Path, pluck_of: PluckOf, strike: Strike, wait: Wait
) -> None:
    path = Path(shutil.copy(bank, tmp_path))
    notes.choose(pluck_of(path))
    assert not notes.at_hand
    notes.prepare(path, bank)
    wait(lambda: notes.at_hand)
    assert not strike(pluck_of(path)).pending


def test_what_waits_hears_of_switches_and_of_stop(
    notes: Notes,
    sound: Any,
    sources: Sources,
    bank: Path,
    tmp_path: Path,
    pluck_of: PluckOf,
    strike: Strike,
    wait: Wait,
) -> None:
    holding = threading.Event()
    try:
        notes.in_background(lambda: holding.wait(20) and None)
        kept, stopped = (strike(pluck_of(Path(shutil.copy(bank, tmp_path / name)))) for name in "ab")
        stopped.release(0.01)
        notes.set_monitor(hears("truth"))
    finally:
        holding.set()
    wait(lambda: not kept.pending)
    assert gains(kept) == {"model": 0.0, "truth": 1.0}
    notes.stop()
    waiting = strike(pluck_of(bank), from_s=0.1)
    notes.stop()
    done = threading.Event()
    notes.in_background(done.set)
    assert done.wait(20)
    assert stopped.over
    assert waiting.released
    seconds_of(sound.mixer, 0.1)
    assert not seconds_of(sound.mixer, 0.1).any()


def test_a_preset_that_cannot_be_played_is_reported(
    notes: Notes, sound: Any, tmp_path: Path, pluck_of: PluckOf, strike: Strike, reports: Reports, wait: Wait
) -> None:
    (tmp_path / "broken.safetensors").write_bytes(b"damaged")
    note = strike(pluck_of(tmp_path / "broken.safetensors"))
    wait(lambda: reports != [])
    wait(lambda: note.over)
    ((message, detail),) = reports
    assert "broken.safetensors" in message
    assert detail == ""
    assert notes.ringing == 0
    assert note.waits_s == 0


def test_what_cannot_be_played_beside_a_preset_does_not_hinder_it(
    notes: Notes,
    sound: Any,
    bank: Path,
    tmp_path: Path,
    pluck_of: PluckOf,
    strike: Strike,
    reports: Reports,
    wait: Wait,
) -> None:
    broken = tmp_path / "broken.safetensors"
    broken.write_bytes(b"damaged")
    for _ in range(2):
        notes.set_monitor(hears("model", "preset:broken"))
        note = strike(pluck_of(bank, others=(broken,)))
        wait(lambda note=note: not note.pending)  # type: ignore[misc]
        assert set(note.voices) == {"model"}
    assert np.abs(seconds_of(sound.mixer, 0.05)).max() > 0.01
    assert reports == []


def test_another_preset_sounds_at_its_own_rate_in_step(
    notes: Notes,
    sound: Any,
    sources: Sources,
    bank: Path,
    tmp_path: Path,
    pluck_of: PluckOf,
    strike: Strike,
    wait: Wait,
) -> None:
    other = Path(shutil.copy(bank, tmp_path / "other.safetensors"))
    notes.prepare(other)
    pluck = pluck_of(bank, others=(other,))
    notes.set_monitor(hears("preset:other", "model"))
    notes.choose(pluck)
    wait(lambda: notes.at_hand)
    note = strike(pluck)
    assert gains(note) == {"model": 0.0, "preset:other": 1.0}
    expected = alone(sources, pluck_of(bank), 0.1)
    np.testing.assert_allclose(seconds_of(sound.mixer, 0.1), expected, atol=1e-6)


def test_levels_are_matched_once_they_are_known(
    notes: Notes,
    sound: Any,
    sources: Sources,
    bank: Path,
    tmp_path: Path,
    pluck_of: PluckOf,
    strike: Strike,
    wait: Wait,
) -> None:
    """To the truth's, without the limiter, which a loud pluck would not pass."""
    preset = load_preset(bank)
    loud = tmp_path / "loud.safetensors"
    with torch.no_grad():
        preset.model.decoder.weight.mul_(12.0)  # type: ignore[union-attr, operator]
    save_preset(loud, preset.info, preset.model)
    notes.prepare(loud)
    pluck = pluck_of(loud, amplitude_mm=8.0)
    notes.choose(pluck)
    wait(lambda: notes.at_hand)
    note = strike(pluck)
    assert note.match is None
    notes.set_monitor(hears("model", level_match=True))  # while it rings
    wait(lambda: note.match is not None and gains(note) == {"model": note.match["model"], "truth": 0.0})
    assert note.match is not None
    assert note.match["truth"] == 1.0
    assert note.match["model"] == pytest.approx(1 / 12, rel=0.02)
    again = strike(pluck)
    assert again.match == note.match, "it is known from the start"
    assert gains(again) == gains(note)
    notes.set_monitor(hears("model"))
    assert gains(again)["model"] == 1.0


@pytest.mark.parametrize("seconds", [0.5, 1.5])
def test_levels_of_a_model_that_is_rendered_are_matched_when_enough_is_there(
    notes: Notes, small_preset: Path, pluck_of: PluckOf, strike: Strike, wait: Wait, seconds: float
) -> None:
    """All of it, where that is short."""
    notes.set_monitor(hears("model", level_match=True))
    note = strike(pluck_of(small_preset, position=0.43, seconds=seconds))
    wait(lambda: not note.pending)

    def matched() -> bool:
        notes.poll()
        return note.match is not None

    wait(matched)
    assert note.match is not None
    assert note.match["model"] == pytest.approx(1.0, abs=0.3)
    assert note.match["model"] != 1.0


def test_a_listening_point_moves_while_it_rings(
    notes: Notes, sound: Any, sources: Sources, bank: Path, pluck_of: PluckOf, strike: Strike
) -> None:
    strike(pluck_of(bank))
    seconds_of(sound.mixer, 0.1)
    notes.listen(Ear((0.15,)))
    notes.poll()
    seconds_of(sound.mixer, 0.1)
    out = seconds_of(sound.mixer, 0.1)
    expected = alone(sources, pluck_of(bank, ear=Ear((0.15,))), 0.3)
    np.testing.assert_allclose(out, expected[-len(out) :], atol=1e-5)


def test_latencies_are_noted_once_a_note(
    notes: Notes, sound: Any, bank: Path, pluck_of: PluckOf, strike: Strike
) -> None:
    strike(pluck_of(bank))
    notes.poll()
    assert notes.latencies_s == ()
    seconds_of(sound.mixer, 0.01)
    notes.poll()
    notes.poll()
    limiter_s = pytest.approx(AHEAD / RATE_HZ)
    assert notes.latencies_s == (limiter_s,), "by this clock it began when it was struck"
    later = strike(pluck_of(bank), begin_frame=round(0.05 * RATE_HZ))
    seconds_of(sound.mixer, 0.1)
    notes.poll()
    assert later.seconds > 0
    assert len(notes.latencies_s) == 1, "a turn of a loop is no gesture"


@pytest.mark.parametrize("now_s", [1.795774879e9, -20.0, float("nan"), float("inf"), 0.0, -1e300])
def test_a_latency_that_cannot_be_is_not_noted(
    notes: Notes, sound: Any, bank: Path, pluck_of: PluckOf, strike: Strike, now_s: float
) -> None:
    """The clock of gestures and that of the device's calls have two bases, or one of them none."""
    sound.now_s = lambda: now_s
    note = strike(pluck_of(bank))
    seconds_of(sound.mixer, 0.01)
    notes.poll()
    assert note.began and note.latency_s is None
    assert notes.latencies_s == ()


def test_a_note_waits_for_its_frame(notes: Notes, sound: Any, bank: Path, pluck_of: PluckOf, strike: Strike) -> None:
    first = strike(pluck_of(bank))
    seconds_of(sound.mixer, 0.1)
    frame = first.frame_at(0.2)
    second = strike(pluck_of(bank), begin_frame=frame)
    assert not second.began
    first.release_at(frame)
    seconds_of(sound.mixer, 0.2)
    assert second.began
    assert second.began_frame == frame
    assert second.began_frame - first.began_frame == round(0.2 * RATE_HZ)
    assert first.over


@pytest.mark.parametrize("which", ["bank", "small_preset"])
def test_a_seek_begins_in_the_middle_alone(
    notes: Notes,
    sound: Any,
    sources: Sources,
    pluck_of: PluckOf,
    strike: Strike,
    wait: Wait,
    which: str,
    request: pytest.FixtureRequest,
) -> None:
    """Also where the model is rendered first: it is in step with the truth."""
    path = request.getfixturevalue(which)
    whole = {}
    for name in ("model", "truth"):
        notes.set_monitor(hears(name))
        struck = strike(pluck_of(path))
        wait(lambda struck=struck: struck.began or (not struck.pending and all(a.finished for a in struck.ahead)))  # type: ignore[misc]
        whole[name] = sound.mixer.render(500 * QUANTUM)[:, 0]
        notes.stop()
        sound.mixer.render(50 * QUANTUM)
    before = strike(pluck_of(path))
    note = strike(pluck_of(path), from_s=0.4, alone=True)
    assert before.released
    assert note.seconds == 0.4, "the playhead is there at once"
    wait(lambda: not note.pending)
    sound.mixer.render(40 * QUANTUM)
    assert note.seconds == pytest.approx(0.4 + 40 * QUANTUM_S, abs=QUANTUM_S)
    assert len({voice.seconds for voice in note.voices.values()}) == 1
    for name in ("model", "truth"):
        notes.set_monitor(hears(name))
        sound.mixer.render(30 * QUANTUM)
        place = round(note.seconds * RATE_HZ)
        out = sound.mixer.render(10 * QUANTUM)[:, 0]
        np.testing.assert_allclose(out, whole[name][place : place + len(out)], atol=1e-6)
    assert note.frame_at(1.0) == note.began_frame + round(0.6 * RATE_HZ)
    notes.poll()
    assert all(latency_s >= 0 for latency_s in notes.latencies_s)


@pytest.fixture
def slow_model(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The small preset's model makes a second of sound in two."""
    advance = KoopmanVar.advance

    def slow(
        self: KoopmanVar, state: KoopmanState, steps: int, readout: torch.Tensor | None = None
    ) -> tuple[torch.Tensor, KoopmanState]:
        time.sleep(steps / 2_000)
        return advance(self, state, steps, readout)

    monkeypatch.setattr(KoopmanVar, "advance", slow)
    yield


def test_a_model_that_is_rendered_begins_when_enough_is_there(
    notes: Notes, sound: Any, small_preset: Path, pluck_of: PluckOf, strike: Strike, wait: Wait, slow_model: None
) -> None:
    """With the truth beside it, at one frame; until then the note says how long it waits."""
    note = strike(pluck_of(small_preset, seconds=1.2))  # blocks of a quarter: two are left when it begins
    assert note.pending
    wait(lambda: note.waits_s > 0)
    assert not seconds_of(sound.mixer, 0.05).any()
    wait(lambda: not note.pending)
    assert note.waits_s == 0
    assert LEAST_S < note.ahead[0].rendered_s < 1.2
    seconds_of(sound.mixer, 0.02)
    assert {voice.began_frame for voice in note.voices.values()} == {note.began_frame}
    assert sound.mixer.new_gaps() == []
    notes.poll()
    assert notes.latencies_s == (), "rendering is no latency"


def test_a_model_that_is_rendered_fades_out_where_its_samples_end(
    notes: Notes, sound: Any, small_preset: Path, pluck_of: PluckOf, strike: Strike, wait: Wait
) -> None:
    note = strike(pluck_of(small_preset, seconds=0.5))
    wait(lambda: not note.pending and all(each.finished for each in note.ahead))
    heard = seconds_of(sound.mixer, 0.7)
    end = int(np.nonzero(np.abs(heard) > 1e-6)[0][-1])
    assert end == pytest.approx(0.5 * RATE_HZ, abs=0.005 * RATE_HZ)
    assert np.abs(heard[end - 2_400 : end - 1_200]).max() > 0.003, "it still rang"
    steps = np.abs(np.diff(heard, 2))
    assert steps[end - 100 : end + 100].max() < 0.2 * steps[end - 2_400 : end - 1_200].max()


def test_a_model_that_is_rendered_can_be_stopped_before_it_sounds(
    notes: Notes, sound: Any, small_preset: Path, pluck_of: PluckOf, strike: Strike, wait: Wait, slow_model: None
) -> None:
    note = strike(pluck_of(small_preset, seconds=5.0))
    wait(lambda: note.waits_s > 0)
    notes.stop()
    assert note.over
    assert note.waits_s == 0
    wait(lambda: notes._ahead._voices == [])
    assert not seconds_of(sound.mixer, 0.1).any()


def test_a_switch_while_a_model_is_rendered_counts(
    notes: Notes, sound: Any, small_preset: Path, pluck_of: PluckOf, strike: Strike, wait: Wait, slow_model: None
) -> None:
    note = strike(pluck_of(small_preset, seconds=0.4))
    notes.set_monitor(hears("truth"))
    wait(lambda: not note.pending)
    assert gains(note) == {"model": 0.0, "truth": 1.0}


def test_a_model_that_fails_is_reported(
    notes: Notes,
    small_preset: Path,
    pluck_of: PluckOf,
    strike: Strike,
    reports: Reports,
    wait: Wait,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(KoopmanVar, "encode", lambda *_: 1 / 0)
    note = strike(pluck_of(small_preset, position=0.41))
    wait(lambda: note.over and reports != [])
    assert "cannot be rendered" in reports[0][0]
    assert notes.ringing == 0


@pytest.mark.parametrize("which", ["bank", "small_preset"])
def test_notes_ring_on_where_the_device_changes_its_rate(
    notes: Notes,
    sound: Any,
    pluck_of: PluckOf,
    strike: Strike,
    wait: Wait,
    which: str,
    request: pytest.FixtureRequest,
) -> None:
    path = request.getfixturevalue(which)
    struck = [strike(pluck_of(path, position=0.3 + 0.05 * number)) for number in range(6)]
    wait(lambda: not any(note.pending for note in struck))
    waiting = strike(pluck_of(path), begin_frame=10 * RATE_HZ)
    seconds_of(sound.mixer, 0.2)
    sound.mixer = Mixer(44_100)
    notes.poll()
    assert [note.over for note in struck] == [True, True, False, False, False, False]
    assert waiting.over, "its frame will not come"
    wait(lambda: not any(note.pending for note in struck[2:]))
    assert np.abs(seconds_of(sound.mixer, 0.05)).max() > 0.01
    assert [note.seconds for note in struck[2:]] == pytest.approx([0.25] * 4, abs=4 * QUANTUM_S)
    assert notes.ringing == 4
    strike(pluck_of(path))
    notes.poll()
    assert notes.ringing == 5


def test_another_rate_while_a_model_is_rendered(
    notes: Notes, sound: Any, small_preset: Path, pluck_of: PluckOf, strike: Strike, wait: Wait, slow_model: None
) -> None:
    note = strike(pluck_of(small_preset, seconds=0.6))
    wait(lambda: note.waits_s > 0)
    sound.mixer = Mixer(44_100)
    wait(lambda: not note.pending)
    assert note.mixer is sound.mixer
    assert {voice.program.rate_hz for voice in note.voices.values()} == {44_100}
    assert np.abs(seconds_of(sound.mixer, 0.05)).max() > 0.01


def test_strikes_come_from_many_threads(
    notes: Notes, sound: Any, bank: Path, pluck_of: PluckOf, strike: Strike
) -> None:
    struck: list[Note] = []
    threads = [
        threading.Thread(
            target=lambda number=number: struck.append(strike(pluck_of(bank, position=0.3 + 0.02 * number)))
        )
        for number in range(12)
    ]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        sound.mixer.render(64)
    seconds_of(sound.mixer, 0.01)
    assert len(struck) == 12
    assert all(note.began for note in struck)
    assert notes.ringing == 12


def test_closed_it_is_silent_and_strikes_nothing_more_that_waits(
    notes: Notes, bank: Path, tmp_path: Path, pluck_of: PluckOf, strike: Strike
) -> None:
    notes.close()
    notes.close()
    note = strike(pluck_of(Path(shutil.copy(bank, tmp_path))))
    assert note.pending


@pytest.fixture
def string(notes: Notes, bank: Path, pluck_of: PluckOf, monkeypatch: pytest.MonkeyPatch) -> PluckRange:
    """The reach of a single string, which is the instrument."""
    entry = PresetEntry("bank", bank, read_info(bank), 0)
    monkeypatch.setattr(notes, "_find", {"bank": entry}.get)
    notes.choose(pluck_of(bank))
    notes.set_instrument(SingleString(preset="bank"), EAR)
    return PluckRange.of(entry.info)


def test_keys_of_a_single_string_are_places_along_it_and_ring(notes: Notes, sound: Any, string: PluckRange) -> None:
    """As a pluck by hand at that place; no release damps it."""
    begun = [notes.handle(NoteOn(key, 64)) for key in (LOWEST_PLACE, HIGHEST_PLACE)]
    plucks = [note.request.pluck for note in begun if note is not None]
    assert [pluck.position for pluck in plucks] == list(string.position)
    assert {pluck.amplitude_mm for pluck in plucks} == {string.amplitude_of(64)}
    assert notes.handle(NoteOff(LOWEST_PLACE)) is None
    assert notes.handle(NoteOn(LOWEST_PLACE, 0)) is None
    assert np.abs(seconds_of(sound.mixer, 0.5)[-1_000:]).max() > 1e-3
    assert notes.ringing == 2


def test_a_key_and_a_hand_at_one_place_sound_alike(notes: Notes, sound: Any, string: PluckRange) -> None:
    heard = []
    for event in (NoteOn(50, 64), PluckAt(string.pluck(50, 64, Pluck(0.35, 3.0)))):
        assert notes.handle(event) is not None
        heard.append(seconds_of(sound.mixer, 0.1))
        notes.stop()
        seconds_of(sound.mixer, 0.1)
    assert np.abs(heard[0]).max() > 0.001
    np.testing.assert_allclose(heard[0], heard[1], atol=1e-6)


def test_a_pluck_by_hand_keeps_its_place_where_a_single_string_is_chosen_meanwhile(
    notes: Notes, sound: Any, string: PluckRange
) -> None:
    by_hand = Pluck(0.44, 3.0)
    note = notes.handle(NoteOn(60, 90, pluck=by_hand))
    assert isinstance(note, Note) and note.request.pluck == by_hand


def test_a_pluck_at_a_place_waits_for_its_frame_and_can_be_cancelled(
    notes: Notes, sound: Any, string: PluckRange
) -> None:
    due = Due(sound.mixer, sound.mixer.frames + 6_400, 0.0)
    kept, cancelled = notes.handle(NoteOn(50, 64), due), notes.handle(NoteOn(55, 64), replace_frame(due, 20_000))
    assert kept is not None and cancelled is not None
    seconds_of(sound.mixer, 0.2)
    assert kept.began_frame == due.frame
    notes.cancel()
    seconds_of(sound.mixer, 0.5)
    assert (kept.over, cancelled.over, cancelled.began_frame) == (False, True, 0)


def replace_frame(due: Due, frames: int) -> Due:
    return Due(due.mixer, due.frame + frames, due.time_s)
