"""Entries of a native plug-in: the functions that its C shell calls, with addresses and counts as plain numbers.

They are compiled for other systems too (`app.export.plugin.objects`), so nothing here or below may need Python.
"""

from __future__ import annotations

import numpy as np
from numba import carray, types

from engine.kernels import amplifier, contact, convolver, kit, mixer, prepared, sympathy
from engine.kernels.compiled import kernel
from engine.kernels.memory import convolver_at as record_of_convolver
from engine.kernels.memory import mixer_at as record_of_mixer
from engine.kernels.memory import pointer
from engine.kernels.playing import events

ADDRESS = COUNT = types.int64
RENDER = types.void(ADDRESS, COUNT, ADDRESS)
BEGIN = types.void(ADDRESS)
PLAY = SOUND = SYMPATHISE = KIT_BEGIN = types.void(ADDRESS, ADDRESS)
KIT_FOLLOW = types.void(ADDRESS, COUNT, types.float64)
KIT_PREPARE = types.void(ADDRESS, ADDRESS, ADDRESS)
MEASURE = types.void(ADDRESS, types.float64, types.float64, types.float64, ADDRESS)
PREPARE = types.void(ADDRESS, ADDRESS, types.float64, types.float64, types.float64, ADDRESS, ADDRESS)
WEIGH = types.void(ADDRESS, types.float64, types.float64, ADDRESS)
MIX = types.void(ADDRESS, ADDRESS, ADDRESS, COUNT, COUNT)
BEGIN_CONVOLVER = types.void(ADDRESS, types.float64, COUNT)
DRIVE = types.void(ADDRESS, types.float64, types.float64, types.float64)


@kernel
def render(mixer_at: int, frames: int, out_at: int) -> None:
    """The next frames of a mixer, float32 (frames, 2)."""
    mixer.render(record_of_mixer(mixer_at), frames, carray(pointer(out_at), (2 * frames,), np.float32), 0.0)


begin = events.begin
play = events.play
sound = contact.sound
sympathise = sympathy.sympathise
kit_begin = kit.begin
kit_follow = kit.follow
kit_prepare = kit.prepare
measure = prepared.measure
prepare = prepared.prepare
weigh = prepared.weigh
mix = prepared.mix


@kernel
def begin_convolver(convolver_at: int, rate_hz: float, frames: int) -> None:
    """Set up a convolver's memory, which is all 0, for responses of so many frames."""
    convolver.begin(record_of_convolver(convolver_at), rate_hz, frames)


@kernel
def drive(mixer_at: int, drive_db: float, tone_db: float, level_db: float) -> None:
    """Set the amplifier of a mixer."""
    amplifier.drive(record_of_mixer(mixer_at), drive_db, tone_db, level_db)
