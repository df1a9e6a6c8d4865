"""The level of a key at each velocity: measured where it was rendered, else interpolated along the plucks' levels."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from app.export.sampled.plan import Zone
from app.export.sampled.sample import INAUDIBLE_DBFS, StoredSample
from app.instruments.instrument import VELOCITIES, Instrument

Levels = NDArray[np.float64]  # in dB, (128,), by velocity; 0 is as 1


def by_key(samples: Mapping[Zone, StoredSample]) -> Iterator[tuple[list[Zone], list[StoredSample]]]:
    """The layers of each key, from the softest to the hardest."""
    for key in dict.fromkeys(zone.key for zone in samples):
        layers = sorted((zone for zone in samples if zone.key == key), key=lambda zone: zone.velocity)
        yield layers, [samples[zone] for zone in layers]


def velocity_levels(instrument: Instrument, layers: list[Zone], stored: list[StoredSample]) -> Levels:
    """The levels of one key in dB; beyond the rendered velocities they follow the slope between the nearest two.

    Where a layer is silent, or there is only one, they follow the amplitudes of the plucks.
    """
    velocities = range(VELOCITIES[1] + 1)
    plucks_db = 20 * np.log10([instrument.pluck.pluck(velocity).amplitude_mm for velocity in velocities])
    rendered = [zone.velocity for zone in layers]
    measured_db = np.array([sample.level_db for sample in stored])
    if len(layers) < 2 or measured_db.min() <= INAUDIBLE_DBFS:
        return measured_db[-1] + plucks_db - plucks_db[rendered[-1]]
    # plucks of equal amplitude still differ in width, and so in level
    # (128,), the axis along which levels are interpolated
    along = plucks_db if np.ptp(plucks_db) > 0 else np.array(velocities, np.float64)
    places = along[rendered]  # (layers,), where levels are known
    slopes = np.diff(measured_db) / np.diff(places)
    levels_db = np.interp(along, places, measured_db)
    softer, harder = along < places[0], along > places[-1]
    levels_db[softer] = measured_db[0] + slopes[0] * (along[softer] - places[0])
    levels_db[harder] = measured_db[-1] + slopes[-1] * (along[harder] - places[-1])
    return levels_db


def headroom_db(instrument: Instrument, samples: Mapping[Zone, StoredSample]) -> dict[Zone, float]:
    """The headroom by zone, in dB: the level of its loudest velocity above that of the rendered one."""
    headrooms_db = {}
    for layers, stored in by_key(samples):
        levels_db = velocity_levels(instrument, layers, stored)
        for zone in layers:
            softest, hardest = zone.velocities
            headrooms_db[zone] = float(levels_db[softest : hardest + 1].max() - levels_db[zone.velocity])
    return headrooms_db
