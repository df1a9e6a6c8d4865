"""The body and room of an instrument, as the mixer takes them, and the body's effect on a key's loudness."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from app.audio.impulse_file import ImpulseError
from app.instruments.instrument import BodyChoice, Instrument
from app.player.bodies import own_impulse
from engine.effects import BODIES, Body, Effects
from engine.effects.body import curves_of


def effects_of(instrument: Instrument) -> Effects | None:
    """Amplifier, body and room of an instrument; None: it has none of them.

    A body that cannot be used is left out: see `body_problem`. The level, behind the amplifier, changes no drive.
    """
    effects = Effects(_body(instrument.body)[0], instrument.room if instrument.room.mix > 0 else None)
    if instrument.amp.drive_db > 0:
        return replace(effects, amp=instrument.amp, level_db=instrument.level_db)
    return None if effects == Effects() else effects


def added_words(instrument: Instrument) -> str:
    """The parts that an instrument adds to the sound of its strings or drums, for people."""
    parts = {
        "amplifier": instrument.amp.drive_db > 0,
        "body": bool(instrument.body.name) and instrument.body.mix > 0,
        "room": instrument.room.mix > 0,
        "sympathetic strings": instrument.sympathy_s_kg > 0,
        "level": True,
    }
    *others, last = [name for name, there in parts.items() if there]
    return f"{', '.join(others)} and {last}" if others else last


def body_problem(instrument: Instrument) -> str:
    """The reason why its body is not heard, in one line; "" where nothing is wrong."""
    problem = _body(instrument.body)[1]
    return problem and f"{instrument.name} is played without its body: {problem}"


def channels_of(instrument: Instrument, wheeled: bool = False) -> int:
    """The channels of an instrument: 2 with two listening points, a room, or a body of two channels, else 1.

    All of the engine's bodies have two.

    Args:
        wheeled: whether the modulation wheel is moved, which may bring in body or room.
    """
    if wheeled and instrument.mod_wheel in ("body.mix", "room.mix"):
        instrument = instrument.with_value(instrument.mod_wheel, 1.0)
    body = _body(instrument.body)[0]
    wide = body is not None and (body.impulse is None or body.impulse.samples.shape[1] == 2)
    return 2 if len(instrument.pickup.points) == 2 or instrument.room.mix > 0 or wide else 1


def body_curves(instrument: Instrument) -> NDArray[np.float64] | None:
    """The curves of an instrument's body, whose resonances favour some keys, at whatever mix; None: it has none."""
    body = _body(instrument.body.model_copy(update={"mix": 1.0}))[0]
    return None if body is None else curves_of(body)


def _body(chosen: BodyChoice) -> tuple[Body | None, str]:
    """The chosen body and ""; or None and the reason why it cannot be used, "" where no body is chosen."""
    if not chosen.name or chosen.mix == 0:
        return None, ""
    if chosen.name in BODIES:
        return Body(chosen.mix, chosen.size, chosen.name), ""
    try:
        return Body(chosen.mix, chosen.size, impulse=own_impulse(chosen.name)), ""
    except ImpulseError as error:
        return None, str(error)
