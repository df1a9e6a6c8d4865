"""Notes: begun with their voices, reported, stopped by what has their place next, stolen, and ended.

Strings are known by their places: a key, or a channel of a guitar, which is one string. What plucks a place again
stops its string first, or, where the instrument says so, adds to its motion.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from engine.kernels import contact, drums, recorded, strings
from engine.kernels import layout as at
from engine.kernels import playing_layout as of
from engine.kernels.compiled import COMPILED
from engine.kernels.memory import fence, reals, wholes
from engine.kernels.playing import changes, channels, gains, keys, plucks, slots, voices
from engine.pluck import LARGEST_AMPLITUDE_MM

MPE_POSITIONS = (0.05, 0.5)  # pluck positions for slide 0 and 127 before the key
STOLEN_S = 0.03  # of the fade of a note that makes room
PLUCK_STOPS_S = 0.006  # in which a string is stopped by what plucks it again

# Estimates. A touch lasts long enough for the fifth harmonic: its lowest neighbour then falls by 72 dB
TOUCH_PERIODS = 12.0  # of the string
HARMONIC_REACH = 0.4  # of the way to the first node, where harmonics are plucked at the farthest

VARIES_RELEASE, VARIES_ANGLE = 0.2, math.radians(8.0)  # a share, rad: at most, as those of `plucks.vary`

MEMBERS_APART = 1 << 16  # places of the strings of a course
COURSES_VARY = 0.5  # by how much detuning varies from key to key, at most


@njit(**COMPILED)
def report(
    player: np.ndarray, players: np.ndarray, kind: int, id: int, channel: int, key: int, frame: int, velocity: float
) -> int:
    """One more report; its first slot, for what else is in it. `reported` publishes it."""
    slot = of.PLAYER_REPORTS + players[of.PLAYER_REPORTED] % of.REPORTS * of.REPORT_SLOTS
    players[slot + of.REPORT_KIND] = kind
    players[slot + of.REPORT_ID] = id
    players[slot + of.REPORT_CHANNEL] = channel
    players[slot + of.REPORT_KEY] = key
    players[slot + of.REPORT_FRAME] = frame
    player[slot + of.REPORT_VELOCITY] = velocity
    return slot


@njit(**COMPILED)
def reported(players: np.ndarray) -> None:
    fence()
    players[of.PLAYER_REPORTED] += 1


@njit(**COMPILED)
def refuse(player: np.ndarray, players: np.ndarray, event: int) -> None:
    """Reports a note that no string can play, or that was cancelled."""
    id, channel, key = players[event + of.EVENT_ID], players[event + of.EVENT_CHANNEL], players[event + of.EVENT_KEY]
    frame, velocity = players[event + of.EVENT_FRAME], player[event + of.EVENT_VALUE]
    report(player, players, of.REFUSED, id, channel, key, frame, velocity)
    reported(players)


@njit(**COMPILED)
def _forget(player: np.ndarray, players: np.ndarray, note: int, frame: int) -> None:
    """A note has ended: its slots are free."""
    players[note + of.NOTE_STATE] = of.FREE
    if players[note + of.NOTE_MEMBER] != 0:
        return
    id, channel, key = players[note + of.NOTE_ID], players[note + of.NOTE_CHANNEL], players[note + of.NOTE_KEY]
    report(player, players, of.ENDED, id, channel, key, frame, 0.0)
    reported(players)


@njit(**COMPILED)
def free_note(player: np.ndarray, players: np.ndarray, mixers: np.ndarray) -> int:
    """A free note; where there is none, one which has not begun or fades is cut, else the oldest."""
    best, best_rank, best_age = 0, 3, 0
    for number in range(of.MOST_NOTES):
        note = slots.note(number)
        if players[note + of.NOTE_STATE] == of.FREE:
            return number
        if slots.over(players, note):
            _forget(player, players, note, mixers[at.M_FRAMES])
            return number
        begun = False
        for source in range(of.MOST_SOURCES):
            address = players[note + of.NOTE_VOICES + source]
            begun = begun or (address != 0 and wholes(address)[at.STATE] != at.WAITING)
        rank = 2
        if players[note + of.NOTE_RELEASED] != 0 or players[note + of.NOTE_HAS_PLACE] == 0:
            rank = 1 if begun else 0
        age = players[note + of.NOTE_AGE]
        if rank < best_rank or (rank == best_rank and age < best_age):
            best, best_rank, best_age = number, rank, age
    for source in range(of.MOST_SOURCES):
        address = players[slots.note(best) + of.NOTE_VOICES + source]
        if address != 0:
            voices.take_out(mixers, address)
    players[of.PLAYER_CUT] += 1
    _forget(player, players, slots.note(best), mixers[at.M_FRAMES])
    return best


@njit(**COMPILED)
def _follow(player: np.ndarray, players: np.ndarray, tables: np.ndarray, note: int, before: int) -> None:
    """A note has the string of the one before, which is stopped, or whose motion continues in it."""
    stops = slots.frames(player, PLUCK_STOPS_S)
    for source in range(of.MOST_SOURCES):
        address, other = players[note + of.NOTE_VOICES + source], players[before + of.NOTE_VOICES + source]
        if other == 0 or slots.voice_over(other):
            continue
        if address == 0:
            voices.release(other, stops)
            continue
        wholes(address)[at.PREVIOUS_VOICE] = other
        wholes(address)[at.STOPS_IN] = stops if tables[of.TABLE_STOPS] != 0 else 0


@njit(**COMPILED)
def _make_room(player: np.ndarray, players: np.ndarray) -> None:
    """Releases the oldest notes where more ring than may."""
    while True:
        ringing, oldest, age = 0, 0, 0
        for number in range(of.MOST_NOTES):
            note = slots.note(number)
            free = players[note + of.NOTE_STATE] == of.FREE or players[note + of.NOTE_RELEASED] != 0
            if free or slots.over(players, note):
                continue
            if ringing == 0 or players[note + of.NOTE_AGE] < age:
                oldest, age = note, players[note + of.NOTE_AGE]
            ringing += 1
        if ringing <= players[of.PLAYER_MOST]:
            return
        voices.release_note(player, players, oldest, STOLEN_S, 0)


@njit(**COMPILED)
def strike(
    player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray, mixers: np.ndarray, event: int
) -> None:
    """Plays all strings of a key's course, one after the other; the first is the one that is reported."""
    note_on(player, players, table, tables, mixers, event, 0)
    frame = players[event + of.EVENT_FRAME]
    for member in range(1, tables[of.TABLE_COURSE]):
        later = round(member * table[of.TABLE_APART_S] * player[of.PLAYER_RATE])
        later += voices.lag_of(player, table, member)
        players[event + of.EVENT_FRAME] = max(frame, mixers[at.M_FRAMES]) + later if later > 0 else frame
        note_on(player, players, table, tables, mixers, event, member)
    players[event + of.EVENT_FRAME] = frame


@njit(**COMPILED)
def note_on(
    player: np.ndarray,
    players: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    mixers: np.ndarray,
    event: int,
    member: int,
) -> None:
    """Plays a note, of a course one string. A string that is impossible is refused, unless another sounds."""
    channel, key, velocity = (
        players[event + of.EVENT_CHANNEL],
        players[event + of.EVENT_KEY],
        player[event + of.EVENT_VALUE],
    )
    frame, mode, drum = players[event + of.EVENT_FRAME], tables[of.TABLE_MODE], tables[of.TABLE_DRUMS] != 0
    by_hand = player[event + of.EVENT_POSITION] > 0.0
    players[slots.channel(channel) + of.CHANNEL_PLAYS] = 1
    place, string, count = channels.place_of(players, tables, event), -1, tables[of.TABLE_STRINGS]
    if place % 256 == 0 and count > 0 and keys.chosen(table, count, key) != place // 256 - 1:
        string = place // 256 - 1
    place += MEMBERS_APART * member
    octaves = keys.has_octave(table, tables, key, string)
    octave = member > 0 and octaves
    own, modes, gain, highest_m = slots.moment(player, 3), 0, 1.0, 0.0
    position = amplitude_mm = width = 0.0
    pairs, strength, hardness, stroke, touched = 0, 1.0, 1.0, 0, 0
    if not drum:
        pitch_hz = keys.pitch_of(table, tables, key)
        shortened = 1.0
        if pitch_hz > 0.0:
            modes, shortened = keys.string_of(player, players, table, tables, key, string, pitch_hz, False, own)
        if octave and modes > 0:
            strings.thin(own, pitch_hz)
            modes = min(modes, strings.modes_below(own, of.HIGHEST_HZ)) if strings.possible(own) else 0
        if modes < 1 or strings.overdamped(own, modes):
            if member > 0:
                return
            refuse(player, players, event)
            return
        gain = gains.gain_of(player, players, table, tables, key, string)
        curve, soft = (
            keys.value_of(player, players, table, tables, of.CURVE),
            keys.value_of(player, players, table, tables, of.SOFTEST_MM),
        )
        share = min(max((velocity - 1) / 126, 0.0), 1.0) ** (4.0**-curve)
        harder = keys.value_of(player, players, table, tables, of.HARDEST_MM) / soft
        amplitude_mm = min(soft * harder**share * shortened, LARGEST_AMPLITUDE_MM)
        if by_hand:
            amplitude_mm = min(player[event + of.EVENT_AMPLITUDE_MM], LARGEST_AMPLITUDE_MM)
            if harder != 1.0:
                share = min(max(math.log(amplitude_mm / soft / shortened) / math.log(harder), 0.0), 1.0)
        strength = harder ** (share - ((of.REFERENCE_VELOCITY - 1) / 126) ** (4.0**-curve))
        width = keys.value_of(player, players, table, tables, of.WIDTH)
        width *= (keys.value_of(player, players, table, tables, of.WIDTH_HARD) / width) ** share
        position, slide = (
            keys.value_of(player, players, table, tables, of.POSITION),
            players[slots.channel(channel) + of.CHANNEL_SLIDE],
        )
        if by_hand:
            position = player[event + of.EVENT_POSITION]
            width = player[event + of.EVENT_WIDTH]
        elif mode == of.MPE and slide >= 0:
            position = MPE_POSITIONS[0] + (MPE_POSITIONS[1] - MPE_POSITIONS[0]) * min(slide, 127) / 127
        turned, varies = 0.0, table[of.TABLE_VARIATION]
        softest_ms = keys.value_of(player, players, table, tables, of.CONTACT_MS)
        release_s = plucks.contact_s(
            softest_ms, keys.value_of(player, players, table, tables, of.CONTACT_HARD_MS), share
        )
        if varies > 0.0:
            stroke = players[of.PLAYER_AGE]
            if not by_hand:
                position, amplitude_mm, width = plucks.vary(position, amplitude_mm, width, varies, stroke, key)
            release_s *= 1 + varies * VARIES_RELEASE * plucks.varied(stroke, key, 3)
            turned = varies * VARIES_ANGLE * plucks.varied(stroke, key, 4)
        touched = keys.node_of(player, players, table, tables, channel, modes)
        if touched > 0 and not by_hand:
            position = min(position, HARMONIC_REACH / touched)
        position, amplitude_mm, width = plucks.nearest(position, amplitude_mm, width)
        shape = players[event + of.EVENT_SHAPE] if by_hand else tables[of.TABLE_SHAPE]
        highest_m = plucks.pull(player, table, tables, shape, modes, position, amplitude_mm / 1000, width)
        plucks.release_pluck(player, tables, own, modes, release_s)
        if tables[of.TABLE_RECORDED] != 0:
            modes = recorded.modes_of(tables, modes)
            pairs = (modes + 1) // 2
            recorded.split(table, tables, own, modes, player[of.PLAYER_AMPLITUDES : of.PLAYER_AMPLITUDES + modes])
        else:
            pairs = plucks.split(player, table, tables, modes, turned)
            modes += pairs
    number = free_note(player, players, mixers)
    note = slots.note(number)
    for slot in range(of.NOTE_SLOTS):
        players[note + slot] = 0
    players[of.PLAYER_AGE] += 1
    players[note + of.NOTE_STATE] = of.RINGS
    players[note + of.NOTE_ID] = players[event + of.EVENT_ID]
    players[note + of.NOTE_AGE] = players[of.PLAYER_AGE]
    players[note + of.NOTE_CHANNEL] = channel
    players[note + of.NOTE_KEY] = key
    players[note + of.NOTE_PLACE] = place
    players[note + of.NOTE_STRING] = string
    players[note + of.NOTE_HELD] = 1
    players[note + of.NOTE_DRUM] = drum
    players[note + of.NOTE_BY_HAND] = by_hand
    players[note + of.NOTE_MODES] = modes
    players[note + of.NOTE_PAIRS] = pairs
    for each in range(3):
        player[note + of.NOTE_LOSSES + each] = table[of.TABLE_LOSSES + each]
    player[note + of.NOTE_DETUNING] = table[of.TABLE_DETUNING]
    player[note + of.NOTE_APERTURE_M] = table[of.TABLE_APERTURE_M]
    if not drum:
        player[note + of.NOTE_SWING_M] = player[gains.swing_slot(key, string)]
    players[note + of.NOTE_MEMBER] = member
    players[note + of.NOTE_OCTAVE] = octave
    if not drum and not octaves and tables[of.TABLE_COURSE] > 1 and table[of.TABLE_CONDUCTANCE] > 0.0:
        player[note + of.NOTE_BRIDGE] = table[of.TABLE_BRIDGE] if pairs > 0 else 0.0
    if member > 0:  # above and below the first by turns, each key a little otherwise
        apart = (
            (member + 1) // 2 * (1 if member % 2 == 1 else -1) * (1 + COURSES_VARY * plucks.varied(0, key, member))
        )
        player[note + of.NOTE_APART] = apart * table[of.TABLE_APART_CENTS] / 100
    for each in range(2):
        polarised = pairs > 0 and tables[of.TABLE_RECORDED] == 0
        player[note + of.NOTE_HEARD + each] = table[of.TABLE_HEARD + each] if polarised else 1.0
        player[note + of.NOTE_CONDUCTANCE + each] = table[of.TABLE_CONDUCTANCE + each]
    players[note + of.NOTE_FRAME] = frame
    players[note + of.NOTE_BEGAN] = max(frame, mixers[at.M_FRAMES])
    player[note + of.NOTE_VELOCITY] = velocity
    if touched > 0:
        players[note + of.NOTE_TOUCHED] = touched
        lasts = slots.frames(player, TOUCH_PERIODS / strings.pitch_hz(own))
        players[note + of.NOTE_LIFTED] = players[note + of.NOTE_BEGAN] + lasts
    player[note + of.NOTE_MUTE] = keys.mute_of(player, players, table, tables, channel)
    player[note + of.NOTE_PLUCK] = position
    player[note + of.NOTE_PLUCK + 1] = amplitude_mm
    player[note + of.NOTE_PLUCK + 2] = width
    player[note + of.NOTE_GAIN] = gain
    for each in range(of.STRING):
        player[note + of.NOTE_OWN + each] = own[each]
        player[note + of.NOTE_STRING_NOW + each] = own[each]
    players[note + of.NOTE_POINTS] = tables[of.TABLE_POINTS]
    players[note + of.NOTE_SOLO] = tables[of.TABLE_SOLO]
    for point in range(2):
        player[note + of.NOTE_POINT + point] = player[of.PLAYER_VALUES + of.POINT + point]
    for source in range(tables[of.TABLE_SOURCES]):
        address = players[of.PLAYER_HERE] + 8 * voices.slots_of_voice(players, number, source)
        if not drum:
            kind, program = tables[of.TABLE_KINDS + source], tables[of.TABLE_PROGRAMS + source]
            voices.make_voice(
                player,
                players,
                table,
                tables,
                address,
                note,
                kind,
                program,
                tables[of.TABLE_VELOCITY],
                highest_m,
            )
            voice, begun = reals(address), gain * player[of.PLAYER_SOURCE_GAINS + source]
            begun *= channels.loudness(players, mode, channel)
            if player[note + of.NOTE_BRIDGE] > 0.0:
                first = players[of.PLAYER_AGE] - member  # of this player, for another may ring as well
                wholes(address)[at.COURSE] = players[of.PLAYER_HERE] + of.MOST_SOURCES * first + source
            voice[at.WANTED_GAIN] = voice[at.GAIN] = voice[at.GAIN_FROM] = voice[at.GAIN_TO] = begun
        players[note + of.NOTE_VOICES + source] = address
    for each in range(of.MOST_NOTES):
        before = slots.note(each)
        has_place = players[before + of.NOTE_STATE] == of.RINGS and players[before + of.NOTE_HAS_PLACE] != 0
        if has_place and players[before + of.NOTE_PLACE] == place:
            players[before + of.NOTE_HAS_PLACE] = 0
            _follow(player, players, tables, note, before)
    players[note + of.NOTE_HAS_PLACE] = 1
    for source in range(of.MOST_SOURCES):
        address = players[note + of.NOTE_VOICES + source]
        if address == 0:
            continue
        wholes(address)[at.BEGIN_AT] = frame
        reals(address)[at.STRUCK_S] = player[event + of.EVENT_STRUCK_S]
        wholes(address)[at.OF_INSTRUMENT] = 1
        spared = players[of.PLAYER_SPARES] != 0 and player[of.PLAYER_SOURCE_GAINS + source] == 0.0
        if mixers[at.M_ACTIVE] < at.MOST_VOICES and not spared:
            mixers[at.M_VOICES + mixers[at.M_ACTIVE]] = address
            mixers[at.M_ACTIVE] += 1
        else:
            wholes(address)[at.STATE] = at.OVER
    changes.retune(player, players, table, tables, number, 0.0, 0, mixers[at.M_FRAMES])
    if drum:
        strength, hardness = drums.contact_of(player, table, tables, key, velocity)
    if member == 0:
        level_db = keys.value_of(player, players, table, tables, of.ONSET_DB)
        level_db += channels.loudness_db(players, mode, channel)
        contact.touch(player, players, table, of.STROKE, level_db, strength, hardness, stroke, key, frame, 0.0, 0.0)
    _make_room(player, players)
    report_began(player, players, tables, event, number, player[note + of.NOTE_OWN : note + of.NOTE_OWN + of.STRING])


@njit(**COMPILED)
def report_began(
    player: np.ndarray, players: np.ndarray, tables: np.ndarray, event: int, number: int, own: np.ndarray
) -> None:
    """Reports the note of an event, and the string of its key."""
    note, frame = slots.note(number), players[event + of.EVENT_FRAME]
    if players[note + of.NOTE_MEMBER] != 0:
        return
    id, channel, key = players[note + of.NOTE_ID], players[note + of.NOTE_CHANNEL], players[note + of.NOTE_KEY]
    slot = report(player, players, of.BEGAN, id, channel, key, frame, player[event + of.EVENT_VALUE])
    players[slot + of.REPORT_STRING] = players[note + of.NOTE_STRING]
    players[slot + of.REPORT_TABLE] = tables[of.TABLE_SERIAL]
    players[slot + of.REPORT_MODES] = players[note + of.NOTE_MODES]
    players[slot + of.REPORT_NOTE] = number
    player[slot + of.REPORT_POSITION] = player[note + of.NOTE_PLUCK]
    player[slot + of.REPORT_AMPLITUDE_MM] = player[note + of.NOTE_PLUCK + 1]
    player[slot + of.REPORT_WIDTH] = player[note + of.NOTE_PLUCK + 2]
    player[slot + of.REPORT_GAIN] = player[note + of.NOTE_GAIN]
    for each in range(of.STRING):
        player[slot + of.REPORT_OWN + each] = own[each]
    reported(players)


@njit(**COMPILED)
def tend(player: np.ndarray, players: np.ndarray, now: int) -> None:
    """Reports notes that have ended."""
    for number in range(of.MOST_NOTES):
        if players[slots.note(number) + of.NOTE_STATE] == of.RINGS and slots.over(players, slots.note(number)):
            _forget(player, players, slots.note(number), now)
