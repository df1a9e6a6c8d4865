"""Notes: struck, switched, listened to, matched, ended; and sent to no device, but to a mixer that the test turns."""

import shutil
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from app.instruments.library import SHIPPED as INSTRUMENTS
from app.instruments.library import read_instrument
from app.player.compiled import InstrumentPlayer
from app.player.events import NoteOff, NoteOn, PluckAt
from app.playing import notes as module
from app.playing.ahead_samples import LEAST_S
from app.playing.key_note import DROPPED, KeyNote
from app.playing.keyboard import HIGHEST_PLACE, LOWEST_PLACE
from app.playing.note import PluckVoices
from app.playing.notes import Notes
from app.playing.playback import Due
from app.playing.sources import Sources
from engine.kernels.constants import AHEAD, QUANTUM
from engine.models.koopman_var import KoopmanVar
from engine.pluck import Pluck
from engine.presets import load_preset, save_preset
from engine.values.ear import Ear
from engine.voices import Mixer, Voice
from tests.app.monitors import find_shipped, hears
from tests.app.playing.conftest import EAR

RATE_HZ = 48_000
QUANTUM_S = QUANTUM / RATE_HZ


def gains(note: PluckVoices) -> dict[str, float]:
    """With which its voices sound, or fade to."""
    return {source: float(voice.record["wanted_gain"]) for source, voice in note.voices.items()}


def test_a_strike_sounds_with_the_next_frame_or_its_own_and_its_voices_are_in_step(lab):
    note, began_s = lab.strike(), lab.mixer.seconds
    assert not note.pending and lab.notes.ringing == 1, "nobody was waited for"
    out = lab.hear(0.05)
    assert np.abs(out).max() > 0.01 and out[:96].any()
    assert note.began_frame == round(began_s * RATE_HZ) and note.seconds == pytest.approx(0.05, abs=QUANTUM_S)
    assert {(each.began_frame, each.seconds) for each in note.voices.values()} == {(note.began_frame, note.seconds)}
    assert gains(note) == {"model": 1.0, "truth": 0.0}
    frame = note.frame_at(0.2)
    second = lab.strike(begin_frame=frame)
    note.release_at(frame)
    assert not second.began
    lab.hear(0.3)
    assert second.began_frame == frame == note.began_frame + round(0.2 * RATE_HZ) and note.over


def test_a_switch_sounds_as_if_the_other_had_been_heard_all_along(lab):
    loud = lab.pluck_of(amplitude_mm=8.0)
    model, truth = (lab.alone(loud, 0.4, name) for name in ("model", "truth"))
    note = lab.strike(loud)
    np.testing.assert_allclose(lab.hear(0.2), model[:9_600], atol=1e-6)
    lab.notes.set_monitor(hears("truth"))
    between, fade = lab.hear(0.05), slice(9_600, 12_000)
    assert (between > np.minimum(model[fade], truth[fade]) - 1e-6).all()
    assert (between < np.maximum(model[fade], truth[fade]) + 1e-6).all()
    np.testing.assert_allclose(lab.hear(0.15), truth[12_000:], atol=1e-6)
    assert np.abs(model[12_000:] - truth[12_000:]).max() > 5e-6
    lab.notes.set_monitor(hears("difference", difference_gain_db=20.0))
    assert gains(note) == pytest.approx({"model": 10.0, "truth": -10.0})


def test_plucks_ring_beside_each_other_and_are_heard_where_the_listener_is(lab):
    plucks = [lab.pluck_of(position=position) for position in (0.3, 0.5)]
    for pluck in plucks:
        lab.strike(pluck)
    expected = sum(lab.alone(pluck, 0.1) for pluck in plucks)
    np.testing.assert_allclose(lab.hear(0.1), expected, atol=1e-6)
    lab.notes.listen(Ear((0.15,)))
    lab.notes.poll()
    out = lab.hear(0.2)[4_800:]
    expected = sum(lab.alone(replace(pluck, ear=Ear((0.15,))), 0.3) for pluck in plucks)
    np.testing.assert_allclose(out, expected[-len(out) :], atol=2e-5)


def test_another_preset_sounds_at_its_own_rate_in_step(lab, tmp_path):
    other = Path(shutil.copy(lab.bank, tmp_path / "other.safetensors"))
    lab.notes.set_monitor(hears("preset:other", "model"))
    lab.notes.choose(lab.pluck_of(others=(other,)))
    assert not lab.notes.at_hand
    lab.notes.prepare(other)
    lab.wait(lambda: lab.notes.at_hand)
    note = lab.strike(others=(other,))
    assert gains(note) == {"model": 0.0, "preset:other": 1.0}
    np.testing.assert_allclose(lab.hear(0.1), lab.alone(lab.pluck_of(), 0.1), atol=1e-6)


@pytest.mark.parametrize("which", ["bank", "small_preset"])
def test_a_seek_begins_in_the_middle_alone(lab, which, request):
    path, whole = request.getfixturevalue(which), {}
    for name in ("model", "truth"):
        lab.notes.set_monitor(hears(name))
        struck = lab.strike(path)
        lab.wait(lambda note=struck: note.began or (not note.pending and all(each.finished for each in note.ahead)))  # type: ignore[misc]
        whole[name] = lab.mixer.render(500 * QUANTUM)[:, 0]
        lab.notes.stop()
        lab.mixer.render(50 * QUANTUM)
    before, note = lab.strike(path), lab.strike(path, from_s=0.4, alone=True)
    assert before.released and note.seconds == 0.4, "the playhead is there at once"
    lab.wait(lambda: not note.pending)
    lab.mixer.render(40 * QUANTUM)
    (seconds,) = {voice.seconds for voice in note.voices.values()}
    assert seconds == pytest.approx(0.4 + 40 * QUANTUM_S, abs=QUANTUM_S)
    for name in ("model", "truth"):
        lab.notes.set_monitor(hears(name))
        lab.mixer.render(30 * QUANTUM)
        place, out = round(note.seconds * RATE_HZ), lab.mixer.render(10 * QUANTUM)[:, 0]
        np.testing.assert_allclose(out, whole[name][place : place + len(out)], atol=1e-6)
    assert note.frame_at(1.0) == note.began_frame + round(0.6 * RATE_HZ)


def look(sound: Any, load: float, times: int = 1) -> None:
    """The sound's thread looks at the load of a device that has taken a quantum since."""
    sound.load = load
    for _ in range(times):
        sound.mixer.render(QUANTUM)
        sound.take_care()


@pytest.mark.parametrize(("load", "struck", "ends"), [(0.9, 6, 2), (1.5, 16, 8)])
def test_where_the_device_has_no_time_the_oldest_notes_end(lab, load, struck, ends):
    """Nobody polls. Bursts of other programs end none: the next callbacks lower the mean load again."""
    rings = [lab.strike() for _ in range(struck)]
    for burst in (*[0.3, 12.0, 4.0, 1.1, 0.8] * 8, 0.3, *[7.0] * (module.LOOKS - 1), 0.3, 7.0):
        look(lab.sound, burst)
    for _ in range(3 * module.LOOKS):
        lab.sound.take_care()  # while the device is not called, this is no new load
    look(lab.sound, 0.3)
    look(lab.sound, load, module.LOOKS - 1)
    assert lab.notes.ringing == struck
    look(lab.sound, load)
    assert [note.released for note in rings] == [True] * ends + [False] * (struck - ends)
    look(lab.sound, load, struck * module.LOOKS)
    assert not rings[-1].released, "one always rings"


def test_the_oldest_notes_end_where_there_are_too_many(lab, monkeypatch):
    monkeypatch.setattr(module, "MOST_NOTES", 3)
    struck = []
    for number in range(5):
        struck.append(lab.strike(position=0.3 + 0.05 * number))
        lab.hear(0.01)
    assert [note.released for note in struck] == [True, True, False, False, False] and lab.notes.ringing == 3
    lab.hear(0.1)
    assert [note.over for note in struck] == [True, True, False, False, False]


def test_stop_ends_all_without_a_click(lab, tmp_path):
    struck = [lab.strike(amplitude_mm=5.0) for _ in range(2)]
    loud = lab.hear(0.1)
    lab.notes.stop()
    end = lab.hear(0.1)
    assert np.abs(np.diff(np.concatenate([loud[-10:], end]))).max() <= 1.2 * np.abs(np.diff(loud)).max()
    assert not end[round((module.STOP_S + 2 * QUANTUM_S) * RATE_HZ) :].any()
    lab.notes.poll()
    lab.mixer.forget_ended()
    assert lab.notes.ringing == 0 and all(note.over for note in struck) and lab.mixer.voices == []
    for _ in range(2):
        lab.notes.close()
    assert lab.strike(Path(shutil.copy(lab.bank, tmp_path))).pending


def test_what_waits_hears_of_switches_and_of_stop(lab, tmp_path):
    holding, done = threading.Event(), threading.Event()
    lab.notes.in_background(lambda: holding.wait(20) and None)
    kept, stopped = (lab.strike(Path(shutil.copy(lab.bank, tmp_path / name))) for name in "ab")
    stopped.release(0.01)
    lab.notes.set_monitor(hears("truth"))
    holding.set()
    lab.wait(lambda: not kept.pending)
    assert gains(kept) == {"model": 0.0, "truth": 1.0}
    waiting = lab.strike(from_s=0.1)
    lab.notes.stop()
    lab.notes.in_background(done.set)
    assert done.wait(20)
    assert stopped.over and waiting.released
    lab.hear(0.1)
    assert not lab.hear(0.1).any()


def test_a_preset_that_cannot_be_played_is_reported_and_hinders_no_other(lab, tmp_path):
    broken = tmp_path / "broken.safetensors"
    broken.write_bytes(b"damaged")
    lab.notes.set_monitor(hears("model", "preset:broken"))
    note = lab.strike(others=(broken,))
    lab.wait(lambda: not note.pending)
    assert set(note.voices) == {"model"} and lab.reports == []
    assert np.abs(lab.hear(0.05)).max() > 0.01
    lab.notes.stop()
    alone = lab.strike(broken)
    lab.wait(lambda: alone.over and lab.reports != [])
    ((message, detail),) = lab.reports
    assert "broken.safetensors" in message and detail == ""
    assert lab.notes.ringing == alone.waits_s == 0


@pytest.mark.parametrize(
    ("loudness", "gain"), [(12.0, 1 / 12), (1 / 80, 80.0), (1 / 120, 1.0), (120.0, 1.0), (0.0, 1.0)]
)
def test_levels_are_matched_once_they_are_known(lab, tmp_path, loudness, gain):
    """To the truth's, without the limiter, which a loud pluck would not pass; but no more than 40 dB off."""
    preset, path = load_preset(lab.bank), tmp_path / "loud.safetensors"
    with torch.no_grad():
        preset.model.decoder.weight.mul_(loudness)  # type: ignore[union-attr, operator]
    save_preset(path, preset.info, preset.model)
    pluck = lab.pluck_of(path, amplitude_mm=8.0)
    lab.notes.prepare(path)
    lab.notes.choose(pluck)
    lab.wait(lambda: lab.notes.at_hand)
    note = lab.strike(pluck)
    assert note.match is None
    lab.notes.set_monitor(hears("model", level_match=True))  # while it rings
    lab.wait(lambda: lab.notes.poll() is None and note.match and gains(note) == {**note.match, "truth": 0.0})
    assert note.match == {"truth": 1.0, "model": pytest.approx(gain, rel=0.02)}
    again = lab.strike(pluck)
    assert again.match == note.match and gains(again) == gains(note), "it is known from the start"
    lab.notes.set_monitor(hears("model"))
    assert gains(again)["model"] == 1.0


def test_latencies_are_noted_once_a_note_unless_they_cannot_be(lab):
    """The clock of gestures and that of the device's calls may have two bases, or one of them none."""
    lab.strike()
    found = [lab.notes.latencies_s]
    for begin_frame in (0, round(0.05 * RATE_HZ)):
        if begin_frame:
            lab.strike(begin_frame=begin_frame)  # a turn of a loop is no gesture
        lab.hear(0.1)
        for _ in range(2):
            lab.notes.poll()
        found.append(lab.notes.latencies_s)
    noted = (pytest.approx(AHEAD / RATE_HZ),)
    assert found == [(), noted, noted], "by this clock it began when it was struck"
    for now_s in (1.795774879e9, -20.0, float("nan"), float("inf"), 0.0, -1e300):
        lab.sound.now_s = lambda now_s=now_s: now_s
        note = lab.strike()
        lab.hear(0.01)
        lab.notes.poll()
        assert note.began and note.latency_s is None and lab.notes.latencies_s == noted


@pytest.fixture
def slow_model(monkeypatch: pytest.MonkeyPatch) -> None:
    """The small preset's model makes a second of sound in two."""
    advance = KoopmanVar.advance

    def slow(self: KoopmanVar, state: Any, steps: int, readout: torch.Tensor | None = None) -> Any:
        time.sleep(steps / 2_000)
        return advance(self, state, steps, readout)

    monkeypatch.setattr(KoopmanVar, "advance", slow)


def test_a_model_that_is_rendered_begins_when_enough_is_there(lab, slow_model):
    note = lab.strike(lab.small_preset, seconds=1.2)  # blocks of a quarter: two are left when it begins
    lab.wait(lambda: note.waits_s > 0)
    lab.notes.set_monitor(hears("truth"))
    assert note.pending and not lab.hear(0.05).any()
    lab.wait(lambda: not note.pending)
    assert note.waits_s == 0 and LEAST_S < note.ahead[0].rendered_s < 1.2
    assert gains(note) == {"model": 0.0, "truth": 1.0}
    lab.hear(0.02)
    assert {voice.began_frame for voice in note.voices.values()} == {note.began_frame}
    lab.notes.poll()
    assert lab.mixer.new_gaps() == [] and lab.notes.latencies_s == (), "rendering is no latency"


@pytest.mark.parametrize("which", ["bank", "small_preset"])
def test_notes_ring_on_where_the_device_changes_its_rate(lab, which, request):
    path = request.getfixturevalue(which)
    struck = [lab.strike(path, position=0.3 + 0.05 * number) for number in range(6)]
    lab.wait(lambda: not any(note.pending or note.unfinished for note in struck))
    waiting = lab.strike(path, begin_frame=10 * RATE_HZ)
    lab.hear(0.2)
    lab.mixer = Mixer(44_100)
    lab.notes.poll()
    assert [note.over for note in struck] == [True, True, False, False, False, False]
    assert waiting.over, "its frame will not come"
    lab.wait(lambda: not any(note.pending for note in struck[2:]))
    assert np.abs(lab.hear(0.05)).max() > 0.01
    assert [note.seconds for note in struck[2:]] == pytest.approx([0.25] * 4, abs=4 * QUANTUM_S)
    lab.strike(path)
    assert lab.notes.ringing == 5


def test_keys_of_a_single_string_are_places_along_it_and_ring(lab):
    reach, by_hand = lab.play_string(), Pluck(0.44, 3.0)
    struck = (NoteOn(LOWEST_PLACE, 64), NoteOn(HIGHEST_PLACE, 64), NoteOn(60, 90, pluck=by_hand), PluckAt(by_hand))
    plucks = [note.request.pluck for event in struck if isinstance(note := lab.notes.handle(event), PluckVoices)]
    assert [pluck.position for pluck in plucks[:2]] == list(reach.position) and plucks[2:] == [by_hand, by_hand]
    assert {pluck.amplitude_mm for pluck in plucks[:2]} == {reach.amplitude_of(64)}
    assert lab.notes.handle(NoteOff(LOWEST_PLACE)) is lab.notes.handle(NoteOn(LOWEST_PLACE, 0)) is None
    assert np.abs(lab.hear(0.5)[-1_000:]).max() > 1e-3 and lab.notes.ringing == 4


def test_a_pluck_at_a_place_waits_for_its_frame_and_can_be_cancelled(lab):
    lab.play_string()
    frame = lab.mixer.frames + 6_400
    kept, cancelled = (lab.notes.handle(NoteOn(50, 64), Due(lab.mixer, frame + late, 0.0)) for late in (0, 20_000))
    assert kept is not None and cancelled is not None
    lab.hear(0.2)
    assert kept.began_frame == frame
    lab.notes.cancel()
    lab.hear(0.5)
    assert (kept.over, cancelled.over, cancelled.began_frame) == (False, True, 0)


# A fault costs one note: it is reported in plain words, and all others play on


def once(work: Callable[..., Any], at: int) -> Callable[..., Any]:
    """`work`, which fails when it is done for the time `at`, from 1."""
    times = [0]

    def failing(*values: Any, **named: Any) -> Any:
        times[0] += 1
        if times[0] == at:
            raise ZeroDivisionError("a mistake")
        return work(*values, **named)

    return failing


def is_loud(sound: Any) -> bool:
    return bool(np.abs(sound.mixer.render(2048)).max() > 1e-3)


@pytest.mark.parametrize(("kind", "name"), [(InstrumentPlayer, "handle"), (KeyNote, "take")])
def test_a_key_that_fails_costs_its_own_note(lab, monkeypatch, kind, name):
    notes = Notes(lab.sound, Sources(), find_shipped, lambda message, details: lab.reports.append((message, details)))
    notes.set_monitor(hears("model"))
    notes.set_instrument(read_instrument(INSTRUMENTS / "classical_guitar.json"), EAR)
    lab.wait(lambda: notes.keys.player is not None)
    monkeypatch.setattr(kind, name, once(getattr(kind, name), at=2))
    begun = []
    for key in (45, 50, 55):
        begun.append(notes.handle(NoteOn(key, 100)))
        lab.mixer.render(128)
        lab.sound.take_care()
        notes.poll()
    assert [message for message, _ in lab.reports] == [DROPPED] and "a mistake" in lab.reports[0][1]
    assert [note.event.key for note in begun if isinstance(note, KeyNote) and not note.over] == [45, 55]
    assert is_loud(lab.sound)
    for key in (45, 50, 55):
        notes.handle(NoteOff(key))
    notes.stop()
    lab.mixer.render(48_000)
    assert notes.ringing == 0 and np.abs(lab.mixer.render(4800)).max() < 1e-4, "what was dropped does not ring on"
    notes.close()


@pytest.mark.parametrize(
    ("kind", "name", "change"),
    [
        (Voice, "set_gain", lambda notes: notes.set_monitor(hears("truth"))),
        (Voice, "listen", lambda notes: (notes.listen(Ear((0.2,))), notes.poll())),
        (PluckVoices, "release", lambda notes: notes.stop()),
    ],
)
def test_a_pluck_that_cannot_be_changed_or_ended_costs_itself(lab, monkeypatch, kind, name, change):
    struck = [lab.strike() for _ in range(3)]
    lab.mixer.render(4800)
    monkeypatch.setattr(kind, name, once(getattr(kind, name), at=3 if kind is Voice else 2))
    change(lab.notes)
    assert [message for message, _ in lab.reports] == [DROPPED]
    assert [note.cut for note in struck] == [False, True, False]
    lab.notes.poll()
    again = lab.strike()
    lab.mixer.render(4800)
    assert again.began and not again.over and is_loud(lab.sound)
