"""Levels and frequencies of the spectrogram, and that growth does not change it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from app.analysis.spectrogram import FLOOR_DB, FrequencyRows, Spectrogram
from app.rendering import Take
from engine.values.ear import Ear

RATE_HZ = 4000
MIDDLE = Ear((0.5,))
Hear = Callable[[Take, Ear], None]
Grown = Callable[..., Spectrogram]


def tone(frequency_hz: float, amplitude_m: float) -> NDArray[np.float32]:
    """Half a second (2001, 101) in the string's first shape, 1 at its middle."""
    time_s = np.arange(2001) / RATE_HZ
    shape = np.sin(np.pi * np.linspace(0, 1, 101))
    return (amplitude_m * np.cos(2 * np.pi * frequency_hz * time_s)[:, None] * shape).astype(np.float32)


@pytest.fixture
def grown(hear: Hear) -> Callable[..., Spectrogram]:
    def of(take: Take, ear: Ear = MIDDLE) -> Spectrogram:
        hear(take, ear)
        made = Spectrogram(take, take.listened)
        while made.advance():
            pass
        return made

    return of


def test_a_sine_has_its_level_at_its_frequency_from_the_first_column(
    make_take: Callable[..., Take], grown: Grown
) -> None:
    made = grown(make_take(tone(750, 1e-3), tone(750, 1e-2)))
    assert made.complete
    for name, level_db in (("model", -20.0), ("truth", 0.0), ("error", 20 * np.log10(0.9))):
        levels_db = made.levels_db[name]
        assert levels_db.max(axis=1) == pytest.approx(np.full(made.columns, level_db), abs=0.3)
        assert (levels_db.argmax(axis=1) * made.bin_hz) == pytest.approx(np.full(made.columns, 750), abs=10)


def test_a_velocity_is_louder_by_its_frequency_from_the_first_column(
    make_take: Callable[..., Take], grown: Grown
) -> None:
    take = make_take(tone(750, 1e-3), tone(750, 2e-3))
    made = grown(take, Ear((0.5,), "velocity"))
    assert made.complete
    full_db = 20 * np.log10(2e-3 * 2 * np.pi * 750 / 30)
    assert made.levels_db["truth"].max(axis=1) == pytest.approx(np.full(made.columns, full_db), abs=0.3)
    alone = grown(take, Ear((0.5,), solo=2))
    assert alone.levels_db["truth"].max() < -120  # there is the first mode alone


def test_it_is_heard_at_the_listening_point(make_take: Callable[..., Take], grown: Grown) -> None:
    take = make_take(tone(750, 1e-3), tone(750, 1e-3))
    here, there = (grown(take, Ear((listen,))).levels_db["truth"].max() for listen in (0.5, 1 / 6))
    assert there - here == pytest.approx(20 * np.log10(0.5), abs=0.01)
    assert grown(take, Ear((0.0,))).levels_db["truth"].max() == pytest.approx(FLOOR_DB)


def test_growing_in_pieces_is_the_same(make_take: Callable[..., Take], grown: Grown) -> None:
    motion = np.random.default_rng(2).standard_normal((2001, 101)).astype(np.float32)
    whole = grown(make_take(motion, motion[::-1].copy()))
    take = make_take(motion, motion[::-1].copy(), 30)
    made = Spectrogram(take, take.listened)
    counts = []
    for stop in (31, 130, 131, 777, 2001):
        for name, frames in (("model", motion), ("truth", motion[::-1])):
            signal = take.listened.signals[name]
            signal.append(frames[signal.ready_frames : stop, 50:51])
        while made.advance():
            pass
        counts.append(made.ready)
    assert counts == sorted(counts)
    assert 0 < counts[1] < made.columns == counts[-1]
    for name, levels_db in whole.levels_db.items():
        np.testing.assert_allclose(made.levels_db[name], levels_db, atol=1e-3)


@pytest.mark.parametrize("logarithmic", [True, False])
@pytest.mark.parametrize("bins", [65, 2049])
def test_no_partial_falls_between_two_rows(logarithmic: bool, bins: int) -> None:
    rate_hz, rows_count = 16_000, 100
    bin_hz = rate_hz / 2 / (bins - 1)
    rows = FrequencyRows(bins, bin_hz, rows_count, 50.0, logarithmic)
    space = np.geomspace if logarithmic else np.linspace
    edges_hz = space(50.0, rate_hz / 2, rows_count + 1)
    for bin_ in range(round(200 / bin_hz) + 1, bins - 1, 7):
        levels_db = np.full((1, bins), -100, np.float32)
        levels_db[0, bin_] = 0
        found = rows.of(levels_db)[0]
        row = int(found.argmax())
        width_hz = edges_hz[row + 1] - edges_hz[row]
        assert abs((edges_hz[row] + edges_hz[row + 1]) / 2 - bin_ * bin_hz) <= max(width_hz, bin_hz)
        if width_hz > 2 * bin_hz:
            assert found[row] == 0


def test_a_flat_spectrum_is_flat_in_rows() -> None:
    rows = FrequencyRows(513, 16_000 / 1024, 320, 50.0, True)
    assert rows.of(np.full((3, 513), -42, np.float32)) == pytest.approx(np.full((3, 320), -42))
