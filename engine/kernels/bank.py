"""A voice of latents z_n(t) whose frequencies follow their energies: `engine.models.integrated_phase`, compiled.

It is what that module says, with time in samples of the trained rate and any number of frames a sample. Level and
phase are computed at the ends of short segments and are cubics in between; within one z is advanced by products.
Where the modulation M z² can be heard it is computed at every frame, for the latents that matter alone. Energies only
decay, so that what has become too quiet to matter is left out for good. Any block is the same as if it were rendered
in one piece: everything hangs on the frame alone.

A linear model (DMD) is a bank without coupling.
"""

from __future__ import annotations

import math

import numpy as np

from engine.kernels import voice_records as at
from engine.kernels.compiled import inlined, kernel
from engine.kernels.constants import QUANTUM
from engine.kernels.memory import behind
from engine.kernels.mixer_records import MOST_LATENTS, SCRATCH_ROWS
from engine.kernels.modes import row, rows, weights

SHORT, LONG = 32, 64  # frames of a segment, at first and later
INAUDIBLE = 1e-6  # of full scale: what changes less than that is left out
DEAD = math.log(4e-7)  # of full scale: a latent that is quieter is left out
LOOK_EVERY = 8  # quanta from one look at which latents' modulation is heard to the next
NO_FIXED_POINT = 3e-4  # nepers: the second step would change a smaller change by less than its square
STRAIGHT = 5e-6  # radians and nepers of a segment that may come from a cubic term that is left out
_TWO_PI = 2 * math.pi


@inlined
def _turn(angle: float) -> tuple[float, float]:
    """Cosine and sine of any angle to 1e-8, as arithmetic that becomes vector instructions."""
    x = (angle - _TWO_PI * np.floor(angle / _TWO_PI + 0.5)) * 0.25
    y = x * x
    s = x * (1 - y * (1 / 6 - y * (1 / 120 - y * (1 / 5040 - y / 362880))))
    c = 1 - y * (0.5 - y * (1 / 24 - y * (1 / 720 - y * (1 / 40320 - y / 3628800))))
    s, c = 2 * s * c, 1 - 2 * s * s
    return 1 - 2 * s * s, 2 * s * c


@inlined
def _exp(x: float) -> float:
    """The exponential e^x, to a share of 1e-9 for -17 … 17 and of 5e-4 up to ±64; below, it is as good as nothing."""
    y = max(x, -64.0) / 64
    e = 1 + y * (
        1 + y * (0.5 + y * (1 / 6 + y * (1 / 24 + y * (1 / 120 + y * (1 / 720 + y * (1 / 5040 + y / 40320))))))
    )
    e *= e
    e *= e
    e *= e
    e *= e
    e *= e
    return e * e


@inlined
def _tanh(x: float) -> float:
    """The hyperbolic tangent, as `compiled.tanh` computes it, in double precision; |x| counts up to 18."""
    y = 0.5 * (-18.0 if x < -18 else 18.0 if x > 18 else x)
    s = y * y
    t = y * (135135 + s * (17325 + s * (378 + s))) / (135135 + s * (62370 + s * (3150 + 28 * s)))
    return 2 * t / (1 + t * t)


@kernel
def _room(scratch: np.ndarray, row: int, count: int) -> np.ndarray:
    """The first `count` numbers of the scratch from a row on: a row has MOST_LATENTS, more run into the next rows."""
    return scratch[row * MOST_LATENTS : row * MOST_LATENTS + count]


@kernel
def energies(voice: at.Voice, program: at.BankProgram, time: float, out: np.ndarray) -> None:
    """Write the energies E_m (modes,) at a time since the pluck, in trained samples."""
    n = program.modes
    sigma = behind(program, program.sigma, n)
    start = row(voice, at.ENERGY_0)
    for m in range(n):
        out[m] = start[m] * _exp(-2 * sigma[m] * time)


@kernel
def higher_orders(program: at.BankProgram, energy: np.ndarray, out: np.ndarray, scratch: np.ndarray) -> None:
    """Write f(E) - K E into `out`, (2 modes,): slopes of each latent's log gain, then of its phase.

    They are in nepers and rad a trained sample.

    Args:
        energy: E (modes,).
        scratch: rows to work in; they are overwritten.
    """
    n = program.modes
    omega = behind(program, program.omega, n)
    out[: 2 * n] = 0.0
    units = behind(program, program.energy_units, n)
    reported = 0.0
    for m in range(n):
        reported += units[m] * energy[m]
    if reported < 1e-12:
        return
    layers = program.layers
    if layers > 0:
        network = behind(program, program.network, program.modulation - program.network).view(np.float32)
        values, results = scratch.view(np.float32), scratch[MOST_LATENTS:].view(np.float32)
        for m in range(n):
            values[m] = units[m] * energy[m]
        slot = 0
        for layer in range(layers):
            wide_in, wide_out = program.widths[layer], program.widths[layer + 1]
            bias = network[slot : slot + wide_out]
            weight = network[slot + wide_out :]
            for o in range(wide_out):
                results[o] = bias[o]
            for i in range(wide_in):
                value = values[i]
                if value != np.float32(0):
                    column = weight[i * wide_out : (i + 1) * wide_out]
                    for o in range(wide_out):
                        results[o] += value * column[o]
            slot += wide_out * (1 + wide_in)
            if layer + 1 < layers:
                for o in range(wide_out):
                    x = results[o]
                    values[o] = x / (np.float32(1) + np.float32(_exp(-float(x))))
            else:
                at_zero = behind(program, program.at_zero, 2 * n)
                rate_units = behind(program, program.rate_units, 2 * n)
                factor = reported if program.second_order else 1.0
                for o in range(2 * n):
                    out[o] = (results[o] - at_zero[o]) * rate_units[o] * factor
    if program.adiabatic:
        shares = behind(program, program.shares, n * n)
        largest = behind(program, program.largest, n)
        linear = _room(scratch, 0, n)
        share = _room(scratch, 1, n)
        change = _room(scratch, 2, n)
        for step in range(3):
            change[:] = 0.0
            for m in range(n):
                if energy[m] * largest[m] < 1e-15:
                    continue
                e = energy[m] if step == 0 else energy[m] / math.sqrt(1 + 2 * max(share[m], -0.4))
                row = shares[m * n : (m + 1) * n]
                for j in range(n):
                    change[j] += e * row[j]
            if step == 0:
                linear[:] = change
            share[:] = change
        for j in range(n):
            out[n + j] += omega[j] * (math.sqrt(1 + 2 * max(share[j], -0.4)) - 1 - linear[j])


@kernel
def strike(voice: at.Voice, program: at.BankProgram, scratch: np.ndarray) -> None:
    """Fill in what follows from z(0), whose log |z| and angle `LEVEL_0` and `ANGLE_0` hold, as a voice begins."""
    n = program.modes
    sigma, coupling = behind(program, program.sigma, n), behind(program, program.coupling, 2 * n * n)
    energy = row(voice, at.ENERGY_0)
    levels = row(voice, at.LEVEL_0)
    constant = rows(voice, at.CONSTANT, 2)
    constant[:] = 0.0
    for m in range(n):
        level = levels[m]
        energy[m] = math.exp(2 * level) if level > -300 else 0.0
        if sigma[m] > 0 and energy[m] > 0:
            share = energy[m] / (2 * sigma[m])
            for j in range(2 * n):
                constant[j] += share * coupling[m * 2 * n + j]
    rows(voice, at.INTEGRAL, 2)[:] = 0.0
    voice.node = 0
    voice.segment_valid = 0
    voice.modulated = program.modulates
    voice.refresh = 0
    voice.audible_count = n
    if program.higher:
        _integrate_from(voice, program, 0, scratch)


@kernel
def _width(node: int) -> int:
    """The number of nodes from this one to the next that is used: it grows, for changes become ever slower."""
    return 1 if node < 16 else 2 if node < 64 else 4 if node < 256 else 8


@kernel
def _integrate_from(voice: at.Voice, program: at.BankProgram, first: int, scratch: np.ndarray) -> None:
    """Compute the higher orders at the voice's node, half-way to the next one and there.

    They go to AT_LEFT, AT_MIDDLE and AT_RIGHT. `first`: the first of these three, 0 … 2, that is to be computed.
    """
    n = program.modes
    energy, more = _room(scratch, 4, n), scratch[5 * MOST_LATENTS :]
    for half in range(first, 3):
        time = (voice.node + 0.5 * half * _width(voice.node)) * program.spacing
        energies(voice, program, time, energy)
        higher_orders(program, energy, rows(voice, at.AT_LEFT + 2 * half, 2), more)


@kernel
def _integrate_to(voice: at.Voice, program: at.BankProgram, time: float, scratch: np.ndarray) -> None:
    """Add to INTEGRAL, by Simpson's rule, up to the last node that is not after a time in trained samples."""
    wanted = int(time / program.spacing)
    while voice.node + _width(voice.node) <= wanted:
        width = _width(voice.node)
        total = rows(voice, at.INTEGRAL, 2)
        left = rows(voice, at.AT_LEFT, 2)
        middle = rows(voice, at.AT_MIDDLE, 2)
        right = rows(voice, at.AT_RIGHT, 2)
        for j in range(2 * program.modes):
            total[j] += width * program.spacing * (left[j] + 4 * middle[j] + right[j]) / 6
            left[j] = right[j]
        voice.node += width
        _integrate_from(voice, program, 1, scratch)


@kernel
def _change(program: at.BankProgram, level: np.ndarray, alive: int, out: np.ndarray, scratch: np.ndarray) -> None:
    """Write what A adds to the log gain of each latent, in nepers (modes,).

    Args:
        level: log |z| (modes,).
        alive: the number of latents that count, the first ones.
    """
    n = program.modes
    weight = behind(program, program.change, n * n)  # transposed
    squares, energy = _room(scratch, 0, alive), _room(scratch, 1, alive)
    change = out[:alive]
    most = 0.0
    for m in range(alive):
        energy[m] = _exp(2 * level[m])
        squares[m] = energy[m]
        most = max(most, energy[m])
    for _ in range(3):  # rounds of a fixed point, at most
        change[:] = 0.0
        for m in range(alive):
            if squares[m] > 1e-7 * most:
                share, row = squares[m], weight[m * n : m * n + alive]
                for j in range(alive):
                    change[j] += share * row[j]
        lowest = 0.0
        for j in range(alive):
            lowest = min(lowest, change[j])
        if lowest > -NO_FIXED_POINT:
            break
        for m in range(alive):  # where the change falls, the square that counts is the amplitude's, not the action's
            squares[m] = energy[m] / math.sqrt(1 + 4 * abs(change[m])) if change[m] < 0 else energy[m]
    for j in range(alive):
        size = abs(change[j])
        grown = math.log1p(4 * size) / 4 if size > 1e-3 else size * (1 - size * (2 - size * 16 / 3))
        change[j] = -grown if change[j] < 0 else grown


@kernel
def _move(voice: at.Voice, program: at.BankProgram, time: float, out: np.ndarray, scratch: np.ndarray) -> None:
    """Write level, phase and their slopes at a time as the first four rows of `out`, (5, modes).

    The fifth row becomes what A adds to the level, where that can be heard; else it stays.

    Args:
        time: since the pluck, in trained samples.
        out: nepers and rad, slopes of them a trained sample; the level's slope is without the decay σ.
    """
    n = program.modes
    sigma, omega = behind(program, program.sigma, n), behind(program, program.omega, n)
    coupling, largest = behind(program, program.coupling, 2 * n * n), behind(program, program.largest, n)
    start = row(voice, at.ENERGY_0)
    constant = rows(voice, at.CONSTANT, 2)
    alive = voice.audible_count
    f, integral = _room(scratch, 0, 2 * n), _room(scratch, 2, 2 * n)
    if program.higher:
        spacing = program.spacing * _width(voice.node)
        u = (time - voice.node * program.spacing) / spacing
        total, left = rows(voice, at.INTEGRAL, 2), rows(voice, at.AT_LEFT, 2)
        middle, right = rows(voice, at.AT_MIDDLE, 2), rows(voice, at.AT_RIGHT, 2)
        for j in range(2 * n):
            slope = 4 * middle[j] - 3 * left[j] - right[j]
            bend = 2 * (left[j] + right[j]) - 4 * middle[j]
            f[j] = left[j] + u * (slope + u * bend)
            integral[j] = constant[j] + total[j] + spacing * u * (left[j] + u * (0.5 * slope + u * bend / 3))
    else:
        f[:] = 0.0
        integral[:] = constant
    for m in range(alive):
        energy = start[m] * _exp(-2 * sigma[m] * time)
        if not energy * largest[m] > 2e-8 * sigma[m]:
            continue
        share = energy / (2 * sigma[m])
        for part in range(2):
            couplings = coupling[(2 * m + part) * n : (2 * m + part + 1) * n]
            slopes, sums = f[part * n : (part + 1) * n], integral[part * n : (part + 1) * n]
            for j in range(alive):
                slopes[j] += energy * couplings[j]
                sums[j] -= share * couplings[j]
    limit = program.limit
    level_0, angle_0 = row(voice, at.LEVEL_0), row(voice, at.ANGLE_0)
    level = out[:n]
    phase = out[n : 2 * n]
    level_rate = out[2 * n : 3 * n]
    phase_rate = out[3 * n : 4 * n]
    for j in range(alive):
        saturated = _tanh(integral[j] / limit)
        level[j] = level_0[j] - sigma[j] * time + limit * saturated
        level_rate[j] = f[j] * (1 - saturated * saturated)  # the decay comes later: this part alone is held
        phase[j] = angle_0[j] + omega[j] * time + integral[n + j]
        phase_rate[j] = omega[j] + f[n + j]
    if program.adiabatic and voice.modulated:
        _change(program, level, alive, out[4 * n :], scratch)


@kernel
def generate(
    voice: at.Voice, program: at.BankProgram, fading: bool, audible: bool, out: np.ndarray, scratch: np.ndarray
) -> None:
    """Write the next quantum, (4, QUANTUM): rows 0 and 1 of the first set of weights, a row for each point.

    Rows 2 and 3 are of the second set, where `fading` to it. Where it is not audible only time advances.
    """
    n = program.modes
    ratio = program.ratio
    first = voice.generated
    if program.higher:
        _integrate_to(voice, program, first * ratio, scratch)
    if fading and voice.weights_faded == 0:  # what could not be heard there may be heard here
        if voice.modulated != program.modulates:
            voice.modulated, voice.segment_valid = program.modulates, 0
        voice.refresh = 0
    if audible:
        out[:] = 0.0
        length = SHORT if first < program.early else LONG
        # (QUANTUM, 2, modes): real parts, then imaginary ones
        z = scratch[SCRATCH_ROWS * MOST_LATENTS :].view(np.float32)[: 2 * QUANTUM * n]
        if not voice.segment_valid:
            _keep_end(voice, program, first * ratio, scratch)
        for begin in range(0, QUANTUM, length):
            _segment(voice, program, first + begin, length, voice.audible_count, z[begin * 2 * n :], scratch)
        if voice.modulated:
            if voice.refresh == 0:
                _look(voice, program, z, scratch)
                voice.refresh = LOOK_EVERY
            voice.refresh -= 1
        for which in range(2 if fading else 1):
            for point in range(voice.points):
                _sum(voice, which, point, z, out[2 * which + point], scratch)
        if voice.modulated and voice.rows > 0:
            _modulate(voice, program, z, fading, out, scratch)
    else:
        voice.segment_valid = 0
    voice.generated = first + QUANTUM
    # Beyond those that were audible there is no level: what is dead stays so
    loudest, alive = -1e9, 1  # nepers; latents up to the last that can be heard
    sigma = behind(program, program.sigma, n)
    levels, latest = row(voice, at.LEVEL_0), row(voice, at.LEVEL)
    time = (first + QUANTUM) * ratio
    for m in range(n):
        level = levels[m] - sigma[m] * time
        if audible and program.higher and m < voice.audible_count:
            level = max(level, latest[m])
        loudest = max(loudest, level)
        if level + program.loudness > DEAD:
            alive = m + 1
    voice.loudness = loudest + program.loudness
    voice.audible_count = alive


@kernel
def _keep_end(voice: at.Voice, program: at.BankProgram, time: float, scratch: np.ndarray) -> None:
    """Compute a voice's state at a time since the pluck, in trained samples, and keep it for the next segment.

    Rows LEVEL, PHASE, LEVEL_RATE and PHASE_RATE are those of `_move`; row CHANGE is what A adds there.
    """
    n = program.modes
    end = _room(scratch, 8, 5 * n)  # (5, modes), from row 8 of the scratch on, which `_move` does not work in
    end[4 * n :] = 0.0
    _move(voice, program, time, end, scratch)
    rows(voice, at.LEVEL, 4)[:] = end[: 4 * n]
    row(voice, at.CHANGE)[:] = end[4 * n :]
    voice.segment_valid = 1


@kernel
def _segment(
    voice: at.Voice, program: at.BankProgram, first: int, length: int, alive: int, z: np.ndarray, scratch: np.ndarray
) -> None:
    """Write z at `length` frames, float32 (frames, 2, modes) with the real parts first.

    Args:
        first: frame since the pluck, at which the kept state is.
        alive: the number of latents that are computed, the first ones; the others' z stays as it was.
    """
    n = program.modes
    ratio = program.ratio
    limit = program.limit
    end = _room(scratch, 8, 5 * n)  # as in `_keep_end`: the state after the segment
    end[4 * n :] = 0.0
    _move(voice, program, (first + length) * ratio, end, scratch)
    sigma = behind(program, program.sigma, n)
    width, count = length * ratio, float(length)  # in trained samples, and in frames
    level, phase = row(voice, at.LEVEL), row(voice, at.PHASE)
    level_rate, phase_rate = row(voice, at.LEVEL_RATE), row(voice, at.PHASE_RATE)
    # (modes,) each: z; its ratio from frame to frame, r; the ratio of that, s; and of that in turn, c
    turns = scratch[16 * MOST_LATENTS :].view(np.float32)
    zr = turns[:n]
    zi = turns[n : 2 * n]
    rr = turns[2 * n : 3 * n]
    ri = turns[3 * n : 4 * n]
    sr = turns[4 * n : 5 * n]
    si = turns[5 * n : 6 * n]
    cr = turns[6 * n : 7 * n]
    ci = turns[7 * n : 8 * n]
    bent = 0.0  # the largest cubic term, in nepers or rad over frames cubed
    for m in range(alive):
        held_left = min(max(level_rate[m] * width, -limit), limit) - sigma[m] * width
        held_right = min(max(end[2 * n + m] * width, -limit), limit) - sigma[m] * width
        rise, turn = end[m] - level[m], end[n + m] - phase[m]
        turn_left, turn_right = phase_rate[m] * width, end[3 * n + m] * width
        bend = (3 * rise - 2 * held_left - held_right) / (count * count)
        cube = (-2 * rise + held_left + held_right) / (count * count * count)
        twist = (3 * turn - 2 * turn_left - turn_right) / (count * count)
        screw = (-2 * turn + turn_left + turn_right) / (count * count * count)
        bent = max(bent, abs(cube), abs(screw))
        loud = _exp(level[m])
        c, s = _turn(phase[m])
        zr[m], zi[m] = loud * c, loud * s
        grown = _exp(held_left / count + bend + cube)
        c, s = _turn(turn_left / count + twist + screw)
        rr[m], ri[m] = grown * c, grown * s
        grown = _exp(2 * bend + 6 * cube)
        c, s = _turn(2 * twist + 6 * screw)
        sr[m], si[m] = grown * c, grown * s
        grown = _exp(6 * cube)
        c, s = _turn(6 * screw)
        cr[m], ci[m] = grown * c, grown * s
    curved = bent * count * count * count > STRAIGHT
    for frame in range(length):
        real, imaginary = z[frame * 2 * n : frame * 2 * n + n], z[frame * 2 * n + n : (frame + 1) * 2 * n]
        for m in range(alive):
            a, b = zr[m], zi[m]
            c, d = rr[m], ri[m]
            e, f = sr[m], si[m]
            real[m], imaginary[m] = a, b
            zr[m], zi[m] = a * c - b * d, a * d + b * c
            rr[m], ri[m] = c * e - d * f, c * f + d * e
            if curved:
                g, h = cr[m], ci[m]
                sr[m], si[m] = e * g - f * h, e * h + f * g
    latest, next_change = rows(voice, at.LEVEL, 4), row(voice, at.CHANGE + 1)
    for m in range(alive):
        for part in range(4):
            latest[part * n + m] = end[part * n + m]
        next_change[m] = end[4 * n + m]


@kernel
def _sum(voice: at.Voice, which: int, point: int, z: np.ndarray, out: np.ndarray, scratch: np.ndarray) -> None:
    """Add Re Σ w z and the bias to `out`, (QUANTUM,), w being the weights of set `which` at a point.

    `z`: (QUANTUM, 2, modes), real parts first.
    """
    n, alive = voice.modes, voice.audible_count
    reals, imaginaries = weights(voice, which, point, 0), weights(voice, which, point, 1)
    w, v = scratch[32 * MOST_LATENTS :].view(np.float32), scratch[33 * MOST_LATENTS :].view(np.float32)
    for m in range(alive):
        w[m], v[m] = reals[m], imaginaries[m]
    constant = voice.bias[which, point]
    for frame in range(QUANTUM):
        total = np.float32(0)
        real, imaginary = z[frame * 2 * n :], z[frame * 2 * n + n :]
        for m in range(alive):
            total += w[m] * real[m] + v[m] * imaginary[m]
        out[frame] += total + constant


@kernel
def _look(voice: at.Voice, program: at.BankProgram, z: np.ndarray, scratch: np.ndarray) -> None:
    """List the latents whose modulation can be heard (ROW_LIST), and those whose squares modulate them (COLUMN_LIST).

    Where no modulation can be heard the voice is not modulated any more.
    """
    n = program.modes
    alive = voice.audible_count
    # M, (modes, modes, 4): log gain by Re z² and Im z², then phase by both
    matrix, largest = behind(program, program.modulation, 4 * n * n), behind(program, program.largest_modulation, n)
    squares, loud = _room(scratch, 20, n), _room(scratch, 21, n)
    loudest = 0.0
    for m in range(alive):  # beyond, z is another voice's
        squares[m] = z[m] * z[m] + z[n + m] * z[n + m]
        size = 0.0
        for which in range(2):
            for point in range(2):
                w, v = weights(voice, which, point, 0), weights(voice, which, point, 1)
                size = max(size, abs(w[m]), abs(v[m]))
        loud[m] = size * math.sqrt(squares[m])
        loudest = max(loudest, loud[m])
    row_list, column_list = row(voice, at.ROW_LIST).view(np.int64), row(voice, at.COLUMN_LIST).view(np.int64)
    columns = 0
    for m in range(alive):
        if squares[m] * largest[m] * loudest > INAUDIBLE:
            column_list[columns] = m
            columns += 1
    kept = 0
    change = row(voice, at.CHANGE)
    for j in range(alive):
        effect = 0.0
        for place in range(columns):
            m = column_list[place]
            entry = matrix[(j * n + m) * 4 : (j * n + m) * 4 + 4]
            effect += squares[m] * (abs(entry[0]) + abs(entry[1]) + abs(entry[2]) + abs(entry[3]))
        if program.adiabatic:
            effect += abs(change[j])
        if effect * loud[j] > INAUDIBLE:
            row_list[kept] = j
            kept += 1
    voice.rows, voice.columns = kept, columns
    if kept == 0:
        voice.modulated = 0


@kernel
def _modulate(
    voice: at.Voice, program: at.BankProgram, z: np.ndarray, fading: bool, out: np.ndarray, scratch: np.ndarray
) -> None:
    """Add what modulation changes to the outputs (4, QUANTUM): w z (e^g - 1), for latents of ROW_LIST.

    g is M z² with what A adds. `z`: (QUANTUM, 2, modes), real parts first.
    """
    n = program.modes
    matrix, limit = behind(program, program.modulation, 4 * n * n), program.limit
    row_list, column_list = row(voice, at.ROW_LIST).view(np.int64), row(voice, at.COLUMN_LIST).view(np.int64)
    change, next_change = row(voice, at.CHANGE), row(voice, at.CHANGE + 1)
    squares = scratch[(SCRATCH_ROWS + 2 * QUANTUM) * MOST_LATENTS :].view(np.float32)
    alive = voice.audible_count
    columns = voice.columns
    rows_kept = voice.rows
    while columns > 0 and column_list[columns - 1] >= alive:  # died since the lists, which ascend, were made
        columns -= 1
    while rows_kept > 0 and row_list[rows_kept - 1] >= alive:
        rows_kept -= 1
    for place in range(columns):
        m = column_list[place]
        real, imaginary = squares[2 * place * QUANTUM :], squares[(2 * place + 1) * QUANTUM :]
        for frame in range(QUANTUM):
            a, b = z[frame * 2 * n + m], z[frame * 2 * n + n + m]
            real[frame] = a * a - b * b
            imaginary[frame] = np.float32(2) * a * b
    # (QUANTUM,): log gain and phase of one latent, then the parts of z (e^g - 1)
    growth, turn = scratch[22 * MOST_LATENTS :].view(np.float32), scratch[23 * MOST_LATENTS :].view(np.float32)
    for place in range(rows_kept):
        j = row_list[place]
        start = change[j]
        step = (next_change[j] - start) / QUANTUM
        for frame in range(QUANTUM):
            growth[frame] = start + step * frame
            turn[frame] = 0.0
        for column in range(columns):
            m = column_list[column]
            entry = matrix[(j * n + m) * 4 : (j * n + m) * 4 + 4]
            a, b = np.float32(entry[0]), np.float32(entry[1])
            c, d = np.float32(entry[2]), np.float32(entry[3])
            real, imaginary = squares[2 * column * QUANTUM :], squares[(2 * column + 1) * QUANTUM :]
            for frame in range(QUANTUM):
                growth[frame] += a * real[frame] + b * imaginary[frame]
                turn[frame] += c * real[frame] + d * imaginary[frame]
        for frame in range(QUANTUM):
            gain = _exp(limit * _tanh(growth[frame] / limit))
            cosine, sine = _turn(float(turn[frame]))
            a, b = z[frame * 2 * n + j], z[frame * 2 * n + n + j]
            growth[frame] = a * (gain * cosine - 1) - b * gain * sine
            turn[frame] = a * gain * sine + b * (gain * cosine - 1)
        for which in range(2 if fading else 1):
            for point in range(voice.points):
                w, v = weights(voice, which, point, 0)[j], weights(voice, which, point, 1)[j]
                signal = out[2 * which + point]
                for frame in range(QUANTUM):
                    signal[frame] += w * growth[frame] + v * turn[frame]
    if program.adiabatic:
        change[:] = next_change
