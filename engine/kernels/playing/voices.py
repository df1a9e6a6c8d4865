"""Voices of a note in the player's memory: made, heard from points, led to other modes, and faded out.

A voice is known by its address. A *wish* is a block of modes that it is to have from a frame on; see WISH.

`frame` is the mixer's frame at which something counts (0: at once), `now` the first frame of its next quantum.
"""

from __future__ import annotations

import math

import numpy as np

from engine.kernels import constants as of
from engine.kernels import drums, javari, recorded, strings, tension
from engine.kernels import voice_records as at
from engine.kernels.compiled import kernel
from engine.kernels.memory import fence, table_at, voice_at, wish_at
from engine.kernels.mixer_records import Mixer
from engine.kernels.modes import TOO_HIGH, motion, row, rows, run_up, weights
from engine.kernels.playing import channels, keys, slots
from engine.kernels.records import Note, Player, Table
from engine.levels import FULL_SCALE_M, FULL_SCALE_N, LEAST_PEAK_M, RUNAWAY_FACTOR

WISH_BYTES = at.WISH.itemsize


@kernel
def weight_of(string_row: np.ndarray, partial: int, place: float, aperture_m: float) -> float:
    """The level at a listening point of a partial's amplitude of 1 m, re full scale, averaged over an aperture."""
    if place == of.BRIDGE:
        return strings.bridge_force(string_row, partial) / FULL_SCALE_N
    half = math.pi * partial * aperture_m / (2 * string_row[of.LENGTH])
    averaged = math.sin(half) / half if half > 1e-6 else 1.0
    return averaged * math.sin(math.pi * partial * place) / FULL_SCALE_M


@kernel
def _weigh(player: Player, voice: at.Voice, which: int, note: Note) -> None:
    """Set one of the two sets of weights of a voice for the points of its note; modes too high are not heard."""
    solo, pairs = note.solo, note.pairs
    string_row, highest = note.own, TOO_HIGH * player.rate_hz
    for mode in range(note.modes):
        partial = strings.partial_of(mode, pairs)
        part = note.heard[strings.direction_of(mode, pairs)]
        sigma = strings.decay_rate(string_row, partial)
        omega = math.sqrt(max(strings.omega_squared(string_row, partial) - sigma * sigma, 0.0))
        for point in range(note.points):
            weight = weight_of(string_row, partial, note.point[point], note.aperture_m)
            audible = omega <= highest and (solo == 0 or solo == partial)
            weights(voice, which, point, 0)[mode] = part * weight if audible else 0.0
            weights(voice, which, point, 1)[mode] = 0.0
    at_bridge = note.point[0] == of.BRIDGE and solo == 0
    voice.javari.heard = note.heard[0] / FULL_SCALE_N if at_bridge else 0.0


@kernel
def fill(player: Player, table: Table, note: Note, string: np.ndarray, out: np.ndarray) -> None:
    """Write ω², σ, k, η² and the bridge's part of a note's modes, (5 modes,), of its string as it is now."""
    losses = keys.value_of(player, table, of.VALUE.knobs_decay)
    inside = keys.value_of(player, table, of.VALUE.knobs_brightness_decay)
    conductance = losses * note.conductance[0], losses * note.conductance[1]
    by_mode = losses * note.losses[0], inside * note.losses[1], inside * note.losses[2]
    strings.rows(string, note.modes, note.pairs, note.detuning, conductance, by_mode, out)
    if note.mute > 0.0:
        strings.mute(string, note.modes, note.pairs, note.mute, out)
    if note.touched > 0:
        strings.touch(string, note.modes, note.pairs, note.touched, out)
    if table.recorded != 0:
        recorded.correct(keys.additions(table), string, note.modes, out)
    shared = note.bridge * losses * note.conductance[0], note.bridge * losses * note.conductance[1]
    strings.stand(string, note.modes, min(note.pairs, of.MOST_PAIRS), shared, out)


@kernel
def make_voice(player: Player, table: Table, address: int, note: Note, source: int) -> None:
    """Make a source's voice at an address, with the modes of a note's own string.

    It sets out with the amplitudes in `player.amplitudes`; where strings are struck, with speeds instead.
    """
    rate_hz, n = player.rate_hz, note.modes
    voice = slots.blank_voice(player, table, address, source, n, at.TRUTH_ROWS)
    voice.points = note.points
    voice.velocity = table.velocity
    voice.nearness = table.nearness
    voice.attack, peak = round(at.ATTACK_S * rate_hz), max(note.highest_m, LEAST_PEAK_M)
    brighter = at.BRIGHTER if table.velocity != 0 else 1.0
    voice.peak, voice.limit = peak, RUNAWAY_FACTOR * peak / FULL_SCALE_M * brighter
    amplitudes, speeds = motion(voice)
    amplitudes[:] = player.amplitudes[:n]
    fill(player, table, note, note.own, rows(voice, at.OMEGA_SQUARED, at.RESONATOR_ROWS))
    if note.bridge > 0.0:
        voice.bridged = 2 * min(note.pairs, of.MOST_PAIRS)
    squares = row(voice, at.OMEGA_SQUARED)
    for mode in range(n if table.strikes != 0 else 0):
        speeds[mode] = amplitudes[mode] * math.sqrt(squares[mode])
        amplitudes[mode] = 0.0
    if table.javari[0] > 0.0:
        javari.fit(voice, note.own, note.pairs, table.javari, rate_hz)
    behind = lag_of(player, table, note.member)  # frames that it moves alone before it begins
    if behind > 0:
        run_up(voice, behind / rate_hz)
    _weigh(player, voice, 0, note)
    if note.point[0] == of.BRIDGE:
        largest, point_weights = 0.0, weights(voice, 0, 0, 0)
        for mode in range(n):
            largest += abs(player.amplitudes[mode] * point_weights[mode])
        voice.limit = max(voice.limit, RUNAWAY_FACTOR * largest)


@kernel
def swing_m(note: Note) -> float:
    """The swing of a note's string now in m: the root of its modes' summed squares. 0: it is over."""
    for address in note.voices:
        if slots.voice_over(address):
            continue
        voice, squared = voice_at(address), 0.0
        q, v = motion(voice)
        squares = row(voice, at.OMEGA_SQUARED)
        if voice.kind == at.TENSION and voice.prepared != 0:
            q, v = row(voice, at.PHYSICAL), row(voice, at.PHYSICAL + 1)
            tension.physical(voice, q, v)
        for mode in range(voice.modes):
            squared += q[mode] * q[mode] + v[mode] * v[mode] / squares[mode]
        return math.sqrt(squared)
    return 0.0


@kernel
def release(address: int, frames: int) -> None:
    """Let a voice fade out; a release under way continues."""
    voice = voice_at(address)
    if voice.release == 0:
        voice.release = frames


@kernel
def release_note(player: Player, note: Note, seconds: float, frame: int) -> None:
    """Let a note fade out; from a frame to come on, where that is above 0."""
    note.released = 1
    for address in note.voices:
        if address != 0 and frame > 0:
            voice_at(address).release_at = frame
        elif address != 0:
            release(address, slots.frames(player, seconds))


@kernel
def _due(address: int, now: int) -> int:
    """The mixer's latest frame at which a wish may count and still be followed in a voice's next quantum."""
    voice = voice_at(address)
    due, before = now + voice.late, voice.previous_voice
    if voice.state == at.WAITING:
        due = max(due, voice.begin_at)
        if before != 0 and voice.stops_in == 0 and voice_at(before).state == at.SOUNDING:
            due = now + voice_at(before).late
    return due


@kernel
def add_wish(player: Player, note: Note, source: int, seconds: float, frame: int, now: int) -> int:
    """The address of a wish for the modes that a voice is to have from a frame on: linked, its rows to be filled.

    At most two are still to be reached: those that are due in this quantum, and those for the next.
    """
    voice, due = voice_at(note.voices[source]), _due(note.voices[source], now)
    latest = voice.resonator
    first = voice.pending_modes if latest == 0 else wish_at(latest).next
    tail, block_address = 0, first
    while block_address != 0:
        tail = block_address
        block_address = wish_at(block_address).next
    free = 0
    if tail == 0 or (wish_at(tail).at <= due) != (frame <= due):
        size = WISH_BYTES + 8 * at.RESONATOR_ROWS * player.modes
        end = slots.address_of_voice(player, note.number, source + 1)
        for place in range(of.BLOCKS):
            block = end - (of.BLOCKS - place) * size
            used, block_address = block in (latest, voice.current_modes), first
            while block_address != 0 and not used:
                used = block_address == block
                block_address = wish_at(block_address).next
            if not used:
                free = block
    if free == 0:
        free = tail  # the latest counts
    wish = wish_at(free)
    wish.quanta = slots.quanta(player, seconds)
    wish.next = 0
    wish.at = frame
    if free != tail and tail != 0:
        wish_at(tail).next = free
    elif free != tail and latest != 0:
        wish_at(latest).next = free
    elif free != tail:
        voice.pending_modes = free
    return free


@kernel
def take_out(mixer: Mixer, address: int) -> None:
    """Take a voice out of the mixer at once; it is over."""
    kept = 0
    for place in range(mixer.active):
        other = mixer.voices[place]
        if other != address:
            mixer.voices[kept] = other
            kept += 1
            if voice_at(other).previous_voice == address:
                voice_at(other).previous_voice = 0
    mixer.active = kept
    fence()
    voice_at(address).state = at.OVER


@kernel
def lag_of(player: Player, table: Table, member: int) -> int:
    """The frames from the stroke of a course's string to its beginning, in step with the first; 0: at once."""
    later = round(member * table.apart_s * player.rate_hz)
    return -later % of.QUANTUM if table.bridge > 0.0 else 0


@kernel
def hear(player: Player) -> None:
    """Let notes follow the gains of sources, their channels' loudness, the javari's gap and the listening points."""
    if player.table == 0:
        return
    table = table_at(player.table)
    for note in player.notes:
        if note.state != of.RINGS:
            continue
        gain = note.gain * channels.loudness(player, table.mode, note.channel)
        for source in range(of.MOST_SOURCES):
            if note.voices[source] != 0:
                voice = voice_at(note.voices[source])
                voice.wanted_gain = gain * player.source_gains[source]
                if voice.javari.steps != 0:
                    voice.javari.gap_m = keys.value_of(player, table, of.VALUE.javari_gap_um) * 1e-6
        _listen(player, table, note)


@kernel
def _listen(player: Player, table: Table, note: Note) -> None:
    """Let a note fade to the instrument's present points and solo, where these have changed.

    It stays as it is where the points are others in number or of another pick-up, or a fade is under way.
    """
    moved = note.solo != table.solo  # whether anything has changed
    for point in range(2):
        moved = moved or note.point[point] != player.values[of.VALUE.pickup_points_0 + point]
    if not moved or note.points != table.points:
        return
    for address in note.voices:
        if address != 0 and not _may_move(table, note, voice_at(address)):
            return
    note.solo = table.solo
    for point in range(2):
        note.point[point] = player.values[of.VALUE.pickup_points_0 + point]
    for address in note.voices:
        if address != 0:
            voice = voice_at(address)
            if note.drum != 0:
                drums.weigh(player, table, voice, 1, note.key)
            else:
                _weigh(player, voice, 1, note)
            voice.weights_faded = 0
            voice.next_weights = 1


@kernel
def _may_move(table: Table, note: Note, voice: at.Voice) -> bool:
    """Return True if a voice of a note can be heard at other points of the instrument."""
    if note.drum != 0 and not drums.has_modes(table, note.key, voice.modes):
        return False
    return voice.next_weights == 0 and (note.drum != 0 or voice.velocity == table.velocity)
