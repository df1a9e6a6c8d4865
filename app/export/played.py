"""The files of what is played through an instrument: a sound file rendered from the events, and their MIDI file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from app.export.recipe import InstrumentSound, source_words
from app.export.recording import Recording
from app.export.wav import WavSettings, WrittenSound, form_of, is_within_full_scale, write_wav
from app.instruments.instrument import Instrument
from app.player.events import Meter, NoteOff, NoteOn, TimedEvent
from app.player.midi_file import midi_bytes
from app.player.offline import channels_played, render_events
from app.shared.version import PROGRAM, program_version
from app.shared.vocabulary import DIFFERENCE, WRITTEN_ENDINGS, PlayedSource
from app.shared.worker import Progress
from engine.plain_text import name_text
from engine.presets import Preset, load_preset
from engine.whole_file import result_file

RATE_HZ = 48_000
TAIL_S = 6.0  # a guess at how long it rings after the last note, for progress
DEFAULT = WavSettings("24", RATE_HZ)


@dataclass(frozen=True, eq=False)
class Played:
    """A performance through an instrument that is not yet written to a file.

    Attributes:
        instrument: with which it began.
        events: `InstrumentTurned` among them have the pick-up through which it was heard.
        source: that is heard: "model", "truth" or "difference".
        difference_gain_db: the gain of the difference.
        recorded: when it began; None: not known, or it was not played.
        meter: its times are from the first beat; None: it was not counted.
    """

    instrument: Instrument
    events: Sequence[TimedEvent]
    source: PlayedSource = "model"
    difference_gain_db: float = 0.0
    recorded: datetime | None = None
    meter: Meter | None = None


def write_played(
    path: Path,
    parts: Sequence[tuple[Played, Preset]],
    midi: str,
    settings: WavSettings = DEFAULT,
    seconds: float | None = None,
    progress: Callable[[float], None] = lambda share: None,
) -> WrittenSound:
    """Write a sound file, whole or not at all, that carries what it is. Memory does not grow with its length.

    Args:
        parts: performances that sound together, of one source, each with the preset that plays it. Where several
            together exceed full scale, the file is normalised.
        midi: the name of the MIDI file with the events.
        seconds: its length; None: until all has decayed.
        progress: is called with the share that is done, at most 0.99; may raise, to end it.

    Raises:
        ValueError: a key has no possible string, or the source is unknown; or see `form_of`.
        PresetError: the preset's file cannot be read any more.
        WriteError: the file cannot be written; raised before the work where the folder cannot be written to.
    """
    first, preset = parts[0]
    source, gain_db, recorded = first.source, first.difference_gain_db, first.recorded
    rate_hz = settings.rate_hz or RATE_HZ
    form = form_of(path, settings.bits, rate_hz)
    names = " + ".join(dict.fromkeys(played.instrument.name for played, _ in parts))
    origin = InstrumentSound(
        **InstrumentSound.of_preset(preset),
        instrument=names,
        source=source,
        difference_gain_db=gain_db if source == DIFFERENCE else 0.0,
        rate_hz=rate_hz,
        bits=settings.bits,
        midi=name_text(midi),
        recorded=None if recorded is None else recorded.isoformat(timespec="seconds"),
    )
    events = [entry for played, _ in parts for entry in played.events]
    notes_s = (entry.time_s for entry in events if isinstance(entry.event, NoteOn | NoteOff))
    whole_s = max(notes_s, default=0.0) + TAIL_S if seconds is None else seconds
    with result_file(path) as file:
        sound = Recording(max(channels_played(played.instrument, played.events) for played, _ in parts))
        for place, (played, player) in enumerate(parts):
            instrument, done = played.instrument, 0
            for block in render_events(
                instrument, player, played.events, rate_hz, source, seconds, difference_gain_db=gain_db
            ):
                sound.add(done, block)
                done += len(block)
                progress((place + min(0.99, done / rate_hz / whole_s)) / len(parts))
        if len(parts) > 1 and not is_within_full_scale(sound):
            settings = replace(settings, normalise=True)
        tags = {
            "title": name_text(f"{path.stem}: {names}"),
            "software": f"{PROGRAM} {program_version()}",
            "comment": origin.model_dump_json(),
        }
        return write_wav(file, sound, rate_hz, settings, tags, form=form)


def recorded_files(path: Path) -> tuple[Path, Path]:
    """The sound and the MIDI file that a recording of what is played is written to, from the chosen path."""
    sound = path if path.suffix.lower() in WRITTEN_ENDINGS else path.with_name(f"{path.name}.wav")
    return sound, sound.with_suffix(".mid")


@dataclass(frozen=True, eq=False)
class PlayedExport:
    """The export of a recording to `recorded_files` of `path`. See `ExportJob`.

    Attributes:
        preset: the file of the preset that plays the instrument.
    """

    played: Played
    preset: Path
    path: Path
    settings: WavSettings = DEFAULT
    cancelled = "the MIDI file is kept."

    @property
    def file(self) -> Path:
        return recorded_files(self.path)[0]

    def run(self, progress: Progress) -> str:
        """The MIDI file is there at once; the sound takes a part of the time in which it was played."""
        played, (sound_file, midi_file) = self.played, recorded_files(self.path)
        with result_file(midi_file) as file:
            file.write(midi_bytes(played.events, played.instrument, played.meter))
        preset = load_preset(self.preset)
        written = write_played(sound_file, [(played, preset)], midi_file.name, self.settings, progress=progress)
        sound = source_words(played.source, played.difference_gain_db)
        level = f"peak {written.peak_db:.1f} dBFS"
        return f"Saved {sound_file} and {midi_file.name}: {written.seconds:.1f} s of {sound}, {level}."
