"""Latents that share one tension: `engine.models.koopman_tension`, compiled, for models and for a voice.

A voice is what that module says, at the device's own rate, in metres and seconds. Its modes are its own and may
change while it rings: what the latents turn by follows from them and from the program's three curves.

A frame has a whole number of *nodes*, h apart. At each the tension kicks the latents z = x + iy; then they turn to
the next one. S = Σ η² A x² is their stretch, R = Σ η² κ r x² corrects it: `sums` are (S, R). Modes of a drum that
nobody hears *rest*: they only decay, and count in S and R by their averages. Those that are *felt* still stretch it.
Blocks of modes, the ears that hear them, and `near` and `far` blocks are those of `kernels.lanes`.
"""

from __future__ import annotations

import math

import numpy as np

from engine.kernels import lanes
from engine.kernels import voice_records as at
from engine.kernels.compiled import inlined, kernel
from engine.kernels.constants import QUANTUM
from engine.kernels.fields import slots
from engine.kernels.memory import behind
from engine.kernels.modes import damped, following, glide, gliding, motion, rest_above, rest_silent, row, weights
from engine.kernels.scheme import ENERGY_BOUND, HARDEST_KICK, MOST_NODES

NEWTON_STEPS, NEWTON_DONE = 20, 1e-9  # at most; of the tension: a smaller change is the last
NOTHING = 1e-60  # squares of displacement: what is left is put to zero, before it becomes denormal
UNFELT = 5e-6  # of S, on average: a mode that adds less rests, and adds its average
LOOKS_QUANTA = 8  # from one look at which modes of a drum move to the next
FEWER_QUANTA = 64  # from one look at whether a string's modes that still move need so many nodes to the next
BEHIND_PROGRAM = slots(at.TENSION_PROGRAM)


@kernel
def load(x: np.ndarray, y: np.ndarray, rows: np.ndarray, order: np.ndarray, memory: np.ndarray, first: int) -> None:
    """Copy modes, in this order, into blocks of `kernels.lanes`; unused lanes of the last block become 0.

    Args:
        rows: (7, modes), see `advance`.
        order: numbers of the modes that are copied.
        memory, first: where the blocks are, from the slot `first` on.
    """
    for number in range(lanes.LANES * lanes.blocks_of(len(order))):
        slot = first + lanes.place(number)
        if number < len(order):
            mode = order[number]
            memory[slot], memory[slot + lanes.LANES] = x[mode], y[mode]
            for row in range(7):
                memory[slot + (lanes.COSINE + row) * lanes.LANES] = rows[row, mode]
        else:
            for row in range(lanes.EARS):
                memory[slot + row * lanes.LANES] = 0.0


@kernel
def order_of(voice: at.Voice) -> np.ndarray:
    """The numbers of a voice's modes, in the order in which they are taken."""
    return row(voice, at.ORDER).view(np.int64)


@kernel
def take(voice: at.Voice, order: np.ndarray, fading: bool, audible: bool, memory: np.ndarray, first: int) -> int:
    """Copy modes of a voice, in this order, and their weights into blocks; return the ears that hear them."""
    x, y = motion(voice)
    load(x, y, following(voice), order, memory, first)
    ears = (2 if fading else 1) * voice.points if audible else 0
    for ear in range(ears):
        point_weights = weights(voice, ear // voice.points, ear % voice.points, 0)
        for number in range(lanes.LANES * lanes.blocks_of(len(order))):
            slot = first + lanes.place(number) + (lanes.EARS + ear) * lanes.LANES
            memory[slot] = point_weights[order[number]] if number < len(order) else 0.0
    return ears


@kernel
def save(x: np.ndarray, y: np.ndarray, order: np.ndarray, memory: np.ndarray, first: int) -> None:
    """Copy modes back from their blocks."""
    for number in range(len(order)):
        slot = first + lanes.place(number)
        x[order[number]], y[order[number]] = memory[slot], memory[slot + lanes.LANES]


@inlined
def node(
    memory: np.ndarray,
    first: int,
    near: int,
    far: int,
    ears: int,
    sums: tuple[float, float],
    rest: tuple[float, float],
    largest_stretch: float,
    at_points: np.ndarray,
) -> tuple[float, float]:
    """The kick of the common tension and the turn to the next node, in place.

    It takes each number by itself, as `lanes.turn`: all stay in registers.

    Args:
        sums, rest: (S, R) of the blocks at this node, and what resting modes add; returned are those at the next.
        largest_stretch: S is not above it.
        at_points: written for the ears, at the next node; see `lanes`.
    """
    tension = min(sums[0] + rest[0], largest_stretch)
    linear, squared = tension * (1 - 2 * (sums[1] + rest[1])), tension * tension
    return lanes.turn(memory, first, near, far, ears, linear, squared, at_points)


@kernel
def hold(memory: np.ndarray, first: int, blocks: int, largest_energy: float) -> tuple[float, bool]:
    """Hold Σ ω² |z|² of blocks below the largest; return Σ |z|², and whether anything has changed."""
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


@kernel
def trim(memory: np.ndarray, first: int, moving: int, silence: float, total: float) -> int:
    """Set the highest modes that are silent to 0, for good; return how many are left.

    Args:
        silence: share of the amplitude of all, whose square is `total`.
    """
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


@kernel
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
    """Advance x and y (batch, modes) in place; write the amplitudes out (batch, steps, modes).

    It takes what a model's step has in arrays and numbers of its own.

    Args:
        largest_energies: of Σ ω² |z|², (batch,), which fall by `decay` a frame, in place.
        largest_stretches: of S, (batch,).
        nodes: of a frame.
        silence: the highest modes rest from when their amplitude is below this share of that of all together.
        rows: (7, modes): λ's parts, h k A/ω, η² A, κ r/A, κ p and ω².
    """
    batch, steps, modes = out.shape
    memory = np.empty(lanes.slots(modes))
    order = np.arange(modes)
    nobody = np.empty(0)
    rest = (0.0, 0.0)
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


@kernel
def _nodes(voice: at.Voice, program: at.TensionProgram, kick: float) -> int:
    """The nodes in a frame for the modes that move, as `KoopmanTension.step`; `kick`: Σ η² k (q² + v²/ω²).

    With a javari they are a multiple of its steps.
    """
    last = voice.moving - 1
    squares, sigmas = row(voice, at.OMEGA_SQUARED), row(voice, at.SIGMA)
    first_rate = damped(squares[0], sigmas[0]) / program.node_phase
    fastest = max(first_rate, damped(squares[last], sigmas[last]) / program.highest_phase)
    fastest = min(max(fastest, math.sqrt(kick) / HARDEST_KICK), MOST_NODES * fastest)
    nodes, steps = max(1, math.ceil(fastest / program.rate_hz)), max(1, voice.javari.steps)
    return (nodes + steps - 1) // steps * steps


@kernel
def _needs_fewer_nodes(voice: at.Voice, program: at.TensionProgram) -> bool:
    """Return True if fewer nodes are enough: high modes have fallen silent since its rows were prepared."""
    if voice.steps == 1 or program.unheard > 0:
        return False
    voice.refresh -= 1
    if voice.refresh > 0:
        return False
    voice.refresh = FEWER_QUANTA
    (x, y), kick = motion(voice), 0.0
    couplings, stretches = row(voice, at.COUPLING), row(voice, at.STRETCH)
    for m in range(voice.moving):
        kick += stretches[m] * couplings[m] * (x[m] * x[m] + y[m] * y[m])
    return _nodes(voice, program, kick) < voice.steps


@kernel
def prepare(voice: at.Voice, program: at.TensionProgram, q: np.ndarray, v: np.ndarray) -> None:
    """Compute the rows (7, modes) of `advance` from a voice's modes, and the nodes of a frame.

    It is done as in `KoopmanTension.step`. The amplitudes q in m and speeds v in m/s, (modes,), set the nodes.
    """
    n, rate = voice.modes, program.rate_hz
    squares, sigmas = row(voice, at.OMEGA_SQUARED), row(voice, at.SIGMA)
    couplings, stretches = row(voice, at.COUPLING), row(voice, at.STRETCH)
    rows = following(voice)
    rest_above(voice, rate)
    highest, kick = program.highest_phase, 0.0
    for m in range(voice.moving):
        omega = damped(squares[m], sigmas[m])
        kick += stretches[m] * couplings[m] * (q[m] * q[m] + (v[m] / omega) ** 2)
    nodes, drum = _nodes(voice, program, kick), program.unheard > 0
    if voice.prepared and not drum:  # a glide leaves as many, so that one to the same modes changes nothing
        nodes = max(nodes, voice.steps)
    h, coefficients = 1 / (nodes * rate), program.coefficients
    curves, slowest = behind(program, BEHIND_PROGRAM, 3 * coefficients), np.inf
    for m in range(n):
        sigma, omega = sigmas[m], damped(squares[m], sigmas[m])
        slowest = min(slowest, sigma)
        phase = h * omega
        argument = min(max(2 * (phase / highest) ** 2 - 1, -1.0), 1.0)
        growth = r = p = 0.0
        now, before = 1.0, argument  # Chebyshev polynomials
        for degree in range(coefficients):
            growth += curves[degree] * now
            r += curves[coefficients + degree] * now
            p += curves[2 * coefficients + degree] * now
            now, before = (2 * argument * now - before, now)
        growth = min(max(1 + phase * phase * growth, 0.0), 2.0)
        r, p = min(max(r, -1.0), 1.0), min(max(p, -1.0), 1.0)
        kappa = h * h * couplings[m]
        angle = h * couplings[m] / omega
        shrunk = math.exp(-h * sigma)
        rows[0, m], rows[1, m] = shrunk * math.cos(phase), shrunk * math.sin(phase)
        rows[2, m], rows[3, m] = angle * growth, stretches[m] * growth
        rows[4, m] = kappa * r / growth if growth > 0.0 else 0.0
        rows[5, m], rows[6, m] = kappa * p, omega * omega
    voice.steps = nodes
    if drum or not voice.prepared:
        voice.refresh = 0 if drum else FEWER_QUANTA
    voice.decay = math.exp(-2 * slowest / rate)
    order = order_of(voice)
    for m in range(n):
        order[m] = m
    voice.heard = voice.felt = voice.moving
    voice.nodes = 0
    voice.stretched = 0.0
    voice.javari.give = 0.0


@kernel
def _turn(voice: at.Voice, mode: int, sign: float) -> None:
    """Turn a mode by the angle that it has swung through since the rows were prepared: forward (1) or back (-1).

    Modes that rest are kept without that angle. A kick K S x turns z by K S/2 on average.
    """
    if voice.nodes == 0:
        return
    x, y = motion(voice)
    rows = following(voice)
    angle = voice.nodes * math.atan2(rows[1, mode], rows[0, mode]) + 0.5 * rows[2, mode] * voice.stretched
    cosine, sine = math.cos(angle), sign * math.sin(angle)
    x[mode], y[mode] = cosine * x[mode] - sine * y[mode], sine * x[mode] + cosine * y[mode]


@kernel
def _fall(voice: at.Voice) -> None:
    """Let modes that rest, because nobody hears or feels them, decay by the quanta that they have rested."""
    frames = voice.rested * QUANTUM
    if frames == 0:
        return
    x, y = motion(voice)
    rows, order = following(voice), order_of(voice)
    steps = voice.steps * frames // 2  # a quantum is even
    for place in range(voice.felt, voice.moving):
        m = order[place]
        square = rows[0, m] * rows[0, m] + rows[1, m] * rows[1, m]
        left = 1.0
        power = steps
        while power > 0:  # square ** steps: of whole numbers in fewer steps than of any
            if power & 1:
                left *= square
            square *= square
            power >>= 1
        x[m] *= left
        y[m] *= left
    voice.rested = 0


@kernel
def _wake(voice: at.Voice) -> None:
    """Bring the modes that rest to the present; the next quantum chooses again which rest."""
    _fall(voice)
    order = order_of(voice)
    if voice.felt < voice.moving:
        voice.refresh = 0
    for place in range(voice.felt, voice.moving):
        _turn(voice, order[place], 1.0)
    voice.felt = voice.moving  # none rests


@kernel
def _look(voice: at.Voice, program: at.TensionProgram, sets: int, scratch: np.ndarray) -> None:
    """Order the modes of a drum: those that so many sets of weights hear, others that stretch it, those that rest.

    The highest that are silent are laid to rest for good. The scratch has room for three rows (modes,).
    """
    _fall(voice)
    moving = voice.moving
    x, y = motion(voice)
    rows, sigmas = following(voice), row(voice, at.SIGMA)
    stretches, order = rows[3], order_of(voice)
    # |z|² of each mode, and its largest share of the power at any point that is heard
    sizes, largest_shares = scratch[:moving], scratch[moving : 2 * moving]
    rested = scratch[2 * moving : 3 * moving]  # 1: it has rested until now; 0: not
    for place in range(moving):
        rested[order[place]] = 1.0 if place >= voice.felt else 0.0
    total = stretch = 0.0
    for m in range(moving):
        sizes[m], largest_shares[m] = x[m] * x[m] + y[m] * y[m], 0.0
        total += sizes[m]
        stretch += stretches[m] * sizes[m]
    for which in range(sets):
        for point in range(voice.points):
            w, loudness = weights(voice, which, point, 0), 0.0
            for m in range(moving):
                loudness += w[m] * w[m] * sizes[m]
            share = 1 / loudness if loudness > 0 else 0.0
            for m in range(moving):
                largest_shares[m] = max(largest_shares[m], share * w[m] * w[m] * sizes[m])
    while moving > 1 and sizes[moving - 1] < program.silence**2 * total + NOTHING:
        moving -= 1
        x[moving] = y[moving] = largest_shares[moving] = 0.0
        order[moving] = moving
    audible = program.unheard**2
    place = 0
    for m in range(moving):
        if largest_shares[m] > audible:
            order[place] = m
            place += 1
    voice.heard = place
    for m in range(moving):
        if largest_shares[m] <= audible and stretches[m] * sizes[m] > UNFELT * stretch:
            order[place] = m
            place += 1
    voice.felt, voice.moving = place, moving
    for felt in range(place):
        if rested[order[felt]] > 0.0:
            _turn(voice, order[felt], 1.0)
    rest = second = rate = 0.0
    for m in range(moving):
        if largest_shares[m] <= audible and not stretches[m] * sizes[m] > UNFELT * stretch:
            order[place] = m
            place += 1
            if not rested[m] > 0.0:
                _turn(voice, m, -1.0)
            rest += 0.5 * stretches[m] * sizes[m]
            second += 0.5 * stretches[m] * rows[4, m] * sizes[m]
            rate += stretches[m] * sizes[m] * sigmas[m]
    voice.rest_stretch, voice.rest_second = rest, second
    voice.rest_decay = math.exp(-rate / rest * QUANTUM / program.rate_hz) if rest > 0 else 0.0
    voice.refresh = LOOKS_QUANTA


@kernel
def _half_kick(rows: np.ndarray, x: np.ndarray, largest_stretch: float, y: np.ndarray, sign: float) -> None:
    """Apply half of the kick that `node` begins with to y (modes,) in place, forward (1) or back (-1)."""
    first = second = 0.0
    for m in range(len(x)):
        stretch = rows[3, m] * x[m] * x[m]
        first += stretch
        second += rows[4, m] * stretch
    first = min(first, largest_stretch)
    linear, squared = first * (1 - 2 * second), first * first
    for m in range(len(x)):
        y[m] += sign * 0.5 * rows[2, m] * (linear - rows[4, m] * squared) * x[m]


@kernel
def physical(voice: at.Voice, q: np.ndarray, v: np.ndarray) -> None:
    """Amplitudes in m and speeds in m/s, (modes,), of a voice as it is now: the inverse of `set_out`, to rounding."""
    n = voice.modes
    _wake(voice)
    x, y = motion(voice)
    rows = following(voice)
    sigmas, stretches = row(voice, at.SIGMA), row(voice, at.STRETCH)
    v[:] = y
    _half_kick(rows, x, voice.largest_stretch, v, 1.0)
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


@kernel
def set_out(voice: at.Voice, q: np.ndarray, v: np.ndarray, bounded: bool) -> None:
    """Write a voice's x and y, in which kicks act, half a kick before the first node, as `KoopmanTension._set_out`.

    Args:
        q, v: amplitudes in m and speeds in m/s, (modes,).
        bounded: the largest energy is there, and may only fall; else it is set.
    """
    n = voice.modes
    x, y = motion(voice)
    rows, sigmas = following(voice), row(voice, at.SIGMA)
    couplings, stretches = row(voice, at.COUPLING), row(voice, at.STRETCH)
    tension = held = energy = widest = 0.0
    for m in range(n):
        omega, square = math.sqrt(rows[6, m]), q[m] * q[m]
        tension += stretches[m] * square
        held += couplings[m] * square
        y[m] = -(v[m] + sigmas[m] * q[m]) / omega
        energy += rows[6, m] * (square + y[m] * y[m])
        widest = max(widest, stretches[m] / rows[6, m])
    largest = ENERGY_BOUND * (energy + 0.5 * tension * held)
    voice.largest_energy = min(voice.largest_energy, largest) if bounded else largest
    voice.largest_stretch = voice.largest_energy * widest
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
    _half_kick(rows, x, voice.largest_stretch, y, -1.0)


@kernel
def bring_up_to_date(voice: at.Voice, program: at.TensionProgram) -> None:
    """Bring up to date what follows from the modes, and the latents, where a voice begins or its modes change."""
    n = voice.modes
    fewer = voice.prepared and _needs_fewer_nodes(voice, program)
    if voice.prepared and not gliding(voice) and not fewer:
        return
    q, v = row(voice, at.PHYSICAL), row(voice, at.PHYSICAL + 1)
    squares = following(voice)[6]
    if voice.prepared:
        physical(voice, q, v)
        if fewer:
            voice.steps = 1  # or as many as are needed
        if gliding(voice):
            glide(voice)
        raised = 1.0  # by the work that raises the tension
        present, sigmas = row(voice, at.OMEGA_SQUARED), row(voice, at.SIGMA)
        for m in range(n):
            omega = damped(present[m], sigmas[m])
            raised = max(raised, omega * omega / squares[m])
        voice.largest_energy *= raised
    else:
        q[:], v[:] = row(voice, 0), row(voice, 1)
        if gliding(voice):
            glide(voice)
        if voice.javari.steps == 0:  # whose contact wakes them
            omega_squared = row(voice, at.OMEGA_SQUARED)
            voice.moving, _ = rest_silent(q, v, omega_squared, voice.moving, program.silence)
    prepare(voice, program, q, v)
    for m in range(voice.moving, n):
        q[m] = v[m] = 0.0
    set_out(voice, q, v, bool(voice.prepared))
    voice.prepared = 1


@kernel
def generate(
    voice: at.Voice, program: at.TensionProgram, fading: bool, audible: bool, out: np.ndarray, scratch: np.ndarray
) -> None:
    """Write the next quantum, (4, QUANTUM); frame 0 is the string at its release.

    Row 2 s + p is of the set s of weights at the point p; the second set is heard where `fading` to it.
    """
    bring_up_to_date(voice, program)
    nodes, points = voice.steps, voice.points
    rests, rest = program.unheard > 0, (0.0, 0.0)
    if not rests:
        voice.heard = voice.felt = voice.moving
    elif fading or voice.refresh == 0:
        _look(voice, program, 2 if fading else 1, scratch)
    if rests:
        rest = (voice.rest_stretch, voice.rest_second)
    x, y = motion(voice)
    order = order_of(voice)
    loud, quiet = order[: voice.heard], order[voice.heard : voice.felt]
    first = lanes.aligned(scratch)
    near = lanes.blocks_of(len(loud))
    far = lanes.blocks_of(len(quiet))
    ear_sums, behind = scratch[first + lanes.slots(voice.modes) :][: 2 * lanes.MOST_EARS], first + near * lanes.BLOCK
    ears = take(voice, loud, fading, audible, scratch, first)
    load(x, y, following(voice), quiet, scratch, behind)
    moving = len(loud)
    total = 0.0
    apart = 2 if points == 1 else 1  # rows of `out` from ear to ear
    largest = voice.largest_stretch
    stretched = QUANTUM * nodes * rest[0]
    sums = lanes.add_up(scratch, first, near, far, ears, ear_sums)
    for frame in range(QUANTUM):
        for ear in range(ears):
            out[apart * ear, frame] = ear_sums[2 * ear] - (sums[0] + rest[0]) * ear_sums[2 * ear + 1]
        stretched += sums[0]
        for _ in range(nodes - 1):
            sums = node(scratch, first, near, far, 0, sums, rest, largest, ear_sums)
            stretched += sums[0]
        sums = node(scratch, first, near, far, ears, sums, rest, largest, ear_sums)
        voice.largest_energy *= voice.decay
        if frame % 16 == 15:
            total, held = hold(scratch, first, near + far, voice.largest_energy)
            before = moving
            if not rests:
                moving = trim(scratch, first, moving, program.silence, total)
                near = lanes.blocks_of(moving)
            if held or moving < before or total < NOTHING:
                sums = lanes.add_up(scratch, first, near, far, ears, ear_sums)
    save(x, y, loud, scratch, first)
    save(x, y, quiet, scratch, behind)
    if rests:
        voice.refresh -= 1
        voice.rested += 1
        voice.nodes += QUANTUM * nodes
        voice.stretched += stretched
        voice.rest_stretch *= voice.rest_decay
        voice.rest_second *= voice.rest_decay
    else:
        voice.moving = moving
    voice.generated += QUANTUM
    voice.loudness = (0.5 * math.log(total) if total > 0 else -1e9) + program.loudness
