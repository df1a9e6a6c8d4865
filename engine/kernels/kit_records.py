"""The records of a kit: the drums of a plug-in, and its keys."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

from engine.kernels import constants as of
from engine.kernels.drum_modes import DRUM
from engine.kernels.fields import R, W

# Records, as annotations of kernels
Kit: TypeAlias = Any
KitKey: TypeAlias = Any

FOLLOWED = (of.MODULUS_FACTOR, of.DECAY, of.BRIGHTNESS_DECAY, of.POINT, of.POINT + 1)  # values that move drums

KIT_DRUM = np.dtype(
    [
        ("drum", R, DRUM),  # with its blow
        ("around", W),  # slot of what is around a mode, (SURFACE, listed)
        ("listed", W),
        ("air", W),  # slot of the terms of the air, (2, low, terms)
        ("low", W),
        ("terms", W),
        ("reach", R),  # of the air
    ]
)

KIT_KEY = np.dtype(
    [
        ("drum", W),  # slot of its `KIT_DRUM`; 0: it has none
        ("ratio", R),
        ("softest_m_s", R),
        ("hardest_m_s", R),
        ("stale", W),  # sum of what of it has changed
        ("modes", W),
        ("tuned", R, DRUM),  # its drum as it is tuned
    ]
)

KIT = np.dtype(
    [
        ("highest_hz", R),
        ("capacity", W),  # modes of a key
        ("most", W),  # modes of a surface
        ("bessels", W),  # slot of a table of Bessel functions, …
        ("steps", W),  # … its rows …
        ("columns", W),  # … and columns
        ("work", W),  # slot of room to work in
        ("found", W),  # slot of the modes of all keys, (KEYS, ROWS, capacity)
        ("stale", W),  # whether any key is
        ("values", R, len(FOLLOWED)),
        ("keys", KIT_KEY, of.KEYS),
    ]
)
"""Slots count from its beginning; what they point to follows the record."""
