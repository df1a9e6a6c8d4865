"""Latents that share one tension: `engine.models.koopman_tension`, compiled, for models and for a voice.

A voice is what that module says, at the device's own rate, in metres and seconds. Its modes are its own and may
change while it rings: what the latents turn by follows from them and from the program's three curves.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from engine.kernels import lanes
from engine.kernels import layout as at
from engine.kernels.compiled import COMPILED
from engine.kernels.modes import damped, following, glide, gliding, rest_above, rest_silent, row
from engine.kernels.scheme import ENERGY_BOUND, HARDEST_KICK, MOST_NODES

NEWTON_STEPS, NEWTON_DONE = 20, 1e-9  # at most; of the tension: a smaller change is the last
NOTHING = 1e-60  # squares of displacement: what is left is put to zero, before it becomes denormal
UNFELT = 5e-6  # of S, on average: a mode that adds less rests, and adds its average
LOOKS_QUANTA = 8  # from one look at which modes of a drum move to the next
FEWER_QUANTA = 64  # from one look at whether a string's modes that still move need so many nodes to the next


@njit(**COMPILED)
def load(x: np.ndarray, y: np.ndarray, rows: np.ndarray, order: np.ndarray, memory: np.ndarray, first: int) -> None:
    """Copies modes, in this order, into blocks of `kernels.lanes`; unused lanes are zero.

    Args:
        rows: (7, modes), see `advance`.
    """
    for number in range(lanes.LANES * lanes.blocks_of(len(order))):
        slot = first + lanes.place(number)
        if number < len(order):
            mode = order[number]
            memory[slot], memory[slot + lanes.LANES] = x[mode], y[mode]
            for each in range(7):
                memory[slot + (lanes.COSINE + each) * lanes.LANES] = rows[each, mode]
        else:
            for each in range(lanes.EARS):
                memory[slot + each * lanes.LANES] = 0.0


@njit(**COMPILED)
def load_weights(weights: np.ndarray, order: np.ndarray, memory: np.ndarray, first: int, ear: int) -> None:
    """Copies the weights of one ear into the blocks that `load` fills."""
    for number in range(lanes.LANES * lanes.blocks_of(len(order))):
        slot = first + lanes.place(number) + (lanes.EARS + ear) * lanes.LANES
        memory[slot] = weights[order[number]] if number < len(order) else 0.0


@njit(**COMPILED)
def save(x: np.ndarray, y: np.ndarray, order: np.ndarray, memory: np.ndarray, first: int) -> None:
    """Copies modes back from their blocks."""
    for number in range(len(order)):
        slot = first + lanes.place(number)
        x[order[number]], y[order[number]] = memory[slot], memory[slot + lanes.LANES]


@njit(inline="always", **COMPILED)
def node(
    memory: np.ndarray,
    first: int,
    near: int,
    far: int,
    ears: int,
    sums: tuple[float, float],
    rest: tuple[float, float],
    largest_stretch: float,
    heard: np.ndarray,
) -> tuple[float, float]:
    """The kick of the common tension and the turn to the next node, in place.

    It leads from S and R here to those there.

    Args:
        sums, rest: S and R of the blocks here, and what resting modes add; the result is of the blocks.
    """
    tension = min(sums[0] + rest[0], largest_stretch)
    linear, squared = tension * (1 - 2 * (sums[1] + rest[1])), tension * tension
    return lanes.turn(memory, first, near, far, ears, linear, squared, heard)


@njit(**COMPILED)
def hold(memory: np.ndarray, first: int, blocks: int, largest_energy: float) -> tuple[float, bool]:
    """Holds Σ ω² |z|² of blocks below the largest; returns Σ |z|², and whether anything has changed."""
    total, energy = lanes.energies(memory, first, blocks)
    held = not energy <= largest_energy  # also where it is not a number
    if held:
        factor = math.sqrt(largest_energy / energy) if energy < np.inf else 0.0
        for number in range(lanes.LANES * blocks):
            x = first + lanes.place(number)
            y = x + lanes.LANES
            memory[x] *= factor
            memory[y] *= factor
            if not (abs(memory[x]) < np.inf and abs(memory[y]) < np.inf):
                memory[x] = memory[y] = 0.0
        total *= factor * factor
        if not total < np.inf:
            total = 0.0
    return total, held


@njit(**COMPILED)
def trim(memory: np.ndarray, first: int, moving: int, silence: float, total: float) -> int:
    """Lays the highest modes to rest that are silent; those left."""
    while moving > 1:
        x = first + lanes.place(moving - 1)
        y = x + lanes.LANES
        if not memory[x] * memory[x] + memory[y] * memory[y] < silence * silence * total + NOTHING:
            break
        memory[x] = memory[y] = 0.0
        moving -= 1
    if total < NOTHING:
        memory[first] = memory[first + lanes.LANES] = 0.0
    return moving


@njit(**COMPILED)
def advance(
    x: np.ndarray,
    y: np.ndarray,
    largest_energies: np.ndarray,
    largest_stretches: np.ndarray,
    decay: float,
    nodes: int,
    silence: float,
    rows: np.ndarray,
    out: np.ndarray,
) -> None:
    """Advances x and y (batch, modes) in place; writes the amplitudes out (batch, steps, modes).

    Args:
        largest_energies: of Σ ω² |z|², (batch,), which fall by `decay` a frame, in place.
        largest_stretches: of S, (batch,).
        nodes: of a frame.
        silence: the highest modes rest from when their amplitude is below this share of that of all together.
        rows: (7, modes): λ's parts, h k A/ω, η² A, κ r/A, κ p and ω².
    """
    batch, steps, modes = out.shape
    memory, order, nobody, rest = np.empty(lanes.slots(modes)), np.arange(modes), np.empty(0), (0.0, 0.0)
    first = lanes.aligned(memory)
    for string in range(batch):
        load(x[string], y[string], rows, order, memory, first)
        moving, blocks = modes, lanes.blocks_of(modes)
        sums = lanes.add_up(memory, first, blocks, 0, 0, nobody)
        for step in range(steps):
            for _ in range(nodes):
                sums = node(memory, first, blocks, 0, 0, sums, rest, largest_stretches[string], nobody)
            largest_energies[string] *= decay
            total, held = hold(memory, first, blocks, largest_energies[string])
            before, moving = moving, trim(memory, first, moving, silence, total)
            if held or moving < before or total < NOTHING:
                blocks = lanes.blocks_of(moving)
                sums = lanes.add_up(memory, first, blocks, 0, 0, nobody)
            frame = out[string, step]
            for n in range(moving):
                slot = first + lanes.place(n)
                frame[n] = memory[slot] * (1 - memory[slot + lanes.SEEN * lanes.LANES] * sums[0])
            for n in range(moving, modes):
                frame[n] = 0.0
        save(x[string], y[string], order, memory, first)


@njit(**COMPILED)
def _nodes(voice: np.ndarray, program: np.ndarray, kick: float) -> int:
    """The number of nodes in a frame, as many as the modes that move need: as `KoopmanTension.step`.

    Args:
        kick: Σ η² k (q² + v²/ω²).
    """
    counts = voice.view(np.int64)
    n, last = counts[at.MODES], counts[at.MOVING] - 1
    squares, sigmas = row(voice, n, at.OMEGA_SQUARED), row(voice, n, at.SIGMA)
    first_rate = damped(squares[0], sigmas[0]) / program[at.S_NODE_PHASE]
    fastest = max(first_rate, damped(squares[last], sigmas[last]) / program[at.S_HIGHEST_PHASE])
    fastest = min(max(fastest, math.sqrt(kick) / HARDEST_KICK), MOST_NODES * fastest)
    nodes, steps = max(1, math.ceil(fastest / program[at.S_RATE])), max(1, counts[at.JAVARI_STEPS])
    return (nodes + steps - 1) // steps * steps


@njit(**COMPILED)
def _needs_fewer_nodes(voice: np.ndarray, program: np.ndarray) -> bool:
    """Return True if fewer nodes are enough: high modes have fallen silent since its rows were prepared."""
    counts = voice.view(np.int64)
    if counts[at.STEPS] == 1 or program[at.S_UNHEARD] > 0:
        return False
    counts[at.REFRESH] -= 1
    if counts[at.REFRESH] > 0:
        return False
    counts[at.REFRESH] = FEWER_QUANTA
    n, kick = counts[at.MODES], 0.0
    x, y = row(voice, n, 0), row(voice, n, 1)
    couplings, stretches = row(voice, n, at.COUPLING), row(voice, n, at.STRETCH)
    for m in range(counts[at.MOVING]):
        kick += stretches[m] * couplings[m] * (x[m] * x[m] + y[m] * y[m])
    return _nodes(voice, program, kick) < counts[at.STEPS]


@njit(**COMPILED)
def prepare(voice: np.ndarray, program: np.ndarray, q: np.ndarray, v: np.ndarray) -> None:
    """The rows that follow from the voice's modes, its amplitudes and speeds (modes,): as `KoopmanTension.step`."""
    counts, whole = voice.view(np.int64), program.view(np.int64)
    n, rate = counts[at.MODES], program[at.S_RATE]
    squares, sigmas = row(voice, n, at.OMEGA_SQUARED), row(voice, n, at.SIGMA)
    couplings, stretches = row(voice, n, at.COUPLING), row(voice, n, at.STRETCH)
    rows = following(voice, n)
    rest_above(voice, rate)
    highest, kick = program[at.S_HIGHEST_PHASE], 0.0
    for m in range(counts[at.MOVING]):
        omega = damped(squares[m], sigmas[m])
        kick += stretches[m] * couplings[m] * (q[m] * q[m] + (v[m] / omega) ** 2)
    nodes, drum = _nodes(voice, program, kick), program[at.S_UNHEARD] > 0
    if counts[at.PREPARED] and not drum:  # a glide leaves as many, so that one to the same modes changes nothing
        nodes = max(nodes, counts[at.STEPS])
    h, coefficients = 1 / (nodes * rate), whole[at.S_COEFFICIENTS]
    slowest = np.inf
    for m in range(n):
        sigma, omega = sigmas[m], damped(squares[m], sigmas[m])
        slowest = min(slowest, sigma)
        phase = h * omega
        argument = min(max(2 * (phase / highest) ** 2 - 1, -1.0), 1.0)
        growth = r = p = 0.0
        now, before = 1.0, argument  # Chebyshev polynomials
        for degree in range(coefficients):
            growth += program[at.S_HEADER + degree] * now
            r += program[at.S_HEADER + coefficients + degree] * now
            p += program[at.S_HEADER + 2 * coefficients + degree] * now
            now, before = (2 * argument * now - before, now)
        growth = min(max(1 + phase * phase * growth, 0.0), 2.0)
        r, p = min(max(r, -1.0), 1.0), min(max(p, -1.0), 1.0)
        kappa, angle, shrunk = h * h * couplings[m], h * couplings[m] / omega, math.exp(-h * sigma)
        rows[0, m], rows[1, m] = shrunk * math.cos(phase), shrunk * math.sin(phase)
        rows[2, m], rows[3, m] = angle * growth, stretches[m] * growth
        rows[4, m] = kappa * r / growth if growth > 0.0 else 0.0
        rows[5, m], rows[6, m] = kappa * p, omega * omega
    counts[at.STEPS] = nodes
    if drum or not counts[at.PREPARED]:
        counts[at.REFRESH] = 0 if drum else FEWER_QUANTA
    voice[at.DECAY] = math.exp(-2 * slowest / rate)
    order = row(voice, n, at.ORDER).view(np.int64)
    for m in range(n):
        order[m] = m
    counts[at.HEARD] = counts[at.FELT] = counts[at.MOVING]
    counts[at.NODES], voice[at.STRETCHED], voice[at.JAVARI_GIVE] = 0, 0.0, 0.0


@njit(**COMPILED)
def _turn(voice: np.ndarray, mode: int, sign: float) -> None:
    """Turns a mode by the angle that it has swung through since the rows were prepared, forward or back.

    Modes that rest are kept without that angle. A kick K S x turns z by K S/2 on average.
    """
    counts = voice.view(np.int64)
    n = counts[at.MODES]
    if counts[at.NODES] == 0:
        return
    x, y, rows = row(voice, n, 0), row(voice, n, 1), following(voice, n)
    angle = counts[at.NODES] * math.atan2(rows[1, mode], rows[0, mode]) + 0.5 * rows[2, mode] * voice[at.STRETCHED]
    cosine, sine = math.cos(angle), sign * math.sin(angle)
    x[mode], y[mode] = cosine * x[mode] - sine * y[mode], sine * x[mode] + cosine * y[mode]


@njit(**COMPILED)
def _fall(voice: np.ndarray) -> None:
    """Modes that rest because nobody hears or feels them decay to the present."""
    counts = voice.view(np.int64)
    n, frames = counts[at.MODES], counts[at.RESTED] * at.QUANTUM
    if frames == 0:
        return
    x, y, rows = row(voice, n, 0), row(voice, n, 1), following(voice, n)
    order = row(voice, n, at.ORDER).view(np.int64)
    steps = counts[at.STEPS] * frames // 2  # a quantum is even
    for place in range(counts[at.FELT], counts[at.MOVING]):
        m = order[place]
        square, left, power = rows[0, m] * rows[0, m] + rows[1, m] * rows[1, m], 1.0, steps
        while power > 0:  # square ** steps: of whole numbers in fewer steps than of any
            if power & 1:
                left *= square
            square *= square
            power >>= 1
        x[m] *= left
        y[m] *= left
    counts[at.RESTED] = 0


@njit(**COMPILED)
def _wake(voice: np.ndarray) -> None:
    """Brings the modes that rest to the present; the next quantum chooses again which rest."""
    _fall(voice)
    counts = voice.view(np.int64)
    order = row(voice, counts[at.MODES], at.ORDER).view(np.int64)
    if counts[at.FELT] < counts[at.MOVING]:
        counts[at.REFRESH] = 0
    for place in range(counts[at.FELT], counts[at.MOVING]):
        _turn(voice, order[place], 1.0)
    counts[at.FELT] = counts[at.MOVING]


@njit(**COMPILED)
def _look(voice: np.ndarray, program: np.ndarray, sets: int, scratch: np.ndarray) -> None:
    """Orders the modes of a drum: those that are heard, others that stretch it, and those that rest.

    The highest that are silent are laid to rest for good.

    Args:
        sets: of weights that hear it.
        scratch: room for three rows (modes,).
    """
    counts = voice.view(np.int64)
    _fall(voice)
    n, moving = counts[at.MODES], counts[at.MOVING]
    x, y, rows, sigmas = row(voice, n, 0), row(voice, n, 1), following(voice, n), row(voice, n, at.SIGMA)
    stretches, order = rows[3], row(voice, n, at.ORDER).view(np.int64)
    sizes, heard, rested = scratch[:moving], scratch[moving : 2 * moving], scratch[2 * moving : 3 * moving]
    for place in range(moving):
        rested[order[place]] = 1.0 if place >= counts[at.FELT] else 0.0
    total = stretch = 0.0
    for m in range(moving):
        sizes[m], heard[m] = x[m] * x[m] + y[m] * y[m], 0.0
        total += sizes[m]
        stretch += stretches[m] * sizes[m]
    for which in range(sets):
        for point in range(counts[at.POINTS]):
            place = at.weights(n, which, point, 0)
            weights, loudness = voice[place : place + n], 0.0
            for m in range(moving):
                loudness += weights[m] * weights[m] * sizes[m]
            share = 1 / loudness if loudness > 0 else 0.0
            for m in range(moving):
                heard[m] = max(heard[m], share * weights[m] * weights[m] * sizes[m])
    while moving > 1 and sizes[moving - 1] < program[at.S_SILENCE] ** 2 * total + NOTHING:
        moving -= 1
        x[moving] = y[moving] = heard[moving] = 0.0
        order[moving] = moving
    audible = program[at.S_UNHEARD] ** 2
    place = 0
    for m in range(moving):
        if heard[m] > audible:
            order[place] = m
            place += 1
    counts[at.HEARD] = place
    for m in range(moving):
        if heard[m] <= audible and stretches[m] * sizes[m] > UNFELT * stretch:
            order[place] = m
            place += 1
    counts[at.FELT], counts[at.MOVING] = place, moving
    for felt in range(place):
        if rested[order[felt]] > 0.0:
            _turn(voice, order[felt], 1.0)
    rest = second = rate = 0.0
    for m in range(moving):
        if heard[m] <= audible and not stretches[m] * sizes[m] > UNFELT * stretch:
            order[place] = m
            place += 1
            if not rested[m] > 0.0:
                _turn(voice, m, -1.0)
            rest += 0.5 * stretches[m] * sizes[m]
            second += 0.5 * stretches[m] * rows[4, m] * sizes[m]
            rate += stretches[m] * sizes[m] * sigmas[m]
    voice[at.REST_STRETCH], voice[at.REST_SECOND] = rest, second
    voice[at.REST_DECAY] = math.exp(-rate / rest * at.QUANTUM / program[at.S_RATE]) if rest > 0 else 0.0
    counts[at.REFRESH] = LOOKS_QUANTA


@njit(**COMPILED)
def _half_kick(rows: np.ndarray, x: np.ndarray, largest_stretch: float, y: np.ndarray, sign: float) -> None:
    """Apply half of the kick that `node` begins with to y in place, forward or back."""
    first = second = 0.0
    for m in range(len(x)):
        stretch = rows[3, m] * x[m] * x[m]
        first += stretch
        second += rows[4, m] * stretch
    first = min(first, largest_stretch)
    linear, squared = first * (1 - 2 * second), first * first
    for m in range(len(x)):
        y[m] += sign * 0.5 * rows[2, m] * (linear - rows[4, m] * squared) * x[m]


@njit(**COMPILED)
def physical(voice: np.ndarray, q: np.ndarray, v: np.ndarray) -> None:
    """Amplitudes in m and speeds in m/s, (modes,), of a voice as it is now: the inverse of `set_out`, to rounding."""
    counts = voice.view(np.int64)
    n = counts[at.MODES]
    _wake(voice)
    x, y = row(voice, n, 0), row(voice, n, 1)
    rows = following(voice, n)
    sigmas, stretches = row(voice, n, at.SIGMA), row(voice, n, at.STRETCH)
    for m in range(n):
        v[m] = y[m]
    _half_kick(rows, x, voice[at.LARGEST_STRETCH], v, 1.0)
    tension = 0.0  # S₀ of x = q (1 + κ p S₀), by Newton's method
    for _ in range(NEWTON_STEPS):
        value, slope = -tension, 1.0
        for m in range(n):
            lift = 1 + rows[5, m] * tension
            square = stretches[m] * (x[m] / lift) ** 2
            value += square
            slope += 2 * square * rows[5, m] / lift
        change = value / slope
        tension += change
        if not abs(change) > NEWTON_DONE * abs(tension):
            break
    moved = 0.0
    for m in range(n):
        q[m] = x[m] / (1 + rows[5, m] * tension)
        v[m] = -math.sqrt(rows[6, m]) * v[m] - sigmas[m] * q[m]
        moved += stretches[m] * q[m] * v[m]
    for m in range(n):
        v[m] = v[m] * (1 + rows[5, m] * tension) + 2 * rows[5, m] * q[m] * moved


@njit(**COMPILED)
def set_out(voice: np.ndarray, q: np.ndarray, v: np.ndarray, bounded: bool) -> None:
    """The coordinates in which kicks act, half a kick before the first node, of amplitudes and speeds (modes,).

    As `KoopmanTension._set_out`.

    Args:
        bounded: the largest energy is there, and may only fall; otherwise it follows from the input.
    """
    counts = voice.view(np.int64)
    n = counts[at.MODES]
    x, y = row(voice, n, 0), row(voice, n, 1)
    rows = following(voice, n)
    sigmas, couplings, stretches = row(voice, n, at.SIGMA), row(voice, n, at.COUPLING), row(voice, n, at.STRETCH)
    tension = held = energy = widest = 0.0
    for m in range(n):
        omega, square = math.sqrt(rows[6, m]), q[m] * q[m]
        tension += stretches[m] * square
        held += couplings[m] * square
        y[m] = -(v[m] + sigmas[m] * q[m]) / omega
        energy += rows[6, m] * (square + y[m] * y[m])
        widest = max(widest, stretches[m] / rows[6, m])
    largest = ENERGY_BOUND * (energy + 0.5 * tension * held)
    voice[at.LARGEST_ENERGY] = min(voice[at.LARGEST_ENERGY], largest) if bounded else largest
    voice[at.LARGEST_STRETCH] = voice[at.LARGEST_ENERGY] * widest
    moved, share = 0.0, 1.0
    for m in range(n):
        part = stretches[m] * q[m] / (1 + rows[5, m] * tension)
        moved += part * v[m]
        share += 2 * part * rows[5, m] * q[m]
    moved /= share
    for m in range(n):
        lift = 1 + rows[5, m] * tension
        lifted = (v[m] - 2 * rows[5, m] * q[m] * moved) / lift
        x[m] = q[m] * lift
        y[m] -= (lifted - v[m]) / math.sqrt(rows[6, m])
    _half_kick(rows, x, voice[at.LARGEST_STRETCH], y, -1.0)


@njit(**COMPILED)
def bring_up_to_date(voice: np.ndarray, program: np.ndarray) -> None:
    """Bring up to date what follows from the modes, and the latents, where a voice begins or its modes change."""
    counts = voice.view(np.int64)
    n = counts[at.MODES]
    fewer = counts[at.PREPARED] and _needs_fewer_nodes(voice, program)
    if counts[at.PREPARED] and not gliding(voice) and not fewer:
        return
    q, v, squares = row(voice, n, at.PHYSICAL), row(voice, n, at.PHYSICAL + 1), following(voice, n)[6]
    if counts[at.PREPARED]:
        physical(voice, q, v)
        if fewer:
            counts[at.STEPS] = 1  # or as many as are needed
        if gliding(voice):
            glide(voice)
        raised = 1.0  # by the work that raises the tension
        for m in range(n):
            omega = damped(row(voice, n, at.OMEGA_SQUARED)[m], row(voice, n, at.SIGMA)[m])
            raised = max(raised, omega * omega / squares[m])
        voice[at.LARGEST_ENERGY] *= raised
    else:
        q[:], v[:] = row(voice, n, 0), row(voice, n, 1)
        if gliding(voice):
            glide(voice)
        if counts[at.JAVARI_STEPS] == 0:  # whose contact wakes them
            silence, own = program[at.S_SILENCE], row(voice, n, at.OMEGA_SQUARED)
            counts[at.MOVING], _ = rest_silent(q, v, own, counts[at.MOVING], silence)
    prepare(voice, program, q, v)
    for m in range(counts[at.MOVING], n):
        q[m] = v[m] = 0.0
    set_out(voice, q, v, bool(counts[at.PREPARED]))
    counts[at.PREPARED] = 1


@njit(**COMPILED)
def generate(
    voice: np.ndarray, program: np.ndarray, fading: bool, heard: bool, out: np.ndarray, scratch: np.ndarray
) -> None:
    """The next quantum, (4, QUANTUM); frame 0 is the string at its release."""
    bring_up_to_date(voice, program)
    counts = voice.view(np.int64)
    n, nodes, points = counts[at.MODES], counts[at.STEPS], counts[at.POINTS]
    sets, rests = 2 if fading else 1, program[at.S_UNHEARD] > 0
    ears = sets * points if heard else 0
    rest = (0.0, 0.0)
    if not rests:
        counts[at.HEARD] = counts[at.FELT] = counts[at.MOVING]
    elif fading or counts[at.REFRESH] == 0:
        _look(voice, program, sets, scratch)
    if rests:
        rest = (voice[at.REST_STRETCH], voice[at.REST_SECOND])
    x, y, rows = row(voice, n, 0), row(voice, n, 1), following(voice, n)
    order = row(voice, n, at.ORDER).view(np.int64)
    loud, quiet = order[: counts[at.HEARD]], order[counts[at.HEARD] : counts[at.FELT]]
    first, near, far = lanes.aligned(scratch), lanes.blocks_of(len(loud)), lanes.blocks_of(len(quiet))
    ear_sums, behind = scratch[first + lanes.slots(n) :][: 2 * lanes.MOST_EARS], first + near * lanes.BLOCK
    load(x, y, rows, loud, scratch, first)
    load(x, y, rows, quiet, scratch, behind)
    for ear in range(ears):
        place = at.weights(n, ear // points, ear % points, 0)
        load_weights(voice[place : place + n], loud, scratch, first, ear)
    moving, total, apart, largest = len(loud), 0.0, 2 if points == 1 else 1, voice[at.LARGEST_STRETCH]
    stretched = at.QUANTUM * nodes * rest[0]
    sums = lanes.add_up(scratch, first, near, far, ears, ear_sums)
    for frame in range(at.QUANTUM):
        for ear in range(ears):
            out[apart * ear, frame] = ear_sums[2 * ear] - (sums[0] + rest[0]) * ear_sums[2 * ear + 1]
        stretched += sums[0]
        for _ in range(nodes - 1):
            sums = node(scratch, first, near, far, 0, sums, rest, largest, ear_sums)
            stretched += sums[0]
        sums = node(scratch, first, near, far, ears, sums, rest, largest, ear_sums)
        voice[at.LARGEST_ENERGY] *= voice[at.DECAY]
        if frame % 16 == 15:
            total, held = hold(scratch, first, near + far, voice[at.LARGEST_ENERGY])
            before = moving
            if not rests:
                moving = trim(scratch, first, moving, program[at.S_SILENCE], total)
                near = lanes.blocks_of(moving)
            if held or moving < before or total < NOTHING:
                sums = lanes.add_up(scratch, first, near, far, ears, ear_sums)
    save(x, y, loud, scratch, first)
    save(x, y, quiet, scratch, behind)
    if rests:
        counts[at.REFRESH] -= 1
        counts[at.RESTED] += 1
        counts[at.NODES] += at.QUANTUM * nodes
        voice[at.STRETCHED] += stretched
        voice[at.REST_STRETCH] *= voice[at.REST_DECAY]
        voice[at.REST_SECOND] *= voice[at.REST_DECAY]
    else:
        counts[at.MOVING] = moving
    counts[at.GENERATED] += at.QUANTUM
    voice[at.LOUDNESS] = (0.5 * math.log(total) if total > 0 else -1e9) + program[at.S_LOUDNESS]
