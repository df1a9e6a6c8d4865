"""The tour's own judgement: holes, fades and silent keys of an instrument's phrase."""

from __future__ import annotations

import numpy as np
import pytest

from app.instrument.events import Event, NoteOff, NoteOn, TimedEvent
from app.instrument.offline import render_events
from app.patches.library import SHIPPED as PATCHES
from app.patches.library import read_patch
from engine.presets import SHIPPED, load_preset
from tests.bench.play import analysis
from tests.bench.play.tour import SILENT_DB, levels_db, own_clicks

RATE_HZ = 48_000
KEYS_S, LINE = (0.3, 0.55, 0.8, 0.925, 1.05), (52, 55, 59, 59, 59)


@pytest.mark.parametrize("name", ["classical_guitar", "concert_harp", "harpsichord"])
def test_what_is_wrong_is_found_and_nothing_else(name: str) -> None:
    patch, preset = read_patch(PATCHES / f"{name}.json"), load_preset(SHIPPED / "studio_any_string.safetensors")
    events: list[tuple[float, Event]] = []
    for at_s, key in zip(KEYS_S, LINE, strict=True):
        events += [(at_s, NoteOn(key, 90)), (at_s + 0.1, NoteOff(key))]
    timed = [TimedEvent(at_s, event) for at_s, event in events]
    sound = np.concatenate(list(render_events(patch, preset, timed, RATE_HZ, seconds=2.0)))
    keys = [round(at_s * RATE_HZ) for at_s in KEYS_S]
    levels = levels_db(sound[:, 0], keys)
    assert (levels > levels.max() + SILENT_DB).all()
    found = analysis.faults(sound, keys, 0, RATE_HZ)
    assert found.holes == found.fades == ()
    hole = slice(keys[1] + 1_000, keys[1] + 1_200)
    sound[hole] = 0.0
    assert [(each.start, each.end) for each in analysis.faults(sound, keys, 0, RATE_HZ).holes] == [
        (hole.start, hole.stop)
    ]
    sound[keys[3] : keys[4]] = 0.0
    levels = levels_db(sound[:, 0], keys)
    assert list(levels < levels.max() + SILENT_DB) == [False, False, False, True, False]


def test_a_string_that_is_stopped_by_the_next_pluck_makes_no_click() -> None:
    """A bass with flat strings is so smooth that corners of its fades stood out."""
    patch, preset = read_patch(PATCHES / "fretless_bass.json"), load_preset(SHIPPED / "studio_any_string.safetensors")
    timed, keys = [], [round((0.1 + 0.125 * number) * RATE_HZ) for number in range(6)]
    for key in keys:
        timed += [TimedEvent(key / RATE_HZ, NoteOn(57, 100)), TimedEvent(key / RATE_HZ + 0.1, NoteOff(57))]
    sound = np.concatenate(list(render_events(patch, preset, timed, RATE_HZ, seconds=1.2, limited=False)))
    found = analysis.faults(sound, keys, 0, RATE_HZ)
    assert found.clicks == found.fades == ()


def test_pulses_of_a_low_stiff_string_are_its_own() -> None:
    """They are there without a stop, a fade or a block of the device; the smooth bass has none."""
    drone, smooth = (read_patch(PATCHES / f"{name}.json") for name in ("ground_drone", "fretless_bass"))
    assert own_clicks(drone, 29) > 2
    assert own_clicks(smooth, 48) == 0
