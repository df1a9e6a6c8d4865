"""The javari of tanpura and sitar: a string that meets the edge of its bridge, near its end, and buzzes.

The bridge is wide: on a tanpura the string lies on a cotton thread, its end, and some millimetres further on the
bridge's edge is hardly below it. That edge pushes from one side, an elastic support with a loss (K. H. Hunt and
F. R. E. Crossley, J. Appl. Mech. 42, 1975), on all modes that move there, of the direction normal to the board:

    q̈_n = … + φ_n F/m,    F = K d (1 + β ḋ) where d = -y - gap > 0, else 0,    y = Σ φ_n q_n,

φ_n = sin(nπ a/ℓ), m = ρAℓ/2. Such a two-point bridge was found to give the tanpura's sound (C. Valette, C. Cuesta,
"Mécanique de la corde vibrante", 1993; C. Issanchou et al., "A modal-based approach to the nonlinear vibration of
strings against a unilateral obstacle", JSV 393, 2017; M. van Walstijn, J. Bridges, S. Mehes, "A real-time synthesis
oriented tanpura model", DAFx-16). A curved bridge, as the sitar's, is one such edge too, which is an approximation.

A frame has steps, h, and within one F is constant: the linear string's answer to that is exact, and its only unknown
is d at the step's end. With d₀ and d₁ at both ends and V(d) = ½K max(d, 0)², F is the discrete gradient

    F = (V(d₁) - V(d₀))/(d₁ - d₀) · (1 + β (d₁ - d₀)/h),    d₁ = d_free - G F,    G = Σ φ_n² (1 - c_n)/(m ω_n²),

c_n being what is left of an amplitude after h. That is a quadratic equation in each case, and it has one solution,
for F does not fall with d₁. The second factor is left out in the step in which the string arrives.

Nothing rings up. A constant force does the work F (y₁ - y₀) = -F (d₁ - d₀) on the string, which loses its own in
addition. So the energy of string and edge together changes by -F (d₁ - d₀) + V(d₁) - V(d₀) =
-(V(d₁) - V(d₀)) (d₁ - d₀) β/h: never up, for V rises with d, and exactly so for any h. The tension's kicks stand
between these steps as they do without. A gap that is turned while string and edge touch does work as the hand does.

Model and truth have the same steps, so that they differ by the tension alone. Steps are as many as keep the contact's
phase, √(K Σ φ_n²/m) h, below `PHASE`, and K is no larger than `MOST_STEPS` resolve. Against many more steps a second
of sound of the factory's instruments is then wrong by 4e-4 … 2e-3 of its energy: in phases of high modes.

The edge is where it was on the string as it was struck: bends and knobs change the modes' frequencies alone.
"""

from __future__ import annotations

import math

import numpy as np

from engine.kernels import constants as of
from engine.kernels import lanes, strings, tension, truth
from engine.kernels import voice_records as at
from engine.kernels.compiled import kernel
from engine.kernels.memory import tension_program_at, truth_program_at
from engine.kernels.modes import damped, following, motion, row
from engine.kernels.rotation import rotation

PHASE, MOST_STEPS = 0.15, 6  # rad of the contact in a step, steps of a frame


@kernel
def fit(voice: at.Voice, string: np.ndarray, pairs: int, edge: np.ndarray, rate_hz: float) -> None:
    """Give a voice that has not begun an edge of its bridge.

    Args:
        string, pairs: as of `strings.rows`.
        edge: its distance from the end in m, stiffness in N/m and loss in s/m.
    """
    n, total = voice.modes, 0.0
    shapes = row(voice, at.JAVARI)
    for mode in range(n):
        along = strings.direction_of(mode, pairs) == 1
        turn = math.pi * strings.partial_of(mode, pairs) * edge[0] / string[of.LENGTH]
        shapes[mode] = 0.0 if along else math.sin(turn)
        total += shapes[mode] * shapes[mode]
    mass, resolved = 0.5 * strings.mass(string) * string[of.LENGTH], PHASE * rate_hz
    steps = math.ceil(math.sqrt(edge[1] * total / mass) / resolved)
    voice.javari.steps = min(max(steps, 1), MOST_STEPS)
    voice.javari.stiffness = min(edge[1], (resolved * voice.javari.steps) ** 2 * mass / total)
    voice.javari.loss, voice.javari.mass_kg = edge[2], mass


@kernel
def force(before: float, free: float, give: float, stiffness: float, loss: float) -> float:
    """The force of the edge within a step, in N.

    Args:
        before, free: d at its begin, and as it would be at its end without a force.
        give: G.
        loss: β/h.
    """
    half, moved = 0.5 * stiffness * give, free - before
    lost = half * loss
    if before > 0.0:
        if moved < before * (half - 1 - lost * before):  # it leaves
            b = moved + lost * before * before
            return (moved + 0.5 * (math.sqrt(b * b + 4 * half * before * before) - b)) / give
        b, c = 1 + half + 2 * lost * before, 2 * half * before - moved
        return (moved + 2 * c / (b + math.sqrt(max(b * b - 4 * lost * c, 0.0)))) / give
    if free <= 0.0:
        return 0.0
    a, b = 1 + half, moved - 2 * half * before
    return (moved - (b + math.sqrt(max(b * b - 4 * a * half * before * before, 0.0))) / (2 * a)) / give


@kernel
def generate(voice: at.Voice, fading: bool, audible: bool, out: np.ndarray, scratch: np.ndarray) -> None:
    """Write the next quantum, (4, QUANTUM), of a string with an edge, as `generate` of `tension` and `truth` does."""
    if voice.kind == at.TRUTH:
        _ring_solved(voice, truth_program_at(voice.program), fading, audible, out)
    else:
        _ring(voice, tension_program_at(voice.program), fading, audible, out, scratch)
    first, second = motion(voice)
    for mode in range(voice.modes):  # or they would become denormal
        if first[mode] * first[mode] < tension.NOTHING:
            first[mode] = 0.0
        if second[mode] * second[mode] < tension.NOTHING:
            second[mode] = 0.0
    voice.generated += of.QUANTUM


@kernel
def _prepare(voice: at.Voice, step_s: float) -> None:
    """Compute what a force of 1 N at the edge changes within a step, for a string whose modes are new.

    Rows GIVEN and GIVEN_SPEED: of each mode's amplitude and speed; `javari.give`: of the displacement at the edge.
    """
    shapes, give = row(voice, at.JAVARI), 0.0
    compliance, speeds = row(voice, at.GIVEN), row(voice, at.GIVEN_SPEED)
    squares, sigmas = row(voice, at.OMEGA_SQUARED), row(voice, at.SIGMA)
    for mode in range(voice.modes):
        sigma = sigmas[mode]
        omega, part = damped(squares[mode], sigma), shapes[mode] / voice.javari.mass_kg
        left, moved, _, _ = rotation(sigma, omega, step_s)
        compliance[mode], speeds[mode] = part * (1 - left) / (omega * omega + sigma * sigma), part * moved
        give += shapes[mode] * compliance[mode]
    voice.javari.give = give


@kernel
def _ring(
    voice: at.Voice, program: at.TensionProgram, fading: bool, audible: bool, out: np.ndarray, scratch: np.ndarray
) -> None:
    """Write a quantum of latents that share a tension, with the edge's force in each of a frame's steps."""
    tension.bring_up_to_date(voice, program)
    moving, steps = voice.moving, voice.javari.steps
    step_s, nodes = 1 / (program.rate_hz * steps), voice.steps // steps
    if voice.javari.give == 0.0:
        _prepare(voice, step_s)
    voice.heard = voice.felt = moving
    rows, order = following(voice), tension.order_of(voice)[:moving]
    first, near = lanes.aligned(scratch), lanes.blocks_of(moving)
    ears = tension.take(voice, order, fading, audible, scratch, first)
    parts = first + lanes.slots(voice.modes)
    ear_sums = scratch[parts + lanes.PRESSED * lanes.LANES * near :][: 2 * lanes.MOST_EARS]
    for number in range(lanes.LANES * near):
        slot = parts + number // lanes.LANES * lanes.PRESSED * lanes.LANES + number % lanes.LANES
        for pressed in range(lanes.PRESSED):
            scratch[slot + pressed * lanes.LANES] = 0.0
        if number < moving:
            compliance, speed = row(voice, at.GIVEN)[number], row(voice, at.GIVEN_SPEED)[number]
            scratch[slot], scratch[slot + lanes.LANES] = row(voice, at.JAVARI)[number], compliance
            speed += row(voice, at.SIGMA)[number] * compliance
            scratch[slot + 2 * lanes.LANES] = -speed / math.sqrt(rows[6, number])  # v = -(ω y + σ x)
    largest, apart = voice.largest_stretch, 2 if voice.points == 1 else 1
    nothing, total = (0.0, 0.0), 0.0
    gap = voice.javari.gap_m
    give = voice.javari.give
    pushed = voice.javari.force  # N: mean force of the frame before
    sums = lanes.add_up(scratch, first, near, 0, ears, ear_sums)
    moved = lanes.felt(scratch, near, first, parts)
    # d of the module: how far the string is beyond the edge, in m; below 0: it does not touch
    before = sums[0] * moved[1] - moved[0] - gap
    for frame in range(of.QUANTUM):
        for ear in range(ears):
            out[apart * ear, frame] = ear_sums[2 * ear] - sums[0] * ear_sums[2 * ear + 1]
            out[apart * ear, frame] -= voice.javari.heard * pushed
        pushed = 0.0
        for step in range(steps):
            hearing = ears if step == steps - 1 else 0
            for _ in range(nodes - 1):
                sums = tension.node(scratch, first, near, 0, 0, sums, nothing, largest, ear_sums)
            sums = tension.node(scratch, first, near, 0, hearing, sums, nothing, largest, ear_sums)
            moved = lanes.felt(scratch, near, first, parts)
            free = sums[0] * moved[1] - moved[0] - gap
            if before > 0.0 or free > 0.0:
                push = force(before, free, give, voice.javari.stiffness, voice.javari.loss / step_s)
                sums = lanes.press(scratch, near, first, parts, push)
                if hearing > 0:
                    sums = lanes.add_up(scratch, first, near, 0, hearing, ear_sums)
                free -= give * push
                pushed += push / steps
            before = free
        voice.largest_energy *= voice.decay
        if frame % 16 == 15:
            total, held = tension.hold(scratch, first, near, voice.largest_energy)
            if held:
                sums = lanes.add_up(scratch, first, near, 0, ears, ear_sums)
    x, y = motion(voice)
    tension.save(x, y, order, scratch, first)
    voice.javari.force = pushed
    voice.loudness = (0.5 * math.log(total) if total > 0 else -1e9) + program.loudness


@kernel
def _ring_solved(voice: at.Voice, program: at.TruthProgram, fading: bool, audible: bool, out: np.ndarray) -> None:
    """Write a quantum of a string that is solved, with the edge's force in each of a frame's steps."""
    sub_steps = truth.set_up(voice, program)
    steps = voice.javari.steps
    step_s = 1 / (program.rate_hz * steps)
    if voice.javari.give == 0.0:
        _prepare(voice, step_s)
    gap = voice.javari.gap_m
    give = voice.javari.give
    moving = voice.moving
    q, v = motion(voice)
    shapes = row(voice, at.JAVARI)
    compliance, speeds = row(voice, at.GIVEN), row(voice, at.GIVEN_SPEED)
    # d of the module, how far the string is beyond the edge, in m; and the mean force of the frame before, in N
    before, pushed = -gap, voice.javari.force
    for mode in range(moving):
        before -= shapes[mode] * q[mode]
    for frame in range(of.QUANTUM):
        truth.hear(voice, program, frame, fading, audible, out)
        for which in range((2 if fading else 1) if audible else 0):
            for point in range(voice.points):
                out[2 * which + point, frame] -= voice.javari.heard * pushed
        pushed = 0.0
        for _ in range(steps):
            truth.ring(voice, program, sub_steps, sub_steps // steps)
            free = -gap
            for mode in range(moving):
                free -= shapes[mode] * q[mode]
            if before > 0.0 or free > 0.0:
                push = force(before, free, give, voice.javari.stiffness, voice.javari.loss / step_s)
                for mode in range(moving):
                    q[mode] += compliance[mode] * push
                    v[mode] += speeds[mode] * push
                free -= give * push
                pushed += push / steps
            before = free
    voice.javari.force = pushed
