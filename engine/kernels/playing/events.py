"""Events become voices, and change those that ring: the control logic of playing, without Python or allocation.

Events wait in a ring until the mixer's next quantum, and in a queue until the quantum of their frame. A note begins
at its very frame; all else counts within a quantum after it. The parts are in this folder, each of which uses those
before it: slots, channels, keys, plucks, voices, gains, changes, notes, hands, chords, controllers, events.
"""

from __future__ import annotations

from engine.kernels import constants as of
from engine.kernels import midi
from engine.kernels.compiled import kernel
from engine.kernels.memory import copy, fence, mixer_at, player_at, table_at
from engine.kernels.mixer_records import Mixer
from engine.kernels.playing import changes, channels, chords, controllers, gains, hands, notes, voices
from engine.kernels.records import Event, Player, Table


@kernel
def _take_table(player: Player, address: int, frame: int, now: int) -> None:
    """Play another instrument, or the same with a knob turned; strings that ring glide to it.

    Another instrument begins with its wheels at rest, for what they turned may be something else now; pedals stay.
    """
    table, before = table_at(address), player.table
    player.values = table.values
    player.table = address
    gains.forget_gains(player)
    if before != 0 and table_at(before).instrument != table.instrument:
        player.wheel = 0
        for channel in range(of.CHANNELS):
            channels.rest(player, channel)
    changes.glide(player, table, -1, controllers.KNOB_S, frame, now)
    fence()
    player.serial = table.serial  # those before may be freed from here on


@kernel
def _cancel(player: Player, id: int, now: int) -> None:
    """Forget the events whose frames are to come, refusing their notes; but a table counts at once.

    Args:
        id: of a note, of which alone events are forgotten; 0: all are.
    """
    kept = 0
    for place in range(player.queued):
        event = player.queue[place]
        if id != 0 and event.id != id:
            copy(player.queue[kept], event)
            kept += 1
        elif event.kind == of.NOTE_ON:
            notes.refuse(player, event)
        elif event.kind == of.TABLE:
            _take_table(player, event.table, 0, now)
    player.queued = kept


@kernel
def _handle(player: Player, mixer: Mixer, event: Event) -> None:
    """Play an event now. Those of a player without a table do nothing, except for a note, which is refused."""
    kind = event.kind
    frame = event.frame
    now = mixer.frames
    if kind == of.TABLE:
        _take_table(player, event.table, frame, now)
    elif kind == of.CANCEL:
        _cancel(player, event.id, now)
    elif kind == of.STOP:
        controllers.stop(player, event.value, frame)
    elif kind in (of.CHOKE, of.TUNE):
        if chords.waits(player, event, now):
            return
        if kind == of.CHOKE:
            hands.choke(player, event, frame)
        elif player.table != 0:
            hands.tune(player, table_at(player.table), event, frame, now)
    elif player.table != 0 and 0 <= event.channel < of.CHANNELS and 0 <= event.key < of.KEYS:
        _handle_on_channel(player, table_at(player.table), mixer, event)
    elif kind == of.NOTE_ON:
        notes.refuse(player, event)


@kernel
def _handle_on_channel(player: Player, table: Table, mixer: Mixer, event: Event) -> None:
    """Play an event of one of the channels."""
    kind = event.kind
    frame = event.frame
    now = mixer.frames
    channel = event.channel
    key = event.key
    value = event.value
    if kind == of.NOTE_ON and value > 0.0:
        if chords.strum(player, table, event, now):
            return
        if event.position <= 0.0:  # else by hand: no key is down
            player.channels[channel].held[key] = 1
            player.channels[channel].strokes[key] += event.string == 0
            if table.drums == 0 and hands.hammer_on(player, table, event, frame, now):
                return
        notes.strike(player, table, mixer, event)
    elif kind in (of.NOTE_ON, of.NOTE_OFF):
        if chords.waits(player, event, now):
            return
        if event.string == 0 and not channels.release_latest(player, channel, key):
            return
        player.channels[channel].held[key] = 0
        hands.note_off(player, table, event, frame, now)
    elif kind == of.BEND:
        player.channels[channel].bend = min(max(value, -1.0), 1.0)
        changes.glide(player, table, channel, hands.BEND_S, frame, now)
    elif kind == of.CONTROLLER:
        controllers.controller(player, table, channel, key, int(value), frame, now)
    elif kind == of.PARAMETER and key < of.VALUES:
        player.values[key] = value
        if key < of.LOUD or key >= of.VALUE.body_mix:
            gains.forget_gains(player)
        changes.glide(player, table, -1, controllers.KNOB_S, frame, now)


@kernel
def _superseded(event: Event, following: Event) -> bool:
    """Return True if an event and the next move the same wheel: a burst costs one glide."""
    same = event.kind == following.kind and event.key == following.key and event.channel == following.channel
    return same and (event.kind == of.BEND or (event.kind == of.CONTROLLER and event.key == midi.MOD_WHEEL))


@kernel
def play(player_address: int, mixer_address: int) -> None:
    """Play all events that are due in the mixer's next quantum, before it is rendered.

    New ones come from the ring `player.events`; those of later quanta wait in `player.queue`.
    """
    player, mixer = player_at(player_address), mixer_at(mixer_address)
    now, pushed = mixer.frames, player.pushed
    fence()
    notes.tend(player, now)
    while player.taken < pushed:
        taken = player.taken
        event, following = player.events[taken % of.EVENTS], player.events[(taken + 1) % of.EVENTS]
        # Whether the next event counts at once too
        at_once = taken + 1 < pushed and following.frame <= now
        if at_once and event.frame <= now and _superseded(event, following):
            pass
        elif event.frame <= now or event.kind == of.CANCEL:
            chords.arrange(player, now, player.events, taken, pushed)
            _handle(player, mixer, event)
        elif player.queued < of.QUEUED:
            chords.queue(player, event)
        else:
            break
        fence()
        player.taken += 1
    done = 0
    while done < player.queued:
        event = player.queue[done]
        if event.frame >= now + of.QUANTUM:
            break
        done += 1
        together = done < player.queued and player.queue[done].frame == event.frame
        if not (together and _superseded(event, player.queue[done])):
            chords.arrange(player, now, player.queue, done - 1, player.queued)
            _handle(player, mixer, event)
    if done > 0:
        player.queued -= done
        for place in range(player.queued):
            copy(player.queue[place], player.queue[done + place])
    hands.follow_hands(player, mixer, now)
    voices.hear(player)


@kernel
def begin(player_address: int) -> None:
    """Put all wheels and pedals of a new player at rest, and number its notes."""
    player = player_at(player_address)
    player.here = player_address
    for number in range(of.MOST_NOTES):
        player.notes[number].number = number
    for channel in range(of.CHANNELS):
        channels.begin(player, channel)
