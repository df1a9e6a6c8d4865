"""Modes of drums in air, how a blow starts them and how they are heard, for Python and for plug-ins.

The physics is that of `engine.resonators.drum`. Arguments are arrays of float64:

    drum     the values of `DrumParameters` in their order, its shape as a number; then those of a blow
    surface  (4, n) modes by rising wavenumber, at a size of 1: the radius of a circle of the same area
    air      (2, low modes that differ, terms): what `air_at` has for ka up to `reach`, as polynomials
    around   surface, air and reach: what all drums of a shape have in common
    found    (7, n) modes of a drum by rising frequency: those of the surface, ω, mass and radiated losses
    work     memory to work in; with a table of Bessel functions, which may be empty: tools
"""

from __future__ import annotations

import math

import numpy as np

from engine import bounds
from engine.kernels import pulses
from engine.kernels.compiled import kernel
from engine.kernels.memory import behind, drum_at
from engine.kernels.records import DRUM as DRUM_BLOCK
from engine.kernels.records import DRUM_ROWS
from engine.levels import FULL_SCALE_PA, MOST_PERIODS

HEADER = DRUM_BLOCK.itemsize // 8

SHAPE, LENGTH, WIDTH, THICKNESS, DENSITY, MODULUS, POISSON, TENSION, D1, D3, UNEVEN, AIR, CAVITY, SHELL = range(14)
X, Y, MALLET_KG, RADIUS, CONTACT, SOFTEST, HARDEST = range(14, 21)  # of a drum with its blow
DRUM = 21
CIRCLE, RECTANGLE, BAR = range(3)
Z, M, N, SLOPE, OMEGA, MASS, RADIATED = range(7)  # κ times size, n or whether it is a sine, J_m' at the edge
SURFACE, ROWS = 4, 7
ORDERS = 512  # of Bessel functions: more than circles of the most modes have
STEP, TERMS = 0.1, 5  # of a table of Bessel functions, for Taylor's series
APART = 1.5  # less than two zeros of a Bessel function are apart

Around = tuple[np.ndarray, np.ndarray, float]
Tools = tuple[np.ndarray, np.ndarray]
LOWEST, HIGHEST = (np.array([limits[end] for limits in bounds.DRUM.values()]) for end in (0, 1))
AIR_KG_M3 = 1.2
AIR_M_S = 343.0
SIDES = 2
EXACT = 16.0  # radians of κ√(A/π), above which waves are nearly plane
ANGLES = 64  # of an integral over what radiates, and a quarter of those of a rectangle's directions
ROUNDS, EXACT_ROUNDS = 4, 2  # the mass depends on the frequency, a little
COLUMN_ROUNDS = 40  # by halves: more than a little near a resonance of the column
BEYOND_THE_END = 0.6133  # of a radius
LEAST_VOLUME = 1e-6  # square of a mode's mean, below which it moves no column
TUNINGS, NEAR = 6, 1e-4  # rounds of a secant method, and of a frequency, where it ends
LOW_HZ, LOW_MODES = 3.0, 6  # among which a pitch is: below so many times the lowest, without air
HERTZ = -0.2  # power of the speed in the time of contact
J01 = 2.404825557695773  # the first zero of J₀


@kernel
def _hypot(x: float, y: float) -> float:
    return math.sqrt(x * x + y * y)


@kernel
def bessels(x: float, out: np.ndarray) -> float:
    """Write J_m(x) of m from 0 on, x ≥ 0, and return Struve's H₁(x).

    From a high order down (Miller), with J₀ + 2 J₂ + 2 J₄ + … = 1; orders beyond the turning point are 0.
    """
    out[:] = 0.0
    if x < 1e-4:  # else what precedes would overflow
        for m, value in enumerate((1 - x * x / 4, x / 2, x * x / 8)):
            if m < len(out):
                out[m] = value
        return 2 * x * x / (3 * math.pi)
    orders = min(len(out), int(x + 12 * x ** (1 / 3)) + 20)
    most = max(float(orders), x)
    above, here = 0.0, 1e-300
    total = struve = 0.0
    for m in range(2 * int(most / 2 + 4 * most ** (1 / 3) + 6), 0, -1):
        if m < orders:
            out[m] = here
        if m & 1 == 0:
            total += 2 * here
            struve += here / (m * m - 1)
        above, here = here, 2 * m / x * here - above
    total += here
    out[0] = here
    for m in range(orders):
        out[m] /= total
    return 2 / math.pi * (1 - out[0]) + 4 / math.pi * struve / total


@kernel
def zeros(highest: float, out: np.ndarray, before: np.ndarray, after: np.ndarray, scratch: np.ndarray) -> int:
    """Write rows (z, m, 1 of a sine or 0, J_m'(z)) of the zeros of all J_m up to `highest`; return their number.

    Args:
        out: (most, 4); further zeros are left out.
        before, after, scratch: room for values of J_m, of orders from 0 on.
    """
    count, x = 0, 0.0
    bessels(x, before)
    while x < highest:
        x += APART
        bessels(x, after)
        for m in range(len(after)):
            if before[m] * after[m] < 0:
                low, high = x - APART, x
                z, slope = x - APART / 2, 0.0
                for _ in range(60):
                    bessels(z, scratch[: m + 2])
                    slope = m / z * scratch[m] - scratch[m + 1]
                    if scratch[m] * after[m] < 0:
                        low = z
                    else:
                        high = z
                    following = z - scratch[m] / slope
                    if not low < following < high:
                        following = (low + high) / 2
                    done = abs(following - z) < 1e-14 * z
                    z = following
                    if done:
                        break
                for sine in range(min(m, 1) + 1):
                    if z <= highest and count < out.shape[0]:
                        out[count, Z] = z
                        out[count, M] = m
                        out[count, N] = sine
                        out[count, SLOPE] = slope
                        count += 1
        before[:] = after
    return count


@kernel
def tabulate(table: np.ndarray) -> None:
    """Write J_m of multiples of STEP, (steps, TERMS + orders + TERMS): m from -TERMS on."""
    for step in range(table.shape[0]):
        row = table[step]
        bessels(step * STEP, row[TERMS:])
        for m in range(1, TERMS + 1):
            row[TERMS - m] = -row[TERMS + m] if m & 1 else row[TERMS + m]


@kernel
def bessel(m: int, x: float, tools: Tools) -> float:
    """J_m(x), where the table has it by Taylor's series, whose derivatives are of other orders: to 3e-11."""
    table, work = tools
    step = int(x / STEP + 0.5)
    if step >= table.shape[0]:
        bessels(x, work[: m + 1])
        return work[m]
    if m >= table.shape[1] - 2 * TERMS:  # beyond the turning point
        return 0.0
    half = (x - step * STEP) / 2
    value, power = 0.0, 1.0
    for derivative in range(TERMS + 1):  # of J_m: sums of (-1)^i (derivative over i) J_(m - derivative + 2i)
        part, over = 0.0, 1.0
        for i in range(derivative + 1):
            part += over * table[step, TERMS + m - derivative + 2 * i]
            over *= -(derivative - i) / (i + 1)
        value += power * part
        power *= half / (derivative + 1)
    return value


@kernel
def size(drum: np.ndarray) -> float:
    """The radius of a circle of the same area."""
    if drum[SHAPE] == CIRCLE:
        return (drum[LENGTH] + drum[WIDTH]) / 4
    return math.sqrt(drum[LENGTH] * drum[WIDTH] / math.pi)


@kernel
def mass_kg(drum: np.ndarray) -> float:
    """μA: of each mass-normalised mode."""
    return drum[DENSITY] * drum[THICKNESS] * math.pi * size(drum) ** 2


@kernel
def stretching(drum: np.ndarray) -> float:
    """C = Eh/2(1 - ν²) in N/m; of a bar, which is free to widen, without ν. D is C h²/6."""
    held_across = 1.0 if drum[SHAPE] == BAR else 1 - drum[POISSON] ** 2
    return drum[MODULUS] * drum[THICKNESS] / (2 * held_across)


@kernel
def _of_sine(m: int, turn: float, sine: float, cosine: float) -> float:
    """|∫₀¹ sin(mπx) e^{i turn x} dx|, with the sign that the middle gives; sine and cosine of |turn|/2."""
    side, away = m * math.pi, abs(turn)
    half, quarter = (away - side) / 2, m & 3
    part = sine if quarter == 0 else -cosine if quarter == 1 else -sine if quarter == 2 else cosine
    part = 1 - half * half / 6 * (1 - half * half / 20) if abs(half) < 0.01 else part / half
    sign = 1.0 if quarter == 1 or quarter == 2 else -1.0
    if m & 1 == 0:
        sign *= np.sign(turn)
    return sign * side / (side + away) * part


@kernel
def _across(n: int, turn: float, sine: float, cosine: float) -> float:
    """The same across the width, over which a bar, n = 0, moves alike."""
    if n > 0:
        return _of_sine(n, turn, sine, cosine)
    return math.sqrt(0.5) * (1.0 if turn == 0 else 2 * sine / abs(turn))


@kernel
def _hankel(z: float, s: float, slope: float, bessel_m: float) -> float:
    """∫ J_m(zr) J_m(sr) r dr to r = 1, where J_m(z) = 0; `slope`: J_m'(z); `bessel_m`: J_m(s)."""
    if abs(z - s) < 1e-6 * z:
        return slope * slope / 2 * (2 - s / z)  # to second order
    return -z * slope * bessel_m / (z * z - s * s)


@kernel
def _height(m: int, slope: float) -> float:
    """1/√(∫ J² cos² dA / A): the factor that normalises a circle's mode; `slope`: J_m' at the edge."""
    return (1.0 if m == 0 else math.sqrt(2.0)) / abs(slope)


@kernel
def transform(drum: np.ndarray, surface: np.ndarray, mode: int, along: float, across: float, tools: Tools) -> float:
    """|∫φ e^{is·x} dA|/A with its sign, s = (along, across) in 1/m."""
    m, n = int(surface[M, mode]), int(surface[N, mode])
    if drum[SHAPE] != CIRCLE:
        one, two = along * drum[LENGTH], across * drum[WIDTH]
        return (
            2
            * _of_sine(m, one, math.sin(abs(one) / 2), math.cos(one / 2))
            * _across(n, two, math.sin(abs(two) / 2), math.cos(two / 2))
        )
    s = _hypot(along, across) * size(drum)
    angle = m * math.atan2(across, along)
    turned = 1.0 if m == 0 else math.sin(angle) if n else math.cos(angle)
    slope = surface[SLOPE, mode]
    return 2 * _height(m, slope) * _hankel(surface[Z, mode], s, slope, bessel(m, s, tools)) * turned


@kernel
def shape(drum: np.ndarray, surface: np.ndarray, mode: int, x: float, y: float, tools: Tools) -> float:
    """φ at a place on the surface, in half-lengths from the centre."""
    m, n = int(surface[M, mode]), int(surface[N, mode])
    if drum[SHAPE] != CIRCLE:
        across = math.sqrt(0.5) if n == 0 else math.sin(math.pi * n * (1 + y) / 2)
        return 2 * math.sin(math.pi * m * (1 + x) / 2) * across
    angle = m * math.atan2(y, x)
    radial = bessel(m, surface[Z, mode] * _hypot(x, y), tools)
    return radial * _height(m, surface[SLOPE, mode]) * (math.sin(angle) if n else math.cos(angle))


@kernel
def shapes(drum: np.ndarray, surface: np.ndarray, places: np.ndarray, tools: Tools, out: np.ndarray) -> None:
    """`shape` at places (places, 2): (modes, places); 0 beyond the edge."""
    for place in range(len(places)):
        x, y = places[place]
        away = _hypot(x, y) if drum[SHAPE] == CIRCLE else max(abs(x), abs(y))
        for mode in range(surface.shape[1]):
            out[mode, place] = shape(drum, surface, mode, x, y, tools) if away <= 1 else 0.0


@kernel
def spread(turn: float, tools: Tools) -> float:
    """The mean of a mode over a disc, of its value at the centre: 2 J₁(κR)/κR for any solution of -∇²φ = κ²φ."""
    return 1.0 if turn < 1e-6 else 2 * bessel(1, turn, tools) / turn


@kernel
def densities(drum: np.ndarray, surface: np.ndarray, s: float, out: np.ndarray, scratch: np.ndarray) -> None:
    """Write the share (modes,) of each mode's square at a wavenumber s over all directions: ∫ density ds = 1.

    s is at a size of 1; `scratch` has room for functions of all orders.
    """
    if drum[SHAPE] == CIRCLE:
        bessels(s, scratch[: int(surface[M].max()) + 1])
        for mode in range(surface.shape[1]):
            slope = surface[SLOPE, mode]
            out[mode] = 2 * s * (_hankel(surface[Z, mode], s, slope, scratch[int(surface[M, mode])]) / slope) ** 2
        return
    out[:] = 0.0
    angles = ANGLES // 4
    most_m, most_n = int(surface[M].max()) + 1, int(surface[N].max()) + 1
    for number in range(angles):  # a quarter turn: the squares are alike in all four
        angle = (number + 0.5) * math.pi / (2 * angles)
        one, two = (s * math.cos(angle) * drum[LENGTH] / size(drum), s * math.sin(angle) * drum[WIDTH] / size(drum))
        sine, cosine = math.sin(one / 2), math.cos(one / 2)
        for m in range(most_m):
            scratch[m] = _of_sine(m, one, sine, cosine)
        sine, cosine = math.sin(two / 2), math.cos(two / 2)
        for n in range(most_n):
            scratch[most_m + n] = _across(n, two, sine, cosine)
        for mode in range(surface.shape[1]):
            out[mode] += (scratch[int(surface[M, mode])] * scratch[most_m + int(surface[N, mode])]) ** 2
    out[:] *= 2 * s / angles


@kernel
def air_at(
    drum: np.ndarray, surface: np.ndarray, ka: float, points: int, out: np.ndarray, scratch: np.ndarray
) -> None:
    """Write what the air adds to modes at k times size: reactance, and resistance by ka, (2, modes), at a size of 1.

    ∫ D(s)/√(s² - k²) ds over s > k, with s² = k² + u²: ∫ D(s)/s du. And ∫ D(s)/√(k² - s²) ds over s < k, with
    s = k sin α.

    Args:
        ka: k times size, k being the wavenumber of sound in air.
        points: of the first integral, whose u ends at 8 EXACT.
    """
    shares, rest = scratch[: surface.shape[1]], scratch[surface.shape[1] :]
    out[:] = 0.0
    wide = 8 * EXACT / points
    for point in range(points):
        s = _hypot(ka, (point + 0.5) * wide)
        densities(drum, surface, s, shares, rest)
        out[0] += shares * (wide / s)
    for number in range(ANGLES):
        densities(drum, surface, ka * math.sin((number + 0.5) * math.pi / (2 * ANGLES)), shares, rest)
        out[1] += shares * (math.pi / (2 * ANGLES * ka))


@kernel
def _chebyshev(row: np.ndarray, ka: float, reach: float) -> float:
    """The value at ka of one function of `air_at`: a Chebyshev series in the square of ka."""
    share = min(ka / reach, 1.0)
    t = 2 * share * share - 1
    one = two = 0.0
    for term in range(len(row) - 1, 0, -1):
        one, two = 2 * t * one - two + row[term], one
    return t * one - two + row[0]


@kernel
def _column(k: float, size_m: float, shell_m: float, scratch: np.ndarray) -> tuple[float, float]:
    """Impedance of a shell's column of air less that of a piston in a baffle, over ρc: real and imaginary parts.

    Args:
        k: wavenumber of sound in air, in 1/m.
        size_m, shell_m: radius and length of the column.
        scratch: room for two numbers.
    """
    ka = k * size_m
    falls, turn = math.exp(-ka * ka / 2), -2 * k * (shell_m + BEYOND_THE_END * size_m)
    x, y = falls * math.cos(turn), falls * math.sin(turn)
    whole = (1 + x) * (1 + x) + y * y
    struve = bessels(2 * ka, scratch[:2])
    return (1 - x * x - y * y) / whole - (1 - scratch[1] / ka), -2 * y / whole - struve / ka


@kernel
def reach(drum: np.ndarray, highest_hz: float, most: int) -> float:
    """The κ times size up to which modes are looked at, to find all below a frequency, or the `most` lowest."""
    load = drum[DENSITY] * drum[THICKNESS] * (2 * math.pi * highest_hz) ** 2
    bending = stretching(drum) * drum[THICKNESS] ** 2 / 6
    highest = size(drum) * math.sqrt(2 * load / (drum[TENSION] + math.sqrt(drum[TENSION] ** 2 + 4 * bending * load)))
    highest *= 1.2 if drum[AIR] > 0 else 1.0
    if highest * highest > 4 * bounds.MOST_SURFACE_MODES:  # Weyl's law
        highest = math.sqrt(10.0 * (most + 50))
    return highest


@kernel
def modes(drum: np.ndarray, around: Around, highest_hz: float, most: int, work: np.ndarray, out: np.ndarray) -> int:
    """Write the lowest modes below a frequency, so many at most, and return how many they are.

    Args:
        work: of 4 modes of the surface, and ORDERS.
    """
    surface, air, air_reach = around
    n = surface.shape[1]
    size_m = size(drum)
    mu = drum[DENSITY] * drum[THICKNESS]
    omega = work[:n]
    mass = work[n : 2 * n]
    radiated = work[2 * n : 3 * n]
    order = work[3 * n : 4 * n]
    area = math.pi * size_m * size_m
    bending = stretching(drum) * drum[THICKNESS] ** 2 / 6
    tools = (surface[:0], work[4 * n :])
    last, circle = reach(drum, highest_hz, most) * (1 + 1e-9), drum[SHAPE] == CIRCLE
    ellipticity = (drum[LENGTH] - drum[WIDTH]) / (drum[LENGTH] + drum[WIDTH])
    low, count = -1, 0
    for mode in range(n):
        z = surface[Z, mode]
        if z > last:
            break
        squared = (z / size_m) ** 2
        stiffness = drum[TENSION] * squared + bending * squared * squared
        modal_mass, sigma = mu, 0.0
        if circle and mode > 0 and z == surface[Z, mode - 1]:
            modal_mass, sigma = mass[mode - 1], radiated[mode - 1]  # the other of a pair
        elif drum[AIR] > 0:
            exact = z < EXACT
            low += 1
            for turn in range(ROUNDS):
                k = math.sqrt(stiffness / modal_mass) / AIR_M_S
                if exact and turn >= ROUNDS - EXACT_ROUNDS:
                    load = size_m * _chebyshev(air[0, low], k * size_m, air_reach)
                else:
                    load = 1 / math.sqrt(max(squared - k * k, 0.01 * squared))
                modal_mass = mu + SIDES * drum[AIR] * load
            if exact:
                here = math.sqrt(stiffness / modal_mass)
                ka = here / AIR_M_S * size_m
                resistance = size_m * ka * _chebyshev(air[1, low], ka, air_reach)
                sigma = SIDES * drum[AIR] * here * resistance / (2 * modal_mass)
        mass[mode], radiated[mode] = modal_mass, sigma
        volume = transform(drum, surface, mode, 0.0, 0.0, tools) if drum[SHELL] + drum[CAVITY] > 0 else 0.0
        if drum[SHELL] > 0 and volume * volume > LEAST_VOLUME:
            still = modal_mass
            moved = drum[AIR] * volume * volume
            real = 0.0
            for _ in range(COLUMN_ROUNDS):
                k = math.sqrt(stiffness / modal_mass) / AIR_M_S
                real, imaginary = _column(k, size_m, drum[SHELL], tools[1])
                modal_mass = (modal_mass + max(still + moved * imaginary / k, mu / 2)) / 2
            mass[mode] = modal_mass
            radiated[mode] = max(sigma * 2 * still + moved * AIR_M_S * real, 0.0) / (2 * modal_mass)
        side = 0.0
        if circle and surface[M, mode] > 0:  # an ellipse parts the pairs of one nodal diameter, uneven tension all
            side = (ellipticity if surface[M, mode] == 1 else 0.0) / 2 + drum[UNEVEN] / 2
        spring = AIR_KG_M3 * AIR_M_S**2 / drum[CAVITY] * volume**2 * area if drum[CAVITY] > 0 else 0.0
        omega[mode] = math.sqrt((stiffness + spring) / modal_mass) * (1 + side * (1 if surface[N, mode] > 0 else -1))
        if omega[mode] < 2 * math.pi * highest_hz:
            place = count  # they come nearly in order
            while place > 0 and omega[int(order[place - 1])] > omega[mode]:
                order[place] = order[place - 1]
                place -= 1
            order[place] = mode
            count += 1
    count = min(count, most, out.shape[1])
    for place in range(count):
        mode = int(order[place])
        for row in range(SURFACE):
            out[row, place] = surface[row, mode]
        out[OMEGA, place] = omega[mode]
        out[MASS, place] = mass[mode]
        out[RADIATED, place] = radiated[mode]
    return count


@kernel
def lowest(drum: np.ndarray) -> float:
    """The wavenumber κ of the lowest mode in 1/m."""
    if drum[SHAPE] == CIRCLE:
        return 2 * J01 / drum[LENGTH]
    return _hypot(math.pi / drum[LENGTH], math.pi / drum[WIDTH])


@kernel
def _principal(drum: np.ndarray, around: Around, work: np.ndarray, out: np.ndarray) -> float:
    """The ω of the mode that gives a drum its pitch: over a kettle (1,1), as (0,1) dies away; else the first."""
    across = lowest(drum)
    stiff = drum[TENSION] + stretching(drum) * (drum[THICKNESS] * across) ** 2 / 6
    in_vacuo_hz = across * math.sqrt(stiff / (drum[DENSITY] * drum[THICKNESS])) / (2 * math.pi)
    count = modes(drum, around, LOW_HZ * in_vacuo_hz, LOW_MODES, work, out)
    for place in range(count):
        if drum[CAVITY] > 0 and drum[SHAPE] == CIRCLE and out[M, place] == 1:
            return out[OMEGA, place]
    return out[OMEGA, 0] if count else math.nan


@kernel
def tune(drum: np.ndarray, ratio: float, around: Around, work: np.ndarray, out: np.ndarray) -> None:
    """Raise a drum's pitch by a ratio, in place: a membrane's by its tension, a plate's by its size.

    `work` and `out` are those of `modes`; they are overwritten.
    """
    if ratio == 1.0:
        return
    if drum[TENSION] == 0.0:
        drum[LENGTH] /= math.sqrt(ratio)
        drum[WIDTH] /= math.sqrt(ratio)
        return
    wanted = ratio * _principal(drum, around, work, out)
    at_rest = drum[TENSION]
    factor = ratio**2
    for _ in range(TUNINGS):
        drum[TENSION] = at_rest * factor
        off = wanted / _principal(drum, around, work, out)
        if abs(off - 1) < NEAR:
            break
        factor *= off**2
    drum[TENSION] = at_rest * factor


@kernel
def losses(drum: np.ndarray, modal: np.ndarray, out: np.ndarray) -> None:
    """Write each mode's decay rate σ in 1/s, (n,): (d₁ + d₃κ²) over twice its mass by area, and radiation.

    `modal` are modes (7, n) as `modes` writes them: `found` of the module.
    """
    for mode in range(len(out)):
        lost = drum[D1] + drum[D3] * (modal[Z, mode] / size(drum)) ** 2
        out[mode] = lost / (2 * modal[MASS, mode]) + modal[RADIATED, mode]


@kernel
def struck(
    drum: np.ndarray, modal: np.ndarray, x: float, y: float, radius_m: float, tools: Tools, out: np.ndarray
) -> None:
    """Write the speeds in m/s, (n,), of a sudden blow of 1 N s, spread over a disc about a place.

    Args:
        modal: (7, n), as `modes` writes them.
        x, y: the place, in half-lengths from the centre.
    """
    for mode in range(len(out)):
        scale = math.sqrt(drum[DENSITY] * drum[THICKNESS] / modal[MASS, mode]) / mass_kg(drum)
        out[mode] = (
            shape(drum, modal, mode, x, y, tools) * spread(modal[Z, mode] / size(drum) * radius_m, tools) * scale
        )


@kernel
def blow(
    squares: np.ndarray,
    struck: np.ndarray,
    contact_s: float,
    masses_kg: tuple[float, float],
    speed: float,
    out: np.ndarray,
) -> None:
    """Speeds (modes,) that a mallet's blow gives, see `engine.strike`.

    Args:
        squares, struck: ω², and what 1 N s at once gives, (modes,).
        contact_s: the time of contact at 1 m/s.
        masses_kg: of each mode, and of the mallet.
    """
    lowest, energy = np.inf, 0.0
    for mode in range(len(out)):
        lowest = min(lowest, squares[mode])
    contact_s = min(contact_s * max(speed, 1e-3) ** HERTZ, MOST_PERIODS * 2 * math.pi / math.sqrt(lowest))
    for mode in range(len(out)):
        out[mode] = struck[mode] * pulses.spectrum(math.sqrt(squares[mode]) * contact_s / (2 * math.pi))
        energy += 0.5 * masses_kg[0] * out[mode] ** 2
    impulse = speed / (energy + 0.5 / masses_kg[1])
    for mode in range(len(out)):
        out[mode] *= impulse


@kernel
def radiated(drum: np.ndarray, modal: np.ndarray, x: float, y: float, tools: Tools, out: np.ndarray) -> None:
    """Write the sound pressure in Pa, (n,), of modes at amplitude 1 m, 1 m off, as from a baffle.

    See `DrumModes.radiated`. `x` and `y` are the parts of the unit vector to the listener along the surface.
    """
    for mode in range(len(out)):
        omega, scale = modal[OMEGA, mode], math.sqrt(drum[DENSITY] * drum[THICKNESS] / modal[MASS, mode])
        moved = (
            transform(drum, modal, mode, omega / AIR_M_S * x, omega / AIR_M_S * y, tools) * size(drum) ** 2 * scale
        )
        out[mode] = AIR_KG_M3 * omega**2 / 2 * moved


@kernel
def write(drum: np.ndarray, modal: np.ndarray, points: np.ndarray, tools: Tools, address: int, n: int) -> None:
    """Write the drum of a key, n modes and its blow, heard at points, as the player reads it: see `records.DRUM`."""
    mu, block = drum[DENSITY] * drum[THICKNESS], drum_at(address)
    block.modes = n
    block.mallet_kg = drum[MALLET_KG]
    block.contact_s = drum[CONTACT]
    block.softest_m_s = drum[SOFTEST]
    block.hardest_m_s = drum[HARDEST]
    block.mass_kg = mass_kg(drum)
    rows = behind(block, HEADER, DRUM_ROWS * n)
    for mode in range(n):
        stretch = (modal[Z, mode] / size(drum)) ** 2 * mu / modal[MASS, mode]
        rows[mode] = modal[OMEGA, mode] ** 2
        rows[2 * n + mode], rows[3 * n + mode] = stretching(drum) / mu * stretch, stretch
    losses(drum, modal, rows[n : 2 * n])
    struck(drum, modal, drum[X], drum[Y], drum[RADIUS], tools, rows[4 * n : 5 * n])
    for point in range(len(points)):
        radiation = rows[(5 + point) * n : (6 + point) * n]
        radiated(drum, modal, 2 * points[point] - 1, 0.0, tools, radiation)
        for mode in range(n):
            radiation[mode] /= FULL_SCALE_PA
