"""The effects of MIDI controllers."""

from __future__ import annotations

from engine.kernels import constants as of
from engine.kernels import midi
from engine.kernels.compiled import kernel
from engine.kernels.playing import changes, channels, chords, hands, slots, voices
from engine.kernels.records import Player, Table

KNOB_S = 0.04  # of the glide to other modes


@kernel
def stop(player: Player, seconds: float, frame: int) -> None:
    """Let all notes and noises fade out, touch the strings that nobody plays, release all keys, and forget chords.

    `frame`: the mixer's frame from which notes fade; 0: at once.
    """
    for note in player.notes:
        if note.state == of.RINGS:
            voices.release_note(player, note, seconds, frame)
            note.has_place = 0
    for channel in range(of.CHANNELS):
        channels.release_keys(player, channel)
    chords.forget_turns(player, of.POLY, -1)
    player.next_up = 0
    quanta = slots.quanta(player, max(seconds, hands.STOP_S))
    player.sympathy.stops = quanta + 2
    for noise in player.noises:
        noise.stops = quanta


# By the numbers of `constants.PEDAL` and those after it
SWITCHED_BY = (midi.SUSTAIN, midi.LEGATO, midi.PORTAMENTO, midi.HARMONICS, midi.TREMOLO, midi.STRUM)


@kernel
def controller(player: Player, table: Table, channel: int, number: int, value: int, frame: int, now: int) -> None:
    """Follow a MIDI controller on a channel: switches, wheels, volume, and messages that release, stop or reset.

    Args:
        number: of the controller, see `kernels.midi`.
        value: 0 … 127; others are cut.
        frame: the mixer's frame at which it counts; 0: at once.
        now: the first frame of the mixer's next quantum.
    """
    mode, state = table.mode, player.channels[channel]
    # Whether the modulation wheel turns a value that changes strings which ring
    turns = 0 <= table.wheel < of.KNOBS or table.wheel == of.VALUE.damping_mute
    value = min(max(value, 0), 127)
    for switch in range(of.SWITCHES):
        if number == SWITCHED_BY[switch]:
            state.switches[switch] = value >= midi.PEDAL_DOWN
    if number == midi.SUSTAIN:
        changes.damp_unkept(player, table, frame, now)
    elif number == midi.SLIDE:
        state.slide = value
    elif number == midi.SOFT:
        state.mute = value / 127
        changes.glide(player, table, channel, changes.DAMPER_S, frame, now)
    elif number == midi.SLIDE_TIME:
        state.slide_time = value
    elif number == midi.MOD_WHEEL:
        player.wheel = value
        player.wheel_by = channel
        if turns:
            changes.glide(player, table, -1, KNOB_S, frame, now)
    elif number == midi.VOLUME:
        state.volume = value
    elif number == midi.EXPRESSION:
        state.expression = value
    elif number == midi.SOUND_OFF:
        stop(player, hands.STOP_S, frame)
    elif midi.NOTES_OFF <= number <= midi.LAST_MODE:
        for other in range(of.CHANNELS):
            if channels.is_master(mode, channel, other):
                channels.release_keys(player, other)
        chords.forget_turns(player, mode, channel)
        for note in player.notes:
            if channels.is_master(mode, channel, note.channel) and slots.sounds(note):
                note.held = 0
                note.kept = 0
                changes.damp(player, table, note, frame, now)
    elif number == midi.RESET:
        for other in range(of.CHANNELS):
            if channels.is_master(mode, channel, other) and value == 0:
                channels.reset(player, other)
            elif channels.is_master(mode, channel, other):  # by this program: MIDI's own has no other value
                channels.begin(player, other)
        if channels.is_master(mode, channel, player.wheel_by):
            player.wheel = 0
        changes.damp_unkept(player, table, frame, now)
        changes.glide(player, table, channel, hands.BEND_S, frame, now)
        if turns:
            changes.glide(player, table, -1, KNOB_S, frame, now)
    elif channels.set_parameter(player, mode, channel, number, value):
        changes.glide(player, table, -1, hands.BEND_S, frame, now)
