"""Strings that nobody plays, and that ring with those that are: coupling through the bridge, in one direction.

The force F of the strings that are played moves the bridge, by its conductance G. That motion drives each partial of
a string at rest, whose own force on the bridge is, near its resonance,

    H(s) = -2 σ_b s / (s² + 2σ s + ω²),      σ_b = T G/ℓ ≤ σ,

σ_b being what the partial itself loses to the bridge (`engine.values.string`), and σ all that it loses.
Nothing rings up: |H| is at most σ_b/σ ≤ 1, the poles have the decay of the string. Nothing leads back from these
strings to those that are played, or to one another. So all that is given is bounded by the sum of σ_b/σ times the
largest input.

A string that is played leaves the bank until its note has ended: its voice has its modes. What other strings would
add to it is left out. A stop touches all strings.
"""

from __future__ import annotations

import math

import numpy as np

from engine.kernels import constants as of
from engine.kernels import strings
from engine.kernels.compiled import kernel
from engine.kernels.memory import mixer_at, player_at, table_at
from engine.kernels.mixer_records import LARGEST
from engine.kernels.playing.keys import pitch_of, string_of
from engine.kernels.records import Player, Sympathy, Table

HIGHEST_HZ = 4_000.0  # of partials: an estimate, above it boards pass hardly anything to other strings
PARTIALS = 8  # of a string
STOPS = 0.98  # what is left in a frame of a string that is touched
NOTHING = 1e-12  # of full scale: below it all rest


@kernel
def tune(player: Player, table: Table) -> None:
    """Fill the bank with the strings of an instrument: of every key, or the open ones of a set."""
    string_row, bank = player.own, player.sympathy
    count, rate_hz = 0, player.rate_hz
    everyone = table.sympathy == of.EVERY_KEY
    for number in range(of.KEYS if everyone else table.strings):
        key = number
        string = -1
        pitch_hz = pitch_of(table, number)
        if not everyone:
            key = int(table.open[number].note)
            string = number
            pitch_hz = table.open[number].pitch_hz
        if not pitch_hz > 0.0:
            continue
        modes, _ = string_of(player, table, key, string, pitch_hz, False, string_row)
        lost = table.sympathy_s_kg * string_row[of.TENSION] / string_row[of.LENGTH]
        for partial in range(1, min(modes, PARTIALS) + 1):
            omega = math.sqrt(strings.omega_squared(string_row, partial))
            if count == of.MOST_SYMPATHETIC or omega > 2 * math.pi * HIGHEST_HZ:
                break
            lossy = table.losses[0], table.losses[1], table.losses[2]
            sigma = strings.decay_rate(string_row, partial) + lost + strings.loss(string_row, partial, *lossy)
            shrunk = math.exp(-sigma / rate_hz)
            bank.owner[count] = number
            bank.cosine[count] = shrunk * math.cos(omega / rate_hz)
            bank.sine[count] = shrunk * math.sin(omega / rate_hz)
            bank.gain[count] = -2 * lost / rate_hz
            bank.x[count] = 0.0
            bank.y[count] = 0.0
            count += 1
    bank.partials = count


@kernel
def ring(bank: Sympathy, force: np.ndarray, out: np.ndarray) -> float:
    """Add the force of partials that a force (frames,) drives to `out` (frames,).

    Return the largest gain² (x² + y²) of any partial: the square of its swing, re full scale.
    """
    count = bank.partials
    x, y = bank.x[:count], bank.y[:count]
    cosine, sine = bank.cosine[:count], bank.sine[:count]
    gain, played = bank.gain[:count], bank.played[:count]
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


@kernel
def sympathise(player_address: int, mixer_address: int) -> None:
    """Add what strings ring that are not played to the mixer's quantum, both channels alike."""
    player = player_at(player_address)
    if player.table == 0:
        return
    table, bank = table_at(player.table), player.sympathy
    if bank.instrument != table.instrument or bank.kind != table.sympathy:
        bank.partials = 0
        if table.sympathy != of.NO_SYMPATHY:
            tune(player, table)
        bank.instrument, bank.kind = table.instrument, table.sympathy
    count = bank.partials
    if count == 0:
        return
    mixer, driven = mixer_at(mixer_address), False
    mix = mixer.mix[:]
    force = mixer.scratch[: of.QUANTUM]
    out = mixer.scratch[of.QUANTUM : 2 * of.QUANTUM]
    for frame in range(of.QUANTUM):
        mono = 0.5 * (mix[frame, 0] + mix[frame, 1])
        force[frame] = mono if abs(mono) < LARGEST else 0.0  # also where it is not a number
        driven = driven or abs(mono) > NOTHING
        out[frame] = 0.0
    if not driven and bank.rings == 0:
        bank.stops = 0
        return
    everyone = table.sympathy == of.EVERY_KEY
    played = bank.played[:count]
    played[:] = 0.0
    if bank.stops > 0:
        bank.stops -= 1
        played[:] = 1.0
    for note in player.notes:
        if note.state != of.RINGS:
            continue
        string = note.key if everyone else note.string
        if string < 0:
            string = strings.chosen(table.open, table.strings, note.key)
        for n in range(count):
            if bank.owner[n] == string:
                played[n] = 1.0
    largest = ring(bank, force, out)
    rings = largest > NOTHING * NOTHING
    bank.rings = rings
    if not rings and not driven:
        bank.x[:count] = 0.0
        bank.y[:count] = 0.0
    for frame in range(of.QUANTUM):
        mix[frame, 0] += out[frame]
        mix[frame, 1] += out[frame]
