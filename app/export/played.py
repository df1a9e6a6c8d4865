"""What is played through a patch, as files: a WAV file rendered from the events, and the events as a MIDI file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from app.export.recording import Recording
from app.export.wav import Level, WavSettings, write_wav
from app.instrument.effects import channels_of
from app.instrument.events import TimedEvent
from app.instrument.midi_file import midi_bytes
from app.instrument.offline import render_events
from app.patches.patch import Patch
from app.shared.version import PROGRAM, program_version
from app.shared.whole_file import whole_file
from engine.presets import Preset

RATE_HZ = 48_000


@dataclass(frozen=True)
class PlayedFile:
    """What was written: its duration and its level."""

    seconds: float
    level: Level


def write_played(
    path: Path,
    patch: Patch,
    preset: Preset,
    events: Sequence[TimedEvent],
    source: str = "model",
    settings: WavSettings = WavSettings("24", RATE_HZ),  # noqa: B008 - immutable
    seconds: float | None = None,
    advanced: Callable[[float], None] = lambda seconds: None,
) -> PlayedFile:
    """Writes a WAV file, whole or not at all. Memory does not grow with its length.

    Args:
        source: "model" or "truth".
        seconds, advanced: see `render_events`.

    Raises:
        ValueError: a key has no possible string, or `source` is unknown.
        WriteError: the file cannot be written; raised before the work where the folder cannot be written to.
    """
    rate_hz = settings.rate_hz or RATE_HZ
    with whole_file(path) as file:
        sound = Recording(channels_of(patch))
        for block in render_events(patch, preset, events, rate_hz, source, seconds, advanced=advanced):
            sound.append(block)
        tags = {"title": f"{path.stem}: {patch.name}", "software": f"{PROGRAM} {program_version()}"}
        level = write_wav(file, sound, rate_hz, settings, tags)
    return PlayedFile(len(sound) / rate_hz, level)


def recorded_files(path: Path) -> tuple[Path, Path]:
    """The WAV and the MIDI file that a recording of what is played is written to, from the chosen path."""
    sound = path if path.suffix.lower() == ".wav" else path.with_name(f"{path.name}.wav")
    return sound, sound.with_suffix(".mid")


def write_recorded(path: Path, patch: Patch, preset: Preset, events: Sequence[TimedEvent], source: str) -> str:
    """Writes both `recorded_files` and returns in words what was written. Raises as `write_played`."""
    sound_file, midi_file = recorded_files(path)
    written = write_played(sound_file, patch, preset, events, source)
    with whole_file(midi_file) as file:
        file.write(midi_bytes(events))
    return f"{sound_file} and {midi_file.name}: {written.seconds:.1f} s, peak {written.level.peak_db:.1f} dBFS"
