"""The command that plays a MIDI file through a patch."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import soundfile

from app.instrument.events import NoteOff, NoteOn, TimedEvent
from app.instrument.midi_file import midi_bytes
from app.patches.library import SHIPPED


def test_a_body_that_is_not_here_is_told_and_the_rest_is_played(
    run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(tmp_path / "own"))
    patch = json.loads((SHIPPED / "classical_guitar.json").read_text(encoding="utf-8"))
    patch["body"] = {"name": "a cello", "mix": 0.5}
    (tmp_path / "mine.json").write_text(json.dumps(patch))
    (tmp_path / "one.mid").write_bytes(midi_bytes([TimedEvent(0.0, NoteOn(57, 90)), TimedEvent(0.1, NoteOff(57))]))
    out = tmp_path / "one.wav"
    found = run("play", tmp_path / "one.mid", "--patch", tmp_path / "mine.json", "--out", out, "--seconds", "0.3")
    assert found.status == 0
    assert "is played without its body: the body a cello is not here" in found.err
    sound, _ = soundfile.read(out)
    assert abs(sound).max() > 0.01
