"""Notes that overlap judged as a recording of them is: no clicks, no holes."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from app.instrument.events import NoteOff, NoteOn, TimedEvent
from app.instrument.offline import render_events
from app.patches.library import SHIPPED as PATCHES
from app.patches.library import read_patch
from engine.presets import SHIPPED, load_preset
from tests.bench.play import analysis

RATE_HZ, BEGIN_S = 48_000, 0.3


def played(name: str, keys: list[int], step_s: float, held_s: float) -> tuple[NDArray[np.float32], list[int]]:
    """The sound of keys in turn, each a little early or late, and the frames at which they begin."""
    random = np.random.default_rng(1)
    begins_s = BEGIN_S + step_s * (np.arange(len(keys)) + random.uniform(-0.1, 0.1, len(keys)))
    timed = []
    for begin_s, key in zip(begins_s, keys, strict=True):
        timed += [TimedEvent(float(begin_s), NoteOn(key, 90)), TimedEvent(float(begin_s) + held_s, NoteOff(key))]
    timed.sort(key=lambda each: each.time_s)
    patch, preset = read_patch(PATCHES / f"{name}.json"), load_preset(SHIPPED / "studio_any_string.safetensors")
    seconds = float(begins_s[-1]) + 1.0
    blocks = render_events(patch, preset, timed, RATE_HZ, seconds=seconds, limited=False)
    return np.concatenate(list(blocks)), [round(begin_s * RATE_HZ) for begin_s in begins_s]


@pytest.mark.parametrize(
    ("name", "keys", "step_s", "held_s"),
    [
        ("tuned_toms", list(np.random.default_rng(2).integers(47, 60, 60)), 1 / 12, 0.03),  # drums still ring
        (
            "fretless_bass",
            [57] * 6,
            0.125,
            0.1,
        ),  # each stops the string: so smooth that corners of its fades stand out
    ],
)
def test_overlapping_notes_make_no_clicks_and_no_holes(
    name: str, keys: list[int], step_s: float, held_s: float
) -> None:
    sound, begins = played(name, [int(key) for key in keys], step_s, held_s)
    assert np.abs(sound).max() > 0.05
    found = analysis.faults(sound, begins, 0, RATE_HZ)
    assert found == analysis.Faults((), (), ())
    middle = (begins[2] + begins[3]) // 2
    sound[middle : middle + 300] += 0.2 * np.abs(sound).max()
    sound[begins[4] + 1_000 : begins[4] + 1_200] = 0
    found = analysis.faults(sound, begins, 0, RATE_HZ)
    assert found.holes == (analysis.Span(begins[4] + 1_000, begins[4] + 1_200),), "it would be found"
    assert min(abs(click - middle) for click in found.clicks) < 48
