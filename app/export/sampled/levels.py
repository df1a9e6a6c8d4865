"""How loud a key is at each velocity: measured where it was rendered, between them as the patch's plucks go."""

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
    """Of one key. Below the softest layer's own velocity it falls as steeply as from the next layer to that one.

    Where a layer is silent, or there is but one, the plucks' amplitudes alone say how it falls.
    """
    velocities = range(VELOCITIES[1] + 1)
    plucks_db = 20 * np.log10([patch.pluck.pluck(velocity).amplitude_mm for velocity in velocities])
    rendered = [zone.velocity for zone in layers]
    measured_db = np.array([sample.level_db for sample in stored])
    if len(layers) < 2 or measured_db.min() <= INAUDIBLE_DBFS:
        return measured_db[-1] + plucks_db - plucks_db[rendered[-1]]
    # a pluck that is as hard at any velocity has other widths still
    along = plucks_db if np.ptp(plucks_db) > 0 else np.array(velocities, np.float64)
    places = along[rendered]
    slope = (measured_db[1] - measured_db[0]) / (places[1] - places[0])
    below = measured_db[0] + slope * (along - places[0])
    return np.where(np.array(velocities) < rendered[0], below, np.interp(along, places, measured_db))
