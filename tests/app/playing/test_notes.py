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
from app.playing import notes as module
from app.playing.ahead import LEAST_S
from app.playing.notes import Note, Notes
from app.playing.sources import Sources
from app.playing.stroke import Mix, Stroke
from engine.kernels import layout as at
from engine.kernels.layout import AHEAD
from engine.models import KoopmanVar
from engine.models.koopman_var import KoopmanState
from engine.presets import load_preset, save_preset
from engine.voices import Ear, Mixer, Voice

RATE_HZ = 48_000
QUANTUM_S = at.QUANTUM / RATE_HZ
Wait = Callable[[Callable[[], bool]], None]
StrokeOf = Callable[..., Stroke]
Reports = list[tuple[str, str]]


def gains(note: Note) -> dict[str, float]:
    """With which its voices sound, or fade to."""
    return {source: float(voice.memory[at.WANTED_GAIN]) for source, voice in note.voices.items()}


def seconds_of(mixer: Mixer, seconds: float) -> np.ndarray:
    """(frames,), left."""
    return mixer.render(round(seconds * mixer.rate_hz))[:, 0]


def alone(sources: Sources, stroke: Stroke, seconds: float) -> np.ndarray:
    """What a stroke of one source sounds like in a mixer of its own, (frames,)."""
    mixer, (source,) = Mixer(RATE_HZ), stroke.sources
    kind = "truth" if source == "truth" else "model"
    initial_m, begin = sources.begin(stroke.preset, kind, RATE_HZ, stroke.pluck)
    mixer.add(Voice(sources.program(stroke.preset, kind, RATE_HZ), initial_m, stroke.ear, begin=begin))
    return seconds_of(mixer, seconds)


def test_a_strike_sounds_with_the_next_frame(
    notes: Notes, sound: Any, bank: Path, stroke_of: StrokeOf, wait: Wait
) -> None:
    note = notes.strike(stroke_of(bank))
    assert not note.pending, "nobody was waited for"
    assert notes.ringing == 1
    began_s = sound.mixer.seconds
    out = seconds_of(sound.mixer, 0.05)
    assert np.abs(out).max() > 0.01
    assert out[:96].any()
    assert note.began_frame == round(began_s * RATE_HZ)
    assert note.seconds == pytest.approx(0.05, abs=QUANTUM_S)


def test_all_voices_of_a_note_begin_with_one_frame_and_one_is_heard(
    notes: Notes, sound: Any, bank: Path, stroke_of: StrokeOf
) -> None:
    note = notes.strike(stroke_of(bank))
    seconds_of(sound.mixer, 0.01)
    assert {voice.began_frame for voice in note.voices.values()} == {note.began_frame}
    assert {voice.seconds for voice in note.voices.values()} == {note.seconds}
    assert gains(note) == {"model": 1.0, "truth": 0.0}


def test_a_switch_sounds_as_if_the_other_had_been_heard_all_along(
    notes: Notes, sound: Any, sources: Sources, bank: Path, stroke_of: StrokeOf
) -> None:
    model, truth = (
        alone(sources, stroke_of(bank, 0.35, (name,), amplitude_mm=8.0), 0.4) for name in ("model", "truth")
    )
    note = notes.strike(stroke_of(bank, amplitude_mm=8.0))
    before, fade, after = (
        slice(round(a * RATE_HZ), round(b * RATE_HZ)) for a, b in ((0, 0.2), (0.2, 0.25), (0.25, 0.4))
    )
    np.testing.assert_allclose(seconds_of(sound.mixer, 0.2), model[before], atol=1e-6)
    notes.set_mix(Mix("truth"))
    between = seconds_of(sound.mixer, 0.05)
    lowest, highest = np.minimum(model[fade], truth[fade]), np.maximum(model[fade], truth[fade])
    assert (between > lowest - 1e-6).all()
    assert (between < highest + 1e-6).all()
    np.testing.assert_allclose(seconds_of(sound.mixer, 0.15), truth[after], atol=1e-6)
    assert np.abs(model[after] - truth[after]).max() > 5e-6
    notes.set_mix(Mix("difference", difference_gain_db=20.0))
    assert gains(note) == pytest.approx({"model": 10.0, "truth": -10.0})
    notes.set_mix(Mix())
    assert gains(note) == {"model": 1.0, "truth": 0.0}


def test_plucks_ring_beside_each_other(
    notes: Notes, sound: Any, sources: Sources, bank: Path, stroke_of: StrokeOf
) -> None:
    strokes = [stroke_of(bank, position=position, sources=("model",)) for position in (0.3, 0.5)]
    for stroke in strokes:
        notes.strike(stroke)
    out = seconds_of(sound.mixer, 0.1)
    np.testing.assert_allclose(out, sum(alone(sources, stroke, 0.1) for stroke in strokes), atol=1e-6)


def test_the_oldest_notes_end_where_there_are_too_many(
    notes: Notes, sound: Any, bank: Path, stroke_of: StrokeOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MOST_NOTES", 3)
    struck = []
    for number in range(5):
        struck.append(notes.strike(stroke_of(bank, position=0.3 + 0.05 * number)))
        seconds_of(sound.mixer, 0.01)
    assert [note.released for note in struck] == [True, True, False, False, False]
    assert notes.ringing == 3
    seconds_of(sound.mixer, 0.1)
    assert [note.over for note in struck] == [True, True, False, False, False]
    notes.poll()
    assert len(notes._notes) == 3


def test_where_the_device_has_no_time_left_notes_end(
    notes: Notes, sound: Any, bank: Path, stroke_of: StrokeOf
) -> None:
    struck = [notes.strike(stroke_of(bank)) for _ in range(6)]
    sound.take_care()
    assert notes.ringing == 6
    sound.load = 0.9
    sound.take_care()
    assert [note.released for note in struck] == [True, True, False, False, False, False]
    for _ in range(6):
        sound.take_care()
    assert not struck[-1].released, "one always rings"


def test_the_more_is_asked_of_the_device_the_more_notes_end_at_once(
    notes: Notes, sound: Any, bank: Path, stroke_of: StrokeOf
) -> None:
    struck = [notes.strike(stroke_of(bank)) for _ in range(16)]
    sound.load = 1.5
    sound.take_care()
    assert [note.released for note in struck] == [True] * 8 + [False] * 8


def test_notes_end_under_load_while_the_window_hangs(
    sources: Sources, bank: Path, stroke_of: StrokeOf, wait: Wait
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
        notes = Notes(sound, sources, lambda message, detail: None)
        try:
            struck = [notes.strike(stroke_of(bank)) for _ in range(6)]
            wait(lambda: sound.status().load == laden)
            assert notes.ringing == 6
            laden = 0.9
            wait(lambda: notes.ringing == 1)
            wait(lambda: all(note.over for note in struck[:-1]))
            laden = 0.2
            assert not struck[-1].over
        finally:
            notes.close()


def test_stop_ends_all_without_a_click(notes: Notes, sound: Any, bank: Path, stroke_of: StrokeOf) -> None:
    struck = [notes.strike(stroke_of(bank, amplitude_mm=5.0)) for _ in range(2)]
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


def test_a_note_rings_until_it_is_silent(notes: Notes, sound: Any, bank: Path, stroke_of: StrokeOf) -> None:
    """Not until some number of seconds."""
    note = notes.strike(stroke_of(bank, seconds=0.1))
    assert np.abs(seconds_of(sound.mixer, 1.0)[-1_000:]).max() > 1e-3
    for _ in range(60):
        if note.over:
            break
        out = seconds_of(sound.mixer, 1.0)
    assert note.over
    assert np.abs(out).max() < 1e-3


def test_a_preset_that_is_not_there_yet_is_loaded_and_sounds(
    notes: Notes, sound: Any, bank: Path, tmp_path: Path, stroke_of: StrokeOf, wait: Wait
) -> None:
    path = Path(shutil.copy(bank, tmp_path))
    note = notes.strike(stroke_of(path))
    assert notes.ringing == 1
    assert note.seconds == 0
    wait(lambda: not note.pending)
    assert np.abs(seconds_of(sound.mixer, 0.05)).max() > 0.01
    again = notes.strike(stroke_of(path, position=0.6))
    assert not again.pending


def test_what_is_prepared_is_not_waited_for(
    notes: Notes, sources: Sources, bank: Path, tmp_path: Path, stroke_of: StrokeOf, wait: Wait
) -> None:
    path = Path(shutil.copy(bank, tmp_path))
    assert not notes.have(stroke_of(path))
    notes.prepare(path, bank)
    wait(lambda: notes.have(stroke_of(path)))
    assert not notes.strike(stroke_of(path)).pending


def test_what_waits_hears_of_switches_and_of_stop(
    notes: Notes, sound: Any, sources: Sources, bank: Path, tmp_path: Path, stroke_of: StrokeOf, wait: Wait
) -> None:
    holding = threading.Event()
    try:
        notes._submit(lambda: holding.wait(20) and None)
        kept, stopped = (notes.strike(stroke_of(Path(shutil.copy(bank, tmp_path / name)))) for name in "ab")
        stopped.release(0.01)
        notes.set_mix(Mix("truth"))
    finally:
        holding.set()
    wait(lambda: not kept.pending)
    assert gains(kept) == {"model": 0.0, "truth": 1.0}
    notes.stop()
    waiting = notes.strike(stroke_of(bank), from_s=0.1)
    notes.stop()
    done = threading.Event()
    notes._submit(done.set)
    assert done.wait(20)
    assert stopped.over
    assert waiting.released
    seconds_of(sound.mixer, 0.1)
    assert not seconds_of(sound.mixer, 0.1).any()


def test_a_preset_that_cannot_be_played_is_told(
    notes: Notes, sound: Any, tmp_path: Path, stroke_of: StrokeOf, reports: Reports, wait: Wait
) -> None:
    (tmp_path / "broken.safetensors").write_bytes(b"damaged")
    note = notes.strike(stroke_of(tmp_path / "broken.safetensors"))
    wait(lambda: reports != [])
    wait(lambda: note.over)
    ((message, detail),) = reports
    assert "broken.safetensors" in message
    assert detail == ""
    assert notes.ringing == 0
    assert note.waits_s == 0


def test_what_cannot_be_played_beside_a_preset_does_not_hinder_it(
    notes: Notes, sound: Any, bank: Path, tmp_path: Path, stroke_of: StrokeOf, reports: Reports, wait: Wait
) -> None:
    broken = tmp_path / "broken.safetensors"
    broken.write_bytes(b"damaged")
    for _ in range(2):
        note = notes.strike(stroke_of(bank, sources=("model", "preset:broken"), others={"preset:broken": broken}))
        wait(lambda note=note: not note.pending)  # type: ignore[misc]
        assert set(note.voices) == {"model"}
    assert np.abs(seconds_of(sound.mixer, 0.05)).max() > 0.01
    assert reports == []


def test_another_preset_sounds_at_its_own_rate_in_step(
    notes: Notes, sound: Any, sources: Sources, bank: Path, tmp_path: Path, stroke_of: StrokeOf, wait: Wait
) -> None:
    other = Path(shutil.copy(bank, tmp_path / "other.safetensors"))
    notes.prepare(other)
    stroke = stroke_of(bank, sources=("model", "preset:other"), others={"preset:other": other})
    wait(lambda: notes.have(stroke))
    notes.set_mix(Mix("preset:other"))
    note = notes.strike(stroke)
    assert gains(note) == {"model": 0.0, "preset:other": 1.0}
    expected = alone(sources, stroke_of(bank, sources=("model",)), 0.1)
    np.testing.assert_allclose(seconds_of(sound.mixer, 0.1), expected, atol=1e-6)


def test_levels_are_matched_once_they_are_known(
    notes: Notes, sound: Any, sources: Sources, bank: Path, tmp_path: Path, stroke_of: StrokeOf, wait: Wait
) -> None:
    """To the truth's, without the limiter, which a loud pluck would not pass."""
    preset = load_preset(bank)
    loud = tmp_path / "loud.safetensors"
    with torch.no_grad():
        preset.model.decoder.weight.mul_(12.0)  # type: ignore[union-attr, operator]
    save_preset(loud, preset.info, preset.model)
    notes.prepare(loud)
    stroke = stroke_of(loud, amplitude_mm=8.0)
    wait(lambda: notes.have(stroke))
    note = notes.strike(stroke)
    assert note.match is None
    notes.set_mix(Mix("model", matched=True))  # while it rings
    wait(lambda: note.match is not None and gains(note) == {"model": note.match["model"], "truth": 0.0})
    assert note.match is not None
    assert note.match["truth"] == 1.0
    assert note.match["model"] == pytest.approx(1 / 12, rel=0.02)
    again = notes.strike(stroke)
    assert again.match == note.match, "it is known from the start"
    assert gains(again) == gains(note)
    notes.set_mix(Mix("model"))
    assert gains(again)["model"] == 1.0


@pytest.mark.parametrize("seconds", [0.5, 1.5])
def test_levels_of_a_model_that_is_rendered_are_matched_when_enough_is_there(
    notes: Notes, small_preset: Path, stroke_of: StrokeOf, wait: Wait, seconds: float
) -> None:
    """All of it, where that is short."""
    notes.set_mix(Mix("model", matched=True))
    note = notes.strike(stroke_of(small_preset, position=0.43, seconds=seconds))
    wait(lambda: not note.pending)

    def matched() -> bool:
        notes.poll()
        return note.match is not None

    wait(matched)
    assert note.match is not None
    assert note.match["model"] == pytest.approx(1.0, abs=0.3)
    assert note.match["model"] != 1.0


def test_a_listening_point_moves_while_it_rings(
    notes: Notes, sound: Any, sources: Sources, bank: Path, stroke_of: StrokeOf
) -> None:
    notes.strike(stroke_of(bank, sources=("model",)))
    seconds_of(sound.mixer, 0.1)
    notes.listen(Ear((0.15,)))
    notes.poll()
    seconds_of(sound.mixer, 0.1)
    out = seconds_of(sound.mixer, 0.1)
    expected = alone(sources, stroke_of(bank, sources=("model",), ear=Ear((0.15,))), 0.3)
    np.testing.assert_allclose(out, expected[-len(out) :], atol=1e-5)


def test_latencies_are_noted_once_a_note(notes: Notes, sound: Any, bank: Path, stroke_of: StrokeOf) -> None:
    notes.strike(stroke_of(bank))
    notes.poll()
    assert notes.latencies_s == ()
    seconds_of(sound.mixer, 0.01)
    notes.poll()
    notes.poll()
    limiter_s = pytest.approx(AHEAD / RATE_HZ)
    assert notes.latencies_s == (limiter_s,), "by this clock it began when it was struck"
    later = notes.strike(stroke_of(bank), begin_frame=round(0.05 * RATE_HZ))
    seconds_of(sound.mixer, 0.1)
    notes.poll()
    assert later.seconds > 0
    assert len(notes.latencies_s) == 1, "a turn of a loop is no gesture"


def test_a_note_waits_for_its_frame(notes: Notes, sound: Any, bank: Path, stroke_of: StrokeOf) -> None:
    first = notes.strike(stroke_of(bank))
    seconds_of(sound.mixer, 0.1)
    frame = first.frame_at(0.2)
    second = notes.strike(stroke_of(bank), begin_frame=frame)
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
    stroke_of: StrokeOf,
    wait: Wait,
    which: str,
    request: pytest.FixtureRequest,
) -> None:
    """Also where the model is rendered first: it is in step with the truth."""
    path = request.getfixturevalue(which)
    whole = {}
    for name in ("model", "truth"):
        notes.set_mix(Mix(name))
        struck = notes.strike(stroke_of(path))
        wait(lambda struck=struck: struck.began or (not struck.pending and all(a.finished for a in struck.ahead)))  # type: ignore[misc]
        whole[name] = sound.mixer.render(500 * at.QUANTUM)[:, 0]
        notes.stop()
        sound.mixer.render(50 * at.QUANTUM)
    before = notes.strike(stroke_of(path))
    note = notes.strike(stroke_of(path), from_s=0.4, alone=True)
    assert before.released
    assert note.seconds == 0.4, "the playhead is there at once"
    wait(lambda: not note.pending)
    sound.mixer.render(40 * at.QUANTUM)
    assert note.seconds == pytest.approx(0.4 + 40 * QUANTUM_S, abs=QUANTUM_S)
    assert len({voice.seconds for voice in note.voices.values()}) == 1
    for name in ("model", "truth"):
        notes.set_mix(Mix(name))
        sound.mixer.render(30 * at.QUANTUM)
        place = round(note.seconds * RATE_HZ)
        out = sound.mixer.render(10 * at.QUANTUM)[:, 0]
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
    notes: Notes, sound: Any, small_preset: Path, stroke_of: StrokeOf, wait: Wait, slow_model: None
) -> None:
    """With the truth beside it, at one frame; until then the note says how long it waits."""
    note = notes.strike(stroke_of(small_preset, seconds=1.2))  # blocks of a quarter: two are left when it begins
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
    notes: Notes, sound: Any, small_preset: Path, stroke_of: StrokeOf, wait: Wait
) -> None:
    note = notes.strike(stroke_of(small_preset, seconds=0.5, sources=("model",)))
    wait(lambda: not note.pending and all(each.finished for each in note.ahead))
    heard = seconds_of(sound.mixer, 0.7)
    end = int(np.nonzero(np.abs(heard) > 1e-6)[0][-1])
    assert end == pytest.approx(0.5 * RATE_HZ, abs=0.005 * RATE_HZ)
    assert np.abs(heard[end - 2_400 : end - 1_200]).max() > 0.003, "it still rang"
    steps = np.abs(np.diff(heard, 2))
    assert steps[end - 100 : end + 100].max() < 0.2 * steps[end - 2_400 : end - 1_200].max()


def test_a_model_that_is_rendered_can_be_stopped_before_it_sounds(
    notes: Notes, sound: Any, small_preset: Path, stroke_of: StrokeOf, wait: Wait, slow_model: None
) -> None:
    note = notes.strike(stroke_of(small_preset, seconds=5.0))
    wait(lambda: note.waits_s > 0)
    notes.stop()
    assert note.over
    assert note.waits_s == 0
    wait(lambda: notes._ahead._voices == [])
    assert not seconds_of(sound.mixer, 0.1).any()


def test_a_switch_while_a_model_is_rendered_counts(
    notes: Notes, sound: Any, small_preset: Path, stroke_of: StrokeOf, wait: Wait, slow_model: None
) -> None:
    note = notes.strike(stroke_of(small_preset, seconds=0.4))
    notes.set_mix(Mix("truth"))
    wait(lambda: not note.pending)
    assert gains(note) == {"model": 0.0, "truth": 1.0}


def test_a_model_that_fails_is_told(
    notes: Notes,
    small_preset: Path,
    stroke_of: StrokeOf,
    reports: Reports,
    wait: Wait,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(KoopmanVar, "encode", lambda *_: 1 / 0)
    note = notes.strike(stroke_of(small_preset, position=0.41))
    wait(lambda: note.over and reports != [])
    assert "cannot be rendered" in reports[0][0]
    assert notes.ringing == 0


@pytest.mark.parametrize("which", ["bank", "small_preset"])
def test_notes_ring_on_where_the_device_changes_its_rate(
    notes: Notes, sound: Any, stroke_of: StrokeOf, wait: Wait, which: str, request: pytest.FixtureRequest
) -> None:
    path = request.getfixturevalue(which)
    struck = [notes.strike(stroke_of(path, position=0.3 + 0.05 * number)) for number in range(6)]
    wait(lambda: not any(note.pending for note in struck))
    waiting = notes.strike(stroke_of(path), begin_frame=10 * RATE_HZ)
    seconds_of(sound.mixer, 0.2)
    sound.mixer = Mixer(44_100)
    notes.poll()
    assert [note.over for note in struck] == [True, True, False, False, False, False]
    assert waiting.over, "its frame will not come"
    wait(lambda: not any(note.pending for note in struck[2:]))
    assert np.abs(seconds_of(sound.mixer, 0.05)).max() > 0.01
    assert [note.seconds for note in struck[2:]] == pytest.approx([0.25] * 4, abs=4 * QUANTUM_S)
    assert notes.ringing == 4
    notes.strike(stroke_of(path))
    notes.poll()
    assert notes.ringing == 5


def test_another_rate_while_a_model_is_rendered(
    notes: Notes, sound: Any, small_preset: Path, stroke_of: StrokeOf, wait: Wait, slow_model: None
) -> None:
    note = notes.strike(stroke_of(small_preset, seconds=0.6))
    wait(lambda: note.waits_s > 0)
    sound.mixer = Mixer(44_100)
    wait(lambda: not note.pending)
    assert note.mixer is sound.mixer
    assert {voice.program.rate_hz for voice in note.voices.values()} == {44_100}
    assert np.abs(seconds_of(sound.mixer, 0.05)).max() > 0.01


def test_a_pluck_for_a_file_is_rendered_without_a_device(
    notes: Notes, sources: Sources, sound: Any, bank: Path, small_preset: Path, stroke_of: StrokeOf
) -> None:
    found = notes.render(stroke_of(bank, ear=Ear((0.37, 0.6))), RATE_HZ, 0.2).result(30)
    assert {name: samples.shape for name, samples in found.items()} == dict.fromkeys(
        ("model", "truth"), (round(0.2 * RATE_HZ), 2)
    )
    heard = alone(sources, stroke_of(bank, sources=("model",)), 0.2)
    np.testing.assert_allclose(found["model"][:-AHEAD, 0], heard[AHEAD:], atol=1e-6)
    rendered = notes.render(stroke_of(small_preset), RATE_HZ, 0.2).result(30)
    assert np.abs(rendered["model"]).max() > 0.01
    assert not sound.mixer.voices


def test_strikes_come_from_many_threads(notes: Notes, sound: Any, bank: Path, stroke_of: StrokeOf) -> None:
    struck: list[Note] = []
    threads = [
        threading.Thread(
            target=lambda number=number: struck.append(notes.strike(stroke_of(bank, position=0.3 + 0.02 * number)))
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
    notes: Notes, bank: Path, tmp_path: Path, stroke_of: StrokeOf
) -> None:
    notes.close()
    notes.close()
    note = notes.strike(stroke_of(Path(shutil.copy(bank, tmp_path))))
    assert note.pending
