"""How loud patches are: a note, and chords, before the limiter."""

from __future__ import annotations

import numpy as np
import pytest

from app.instrument.events import NoteOn, TimedEvent
from app.instrument.offline import render_events
from app.patches.library import SHIPPED, find_patch, list_patches
from app.patches.patch import Patch
from engine.kernels.limiter import CEILING
from engine.kernels.playing_layout import REFERENCE_VELOCITY
from engine.presets import Preset
from tests.bench.tune import chord_of

RATE_HZ = 48_000
E_MAJOR = (40, 47, 52, 56, 59, 64)
STRUM_S = 0.01  # from key to key
PATCHES = [entry.patch for entry in list_patches(SHIPPED)[0] if entry.patch.strings.kind != "drums"]


def peak_db(patch: Patch, preset: Preset, keys: tuple[int, ...], apart_s: float) -> float:
    """The peak before the limiter, of the attacks of keys at the reference velocity, in dB relative to full scale."""
    events = [TimedEvent(n * apart_s, NoteOn(key, REFERENCE_VELOCITY, n)) for n, key in enumerate(keys)]
    blocks = render_events(patch, preset, events, RATE_HZ, seconds=len(keys) * apart_s + 0.15, limited=False)
    return 20 * float(np.log10(max(np.abs(block).max() for block in blocks)))


def test_six_strummed_keys_of_a_guitar_peak_at_nine_db(preset: Preset) -> None:
    guitar = find_patch("Classical guitar").patch
    strummed = [peak_db(guitar, preset, E_MAJOR, apart_s) for apart_s in (0.005, 0.01, 0.02, 0.04)]
    assert np.mean(strummed) == pytest.approx(-9, abs=1)
    assert max(strummed) < -6.5
    notes = [peak_db(guitar, preset, (key,), STRUM_S) for key in E_MAJOR]
    assert np.mean(notes) == pytest.approx(-18, abs=1)


def test_six_keys_at_once_stay_below_the_limiter(patch: Patch, preset: Preset) -> None:
    for chosen in (patch, find_patch("Classical guitar").patch):
        assert peak_db(chosen, preset, E_MAJOR, 0.0) < 20 * np.log10(CEILING) - 2


@pytest.mark.parametrize("patch", PATCHES, ids=lambda patch: patch.name)
def test_six_strummed_keys_do_not_engage_the_limiter(patch: Patch, preset: Preset) -> None:
    found = peak_db(patch, preset, tuple(chord_of(patch)), STRUM_S)
    print(f"{patch.name}: {found:.1f} dBFS")
    assert -20 < found < 20 * np.log10(CEILING)
