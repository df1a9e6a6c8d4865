"""Render the sounds of this folder with the project's command line: `.venv/bin/python docs/sounds/make.py`."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import mido
import soundfile

HERE = Path(__file__).resolve().parent
PRESET = "nylon_nonlinear_gaussian_16k_koopman_var"
PLUCK = ("--position", "0.3", "--amplitude-mm", "8", "--seconds", "3", "--bits", "16")
INSTRUMENTS = ("classical_guitar", "steel_string_acoustic", "concert_harp", "harpsichord", "koto", "glass_threads")
NOTES = (52, 59, 64, 68, 71, 76, 71, 68, 64, 59, 52)  # an arpeggio of E major up and down
NOTE_TICKS = 150  # of 480 a beat, at 120 beats a minute
DRONE, DRONE_TICKS = (43, 48, 48, 36) * 2, 800  # fifth, octave, octave and ground of a tanpura


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        wav, melody = Path(folder, "sound.wav"), Path(folder, "melody.mid")
        for source in ("model", "truth", "difference"):
            run("render", PRESET, wav, *PLUCK, "--source", source)
            convert(wav, HERE / f"pluck_{source}.flac")
        write_melody(melody)
        for name in INSTRUMENTS:
            run("play", melody, "--instrument", name, "--out", wav, "--seconds", "7", "--normalise")
            convert(wav, HERE / f"{name}.opus")
        write_melody(melody, DRONE, DRONE_TICKS)
        run("play", melody, "--instrument", "tanpura_drone", "--out", wav, "--seconds", "10", "--normalise")
        convert(wav, HERE / "tanpura_drone.opus")


def run(*words: str | Path) -> None:
    subprocess.run([sys.executable, "-m", "app.commands.cli", *words], cwd=HERE.parents[1], check=True)


def convert(wav: Path, path: Path) -> None:
    """Write a WAV as FLAC or Opus."""
    frames, rate_hz = soundfile.read(wav)
    soundfile.write(path, frames, rate_hz, **({"format": "OGG", "subtype": "OPUS"} if path.suffix == ".opus" else {}))
    wav.unlink()


def write_melody(path: Path, notes: Sequence[int] = NOTES, ticks: int = NOTE_TICKS) -> None:
    """Held notes, so that the instruments ring."""
    track = mido.MidiTrack()
    for number, note in enumerate(notes):
        velocity = 60 + 10 * (number % 5)
        track.append(mido.Message("note_on", note=note, velocity=velocity, time=ticks if number else 0))
    track += [mido.Message("note_off", note=note, time=1400 if not i else 0) for i, note in enumerate(set(notes))]
    file = mido.MidiFile(ticks_per_beat=480)
    file.tracks.append(track)
    file.save(path)


if __name__ == "__main__":
    main()
