"""The effects of MIDI controllers."""

from __future__ import annotations

from engine.kernels import constants as of
from engine.kernels import contact, midi
from engine.kernels.compiled import kernel
from engine.kernels.playing import changes, channels, chords, hands, slots, voices
from engine.kernels.records import Player, Table

KNOB_S = 0.04  # of the glide to other modes


@kernel
def stop(player: Player, seconds: float, frame: int) -> None:
    """Let all strings fade out, those too that nobody plays, and forget their places."""
    for number in range(of.MOST_NOTES):
        note = player.notes[number]
        if note.state == of.RINGS:
            voices.release_note(player, note, seconds, frame)
            note.has_place = 0
    for channel in range(of.CHANNELS):
        channels.release_keys(player, channel)
    chords.forget_turns(player, of.POLY, -1)
    player.next_up = 0
    player.sympathy.stops = slots.quanta(player, max(seconds, hands.STOP_S)) + 2
    contact.hush(player, slots.quanta(player, max(seconds, hands.STOP_S)))


@kernel
def controller(player: Player, table: Table, channel: int, number: int, value: int, frame: int, now: int) -> None:
    mode = table.mode
    state = player.channels[channel]
    wheel = table.wheel
    turns = 0 <= wheel < of.KNOBS or wheel == of.MUTE
    if number == midi.SUSTAIN:
        state.pedal = value >= midi.PEDAL_DOWN
        changes.damp_unkept(player, table, frame, now)
    elif number == midi.SLIDE:
        state.slide = max(value, 0)
    elif number == midi.SOFT:
        state.mute = min(max(value, 0), 127) / 127
        changes.glide(player, table, channel, changes.DAMPER_S, frame, now)
    elif number == midi.LEGATO:
        state.switches[of.LEGATO] = value >= midi.PEDAL_DOWN
    elif number == midi.PORTAMENTO:
        state.switches[of.SLIDES] = value >= midi.PEDAL_DOWN
    elif number == midi.HARMONICS:
        state.switches[of.HARMONICS] = value >= midi.PEDAL_DOWN
    elif number == midi.TREMOLO:
        state.switches[of.TREMOLO] = value >= midi.PEDAL_DOWN
    elif number == midi.STRUM:
        state.switches[of.STRUMS] = value >= midi.PEDAL_DOWN
    elif number == midi.SLIDE_TIME:
        state.slide_time = min(max(value, 0), 127)
    elif number == midi.MOD_WHEEL:
        player.wheel = min(max(value, 0), 127)
        player.wheel_by = channel
        if turns:
            changes.glide(player, table, -1, KNOB_S, frame, now)
    elif number == midi.VOLUME:
        state.volume = min(max(value, 0), 127)
    elif number == midi.EXPRESSION:
        state.expression = min(max(value, 0), 127)
    elif number == midi.SOUND_OFF:
        stop(player, hands.STOP_S, frame)
    elif midi.NOTES_OFF <= number <= midi.LAST_MODE:
        for other in range(of.CHANNELS):
            if channels.is_master(mode, channel, other):
                channels.release_keys(player, other)
        chords.forget_turns(player, mode, channel)
        for other in range(of.MOST_NOTES):
            note = player.notes[other]
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
