"""Strings that nobody plays, and that ring with those that are: coupling through the bridge, in one direction.

The force F of the strings that are played moves the bridge, by its conductance G. That motion drives each partial of
a string at rest, whose own force on the bridge is, near its resonance,

    H(s) = -2 σ_b s / (s² + 2σ s + ω²),      σ_b = T G/ℓ ≤ σ,

σ_b being what the partial itself loses to the bridge (`engine.resonators.polarised`), and σ all that it loses.
Nothing rings up: |H| is at most σ_b/σ ≤ 1, the poles have the decay of the string, and nothing leads back from these
strings to those that are played, or to one another. So all that is given is bounded by the sum of σ_b/σ times the
largest input.

A string that is played leaves the bank until its note has ended: its voice has its modes. What other strings would
add to it is left out. A stop touches all strings.
"""

from __future__ import annotations

import math

import numpy as np
from numba import carray, njit

from engine.kernels import layout as at
from engine.kernels import playing_layout as of
from engine.kernels import strings
from engine.kernels.compiled import COMPILED
from engine.kernels.memory import pointer
from engine.kernels.playing.keys import string_of

HIGHEST_HZ = 4_000.0  # of partials: an estimate, above it boards pass hardly anything to other strings
PARTIALS = 8  # of a string
STOPS = 0.98  # what is left in a frame of a string that is touched
NOTHING = 1e-12  # of full scale: below it all rest


@njit(**COMPILED)
def tune(player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray) -> None:
    """Fills the bank with the strings of an instrument: of every key, or the open ones of a set."""
    own = player[of.PLAYER_STRINGS + 3 * of.STRING : of.PLAYER_STRINGS + 4 * of.STRING]
    count, rate_hz, everyone = 0, player[of.PLAYER_RATE], tables[of.TABLE_SYMPATHY] == of.EVERY_KEY
    for number in range(of.KEYS if everyone else tables[of.TABLE_STRINGS]):
        if everyone:
            inside = tables[of.TABLE_LOW] <= number <= tables[of.TABLE_HIGH]
            key, string, pitch_hz = number, -1, table[of.TABLE_PITCHES + number] if inside else 0.0
        else:
            first = of.TABLE_OPEN + number * of.OPEN_SLOTS
            key, string = int(table[first + of.OPEN_NOTE]), number
            pitch_hz = table[first + of.OPEN_HZ]
        if not pitch_hz > 0.0:
            continue
        modes, _ = string_of(player, players, table, tables, key, string, pitch_hz, False, own)
        lost = table[of.TABLE_SYMPATHY_S_KG] * own[of.TENSION] / own[of.LENGTH]
        for partial in range(1, min(modes, PARTIALS) + 1):
            omega = math.sqrt(strings.omega_squared(own, partial))
            if count == of.MOST_SYMPATHETIC or omega > 2 * math.pi * HIGHEST_HZ:
                break
            lossy = table[of.TABLE_LOSSES], table[of.TABLE_LOSSES + 1], table[of.TABLE_LOSSES + 2]
            sigma = strings.decay_rate(own, partial) + lost + strings.loss(own, partial, *lossy)
            shrunk = math.exp(-sigma / rate_hz)
            place = of.PLAYER_SYMPATHY + count
            players[place + of.SYMPATHY_OWNER * of.MOST_SYMPATHETIC] = number
            player[place + of.SYMPATHY_COSINE * of.MOST_SYMPATHETIC] = shrunk * math.cos(omega / rate_hz)
            player[place + of.SYMPATHY_SINE * of.MOST_SYMPATHETIC] = shrunk * math.sin(omega / rate_hz)
            player[place + of.SYMPATHY_GAIN * of.MOST_SYMPATHETIC] = -2 * lost / rate_hz
            player[place + of.SYMPATHY_X * of.MOST_SYMPATHETIC] = 0.0
            player[place + of.SYMPATHY_Y * of.MOST_SYMPATHETIC] = 0.0
            count += 1
    players[of.PLAYER_SYMPATHETIC] = count


@njit(**COMPILED)
def ring(
    x: np.ndarray,
    y: np.ndarray,
    cosine: np.ndarray,
    sine: np.ndarray,
    gain: np.ndarray,
    played: np.ndarray,
    force: np.ndarray,
    out: np.ndarray,
) -> float:
    """Adds the force of partials (count,) that a force (frames,) drives to out (frames,); the largest of x² + y².

    Args:
        played: 1 for partials of strings that are played, which are stopped, else 0.
    """
    for frame in range(len(force)):
        driven, total = force[frame], 0.0
        for n in range(len(x)):
            left = 1.0 - (1.0 - STOPS) * played[n]
            turned = left * (cosine[n] * x[n] - sine[n] * y[n]) + (1.0 - played[n]) * driven
            y[n] = left * (sine[n] * x[n] + cosine[n] * y[n])
            x[n] = turned
            total += gain[n] * turned
        out[frame] += total
    largest = 0.0
    for n in range(len(x)):
        largest = max(largest, gain[n] * gain[n] * (x[n] * x[n] + y[n] * y[n]))
    return largest


@njit(**COMPILED)
def sympathise(player_address: int, mixer_address: int) -> None:
    """Adds what strings ring that are not played to the mixer's quantum, both channels alike."""
    player = carray(pointer(player_address), (1 << 40,), np.float64)
    players = carray(pointer(player_address), (1 << 40,), np.int64)
    address = players[of.PLAYER_TABLE]
    if address == 0:
        return
    table = carray(pointer(address), (1 << 40,), np.float64)
    tables = carray(pointer(address), (1 << 40,), np.int64)
    if (
        players[of.PLAYER_TUNED] != tables[of.TABLE_INSTRUMENT]
        or players[of.PLAYER_TUNED_BY] != tables[of.TABLE_SYMPATHY]
    ):
        players[of.PLAYER_SYMPATHETIC] = 0
        if tables[of.TABLE_SYMPATHY] != of.NO_SYMPATHY:
            tune(player, players, table, tables)
        players[of.PLAYER_TUNED], players[of.PLAYER_TUNED_BY] = tables[of.TABLE_INSTRUMENT], tables[of.TABLE_SYMPATHY]
    count, size = players[of.PLAYER_SYMPATHETIC], of.MOST_SYMPATHETIC
    if count == 0:
        return
    mixer = carray(pointer(mixer_address), (at.MIXER_SLOTS,), np.float64)
    mix = mixer[at.M_MIX : at.M_MIX + 2 * at.QUANTUM].reshape(at.QUANTUM, 2)
    force, out = (
        mixer[at.M_SCRATCH : at.M_SCRATCH + at.QUANTUM],
        mixer[at.M_SCRATCH + at.QUANTUM : at.M_SCRATCH + 2 * at.QUANTUM],
    )
    heard = False
    for frame in range(at.QUANTUM):
        given = 0.5 * (mix[frame, 0] + mix[frame, 1])
        force[frame] = given if abs(given) < at.LARGEST else 0.0  # also where it is not a number
        heard = heard or abs(given) > NOTHING
        out[frame] = 0.0
    if not heard and players[of.PLAYER_SYMPATHY_RINGS] == 0:
        players[of.PLAYER_SYMPATHY_STOPS] = 0
        return
    everyone = tables[of.TABLE_SYMPATHY] == of.EVERY_KEY
    first = of.PLAYER_SYMPATHY
    owners = players[first + of.SYMPATHY_OWNER * size : first + of.SYMPATHY_OWNER * size + count]
    played = player[first + of.SYMPATHY_PLAYED * size : first + of.SYMPATHY_PLAYED * size + count]
    played[:] = 0.0
    if players[of.PLAYER_SYMPATHY_STOPS] > 0:
        players[of.PLAYER_SYMPATHY_STOPS] -= 1
        played[:] = 1.0
    for number in range(of.MOST_NOTES):
        note = of.PLAYER_NOTES + number * of.NOTE_SLOTS
        if players[note + of.NOTE_STATE] != of.RINGS:
            continue
        string = players[note + of.NOTE_KEY]
        if not everyone:
            string = players[note + of.NOTE_STRING]
            if string < 0:
                for each in range(tables[of.TABLE_STRINGS]):
                    string = each
                    if table[of.TABLE_OPEN + each * of.OPEN_SLOTS + of.OPEN_NOTE] <= players[note + of.NOTE_KEY]:
                        break
        for n in range(count):
            if owners[n] == string:
                played[n] = 1.0
    largest = ring(
        player[first + of.SYMPATHY_X * size : first + of.SYMPATHY_X * size + count],
        player[first + of.SYMPATHY_Y * size : first + of.SYMPATHY_Y * size + count],
        player[first + of.SYMPATHY_COSINE * size : first + of.SYMPATHY_COSINE * size + count],
        player[first + of.SYMPATHY_SINE * size : first + of.SYMPATHY_SINE * size + count],
        player[first + of.SYMPATHY_GAIN * size : first + of.SYMPATHY_GAIN * size + count],
        played,
        force,
        out,
    )
    rings = largest > NOTHING * NOTHING
    players[of.PLAYER_SYMPATHY_RINGS] = rings
    if not rings and not heard:
        player[first + of.SYMPATHY_X * size : first + (of.SYMPATHY_Y + 1) * size] = 0.0
    for frame in range(at.QUANTUM):
        mix[frame, 0] += out[frame]
        mix[frame, 1] += out[frame]
