"""Hands on strings that ring: hammer-on, pull-off, slide, release, vibrato, tremolo and harmonics.

With the legato footswitch down, a key moves the note of a key that is held on its channel: it shortens the same
string without a pluck (hammer-on), or slides there where portamento is on. A key that is released gives the note back
to the highest one that is still down (pull-off). A key that is released damps its string, unless the pedal or the
instrument lets it ring.

Harmonics: a finger touches the string at a node as it is plucked, and leaves after some periods. Tremolo: a key that
is held plucks again and again. A footswitch turns each on where its parameter is off.

`frame` is the mixer's frame at which something counts (0: at once), `now` the first frame of its next quantum.
"""

from __future__ import annotations

import math

from engine.kernels import constants as of
from engine.kernels import contact, strings
from engine.kernels.compiled import inlined, kernel
from engine.kernels.memory import clear, table_at
from engine.kernels.mixer_records import Mixer
from engine.kernels.playing import changes, channels, keys, notes, slots, voices
from engine.kernels.records import Event, Note, Player, Table

BEND_S, LIFT_S = 0.006, 0.004  # of the glide to other modes, as a bend or as a finger leaves
STOP_S = 0.03  # of the shortest fade
PLAIN_DB = 12.0  # by how much fingers are quieter on plain strings than on wound ones: an estimate
USUAL_TREMOLO_HZ = 10.0  # of its footswitch
VIBRATO_QUANTA = 8  # of a glide, of which a vibrato is made


@kernel
def _move(player: Player, table: Table, note: Note, key: int, frame: int, now: int) -> bool:
    """Shorten or lengthen the string of a note for another key; False where it cannot play that key."""
    pitch_hz, string = keys.pitch_of(table, key), note.string
    if table.strings > 0 and string < 0:
        string = strings.chosen(table.open, table.strings, note.key)
    if pitch_hz <= 0.0 or (table.strings > 0 and key < table.open[string].note):
        return False
    modes, _ = keys.string_of(player, table, key, string, pitch_hz, False, player.own)
    if modes < 1:
        return False
    if note.place % 256 != 0:  # no string is given: each key is a place
        note.place += key - note.key
        for other in player.notes:
            if other.number != note.number and slots.sounds(other) and other.place == note.place:
                other.has_place = 0
                voices.release_note(player, other, notes.PLUCK_STOPS_S, frame)
    note.string, note.key = string, key
    seconds = channels.moves_in_s(player, table.mode, note.channel)
    if note.member == 0:
        level_db = changes.level_of(player, table, note, of.VALUE.noise_release_db)
        if not strings.is_wound(note.own):
            level_db -= PLAIN_DB
        slid_m = abs(player.own[of.LENGTH] - note.string_now[of.LENGTH])
        slides_s = seconds if seconds > channels.HAMMER_S else 0.0
        stroke = note.age if table.variation > 0.0 else 0
        strength = 1.0 if slides_s > 0.0 else changes.landing(table, note)
        by = contact.Touch(of.RELEASE, level_db, strength, 1.0, stroke, key, frame, slid_m, slides_s)
        contact.touch(player, table, by)
    changes.retune(player, table, note, seconds, frame, now)
    return True


@kernel
def _move_course(player: Player, table: Table, first: Note, key: int, frame: int, now: int) -> bool:
    """Move a note, and the other strings of its course with it; False where it cannot play that key."""
    before = first.key
    if not _move(player, table, first, key, frame, now):
        return False
    for note in player.notes:
        same = note.key == before and note.channel == first.channel and note.id == first.id
        if same and note.member != 0 and slots.sounds(note):
            _move(player, table, note, key, frame, now)
    return True


@kernel
def hammer_on(player: Player, table: Table, event: Event, frame: int, now: int) -> bool:
    """Give a key the latest note that is held on its channel, where legato is on; return True if it has one.

    Where the event gives a string, only a note on that string.
    """
    latest, age = player.notes[0], 0
    place = channels.place_of(player, table, event)
    if not channels.switched(player, table.mode, event.channel, of.LEGATO):
        return False
    for note in player.notes:
        held = note.held != 0 and note.member == 0 and note.channel == event.channel
        held = held and (place % 256 != 0 or note.place == place)
        if held and note.age > age and slots.sounds(note):
            latest, age = note, note.age
    id, before = latest.id, latest.key
    if age == 0 or event.key == before or not _move_course(player, table, latest, event.key, frame, now):
        return False
    notes.report(player, of.ENDED, id, event.channel, before, now, 0.0)
    notes.reported(player)
    for other in player.notes:
        if other.member != 0 and other.id == id:
            other.id = event.id
    latest.id = event.id
    notes.report_began(player, table, event, latest, player.own)
    return True


@kernel
def _pull_off(player: Player, table: Table, note: Note, frame: int, now: int) -> bool:
    """Give the note of a released key to the highest key that is down and has none; return True if there is one."""
    if not channels.switched(player, table.mode, note.channel, of.LEGATO):
        return False
    for key in range(of.KEYS - 1, -1, -1):
        free = player.channels[note.channel].held[key] != 0
        for other in player.notes:
            same = other.key == key and other.channel == note.channel and other.member == 0
            free = free and not (same and other.held != 0 and slots.sounds(other))
        if free and _move_course(player, table, note, key, frame, now):
            return True
    return False


@kernel
def note_off(player: Player, table: Table, event: Event, frame: int, now: int) -> None:
    """Damp the strings of a released key, or give them to another that is down."""
    place = channels.place_of(player, table, event)
    for turn in range(2 * of.MOST_NOTES):  # first strings of courses first, which the others follow
        note = player.notes[turn % of.MOST_NOTES]
        same = note.key == event.key and note.channel == event.channel
        same = same and (note.member == 0) == (turn < of.MOST_NOTES)
        same = same and (event.string == 0 or note.place % notes.MEMBERS_APART == place)
        if same and note.held != 0 and slots.sounds(note):
            if note.member == 0 and _pull_off(player, table, note, frame, now):
                continue
            note.held = 0
            note.kept = channels.switched(player, table.mode, note.channel, of.PEDAL)
            changes.damp(player, table, note, frame, now)


@kernel
def _is_meant(event: Event, note: Note) -> bool:
    """Return True if an event is for a note. Its number, channel and key count as far as they are given."""
    if note.state != of.RINGS or event.id not in (0, note.id):
        return False
    return event.channel in (of.ANY, note.channel) and event.key in (of.ANY, note.key)


@kernel
def tune(player: Player, table: Table, event: Event, frame: int, now: int) -> None:
    """Bend the notes that an event is for by its value, in semitones."""
    semitones = min(max(event.value, -channels.WIDEST_SEMITONES), channels.WIDEST_SEMITONES)
    for note in player.notes:
        if _is_meant(event, note) and slots.sounds(note):
            note.tuned = semitones
            changes.retune(player, table, note, BEND_S, frame, now)


@kernel
def choke(player: Player, event: Event, frame: int) -> None:
    """Let single notes fade out fast, though their instrument lets them ring; no release of their keys follows."""
    seconds = event.value if event.value > 0.0 else STOP_S
    for note in player.notes:
        if _is_meant(event, note):
            if note.has_place != 0:
                channels.release_key(player, note.channel, note.key)
            voices.release_note(player, note, seconds, frame)
            note.has_place = 0
    if event.id != 0 and event.key == of.ANY:
        return
    for held in range(of.CHANNELS * of.KEYS):  # whose notes may have ended
        if event.channel in (of.ANY, held // of.KEYS) and event.key in (of.ANY, held % of.KEYS):
            channels.release_key(player, held // of.KEYS, held % of.KEYS)


@kernel
def _vibrate(player: Player, table: Table, note: Note, now: int) -> None:
    """Let a note glide to where its vibrato is some quanta later; all strings of a course alike."""
    depth = keys.value_of(player, table, of.VALUE.technique_vibrato_cents) / 100
    if depth == 0.0 and note.vibrato == 0.0:
        return
    ahead = now + VIBRATO_QUANTA * of.QUANTUM - note.began
    hz = keys.value_of(player, table, of.VALUE.technique_vibrato_hz)
    note.vibrato = depth * math.sin(2 * math.pi * hz * max(ahead, 0) / player.rate_hz)
    seconds = VIBRATO_QUANTA * of.QUANTUM / player.rate_hz
    changes.retune(player, table, note, seconds, 0, now)


@inlined
def follow_hands(player: Player, mixer: Mixer, now: int) -> None:
    """Lift fingers from strings that they touch, and pluck again what a tremolo plucks, in the next quantum."""
    if player.table == 0 or table_at(player.table).drums != 0:
        return
    table, end = table_at(player.table), now + of.QUANTUM
    for note in player.notes:
        if note.state != of.RINGS:
            continue
        if note.touched != 0 and note.lifted < end:
            changes.retune(player, table, note, LIFT_S, note.lifted, now)
        if (now - note.began) // of.QUANTUM % VIBRATO_QUANTA == 0:
            _vibrate(player, table, note, now)
        again = note.held != 0 and note.released == 0 and note.member == 0 and note.by_hand == 0
        if not again or not slots.sounds(note):
            continue
        hz = keys.technique_of(
            player, table, note.channel, of.VALUE.technique_tremolo_hz, of.TREMOLO, USUAL_TREMOLO_HZ
        )
        due = note.began + slots.frames(player, 1 / hz) if hz > 0.0 else end
        if due < end:
            _pluck_again(player, table, mixer, note, max(due, now))


@inlined
def _pluck_again(player: Player, table: Table, mixer: Mixer, note: Note, frame: int) -> None:
    """Pluck the string of a note again: another note with its number, which ends without a report of its own."""
    event = player.again
    clear(event)
    event.frame, event.kind = frame, of.NOTE_ON
    event.channel = note.channel
    event.key = note.key
    event.id = note.id
    if note.place % 256 == 0:
        event.string = note.place // 256
    event.value = note.velocity
    note.id, note.began = 0, frame
    tuned, before = note.tuned, player.age
    notes.strike(player, table, mixer, event)
    for made in player.notes:
        if tuned != 0.0 and made.state == of.RINGS and made.age > before:
            made.tuned = tuned
            changes.retune(player, table, made, 0.0, 0, mixer.frames)
