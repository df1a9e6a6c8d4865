"""The string of a key, as knobs, wheels, hands and damper have changed it."""

from __future__ import annotations

import numpy as np

from engine.kernels import constants as of
from engine.kernels import recorded, strings
from engine.kernels.compiled import kernel
from engine.kernels.memory import address_of, behind, recorded_at
from engine.kernels.playing import channels
from engine.kernels.records import RECORDED, Note, Player, Recorded, Table

RECORDED_SLOTS = RECORDED.itemsize // 8
USUAL_HARMONIC = 2.0  # of its footswitch where the parameter is off: an estimate, as those of other techniques


@kernel
def value_of(player: Player, table: Table, which: int) -> float:
    """The instrument's value of a number, a field of VALUE, as far as the modulation wheel has turned it."""
    value, wheel = player.values[which], player.wheel
    if wheel != 0 and table.wheel == which:
        return value + wheel / 127 * (table.wheel_goal - value)
    return value


@kernel
def mute_of(player: Player, table: Table, channel: int) -> float:
    """The strength of a hand's mute on what was struck on a channel, 0 … 1."""
    share = value_of(player, table, of.VALUE.damping_mute)
    for number in range(of.CHANNELS):
        if channels.acts_on(table.mode, number, channel):
            share = max(share, player.channels[number].mute)
    return share


@kernel
def body_of(player: Player, table: Table) -> tuple[np.ndarray, float]:
    """The curves of the body, and how much of it is heard."""
    return behind(table, table.body, of.BODY_SLOTS), player.values[of.VALUE.body_mix] if table.body != 0 else 0.0


@kernel
def technique_of(player: Player, table: Table, channel: int, which: int, switch: int, usual: float) -> float:
    """The value of a technique for a channel: the usual one where its footswitch is down and the value is off.

    `which` is a field of VALUE, `switch` the number of the footswitch, HARMONICS … STRUMS.
    """
    value, off = value_of(player, table, which), 1.0 if which == of.VALUE.technique_harmonic else 0.0
    if value <= off and channels.switched(player, table.mode, channel, switch):
        return usual
    return value


@kernel
def node_of(player: Player, table: Table, channel: int, partials: int) -> int:
    """The n of a string that is touched at 1/n of its length as it is plucked; 0: it is not."""
    node = round(technique_of(player, table, channel, of.VALUE.technique_harmonic, of.HARMONICS, USUAL_HARMONIC))
    return node if 1 < node <= partials else 0


@kernel
def string_of(
    player: Player, table: Table, key: int, number: int, pitch_hz: float, wheeled: bool, out: np.ndarray
) -> tuple[int, float]:
    """The string of a key, before bends. Return its partials, 0 where there is none, and its share of the whole.

    Args:
        number: on which of a set it is wanted, as of `strings.played`.
        wheeled: whether with the knob that the modulation wheel turns, as far as it does.
    """
    whole = player.whole
    knobs = player.knobs
    count = table.strings
    for which in range(of.KNOBS):
        knobs[which] = value_of(player, table, which) if wheeled else player.values[which]
    first = table.open[strings.played(table.open, count, key, number) if count > 0 else 0]
    slackened = pitch_hz / first.pitch_hz if count > 0 and key < first.note else 1.0
    if not strings.stop(first.string, knobs, slackened, pitch_hz, whole, out):
        return 0, 1.0
    modes = min(strings.modes_below(out, of.HIGHEST_HZ), player.modes - of.MOST_PAIRS)
    return modes, out[of.LENGTH] / whole[of.LENGTH]


@kernel
def has_octave(table: Table, key: int, number: int) -> bool:
    """Return True if a key's course has octave strings, on a string of a set or, -1, the one that the key chooses."""
    count, octaves = table.strings, table.octaves
    return octaves > 0 and (number if number >= 0 else strings.chosen(table.open, count, key)) >= count - octaves


@kernel
def _recorded(table: Table) -> Recorded:
    return recorded_at(address_of(table) + 8 * table.recorded)


@kernel
def modes_of(table: Table, partials: int) -> int:
    """The number of modes of so many partials of a recorded string."""
    return min(2 * partials, _recorded(table).modes)


@kernel
def additions(table: Table) -> recorded.Additions:
    """The additions of a recording to a string's law, of a table that has them."""
    recorded_rows = _recorded(table)
    points, partials = recorded_rows.smooth, recorded_rows.partials
    rows = behind(recorded_rows, RECORDED_SLOTS + 2 * points, 5 * partials).reshape((5, partials))
    smooth = behind(recorded_rows, RECORDED_SLOTS, points), behind(recorded_rows, RECORDED_SLOTS + points, points)
    return recorded_rows.pitch_hz, recorded_rows.rest, smooth[0], smooth[1], rows


@kernel
def pitch_of(table: Table, key: int) -> float:
    """The pitch of a key in Hz; 0: it is silent."""
    if not table.low <= key <= table.high:
        return 0.0
    return table.pitches_hz[key]


@kernel
def string_now(player: Player, table: Table, note: Note, out: np.ndarray) -> None:
    """Write the string of a note with the present knobs, wheels and damper; where there is none, it stays."""
    pitch_hz, fits = pitch_of(table, note.key), True
    if pitch_hz > 0.0:
        wheeled = player.wheel != 0 and 0 <= table.wheel < of.KNOBS
        modes, _ = string_of(player, table, note.key, note.string, pitch_hz, wheeled, out)
        if note.octave != 0:
            strings.thin(out, pitch_hz)
        fits = modes > 0 and (wheeled or not strings.overdamped(out, modes))
    else:
        out[:] = note.own
    semitones = channels.semitones(player, table.mode, note.channel)
    semitones += note.tuned + note.apart + note.vibrato
    ratio = 2.0 ** (semitones / 12)
    if fits and ratio != 1.0:
        if table.bend_by == of.BY_LENGTH:
            out[of.LENGTH] = strings.slid(out, ratio)
        else:
            out[of.TENSION] = strings.bent(out, ratio)
        fits = strings.possible(out)
    if fits and note.damped != 0:
        out[of.D1] = strings.damped(out, value_of(player, table, of.VALUE.damping_release_t60_s))
        fits = strings.possible(out)
    if not fits:
        out[:] = note.string_now
