"""Voices of a note in the player's memory: made, heard from points, led to other modes, and faded out."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from engine.kernels import constants as of
from engine.kernels import drums, javari, recorded, strings, tension
from engine.kernels import layout as at
from engine.kernels.compiled import COMPILED
from engine.kernels.memory import fence, reals, table_at, wholes
from engine.kernels.modes import TOO_HIGH, row, run_up
from engine.kernels.playing import channels, keys, slots
from engine.kernels.records import Note, Player, Table
from engine.levels import FULL_SCALE_M, FULL_SCALE_N, LEAST_PEAK_M, RUNAWAY_FACTOR


@njit(**COMPILED)
def weight_of(own: np.ndarray, partial: int, place: float, aperture_m: float) -> float:
    """The level at a listening point of a partial's amplitude of 1 m, re full scale, averaged over an aperture."""
    if place == of.BRIDGE:
        return strings.bridge_force(own, partial) / FULL_SCALE_N
    half = math.pi * partial * aperture_m / (2 * own[of.LENGTH])
    averaged = math.sin(half) / half if half > 1e-6 else 1.0
    return averaged * math.sin(math.pi * partial * place) / FULL_SCALE_M


@njit(**COMPILED)
def _weigh(player: Player, voice: np.ndarray, which: int, note: Note) -> None:
    """Set one of the two sets of weights of a voice for the points of its note.

    Modes too high are not heard.
    """
    n, solo, pairs = note.modes, note.solo, note.pairs
    own, highest = note.own, TOO_HIGH * player.rate_hz
    for mode in range(n):
        partial = strings.partial_of(mode, pairs)
        part = note.heard[strings.direction_of(mode, pairs)]
        sigma = strings.decay_rate(own, partial)
        omega = math.sqrt(max(strings.omega_squared(own, partial) - sigma * sigma, 0.0))
        for point in range(note.points):
            first = at.weights(n, which, point, 0) + mode
            aperture_m = note.aperture_m
            weight = weight_of(own, partial, note.point[point], aperture_m)
            heard = omega <= highest and (solo == 0 or solo == partial)
            voice[first] = part * weight if heard else 0.0
            voice[first + n] = 0.0
    at_bridge = note.point[0] == of.BRIDGE and solo == 0
    voice[at.JAVARI_HEARD] = note.heard[0] / FULL_SCALE_N if at_bridge else 0.0


@njit(**COMPILED)
def fill(
    player: Player,
    table: Table,
    note: Note,
    string: np.ndarray,
    out: np.ndarray,
) -> None:
    """ω², σ, k, η² and the bridge's part of a note's modes, of its string as it is now."""
    losses = keys.value_of(player, table, of.DECAY)
    inside = keys.value_of(player, table, of.BRIGHTNESS_DECAY)
    strings.rows(
        string,
        note.modes,
        note.pairs,
        note.detuning,
        losses * note.conductance[0],
        losses * note.conductance[1],
        losses * note.losses[0],
        inside * note.losses[1],
        inside * note.losses[2],
        out,
    )
    if note.mute > 0.0:
        strings.mute(string, note.modes, note.pairs, note.mute, out)
    if note.touched > 0:
        strings.touch(string, note.modes, note.pairs, note.touched, out)
    if table.recorded != 0:
        recorded.correct(keys.additions(table), string, note.modes, out)
    strings.stand(
        string,
        note.modes,
        min(note.pairs, of.MOST_PAIRS),
        note.bridge * losses * note.conductance[0],
        note.bridge * losses * note.conductance[1],
        out,
    )


@njit(**COMPILED)
def make_voice(
    player: Player,
    table: Table,
    address: int,
    note: Note,
    source: int,
) -> None:
    """A voice of the modes of a note's own string: as `Voice`.

    It sets out with the amplitudes of a pluck.
    """
    voice, counts, rate_hz, n = reals(address), wholes(address), player.rate_hz, note.modes
    for slot in range(at.state(n) + at.TRUTH_ROWS * n):
        voice[slot] = 0.0
    counts[at.KIND], counts[at.PROGRAM], counts[at.MODES] = table.kinds[source], table.programs[source], n
    counts[at.POINTS], counts[at.VELOCITY] = note.points, table.velocity
    counts[at.BEGAN_FRAME], counts[at.MOVING] = -1, n
    voice[at.NEARNESS] = table.nearness
    counts[at.FADE_FRAMES], counts[at.ATTACK] = round(at.FADE_S * rate_hz), round(at.ATTACK_S * rate_hz)
    counts[at.ENDS_AT], counts[at.ENDS_IN] = round(at.LONGEST_S * rate_hz), round(at.END_FADE_S * rate_hz)
    voice[at.SILENT], peak = at.SILENT_DB * math.log(10.0) / 20, max(note.highest_m, LEAST_PEAK_M)
    brighter = at.BRIGHTER if table.velocity != 0 else 1.0
    voice[at.PEAK], voice[at.LIMIT] = peak, RUNAWAY_FACTOR * peak / FULL_SCALE_M * brighter
    first = at.state(n)
    for mode in range(n):
        voice[first + mode] = player.amplitudes[mode]
    struck, first = first, first + at.OMEGA_SQUARED * n
    own = note.own
    fill(player, table, note, own, voice[first : first + at.RESONATOR_ROWS * n])
    if note.bridge > 0.0:
        counts[at.BRIDGED] = 2 * min(note.pairs, of.MOST_PAIRS)
    for mode in range(n if table.strikes != 0 else 0):
        voice[struck + n + mode] = voice[struck + mode] * math.sqrt(voice[first + mode])
        voice[struck + mode] = 0.0
    if table.javari[0] > 0.0:
        javari.fit(voice, own, note.pairs, table.javari, rate_hz)
    behind = lag_of(player, table, note.member)
    if behind > 0:
        run_up(voice, behind / rate_hz)
    _weigh(player, voice, 0, note)
    if note.point[0] == of.BRIDGE:
        largest = 0.0
        for mode in range(n):
            largest += abs(player.amplitudes[mode] * voice[at.weights(n, 0, 0, 0) + mode])
        voice[at.LIMIT] = max(voice[at.LIMIT], RUNAWAY_FACTOR * largest)


@njit(**COMPILED)
def swing_m(note: Note) -> float:
    """The swing of a note's string now: the root of its modes' summed squares. 0: it is over."""
    for source in range(of.MOST_SOURCES):
        address = note.voices[source]
        if address == 0 or slots.voice_over(address):
            continue
        voice, counts, found = reals(address), wholes(address), 0.0
        n = counts[at.MODES]
        q, v, squares = row(voice, n, 0), row(voice, n, 1), row(voice, n, at.OMEGA_SQUARED)
        if counts[at.KIND] == at.TENSION and counts[at.PREPARED] != 0:
            q, v = row(voice, n, at.PHYSICAL), row(voice, n, at.PHYSICAL + 1)
            tension.physical(voice, q, v)
        for mode in range(n):
            found += q[mode] * q[mode] + v[mode] * v[mode] / squares[mode]
        return math.sqrt(found)
    return 0.0


@njit(**COMPILED)
def release(address: int, frames: int) -> None:
    """Lets a voice fade out; a release under way continues."""
    counts = wholes(address)
    if counts[at.RELEASE] == 0:
        counts[at.RELEASE] = frames


@njit(**COMPILED)
def release_note(player: Player, note: Note, seconds: float, frame: int) -> None:
    """Lets a note fade out; from a frame to come on, where that is above 0."""
    note.released = 1
    for source in range(of.MOST_SOURCES):
        address = note.voices[source]
        if address != 0 and frame > 0:
            wholes(address)[at.RELEASE_AT] = frame
        elif address != 0:
            release(address, slots.frames(player, seconds))


@njit(**COMPILED)
def _due(address: int, now: int) -> int:
    """The latest frame for which modes count with a voice's next quantum."""
    counts = wholes(address)
    due, before = now + counts[at.LATE], counts[at.PREVIOUS_VOICE]
    if counts[at.STATE] == at.WAITING:
        due = max(due, counts[at.BEGIN_AT])
        if before != 0 and counts[at.STOPS_IN] == 0 and wholes(before)[at.STATE] == at.SOUNDING:
            due = now + wholes(before)[at.LATE]
    return due


@njit(**COMPILED)
def wish(
    player: Player,
    note: Note,
    source: int,
    seconds: float,
    frame: int,
    now: int,
) -> int:
    """The address of rows for the modes that a voice is to have from a frame on: linked, and to be filled.

    At most two are still to be reached: those that are due in this quantum, and those for the next.
    """
    address = note.voices[source]
    counts = wholes(address)
    latest, taken, due = counts[at.RESONATOR], counts[at.CURRENT_MODES], _due(address, now)
    first = counts[at.PENDING_MODES] if latest == 0 else wholes(latest)[at.B_NEXT]
    tail, wished = 0, first
    while wished != 0:
        tail = wished
        wished = wholes(wished)[at.B_NEXT]
    found = 0
    if tail == 0 or (wholes(tail)[at.B_AT] <= due) != (frame <= due):
        size = 8 * (at.B_HEADER + at.RESONATOR_ROWS * player.modes)
        end = slots.address_of_voice(player, note.number, source + 1)
        for place in range(of.BLOCKS):
            block = end - (of.BLOCKS - place) * size
            used, wished = block in (latest, taken), first
            while wished != 0 and not used:
                used = wished == block
                wished = wholes(wished)[at.B_NEXT]
            if not used:
                found = block
    if found == 0:
        found = tail  # the latest counts
    wishes = wholes(found)
    wishes[at.B_QUANTA], wishes[at.B_NEXT], wishes[at.B_AT] = slots.quanta(player, seconds), 0, frame
    if found != tail and tail != 0:
        wholes(tail)[at.B_NEXT] = found
    elif found != tail and latest != 0:
        wholes(latest)[at.B_NEXT] = found
    elif found != tail:
        counts[at.PENDING_MODES] = found
    return found + 8 * at.B_HEADER


@njit(**COMPILED)
def take_out(mixers: np.ndarray, address: int) -> None:
    """Takes a voice out of the mixer at once; it is over."""
    kept = 0
    for place in range(mixers[at.M_ACTIVE]):
        each = mixers[at.M_VOICES + place]
        if each != address:
            mixers[at.M_VOICES + kept] = each
            kept += 1
            if wholes(each)[at.PREVIOUS_VOICE] == address:
                wholes(each)[at.PREVIOUS_VOICE] = 0
    mixers[at.M_ACTIVE] = kept
    fence()
    wholes(address)[at.STATE] = at.OVER


@njit(**COMPILED)
def lag_of(player: Player, table: Table, member: int) -> int:
    """The frames from the stroke of a course's string to its beginning, in step with the first; 0: at once."""
    later = round(member * table.apart_s * player.rate_hz)
    return -later % at.QUANTUM if table.bridge > 0.0 else 0


@njit(**COMPILED)
def hear(player: Player) -> None:
    """Lets notes follow the gains of sources and the listening points."""
    if player.table == 0:
        return
    table = table_at(player.table)
    for number in range(of.MOST_NOTES):
        note = player.notes[number]
        if note.state == of.RINGS and note.drum == 0:
            gain = note.gain * channels.loudness(player, table.mode, note.channel)
            for source in range(of.MOST_SOURCES):
                address = note.voices[source]
                if address != 0:
                    reals(address)[at.WANTED_GAIN] = gain * player.source_gains[source]
                    if wholes(address)[at.JAVARI_STEPS] != 0:
                        gap_um = keys.value_of(player, table, of.JAVARI_UM)
                        reals(address)[at.JAVARI_GAP] = gap_um * 1e-6
            _listen(player, table, note)
        elif note.state == of.RINGS:
            drums.hear(player, table, note)


@njit(**COMPILED)
def _listen(player: Player, table: Table, note: Note) -> None:
    """Lets a note be heard at the instrument's points, unless they are others in number, or of another pick-up."""
    moved = note.solo != table.solo
    for point in range(2):
        moved = moved or note.point[point] != player.values[of.POINT + point]
    if not moved or note.points != table.points:
        return
    for source in range(of.MOST_SOURCES):
        address = note.voices[source]
        if address != 0:
            counts = wholes(address)
            if counts[at.NEXT_WEIGHTS] != 0 or counts[at.VELOCITY] != table.velocity:
                return
    note.solo = table.solo
    for point in range(2):
        note.point[point] = player.values[of.POINT + point]
    for source in range(of.MOST_SOURCES):
        address = note.voices[source]
        if address != 0:
            _weigh(player, reals(address), 1, note)
            wholes(address)[at.WEIGHTS_FADED] = 0
            wholes(address)[at.NEXT_WEIGHTS] = 1
