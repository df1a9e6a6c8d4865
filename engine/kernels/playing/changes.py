"""Notes that ring follow knobs, wheels and dampers: their voices glide to other modes, all of a note alike.

`frame` is the mixer's frame at which something counts (0: at once), `now` the first frame of its next quantum.
"""

from __future__ import annotations

import math

from engine.kernels import constants as of
from engine.kernels import contact
from engine.kernels import voice_records as at
from engine.kernels.compiled import kernel
from engine.kernels.memory import voice_at
from engine.kernels.modes import rows, wished_rows
from engine.kernels.playing import channels, keys, slots, voices
from engine.kernels.records import Note, Player, Table

DAMPER_S = 0.012  # of the glide to other modes
LANDS = 0.03  # strength of what lands on a string at rest: an estimate


@kernel
def landing(table: Table, note: Note) -> float:
    """The motion of a note's string over that of a reference stroke: the strength of the noise of what lands there.

    A mechanism, whose noise follows nothing, falls alike on every string.
    """
    if table.contacts[of.RELEASE].follows == 0.0:
        return 1.0
    return max(LANDS, voices.swing_m(note) / note.swing_m)


@kernel
def level_of(player: Player, table: Table, note: Note, which: int) -> float:
    """The level of the noise of a note's stroke or release, in dB."""
    loudness = max(channels.loudness(player, table.mode, note.channel), 1e-9)
    return keys.value_of(player, table, which) + 20 * math.log10(loudness)


@kernel
def retune(player: Player, table: Table, note: Note, seconds: float, frame: int, now: int) -> None:
    """Let a note glide, in so many seconds, to its string as knobs, wheels and damper have changed it.

    Nothing happens where they have not changed it, or to a drum.
    """
    string, changed = player.bent, False
    if note.drum != 0:
        return
    keys.string_now(player, table, note, string)
    for place in range(of.STRING):
        changed = changed or string[place] != note.string_now[place]
    note.string_now = player.bent
    mute = keys.mute_of(player, table, note.channel)
    changed = changed or mute != note.mute
    note.mute = mute
    if note.touched != 0 and max(frame, now) >= note.lifted:
        note.touched = 0
        changed = True
    if not changed:
        return
    filled = 0  # address of the first voice's wish, whose rows the others copy
    for source in range(of.MOST_SOURCES):
        if slots.voice_over(note.voices[source]):
            continue
        wish = voices.add_wish(player, note, source, seconds, frame, now)
        target_rows = wished_rows(wish, note.modes)
        if filled == 0:
            voices.fill(player, table, note, string, target_rows)
            filled = wish
        else:
            target_rows[:] = wished_rows(filled, note.modes)


@kernel
def damp(player: Player, table: Table, note: Note, frame: int, now: int) -> None:
    """Put the damper on a note's string or drum, unless key, pedal or instrument let it ring, or it is damped."""
    if note.held + note.kept + note.damped != 0 or table.let_ring != 0:
        return
    note.damped = 1
    if note.drum == 0:
        retune(player, table, note, DAMPER_S, frame, now)
        if note.member != 0:
            return
        level_db = level_of(player, table, note, of.VALUE.noise_release_db)
        stroke, strength = note.age if table.variation > 0.0 else 0, landing(table, note)
        by = contact.Touch(of.RELEASE, level_db, strength, 1.0, stroke, note.key, frame, 0.0, 0.0)
        contact.touch(player, table, by)
        return
    t60_s = keys.value_of(player, table, of.VALUE.damping_release_t60_s)
    for source in range(of.MOST_SOURCES):
        if slots.voice_over(note.voices[source]):
            continue
        voice = voice_at(note.voices[source])
        target_rows = wished_rows(voices.add_wish(player, note, source, DAMPER_S, frame, now), voice.modes)
        target_rows[:] = rows(voice, at.OMEGA_SQUARED, at.RESONATOR_ROWS)
        for place in range(voice.modes, 2 * voice.modes):  # σ
            target_rows[place] += math.log(1000.0) / t60_s


@kernel
def damp_unkept(player: Player, table: Table, frame: int, now: int) -> None:
    """Put the damper on strings that a pedal kept, and keep no longer."""
    for note in player.notes:
        if note.kept == 0 or not slots.sounds(note):
            continue
        if not channels.switched(player, table.mode, note.channel, of.PEDAL):
            note.kept = 0
            damp(player, table, note, frame, now)


@kernel
def glide(player: Player, table: Table, channel: int, seconds: float, frame: int, now: int) -> None:
    """Let strings glide, in so many seconds, to where the wheels of a channel have them; channel -1: all strings."""
    for note in player.notes:
        moved = channel < 0 or channels.acts_on(table.mode, channel, note.channel)
        if moved and slots.sounds(note):
            retune(player, table, note, seconds, frame, now)
