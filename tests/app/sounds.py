"""The sound of a request, as an export has it."""

from __future__ import annotations

from pathlib import Path

from app.export.files import WavReport, export_sounds
from app.export.sound import Mixed, Samples, SoundRequest, render_voices
from app.export.wav import WavSettings
from app.shared.worker import Progress


def render_sound(request: SoundRequest, rate_hz: int = 0) -> Samples:
    """(frames,), or (frames, 2) in stereo and for both sources; `rate_hz`: 0 for the preset's own."""
    voices = render_voices(request, (request.source,), rate_hz)
    samples = Mixed(voices, request.source, request.difference_gain_db)[:]
    return samples[:, 0] if samples.shape[1] == 1 else samples


def export_sound(
    request: SoundRequest, path: Path, settings: WavSettings | None = None, progress: Progress = lambda *_: None
) -> WavReport:
    """Writes a file of the request's own source."""
    (report,) = export_sounds(request, {request.source: path}, settings or WavSettings(), progress=progress)
    return report
