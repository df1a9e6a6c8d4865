"""What a player hears of blows that overlap and meet drums that still ring, judged as a recording is."""

from __future__ import annotations

from random import Random

import numpy as np

from app.instrument.events import Event, NoteOff, NoteOn, TimedEvent
from app.instrument.offline import render_events
from app.patches.library import SHIPPED as PATCHES
from app.patches.library import read_patch
from engine.presets import SHIPPED, load_preset
from tests.bench.play import analysis, hands

RATE_HZ = 48_000
BLOWS_HZ, SECONDS = 12.0, 6.0
VELOCITY = 90


def test_blows_make_no_clicks_and_no_holes() -> None:
    """Of tuned toms: a plate's or a bar's own motion has steps, where its waves meet again."""
    patch, random = read_patch(PATCHES / "tuned_toms.json"), Random(1)
    lowest, letters = hands.LOWEST + 12 * hands.octave_of(patch), hands.keys_of(patch)
    now_s, events, keys = 0.3, list[tuple[float, Event]](), list[int]()
    for step_s in hands.steady(random, BLOWS_HZ, SECONDS):
        now_s += step_s
        key = lowest + hands.KEYS.index(random.choice(letters))
        keys.append(round(now_s * RATE_HZ))
        events += [(now_s, NoteOn(key, VELOCITY)), (now_s + hands.HELD_S, NoteOff(key))]
    timed = [TimedEvent(time_s, event) for time_s, event in events]
    preset = load_preset(SHIPPED / "studio_any_string.safetensors")
    sound = np.concatenate(list(render_events(patch, preset, timed, RATE_HZ, seconds=now_s + 1.0)))
    assert np.abs(sound).max() > 0.1
    expected = analysis.expected_sound(sound, keys, RATE_HZ)
    assert analysis.holes(sound, expected, RATE_HZ) == []
    rest = analysis.unpredicted(sound[:, 0], RATE_HZ)
    found = analysis.events(rest, RATE_HZ)
    struck = analysis.matched(keys, found, rest.by_past, 0, RATE_HZ)
    assert None not in struck
    assert analysis.clicks(found, struck, [], expected, RATE_HZ) == []
