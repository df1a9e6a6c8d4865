"""Events become voices, and change those that ring: the control logic of playing, without Python or allocation.

Strings are known by their places: a key, or a channel of a guitar, which is one string. What plucks a place again
stops its string first, or, where the instrument says so, adds to its motion. A key that is released damps its string,
unless the pedal or the instrument lets it ring. Bends, slides, dampers and knobs change the modes of a string's
voices, all of a note alike.

In guitar mode the first channels are the strings, the highest first, as guitars with MIDI send them. The first of
them alone may as well be a keyboard: until another has played, it plays any key, each on the string that the key
chooses. So do all further channels, and the keys of the computer and the screen always.

With the legato footswitch down, a key moves the note of a key that is held on its channel: it shortens the same
string without a pluck (hammer-on), or slides there where portamento is on. A key that is released gives the note back
to the highest one that is still down (pull-off).

Three techniques have a parameter and a footswitch each. Harmonics: a finger touches the string at a node as it is
plucked, and leaves after some periods. Tremolo: a key that is held plucks again and again. Strum: notes that come
within some milliseconds are one chord; its first begins at once, the others wait their turns in the queue.

A channel's own wheel and pedal hold for what was struck on it. Those of the first channel hold for the keys of the
computer and the screen too, which have none, and in MPE, as the master's, for every channel.

Events wait in a ring until the mixer's next quantum, and in a queue until the quantum of their frame. A note begins
at its very frame; all else counts within a quantum after it.

Memory is passed twice, as real numbers and as whole ones (`players`, `tables`, `mixers`), and notes, channels and
events by their first slot: views of slices would take the compiler five times as long.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from engine.kernels import contact, drums, javari, loudness, recorded, strings
from engine.kernels import layout as at
from engine.kernels import playing_layout as of
from engine.kernels.compiled import COMPILED
from engine.kernels.memory import fence, reals, wholes
from engine.kernels.modes import TOO_HIGH, run_up
from engine.pluck import (
    FULL_SCALE_M,
    FULL_SCALE_M_S,
    FULL_SCALE_N,
    LARGEST_AMPLITUDE_MM,
    LEAST_PEAK_M,
    POSITION_RANGE,
    RUNAWAY_FACTOR,
)

MPE_POSITIONS = (0.05, 0.5)  # pluck positions for slide 0 and 127 before the key
MPE_BEND_SEMITONES = 48.0  # range of the pitch wheel of a member channel
WIDEST_SEMITONES = 96.0  # that messages may ask for
DAMPER_S, BEND_S, KNOB_S = 0.012, 0.006, 0.04  # of the glide to other modes
HAMMER_S, SLIDE_S = 0.006, (0.02, 1.0)  # of that to the length of another key; of a slide, at times of 0 and 127
STOP_S = 0.03  # of the fade of all strings
STOLEN_S = 0.03  # of the fade of a note that makes room
PLUCK_STOPS_S = 0.006  # in which a string is stopped by what plucks it again

# Techniques: estimates. A touch lasts long enough for the fifth harmonic: its lowest neighbour then falls by 72 dB
TOUCH_PERIODS, LIFT_S = 12.0, 0.004  # of the string; of the glide as the finger leaves
HARMONIC_REACH = 0.4  # of the way to the first node, where harmonics are plucked at the farthest
CHORD_S = 0.03  # in which notes come that are one chord
USUAL_HARMONIC, USUAL_STRUM_MS, USUAL_TREMOLO_HZ = 2.0, 12.0, 10.0  # of a footswitch where the parameter is off

# By how much a pluck varies from stroke to stroke, at most, where an instrument varies by 1. Estimates: repeats then
# differ by about -20 dB; those of a player that was recorded do by -4 … -12 dB
VARIES_PLACE, VARIES_DB, VARIES_WIDTH, VARIES_RELEASE = 0.08, 1.0, 0.12, 0.2  # shares, dB
VARIES_ANGLE = math.radians(8.0)

PLAIN_DB = 12.0  # by how much fingers are quieter on plain strings than on wound ones: an estimate
MEMBERS_APART = 1 << 16  # places of the strings of a course
COURSES_VARY = 0.5  # by how much detuning varies from key to key, at most
VIBRATO_QUANTA = 8  # of a glide, of which a vibrato is made

# Controllers of MIDI
MOD_WHEEL, DATA, SUSTAIN, FINE_DATA, SLIDE = 1, 6, 64, 38, 74
SLIDE_TIME, PORTAMENTO, SOFT, LEGATO = 5, 65, 67, 68
HARMONICS, TREMOLO, STRUM = 80, 81, 82
FINE_OTHER, OTHER, FINE_REGISTERED, REGISTERED, SOUND_OFF, RESET, NOTES_OFF = 98, 99, 100, 101, 120, 121, 123
PEDAL_DOWN = 64  # from this value on
SWITCHES = (of.CHANNEL_LEGATO, of.CHANNEL_SLIDES, of.CHANNEL_HARMONICS, of.CHANNEL_TREMOLO, of.CHANNEL_STRUMS)
NO_PARAMETER, BEND_RANGE = 127, 0


@njit(**COMPILED)
def _note(number: int) -> int:
    """First slot of a note."""
    return of.PLAYER_NOTES + number * of.NOTE_SLOTS


@njit(**COMPILED)
def _channel(number: int) -> int:
    """First slot of a channel."""
    return of.PLAYER_CHANNELS + number * of.CHANNEL_SLOTS


@njit(**COMPILED)
def _moment(player: np.ndarray, number: int) -> np.ndarray:
    """Room for a string, for a moment."""
    return player[of.PLAYER_STRINGS + number * of.STRING : of.PLAYER_STRINGS + (number + 1) * of.STRING]


@njit(**COMPILED)
def _frames(player: np.ndarray, seconds: float) -> int:
    return max(1, round(seconds * player[of.PLAYER_RATE]))


@njit(**COMPILED)
def _quanta(player: np.ndarray, seconds: float) -> int:
    return max(1, round(seconds * player[of.PLAYER_RATE] / at.QUANTUM))


@njit(**COMPILED)
def _voice_over(address: int) -> bool:
    state = wholes(address)[at.STATE]
    return state == at.OVER or state == at.RUNAWAY


@njit(**COMPILED)
def _over(players: np.ndarray, note: int) -> bool:
    """Whether all voices of a note are."""
    for source in range(of.MOST_SOURCES):
        address = players[note + of.NOTE_VOICES + source]
        if address != 0 and not _voice_over(address):
            return False
    return True


@njit(**COMPILED)
def _sounds(players: np.ndarray, note: int) -> bool:
    """Whether a note has its place and rings."""
    return (
        players[note + of.NOTE_STATE] == of.RINGS
        and players[note + of.NOTE_HAS_PLACE] == 1
        and not _over(players, note)
    )


# Channels


@njit(**COMPILED)
def _rest(player: np.ndarray, players: np.ndarray, number: int, pedal: int, plays: int) -> None:
    """A channel as if nobody had moved anything on it, except for these."""
    channel = _channel(number)
    player[channel + of.CHANNEL_BEND] = 0.0
    player[channel + of.CHANNEL_RANGE] = -1.0
    players[channel + of.CHANNEL_PEDAL] = pedal
    players[channel + of.CHANNEL_SLIDE] = -1
    players[channel + of.CHANNEL_PLAYS] = plays
    players[channel + of.CHANNEL_COARSE] = NO_PARAMETER
    players[channel + of.CHANNEL_FINE] = NO_PARAMETER


@njit(**COMPILED)
def _is_master(mode: int, channel: int, other: int) -> bool:
    """Whether "all notes off" and "reset all controllers" on a channel are meant for another: MPE's master's."""
    return channel == other or (mode == of.MPE and channel == of.FIRST and other != of.ON_SCREEN)


@njit(**COMPILED)
def _acts_on(mode: int, channel: int, other: int) -> bool:
    """Whether wheel and pedal of a channel hold for what was struck on another."""
    return channel == other or (channel == of.FIRST and (mode == of.MPE or other == of.ON_SCREEN))


@njit(**COMPILED)
def _pedal(players: np.ndarray, mode: int, channel: int) -> bool:
    """Whether a pedal holds what was struck on a channel."""
    for each in range(of.CHANNELS):
        if players[_channel(each) + of.CHANNEL_PEDAL] != 0 and _acts_on(mode, each, channel):
            return True
    return False


@njit(**COMPILED)
def _semitones(player: np.ndarray, mode: int, channel: int) -> float:
    """How far pitch wheels bend what was struck on a channel."""
    total = 0.0
    for each in range(of.CHANNELS):
        bend, wide = player[_channel(each) + of.CHANNEL_BEND], player[_channel(each) + of.CHANNEL_RANGE]
        if bend != 0.0 and _acts_on(mode, each, channel):
            if wide < 0.0:
                member = mode == of.MPE and each != of.FIRST and each != of.ON_SCREEN
                wide = MPE_BEND_SEMITONES if member else player[of.PLAYER_VALUES + of.BEND_SEMITONES]
            total += bend * wide
    return total


@njit(**COMPILED)
def _set_range(player: np.ndarray, players: np.ndarray, channel: int, number: int, value: int) -> bool:
    """Follows the controllers that choose a parameter and set it; whether they set the range of bends."""
    coarse, fine, wide = channel + of.CHANNEL_COARSE, channel + of.CHANNEL_FINE, channel + of.CHANNEL_RANGE
    chosen = players[coarse] == BEND_RANGE and players[fine] == BEND_RANGE
    if number in (OTHER, FINE_OTHER):
        players[coarse] = NO_PARAMETER
        players[fine] = NO_PARAMETER
    elif number == REGISTERED:
        players[coarse] = value
    elif number == FINE_REGISTERED:
        players[fine] = value
    elif chosen and number == DATA:
        player[wide] = min(float(value), WIDEST_SEMITONES)
        return True
    elif chosen and number == FINE_DATA and player[wide] >= 0.0:
        player[wide] = min(math.floor(player[wide]) + value / 100, WIDEST_SEMITONES)
        return True
    return False


@njit(**COMPILED)
def _is_string(players: np.ndarray, tables: np.ndarray, channel: int) -> bool:
    """Whether a channel is one string of a guitar. The first one is, once another string has played."""
    if tables[of.TABLE_MODE] != of.GUITAR:
        return False
    count = of.GUITAR_STRINGS
    if tables[of.TABLE_STRINGS] > 0:
        count = min(count, tables[of.TABLE_STRINGS])
    others = 0
    for each in range(of.FIRST + 1, count):
        others += players[_channel(each) + of.CHANNEL_PLAYS]
    return channel < count and others > 0


@njit(**COMPILED)
def _place(players: np.ndarray, tables: np.ndarray, event: int) -> int:
    """Which string of the instrument the note of an event has; 256 (n + 1): string n of a set, which was given."""
    channel, string = players[event + of.EVENT_CHANNEL], players[event + of.EVENT_STRING]
    if _is_string(players, tables, channel):
        return 256 * (channel + 1)
    if 0 < string <= min(tables[of.TABLE_STRINGS], of.GUITAR_STRINGS):
        return 256 * string
    return (256 * (channel + 1) if tables[of.TABLE_MODE] == of.MPE else 0) + players[event + of.EVENT_KEY] + 1


@njit(**COMPILED)
def _hold(players: np.ndarray, channel: int, key: int, down: bool) -> None:
    """Notes that a key is down, or is not."""
    slot = _channel(channel) + of.CHANNEL_HELD + key // 64
    bit = np.int64(1) << np.int64(key % 64)
    players[slot] = players[slot] | bit if down else players[slot] & ~bit


@njit(**COMPILED)
def _is_down(players: np.ndarray, channel: int, key: int) -> bool:
    slot = _channel(channel) + of.CHANNEL_HELD + key // 64
    return (players[slot] >> np.int64(key % 64)) & 1 != 0


@njit(**COMPILED)
def _release_keys(players: np.ndarray, channel: int) -> None:
    """No key of a channel is down."""
    players[_channel(channel) + of.CHANNEL_HELD] = 0
    players[_channel(channel) + of.CHANNEL_HELD + 1] = 0


@njit(**COMPILED)
def _switched(players: np.ndarray, mode: int, channel: int, which: int) -> bool:
    """Whether a footswitch, by its slot of a channel, holds for a channel."""
    down = False
    for each in range(of.CHANNELS):
        down = down or (players[_channel(each) + which] != 0 and _acts_on(mode, each, channel))
    return down


@njit(**COMPILED)
def _moves_in_s(players: np.ndarray, mode: int, channel: int) -> float:
    """The time in which a note moves to another key of its channel."""
    for each in range(of.CHANNELS):
        own = _channel(each)
        if players[own + of.CHANNEL_SLIDES] != 0 and _acts_on(mode, each, channel):
            return SLIDE_S[0] * (SLIDE_S[1] / SLIDE_S[0]) ** (players[own + of.CHANNEL_TIME] / 127)
    return HAMMER_S


# The string of a key


@njit(**COMPILED)
def _value(player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray, which: int) -> float:
    """One of the instrument's values, as the modulation wheel turns it."""
    value, wheel = player[of.PLAYER_VALUES + which], players[of.PLAYER_WHEEL]
    if wheel != 0 and tables[of.TABLE_WHEEL] == which:
        return value + wheel / 127 * (table[of.TABLE_WHEEL_GOAL] - value)
    return value


@njit(**COMPILED)
def _mute(player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray, channel: int) -> float:
    """How far a hand mutes what was struck on a channel, 0 … 1."""
    share = _value(player, players, table, tables, of.MUTE)
    for each in range(of.CHANNELS):
        if _acts_on(tables[of.TABLE_MODE], each, channel):
            share = max(share, player[_channel(each) + of.CHANNEL_MUTE])
    return share


@njit(**COMPILED)
def _technique(
    player: np.ndarray,
    players: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    channel: int,
    which: int,
    switch: int,
    usual: float,
) -> float:
    """The value of a technique for a channel; the usual one where its footswitch is down and the value is off."""
    value, off = _value(player, players, table, tables, which), 1.0 if which == of.HARMONIC else 0.0
    if value <= off and _switched(players, tables[of.TABLE_MODE], channel, switch):
        return usual
    return value


@njit(**COMPILED)
def _node(
    player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray, channel: int, partials: int
) -> int:
    """At 1 over how much of its length a string is touched as it is plucked; 0: it is not."""
    switch = of.CHANNEL_HARMONICS
    node = round(_technique(player, players, table, tables, channel, of.HARMONIC, switch, USUAL_HARMONIC))
    return node if 1 < node <= partials else 0


@njit(**COMPILED)
def _chosen(table: np.ndarray, count: int, key: int) -> int:
    """Which string of a set, from the highest, 0, a key chooses: the highest at or below it, else the lowest."""
    for number in range(count):
        if table[of.TABLE_OPEN + number * of.OPEN_SLOTS + of.OPEN_NOTE] <= key:
            return number
    return count - 1


@njit(**COMPILED)
def string_of(
    player: np.ndarray,
    players: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    key: int,
    number: int,
    pitch_hz: float,
    wheeled: bool,
    out: np.ndarray,
) -> tuple[int, float]:
    """The string of a key, before bends: its partials, 0 where there is none, and its share of the whole string.

    Args:
        number: on which of a set it is played, from the highest, 0; -1, or one that would have to be slackened too
            far: the one that the key itself chooses.
        wheeled: whether with the knob that the modulation wheel turns, as far as it does.
    """
    whole, knobs, count = _moment(player, 0), _moment(player, 1), tables[of.TABLE_STRINGS]
    for which in range(of.KNOBS):
        knobs[which] = player[of.PLAYER_VALUES + which]
        if wheeled:
            knobs[which] = _value(player, players, table, tables, which)
    first = of.TABLE_OPEN
    if count > 0:
        note = table[first + number * of.OPEN_SLOTS + of.OPEN_NOTE] if 0 <= number < count else 0.0
        if not 0 <= number < count or key < note - of.MOST_SLACKENED:
            number = _chosen(table, count, key)
        first += number * of.OPEN_SLOTS
    strings.turned(table[first + of.OPEN_STRING : first + of.OPEN_SLOTS], knobs, whole)
    if not strings.possible(whole):
        return 0, 1.0
    if count > 0 and key < table[first + of.OPEN_NOTE]:  # slackened
        whole[of.TENSION] = strings.bent(whole, pitch_hz / table[first + of.OPEN_HZ])
        if not strings.possible(whole):
            return 0, 1.0
    for place in range(of.STRING):
        out[place] = whole[place]
    out[of.LENGTH] = strings.fretted(whole, pitch_hz)
    if not strings.possible(out):
        return 0, 1.0
    modes = min(strings.modes_below(out, of.HIGHEST_HZ), players[of.PLAYER_MODES] - of.MOST_PAIRS)
    return modes, out[of.LENGTH] / whole[of.LENGTH]


@njit(**COMPILED)
def _has_octave(table: np.ndarray, tables: np.ndarray, key: int, number: int) -> bool:
    """Whether the course of a key has octave strings, on a string of a set; -1: on the one that the key chooses."""
    count, octaves = tables[of.TABLE_STRINGS], tables[of.TABLE_OCTAVES]
    return octaves > 0 and (number if number >= 0 else _chosen(table, count, key)) >= count - octaves


@njit(**COMPILED)
def _pitch_hz(table: np.ndarray, tables: np.ndarray, key: int) -> float:
    """Of a note; 0: its key is silent."""
    if not tables[of.TABLE_LOW] <= key <= tables[of.TABLE_HIGH]:
        return 0.0
    return table[of.TABLE_PITCHES + key]


@njit(**COMPILED)
def _string_now(
    player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray, note: int, out: np.ndarray
) -> None:
    """The string of a note with the present knobs, wheels and damper; where there is none, it stays as it is."""
    key, mode = players[note + of.NOTE_KEY], tables[of.TABLE_MODE]
    pitch_hz, fits = _pitch_hz(table, tables, key), True
    if pitch_hz > 0.0:
        number = players[note + of.NOTE_STRING]
        wheeled = players[of.PLAYER_WHEEL] != 0 and 0 <= tables[of.TABLE_WHEEL] < of.KNOBS
        modes, _ = string_of(player, players, table, tables, key, number, pitch_hz, wheeled, out)
        if players[note + of.NOTE_OCTAVE] != 0:
            strings.thin(out, pitch_hz)
        fits = modes > 0 and (wheeled or not strings.overdamped(out, modes))
    else:
        for place in range(of.STRING):
            out[place] = player[note + of.NOTE_OWN + place]
    semitones = _semitones(player, mode, players[note + of.NOTE_CHANNEL]) + player[note + of.NOTE_TUNED]
    semitones += player[note + of.NOTE_APART] + player[note + of.NOTE_VIBRATO]
    ratio = 2.0 ** (semitones / 12)
    if fits and ratio != 1.0:
        if tables[of.TABLE_BEND_BY] == of.BY_LENGTH:
            out[of.LENGTH] = strings.slid(out, ratio)
        else:
            out[of.TENSION] = strings.bent(out, ratio)
        fits = strings.possible(out)
    if fits and players[note + of.NOTE_DAMPED] != 0:
        out[of.D1] = strings.damped(out, _value(player, players, table, tables, of.RELEASE_S))
        fits = strings.possible(out)
    if not fits:
        for place in range(of.STRING):
            out[place] = player[note + of.NOTE_STRING_NOW + place]


# Voices


@njit(**COMPILED)
def _pull(
    player: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    modes: int,
    position: float,
    peak_m: float,
    width: float,
) -> float:
    """The amplitudes of the modes of a pluck, and its highest point in m: its shape on the grid, then sines.

    Those of a blow are divided by its width, the shape's area over its height; `_release_pluck` does the rest.
    """
    grid, shape, highest = tables[of.TABLE_GRID], tables[of.TABLE_SHAPE], 0.0
    if shape == of.ROUNDED:
        _round(player, table, grid, modes, position, peak_m, width)
        return peak_m
    for point in range(grid):
        x = point / (grid - 1)
        distance = (x - position) / width
        if shape == of.TRIANGULAR:
            found = peak_m * min(x / position, (1 - x) / (1 - position))
        elif point == 0 or point == grid - 1:
            found = 0.0
        elif shape == of.GAUSSIAN:
            found = peak_m * math.exp(-distance * distance)
        else:
            found = peak_m / 2 * (1 + math.cos(2 * math.pi * distance)) if abs(distance) < 0.5 else 0.0
        player[of.PLAYER_PULLED + point] = found
        highest = max(highest, found)
    turn = 2 * (grid - 1)
    for mode in range(modes):
        total, place = 0.0, 0
        for point in range(1, grid - 1):
            place += mode + 1
            if place >= turn:
                place -= turn
            total += player[of.PLAYER_PULLED + point] * table[of.TABLE_SINES + place]
        player[of.PLAYER_AMPLITUDES + mode] = total * (2 / (grid - 1))
    if tables[of.TABLE_STRIKES] != 0:
        area = 0.0
        for point in range(grid):
            area += player[of.PLAYER_PULLED + point] / (peak_m * (grid - 1))
        for mode in range(modes):
            player[of.PLAYER_AMPLITUDES + mode] /= area
    return highest


@njit(**COMPILED)
def _round(
    player: np.ndarray, table: np.ndarray, grid: int, modes: int, position: float, peak_m: float, width: float
) -> None:
    """The amplitudes of the modes of a rounded triangle: as `excitation.rounded`.

    It peaks where the force pulls: elsewhere it is straight.
    """
    turn, highest = 2 * (grid - 1), 0.0
    near = int((position - width / 2) * (grid - 1)) - 1
    far = int((position + width / 2) * (grid - 1)) + 2
    low, high = max(near, 1), min(far, grid - 2) + 1
    player[of.PLAYER_PULLED + low : of.PLAYER_PULLED + high] = 0.0
    for mode in range(1, grid - 1):
        half = mode * width / 2
        spread = 0.5 if abs(half - 1) < 1e-6 else math.sin(math.pi * half) / (math.pi * half * (1 - half * half))
        each, place = math.sin(math.pi * mode * position) / (mode * mode) * spread, mode * low % turn
        for point in range(low, high):
            player[of.PLAYER_PULLED + point] += each * table[of.TABLE_SINES + place]
            place += mode
            if place >= turn:
                place -= turn
        if mode <= modes:
            player[of.PLAYER_AMPLITUDES + mode - 1] = each
    for point in range(low, high):
        highest = max(highest, player[of.PLAYER_PULLED + point])
    for mode in range(modes):
        player[of.PLAYER_AMPLITUDES + mode] *= peak_m / highest


@njit(**COMPILED)
def _weight(own: np.ndarray, partial: int, place: float, aperture_m: float) -> float:
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
            weight = _weight(own, partial, player[note + of.NOTE_POINT + point], aperture_m)
            heard = omega <= highest and (solo == 0 or solo == partial)
            voice[first] = part * weight if heard else 0.0
            voice[first + n] = 0.0
    at_bridge = player[note + of.NOTE_POINT] == of.BRIDGE and solo == 0
    voice[at.JAVARI_HEARD] = player[note + of.NOTE_HEARD] / FULL_SCALE_N if at_bridge else 0.0


@njit(**COMPILED)
def _slots_of_voice(players: np.ndarray, note: int, source: int) -> int:
    """First slot of the player's own voice for a note, by its number, and a source."""
    modes = players[of.PLAYER_MODES]
    each = at.HEADER + 8 * modes + 4 + 8 * at.QUANTUM + at.TRUTH_ROWS * modes
    each += of.BLOCKS * (at.B_HEADER + at.RESONATOR_ROWS * modes)
    return of.PLAYER_VOICES + (note * of.MOST_SOURCES + source) * each


@njit(**COMPILED)
def _release_pluck(player: np.ndarray, tables: np.ndarray, own: np.ndarray, partials: int, release_s: float) -> None:
    """Releases a pluck's partials within a time, or strikes them for so long: as `excitation`."""
    for mode in range(partials if tables[of.TABLE_STRIKES] != 0 else 0):
        share = math.sqrt(strings.omega_squared(own, 1) / strings.omega_squared(own, mode + 1))
        player[of.PLAYER_AMPLITUDES + mode] *= 2 / math.pi * share
    for mode in range(partials if release_s > 0.0 else 0):
        half = math.sqrt(strings.omega_squared(own, mode + 1)) * release_s / (2 * math.pi)
        left = 0.5 if abs(half - 1) < 1e-6 else math.sin(math.pi * half) / (math.pi * half * (1 - half * half))
        player[of.PLAYER_AMPLITUDES + mode] *= left


@njit(**COMPILED)
def _varied(stroke: int, key: int, which: int) -> float:
    """A number in -1 … 1 for each stroke: the same for the same strokes (splitmix64)."""
    mixed = np.uint64(stroke * 4096 + key * 16 + which + 1) * np.uint64(0x9E3779B97F4A7C15)
    mixed = (mixed ^ (mixed >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    mixed = mixed ^ (mixed >> np.uint64(31))
    return float(np.int64(mixed >> np.uint64(12))) / 2.0**51 - 1


@njit(**COMPILED)
def _split(player: np.ndarray, table: np.ndarray, tables: np.ndarray, partials: int, turned: float) -> int:
    """Splits a pluck's partials into modes of both polarisations; how many partials have two.

    Args:
        turned: by so many rad from the instrument's angle.
    """
    pairs = min(tables[of.TABLE_PAIRS], partials)
    if pairs == 0:
        return 0
    first, cosine, sine = of.PLAYER_AMPLITUDES, math.cos(turned), math.sin(turned)
    normal, along = table[of.TABLE_PULLED], table[of.TABLE_PULLED + 1]
    for mode in range(partials + pairs - 1, -1, -1):
        amplitude = player[first + strings.partial_of(mode, pairs) - 1]
        second = strings.direction_of(mode, pairs) == 1
        part = along * cosine + normal * sine if second else normal * cosine - along * sine
        if mode >= 2 * pairs:  # heard as the others are
            part = 1 / table[of.TABLE_HEARD]
        player[first + mode] = part * amplitude
    return pairs


@njit(**COMPILED)
def _fill(
    player: np.ndarray,
    players: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    note: int,
    string: np.ndarray,
    out: np.ndarray,
) -> None:
    """ω², σ, k, η² and the bridge's part of a note's modes, of its string as it is now."""
    losses = _value(player, players, table, tables, of.DECAY)
    inside = _value(player, players, table, tables, of.BRIGHTNESS_DECAY)
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
def _make_voice(
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
    """A voice of the modes of a note's own string, which sets out with the amplitudes of `_pull`: as `Voice`."""
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
    _fill(player, players, table, tables, note, own, voice[first : first + at.RESONATOR_ROWS * n])
    if player[note + of.NOTE_BRIDGE] > 0.0:
        counts[at.BRIDGED] = 2 * min(players[note + of.NOTE_PAIRS], of.MOST_PAIRS)
    for mode in range(n if tables[of.TABLE_STRIKES] != 0 else 0):
        voice[struck + n + mode] = voice[struck + mode] * math.sqrt(voice[first + mode])
        voice[struck + mode] = 0.0
    if table[of.TABLE_JAVARI] > 0.0:
        edge = table[of.TABLE_JAVARI : of.TABLE_JAVARI + 3]
        javari.fit(voice, own, players[note + of.NOTE_PAIRS], edge, rate_hz)
    behind = _behind(player, table, players[note + of.NOTE_MEMBER])
    if behind > 0:
        run_up(voice, behind / rate_hz)
    _weigh(player, players, voice, 0, note)
    if player[note + of.NOTE_POINT] == of.BRIDGE:
        largest = 0.0
        for mode in range(n):
            largest += abs(player[of.PLAYER_AMPLITUDES + mode] * voice[at.weights(n, 0, 0, 0) + mode])
        voice[at.LIMIT] = max(voice[at.LIMIT], RUNAWAY_FACTOR * largest)


# How loud a key is


@njit(**COMPILED)
def _forget_gains(player: np.ndarray) -> None:
    """Gains of keys are computed again, each with the next note of its key."""
    player[of.PLAYER_LIMIT] = 0.0
    for slot in range(of.KEYS * of.GAINS):
        player[of.PLAYER_GAINS + slot] = 0.0


@njit(**COMPILED)
def _reference_share(player: np.ndarray) -> float:
    """The share of the velocities at which keys are equally loud."""
    return ((of.REFERENCE_VELOCITY - 1) / 126) ** (4.0 ** -player[of.PLAYER_VALUES + of.CURVE])


@njit(**COMPILED)
def _contact_s(softest_ms: float, hardest_ms: float, share: float) -> float:
    """The time in which a pluck releases the string, or a hammer touches it, of a share of the velocities."""
    if softest_ms <= 0.0 or hardest_ms <= 0.0:
        return 0.0
    return softest_ms / 1000 * (hardest_ms / softest_ms) ** share


@njit(**COMPILED)
def _sound(
    player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray, key: int, string: int
) -> int:
    """Fills the sound of a key at the reference velocity, see `loudness`; how many modes it has, 0: it is silent.

    The modulation wheel and the mute do not count: what they change is heard as louder or softer.
    """
    own, values, first = _moment(player, 2), of.PLAYER_VALUES, of.PLAYER_SOUND
    pitch_hz = _pitch_hz(table, tables, key)
    if not pitch_hz > 0.0:
        return 0
    partials, shortened = string_of(player, players, table, tables, key, string, pitch_hz, False, own)
    if partials < 1 or strings.overdamped(own, partials):
        return 0
    share, soft = _reference_share(player), player[values + of.SOFTEST_MM]
    amplitude_mm = soft * (player[values + of.HARDEST_MM] / soft) ** share * shortened
    for mode in range(partials):
        pulled_m = min(amplitude_mm, LARGEST_AMPLITUDE_MM) / 1000
        player[of.PLAYER_AMPLITUDES + mode] = pulled_m * player[of.PLAYER_REFERENCE + mode]
    release_s = _contact_s(player[values + of.CONTACT_MS], player[values + of.CONTACT_HARD_MS], share)
    _release_pluck(player, tables, own, partials, release_s)
    modes, pairs, learned = partials, 0, tables[of.TABLE_RECORDED] != 0
    if learned:
        modes = recorded.modes_of(tables, partials)
        pairs = (modes + 1) // 2
        recorded.split(table, tables, own, modes, player[of.PLAYER_AMPLITUDES : of.PLAYER_AMPLITUDES + modes])
    else:
        pairs = _split(player, table, tables, partials, 0.0)
        modes += pairs
    decay, inside = player[values + of.DECAY], player[values + of.BRIGHTNESS_DECAY]
    together = decay
    if tables[of.TABLE_COURSE] > 1 and not _has_octave(table, tables, key, string):  # at first they are in phase
        together *= 1 + (tables[of.TABLE_COURSE] - 1) * table[of.TABLE_BRIDGE]
    rows = player[first : first + 4 * modes]
    strings.rows(
        own,
        modes,
        pairs,
        table[of.TABLE_DETUNING],
        together * table[of.TABLE_CONDUCTANCE],
        together * table[of.TABLE_CONDUCTANCE + 1],
        decay * table[of.TABLE_LOSSES],
        inside * table[of.TABLE_LOSSES + 1],
        inside * table[of.TABLE_LOSSES + 2],
        rows,
    )
    if learned:
        recorded.correct(table, tables, own, modes, rows)
    for mode in range(modes):
        partial, direction = strings.partial_of(mode, pairs), strings.direction_of(mode, pairs)
        omega = math.sqrt(rows[mode])
        amplitude = player[of.PLAYER_AMPLITUDES + mode]
        if pairs > 0 and not learned:
            amplitude *= table[of.TABLE_HEARD + direction]
        if tables[of.TABLE_VELOCITY] != 0:
            amplitude *= omega * (FULL_SCALE_M / FULL_SCALE_M_S)
        rows[of.SOUND_OMEGA * modes + mode] = omega
        left, right = player[values + of.POINT], player[values + of.POINT + 1]
        stereo, aperture_m = tables[of.TABLE_POINTS] == 2, table[of.TABLE_APERTURE_M]
        rows[of.SOUND_LEFT * modes + mode] = amplitude * _weight(own, partial, left, aperture_m)
        rows[of.SOUND_RIGHT * modes + mode] = amplitude * _weight(own, partial, right, aperture_m) if stereo else 0.0
    return modes


@njit(**COMPILED)
def _body(player: np.ndarray, table: np.ndarray, tables: np.ndarray) -> tuple[np.ndarray, float]:
    """The curves of the body, and how much of it is heard."""
    slot = tables[of.TABLE_BODY]
    return table[slot : slot + of.BODY_SLOTS], player[of.PLAYER_VALUES + of.BODY_MIX] if slot != 0 else 0.0


@njit(**COMPILED)
def _look_at_peaks(player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray) -> None:
    """The pluck of which keys are equally loud, and the factor that keeps all keys below the highest peak."""
    values, share = of.PLAYER_VALUES, _reference_share(player)
    width = player[values + of.WIDTH]
    width *= (player[values + of.WIDTH_HARD] / width) ** share
    partials = min(players[of.PLAYER_MODES] - of.MOST_PAIRS, of.MOST_MODES)
    _pull(player, table, tables, partials, player[values + of.POSITION], 1.0, width)
    for mode in range(partials):
        player[of.PLAYER_REFERENCE + mode] = player[of.PLAYER_AMPLITUDES + mode]
    (body, mix), highest = _body(player, table, tables), 0.0
    for number in range(loudness.LOOKED_AT):
        key = loudness.looked_at(tables[of.TABLE_LOW], tables[of.TABLE_HIGH], number)
        modes = _sound(player, players, table, tables, key, -1)
        sound = player[of.PLAYER_SOUND : of.PLAYER_SOUND + of.SOUND_ROWS * modes]
        gain = loudness.gain(sound, modes, tables[of.TABLE_POINTS], body, mix)
        swings = (tables[of.TABLE_VELOCITY] != 0) != (tables[of.TABLE_STRIKES] != 0)
        highest = max(highest, gain * loudness.peak(sound, modes, swings, body, mix, highest / gain))
    player[of.PLAYER_LIMIT] = loudness.limit(highest)


@njit(**COMPILED)
def _gain(
    player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray, key: int, string: int
) -> float:
    """The factor that makes a key as loud as others on a string of a set, -1: the one that it chooses."""
    slot = of.PLAYER_GAINS + key * of.GAINS + 1 + string
    if player[slot] == 0.0:
        if player[of.PLAYER_LIMIT] == 0.0:
            _look_at_peaks(player, players, table, tables)
        body, mix = _body(player, table, tables)
        modes = _sound(player, players, table, tables, key, string)
        sound = player[of.PLAYER_SOUND : of.PLAYER_SOUND + of.SOUND_ROWS * modes]
        found = loudness.gain(sound, modes, tables[of.TABLE_POINTS], body, mix)
        found /= max(tables[of.TABLE_COURSE], 1)  # of strings that swing together at first
        player[slot] = found * player[of.PLAYER_LIMIT] * table[of.TABLE_LEVEL]
    return player[slot]


@njit(**COMPILED)
def _release(address: int, frames: int) -> None:
    """Lets a voice fade out; a release under way continues."""
    counts = wholes(address)
    if counts[at.RELEASE] == 0:
        counts[at.RELEASE] = frames


@njit(**COMPILED)
def _release_note(player: np.ndarray, players: np.ndarray, note: int, seconds: float, frame: int) -> None:
    """Lets a note fade out; from a frame to come on, where that is above 0."""
    players[note + of.NOTE_RELEASED] = 1
    for source in range(of.MOST_SOURCES):
        address = players[note + of.NOTE_VOICES + source]
        if address != 0 and frame > 0:
            wholes(address)[at.RELEASE_AT] = frame
        elif address != 0:
            _release(address, _frames(player, seconds))


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
def _wish(
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
        blocks = _slots_of_voice(players, number, source + 1) - of.BLOCKS * size
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
    wishes[at.B_QUANTA], wishes[at.B_NEXT], wishes[at.B_AT] = _quanta(player, seconds), 0, frame
    if found != tail and tail != 0:
        wholes(tail)[at.B_NEXT] = found
    elif found != tail and latest != 0:
        wholes(latest)[at.B_NEXT] = found
    elif found != tail:
        counts[at.PENDING_MODES] = found
    return (found - base) // 8 + at.B_HEADER


@njit(**COMPILED)
def _retune(
    player: np.ndarray,
    players: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    number: int,
    seconds: float,
    frame: int,
    now: int,
) -> None:
    """Lets a note glide to its string as knobs, wheels and damper have changed it, where they have."""
    note, string, changed = _note(number), _moment(player, 2), False
    if players[note + of.NOTE_DRUM] != 0:
        return
    _string_now(player, players, table, tables, note, string)
    for place in range(of.STRING):
        changed = changed or string[place] != player[note + of.NOTE_STRING_NOW + place]
        player[note + of.NOTE_STRING_NOW + place] = string[place]
    mute = _mute(player, players, table, tables, players[note + of.NOTE_CHANNEL])
    changed = changed or mute != player[note + of.NOTE_MUTE]
    player[note + of.NOTE_MUTE] = mute
    if players[note + of.NOTE_TOUCHED] != 0 and max(frame, now) >= players[note + of.NOTE_LIFTED]:
        players[note + of.NOTE_TOUCHED] = 0
        changed = True
    if not changed:
        return
    size, filled = at.RESONATOR_ROWS * players[note + of.NOTE_MODES], 0
    for source in range(of.MOST_SOURCES):
        address = players[note + of.NOTE_VOICES + source]
        if address == 0 or _voice_over(address):
            continue
        slot = _wish(player, players, number, source, address, seconds, frame, now)
        if filled == 0:
            _fill(player, players, table, tables, note, string, player[slot : slot + size])
            filled = slot
        else:
            for place in range(size):
                player[slot + place] = player[filled + place]


@njit(**COMPILED)
def _damp(
    player: np.ndarray,
    players: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    number: int,
    frame: int,
    now: int,
) -> None:
    """Puts the damper on a string or a drum that nothing holds."""
    note = _note(number)
    held = players[note + of.NOTE_HELD] + players[note + of.NOTE_KEPT] + players[note + of.NOTE_DAMPED]
    if held != 0 or tables[of.TABLE_LET_RING] != 0:
        return
    players[note + of.NOTE_DAMPED] = 1
    if players[note + of.NOTE_DRUM] == 0:
        _retune(player, players, table, tables, number, DAMPER_S, frame, now)
        if players[note + of.NOTE_MEMBER] != 0:
            return
        level_db = _value(player, players, table, tables, of.DAMPER_DB)
        stroke, key = (
            players[note + of.NOTE_AGE] if table[of.TABLE_VARIATION] > 0.0 else 0,
            players[note + of.NOTE_KEY],
        )
        contact.touch(player, players, table, of.RELEASE, level_db, 1.0, stroke, key, frame, 0.0, 0.0)
        return
    t60_s = _value(player, players, table, tables, of.RELEASE_S)
    for source in range(of.MOST_SOURCES):
        address = players[note + of.NOTE_VOICES + source]
        if address == 0 or _voice_over(address):
            continue
        voice, n = reals(address), wholes(address)[at.MODES]
        slot = _wish(player, players, number, source, address, DAMPER_S, frame, now)
        first = at.state(n) + at.OMEGA_SQUARED * n
        for place in range(at.RESONATOR_ROWS * n):
            player[slot + place] = voice[first + place]
            if n <= place < 2 * n:  # σ
                player[slot + place] += math.log(1000.0) / t60_s


# Notes


@njit(**COMPILED)
def _report(
    player: np.ndarray, players: np.ndarray, kind: int, id: int, channel: int, key: int, frame: int, velocity: float
) -> int:
    """One more report; its first slot, for what else is in it. `_reported` publishes it."""
    slot = of.PLAYER_REPORTS + players[of.PLAYER_REPORTED] % of.REPORTS * of.REPORT_SLOTS
    players[slot + of.REPORT_KIND] = kind
    players[slot + of.REPORT_ID] = id
    players[slot + of.REPORT_CHANNEL] = channel
    players[slot + of.REPORT_KEY] = key
    players[slot + of.REPORT_FRAME] = frame
    player[slot + of.REPORT_VELOCITY] = velocity
    return slot


@njit(**COMPILED)
def _reported(players: np.ndarray) -> None:
    fence()
    players[of.PLAYER_REPORTED] += 1


@njit(**COMPILED)
def _refuse(player: np.ndarray, players: np.ndarray, event: int) -> None:
    """Reports a note that no string can play, or that was cancelled."""
    id, channel, key = players[event + of.EVENT_ID], players[event + of.EVENT_CHANNEL], players[event + of.EVENT_KEY]
    frame, velocity = players[event + of.EVENT_FRAME], player[event + of.EVENT_VALUE]
    _report(player, players, of.REFUSED, id, channel, key, frame, velocity)
    _reported(players)


@njit(**COMPILED)
def _forget(player: np.ndarray, players: np.ndarray, note: int, frame: int) -> None:
    """A note has ended: its slots are free."""
    players[note + of.NOTE_STATE] = of.FREE
    if players[note + of.NOTE_MEMBER] != 0:
        return
    id, channel, key = players[note + of.NOTE_ID], players[note + of.NOTE_CHANNEL], players[note + of.NOTE_KEY]
    _report(player, players, of.ENDED, id, channel, key, frame, 0.0)
    _reported(players)


@njit(**COMPILED)
def _free_note(player: np.ndarray, players: np.ndarray, mixers: np.ndarray) -> int:
    """A free note; where there is none, one which has not begun or fades is cut, else the oldest."""
    best, best_rank, best_age = 0, 3, 0
    for number in range(of.MOST_NOTES):
        note = _note(number)
        if players[note + of.NOTE_STATE] == of.FREE:
            return number
        if _over(players, note):
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
        address = players[_note(best) + of.NOTE_VOICES + source]
        if address != 0:
            _take_out(mixers, address)
    players[of.PLAYER_CUT] += 1
    _forget(player, players, _note(best), mixers[at.M_FRAMES])
    return best


@njit(**COMPILED)
def _take_out(mixers: np.ndarray, address: int) -> None:
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
def _follow(player: np.ndarray, players: np.ndarray, tables: np.ndarray, note: int, before: int) -> None:
    """A note has the string of the one before, which is stopped, or whose motion continues in it."""
    stops = _frames(player, PLUCK_STOPS_S)
    for source in range(of.MOST_SOURCES):
        address, other = players[note + of.NOTE_VOICES + source], players[before + of.NOTE_VOICES + source]
        if other == 0 or _voice_over(other):
            continue
        if address == 0:
            _release(other, stops)
            continue
        wholes(address)[at.PREVIOUS_VOICE] = other
        wholes(address)[at.STOPS_IN] = stops if tables[of.TABLE_STOPS] != 0 else 0


@njit(**COMPILED)
def _make_room(player: np.ndarray, players: np.ndarray) -> None:
    """Releases the oldest notes where more ring than may."""
    while True:
        ringing, oldest, age = 0, 0, 0
        for number in range(of.MOST_NOTES):
            note = _note(number)
            free = players[note + of.NOTE_STATE] == of.FREE or players[note + of.NOTE_RELEASED] != 0
            if free or _over(players, note):
                continue
            if ringing == 0 or players[note + of.NOTE_AGE] < age:
                oldest, age = note, players[note + of.NOTE_AGE]
            ringing += 1
        if ringing <= players[of.PLAYER_MOST]:
            return
        _release_note(player, players, oldest, STOLEN_S, 0)


@njit(**COMPILED)
def _behind(player: np.ndarray, table: np.ndarray, member: int) -> int:
    """Frames from the stroke of a string of a course to its beginning, in step with the first; 0: at once."""
    later = round(member * table[of.TABLE_APART_S] * player[of.PLAYER_RATE])
    return -later % at.QUANTUM if table[of.TABLE_BRIDGE] > 0.0 else 0


@njit(**COMPILED)
def _strike(
    player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray, mixers: np.ndarray, event: int
) -> None:
    """Plays all strings of a key's course, one after the other; the first is the one that is reported."""
    _note_on(player, players, table, tables, mixers, event, 0)
    frame = players[event + of.EVENT_FRAME]
    for member in range(1, tables[of.TABLE_COURSE]):
        later = round(member * table[of.TABLE_APART_S] * player[of.PLAYER_RATE])
        later += _behind(player, table, member)
        players[event + of.EVENT_FRAME] = max(frame, mixers[at.M_FRAMES]) + later if later > 0 else frame
        _note_on(player, players, table, tables, mixers, event, member)
    players[event + of.EVENT_FRAME] = frame


@njit(**COMPILED)
def _note_on(
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
    players[_channel(channel) + of.CHANNEL_PLAYS] = 1
    place, string, count = _place(players, tables, event), -1, tables[of.TABLE_STRINGS]
    if place % 256 == 0 and count > 0 and _chosen(table, count, key) != place // 256 - 1:
        string = place // 256 - 1
    place += MEMBERS_APART * member
    octaves = _has_octave(table, tables, key, string)
    octave = member > 0 and octaves
    own, modes, gain, highest_m = _moment(player, 3), 0, 1.0, 0.0
    position = amplitude_mm = width = 0.0
    pairs, strength, stroke, touched = 0, 1.0, 0, 0
    if not drum:
        pitch_hz = _pitch_hz(table, tables, key)
        shortened = 1.0
        if pitch_hz > 0.0:
            modes, shortened = string_of(player, players, table, tables, key, string, pitch_hz, False, own)
        if octave and modes > 0:
            strings.thin(own, pitch_hz)
            modes = min(modes, strings.modes_below(own, of.HIGHEST_HZ)) if strings.possible(own) else 0
        if modes < 1 or strings.overdamped(own, modes):
            if member > 0:
                return
            _refuse(player, players, event)
            return
        gain = _gain(player, players, table, tables, key, string)
        curve, soft = (
            _value(player, players, table, tables, of.CURVE),
            _value(player, players, table, tables, of.SOFTEST_MM),
        )
        share = min(max((velocity - 1) / 126, 0.0), 1.0) ** (4.0**-curve)
        harder = _value(player, players, table, tables, of.HARDEST_MM) / soft
        amplitude_mm = min(soft * harder**share * shortened, LARGEST_AMPLITUDE_MM)
        if by_hand:
            amplitude_mm = min(player[event + of.EVENT_AMPLITUDE_MM], LARGEST_AMPLITUDE_MM)
            if harder != 1.0:
                share = min(max(math.log(amplitude_mm / soft / shortened) / math.log(harder), 0.0), 1.0)
        strength = harder ** (share - ((of.REFERENCE_VELOCITY - 1) / 126) ** (4.0**-curve))
        width = _value(player, players, table, tables, of.WIDTH)
        width *= (_value(player, players, table, tables, of.WIDTH_HARD) / width) ** share
        position, slide = (
            _value(player, players, table, tables, of.POSITION),
            players[_channel(channel) + of.CHANNEL_SLIDE],
        )
        if by_hand:
            position = min(max(player[event + of.EVENT_POSITION], POSITION_RANGE[0]), POSITION_RANGE[1])
            width = player[event + of.EVENT_WIDTH]
        elif mode == of.MPE and slide >= 0:
            position = MPE_POSITIONS[0] + (MPE_POSITIONS[1] - MPE_POSITIONS[0]) * min(slide, 127) / 127
        turned, varies = 0.0, table[of.TABLE_VARIATION]
        softest_ms = _value(player, players, table, tables, of.CONTACT_MS)
        release_s = _contact_s(softest_ms, _value(player, players, table, tables, of.CONTACT_HARD_MS), share)
        if varies > 0.0:
            stroke = players[of.PLAYER_AGE]
            if not by_hand:
                position *= 1 + varies * VARIES_PLACE * _varied(stroke, key, 0)
                position = min(max(position, POSITION_RANGE[0]), POSITION_RANGE[1])
                amplitude_mm *= 10.0 ** (varies * VARIES_DB / 20 * _varied(stroke, key, 1))
                amplitude_mm = min(amplitude_mm, LARGEST_AMPLITUDE_MM)
                width *= 1 + varies * VARIES_WIDTH * _varied(stroke, key, 2)
            release_s *= 1 + varies * VARIES_RELEASE * _varied(stroke, key, 3)
            turned = varies * VARIES_ANGLE * _varied(stroke, key, 4)
        touched = _node(player, players, table, tables, channel, modes)
        if touched > 0 and not by_hand:
            position = min(position, HARMONIC_REACH / touched)
        highest_m = _pull(player, table, tables, modes, position, amplitude_mm / 1000, width)
        _release_pluck(player, tables, own, modes, release_s)
        if tables[of.TABLE_RECORDED] != 0:
            modes = recorded.modes_of(tables, modes)
            pairs = (modes + 1) // 2
            recorded.split(table, tables, own, modes, player[of.PLAYER_AMPLITUDES : of.PLAYER_AMPLITUDES + modes])
        else:
            pairs = _split(player, table, tables, modes, turned)
            modes += pairs
    number = _free_note(player, players, mixers)
    note = _note(number)
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
    players[note + of.NOTE_MEMBER] = member
    players[note + of.NOTE_OCTAVE] = octave
    if not drum and not octaves and tables[of.TABLE_COURSE] > 1 and table[of.TABLE_CONDUCTANCE] > 0.0:
        player[note + of.NOTE_BRIDGE] = table[of.TABLE_BRIDGE] if pairs > 0 else 0.0
    if member > 0:  # above and below the first by turns, each key a little otherwise
        apart = (member + 1) // 2 * (1 if member % 2 == 1 else -1) * (1 + COURSES_VARY * _varied(0, key, member))
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
        lasts = _frames(player, TOUCH_PERIODS / strings.pitch_hz(own))
        players[note + of.NOTE_LIFTED] = players[note + of.NOTE_BEGAN] + lasts
    player[note + of.NOTE_MUTE] = _mute(player, players, table, tables, channel)
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
        address = players[of.PLAYER_HERE] + 8 * _slots_of_voice(players, number, source)
        if not drum:
            kind, program = tables[of.TABLE_KINDS + source], tables[of.TABLE_PROGRAMS + source]
            _make_voice(
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
            if player[note + of.NOTE_BRIDGE] > 0.0:
                first = players[of.PLAYER_AGE] - member  # of this player, for another may ring as well
                wholes(address)[at.COURSE] = players[of.PLAYER_HERE] + of.MOST_SOURCES * first + source
            voice[at.WANTED_GAIN] = voice[at.GAIN] = voice[at.GAIN_FROM] = voice[at.GAIN_TO] = begun
        players[note + of.NOTE_VOICES + source] = address
    for each in range(of.MOST_NOTES):
        before = _note(each)
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
        spared = players[of.PLAYER_SPARES] != 0 and player[of.PLAYER_SOURCE_GAINS + source] == 0.0
        if mixers[at.M_ACTIVE] < at.MOST_VOICES and not spared:
            mixers[at.M_VOICES + mixers[at.M_ACTIVE]] = address
            mixers[at.M_ACTIVE] += 1
        else:
            wholes(address)[at.STATE] = at.OVER
    _retune(player, players, table, tables, number, 0.0, 0, mixers[at.M_FRAMES])
    if not drum and member == 0:
        level_db = _value(player, players, table, tables, of.ONSET_DB)
        contact.touch(player, players, table, of.STROKE, level_db, strength, stroke, key, frame, 0.0, 0.0)
    _make_room(player, players)
    _report_began(player, players, tables, event, number, player[note + of.NOTE_OWN : note + of.NOTE_OWN + of.STRING])


@njit(**COMPILED)
def _report_began(
    player: np.ndarray, players: np.ndarray, tables: np.ndarray, event: int, number: int, own: np.ndarray
) -> None:
    """Reports the note of an event, and the string of its key."""
    note, frame = _note(number), players[event + of.EVENT_FRAME]
    if players[note + of.NOTE_MEMBER] != 0:
        return
    id, channel, key = players[note + of.NOTE_ID], players[note + of.NOTE_CHANNEL], players[note + of.NOTE_KEY]
    slot = _report(player, players, of.BEGAN, id, channel, key, frame, player[event + of.EVENT_VALUE])
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
    _reported(players)


@njit(**COMPILED)
def _move(
    player: np.ndarray,
    players: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    number: int,
    key: int,
    frame: int,
    now: int,
) -> bool:
    """Shortens or lengthens the string of a note for another key; False where it cannot play that key."""
    note, count, mode = _note(number), tables[of.TABLE_STRINGS], tables[of.TABLE_MODE]
    pitch_hz, string = _pitch_hz(table, tables, key), players[note + of.NOTE_STRING]
    if count > 0 and string < 0:
        string = _chosen(table, count, players[note + of.NOTE_KEY])
    if pitch_hz <= 0.0 or (count > 0 and key < table[of.TABLE_OPEN + string * of.OPEN_SLOTS + of.OPEN_NOTE]):
        return False
    modes, _ = string_of(player, players, table, tables, key, string, pitch_hz, False, _moment(player, 3))
    if modes < 1:
        return False
    if players[note + of.NOTE_PLACE] % 256 != 0:  # a place for each key
        players[note + of.NOTE_PLACE] += key - players[note + of.NOTE_KEY]
        for each in range(of.MOST_NOTES):
            other = _note(each)
            if (
                each != number
                and _sounds(players, other)
                and players[other + of.NOTE_PLACE] == players[note + of.NOTE_PLACE]
            ):
                players[other + of.NOTE_HAS_PLACE] = 0
                _release_note(player, players, other, PLUCK_STOPS_S, frame)
    players[note + of.NOTE_STRING], players[note + of.NOTE_KEY] = string, key
    seconds = _moves_in_s(players, mode, players[note + of.NOTE_CHANNEL])
    if players[note + of.NOTE_MEMBER] == 0:
        level_db = _value(player, players, table, tables, of.DAMPER_DB)
        if not strings.is_wound(player[note + of.NOTE_OWN : note + of.NOTE_OWN + of.STRING]):
            level_db -= PLAIN_DB
        slid_m = abs(_moment(player, 3)[of.LENGTH] - player[note + of.NOTE_STRING_NOW + of.LENGTH])
        slides_s = seconds if seconds > HAMMER_S else 0.0
        stroke = players[note + of.NOTE_AGE] if table[of.TABLE_VARIATION] > 0.0 else 0
        contact.touch(player, players, table, of.RELEASE, level_db, 1.0, stroke, key, frame, slid_m, slides_s)
    _retune(player, players, table, tables, number, seconds, frame, now)
    return True


@njit(**COMPILED)
def _move_others(
    player: np.ndarray,
    players: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    first: int,
    before: int,
    key: int,
    frame: int,
    now: int,
) -> None:
    """Lets the other strings of a course follow the first, a note that has moved."""
    id, channel = players[first + of.NOTE_ID], players[first + of.NOTE_CHANNEL]
    for number in range(of.MOST_NOTES):
        note = _note(number)
        same = players[note + of.NOTE_KEY] == before and players[note + of.NOTE_CHANNEL] == channel
        same = same and players[note + of.NOTE_MEMBER] != 0 and players[note + of.NOTE_ID] == id
        if same and _sounds(players, note):
            _move(player, players, table, tables, number, key, frame, now)


@njit(**COMPILED)
def _hammer_on(
    player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray, event: int, frame: int, now: int
) -> bool:
    """Lets a key have the latest note that is held on its channel, where legato is on; whether it has one.

    Where the event gives a string, only a note on that string.
    """
    channel, key, found, age = players[event + of.EVENT_CHANNEL], players[event + of.EVENT_KEY], -1, 0
    place = _place(players, tables, event)
    if not _switched(players, tables[of.TABLE_MODE], channel, of.CHANNEL_LEGATO):
        return False
    for number in range(of.MOST_NOTES):
        note = _note(number)
        held = players[note + of.NOTE_HELD] != 0 and players[note + of.NOTE_CHANNEL] == channel
        if (
            held
            and players[note + of.NOTE_MEMBER] == 0
            and (place % 256 != 0 or players[note + of.NOTE_PLACE] == place)
            and players[note + of.NOTE_AGE] > age
            and _sounds(players, note)
        ):
            found, age = number, players[note + of.NOTE_AGE]
    if found < 0:
        return False
    note = _note(found)
    id, before = players[note + of.NOTE_ID], players[note + of.NOTE_KEY]
    if key == before or not _move(player, players, table, tables, found, key, frame, now):
        return False
    _move_others(player, players, table, tables, note, before, key, frame, now)
    _report(player, players, of.ENDED, id, channel, before, now, 0.0)
    _reported(players)
    for number in range(of.MOST_NOTES):
        other = _note(number)
        if players[other + of.NOTE_MEMBER] != 0 and players[other + of.NOTE_ID] == id:
            players[other + of.NOTE_ID] = players[event + of.EVENT_ID]
    players[note + of.NOTE_ID] = players[event + of.EVENT_ID]
    _report_began(player, players, tables, event, found, _moment(player, 3))
    return True


@njit(**COMPILED)
def _pull_off(
    player: np.ndarray,
    players: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    number: int,
    frame: int,
    now: int,
) -> bool:
    """Gives the note of a released key to the highest key that is down and has none; whether there is one."""
    channel, before = players[_note(number) + of.NOTE_CHANNEL], players[_note(number) + of.NOTE_KEY]
    if not _switched(players, tables[of.TABLE_MODE], channel, of.CHANNEL_LEGATO):
        return False
    for key in range(of.KEYS - 1, -1, -1):
        free = _is_down(players, channel, key)
        for each in range(of.MOST_NOTES):
            other = _note(each)
            same = players[other + of.NOTE_KEY] == key and players[other + of.NOTE_CHANNEL] == channel
            same = same and players[other + of.NOTE_MEMBER] == 0
            free = free and not (same and players[other + of.NOTE_HELD] != 0 and _sounds(players, other))
        if free and _move(player, players, table, tables, number, key, frame, now):
            _move_others(player, players, table, tables, _note(number), before, key, frame, now)
            return True
    return False


@njit(**COMPILED)
def _note_off(
    player: np.ndarray,
    players: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    event: int,
    frame: int,
    now: int,
) -> None:
    channel, key = players[event + of.EVENT_CHANNEL], players[event + of.EVENT_KEY]
    place = _place(players, tables, event)
    for turn in range(2 * of.MOST_NOTES):  # first strings of courses first, which the others follow
        number = turn % of.MOST_NOTES
        note = _note(number)
        same = players[note + of.NOTE_KEY] == key and players[note + of.NOTE_CHANNEL] == channel
        same = same and (players[note + of.NOTE_MEMBER] == 0) == (turn < of.MOST_NOTES)
        given = players[event + of.EVENT_STRING] != 0
        same = same and (not given or players[note + of.NOTE_PLACE] % MEMBERS_APART == place)
        if same and players[note + of.NOTE_HELD] != 0 and _sounds(players, note):
            if players[note + of.NOTE_MEMBER] == 0 and _pull_off(player, players, table, tables, number, frame, now):
                continue
            players[note + of.NOTE_HELD] = 0
            players[note + of.NOTE_KEPT] = _pedal(players, tables[of.TABLE_MODE], channel)
            _damp(player, players, table, tables, number, frame, now)


@njit(**COMPILED)
def _is_meant(players: np.ndarray, event: int, note: int) -> bool:
    """Whether an event is for a note: of its number, channel and key, as far as they are given."""
    id, channel, key = players[event + of.EVENT_ID], players[event + of.EVENT_CHANNEL], players[event + of.EVENT_KEY]
    if players[note + of.NOTE_STATE] != of.RINGS or (id != 0 and players[note + of.NOTE_ID] != id):
        return False
    return channel in (of.ANY, players[note + of.NOTE_CHANNEL]) and key in (of.ANY, players[note + of.NOTE_KEY])


@njit(**COMPILED)
def _tune(
    player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray, event: int, frame: int, now: int
) -> None:
    """Bends single notes."""
    semitones = min(max(player[event + of.EVENT_VALUE], -WIDEST_SEMITONES), WIDEST_SEMITONES)
    for number in range(of.MOST_NOTES):
        note = _note(number)
        if _is_meant(players, event, note) and _sounds(players, note):
            player[note + of.NOTE_TUNED] = semitones
            _retune(player, players, table, tables, number, BEND_S, frame, now)


@njit(**COMPILED)
def _choke(player: np.ndarray, players: np.ndarray, event: int, frame: int) -> None:
    """Lets single notes fade out fast, though their instrument lets them ring."""
    seconds = player[event + of.EVENT_VALUE] if player[event + of.EVENT_VALUE] > 0.0 else STOP_S
    for number in range(of.MOST_NOTES):
        note = _note(number)
        if _is_meant(players, event, note):
            _release_note(player, players, note, seconds, frame)
            players[note + of.NOTE_HAS_PLACE] = 0


# Chords, tremolo, harmonics


@njit(**COMPILED)
def _height(players: np.ndarray, tables: np.ndarray, event: int) -> int:
    """Rises from the lowest note of a chord to the highest: by strings where these are given, else by keys."""
    place = _place(players, tables, event)
    string = of.CHANNELS + 1 - place // 256 if place % 256 == 0 else 0
    return string * of.KEYS + players[event + of.EVENT_KEY]


@njit(**COMPILED)
def _strums_in(player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray, event: int) -> int:
    """Frames from string to string of a chord that the note of an event is in; 0: notes begin as they come."""
    note_on = players[event + of.EVENT_KIND] == of.NOTE_ON and player[event + of.EVENT_VALUE] > 0.0
    channel = players[event + of.EVENT_CHANNEL]
    by_hand = player[event + of.EVENT_POSITION] > 0.0
    if not note_on or by_hand or not 0 <= channel < of.CHANNELS or tables[of.TABLE_DRUMS] != 0:
        return 0
    switch = of.CHANNEL_STRUMS
    milliseconds = _technique(player, players, table, tables, channel, of.STRUM_MS, switch, USUAL_STRUM_MS)
    return _frames(player, milliseconds / 1000) if milliseconds > 0.0 else 0


@njit(**COMPILED)
def _continues(player: np.ndarray, players: np.ndarray, frame: int) -> bool:
    """Whether a note that comes at a frame belongs to the latest chord."""
    since = frame - players[of.PLAYER_CHORD_BEGAN]
    return players[of.PLAYER_CHORD] != 0 and 0 <= since <= _frames(player, CHORD_S)


@njit(**COMPILED)
def _goes_up(player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray) -> bool:
    """Whether the next strum goes from the highest note to the lowest."""
    strokes = round(_value(player, players, table, tables, of.STROKES))
    return strokes == of.UP or (strokes == of.ALTERNATE and players[of.PLAYER_NEXT_UP] != 0)


@njit(**COMPILED)
def _swap(players: np.ndarray, first: int, second: int) -> None:
    """Exchanges two events; each place keeps its frame."""
    for slot in range(of.EVENT_SLOTS):
        if slot != of.EVENT_FRAME:
            kept = players[first + slot]
            players[first + slot] = players[second + slot]
            players[second + slot] = kept


@njit(**COMPILED)
def _arrange(player: np.ndarray, players: np.ndarray, now: int, first: int, count: int, place: int, end: int) -> None:
    """Lets the first string of a chord come first, of notes that come at the same frame.

    Args:
        first, count: slot and number of the events of a ring, of which `place` is played next, and `end` is the last
            one's successor.
    """
    address, event = players[of.PLAYER_TABLE], first + place % count * of.EVENT_SLOTS
    if address == 0 or players[event + of.EVENT_CHORD] != 0:
        return
    table, tables, frame = reals(address), wholes(address), max(players[event + of.EVENT_FRAME], now)
    if _strums_in(player, players, table, tables, event) == 0 or _continues(player, players, frame):
        return
    up, best = _goes_up(player, players, table, tables), event
    for each in range(place + 1, end):
        other = first + each % count * of.EVENT_SLOTS
        together = max(players[other + of.EVENT_FRAME], now) == frame and players[other + of.EVENT_CHORD] == 0
        if not together or _strums_in(player, players, table, tables, other) == 0:
            break
        higher = _height(players, tables, other) > _height(players, tables, best)
        if higher == up:
            best = other
    _swap(players, event, best)


@njit(**COMPILED)
def _strum(
    player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray, event: int, now: int
) -> bool:
    """Lets a note wait for its turn in a chord; False: it begins now."""
    chord = players[of.PLAYER_CHORD]
    if players[event + of.EVENT_CHORD] != 0:  # its turn has come
        players[of.PLAYER_CHORD_BEGUN] += players[event + of.EVENT_CHORD] == chord
        players[event + of.EVENT_CHORD] = 0
        return False
    step, frame = _strums_in(player, players, table, tables, event), max(players[event + of.EVENT_FRAME], now)
    if step == 0:
        return False
    if not _continues(player, players, frame):
        players[of.PLAYER_CHORD] += 1
        players[of.PLAYER_CHORD_BEGAN] = frame
        players[of.PLAYER_CHORD_BEGUN] = 1
        players[of.PLAYER_CHORD_UP] = _goes_up(player, players, table, tables)
        return False
    if players[of.PLAYER_QUEUED] == of.QUEUED:
        return False
    players[of.PLAYER_NEXT_UP] = 1 - players[of.PLAYER_CHORD_UP]
    turn = players[of.PLAYER_CHORD_BEGUN]
    for place in range(players[of.PLAYER_QUEUED]):
        turn += players[of.PLAYER_QUEUE + place * of.EVENT_SLOTS + of.EVENT_CHORD] == chord
    players[event + of.EVENT_CHORD], players[event + of.EVENT_CAME] = chord, frame
    players[event + of.EVENT_FRAME] = max(players[of.PLAYER_CHORD_BEGAN] + turn * step, frame)
    player[event + of.EVENT_STRUCK_S] = 0.0  # its latency is meant
    _queue(players, event)
    players[event + of.EVENT_CHORD] = 0
    later, up = 0, players[of.PLAYER_CHORD_UP] != 0
    for place in range(players[of.PLAYER_QUEUED] - 1, -1, -1):  # from the new one, which is the last, to its turn
        each = of.PLAYER_QUEUE + place * of.EVENT_SLOTS
        if players[each + of.EVENT_CHORD] != chord:
            continue
        if later != 0:
            if (_height(players, tables, each) < _height(players, tables, later)) != up:
                break
            _swap(players, each, later)
        later = each
    return True


@njit(**COMPILED)
def _waits(players: np.ndarray, event: int, now: int) -> bool:
    """Puts what is meant for a note behind it where that waits for its turn in a chord; whether it does."""
    id, channel, key = players[event + of.EVENT_ID], players[event + of.EVENT_CHANNEL], players[event + of.EVENT_KEY]
    by_id = id != 0 and players[event + of.EVENT_KIND] in (of.TUNE, of.CHOKE)
    for place in range(players[of.PLAYER_QUEUED]):
        each = of.PLAYER_QUEUE + place * of.EVENT_SLOTS
        if players[each + of.EVENT_CHORD] == 0:
            continue
        meant = players[each + of.EVENT_CHANNEL] == channel and players[each + of.EVENT_KEY] == key
        meant = meant and players[event + of.EVENT_STRING] in (0, players[each + of.EVENT_STRING])
        if by_id:
            meant = players[each + of.EVENT_ID] == id
        if meant and players[of.PLAYER_QUEUED] < of.QUEUED:
            later = players[each + of.EVENT_FRAME] - players[each + of.EVENT_CAME]
            players[event + of.EVENT_FRAME] = max(players[event + of.EVENT_FRAME], now) + later
            _queue(players, event)
            return True
    return False


@njit(**COMPILED)
def _forget_turns(player: np.ndarray, players: np.ndarray, mode: int, channel: int) -> None:
    """Forgets notes that wait for their turns in a chord: those of a channel, or all, -1."""
    for place in range(players[of.PLAYER_QUEUED]):
        event = of.PLAYER_QUEUE + place * of.EVENT_SLOTS
        meant = channel < 0 or _is_master(mode, channel, players[event + of.EVENT_CHANNEL])
        if players[event + of.EVENT_CHORD] != 0 and meant:
            _refuse(player, players, event)
            players[event + of.EVENT_CHORD] = 0
            players[event + of.EVENT_KIND] = of.NOTHING


@njit(**COMPILED)
def _vibrate(
    player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray, number: int, now: int
) -> None:
    """Lets a note glide to where its vibrato is some quanta later; all strings of a course alike."""
    note, depth = _note(number), _value(player, players, table, tables, of.VIBRATO_CENTS) / 100
    if depth == 0.0 and player[note + of.NOTE_VIBRATO] == 0.0:
        return
    ahead = now + VIBRATO_QUANTA * at.QUANTUM - players[note + of.NOTE_BEGAN]
    hz = _value(player, players, table, tables, of.VIBRATO_HZ)
    player[note + of.NOTE_VIBRATO] = depth * math.sin(2 * math.pi * hz * max(ahead, 0) / player[of.PLAYER_RATE])
    seconds = VIBRATO_QUANTA * at.QUANTUM / player[of.PLAYER_RATE]
    _retune(player, players, table, tables, number, seconds, 0, now)


@njit(inline="always", **COMPILED)
def _follow_hands(player: np.ndarray, players: np.ndarray, mixers: np.ndarray, now: int) -> None:
    """Lifts fingers from strings that they touch, and plucks again what a tremolo plucks, in the next quantum."""
    address = players[of.PLAYER_TABLE]
    if address == 0:
        return
    table, tables, end = reals(address), wholes(address), now + at.QUANTUM
    if tables[of.TABLE_DRUMS] != 0:
        return
    for number in range(of.MOST_NOTES):
        note = _note(number)
        if players[note + of.NOTE_STATE] != of.RINGS:
            continue
        if players[note + of.NOTE_TOUCHED] != 0 and players[note + of.NOTE_LIFTED] < end:
            _retune(player, players, table, tables, number, LIFT_S, players[note + of.NOTE_LIFTED], now)
        if (now - players[note + of.NOTE_BEGAN]) // at.QUANTUM % VIBRATO_QUANTA == 0:
            _vibrate(player, players, table, tables, number, now)
        if players[note + of.NOTE_HELD] == 0 or players[note + of.NOTE_RELEASED] != 0 or not _sounds(players, note):
            continue
        channel, switch = players[note + of.NOTE_CHANNEL], of.CHANNEL_TREMOLO
        if players[note + of.NOTE_MEMBER] != 0 or players[note + of.NOTE_BY_HAND] != 0:
            continue
        hz = _technique(player, players, table, tables, channel, of.TREMOLO_HZ, switch, USUAL_TREMOLO_HZ)
        due = players[note + of.NOTE_BEGAN] + _frames(player, 1 / hz) if hz > 0.0 else end
        if due < end:
            _pluck_again(player, players, table, tables, mixers, note, max(due, now))


@njit(inline="always", **COMPILED)
def _pluck_again(
    player: np.ndarray,
    players: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    mixers: np.ndarray,
    note: int,
    frame: int,
) -> None:
    """Plucks the string of a note again: another note with its number, which ends without a report of its own."""
    event = of.PLAYER_AGAIN
    for slot in range(of.EVENT_SLOTS):
        players[event + slot] = 0
    players[event + of.EVENT_FRAME], players[event + of.EVENT_KIND] = frame, of.NOTE_ON
    players[event + of.EVENT_CHANNEL] = players[note + of.NOTE_CHANNEL]
    players[event + of.EVENT_KEY] = players[note + of.NOTE_KEY]
    players[event + of.EVENT_ID] = players[note + of.NOTE_ID]
    if players[note + of.NOTE_PLACE] % 256 == 0:
        players[event + of.EVENT_STRING] = players[note + of.NOTE_PLACE] // 256
    player[event + of.EVENT_VALUE] = player[note + of.NOTE_VELOCITY]
    players[note + of.NOTE_ID], players[note + of.NOTE_BEGAN] = 0, frame
    tuned, before = player[note + of.NOTE_TUNED], players[of.PLAYER_AGE]
    _strike(player, players, table, tables, mixers, event)
    for number in range(of.MOST_NOTES):
        made = _note(number)
        if tuned != 0.0 and players[made + of.NOTE_STATE] == of.RINGS and players[made + of.NOTE_AGE] > before:
            player[made + of.NOTE_TUNED] = tuned
            _retune(player, players, table, tables, number, 0.0, 0, mixers[at.M_FRAMES])


# Controllers


@njit(**COMPILED)
def _damp_unkept(
    player: np.ndarray, players: np.ndarray, table: np.ndarray, tables: np.ndarray, frame: int, now: int
) -> None:
    """Puts the damper on strings that a pedal kept, and keeps no longer."""
    for number in range(of.MOST_NOTES):
        note = _note(number)
        if players[note + of.NOTE_KEPT] == 0 or not _sounds(players, note):
            continue
        if not _pedal(players, tables[of.TABLE_MODE], players[note + of.NOTE_CHANNEL]):
            players[note + of.NOTE_KEPT] = 0
            _damp(player, players, table, tables, number, frame, now)


@njit(**COMPILED)
def _glide(
    player: np.ndarray,
    players: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    channel: int,
    seconds: float,
    frame: int,
    now: int,
) -> None:
    """Lets strings follow the wheels of a channel; -1: all, whatever has changed."""
    for number in range(of.MOST_NOTES):
        note = _note(number)
        moved = channel < 0 or _acts_on(tables[of.TABLE_MODE], channel, players[note + of.NOTE_CHANNEL])
        if moved and _sounds(players, note):
            _retune(player, players, table, tables, number, seconds, frame, now)


@njit(**COMPILED)
def _stop(player: np.ndarray, players: np.ndarray, seconds: float, frame: int) -> None:
    """Lets all strings fade out, those too that nobody plays, and forgets their places."""
    for number in range(of.MOST_NOTES):
        note = _note(number)
        if players[note + of.NOTE_STATE] == of.RINGS:
            _release_note(player, players, note, seconds, frame)
            players[note + of.NOTE_HAS_PLACE] = 0
    for each in range(of.CHANNELS):
        _release_keys(players, each)
    _forget_turns(player, players, of.POLY, -1)
    players[of.PLAYER_NEXT_UP] = 0
    players[of.PLAYER_SYMPATHY_STOPS] = _quanta(player, max(seconds, STOP_S)) + 2
    contact.hush(players, _quanta(player, max(seconds, STOP_S)))


@njit(**COMPILED)
def _controller(
    player: np.ndarray,
    players: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    channel: int,
    number: int,
    value: int,
    frame: int,
    now: int,
) -> None:
    mode, own, wheel = tables[of.TABLE_MODE], _channel(channel), tables[of.TABLE_WHEEL]
    turns = 0 <= wheel < of.KNOBS or wheel == of.MUTE
    if number == SUSTAIN:
        players[own + of.CHANNEL_PEDAL] = value >= PEDAL_DOWN
        _damp_unkept(player, players, table, tables, frame, now)
    elif number == SLIDE:
        players[own + of.CHANNEL_SLIDE] = max(value, 0)
    elif number == SOFT:
        player[own + of.CHANNEL_MUTE] = min(max(value, 0), 127) / 127
        _glide(player, players, table, tables, channel, DAMPER_S, frame, now)
    elif number == LEGATO:
        players[own + of.CHANNEL_LEGATO] = value >= PEDAL_DOWN
    elif number == PORTAMENTO:
        players[own + of.CHANNEL_SLIDES] = value >= PEDAL_DOWN
    elif number == HARMONICS:
        players[own + of.CHANNEL_HARMONICS] = value >= PEDAL_DOWN
    elif number == TREMOLO:
        players[own + of.CHANNEL_TREMOLO] = value >= PEDAL_DOWN
    elif number == STRUM:
        players[own + of.CHANNEL_STRUMS] = value >= PEDAL_DOWN
    elif number == SLIDE_TIME:
        players[own + of.CHANNEL_TIME] = min(max(value, 0), 127)
    elif number == MOD_WHEEL:
        players[of.PLAYER_WHEEL] = value
        players[of.PLAYER_WHEEL_BY] = channel
        if turns:
            _glide(player, players, table, tables, -1, KNOB_S, frame, now)
    elif number == SOUND_OFF:
        _stop(player, players, STOP_S, frame)
    elif number == NOTES_OFF:
        for each in range(of.CHANNELS):
            if _is_master(mode, channel, each):
                _release_keys(players, each)
        _forget_turns(player, players, mode, channel)
        for each in range(of.MOST_NOTES):
            note = _note(each)
            if _is_master(mode, channel, players[note + of.NOTE_CHANNEL]) and _sounds(players, note):
                players[note + of.NOTE_HELD] = 0
                players[note + of.NOTE_KEPT] = 0
                _damp(player, players, table, tables, each, frame, now)
    elif number == RESET:
        for each in range(of.CHANNELS):
            if _is_master(mode, channel, each):
                _rest(player, players, each, 0, 0)
                player[_channel(each) + of.CHANNEL_MUTE] = 0.0
                for switch in SWITCHES:
                    players[_channel(each) + switch] = 0
        if _is_master(mode, channel, players[of.PLAYER_WHEEL_BY]):
            players[of.PLAYER_WHEEL] = 0
        _damp_unkept(player, players, table, tables, frame, now)
        _glide(player, players, table, tables, channel, BEND_S, frame, now)
        if turns:
            _glide(player, players, table, tables, -1, KNOB_S, frame, now)
    elif _set_range(player, players, own, number, value):
        _glide(player, players, table, tables, channel, BEND_S, frame, now)


@njit(**COMPILED)
def _take_table(player: np.ndarray, players: np.ndarray, address: int, frame: int, now: int) -> None:
    """Plays another instrument, or the same with a knob turned; strings that ring glide to it.

    Another instrument begins with its wheels at rest, for what they turned may be something else now; pedals stay.
    """
    table, tables, before = reals(address), wholes(address), players[of.PLAYER_TABLE]
    for which in range(of.VALUES):
        player[of.PLAYER_VALUES + which] = table[of.TABLE_VALUES + which]
    players[of.PLAYER_TABLE] = address
    _forget_gains(player)
    if before != 0 and wholes(before)[of.TABLE_INSTRUMENT] != tables[of.TABLE_INSTRUMENT]:
        players[of.PLAYER_WHEEL] = 0
        for each in range(of.CHANNELS):
            own = _channel(each)
            _rest(player, players, each, players[own + of.CHANNEL_PEDAL], players[own + of.CHANNEL_PLAYS])
    _glide(player, players, table, tables, -1, KNOB_S, frame, now)
    fence()
    players[of.PLAYER_SERIAL] = tables[of.TABLE_SERIAL]  # those before may be freed from here on


@njit(**COMPILED)
def _cancel(player: np.ndarray, players: np.ndarray, id: int, now: int) -> None:
    """Forgets the events whose frames are to come; but a table counts at once, for later events go by it.

    Args:
        id: of a note, of which alone events are forgotten; 0: all are.
    """
    kept = 0
    for place in range(players[of.PLAYER_QUEUED]):
        event = of.PLAYER_QUEUE + place * of.EVENT_SLOTS
        if id != 0 and players[event + of.EVENT_ID] != id:
            for each in range(of.EVENT_SLOTS):
                players[of.PLAYER_QUEUE + kept * of.EVENT_SLOTS + each] = players[event + each]
            kept += 1
        elif players[event + of.EVENT_KIND] == of.NOTE_ON:
            _refuse(player, players, event)
        elif players[event + of.EVENT_KIND] == of.TABLE:
            _take_table(player, players, players[event + of.EVENT_TABLE], 0, now)
    players[of.PLAYER_QUEUED] = kept


# Events


@njit(**COMPILED)
def _handle(player: np.ndarray, players: np.ndarray, mixers: np.ndarray, event: int) -> None:
    """Plays an event now. Those of a player without a table do nothing, except for a note, which is refused."""
    kind, frame, now = players[event + of.EVENT_KIND], players[event + of.EVENT_FRAME], mixers[at.M_FRAMES]
    channel, key = players[event + of.EVENT_CHANNEL], players[event + of.EVENT_KEY]
    value, address = player[event + of.EVENT_VALUE], players[of.PLAYER_TABLE]
    if kind == of.TABLE:
        _take_table(player, players, players[event + of.EVENT_TABLE], frame, now)
        return
    if kind == of.CANCEL:
        _cancel(player, players, players[event + of.EVENT_ID], now)
        return
    if kind == of.STOP:
        _stop(player, players, value, frame)
        return
    if kind in (of.CHOKE, of.TUNE) and _waits(players, event, now):
        return
    if kind == of.CHOKE:
        _choke(player, players, event, frame)
        return
    if kind == of.TUNE and address != 0:
        _tune(player, players, reals(address), wholes(address), event, frame, now)
        return
    if not (0 <= channel < of.CHANNELS and 0 <= key < of.KEYS and address != 0):
        if kind == of.NOTE_ON:
            _refuse(player, players, event)
        return
    table, tables = reals(address), wholes(address)
    if kind == of.NOTE_ON and value > 0.0:
        if _strum(player, players, table, tables, event, now):
            return
        if player[event + of.EVENT_POSITION] > 0.0:  # by hand: no key is down
            _strike(player, players, table, tables, mixers, event)
            return
        _hold(players, channel, key, True)
        if tables[of.TABLE_DRUMS] == 0 and _hammer_on(player, players, table, tables, event, frame, now):
            return
        if tables[of.TABLE_DRUMS] != 0:
            number = _free_note(player, players, mixers)
            first = _slots_of_voice(players, number, 0)
            stride = _slots_of_voice(players, number, 1) - first
            gain = drums.strike(player, players, table, tables, event, first, stride)
            if gain == 0.0:
                _refuse(player, players, event)
                return
            _note_on(player, players, table, tables, mixers, event, 0)
            player[_note(number) + of.NOTE_GAIN] = gain
            return
        _strike(player, players, table, tables, mixers, event)
    elif kind in (of.NOTE_ON, of.NOTE_OFF):
        if _waits(players, event, now):
            return
        _hold(players, channel, key, False)
        _note_off(player, players, table, tables, event, frame, now)
    elif kind == of.BEND:
        player[_channel(channel) + of.CHANNEL_BEND] = min(max(value, -1.0), 1.0)
        _glide(player, players, table, tables, channel, BEND_S, frame, now)
    elif kind == of.CONTROLLER:
        _controller(player, players, table, tables, channel, key, int(value), frame, now)
    elif kind == of.PARAMETER and key < of.VALUES:
        player[of.PLAYER_VALUES + key] = value
        if key <= of.CURVE or key >= of.BODY_MIX:
            _forget_gains(player)
        _glide(player, players, table, tables, -1, KNOB_S, frame, now)


@njit(**COMPILED)
def _queue(players: np.ndarray, event: int) -> None:
    """Puts an event behind those of its frame and of earlier ones."""
    place, size = players[of.PLAYER_QUEUED], of.EVENT_SLOTS
    while place > 0:
        before = of.PLAYER_QUEUE + (place - 1) * size
        if players[before + of.EVENT_FRAME] <= players[event + of.EVENT_FRAME]:
            break
        for each in range(size):
            players[before + size + each] = players[before + each]
        place -= 1
    for each in range(size):
        players[of.PLAYER_QUEUE + place * size + each] = players[event + each]
    players[of.PLAYER_QUEUED] += 1


@njit(**COMPILED)
def _tend(player: np.ndarray, players: np.ndarray, now: int) -> None:
    """Reports notes that have ended."""
    for number in range(of.MOST_NOTES):
        if players[_note(number) + of.NOTE_STATE] == of.RINGS and _over(players, _note(number)):
            _forget(player, players, _note(number), now)


@njit(**COMPILED)
def _hear(player: np.ndarray, players: np.ndarray) -> None:
    """Lets notes follow the gains of sources and the listening points."""
    for number in range(of.MOST_NOTES):
        note = _note(number)
        if players[note + of.NOTE_STATE] == of.RINGS and players[note + of.NOTE_DRUM] == 0:
            for source in range(of.MOST_SOURCES):
                address = players[note + of.NOTE_VOICES + source]
                if address != 0:
                    wanted = player[note + of.NOTE_GAIN] * player[of.PLAYER_SOURCE_GAINS + source]
                    reals(address)[at.WANTED_GAIN] = wanted
                    if wholes(address)[at.JAVARI_STEPS] != 0:
                        table, tables = reals(players[of.PLAYER_TABLE]), wholes(players[of.PLAYER_TABLE])
                        gap_um = _value(player, players, table, tables, of.JAVARI_UM)
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


@njit(**COMPILED)
def _superseded(players: np.ndarray, event: int, following: int) -> bool:
    """Whether an event moves a wheel, and the one that follows it at once moves the same: a burst costs one glide."""
    kind, key = players[event + of.EVENT_KIND], players[event + of.EVENT_KEY]
    same = kind == players[following + of.EVENT_KIND] and key == players[following + of.EVENT_KEY]
    if not same or players[event + of.EVENT_CHANNEL] != players[following + of.EVENT_CHANNEL]:
        return False
    return kind == of.BEND or (kind == of.CONTROLLER and key == MOD_WHEEL)


@njit(**COMPILED)
def play(player_address: int, mixer_address: int) -> None:
    """Plays all events that are due in the mixer's next quantum, before it is rendered."""
    player, players, mixers = reals(player_address), wholes(player_address), wholes(mixer_address)
    now, pushed = mixers[at.M_FRAMES], players[of.PLAYER_PUSHED]
    fence()
    _tend(player, players, now)
    while players[of.PLAYER_TAKEN] < pushed:
        taken = players[of.PLAYER_TAKEN]
        event = of.PLAYER_EVENTS + taken % of.EVENTS * of.EVENT_SLOTS
        following = of.PLAYER_EVENTS + (taken + 1) % of.EVENTS * of.EVENT_SLOTS
        at_once = taken + 1 < pushed and players[following + of.EVENT_FRAME] <= now
        if at_once and players[event + of.EVENT_FRAME] <= now and _superseded(players, event, following):
            pass
        elif players[event + of.EVENT_FRAME] <= now or players[event + of.EVENT_KIND] == of.CANCEL:
            _arrange(player, players, now, of.PLAYER_EVENTS, of.EVENTS, taken, pushed)
            _handle(player, players, mixers, event)
        elif players[of.PLAYER_QUEUED] < of.QUEUED:
            _queue(players, event)
        else:
            break
        fence()
        players[of.PLAYER_TAKEN] += 1
    done = 0
    while done < players[of.PLAYER_QUEUED]:
        event = of.PLAYER_QUEUE + done * of.EVENT_SLOTS
        if players[event + of.EVENT_FRAME] >= now + at.QUANTUM:
            break
        done += 1
        following = event + of.EVENT_SLOTS
        frame = players[event + of.EVENT_FRAME]
        together = done < players[of.PLAYER_QUEUED] and players[following + of.EVENT_FRAME] == frame
        if not (together and _superseded(players, event, following)):
            _arrange(player, players, now, of.PLAYER_QUEUE, of.QUEUED, done - 1, players[of.PLAYER_QUEUED])
            _handle(player, players, mixers, event)
    if done > 0:
        players[of.PLAYER_QUEUED] -= done
        for each in range(players[of.PLAYER_QUEUED] * of.EVENT_SLOTS):
            players[of.PLAYER_QUEUE + each] = players[of.PLAYER_QUEUE + done * of.EVENT_SLOTS + each]
    _follow_hands(player, players, mixers, now)
    _hear(player, players)


@njit(**COMPILED)
def begin(player_address: int) -> None:
    """Puts all wheels and pedals of a new player at rest."""
    player, players = reals(player_address), wholes(player_address)
    players[of.PLAYER_HERE] = player_address
    for each in range(of.CHANNELS):
        _rest(player, players, each, 0, 0)
