"""The samples of a request, as an export has them."""

from __future__ import annotations

from app.export.sound import Mixed, Samples, SoundRequest, render_voices


def render_sound(request: SoundRequest, rate_hz: int = 0) -> Samples:
    """(frames,), or (frames, 2) in stereo and for both sources; `rate_hz`: 0 for the preset's own."""
    voices = render_voices(request, (request.source,), rate_hz)
    samples = Mixed(voices, request.source, request.difference_gain_db)[:]
    return samples[:, 0] if samples.shape[1] == 1 else samples
