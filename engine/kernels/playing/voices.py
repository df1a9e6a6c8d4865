"""Voices of a note in the player's memory: made, heard from points, led to other modes, and faded out."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from engine.kernels import drums, javari, recorded, strings, tension
from engine.kernels import layout as at
from engine.kernels import playing_layout as of
from engine.kernels.compiled import COMPILED
from engine.kernels.memory import fence, reals, wholes
from engine.kernels.modes import TOO_HIGH, row, run_up
from engine.kernels.playing import channels, keys, slots
from engine.pluck import FULL_SCALE_M, FULL_SCALE_N, LEAST_PEAK_M, RUNAWAY_FACTOR


@njit(**COMPILED)
def weight_of(own: np.ndarray, partial: int, place: float, aperture_m: float) -> float:
    """What an amplitude of 1 m of a partial is at a listening point, re full scale, averaged over an aperture."""
    if place == of.BRIDGE:
        return strings.bridge_force(own, partial) / FULL_SCALE_N
    half = math.pi * partial * aperture_m / (2 * own[of.LENGTH])
    averaged = math.sin(half) / half if half > 1e-6 else 1.0
    return averaged * math.sin(math.pi * partial * place) / FULL_SCALE_M


@njit(**COMPILED)
def _weigh(player: np.ndarray, players: np.ndarray, voice: np.ndarray, which: int, note: int) -> None:
    """Sets one of the two sets of weights of a voice for the points of its note; modes too high are not heard."""
    n, solo, pairs = players[note + of.NOTE_MODES], players[note + of.NOTE_SOLO], players[note + of.NOTE_PAIRS]
    own, highest = player[note + of.NOTE_OWN : note + of.NOTE_OWN + of.STRING], TOO_HIGH * player[of.PLAYER_RATE]
    for mode in range(n):
        partial = strings.partial_of(mode, pairs)
        part = player[note + of.NOTE_HEARD + strings.direction_of(mode, pairs)]
        sigma = strings.decay_rate(own, partial)
        omega = math.sqrt(max(strings.omega_squared(own, partial) - sigma * sigma, 0.0))
        for point in range(players[note + of.NOTE_POINTS]):
            first = at.weights(n, which, point, 0) + mode
            aperture_m = player[note + of.NOTE_APERTURE_M]
            weight = weight_of(own, partial, player[note + of.NOTE_POINT + point], aperture_m)
            heard = omega <= highest and (solo == 0 or solo == partial)
            voice[first] = part * weight if heard else 0.0
            voice[first + n] = 0.0
    at_bridge = player[note + of.NOTE_POINT] == of.BRIDGE and solo == 0
    voice[at.JAVARI_HEARD] = player[note + of.NOTE_HEARD] / FULL_SCALE_N if at_bridge else 0.0


@njit(**COMPILED)
def slots_of_voice(players: np.ndarray, note: int, source: int) -> int:
    """First slot of the player's own voice for a note, by its number, and a source."""
    modes = players[of.PLAYER_MODES]
    each = at.HEADER + 8 * modes + 4 + 8 * at.QUANTUM + at.TRUTH_ROWS * modes
    each += of.BLOCKS * (at.B_HEADER + at.RESONATOR_ROWS * modes)
    return of.PLAYER_VOICES + (note * of.MOST_SOURCES + source) * each


@njit(**COMPILED)
def fill(
    player: np.ndarray,
    players: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    note: int,
    string: np.ndarray,
    out: np.ndarray,
) -> None:
    """ω², σ, k, η² and the bridge's part of a note's modes, of its string as it is now."""
    losses = keys.value_of(player, players, table, tables, of.DECAY)
    inside = keys.value_of(player, players, table, tables, of.BRIGHTNESS_DECAY)
    strings.rows(
        string,
        players[note + of.NOTE_MODES],
        players[note + of.NOTE_PAIRS],
        player[note + of.NOTE_DETUNING],
        losses * player[note + of.NOTE_CONDUCTANCE],
        losses * player[note + of.NOTE_CONDUCTANCE + 1],
        losses * player[note + of.NOTE_LOSSES],
        inside * player[note + of.NOTE_LOSSES + 1],
        inside * player[note + of.NOTE_LOSSES + 2],
        out,
    )
    if player[note + of.NOTE_MUTE] > 0.0:
        modes, pairs = players[note + of.NOTE_MODES], players[note + of.NOTE_PAIRS]
        strings.mute(string, modes, pairs, player[note + of.NOTE_MUTE], out)
    if players[note + of.NOTE_TOUCHED] > 0:
        modes, pairs = players[note + of.NOTE_MODES], players[note + of.NOTE_PAIRS]
        strings.touch(string, modes, pairs, players[note + of.NOTE_TOUCHED], out)
    if tables[of.TABLE_RECORDED] != 0:
        recorded.correct(table, tables, string, players[note + of.NOTE_MODES], out)
    strings.stand(
        string,
        players[note + of.NOTE_MODES],
        min(players[note + of.NOTE_PAIRS], of.MOST_PAIRS),
        player[note + of.NOTE_BRIDGE] * losses * player[note + of.NOTE_CONDUCTANCE],
        player[note + of.NOTE_BRIDGE] * losses * player[note + of.NOTE_CONDUCTANCE + 1],
        out,
    )


@njit(**COMPILED)
def make_voice(
    player: np.ndarray,
    players: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    address: int,
    note: int,
    kind: int,
    program: int,
    velocity: int,
    highest_m: float,
) -> None:
    """A voice of the modes of a note's own string, which sets out with the amplitudes of a pluck: as `Voice`."""
    voice, counts, rate_hz, n = reals(address), wholes(address), player[of.PLAYER_RATE], players[note + of.NOTE_MODES]
    for slot in range(at.state(n) + at.TRUTH_ROWS * n):
        voice[slot] = 0.0
    counts[at.KIND], counts[at.PROGRAM], counts[at.MODES] = kind, program, n
    counts[at.POINTS], counts[at.VELOCITY] = players[note + of.NOTE_POINTS], velocity
    counts[at.BEGAN_FRAME], counts[at.MOVING] = -1, n
    voice[at.NEARNESS] = table[of.TABLE_NEARNESS]
    counts[at.FADE_FRAMES], counts[at.ATTACK] = round(at.FADE_S * rate_hz), round(at.ATTACK_S * rate_hz)
    counts[at.ENDS_AT], counts[at.ENDS_IN] = round(at.LONGEST_S * rate_hz), round(at.END_FADE_S * rate_hz)
    voice[at.SILENT], peak = at.SILENT_DB * math.log(10.0) / 20, max(highest_m, LEAST_PEAK_M)
    voice[at.PEAK], voice[at.LIMIT] = peak, RUNAWAY_FACTOR * peak / FULL_SCALE_M * (at.BRIGHTER if velocity else 1.0)
    first = at.state(n)
    for mode in range(n):
        voice[first + mode] = player[of.PLAYER_AMPLITUDES + mode]
    struck, first = first, first + at.OMEGA_SQUARED * n
    own = player[note + of.NOTE_OWN : note + of.NOTE_OWN + of.STRING]
    fill(player, players, table, tables, note, own, voice[first : first + at.RESONATOR_ROWS * n])
    if player[note + of.NOTE_BRIDGE] > 0.0:
        counts[at.BRIDGED] = 2 * min(players[note + of.NOTE_PAIRS], of.MOST_PAIRS)
    for mode in range(n if tables[of.TABLE_STRIKES] != 0 else 0):
        voice[struck + n + mode] = voice[struck + mode] * math.sqrt(voice[first + mode])
        voice[struck + mode] = 0.0
    if table[of.TABLE_JAVARI] > 0.0:
        edge = table[of.TABLE_JAVARI : of.TABLE_JAVARI + 3]
        javari.fit(voice, own, players[note + of.NOTE_PAIRS], edge, rate_hz)
    behind = lag_of(player, table, players[note + of.NOTE_MEMBER])
    if behind > 0:
        run_up(voice, behind / rate_hz)
    _weigh(player, players, voice, 0, note)
    if player[note + of.NOTE_POINT] == of.BRIDGE:
        largest = 0.0
        for mode in range(n):
            largest += abs(player[of.PLAYER_AMPLITUDES + mode] * voice[at.weights(n, 0, 0, 0) + mode])
        voice[at.LIMIT] = max(voice[at.LIMIT], RUNAWAY_FACTOR * largest)


@njit(**COMPILED)
def swing_m(players: np.ndarray, note: int) -> float:
    """How far a note's string swings now: the root of its modes' summed squares. 0: it is over."""
    for source in range(of.MOST_SOURCES):
        address = players[note + of.NOTE_VOICES + source]
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
def release_note(player: np.ndarray, players: np.ndarray, note: int, seconds: float, frame: int) -> None:
    """Lets a note fade out; from a frame to come on, where that is above 0."""
    players[note + of.NOTE_RELEASED] = 1
    for source in range(of.MOST_SOURCES):
        address = players[note + of.NOTE_VOICES + source]
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
    player: np.ndarray,
    players: np.ndarray,
    number: int,
    source: int,
    address: int,
    seconds: float,
    frame: int,
    now: int,
) -> int:
    """The slot of the block for the modes that a voice is to have from a frame on: linked, and to be filled.

    At most two are still to be reached: those that are due in this quantum, and those for the next.
    """
    counts, modes = wholes(address), players[of.PLAYER_MODES]
    latest, taken, due = counts[at.RESONATOR], counts[at.CURRENT_MODES], _due(address, now)
    first = counts[at.PENDING_MODES] if latest == 0 else wholes(latest)[at.B_NEXT]
    tail, wished = 0, first
    while wished != 0:
        tail = wished
        wished = wholes(wished)[at.B_NEXT]
    base, found = players[of.PLAYER_HERE], 0
    if tail == 0 or (wholes(tail)[at.B_AT] <= due) != (frame <= due):
        size = at.B_HEADER + at.RESONATOR_ROWS * modes
        blocks = slots_of_voice(players, number, source + 1) - of.BLOCKS * size
        for place in range(of.BLOCKS):
            block = base + 8 * (blocks + place * size)
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
    return (found - base) // 8 + at.B_HEADER


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
def lag_of(player: np.ndarray, table: np.ndarray, member: int) -> int:
    """Frames from the stroke of a string of a course to its beginning, in step with the first; 0: at once."""
    later = round(member * table[of.TABLE_APART_S] * player[of.PLAYER_RATE])
    return -later % at.QUANTUM if table[of.TABLE_BRIDGE] > 0.0 else 0


@njit(**COMPILED)
def hear(player: np.ndarray, players: np.ndarray) -> None:
    """Lets notes follow the gains of sources and the listening points."""
    for number in range(of.MOST_NOTES):
        note = slots.note(number)
        if players[note + of.NOTE_STATE] == of.RINGS and players[note + of.NOTE_DRUM] == 0:
            mode = wholes(players[of.PLAYER_TABLE])[of.TABLE_MODE]
            gain = player[note + of.NOTE_GAIN] * channels.loudness(players, mode, players[note + of.NOTE_CHANNEL])
            for source in range(of.MOST_SOURCES):
                address = players[note + of.NOTE_VOICES + source]
                if address != 0:
                    reals(address)[at.WANTED_GAIN] = gain * player[of.PLAYER_SOURCE_GAINS + source]
                    if wholes(address)[at.JAVARI_STEPS] != 0:
                        table, tables = reals(players[of.PLAYER_TABLE]), wholes(players[of.PLAYER_TABLE])
                        gap_um = keys.value_of(player, players, table, tables, of.JAVARI_UM)
                        reals(address)[at.JAVARI_GAP] = gap_um * 1e-6
            _listen(player, players, note)
        elif players[note + of.NOTE_STATE] == of.RINGS:
            drums.hear(player, players, reals(players[of.PLAYER_TABLE]), wholes(players[of.PLAYER_TABLE]), note)


@njit(**COMPILED)
def _listen(player: np.ndarray, players: np.ndarray, note: int) -> None:
    """Lets a note be heard at the instrument's points, unless they are others in number, or of another pick-up."""
    tables = wholes(players[of.PLAYER_TABLE])
    moved = players[note + of.NOTE_SOLO] != tables[of.TABLE_SOLO]
    for point in range(2):
        moved = moved or player[note + of.NOTE_POINT + point] != player[of.PLAYER_VALUES + of.POINT + point]
    if not moved or players[note + of.NOTE_POINTS] != tables[of.TABLE_POINTS]:
        return
    for source in range(of.MOST_SOURCES):
        address = players[note + of.NOTE_VOICES + source]
        if address != 0:
            counts = wholes(address)
            if counts[at.NEXT_WEIGHTS] != 0 or counts[at.VELOCITY] != tables[of.TABLE_VELOCITY]:
                return
    players[note + of.NOTE_SOLO] = tables[of.TABLE_SOLO]
    for point in range(2):
        player[note + of.NOTE_POINT + point] = player[of.PLAYER_VALUES + of.POINT + point]
    for source in range(of.MOST_SOURCES):
        address = players[note + of.NOTE_VOICES + source]
        if address != 0:
            _weigh(player, players, reals(address), 1, note)
            wholes(address)[at.WEIGHTS_FADED] = 0
            wholes(address)[at.NEXT_WEIGHTS] = 1
