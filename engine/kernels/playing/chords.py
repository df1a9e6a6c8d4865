"""Events that wait for their frames, and strums: notes within some milliseconds are one chord.

Its first note begins at once, the others wait their turns in the queue: a note's turn is its number in the chord's
order, which sets its frame. An event that waits has the number of its chord as `chord`, else 0.
`now` is the first frame of the mixer's next quantum.
"""

from __future__ import annotations

import numpy as np

from engine.kernels import constants as of
from engine.kernels.compiled import kernel
from engine.kernels.memory import copy, table_at
from engine.kernels.playing import channels, keys, notes, slots
from engine.kernels.records import Event, Player, Table

CHORD_S = 0.03  # in which notes come that are one chord: an estimate
USUAL_STRUM_MS = 12.0  # of its footswitch


@kernel
def _height(player: Player, table: Table, event: Event) -> int:
    """A number that rises from the lowest note of a chord to the highest: by strings where given, else by keys."""
    place = channels.place_of(player, table, event)
    string = of.CHANNELS + 1 - place // 256 if place % 256 == 0 else 0  # a multiple of 256: its string is given
    return string * of.KEYS + event.key


@kernel
def _strums_in(player: Player, table: Table, event: Event) -> int:
    """The frames from string to string of the chord of an event's note; 0: notes begin as they come."""
    strikes = event.kind == of.NOTE_ON and event.value > 0.0 and event.position <= 0.0
    if not strikes or not 0 <= event.channel < of.CHANNELS or table.drums != 0:
        return 0
    milliseconds = keys.technique_of(
        player, table, event.channel, of.VALUE.technique_strum_ms, of.STRUMS, USUAL_STRUM_MS
    )
    return slots.frames(player, milliseconds / 1000) if milliseconds > 0.0 else 0


@kernel
def _continues(player: Player, frame: int) -> bool:
    """Return True if a note that comes at a frame belongs to the latest chord."""
    since = frame - player.chord_began
    return player.chord != 0 and 0 <= since <= slots.frames(player, CHORD_S)


@kernel
def _goes_up(player: Player, table: Table) -> bool:
    """Return True if the next strum goes from the highest note to the lowest."""
    strokes = round(keys.value_of(player, table, of.VALUE.technique_strokes))
    return strokes == of.UP or (strokes == of.ALTERNATE and player.next_up != 0)


@kernel
def _swap(player: Player, first: Event, second: Event) -> None:
    """Exchange two events; each place keeps its frame."""
    copy(player.kept_event, first)
    copy(first, second)
    copy(second, player.kept_event)
    first.frame, second.frame = second.frame, first.frame


@kernel
def arrange(player: Player, now: int, ring: np.ndarray, place: int, end: int) -> None:
    """Let the first string of a chord come first, of notes that come at the same frame.

    Of the ring's events, `place` is played next, and `end` is the last one's successor.
    """
    event = ring[place % len(ring)]
    if player.table == 0 or event.chord != 0:
        return
    table, frame = table_at(player.table), max(event.frame, now)
    if _strums_in(player, table, event) == 0 or _continues(player, frame):
        return
    up, best = _goes_up(player, table), event
    for later in range(place + 1, end):
        other = ring[later % len(ring)]
        together = max(other.frame, now) == frame and other.chord == 0
        if not together or _strums_in(player, table, other) == 0:
            break
        if (_height(player, table, other) > _height(player, table, best)) == up:
            best = other
    _swap(player, event, best)


@kernel
def strum(player: Player, table: Table, event: Event, now: int) -> bool:
    """Let a note wait for its turn in a chord, in the queue; return False if it begins now.

    Its event is changed: while it waits `frame` is that of its turn, and `came` that at which it came.
    """
    chord = player.chord
    if event.chord != 0:  # its turn has come
        player.chord_begun += event.chord == chord
        event.chord = 0
        return False
    step, frame = _strums_in(player, table, event), max(event.frame, now)
    if step == 0:
        return False
    if not _continues(player, frame):
        player.chord += 1
        player.chord_began = frame
        player.chord_begun = 1
        player.chord_up = _goes_up(player, table)
        return False
    if player.queued == of.QUEUED:
        return False
    player.next_up = 1 - player.chord_up
    turn = player.chord_begun  # notes of the chord before it, those that have begun and those that wait
    for place in range(player.queued):
        turn += player.queue[place].chord == chord
    event.chord, event.came = chord, frame
    event.frame = max(player.chord_began + turn * step, frame)
    event.struck_s = 0.0  # its latency is meant
    queue(player, event)
    event.chord = 0
    later, up = -1, player.chord_up != 0
    for place in range(player.queued - 1, -1, -1):  # from the new one, which is the last, to its turn
        waiting = player.queue[place]
        if waiting.chord != chord:
            continue
        if later >= 0:
            if (_height(player, table, waiting) < _height(player, table, player.queue[later])) != up:
                break
            _swap(player, waiting, player.queue[later])
        later = place
    return True


@kernel
def waits(player: Player, event: Event, now: int) -> bool:
    """Put an event for a note that waits for its turn in a chord behind that note; return True if there is one.

    Its frame is as much later as the note's is.
    """
    by_id = event.id != 0 and event.kind in (of.TUNE, of.CHOKE)
    for place in range(player.queued):
        waiting = player.queue[place]
        meant = waiting.channel == event.channel and waiting.key == event.key
        meant = meant and event.string in (0, waiting.string)
        if by_id:
            meant = waiting.id == event.id
        if waiting.chord != 0 and meant and player.queued < of.QUEUED:
            event.frame = max(event.frame, now) + waiting.frame - waiting.came
            queue(player, event)
            return True
    return False


@kernel
def forget_turns(player: Player, mode: int, channel: int) -> None:
    """Forget notes that wait for their turns in a chord: those of a channel, or all, -1."""
    for place in range(player.queued):
        event = player.queue[place]
        if event.chord != 0 and (channel < 0 or channels.is_master(mode, channel, event.channel)):
            notes.refuse(player, event)
            event.chord = 0
            event.kind = of.NOTHING


@kernel
def queue(player: Player, event: Event) -> None:
    """Copy an event into the queue, which is sorted by frames, behind those of its frame; there must be room."""
    place = player.queued
    while place > 0 and player.queue[place - 1].frame > event.frame:
        copy(player.queue[place], player.queue[place - 1])
        place -= 1
    copy(player.queue[place], event)
    player.queued += 1
