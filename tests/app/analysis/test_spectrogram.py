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
MakeTake = Callable[..., Take]
Grown = Callable[..., Spectrogram]


def tone(amplitude_m: float) -> NDArray[np.float32]:
    """Half a second (2001, 101) of 750 Hz in the string's first shape, 1 at its middle."""
    shape, phase = np.sin(np.pi * np.linspace(0, 1, 101)), 2 * np.pi * 750 * np.arange(2001)[:, None] / RATE_HZ
    return (amplitude_m * np.cos(phase) * shape).astype(np.float32)


@pytest.fixture
def grown(hear: Callable[[Take, Ear], None]) -> Grown:
    def of(take: Take, ear: Ear = MIDDLE) -> Spectrogram:
        hear(take, ear)
        made = Spectrogram(take, take.listened)
        while made.advance():
            pass
        assert made.complete
        return made

    return of


def test_a_sine_has_its_level_at_its_frequency_from_the_first_column(make_take: MakeTake, grown: Grown) -> None:
    made = grown(make_take(tone(1e-3), tone(1e-2)))
    for name, level_db in (("model", -20.0), ("truth", 0.0), ("error", 20 * np.log10(0.9))):
        levels_db = made.levels_db[name]
        assert levels_db.max(axis=1) == pytest.approx(np.full(made.columns, level_db), abs=0.3)
        assert (levels_db.argmax(axis=1) * made.bin_hz) == pytest.approx(np.full(made.columns, 750), abs=10)


@pytest.mark.parametrize(
    ("ear", "level_db", "near_db"),
    [
        (Ear((0.5,), "velocity"), 20 * np.log10(2e-3 * 2 * np.pi * 750 / 30), 0.3),  # louder by its frequency
        (Ear((1 / 6,)), 20 * np.log10(0.5 * 2e-3 / 1e-2), 0.01),  # where the shape is half of the middle's
        (Ear((0.0,)), FLOOR_DB, 1e-3),
        (Ear((0.5,), solo=2), FLOOR_DB, 30),  # there is the first mode alone
    ],
)
def test_levels_are_those_of_the_ear(
    make_take: MakeTake, grown: Grown, ear: Ear, level_db: float, near_db: float
) -> None:
    made = grown(make_take(tone(1e-3), tone(2e-3)), ear)
    assert made.levels_db["truth"].max(axis=1) == pytest.approx(np.full(made.columns, level_db), abs=near_db)


def test_growing_in_pieces_is_the_same(make_take: MakeTake, grown: Grown) -> None:
    motion = np.random.default_rng(2).standard_normal((2001, 101)).astype(np.float32)
    motions, take = (motion, motion[::-1].copy()), make_take(motion, motion, 30)
    whole, made, counts = grown(make_take(*motions)), Spectrogram(take, take.listened), []
    for stop in (31, 130, 131, 777, 2001):
        for name, frames in zip(("model", "truth"), motions, strict=True):
            signal = take.listened.signals[name]
            signal.append(frames[signal.ready_frames : stop, 50:51])
        while made.advance():
            pass
        counts.append(made.ready)
    assert counts == sorted(counts) and 0 < counts[1] < made.columns == counts[-1]
    for name, levels_db in whole.levels_db.items():
        np.testing.assert_allclose(made.levels_db[name], levels_db, atol=1e-3)


@pytest.mark.parametrize("space", [np.geomspace, np.linspace])
@pytest.mark.parametrize("bins", [65, 2049])
def test_no_partial_falls_between_two_rows_and_a_flat_spectrum_stays_flat(space: Callable[..., NDArray], bins: int):
    bin_hz = 8_000 / (bins - 1)
    rows, edges_hz = FrequencyRows(bins, bin_hz, 100, 50.0, space is np.geomspace), space(50.0, 8_000, 101)
    for bin_ in range(round(200 / bin_hz) + 1, bins - 1, 7):
        levels_db = np.full((1, bins), -100, np.float32)
        levels_db[0, bin_] = 0
        found = rows.of(levels_db)[0]
        row = int(found.argmax())
        width_hz = edges_hz[row + 1] - edges_hz[row]
        assert abs((edges_hz[row] + edges_hz[row + 1]) / 2 - bin_ * bin_hz) <= max(width_hz, bin_hz)
        assert found[row] == 0 or width_hz <= 2 * bin_hz
    assert rows.of(np.full((3, bins), -42, np.float32)) == pytest.approx(np.full((3, 100), -42))
