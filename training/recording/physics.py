"""The physics of a note from its poles: f0, B, decay over frequency, one product of glide, two polarisations.

A sound gives these and no more. Length, density and millimetres are a gauge: any of them may be chosen, and tension,
area, moduli and amplitude follow. They are asked for, else assumed and marked.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy import optimize

from engine.resonators.base import Array
from engine.resonators.recorded import MOST_CENTS, RATIOS
from engine.resonators.string import decay_rates, undamped_frequencies
from engine.values.string import StringParameters
from training.recording.fit import LearnedNote
from training.recording.numbering import fit_law, partial_hz
from training.recording.refine import Pole, moments, polarisations

Kind = Literal["guitar", "bass", "harp", "piano"]

SMOOTH_OCTAVES = 0.4  # half width of the window in which decays are averaged
MOST_NODES = 24  # of the curve of decay over frequency
MOST_BESIDE_SMOOTH = 5.0  # times the smooth decay, or a fifth: a partial beyond is not the string's
MOST_OFF_CENTS = 25.0  # an estimate: a partial further from the series is pulled by the body, and decays with it
MOST_DECAYS_APART = 12.0  # an estimate, of two polarisations; intervals are stated for closer ones
NEAR_CENTS = 12.0  # an estimate: a partial with a pole so near has no other further off
PULLED_WEIGHT = 1e-3
NEARLY_ALIKE = 1.12  # an estimate: times the least misfit of a place where the string may have been pulled
COMB_FLOOR = 0.15  # partials that the pluck hardly excites say nothing of the body
LEAST_SHARE = 1e-8  # of the strongest partial's energy, for a partial whose decay counts


@dataclass(frozen=True)
class Build:
    """The assumptions on a string that is only heard: its length, tension, and material."""

    length_m: float
    tension_n: float
    density_kg_m3: float
    youngs_modulus_pa: float


BUILDS: dict[Kind, Build] = {
    "guitar": Build(0.65, 70.0, 7850.0, 2.0e11),
    "bass": Build(1.06, 200.0, 7850.0, 2.0e11),
    "harp": Build(0.5, 120.0, 1140.0, 5.4e9),
    "piano": Build(0.6, 700.0, 7850.0, 2.0e11),
}


@dataclass(frozen=True)
class Partial:
    """A partial of the note.

    Attributes:
        hz: mean frequency over time, weighted by its energy.
        decay: σ in 1/s of the one exponential with the same centre of energy in time.
        amplitude: |a| of its poles, summed.
        energy: ∫ |z|².
        poles: the lower one first; one or two.
    """

    number: int
    hz: float
    decay: float
    amplitude: float
    energy: float
    poles: tuple[Pole, ...]


@dataclass(frozen=True)
class LearnedPhysics:
    """The physics that the sound gives.

    Attributes:
        f0_hz, stiffness: with standard errors; stiffness is B.
        partials: ascending.
        smooth_hz, smooth_decay: σ in 1/s over frequency, a curve through all partials.
        rise: share that the glide adds to all frequencies when the fit begins: the product of the tension's
            coupling and the squared amplitude, which a sound cannot take apart.
    """

    f0_hz: float
    f0_error_hz: float
    stiffness: float
    stiffness_error: float
    partials: tuple[Partial, ...]
    smooth_hz: tuple[float, ...]
    smooth_decay: tuple[float, ...]
    rise: float


@dataclass(frozen=True)
class Strung:
    """A string with the sound's numbers in a chosen gauge.

    Attributes:
        amplitude_m: of the recorded pluck's rise of tension, as the peak of a triangle at `position`.
        position: of the pluck, in lengths.
        assumed: what the sound did not give, in words.
    """

    string: StringParameters
    amplitude_m: float
    position: float
    assumed: tuple[str, ...]


def partials_of(learned: LearnedNote) -> tuple[Partial, ...]:
    """The partials with their poles, at rest; those without energy are left out."""
    partials = []
    for number in sorted({pole.partial for pole in learned.poles if pole.partial}):
        poles = polarisations(_of_string(learned, number), MOST_DECAYS_APART)
        if not poles:
            continue
        if number in learned.spreads:
            higher = 2 ** (learned.spreads[number].rest_cents / 1200)
            poles = [replace(pole, s=complex(pole.s.real, higher * pole.s.imag)) for pole in poles]
        s, a = np.array([pole.s for pole in poles]), np.array([pole.a for pole in poles])
        energy, moment, turn = map(float, moments(a, s))
        if energy <= 0 or moment <= 0:
            continue
        hz = turn / energy / (2 * math.pi)
        partials.append(Partial(number, hz, 0.5 * energy / moment, float(np.abs(a).sum()), energy, tuple(poles)))
    loudest = max((partial.energy for partial in partials), default=0.0)
    return tuple(partial for partial in partials if partial.energy > LEAST_SHARE * loudest)


def _of_string(learned: LearnedNote, number: int) -> list[Pole]:
    """The poles that a partial's polarisations are among: its own and free ones, near their place in the series.

    What is further off is a resonance of the body. A partial that has nothing near is pulled by it: its own stay.
    """
    place = partial_hz(number, learned.f0_hz, learned.stiffness)
    far = 300 * math.log2((number + 1) / number)  # a quarter of the way to the next partial
    numbered = [pole for pole in learned.poles if pole.partial == number and pole.a]
    free = [pole for pole in learned.poles if pole.partial == 0 and pole.a and pole.hz > 0]
    off = {id(pole): abs(1200 * math.log2(pole.hz / place)) for pole in (*numbered, *free)}
    for reach in (NEAR_CENTS, MOST_OFF_CENTS):
        near = [pole for pole in numbered if off[id(pole)] < reach]
        if len(near) > 1:
            return near
        if near:
            return near + [pole for pole in free if off[id(pole)] < min(reach, far)]
    return numbered


def physics_of(learned: LearnedNote) -> LearnedPhysics:
    """Fit f0, B and the decay over frequency to a note's partials.

    Those pulled by the body count little for it.
    """
    partials = partials_of(learned)
    k = np.array([partial.number for partial in partials], float)
    hz = np.array([partial.hz for partial in partials])
    loudest = max(partial.energy for partial in partials)
    weight = np.array([(partial.energy / loudest) ** 0.15 for partial in partials])
    if len(k) >= 3:
        solution, rows, scale = fit_law(k, hz, weight, 8)
        if solution[1] < 0:
            solution = np.array([np.average((hz / k) ** 2, weights=scale**2), 0.0])
        residual = ((hz / k) ** 2 - rows @ solution) * scale
        covariance = np.linalg.pinv((rows * scale[:, None]).T @ (rows * scale[:, None]))
        covariance *= float(residual @ residual) / max(1, len(k) - 2)
        square, slope = solution
        f0, stiffness = math.sqrt(square), slope / square
        f0_error, stiffness_error = math.sqrt(covariance[0, 0]) / (2 * f0), math.sqrt(covariance[1, 1]) / square
    else:
        f0, stiffness = hz[0] / partial_hz(k[0], 1.0, learned.stiffness), learned.stiffness
        f0_error, stiffness_error = math.inf, math.inf
    cents = 1200 * np.log2(hz / partial_hz(k, f0, stiffness))
    of_string = weight * np.where(np.abs(cents) > MOST_OFF_CENTS, PULLED_WEIGHT, 1.0)
    smooth_hz, smooth = _smooth(hz, np.array([partial.decay for partial in partials]), of_string)
    rise = float(learned.glide.shares.sum())
    return LearnedPhysics(f0, f0_error, stiffness, stiffness_error, partials, smooth_hz, smooth, max(0.0, rise))


def _smooth(hz: Array, decay: Array, weight: Array) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """The weighted median of σ in windows of octaves: frequencies (nodes,) in Hz, and σ in 1/s there.

    Args:
        hz, decay, weight: of each partial, (partials,).
    """
    count = min(MOST_NODES, len(hz))
    nodes = np.geomspace(hz[0], hz[-1], count) if count > 1 else hz[:1]
    values = []
    for node in nodes:
        near = weight * np.exp(-0.5 * (np.log2(hz / node) / SMOOTH_OCTAVES) ** 2) + 1e-12
        order = np.argsort(decay)
        share = np.cumsum(near[order]) / near.sum()
        values.append(float(decay[order][np.searchsorted(share, 0.5)]))  # the weighted median bears outliers
    return tuple(float(node) for node in nodes), tuple(values)


def strung(
    physics: LearnedPhysics, kind: Kind, length_m: float | None = None, gauge_mm: float | None = None
) -> Strung:
    """The string of a kind that has the sound's pitch, stiffness, decay and glide.

    Args:
        length_m: the sounding length; None: that of the kind.
        gauge_mm: the diameter; None: what the tension of the kind asks for.
    """
    build = BUILDS[kind]
    f0 = physics.f0_hz
    assumed = []
    length = length_m or build.length_m
    if length_m is None:
        assumed.append(f"length {length:g} m of a {kind}")
    density = build.density_kg_m3
    assumed.append(f"density {density:g} kg/m³")
    if gauge_mm is not None:
        area = math.pi * (gauge_mm / 2000) ** 2
    else:
        area = build.tension_n / (density * (2 * length * f0) ** 2)
        assumed.append(f"tension {build.tension_n:g} N, and with it the gauge")
    mass = density * area
    tension = mass * (2 * length * f0) ** 2
    modulus = build.youngs_modulus_pa
    second_moment = max(physics.stiffness, 1e-9) * tension * length**2 / (math.pi**2 * modulus)
    d1, d3 = _damping(physics, mass, length)
    position = pluck_place(physics)
    assumed.append(f"pluck at {position:.2f} or {1 - position:.2f} of the length: both sound alike")
    # A triangle of height 1 m at p has the slopes 1/(p ℓ) and -1/((1 - p) ℓ), whose mean square is 1/(p (1 - p) ℓ²).
    squares = 2 / (position * (1 - position) * length**2)  # Σ η² q², which is twice that
    wanted = 4 * physics.rise  # ΔT/T₀ at the height: the mean over a period is half, and of a frequency half of that
    amplitude = math.sqrt(max(wanted, 1e-9) * 4 * tension / (modulus * area * squares))  # ΔT = EA/4 Σ η² q²
    low, high = 2e-4, 8e-3  # m, of plucks; beyond them the modulus gives way, while EI and so the stiffness stay
    if not low <= amplitude <= high:
        chosen = min(max(amplitude, low), high)
        effective = modulus * (amplitude / chosen) ** 2
        second_moment *= modulus / effective
        assumed.append(f"a pluck of {1000 * chosen:.2g} mm; the modulus, {effective:.2g} Pa, follows from the glide")
        amplitude, modulus = chosen, effective
    else:
        assumed.append(f"modulus {modulus:.3g} Pa; the pluck, {1000 * amplitude:.2g} mm, follows from the glide")
    string = StringParameters(length, area, second_moment, density, modulus, d1, d3, tension)
    return Strung(string, amplitude, position, tuple(assumed))


def _damping(physics: LearnedPhysics, mass: float, length: float) -> tuple[float, float]:
    """d₁ and d₃ with σ = (d₁ + d₃ η²)/2ρA, neither below 0, nearest to the smooth decay in its own measure."""
    hz, sigma = np.array(physics.smooth_hz), np.array(physics.smooth_decay)
    eta = 2 * math.pi * hz / (2 * length * physics.f0_hz)  # of a flexible string
    rows = np.stack([np.ones_like(eta), eta**2], 1) / (2 * mass * sigma[:, None])
    scale = np.linalg.norm(rows, axis=0)
    coefficients, _ = optimize.nnls(rows / scale, np.ones(len(sigma)))
    d1, d3 = coefficients / scale
    least = 2 * mass * 0.02
    return float(max(d1, least)), float(d3)


def pluck_place(physics: LearnedPhysics) -> float:
    """The place of a triangle's pluck, below one half, by the comb of the partials' amplitudes; it is a guess.

    Of places that fit nearly alike, that whose nodes cost the instrument least: it cannot make up for a node.
    """
    k = np.array([partial.number for partial in physics.partials], float)
    level = np.log([partial.amplitude for partial in physics.partials])
    if len(k) < 6:
        return 0.2
    k, level = k[:40], level[:40]
    smooth = np.stack([np.ones_like(k), np.log(k), np.log(k) ** 2, k], 1)
    candidates = []
    for place in np.linspace(0.06, 0.5, 111):
        heights = np.abs(np.sin(math.pi * k * place))
        comb = np.log(np.maximum(heights, 0.08))
        solution, *_ = np.linalg.lstsq(smooth, level - comb, rcond=None)
        left = float(np.sum((level - comb - smooth @ solution) ** 2))
        missing = np.log(COMB_FLOOR / np.clip(heights, 1e-3, COMB_FLOOR))
        candidates.append((left, float(np.sum(missing**2)), float(place)))
    most = NEARLY_ALIKE * min(left for left, _, _ in candidates)
    return round(min((missing, place) for left, missing, place in candidates if left <= most)[1], 3)


def corrections(physics: LearnedPhysics, string: StringParameters) -> dict[str, tuple[float, ...]]:
    """The corrections by the note's partials to the law of its string, by name; see `RecordedString` for each.

    Those of partials have an entry for each number from 1 to the highest; one that was not heard has no correction.
    """
    count = max(partial.number for partial in physics.partials)
    omega = undamped_frequencies(string, count)
    sigma = decay_rates(string, count)
    # σ by the string's law at the frequencies of the smooth decay, as a logarithm
    law = np.interp(np.log(physics.smooth_hz), np.log(omega / (2 * math.pi)), np.log(sigma))
    smooth_ratio = np.clip(np.array(physics.smooth_decay) / np.exp(law), *RATIOS)
    nodes = np.log(2 * math.pi * np.array(physics.smooth_hz))
    smooth = sigma * np.exp(np.interp(np.log(omega), nodes, np.log(smooth_ratio)))
    pairs = [partial.poles for partial in physics.partials if len(partial.poles) == 2]
    # typical second polarisation: cents above the first, and times its decay; for partials that show none
    split = float(np.median([_split(pair) for pair in pairs])) if pairs else 0.0
    slower = float(np.median([second.decay / first.decay for first, second in pairs])) if pairs else 1.0
    cents = np.zeros(count)
    ratio = np.ones(count)
    share = np.zeros(count)
    second_cents, second_ratio = np.full(count, split), np.full(count, slower)
    for partial in physics.partials:
        place = partial.number - 1
        first = partial.poles[0]
        cents[place] = 1200 * math.log2(abs(first.s) / omega[place])
        beside = [pole.decay / smooth[place] for pole in partial.poles]
        if not any(1 / MOST_BESIDE_SMOOTH < apart < MOST_BESIDE_SMOOTH for apart in beside):
            continue  # of noise or the body, not of the string: it decays as its neighbours do
        ratio[place] = first.decay / smooth[place]
        if len(partial.poles) == 2:
            second = partial.poles[1]
            second_cents[place] = _split(partial.poles)
            second_ratio[place] = second.decay / first.decay
            share[place] = abs(second.a) / (abs(first.a) + abs(second.a))
    return {
        "smooth_hz": physics.smooth_hz,
        "smooth_ratio": tuple(smooth_ratio.tolist()),
        "cents": tuple(np.clip(cents, -MOST_CENTS, MOST_CENTS).tolist()),
        "ratio": tuple(np.clip(ratio, *RATIOS).tolist()),
        "second_cents": tuple(np.clip(second_cents, 0.0, MOST_CENTS).tolist()),
        "second_ratio": tuple(np.clip(second_ratio, *RATIOS).tolist()),
        "second_share": tuple(share.tolist()),
    }


def _split(poles: tuple[Pole, ...]) -> float:
    """Cents between two poles."""
    return 1200 * math.log2(poles[1].hz / poles[0].hz)
