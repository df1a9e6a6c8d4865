"""The level of a key at each velocity: measured where it was rendered, else interpolated along the plucks' levels."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from app.export.sampled.plan import Zone
from app.export.sampled.sample import INAUDIBLE_DBFS
from app.export.sampled.store import StoredSample
from app.patches.patch import VELOCITIES, Patch

Levels = NDArray[np.float64]  # in dB, (128,), by velocity; 0 is as 1


def by_key(samples: Mapping[Zone, StoredSample]) -> Iterator[tuple[list[Zone], list[StoredSample]]]:
    """The layers of each key, from the softest to the hardest."""
    for key in dict.fromkeys(zone.key for zone in samples):
        layers = sorted((zone for zone in samples if zone.key == key), key=lambda zone: zone.velocity)
        yield layers, [samples[zone] for zone in layers]


def velocity_levels(patch: Patch, layers: list[Zone], stored: list[StoredSample]) -> Levels:
    """The levels of one key. Below the softest layer's velocity they fall as steeply as from the next layer to it.

    Where a layer is silent, or there is only one, they follow the amplitudes of the plucks.
    """
    velocities = range(VELOCITIES[1] + 1)
    plucks_db = 20 * np.log10([patch.pluck.pluck(velocity).amplitude_mm for velocity in velocities])
    rendered = [zone.velocity for zone in layers]
    measured_db = np.array([sample.level_db for sample in stored])
    if len(layers) < 2 or measured_db.min() <= INAUDIBLE_DBFS:
        return measured_db[-1] + plucks_db - plucks_db[rendered[-1]]
    # plucks of equal amplitude still differ in width, and so in level
    along = plucks_db if np.ptp(plucks_db) > 0 else np.array(velocities, np.float64)
    places = along[rendered]
    slope = (measured_db[1] - measured_db[0]) / (places[1] - places[0])
    below = measured_db[0] + slope * (along - places[0])
    return np.where(np.array(velocities) < rendered[0], below, np.interp(along, places, measured_db))
