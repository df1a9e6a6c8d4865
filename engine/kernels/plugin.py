"""Entries of a native plug-in: the functions that its C shell calls, with addresses and counts as plain numbers.

They are compiled for other systems too (`app.export.plugin.objects`), so nothing here or below may need Python.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numba import carray, types

from engine.kernels import amplifier, contact, convolver, kit, mixer, prepared, sympathy
from engine.kernels.compiled import kernel
from engine.kernels.memory import convolver_at as record_of_convolver
from engine.kernels.memory import mixer_at as record_of_mixer
from engine.kernels.memory import pointer
from engine.kernels.playing import events


@kernel
def render(mixer_at: int, frames: int, out_at: int) -> None:
    """The next frames of a mixer, float32 (frames, 2)."""
    mixer.render(record_of_mixer(mixer_at), frames, carray(pointer(out_at), (2 * frames,), np.float32), 0.0)


@kernel
def begin_convolver(convolver_at: int, rate_hz: float, frames: int) -> None:
    """Set up a convolver's memory, which is all 0, for responses of so many frames."""
    convolver.begin(record_of_convolver(convolver_at), rate_hz, frames)


@kernel
def drive(mixer_at: int, drive_db: float, tone_db: float, level_db: float) -> None:
    """Set the amplifier of a mixer."""
    amplifier.drive(record_of_mixer(mixer_at), drive_db, tone_db, level_db)


ADDRESS, COUNT, REAL = types.int64, types.int64, types.float64
ENTRIES: Mapping[str, tuple[Any, tuple[Any, ...]]] = {  # the kernel of each, and its arguments
    "render": (render, (ADDRESS, COUNT, ADDRESS)),
    "begin": (events.begin, (ADDRESS,)),
    "play": (events.play, (ADDRESS, ADDRESS)),
    "sound": (contact.sound, (ADDRESS, ADDRESS)),
    "sympathise": (sympathy.sympathise, (ADDRESS, ADDRESS)),
    "kit_begin": (kit.begin, (ADDRESS, ADDRESS)),
    "kit_follow": (kit.follow, (ADDRESS, COUNT, REAL)),
    "kit_prepare": (kit.prepare, (ADDRESS, ADDRESS, ADDRESS)),
    "measure": (prepared.measure, (ADDRESS, REAL, REAL, REAL, ADDRESS)),
    "prepare": (prepared.prepare, (ADDRESS, ADDRESS, REAL, REAL, REAL, ADDRESS, ADDRESS)),
    "weigh": (prepared.weigh, (ADDRESS, REAL, REAL, ADDRESS)),
    "mix": (prepared.mix, (ADDRESS, ADDRESS, ADDRESS, COUNT, COUNT)),
    "begin_convolver": (begin_convolver, (ADDRESS, REAL, COUNT)),
    "drive": (drive, (ADDRESS, REAL, REAL, REAL)),
}
