"""The command that plays a MIDI file through a patch."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import soundfile
from numpy.typing import NDArray

from app.instrument.events import NoteOff, NoteOn, TimedEvent
from app.instrument.midi_file import midi_bytes
from app.patches.library import SHIPPED
from app.shared.version import program_version
from engine.presets import SHIPPED as PRESETS


def test_a_body_that_is_not_here_is_reported_and_the_rest_is_played(
    run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(tmp_path / "own"))
    patch = json.loads((SHIPPED / "classical_guitar.json").read_text(encoding="utf-8"))
    patch["body"] = {"name": "a cello", "mix": 0.5}
    (tmp_path / "mine.json").write_text(json.dumps(patch))
    (tmp_path / "one.mid").write_bytes(midi_bytes([TimedEvent(0.0, NoteOn(57, 90)), TimedEvent(0.1, NoteOff(57))]))
    out = tmp_path / "one.wav"
    found = run(
        "play", tmp_path / "one.mid", "--instrument", tmp_path / "mine.json", "--out", out, "--seconds", "0.3"
    )
    assert found.status == 0
    assert "is played without its body: the body a cello is not here" in found.err
    assert found.out.startswith(f"{out}: 0.3 s of model in ")
    sound, _ = soundfile.read(out)
    assert abs(sound).max() > 0.01


EVENTS = [TimedEvent(0.0, NoteOn(57, 90)), TimedEvent(0.2, NoteOff(57))]


def test_a_midi_file_is_played_by_model_and_truth_the_same_each_time(run, tmp_path: Path) -> None:
    (tmp_path / "one.mid").write_bytes(midi_bytes(EVENTS))

    def played(name: str, *more: str) -> bytes:
        found = run("play", tmp_path / "one.mid", "--instrument", "jazz_guitar", "--out", tmp_path / name, *more)
        assert found.status == 0, found.err
        return (tmp_path / name).read_bytes()[-20_000:]

    assert played("a.wav") == played("b.wav")
    played("truth.wav", "--source", "truth")
    model, rate_hz = soundfile.read(tmp_path / "a.wav")
    truth, _ = soundfile.read(tmp_path / "truth.wav")
    assert rate_hz == 48_000
    shortest = min(len(model), len(truth))
    assert abs(model[:shortest] - truth[:shortest]).max() < 1e-4 * abs(truth).max()
    assert 0.2 < len(model) / rate_hz < 20
    assert abs(model[-480:]).max() < 1e-3


def test_what_cannot_be_played_is_reported_in_a_line(run, tmp_path: Path) -> None:
    (tmp_path / "one.mid").write_bytes(midi_bytes(EVENTS))
    out = tmp_path / "one.wav"
    for arguments in (
        (tmp_path / "none.mid", "--instrument", "jazz_guitar", "--out", out),
        (tmp_path / "one.mid", "--instrument", "no such instrument", "--out", out),
        (tmp_path / "one.mid", "--instrument", "jazz_guitar", "--out", tmp_path / "nowhere" / "one.wav"),
    ):
        found = run("play", *arguments)
        assert found.status == 1
        assert found.err.count("\n") == 1
    assert not out.exists()


def test_drums_are_left_out_and_that_is_reported_in_a_line(run, tmp_path: Path) -> None:
    (tmp_path / "plain.mid").write_bytes(midi_bytes(EVENTS))
    (tmp_path / "drums.mid").write_bytes(midi_bytes([TimedEvent(0.0, NoteOn(40, 127, 9)), *EVENTS]))

    def played(name: str) -> tuple[bytes, str]:
        out = tmp_path / f"{name}.wav"
        found = run("play", tmp_path / f"{name}.mid", "--instrument", "jazz_guitar", "--out", out, "--seconds", "0.5")
        assert found.status == 0, found.err
        return soundfile.read(out)[0].tobytes(), found.err

    (plain, silent), (without, reported) = played("plain"), played("drums")
    assert plain == without
    assert "drums.mid is played without its drums (channel 10)" in reported
    assert "drums" not in silent


def test_a_file_of_one_channel_sounds_in_chords_by_a_guitars_patch(run, tmp_path: Path) -> None:
    chord = [TimedEvent(0.0, NoteOn(key, 90, 2)) for key in (60, 64, 67)]  # all on the oud's highest string

    def played(name: str, events: list[TimedEvent]) -> NDArray[np.float64]:
        (tmp_path / f"{name}.mid").write_bytes(midi_bytes(events))
        out = tmp_path / f"{name}.wav"
        found = run("play", tmp_path / f"{name}.mid", "--instrument", "oud", "--out", out, "--seconds", "0.5")
        assert found.status == 0, found.err
        sound = soundfile.read(out, always_2d=True)[0][:, 0]
        return np.abs(np.fft.rfft(sound * np.hanning(len(sound))))

    together = played("chord", chord)
    for key in (60, 64, 67):
        near = round(0.5 * 440 * 2 ** ((key - 69) / 12))
        alone = played("alone", [TimedEvent(0.0, NoteOn(key, 90, 2))])
        assert together[near - 2 : near + 3].max() > 0.5 * alone[near - 2 : near + 3].max()


def test_info_says_which_instrument_played(run, tmp_path: Path) -> None:
    midi, out = tmp_path / "one.mid", tmp_path / "one.wav"
    midi.write_bytes(midi_bytes(EVENTS))
    reported = (
        "--instrument",
        "jazz_guitar",
        "--source",
        "truth",
        "--rate",
        44_100,
        "--bits",
        "16",
        "--seconds",
        "0.2",
    )
    assert run("play", midi, "--out", out, *reported).status == 0
    facts = json.loads(run("info", out, "--json").out)
    assert facts["preset_file"] == str(PRESETS / "studio_any_string.safetensors")
    assert (facts["instrument"], facts["preset"], facts["source"]) == ("Jazz guitar", "studio_any_string", "truth")
    assert (facts["rate_hz"], facts["bits"], facts["midi"]) == (44_100, "16", "one.mid")
    assert (facts["version"], facts["recorded"]) == (program_version(), None)
    shown = run("info", out)
    assert "instrument          Jazz guitar\n" in shown.out
    assert "a rendering of Jazz guitar (the truth)" in shown.err
    again = run("render", "--recipe", out, tmp_path / "again.wav").failure
    assert f"{out}: is a rendering of Jazz guitar (the truth). It has no recipe to render again" in again
    assert "one.mid" in again
