"""What controllers of MIDI do."""

from __future__ import annotations

import numpy as np
from numba import njit

from engine.kernels import contact
from engine.kernels import playing_layout as of
from engine.kernels.compiled import COMPILED
from engine.kernels.playing import changes, channels, chords, hands, slots, voices

KNOB_S = 0.04  # of the glide to other modes
MOD_WHEEL, SLIDE_TIME, VOLUME, EXPRESSION, SUSTAIN, PORTAMENTO, SOFT, LEGATO, SLIDE = 1, 5, 7, 11, 64, 65, 67, 68, 74
HARMONICS, TREMOLO, STRUM, SOUND_OFF, RESET, NOTES_OFF = 80, 81, 82, 120, 121, 123
PEDAL_DOWN = 64  # from this value on
LAST_MODE = 127  # messages from NOTES_OFF on choose a mode, and release all keys as well


@njit(**COMPILED)
def stop(player: np.ndarray, players: np.ndarray, seconds: float, frame: int) -> None:
    """Lets all strings fade out, those too that nobody plays, and forgets their places."""
    for number in range(of.MOST_NOTES):
        note = slots.note(number)
        if players[note + of.NOTE_STATE] == of.RINGS:
            voices.release_note(player, players, note, seconds, frame)
            players[note + of.NOTE_HAS_PLACE] = 0
    for each in range(of.CHANNELS):
        channels.release_keys(players, each)
    chords.forget_turns(player, players, of.POLY, -1)
    players[of.PLAYER_NEXT_UP] = 0
    players[of.PLAYER_SYMPATHY_STOPS] = slots.quanta(player, max(seconds, hands.STOP_S)) + 2
    contact.hush(players, slots.quanta(player, max(seconds, hands.STOP_S)))


@njit(**COMPILED)
def controller(
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
    mode, own, wheel = tables[of.TABLE_MODE], slots.channel(channel), tables[of.TABLE_WHEEL]
    turns = 0 <= wheel < of.KNOBS or wheel == of.MUTE
    if number == SUSTAIN:
        players[own + of.CHANNEL_PEDAL] = value >= PEDAL_DOWN
        changes.damp_unkept(player, players, table, tables, frame, now)
    elif number == SLIDE:
        players[own + of.CHANNEL_SLIDE] = max(value, 0)
    elif number == SOFT:
        player[own + of.CHANNEL_MUTE] = min(max(value, 0), 127) / 127
        changes.glide(player, players, table, tables, channel, changes.DAMPER_S, frame, now)
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
        players[of.PLAYER_WHEEL] = min(max(value, 0), 127)
        players[of.PLAYER_WHEEL_BY] = channel
        if turns:
            changes.glide(player, players, table, tables, -1, KNOB_S, frame, now)
    elif number == VOLUME:
        players[own + of.CHANNEL_VOLUME] = min(max(value, 0), 127)
    elif number == EXPRESSION:
        players[own + of.CHANNEL_EXPRESSION] = min(max(value, 0), 127)
    elif number == SOUND_OFF:
        stop(player, players, hands.STOP_S, frame)
    elif NOTES_OFF <= number <= LAST_MODE:
        for each in range(of.CHANNELS):
            if channels.is_master(mode, channel, each):
                channels.release_keys(players, each)
        chords.forget_turns(player, players, mode, channel)
        for each in range(of.MOST_NOTES):
            note = slots.note(each)
            if channels.is_master(mode, channel, players[note + of.NOTE_CHANNEL]) and slots.sounds(players, note):
                players[note + of.NOTE_HELD] = 0
                players[note + of.NOTE_KEPT] = 0
                changes.damp(player, players, table, tables, each, frame, now)
    elif number == RESET:
        for each in range(of.CHANNELS):
            if channels.is_master(mode, channel, each) and value == 0:
                channels.reset(player, players, each)
            elif channels.is_master(mode, channel, each):  # by this program: MIDI's own has no other value
                channels.begin(player, players, each)
        if channels.is_master(mode, channel, players[of.PLAYER_WHEEL_BY]):
            players[of.PLAYER_WHEEL] = 0
        changes.damp_unkept(player, players, table, tables, frame, now)
        changes.glide(player, players, table, tables, channel, hands.BEND_S, frame, now)
        if turns:
            changes.glide(player, players, table, tables, -1, KNOB_S, frame, now)
    elif channels.set_parameter(player, players, mode, channel, number, value):
        changes.glide(player, players, table, tables, -1, hands.BEND_S, frame, now)
