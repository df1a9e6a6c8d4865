"""The compiled parts of `slow_flow`: coefficients of the averaged Hamiltonian, its flow, the way back to amplitudes.

Symbols as there. All of it is a function of z = √I e^{iθ}, apart in real and imaginary parts, and of the mean stretch
S̄, on which every coefficient depends smoothly and alone.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from engine.kernels.compiled import COMPILED

Array = NDArray[np.float64]
Triads = NDArray[np.int32]

DEAD_NEPERS = 700.0  # of a mode's decay: what it is made louder by stays a number
NEWTON_STEPS = 12  # at most; S̄ is a concave equation of one unknown, three or four suffice
STRONG = 1e-5  # of a triad's effect, as `slow_flow.NEGLIGIBLE` counts it: from here on its third order is there, too
HORIZON_S = 1.0  # time in which what a triad does adds up, if its phase does not turn before
MOST_STRONG = 2000  # triads
LOUDEST = 20  # modes, of which quartets are looked for
MOST_QUARTETS = 2000
NODES_A_CHOICE = 16  # between two choices of the modes and triads that still count
NODES_A_QUARTETS_CHOICE = 64


@njit(**COMPILED)
def mean_stretch(actions: Array, frequencies: Array, stiffening: Array, stretch: Array, guess: float) -> float:
    """S̄ = Σ η² I/√(ω² + c η² S̄) by Newton's method from a guess."""
    for _ in range(NEWTON_STEPS):
        found = slope = 0.0
        for n in range(len(actions)):
            raised = 1 / math.sqrt(frequencies[n] * frequencies[n] + stiffening[n] * guess)
            share = stretch[n] * actions[n] * raised
            found += share
            slope += 0.5 * share * stiffening[n] * raised * raised
        change = (found - guess) / (1 + slope)
        guess += change
        if abs(change) <= 1e-14 * guess:
            break
    return guess


@njit(**COMPILED)
def raise_frequencies(
    s: float, frequencies: Array, stiffening: Array, stretch: Array, raised: Array, b: Array, v: Array
) -> None:
    """Writes Ω, b = η²/Ω (modes,) and V_mn = 1/(Ω_m² - Ω_n²) with a zero diagonal (modes, modes)."""
    modes = len(raised)
    for n in range(modes):
        raised[n] = math.sqrt(frequencies[n] * frequencies[n] + stiffening[n] * s)
        b[n] = stretch[n] / raised[n]
    for m in range(modes):
        own = raised[m] * raised[m]
        for n in range(modes):
            v[m, n] = 1 / (own - raised[n] * raised[n]) if m != n else 0.0


@njit(**COMPILED)
def weigh_triads(triads: Triads, c: float, raised: Array, b: Array, tau: Array) -> None:
    """τ of 2τ Re(z_j² z_k² z̄_l²), (triads,)."""
    for i in range(len(triads)):
        j, k, last = triads[i, 0], triads[i, 1], triads[i, 2]
        oj, ok, ol = raised[j], raised[k], raised[last]
        bj, bk, bl = b[j], b[k], b[last]
        sums = (bj + bk) / ol - (bj - bl) / ok - (bk - bl) / oj
        tau[i] = -(c * c / 32) * bj * bk * bl * sums * (0.5 if j == k else 1.0)


@njit(**COMPILED)
def exponents(
    re: Array, im: Array, c: float, raised: Array, b: Array, v: Array, growth: Array, turn: Array, work: Array
) -> None:
    """∂χ/∂I as `turn` and -∂χ/∂θ / 2I as `growth`, of which the first order of a period's swing is made: (modes,)."""
    modes = len(re)
    x, y = work[0], work[1]
    for n in range(modes):
        x[n] = b[n] * (re[n] * re[n] - im[n] * im[n])
        y[n] = b[n] * (2 * re[n] * im[n]) * raised[n]
    for n in range(modes):
        row = v[n]
        t = u = 0.0
        for m in range(modes):
            t += row[m] * x[m]
            u -= row[m] * y[m]
        t *= raised[n]
        action = re[n] * re[n] + im[n] * im[n] + 1e-300
        cosine = (re[n] * re[n] - im[n] * im[n]) / action
        sine = 2 * re[n] * im[n] / action
        half = c / 4 * b[n]
        own = c / 16 * b[n] * b[n] * action / raised[n]
        growth[n] = -half * (t * cosine - u * sine) - own * (cosine * cosine - sine * sine)
        turn[n] = half * (t * sine + u * cosine) + own * 2 * sine * cosine


@njit(**COMPILED)
def read(
    re: Array,
    im: Array,
    c: float,
    frequencies: Array,
    stiffening: Array,
    stretch: Array,
    s: float,
    raised: Array,
    b: Array,
    v: Array,
    work: Array,
    out: Array,
) -> None:
    """Modal amplitudes of z, with coefficients at the mean stretch s; work (6, modes)."""
    modes = len(re)
    growth, turn, actions, swing = work[2], work[3], work[4], work[5]
    exponents(re, im, c, raised, b, v, growth, turn, work)
    for n in range(modes):
        gain = math.exp(growth[n])
        cosine, sine = gain * math.cos(turn[n]), gain * math.sin(turn[n])
        p, q = re[n] * cosine - im[n] * sine, re[n] * sine + im[n] * cosine
        growth[n], turn[n] = p, q
        actions[n] = p * p + q * q
    s = mean_stretch(actions, frequencies, stiffening, stretch, s)
    total = slope = 0.0
    for n in range(modes):
        own = 1 / math.sqrt(frequencies[n] * frequencies[n] + stiffening[n] * s)
        swing[n] = own
        total += stretch[n] * own * own * 2 * growth[n] * turn[n]
        slope += 0.5 * stretch[n] * actions[n] * own * stiffening[n] * own * own
    total *= c / 4 / (1 + slope)
    for n in range(modes):
        own = swing[n]
        angle = total * stretch[n] * own
        out[n] = math.sqrt(2 * own) * (growth[n] * math.cos(angle) - turn[n] * math.sin(angle))


@njit(**COMPILED)
def velocities(
    re: Array,
    im: Array,
    c: float,
    frequencies: Array,
    stiffening: Array,
    stretch: Array,
    s: float,
    v: Array,
    triads: Triads,
    tau: Array,
    chosen: NDArray[np.int64],
    count: int,
    strong: int,
    kappa: Array,
    quartets: NDArray[np.int64],
    signs: Array,
    of_quartets: Array,
    quartet_count: int,
    speed: Array,
    pull: Array,
    work: Array,
) -> float:
    """Writes ∂(K₀ + K₁ + K₂)/∂I as `speed` (modes,), and g of żₙ = i g z̄ₙ that triads add (2, modes); returns S̄."""
    modes = len(re)
    a, raised, b, squares = work[0], work[1], work[2], work[3]
    for n in range(modes):
        a[n] = re[n] * re[n] + im[n] * im[n]
    s = mean_stretch(a, frequencies, stiffening, stretch, s)
    slope = through = 0.0
    for n in range(modes):
        raised[n] = math.sqrt(frequencies[n] * frequencies[n] + stiffening[n] * s)
        b[n] = stretch[n] / raised[n]
        a[n] *= b[n]
        squares[n] = a[n] * a[n]
        slope += 0.5 * c * a[n] * b[n] / raised[n]
        through -= c * c / 8 * squares[n] * b[n] / raised[n]
    deep = 0.0
    for n in range(modes):
        row = v[n]
        one = two = three = 0.0
        for m in range(modes):  # Σ_m W_nm a_m² and Σ_m W_mn a_m, W_mn = 2η_m² V_mn
            one += row[m] * squares[m]
            two -= row[m] * a[m] * stretch[m]
            three += row[m] * row[m] * a[m] * stretch[m] * (stretch[m] - stretch[n])
        second = 3 * squares[n] * b[n] / raised[n] + 4 * stretch[n] * one + 8 * a[n] * two
        deep -= a[n] * b[n] / (2 * raised[n]) * second + squares[n] * (
            a[n] * b[n] / (raised[n] * raised[n]) * b[n] + 4 * three
        )
        speed[n] = raised[n] + b[n] * (c / 4 * a[n] - c * c / 64 * second)
    through = (through - c * c * c / 64 * deep) / (1 + slope)
    for n in range(modes):
        speed[n] += b[n] * through
    if count > 0:
        sx, sy = work[4], work[5]
        for n in range(modes):
            sx[n] = re[n] * re[n] - im[n] * im[n]
            sy[n] = 2 * re[n] * im[n]
            pull[0, n] = pull[1, n] = 0.0
        for i in range(count):
            of = chosen[i]
            j, k, last = triads[of, 0], triads[of, 1], triads[of, 2]
            w = 2 * tau[of]
            if i < strong:
                for m in range(modes):
                    w += 2 * kappa[i, m] * a[m]
            jx, jy, kx, ky, lx, ly = w * sx[j], w * sy[j], sx[k], sy[k], sx[last], sy[last]
            pull[0, last] += jx * kx - jy * ky
            pull[1, last] += jx * ky + jy * kx
            pull[0, k] += jx * lx + jy * ly
            pull[1, k] += jx * ly - jy * lx
            pull[0, j] += w * (kx * lx + ky * ly)
            pull[1, j] += w * (kx * ly - ky * lx)
            if i < strong:
                product = 2 * ((sx[j] * kx - sy[j] * ky) * lx + (sx[j] * ky + sy[j] * kx) * ly)
                for m in range(modes):
                    speed[m] += b[m] * kappa[i, m] * product
        whole = level = energy = 0.0
        for n in range(modes):
            whole += a[n]
            level += a[n] * b[n] / raised[n]
            energy += (pull[0, n] * sx[n] + pull[1, n] * sy[n]) / 3
        through = -2.5 * c * level / (whole + 1e-300) * energy / (1 + slope)
        for n in range(modes):
            speed[n] += b[n] * through
        pull_quartets(sx, sy, quartets, signs, of_quartets, quartet_count, pull)
    return s


@njit(**COMPILED)
def third_order(re: Array, im: Array, c: float, raised: Array, b: Array, v: Array, speed: Array) -> None:
    """Writes ∂K₃/∂I with S̄ held, (modes,)."""
    modes = len(re)
    a, q, s = np.empty(modes), np.empty(modes), np.empty(modes)
    sums = np.zeros((7, modes))
    r, u, ks, ksq, mq, ms, eq = sums[0], sums[1], sums[2], sums[3], sums[4], sums[5], sums[6]
    for n in range(modes):
        a[n] = b[n] * (re[n] * re[n] + im[n] * im[n])
        q[n] = a[n] * a[n]
        s[n] = a[n] * b[n]
    for m in range(modes):
        om, bm = raised[m], b[m]
        for n in range(modes):
            on, bn = raised[n], b[n]
            if m == n:
                one = two = 0.25 / om
                of_x, of_y = -bm / (2 * om), bm / (2 * om)
            else:
                one, two = om * v[m, n], on * v[n, m]  # R_mn, R_nm
                of_x, of_y = -(bm * one + bn * two), bn * one + bm * two
            r[m] += two * s[n]
            u[m] += one * q[n]
            ks[m] += one * two * s[n]
            ksq[m] += one * two * s[n] * q[n]
            mq[m] += (7 / 6 * one * one + 0.5 * two * two) * q[n]
            ms[m] += (7 / 6 * two * two + 0.5 * one * one) * s[n] * s[n]
            own, other = bm / om, bn / on
            form = of_x * of_x + of_y * of_y + 4 / 3 * own * other
            form -= 4 / 3 * of_x * (own + other) + 2 / 3 * of_y * (bm / on + bn / om)
            eq[m] += 0.5 * form * q[n]
    of_r, of_u = np.empty(modes), np.empty(modes)
    for n in range(modes):
        of_r[n] = 4 / 3 * s[n] * u[n] + 8 / 3 * q[n] * r[n]
        of_u[n] = 4 / 3 * s[n] * r[n] + 1 / 6 * s[n] * s[n] / raised[n]
    cube = (c / 4) ** 3
    for m in range(modes):
        rho = 0.25 / raised[m]
        of_s = 4 / 3 * u[m] * (r[m] + rho * s[m]) + 2 * s[m] * mq[m]
        of_s += 2 / 3 * (ksq[m] + q[m] * ks[m]) - 4 / 3 * rho * rho * s[m] * q[m]
        of_q = 4 / 3 * r[m] * r[m] + ms[m] + 2 / 3 * s[m] * ks[m] - 2 / 3 * rho * rho * s[m] * s[m]
        of_q += 2 * eq[m] - 5 / 4 * q[m] * (b[m] / raised[m]) ** 2
        for n in range(modes):
            one, two = (raised[m] * v[m, n], raised[n] * v[n, m]) if m != n else (rho, rho)
            of_s += one * of_r[n]
            of_q += two * of_u[n]
        speed[m] = cube * b[m] * (b[m] * of_s + 2 * a[m] * of_q)
    whole = level = slope = energy = 0.0
    for n in range(modes):
        beta = b[n] / raised[n]
        whole += a[n]
        level += a[n] * beta
        slope += 0.5 * c * a[n] * beta
        energy += 0.25 * speed[n] * a[n] / b[n]
    through = -4 * c * level / (whole + 1e-300) * energy / (1 + slope)
    for n in range(modes):
        speed[n] += b[n] * through


@njit(**COMPILED)
def third_order_triad(
    triad: NDArray[np.int32], c: float, raised: Array, b: Array, r: Array, x: Array, y: Array, w: Array, found: Array
) -> None:
    """Writes κ_m of a triad's third order, 2 Σ κ_m a_m Re(z_j² z_k² z̄_l²), (modes,), from `pair_matrices`."""
    modes = len(raised)
    scale = (c / 4) ** 3 * b[triad[0]] * b[triad[1]] * b[triad[2]] * (0.5 if triad[0] == triad[1] else 1.0)
    for m in range(modes):
        found[m] = 0.0
    for turn in range(3):
        p, q, t = triad[turn], triad[(turn + 1) % 3], triad[(turn + 2) % 3]
        of_p, of_q, of_t = (-1.0 if turn == 2 else 1.0), (-1.0 if turn == 1 else 1.0), (-1.0 if turn == 0 else 1.0)
        signs = of_q * of_t
        one = x[q, t] - signs * y[q, t]
        two = x[q, t] - signs * w[q, t]
        for m in range(modes):
            bm = b[m]
            of_c = -4 / 3 * bm * (r[m, p] + 1 / raised[m])
            value = 0.25 * of_c * one - bm * r[m, p] / 3 * two
            value -= bm / 3 * (x[q, m] * r[m, t] + r[m, q] * x[m, t])
            value -= bm / 3 * signs * (w[q, m] * r[t, m] + r[q, m] * w[m, t])
            of_x = -2 / 3 * bm * (r[m, q] + r[m, t])
            value += 0.5 * of_p * (of_t * b[t] + of_q * b[q]) * of_x / raised[p]
            found[m] += value
        found[p] -= 0.25 / 3 * b[p] / raised[p] * one
        for first in range(2):  # what is left of G and L where the third is q or t itself
            u, v, of_v = (q, t, of_t) if first == 0 else (t, q, of_q)
            factor = -0.5 * of_v * of_p / raised[p] / 6
            found[v] += factor * b[v] * (b[u] * r[u, v] + b[v] * r[v, u])
            found[u] += factor * b[u] * (b[u] * r[v, u] + b[v] * r[u, v])
    for m in range(modes):
        found[m] *= scale


@njit(**COMPILED)
def pair_matrices(raised: Array, b: Array, v: Array, r: Array, x: Array, y: Array, w: Array) -> None:
    """Writes R of χ = (c/4) Σ R_mn Y_m X_n, x, y of {S̄, χ} ~ Σ x_mn X_m X_n + Σ y_mn Y_m Y_n, and w = y - 2bYY/Ω."""
    modes = len(raised)
    for m in range(modes):
        for n in range(modes):
            r[m, n] = raised[m] * v[m, n] if m != n else 0.25 / raised[m]
    for m in range(modes):
        for n in range(modes):
            x[m, n] = -(b[m] * r[m, n] + b[n] * r[n, m])
            y[m, n] = b[n] * r[m, n] + b[m] * r[n, m]
            w[m, n] = y[m, n] - b[m] / raised[n] - b[n] / raised[m]


@njit(**COMPILED)
def weigh_quartet(
    modes: NDArray[np.int64], signs: Array, c: float, raised: Array, b: Array, r: Array, x: Array, y: Array, w: Array
) -> float:
    """τ of 2τ Re Π z² of four modes, some of them conjugated (sign -1), in third order."""
    total = 0.0
    for p in range(4):
        for q in range(4):
            if q == p:
                continue
            for t in range(4):
                if t in (p, q):
                    continue
                u = 6 - p - q - t
                i, j, k, n = modes[p], modes[q], modes[t], modes[u]
                ij, jk, kn, ni = signs[p] * signs[q], signs[q] * signs[t], signs[t] * signs[u], signs[u] * signs[p]
                of_kn = x[k, n] - kn * y[k, n]
                value = (x[i, j] - ij * y[i, j]) * of_kn
                value += 4 / 3 * (ij * b[i] / raised[j] - b[j] / raised[j]) * of_kn
                value += 4 / 3 * ni * b[i] / raised[n] * (x[j, k] - jk * w[j, k])
                value -= 8 / 3 * kn / raised[n] * (b[j] * w[j, k] - x[j, k] * b[k])
                form = -2 / 3 * (r[i, j] + r[i, k])
                if i == j:
                    form -= (r[j, k] + jk * r[k, j]) / 6
                if i == k:
                    form -= (r[k, j] + jk * r[j, k]) / 6
                value -= 2 * b[i] * b[i] * (r[i, n] + ni * r[n, i]) * form
                total += value
    equal = 0
    for p in range(4):
        for q in range(p):
            equal += modes[p] == modes[q]
    many = 1.0 if equal == 0 else 0.5 if equal == 1 else 1 / 6
    return (c / 4) ** 3 * total / 16 * many * b[modes[0]] * b[modes[1]] * b[modes[2]] * b[modes[3]]


@njit(**COMPILED)
def choose_quartets(
    actions: Array,
    c: float,
    raised: Array,
    b: Array,
    matrices: Array,
    negligible: float,
    quartets: NDArray[np.int64],
    signs: Array,
    tau: Array,
) -> int:
    """Writes which quartets of the loudest modes count, j + k = l + m and j + k + l = m; returns how many."""
    modes = len(actions)
    squares = np.empty(modes)
    for n in range(modes):
        squares[n] = actions[n] / raised[n]
    whole = squares.sum()
    loudest = np.sort(np.argsort(-squares)[:LOUDEST])
    r, x, y, w = matrices[0], matrices[1], matrices[2], matrices[3]
    members, of, sign = len(loudest), np.empty(4, np.int64), np.ones(4)
    sign[3] = -1.0
    count = 0
    for i in range(members):
        for j in range(i, members):
            for k in range(members):
                for n in range(members):
                    of[0], of[1], of[2], of[3] = loudest[i], loudest[j], loudest[k], loudest[n]
                    for kind in range(2):
                        sign[2] = 1.0 if kind == 0 else -1.0
                        if kind == 0 and (k < j or n in (i, j, k)):
                            continue
                        if kind == 1 and (k > n or k in (i, j) or n in (i, j) or k < i):
                            continue
                        detuning = raised[of[0]] + raised[of[1]] + sign[2] * raised[of[2]] - raised[of[3]]
                        if abs(detuning) >= raised[0] or count == len(tau):
                            continue
                        product, least = 1.0, whole
                        for e in range(4):
                            product *= actions[of[e]]
                            least = min(least, squares[of[e]])
                        strength = weigh_quartet(of, sign, c, raised, b, r, x, y, w)
                        time_s = min(HORIZON_S, 0.5 / (abs(detuning) + 1e-300))
                        effect = (
                            2 * abs(strength) * product * time_s / (raised[0] * math.sqrt(least * whole) + 1e-300)
                        )
                        if effect > negligible:
                            quartets[count], signs[count], tau[count] = of, sign, strength
                            count += 1
    return count


@njit(**COMPILED)
def pull_quartets(
    sx: Array, sy: Array, quartets: NDArray[np.int64], signs: Array, tau: Array, count: int, pull: Array
) -> None:
    """Adds g of żₙ = i g z̄ₙ of the first `count` quartets, for z² in real and imaginary parts."""
    for i in range(count):
        for own in range(4):
            re, im = 2 * tau[i], 0.0
            for e in range(4):
                if e != own:
                    p, q = sx[quartets[i, e]], signs[i, e] * sy[quartets[i, e]]
                    re, im = re * p - im * q, re * q + im * p
            pull[0, quartets[i, own]] += re
            pull[1, quartets[i, own]] -= signs[i, own] * im


@njit(**COMPILED)
def choose(
    triads: Triads,
    tau: Array,
    actions: Array,
    raised: Array,
    negligible: float,
    chosen: NDArray[np.int64],
    kappa: Array,
) -> tuple[int, int]:
    """Writes which triads among the modes that move count in the time to come; returns how many."""
    modes = len(actions)
    whole = 0.0
    for n in range(modes):
        whole += actions[n] / raised[n]
    count = strong = 0
    for i in range(len(triads)):
        j, k, last = triads[i, 0], triads[i, 1], triads[i, 2]
        if last >= modes or j >= modes or k >= modes:
            continue
        ij, ik, il = actions[j], actions[k], actions[last]
        least = min(ij / raised[j], ik / raised[k], il / raised[last]) + 1e-300
        detuning = 2 * abs(raised[j] + raised[k] - raised[last])
        time_s = min(HORIZON_S, 1 / (detuning + 1e-300))
        effect = 2 * abs(tau[i]) * ij * ik * il * time_s / (raised[j] * math.sqrt(least * whole))
        if effect > negligible:
            chosen[count] = i
            if effect > STRONG and strong < len(kappa):
                chosen[count], chosen[strong] = chosen[strong], i
                strong += 1
            count += 1
    return count, strong


@njit(**COMPILED)
def flow(
    start: Array,
    c: float,
    frequencies: Array,
    decays: Array,
    stiffening: Array,
    stretch: Array,
    triads: Triads,
    rate_hz: float,
    node_s: float,
    silence: float,
    negligible: float,
    out: Array,
) -> None:
    """Writes the modal amplitudes of frames 1 … steps, (steps, modes), from z at frame 0, (2, modes).

    Latents are z = w e^{-σt + iΦ}: phases Φ of the frequencies ∂(K₀ + K₁ + K₂)/∂I, and w that triads alone change.
    Both by classical Runge-Kutta from node to node, and by cubics in between.
    """
    steps, modes = out.shape
    phase, w = np.zeros(modes), start.copy()
    z, work, flight = np.empty((2, modes)), np.empty((6, modes)), np.empty((6, modes))
    stage_phase, stage_w = np.empty(modes), np.empty((2, modes))
    speed, pull, drift = np.empty((4, modes)), np.zeros((2, modes)), np.zeros((4, 2, modes))
    raised, b, v = np.empty(modes), np.empty(modes), np.empty((modes, modes))
    tau, chosen = np.empty(len(triads)), np.empty(len(triads), np.int64)
    last_phase, last_w, last_speed, last_drift = (
        np.empty(modes),
        np.empty((2, modes)),
        np.empty(modes),
        np.empty((2, modes)),
    )
    actions, third = np.empty(modes), np.empty(modes)
    matrices, kappa = np.empty((4, modes, modes)), np.empty((min(len(triads), MOST_STRONG), modes))
    quartets, signs = np.empty((MOST_QUARTETS, 4), np.int64), np.empty((MOST_QUARTETS, 4))
    of_quartets, quartet_count = np.empty(MOST_QUARTETS), 0
    moving, count, strong, frame, node = modes, 0, 0, 0, 0
    for n in range(modes):
        actions[n] = w[0, n] ** 2 + w[1, n] ** 2
    s = mean_stretch(actions, frequencies, stiffening, stretch, 0.0)
    while frame < steps:
        begin_s = node * node_s
        if node % NODES_A_CHOICE == 0:
            whole = 0.0
            for n in range(moving):
                actions[n] = (w[0, n] ** 2 + w[1, n] ** 2) * math.exp(-2 * decays[n] * begin_s)
                raised[n] = math.sqrt(frequencies[n] * frequencies[n] + stiffening[n] * s)
                whole += actions[n] / raised[n]
            while moving > 1 and actions[moving - 1] / raised[moving - 1] < silence * silence * whole:
                moving -= 1
            raise_frequencies(
                s,
                frequencies[:moving],
                stiffening[:moving],
                stretch[:moving],
                raised[:moving],
                b[:moving],
                v[:moving, :moving],
            )
            weigh_triads(triads, c, raised, b, tau)
            count, strong = choose(triads, tau, actions[:moving], raised[:moving], negligible, chosen, kappa)
            left = 0 if node % NODES_A_QUARTETS_CHOICE == 0 else quartet_count
            quartet_count = 0
            for i in range(left):  # those whose modes still move
                if quartets[i].max() < moving:
                    quartets[quartet_count], signs[quartet_count] = quartets[i], signs[i]
                    of_quartets[quartet_count] = of_quartets[i]
                    quartet_count += 1
            if strong > 0:
                pairs = matrices[:, :moving, :moving]
                pair_matrices(
                    raised[:moving], b[:moving], v[:moving, :moving], pairs[0], pairs[1], pairs[2], pairs[3]
                )
                if node % NODES_A_QUARTETS_CHOICE == 0:
                    quartet_count = choose_quartets(
                        actions[:moving],
                        c,
                        raised[:moving],
                        b[:moving],
                        pairs,
                        STRONG,
                        quartets,
                        signs,
                        of_quartets,
                    )
                for i in range(strong):
                    third_order_triad(
                        triads[chosen[i]],
                        c,
                        raised[:moving],
                        b[:moving],
                        pairs[0],
                        pairs[1],
                        pairs[2],
                        pairs[3],
                        kappa[i, :moving],
                    )
        mo = moving
        fr, st, sr = frequencies[:mo], stiffening[:mo], stretch[:mo]
        vv = v[:mo, :mo]
        raise_frequencies(s, fr, st, sr, raised[:mo], b[:mo], vv)
        weigh_triads(triads, c, raised, b, tau)
        for stage in range(5):  # the fifth: the slopes at the end, for the cubics
            part = 0.0 if stage == 0 else 0.5 if stage < 3 else 1.0
            time_s = begin_s + part * node_s
            if stage < 4:
                for n in range(mo):
                    if stage == 0:
                        stage_phase[n], stage_w[0, n], stage_w[1, n] = phase[n], w[0, n], w[1, n]
                    else:
                        h = part * node_s
                        stage_phase[n] = phase[n] + h * speed[stage - 1, n]
                        stage_w[0, n] = w[0, n] + h * drift[stage - 1, 0, n]
                        stage_w[1, n] = w[1, n] + h * drift[stage - 1, 1, n]
            else:
                for n in range(mo):
                    last_phase[n], last_speed[n] = phase[n], speed[0, n]
                    phase[n] += node_s / 6 * (speed[0, n] + 2 * (speed[1, n] + speed[2, n]) + speed[3, n])
                    stage_phase[n] = phase[n]
                    for e in range(2):
                        last_w[e, n], last_drift[e, n] = w[e, n], drift[0, e, n]
                        w[e, n] += (
                            node_s / 6 * (drift[0, e, n] + 2 * (drift[1, e, n] + drift[2, e, n]) + drift[3, e, n])
                        )
                        stage_w[e, n] = w[e, n]
            for n in range(mo):
                decay = math.exp(-decays[n] * time_s)
                cosine, sine = decay * math.cos(stage_phase[n]), decay * math.sin(stage_phase[n])
                z[0, n] = stage_w[0, n] * cosine - stage_w[1, n] * sine
                z[1, n] = stage_w[0, n] * sine + stage_w[1, n] * cosine
            if stage == 0:
                third_order(z[0, :mo], z[1, :mo], c, raised[:mo], b[:mo], vv, third[:mo])
            slot = stage % 4
            s = velocities(
                z[0, :mo],
                z[1, :mo],
                c,
                fr,
                st,
                sr,
                s,
                vv,
                triads,
                tau,
                chosen,
                count,
                strong,
                kappa,
                quartets,
                signs,
                of_quartets,
                quartet_count,
                speed[slot, :mo],
                pull[:, :mo],
                flight[:, :mo],
            )
            for n in range(mo):
                speed[slot, n] += third[n]
            for n in range(mo):  # ẇ = i g z̄ e^{σt - iΦ}
                growth = math.exp(min(decays[n] * time_s, DEAD_NEPERS))
                re, im = pull[0, n] * z[0, n] + pull[1, n] * z[1, n], pull[1, n] * z[0, n] - pull[0, n] * z[1, n]
                cosine, sine = growth * math.cos(stage_phase[n]), growth * math.sin(stage_phase[n])
                drift[slot, 0, n] = -im * cosine + re * sine
                drift[slot, 1, n] = re * cosine + im * sine
        while frame < steps and (frame + 1) / rate_hz <= (node + 1) * node_s * (1 + 1e-12):
            time_s = (frame + 1) / rate_hz
            t = time_s / node_s - node
            h00, h10 = (1 + 2 * t) * (1 - t) ** 2, t * (1 - t) ** 2 * node_s
            h01, h11 = t * t * (3 - 2 * t), t * t * (t - 1) * node_s
            for n in range(mo):
                angle = h00 * last_phase[n] + h10 * last_speed[n] + h01 * phase[n] + h11 * speed[0, n]
                p = h00 * last_w[0, n] + h10 * last_drift[0, n] + h01 * w[0, n] + h11 * drift[0, 0, n]
                q = h00 * last_w[1, n] + h10 * last_drift[1, n] + h01 * w[1, n] + h11 * drift[0, 1, n]
                decay = math.exp(-decays[n] * time_s)
                cosine, sine = decay * math.cos(angle), decay * math.sin(angle)
                z[0, n], z[1, n] = p * cosine - q * sine, p * sine + q * cosine
            read(z[0, :mo], z[1, :mo], c, fr, st, sr, s, raised[:mo], b[:mo], vv, work[:, :mo], out[frame, :mo])
            for n in range(mo, modes):
                out[frame, n] = 0.0
            frame += 1
        node += 1


@njit(**COMPILED)
def swing(
    z: NDArray[np.complex128], c: float, frequencies: Array, decays: Array, stiffening: Array, stretch: Array
) -> NDArray[np.complex128]:
    """How far the flow of χ takes log z in one unit of its time, complex (modes,), by one step of Runge-Kutta."""
    modes = len(z)
    raised, b, v, work = np.empty(modes), np.empty(modes), np.empty((modes, modes)), np.empty((2, modes))
    growth, turn, slope = np.empty(modes), np.empty(modes), np.zeros(modes, np.complex128)
    total, s = np.zeros(modes, np.complex128), 0.0
    for stage in range(4):
        at = z * np.exp(slope * (0.0 if stage == 0 else 0.5 if stage < 3 else 1.0))
        re, im = at.real.copy(), at.imag.copy()
        s = mean_stretch(re * re + im * im, frequencies, stiffening, stretch, s)
        raise_frequencies(s, frequencies, stiffening, stretch, raised, b, v)
        exponents(re, im, c, raised, b, v, growth, turn, work)
        slope = growth + 1j * turn
        total += slope / (6 if stage in (0, 3) else 3)
    return total


@njit(**COMPILED)
def second_order(
    actions: Array, c: float, frequencies: Array, decays: Array, stiffening: Array, stretch: Array, resonant: float
) -> Array:
    """-∂χ₂/∂θ / 2I at angles 0 or π, where χ₂ takes away what second order leaves of a period's swing: (modes,).

    Its terms are XX and YY, whose coefficients are sums over a third mode, and triads of all signs. Those that are
    detuned by less than `resonant` stay in the flow.
    """
    modes = len(actions)
    raised, b, v = np.empty(modes), np.empty(modes), np.empty((modes, modes))
    s = mean_stretch(actions, frequencies, stiffening, stretch, 0.0)
    raise_frequencies(s, frequencies, stiffening, stretch, raised, b, v)
    for m in range(modes):  # R of χ = (c/4) Σ R_mn Y_m X_n, in place
        for n in range(modes):
            v[m, n] = raised[m] * v[m, n] if m != n else 0.25 / raised[n]
    a = b * actions
    ab = a * b
    r, growth = np.zeros(modes), np.empty(modes)
    for m in range(modes):
        r += ab[m] * v[m]
    for n in range(modes):
        total = 0.0
        for m in range(modes):
            of_xx = -(r[n] + r[m]) / 16 - (ab[n] * v[n, m] + ab[m] * v[m, n]) / 32
            of_yy = (ab[n] * v[m, n] + ab[m] * v[n, m]) / 32
            total += a[m] * (of_xx - of_yy) / (raised[n] + raised[m])
            if m != n:
                total += a[m] * (of_xx + of_yy) / (raised[n] - raised[m])
        for j in range(modes):
            for sign_j in (-1.0, 1.0):
                bj, oj = sign_j * b[j], sign_j * raised[j]
                for k in range(modes):
                    for sign_k in (-1.0, 1.0):
                        bk, ok = sign_k * b[k], sign_k * raised[k]
                        if abs(frequencies[n] + sign_j * frequencies[j] + sign_k * frequencies[k]) >= resonant:
                            form = (b[n] + bj) / ok + (b[n] + bk) / oj + (bj + bk) / raised[n]
                            total += a[j] * a[k] * form / (32 * (raised[n] + oj + ok))
        growth[n] = -c * c / 2 * b[n] * total
    return growth
