"""Every shipped preset falls silent: also long after the last of its latents is too small to count."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from engine.pluck import Pluck
from engine.presets import load_preset, preset_files
from engine.resonators.sine_transform import project
from engine.sources import ModelSource, Runaway

OFFSET_M = 1e-6  # a decoder's bias may leave so much, 80 dB below full scale; it does not sound
MOVES_M = 1e-9  # 140 dB below


@pytest.mark.parametrize("path", preset_files(), ids=lambda path: path.stem)
def test_silence_at_the_end_of_time(path: Path) -> None:
    preset = load_preset(path)
    source = ModelSource(preset)
    points, rate_hz = preset.info.grid_points, preset.info.rate_hz
    state = source.start(project(Pluck(position=0.4, amplitude_mm=4.0).displacement(points), preset.info.modes)[None])
    frame = 3600 * rate_hz
    if hasattr(state.inner, "time"):
        state = replace(state, inner=replace(state.inner, time=frame), frame=frame)
    elif hasattr(state.inner, "step"):
        state = replace(state, inner=replace(state.inner, step=frame), frame=frame)
    else:  # a recurrence cannot jump: finite, or reported
        try:
            frames, _ = source.advance(state, 300)
        except Runaway:
            return
        assert np.isfinite(frames).all()
        return
    for readout in (None, np.eye(points)[:, ::50]):  # the string, and some points of it, by another way
        frames, _ = source.advance(state, 600, readout)
        assert float(np.abs(frames).max()) < OFFSET_M
        assert float(np.abs(np.diff(frames, axis=1)).max()) < MOVES_M
