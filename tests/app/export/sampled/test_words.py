"""The size that is reported before is written, at most."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from app.export.sampled.job import export_sampled
from app.export.sampled.plan import SampledPlan
from app.export.sampled.words import instrument_bytes, needed_bytes


@pytest.mark.parametrize("points", [(0.2,), (0.2, 0.3)])
@pytest.mark.parametrize(
    ("kind", "form", "bits"),
    [("sfz", "wav", "16"), ("sfz", "wav", "24"), ("sfz", "flac", "16"), ("sfz", "flac", "24"), ("sf2", "flac", "24")],
)
def test_no_instrument_is_larger_than_reported(
    kind: str, form: str, bits: str, points: tuple[float, ...], instrument_of: Callable, tmp_path: Path
) -> None:
    instrument = instrument_of(pickup={"points": points})
    plan = SampledPlan(instrument, (50, 52), layers=2, seconds=0.4, format=form, bits=bits)

    def noise(instrument, key, velocity, held_s, seconds, rate_hz, *, advanced):
        frames = round(seconds * rate_hz)
        return np.random.default_rng(key).uniform(-0.1, 0.1, (frames, len(points))).astype(np.float32)

    soundfont = kind == "sf2"
    reported = instrument_bytes(plan, soundfont)
    size = export_sampled(plan, tmp_path / f"a.{kind}", noise).size_bytes
    assert size <= reported
    assert size > (0.5 if form == "flac" and not soundfont else 0.97) * reported
    assert needed_bytes(plan, soundfont) == reported + (plan.largest_bytes if soundfont else 0)
