"""Notes: begun with their voices, reported, stopped by what has their place next, stolen, and ended.

Strings are known by their places: a key, or a channel of a guitar, which is one string. What plucks a place again
stops its string first, or, where the instrument says so, adds to its motion.

A note has one voice of each source, a model or a solver of the table; its voices are addresses, 0 for none. Strings
of a course are notes of their own: their `member` is 0 for the first, which alone is reported. A *draft* is a note
that is not yet among the player's.
"""

from __future__ import annotations

import math

import numpy as np

from engine.bounds import LARGEST_AMPLITUDE_MM
from engine.kernels import constants as of
from engine.kernels import contact, drums, strings, velocities
from engine.kernels import voice_records as at
from engine.kernels.compiled import kernel
from engine.kernels.memory import clear, copy, fence, voice_at
from engine.kernels.mixer_records import MOST_VOICES, Mixer
from engine.kernels.playing import changes, channels, gains, keys, plucks, slots, voices
from engine.kernels.records import Event, Note, Player, Report, Table

MPE_POSITIONS = (0.05, 0.5)  # pluck positions for slide 0 and 127 before the key
STOLEN_S = 0.03  # of the fade of a note that makes room
PLUCK_STOPS_S = 0.006  # in which a string is stopped by what plucks it again

# Estimates. A touch lasts long enough for the fifth harmonic: its lowest neighbour then falls by 72 dB
TOUCH_PERIODS = 12.0  # of the string
HARMONIC_REACH = 0.4  # of the way to the first node, where harmonics are plucked at the farthest

VARIES_RELEASE, VARIES_ANGLE = 0.2, math.radians(8.0)  # a share, rad: at most, as those of `plucks.vary`

MEMBERS_APART = 1 << 16  # from the place of one string of a course to that of the next
COURSES_VARY = 0.5  # by how much detuning varies from key to key, at most


@kernel
def report(player: Player, kind: int, id: int, channel: int, key: int, frame: int, velocity: float) -> Report:
    """The player's next report, BEGAN, ENDED or REFUSED, for the caller to complete; `reported` publishes it."""
    made = player.reports[player.reported % of.REPORTS]
    made.kind = kind
    made.id = id
    made.channel = channel
    made.key = key
    made.frame = frame
    made.velocity = velocity
    return made


@kernel
def reported(player: Player) -> None:
    """Publish the report that `report` gave."""
    fence()
    player.reported += 1


@kernel
def refuse(player: Player, event: Event) -> None:
    """Report a note that no string can play, or that was cancelled."""
    report(player, of.REFUSED, event.id, event.channel, event.key, event.frame, event.value)
    reported(player)


@kernel
def _forget(player: Player, note: Note, frame: int) -> None:
    """Free a note that has ended, and report its end, unless it is a further string of a course."""
    note.state = of.FREE
    if note.member != 0:
        return
    report(player, of.ENDED, note.id, note.channel, note.key, frame, 0.0)
    reported(player)


@kernel
def _begun(note: Note) -> bool:
    """Return True if any voice of a note has sounded."""
    begun = False
    for address in note.voices:
        begun = begun or (address != 0 and voice_at(address).state != at.WAITING)
    return begun


@kernel
def free_note(player: Player, mixer: Mixer) -> Note:
    """A free one of the player's notes; where there is none, one is cut.

    That is first one that fades or has lost its place and has not begun, then one that has, else the oldest.
    """
    best, best_rank = player.notes[0], 3  # the lowest rank is cut: 0 is unheard, 1 fades, 2 is in its place
    for note in player.notes:
        if note.state != of.FREE and slots.over(note):
            _forget(player, note, mixer.frames)
        if note.state == of.FREE:
            return note
        rank = 2
        if note.released != 0 or note.has_place == 0:
            rank = 1 if _begun(note) else 0
        if rank < best_rank or (rank == best_rank and note.age < best.age):
            best, best_rank = note, rank
    for address in best.voices:
        if address != 0:
            voices.take_out(mixer, address)
    player.cut += 1
    _forget(player, best, mixer.frames)
    return best


@kernel
def _follow(player: Player, table: Table, note: Note, before: Note) -> None:
    """Let a note take over the string of the one before, which is stopped, or whose motion continues in it."""
    stops = slots.frames(player, PLUCK_STOPS_S)
    for source in range(of.MOST_SOURCES):
        address, other = note.voices[source], before.voices[source]
        if slots.voice_over(other):
            continue
        if address == 0:
            voices.release(other, stops)
            continue
        voice_at(address).previous_voice = other
        voice_at(address).stops_in = stops if table.stops != 0 else 0


@kernel
def _cost(note: Note) -> int:
    """The notes that one counts as: two with a string that may meet its bridge, whose steps cost many times more."""
    for address in note.voices:
        if address != 0 and voice_at(address).javari.steps > 0:
            return 2
    return 1


@kernel
def _make_room(player: Player) -> None:
    """Release the oldest notes while more ring than may, by `_cost`; one is always left.

    One that costs more than 1 and has not begun ends at once.
    """
    while True:
        notes = cost = 0
        oldest = player.notes[0]
        for note in player.notes:
            if note.state == of.FREE or note.released != 0 or slots.over(note):
                continue
            if notes == 0 or note.age < oldest.age:
                oldest = note
            notes += 1
            cost += _cost(note)
        if cost <= player.most or notes == 1:
            return
        voices.release_note(player, oldest, STOLEN_S if _begun(oldest) or _cost(oldest) == 1 else 0.0, 0)


@kernel
def strike(player: Player, table: Table, mixer: Mixer, event: Event) -> None:
    """Play all strings of a key's course, one after the other; the first is the one that is reported."""
    note_on(player, table, mixer, event, 0)
    frame = event.frame
    for member in range(1, table.course):
        later = round(member * table.apart_s * player.rate_hz)
        later += voices.lag_of(player, table, member)
        event.frame = max(frame, mixer.frames) + later if later > 0 else frame
        note_on(player, table, mixer, event, member)
    event.frame = frame


@kernel
def note_on(player: Player, table: Table, mixer: Mixer, event: Event, member: int) -> None:
    """Play a note, of a course one string. A string that is impossible is refused, unless another sounds.

    The note is drafted first: one that is refused takes no other's place.
    """
    draft = player.draft
    clear(draft)
    _identify(player, table, event, member, draft)
    if not (drums.take(player, table, draft) if table.drums != 0 else _take_string(player, table, draft)):
        if member == 0:
            refuse(player, event)
        return
    if draft.drum == 0:
        _pluck(player, table, event, draft)
    note = free_note(player, mixer)
    player.age += 1
    draft.number = note.number
    draft.age = player.age
    draft.began = max(event.frame, mixer.frames)
    copy(note, draft)
    _keep_of_table(player, table, note)
    _make_voices(player, table, event, note)
    _take_place(player, table, note)
    _begin_voices(player, mixer, event, note)
    changes.retune(player, table, note, 0.0, 0, mixer.frames)
    if member == 0:
        level_db, begins = changes.level_of(player, table, note, of.VALUE.noise_onset_db), event.frame
        by = contact.Touch(of.STROKE, level_db, note.strength, note.hardness, note.stroke, note.key, begins, 0.0, 0.0)
        contact.touch(player, table, by)
    _make_room(player)
    report_began(player, table, event, note, note.own)


@kernel
def _identify(player: Player, table: Table, event: Event, member: int, note: Note) -> None:
    """Set the note's identity, and the string that it is played on."""
    note.state, note.held = of.RINGS, 1
    note.id = event.id
    note.channel = event.channel
    note.key = event.key
    note.velocity = event.value
    note.frame = event.frame
    note.member = member
    note.by_hand = event.position > 0.0
    player.channels[note.channel].plays = 1
    note.place, note.string = channels.place_of(player, table, event), -1
    if note.place % 256 == 0 and table.strings > 0:
        string = note.place // 256 - 1
        if strings.chosen(table.open, table.strings, note.key) != string:
            note.string = string
    note.place += MEMBERS_APART * member
    note.octave = member > 0 and keys.has_octave(table, note.key, note.string)


@kernel
def _take_string(player: Player, table: Table, note: Note) -> bool:
    """Set a note's own string, its number of modes and its gain, by its key; return False if it is impossible."""
    pitch_hz, string_row = keys.pitch_of(table, note.key), note.own
    if not pitch_hz > 0.0:
        return False
    modes, shortened = keys.string_of(player, table, note.key, note.string, pitch_hz, False, string_row)
    note.modes, note.shortened = modes, shortened
    if note.octave != 0 and modes > 0:
        strings.thin(string_row, pitch_hz)
        note.modes = min(modes, strings.modes_below(string_row, of.HIGHEST_HZ)) if strings.possible(string_row) else 0
    if note.modes < 1 or strings.overdamped(string_row, note.modes):
        return False
    note.gain = gains.gain_of(player, table, note.key, note.string)
    note.swing_m = player.swings_m[note.key, 1 + note.string]
    return True


@kernel
def _pluck(player: Player, table: Table, event: Event, note: Note) -> None:
    """Set a note's pluck, by its velocity or by hand; write the amplitudes of its modes to `player.amplitudes`."""
    curve = keys.value_of(player, table, of.VALUE.pluck_curve)
    soft = keys.value_of(player, table, of.VALUE.pluck_softest_mm)
    share = velocities.share(note.velocity, curve)  # of the way from the softest stroke to the hardest, 0 … 1
    harder = keys.value_of(player, table, of.VALUE.pluck_hardest_mm) / soft
    amplitude_mm = min(soft * harder**share * note.shortened, LARGEST_AMPLITUDE_MM)
    if note.by_hand != 0:
        amplitude_mm = min(event.amplitude_mm, LARGEST_AMPLITUDE_MM)
        if harder != 1.0:
            share = min(max(math.log(amplitude_mm / soft / note.shortened) / math.log(harder), 0.0), 1.0)
    note.strength = harder ** (share - velocities.share(of.REFERENCE_VELOCITY, curve))
    note.hardness = 1.0
    narrowest = keys.value_of(player, table, of.VALUE.pluck_width_hard)
    width = velocities.between(keys.value_of(player, table, of.VALUE.pluck_width), narrowest, share)
    position, slide = keys.value_of(player, table, of.VALUE.pluck_position), player.channels[note.channel].slide
    if note.by_hand != 0:
        position, width = event.position, event.width
    elif table.mode == of.MPE and slide >= 0:
        position = MPE_POSITIONS[0] + (MPE_POSITIONS[1] - MPE_POSITIONS[0]) * slide / 127
    turned, varies = 0.0, table.variation  # rad from the instrument's angle of plucks; 0 … 1
    softest_ms = keys.value_of(player, table, of.VALUE.pluck_release_ms)
    release_s = velocities.contact_s(softest_ms, keys.value_of(player, table, of.VALUE.pluck_release_hard_ms), share)
    if varies > 0.0:
        note.stroke = player.age
        if note.by_hand == 0:
            position, amplitude_mm, width = plucks.vary(position, amplitude_mm, width, varies, note.stroke, note.key)
        release_s *= 1 + varies * VARIES_RELEASE * plucks.varied(note.stroke, note.key, 3)
        turned = varies * VARIES_ANGLE * plucks.varied(note.stroke, note.key, 4)
    note.touched = keys.node_of(player, table, note.channel, note.modes)
    if note.touched > 0 and note.by_hand == 0:
        position = min(position, HARMONIC_REACH / note.touched)
    position, amplitude_mm, width = plucks.nearest(position, amplitude_mm, width)
    note.position = position
    note.amplitude_mm = amplitude_mm
    note.width = width
    shape = event.shape if note.by_hand != 0 else table.shape
    note.highest_m = plucks.pull(player, table, shape, note.modes, position, amplitude_mm / 1000, width)
    plucks.release_pluck(player, table, note.own, note.modes, release_s)
    note.modes, note.pairs = plucks.split(player, table, note.own, note.modes, turned)


@kernel
def _keep_of_table(player: Player, table: Table, note: Note) -> None:
    """Keep in a note what it needs of the table that it was struck by."""
    key, member = note.key, note.member
    note.detuning, note.aperture_m = table.detuning, table.aperture_m
    note.points, note.solo = table.points, table.solo
    note.losses, note.conductance = table.losses, table.conductance
    polarised = note.pairs > 0 and table.recorded == 0
    for slot in range(2):
        note.heard[slot] = table.heard[slot] if polarised else 1.0
        note.point[slot] = player.values[of.VALUE.pickup_points_0 + slot]
    octaves = keys.has_octave(table, key, note.string)
    if note.drum == 0 and not octaves and table.course > 1 and table.conductance[0] > 0.0 and note.pairs > 0:
        note.bridge = table.bridge
    if member > 0:  # above and below the first by turns, each key a little otherwise
        steps = (member + 1) // 2 * (1 if member % 2 == 1 else -1)
        note.apart = steps * (1 + COURSES_VARY * plucks.varied(0, key, member)) * table.apart_cents / 100
    if note.touched > 0:
        note.lifted = note.began + slots.frames(player, TOUCH_PERIODS / strings.pitch_hz(note.own))
    note.mute = keys.mute_of(player, table, note.channel)
    note.string_now = note.own


@kernel
def _make_voices(player: Player, table: Table, event: Event, note: Note) -> None:
    """Make the voices of a note, one of each source, in the player's memory, with their gains."""
    for source in range(table.sources):
        address = slots.address_of_voice(player, note.number, source)
        if note.drum != 0:
            drums.make_voice(player, table, address, event, source)
        else:
            voices.make_voice(player, table, address, note, source)
        begun = note.gain * player.source_gains[source]
        begun *= channels.loudness(player, table.mode, note.channel)
        slots.set_gain(address, begun)
        if note.bridge > 0.0:
            first = player.age - note.member  # of this player, for another may ring as well
            voice_at(address).course = player.here + of.MOST_SOURCES * first + source
        note.voices[source] = address


@kernel
def _take_place(player: Player, table: Table, note: Note) -> None:
    """Make a note the latest of its place, and let it take over the string of the one before."""
    for before in player.notes:
        if before.state == of.RINGS and before.has_place != 0 and before.place == note.place:
            before.has_place = 0
            _follow(player, table, note, before)
    note.has_place = 1


@kernel
def _begin_voices(player: Player, mixer: Mixer, event: Event, note: Note) -> None:
    """Hand the voices of a note to the mixer; those that have no room there, or that nobody hears, are over."""
    for source in range(of.MOST_SOURCES):
        address = note.voices[source]
        if address == 0:
            continue
        voice_at(address).begin_at = event.frame
        voice_at(address).struck_s = event.struck_s
        voice_at(address).of_instrument = 1
        spared = player.spares != 0 and player.source_gains[source] == 0.0
        if mixer.active < MOST_VOICES and not spared:
            mixer.voices[mixer.active] = address
            mixer.active += 1
        else:
            voice_at(address).state = at.OVER


@kernel
def report_began(player: Player, table: Table, event: Event, note: Note, string_row: np.ndarray) -> None:
    """Report that an event's note began, with its pluck and its string; only for the first string of a course."""
    if note.member != 0:
        return
    made = report(player, of.BEGAN, note.id, note.channel, note.key, event.frame, event.value)
    made.string, made.table = note.string, table.serial
    made.modes = note.modes
    made.note = note.number
    made.gain = note.gain
    made.position = note.position
    made.amplitude_mm = note.amplitude_mm
    made.width = note.width
    for place in range(of.STRING):
        made.own[place] = string_row[place]
    reported(player)


@kernel
def tend(player: Player, now: int) -> None:
    """Report notes that have ended."""
    for note in player.notes:
        if note.state == of.RINGS and slots.over(note):
            _forget(player, note, now)
