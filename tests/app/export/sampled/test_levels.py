from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from app.export.sampled.levels import headroom_db, velocity_levels
from app.export.sampled.plan import SampledPlan
from app.export.sampled.sample import StoredSample
from app.instruments.instrument import Instrument

InstrumentOf = Callable[..., Instrument]


def stored(level_db: float) -> StoredSample:
    return StoredSample(frames=64, channels=1, gain_db=0.0, level_db=level_db)


def rendered(instrument: Instrument, layers: int) -> list[int]:
    return [zone.velocity for zone in SampledPlan(instrument, (60, 60), layers=layers).zones]


def levels(instrument: Instrument, measured_db: list[float]) -> np.ndarray:
    layers = list(SampledPlan(instrument, (60, 60), layers=len(measured_db)).zones)
    return velocity_levels(instrument, layers, [stored(level) for level in measured_db])


def amplitudes_db(instrument: Instrument) -> np.ndarray:
    return 20 * np.log10([instrument.pluck.pluck(velocity).amplitude_mm for velocity in range(128)])


@pytest.mark.parametrize("curve", [-0.5, 0.0, 0.5])
def test_a_string_that_follows_its_plucks_does_so_at_every_velocity(
    curve: float, instrument_of: InstrumentOf
) -> None:
    instrument = instrument_of(pluck={"curve": curve})
    wanted = amplitudes_db(instrument)
    for layers in (1, 2, 3):
        np.testing.assert_allclose(levels(instrument, list(wanted[rendered(instrument, layers)])), wanted, atol=1e-9)


def test_what_was_measured_holds_where_it_was(instrument: Instrument) -> None:
    found = levels(instrument, [-40.0, -25.0, -22.0])
    first, second, third = rendered(instrument, 3)
    assert list(found[[first, second, third]]) == pytest.approx([-40, -25, -22])
    assert (np.diff(found[1:]) > 0).all()
    # as steep as between the nearest two
    assert found[first] - found[1] == pytest.approx(15 * (first - 1) / (second - first))
    assert found[127] - found[third] == pytest.approx(3 * (127 - third) / (third - second))


def test_plucks_of_one_strength_differ_in_width_alone(instrument_of: InstrumentOf) -> None:
    instrument = instrument_of(pluck={"softest_mm": 2.0, "hardest_mm": 2.0})
    first, second = rendered(instrument, 2)
    between = levels(instrument, [-30.0, -26.0])[first : second + 1]
    assert between == pytest.approx(np.linspace(-30, -26, second - first + 1))


def test_a_silent_layer_says_nothing(instrument: Instrument) -> None:
    amplitudes = amplitudes_db(instrument)
    hardest = rendered(instrument, 2)[-1]
    np.testing.assert_allclose(levels(instrument, [-120.0, -20.0]), amplitudes - amplitudes[hardest] - 20)


def test_headroom_is_up_to_the_loudest_velocity_of_a_layer(instrument: Instrument) -> None:
    layers = SampledPlan(instrument, (60, 60), layers=2).zones
    found = headroom_db(instrument, {zone: stored(level) for zone, level in zip(layers, [-30.0, -20.0], strict=True)})
    levels_db = levels(instrument, [-30.0, -20.0])
    assert list(found.values()) == pytest.approx([levels_db[63] + 30, levels_db[127] + 20])
    assert min(found.values()) > 1
