"""Noise of what touches a string: a pulse of force on the bridge, and a burst of noise in a band.

    F(t) = P (1 - cos 2πt/T)/2  +  B e(t) (h * w)(t)

w is white noise, h a band-pass of second order, and e rises in a straight line and falls exponentially. P and B give
pulse and burst their shares of an energy in dB re that of a note. A harder stroke is louder; its pulse is shorter, as
contact of bodies is by Hertz's law (T ~ v^-1/5), and its band higher (an estimate). What lands on a string that moves
is as loud as that motion is large.

What strikes a drum has a hardness, see `engine.kernels.drums`: the band is in proportion to it. Its amplitude falls
by 18 dB an octave of softness, as the spectrum of a raised cosine does; where it is hard it tends to a limit.

A string that was learned from a recording may have the attack of that instead, at the amplitude of the stroke.
The noise of a stroke is the same for the same strokes: a counter makes it. It is no part of the string's equation, so
it sounds where one source alone is heard, and never where model and truth sound together.
"""

from __future__ import annotations

import math

import numpy as np
from numba import carray, njit

from engine.kernels import layout as at
from engine.kernels import playing_layout as of
from engine.kernels.compiled import COMPILED
from engine.kernels.memory import pointer

OFF_DB = -60.0  # from this level down there is no noise
SHORTENS, BRIGHTENS = -0.2, 0.15  # exponents of strength: of the pulse's length (Hertz), of the band (an estimate)
LARGEST_CHANGE = 2.0  # of either
HARDEST = 1.6  # amplitude of what is hard without limit, over that of hardness 1: an estimate
HIGHEST_SHARE = 0.4  # of the rate: the middle of a band
# Of a slide: J. Pakarinen, H. Penttinen, B. Bank, "Analysis of handling noises on wound strings", J. Acoust. Soc. Am.
# 122, 2007. Its pitch is that of the windings that pass; wires of 0.4 mm are an estimate
WINDINGS_M, LOWEST_SLIDE_HZ = 2_500.0, 200.0
LEFT_DB = -80.0  # of the burst as it ends


@njit(**COMPILED)
def _mixed(number: int) -> int:
    """A number with all bits mixed (splitmix64)."""
    mixed = np.uint64(number) * np.uint64(0x9E3779B97F4A7C15)
    mixed = (mixed ^ (mixed >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return int(np.int64(mixed ^ (mixed >> np.uint64(31))))


@njit(**COMPILED)
def touch(
    player: np.ndarray,
    players: np.ndarray,
    table: np.ndarray,
    which: int,
    level_db: float,
    strength: float,
    hardness: float,
    stroke: int,
    key: int,
    frame: int,
    slid_m: float,
    slides_s: float,
) -> None:
    """Begins the noise of a stroke, a release or a slide. Where no place is free, the one heard longest ends.

    Args:
        level_db: energy re a note's; `OFF_DB` and below: none.
        strength: amplitude of the stroke, or of the motion that it stops, over that at the reference velocity.
        hardness: of what touches, over that of which the numbers of its contact hold.
        stroke: with the key, it chooses the noise.
        frame: of the mixer, at which it begins; 0: at once.
        slid_m, slides_s: way and time of a finger along the string, whose windings pass by: then that is the band.
    """
    if not level_db > OFF_DB:
        return
    first, rate_hz = of.TABLE_CONTACTS + which * of.CONTACT, player[of.PLAYER_RATE]
    energy = table[of.TABLE_NOISE_LEVEL] * rate_hz * 10.0 ** (level_db / 10)
    energy *= strength ** (2 * table[first + of.FOLLOWS]) * (HARDEST / (1 + (HARDEST - 1) / hardness**3)) ** 2
    noise, longest = of.PLAYER_NOISES, -1
    for number in range(of.MOST_NOISES):
        each = of.PLAYER_NOISES + number * of.NOISE_SLOTS
        if players[each + of.NOISE_LEFT] == 0:
            noise = each
            break
        if players[each + of.NOISE_DONE] > longest:
            noise, longest = each, players[each + of.NOISE_DONE]
    shorter = min(max(strength**SHORTENS, 1 / LARGEST_CHANGE), LARGEST_CHANGE)
    brighter = min(max(strength**BRIGHTENS, 1 / LARGEST_CHANGE), LARGEST_CHANGE)
    pulse_frames = max(2.0, table[first + of.PULSE_S] * shorter / hardness * rate_hz)
    band_hz, share = table[first + of.BURST_HZ] * brighter * hardness, table[first + of.PULSE_SHARE]
    attack_s, fall_s = table[first + of.ATTACK_S], table[first + of.FALL_S]
    if slides_s > 0.0:
        band_hz, share = max(slid_m * WINDINGS_M / slides_s, LOWEST_SLIDE_HZ), 0.0
        attack_s, fall_s = 0.5 * slides_s, 0.1 * slides_s
    turn = 2 * math.pi * min(band_hz / rate_hz, HIGHEST_SHARE)
    alpha = math.sin(turn) / (2 * table[first + of.BURST_Q])
    shrinks = math.exp(-1 / max(1.0, fall_s * rate_hz))
    attack_frames = max(1.0, attack_s * rate_hz)
    passed = alpha / (1 + alpha)  # power of white noise in the band
    lasts = attack_frames / 3 + 1 / (1 - shrinks * shrinks)
    players[noise + of.NOISE_FRAME] = frame
    players[noise + of.NOISE_DONE] = players[noise + of.NOISE_STOPS] = 0
    players[noise + of.NOISE_SEED] = _mixed((stroke * of.KEYS + key) * 2 + which + 1)
    player[noise + of.NOISE_PULSE] = math.sqrt(share * energy / (0.375 * pulse_frames))
    player[noise + of.NOISE_PULSE_FRAMES] = pulse_frames
    player[noise + of.NOISE_BURST] = math.sqrt((1 - share) * energy / (passed * lasts))
    player[noise + of.NOISE_ATTACK_FRAMES] = attack_frames
    player[noise + of.NOISE_SHRINKS] = shrinks
    player[noise + of.NOISE_ENVELOPE] = 1.0
    player[noise + of.NOISE_B0] = passed
    player[noise + of.NOISE_A1] = -2 * math.cos(turn) / (1 + alpha)
    player[noise + of.NOISE_A2] = (1 - alpha) / (1 + alpha)
    for each in range(4):
        player[noise + of.NOISE_PAST + each] = 0.0
    tables = table.view(np.int64)
    attack = tables[of.TABLE_ATTACK] if which == of.STROKE else 0
    players[noise + of.NOISE_RECORDED] = attack != 0
    if attack != 0:
        player[noise + of.NOISE_PULSE] = math.sqrt(energy / rate_hz)
        frames = tables[attack + of.ATTACK_FRAMES] * rate_hz / table[attack + of.ATTACK_RATE]
        players[noise + of.NOISE_LEFT] = int(frames) + 1
        return
    falls = attack_frames + LEFT_DB * math.log(10.0) / 20 / math.log(shrinks)
    players[noise + of.NOISE_LEFT] = int(max(pulse_frames, falls)) + 1


@njit(**COMPILED)
def hush(players: np.ndarray, quanta: int) -> None:
    """Lets all noises fade out."""
    for number in range(of.MOST_NOISES):
        players[of.PLAYER_NOISES + number * of.NOISE_SLOTS + of.NOISE_STOPS] = quanta


@njit(**COMPILED)
def sound(player_address: int, mixer_address: int) -> None:
    """Adds all noises to the mixer's quantum, both channels alike."""
    player = carray(pointer(player_address), (1 << 40,), np.float64)
    players = carray(pointer(player_address), (1 << 40,), np.int64)
    address = players[of.PLAYER_TABLE]
    if address == 0:
        return
    table = carray(pointer(address), (1 << 40,), np.float64)
    tables = carray(pointer(address), (1 << 40,), np.int64)
    gain, heard = 0.0, 0
    for source in range(tables[of.TABLE_SOURCES]):
        if player[of.PLAYER_SOURCE_GAINS + source] != 0.0:
            gain = player[of.PLAYER_SOURCE_GAINS + source]
            heard += 1
    if heard != 1 or tables[of.TABLE_SOLO] != 0:
        gain = 0.0
    before = player[of.PLAYER_NOISE_GAIN]
    player[of.PLAYER_NOISE_GAIN] = gain
    mixer = carray(pointer(mixer_address), (at.MIXER_SLOTS,), np.float64)
    mix = mixer[at.M_MIX : at.M_MIX + 2 * at.QUANTUM].reshape(at.QUANTUM, 2)
    now = mixer.view(np.int64)[at.M_FRAMES]
    for number in range(of.MOST_NOISES):
        noise = of.PLAYER_NOISES + number * of.NOISE_SLOTS
        if players[noise + of.NOISE_LEFT] == 0 or players[noise + of.NOISE_FRAME] >= now + at.QUANTUM:
            continue
        begin, gain_from = 0, before
        if players[noise + of.NOISE_DONE] == 0:
            begin, gain_from = max(0, players[noise + of.NOISE_FRAME] - now), gain
        end = min(at.QUANTUM, begin + players[noise + of.NOISE_LEFT])
        if players[noise + of.NOISE_RECORDED] == 0:
            _run(player, players, noise, begin, end, gain_from, gain, mix)
        elif tables[of.TABLE_ATTACK] != 0:
            _play(player, players, table, tables, noise, begin, end, gain_from, gain, mix)
        players[noise + of.NOISE_LEFT] -= end - begin
        stops = players[noise + of.NOISE_STOPS]
        if stops > 0:
            player[noise + of.NOISE_PULSE] *= (stops - 1) / stops
            player[noise + of.NOISE_BURST] *= (stops - 1) / stops
            players[noise + of.NOISE_STOPS] = stops - 1
        if stops == 1:
            players[noise + of.NOISE_LEFT] = 0


@njit(**COMPILED)
def _add(mix: np.ndarray, frame: int, force: float, before: float, gain: float, stops: int) -> None:
    """Adds a force to a frame of the mix, at a gain between two quanta; it fades out where the noise stops."""
    share = (frame + 1) / at.QUANTUM
    level = before + (gain - before) * share
    if stops > 0:
        level *= 1 - share / stops
    mix[frame, 0] += level * force
    mix[frame, 1] += level * force


@njit(**COMPILED)
def _run(
    player: np.ndarray,
    players: np.ndarray,
    noise: int,
    begin: int,
    end: int,
    before: float,
    gain: float,
    mix: np.ndarray,
) -> None:
    """Adds a noise to frames of the mix, while its gain goes from `before` to `gain`."""
    pulse, pulse_frames = player[noise + of.NOISE_PULSE], player[noise + of.NOISE_PULSE_FRAMES]
    burst, attack_frames = player[noise + of.NOISE_BURST], player[noise + of.NOISE_ATTACK_FRAMES]
    shrinks, envelope = player[noise + of.NOISE_SHRINKS], player[noise + of.NOISE_ENVELOPE]
    b0, a1, a2 = player[noise + of.NOISE_B0], player[noise + of.NOISE_A1], player[noise + of.NOISE_A2]
    past = player[noise + of.NOISE_PAST : noise + of.NOISE_PAST + 4]
    x1, x2, y1, y2 = past[0], past[1], past[2], past[3]
    seed, done, stops = (
        players[noise + of.NOISE_SEED],
        players[noise + of.NOISE_DONE],
        players[noise + of.NOISE_STOPS],
    )
    for frame in range(begin, end):
        x = math.sqrt(3.0) * float(_mixed(seed + done) >> 11) / 2.0**52
        y = b0 * (x - x2) - a1 * y1 - a2 * y2
        x1, x2, y1, y2 = x, x1, y, y1
        force = burst * y * ((done + 0.5) / attack_frames if done < attack_frames else envelope)
        if done >= attack_frames:
            envelope *= shrinks
        if done < pulse_frames:
            force += pulse * (0.5 - 0.5 * math.cos(2 * math.pi * (done + 0.5) / pulse_frames))
        _add(mix, frame, force, before, gain, stops)
        done += 1
    past[0], past[1], past[2], past[3] = x1, x2, y1, y2
    player[noise + of.NOISE_ENVELOPE] = envelope
    players[noise + of.NOISE_DONE] = done


@njit(**COMPILED)
def _play(
    player: np.ndarray,
    players: np.ndarray,
    table: np.ndarray,
    tables: np.ndarray,
    noise: int,
    begin: int,
    end: int,
    before: float,
    gain: float,
    mix: np.ndarray,
) -> None:
    """Adds the table's recorded attack, by linear interpolation between its samples, as `_run` adds a noise."""
    first = tables[of.TABLE_ATTACK]
    frames, step = tables[first + of.ATTACK_FRAMES], table[first + of.ATTACK_RATE] / player[of.PLAYER_RATE]
    first += of.ATTACK_HEADER
    amplitude, done, stops = (
        player[noise + of.NOISE_PULSE],
        players[noise + of.NOISE_DONE],
        players[noise + of.NOISE_STOPS],
    )
    for frame in range(begin, end):
        place = done * step
        number = int(place)
        if number < frames:
            after = table[first + number + 1] if number + 1 < frames else 0.0
            force = amplitude * (table[first + number] + (place - number) * (after - table[first + number]))
            _add(mix, frame, force, before, gain, stops)
        done += 1
    players[noise + of.NOISE_DONE] = done
