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
from typing import NamedTuple

import numpy as np

from engine.kernels import constants as of
from engine.kernels.compiled import kernel
from engine.kernels.memory import address_of, attack_at, behind, mixed, mixer_at, player_at, table_at
from engine.kernels.records import ATTACK, Attack, Noise, Player, Table

HEADER = ATTACK.itemsize // 8

OFF_DB = -60.0  # from this level down there is no noise
SHORTENS, BRIGHTENS = -0.2, 0.15  # exponents of strength: of the pulse's length (Hertz), of the band (an estimate)
LARGEST_CHANGE = 2.0  # of either
HARDEST = 1.6  # amplitude of what is hard without limit, over that of hardness 1: an estimate
HIGHEST_SHARE = 0.4  # of the rate: the middle of a band
# Of a slide: J. Pakarinen, H. Penttinen, B. Bank, "Analysis of handling noises on wound strings", J. Acoust. Soc. Am.
# 122, 2007. Its pitch is that of the windings that pass; wires of 0.4 mm are an estimate
WINDINGS_M, LOWEST_SLIDE_HZ = 2_500.0, 200.0
LEFT_DB = -80.0  # of the burst as it ends


@kernel
def attack_of(table: Table) -> Attack:
    """The recorded attack of a table that has one."""
    return attack_at(address_of(table) + 8 * table.attack)


class Touch(NamedTuple):
    """The touch of a string or a drum.

    Attributes:
        which: STROKE or RELEASE of `constants`.
        level_db: energy of its noise re a note's; `OFF_DB` and below: none.
        strength: amplitude of the stroke, or of the motion that it stops, over that at the reference velocity.
        hardness: of what touches, over that of which the numbers of its contact hold.
        stroke: with the key, it chooses the noise.
        frame: of the mixer, at which it begins; 0: at once.
        slid_m, slides_s: way and time of a finger along the string, whose windings pass by: then that is the band.
    """

    which: int
    level_db: float
    strength: float
    hardness: float
    stroke: int
    key: int
    frame: int
    slid_m: float
    slides_s: float


@kernel
def touch(player: Player, table: Table, by: Touch) -> None:
    """Begin the noise of a stroke, a release or a slide. Where no place is free, the one heard longest ends."""
    if not by.level_db > OFF_DB:
        return
    kind, rate_hz = table.contacts[by.which], player.rate_hz
    strength, hardness = by.strength, by.hardness
    energy = table.noise_level * rate_hz * 10.0 ** (by.level_db / 10)
    energy *= strength ** (2 * kind.follows) * (HARDEST / (1 + (HARDEST - 1) / hardness**3)) ** 2
    noise, longest = player.noises[0], -1
    for candidate in player.noises:
        if candidate.left == 0:
            noise = candidate
            break
        if candidate.done > longest:
            noise, longest = candidate, candidate.done
    shorter = min(max(strength**SHORTENS, 1 / LARGEST_CHANGE), LARGEST_CHANGE)
    brighter = min(max(strength**BRIGHTENS, 1 / LARGEST_CHANGE), LARGEST_CHANGE)
    pulse_frames = max(2.0, kind.pulse_s * shorter / hardness * rate_hz)
    band_hz, share = kind.burst_hz * brighter * hardness, kind.pulse_share
    attack_s, fall_s = kind.attack_s, kind.fall_s
    if by.slides_s > 0.0:
        band_hz, share = max(by.slid_m * WINDINGS_M / by.slides_s, LOWEST_SLIDE_HZ), 0.0
        attack_s, fall_s = 0.5 * by.slides_s, 0.1 * by.slides_s
    turn = 2 * math.pi * min(band_hz / rate_hz, HIGHEST_SHARE)
    alpha = math.sin(turn) / (2 * kind.burst_q)
    shrinks = math.exp(-1 / max(1.0, fall_s * rate_hz))
    attack_frames = max(1.0, attack_s * rate_hz)
    passed = alpha / (1 + alpha)  # power of white noise in the band
    lasts = attack_frames / 3 + 1 / (1 - shrinks * shrinks)
    noise.frame = by.frame
    noise.done, noise.stops = 0, 0
    noise.seed = mixed((by.stroke * of.KEYS + by.key) * 2 + by.which + 1)
    noise.pulse = math.sqrt(share * energy / (0.375 * pulse_frames))
    noise.pulse_frames = pulse_frames
    noise.burst = math.sqrt((1 - share) * energy / (passed * lasts))
    noise.attack_frames = attack_frames
    noise.shrinks = shrinks
    noise.envelope = 1.0
    noise.b0 = passed
    noise.a1 = -2 * math.cos(turn) / (1 + alpha)
    noise.a2 = (1 - alpha) / (1 + alpha)
    noise.past[:] = 0.0
    noise.recorded = table.attack != 0 and by.which == of.STROKE
    if noise.recorded != 0:
        noise.pulse = math.sqrt(energy / rate_hz)
        attack = attack_of(table)
        noise.left = int(attack.frames * rate_hz / attack.rate_hz) + 1
        return
    falls = attack_frames + LEFT_DB * math.log(10.0) / 20 / math.log(shrinks)
    noise.left = int(max(pulse_frames, falls)) + 1


@kernel
def sound(player_address: int, mixer_address: int) -> None:
    """Add all noises of a player to the mixer's quantum, both channels alike.

    They are heard where exactly one source sounds, at its gain, and no mode is heard alone; else at a gain of 0.
    """
    player = player_at(player_address)
    if player.table == 0:
        return
    table = table_at(player.table)
    gain = 0.0
    sounding = 0
    for source in range(table.sources):
        if player.source_gains[source] != 0.0:
            gain = player.source_gains[source]
            sounding += 1
    if sounding != 1 or table.solo != 0:
        gain = 0.0
    before, player.noise_gain = player.noise_gain, gain
    mixer = mixer_at(mixer_address)
    mix, now = mixer.mix[:], mixer.frames
    for noise in player.noises:
        if noise.left == 0 or noise.frame >= now + of.QUANTUM:
            continue
        begin, gain_from = 0, before
        if noise.done == 0:
            begin, gain_from = max(0, noise.frame - now), gain
        end = min(of.QUANTUM, begin + noise.left)
        if noise.recorded == 0:
            _run(noise, begin, end, gain_from, gain, mix)
        elif table.attack != 0:
            _play(player, attack_of(table), noise, begin, end, gain_from, mix)
        noise.left -= end - begin
        stops = noise.stops
        if stops > 0:
            noise.pulse *= (stops - 1) / stops
            noise.burst *= (stops - 1) / stops
            noise.stops = stops - 1
        if stops == 1:
            noise.left = 0


@kernel
def _add(mix: np.ndarray, frame: int, force: float, before: float, gain: float, stops: int) -> None:
    """Add a force to a frame of the mix, at a gain that moves from `before` to `gain` within the quantum.

    `stops`: quanta in which the noise fades out, this one included; 0: it does not.
    """
    share = (frame + 1) / of.QUANTUM
    level = before + (gain - before) * share
    if stops > 0:
        level *= 1 - share / stops
    mix[frame, 0] += level * force
    mix[frame, 1] += level * force


@kernel
def _run(noise: Noise, begin: int, end: int, before: float, gain: float, mix: np.ndarray) -> None:
    """Add a noise to the frames `begin` to `end` of the mix, while its gain goes from `before` to `gain`."""
    pulse, pulse_frames = noise.pulse, noise.pulse_frames
    burst, attack_frames = noise.burst, noise.attack_frames
    shrinks, envelope = noise.shrinks, noise.envelope
    b0 = noise.b0
    a1 = noise.a1
    a2 = noise.a2
    x1 = noise.past[0]
    x2 = noise.past[1]
    y1 = noise.past[2]
    y2 = noise.past[3]
    seed = noise.seed
    done = noise.done
    stops = noise.stops
    for frame in range(begin, end):
        x = math.sqrt(3.0) * float(mixed(seed + done) >> 11) / 2.0**52
        y = b0 * (x - x2) - a1 * y1 - a2 * y2
        x1, x2, y1, y2 = x, x1, y, y1
        force = burst * y * ((done + 0.5) / attack_frames if done < attack_frames else envelope)
        if done >= attack_frames:
            envelope *= shrinks
        if done < pulse_frames:
            force += pulse * (0.5 - 0.5 * math.cos(2 * math.pi * (done + 0.5) / pulse_frames))
        _add(mix, frame, force, before, gain, stops)
        done += 1
    noise.past[0] = x1
    noise.past[1] = x2
    noise.past[2] = y1
    noise.past[3] = y2
    noise.envelope = envelope
    noise.done = done


@kernel
def _play(player: Player, attack: Attack, noise: Noise, begin: int, end: int, before: float, mix: np.ndarray) -> None:
    """Add a recorded attack, by linear interpolation between its samples, as `_run` adds a noise."""
    gain = player.noise_gain
    frames, step = attack.frames, attack.rate_hz / player.rate_hz
    samples = behind(attack, HEADER, frames)
    done, stops = noise.done, noise.stops
    for frame in range(begin, end):
        place = done * step
        number = int(place)
        if number < frames:
            after = samples[number + 1] if number + 1 < frames else 0.0
            force = noise.pulse * (samples[number] + (place - number) * (after - samples[number]))
            _add(mix, frame, force, before, gain, stops)
        done += 1
    noise.done = done
