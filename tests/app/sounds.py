"""The sound of a note, as an export has it."""

from pathlib import Path

from app.export.note import WavReport, export_sounds
from app.export.sound import Mixed, Samples, render_voices
from app.export.wav import WavSettings
from app.rendering.note_sound import NoteSound
from app.shared.vocabulary import Source
from app.shared.worker import Progress

OWN = WavSettings()


def render_sound(sound: NoteSound, source: Source = "model", settings: WavSettings = OWN) -> Samples:
    """(frames,), or (frames, 2) in stereo and for both sources."""
    voices = render_voices(sound, sound.load(settings.rate_hz), (source,), settings)
    samples = Mixed(voices, source, settings.difference_gain_db)[:]
    return samples[:, 0] if samples.shape[1] == 1 else samples


def export_sound(
    sound: NoteSound,
    path: Path,
    source: Source = "model",
    settings: WavSettings = OWN,
    progress: Progress = lambda *_: None,
) -> WavReport:
    """Writes a file of one source."""
    (report,) = export_sounds(sound, sound.load(settings.rate_hz), {source: path}, settings, progress)
    return report
