"""Synthetic recordings of which all is known: the project's own solver, a body, noise, a second polarisation."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from engine.resonators.base import Resonator
from engine.resonators.string import resonator_of
from engine.truth import ModalState
from engine.truth.splitting import SplittingSolver
from engine.values.string import StringParameters
from training.recording.fit import LearnedNote
from training.recording.glide import CENTS, Glide
from training.recording.intervals import figures_of
from training.recording.note import FIT_BEGINS_S, Note
from training.recording.numbering import PartialSeries, partial_hz
from training.recording.refine import Pole

Array = NDArray[np.float64]

RATE_HZ = 44_100
LEAD_S = 0.1


@dataclass(frozen=True)
class TruePartial:
    """At rest, from 8 ms on: mean frequency over its energy, σ of the same centre of energy, level of it in dB."""

    number: int
    hz: float
    decay: float
    level_db: float


@dataclass(frozen=True)
class SyntheticNote:
    """A recording and its truth."""

    samples: Array
    rate_hz: int
    f0_hz: float
    stiffness: float
    partials: tuple[TruePartial, ...]


def synthetic_note(
    seed: int,
    seconds: float = 2.8,
    snr_db: float = 50.0,
    rise_cents: float = 15.0,
    f0_range_hz: tuple[float, float] = (60.0, 350.0),
    highest_hz: float = 4_000.0,
    damping: tuple[float, float] = (0.6, 2.0),
    body_db: tuple[float, float] = (-36.0, -20.0),
) -> SyntheticNote:
    """A note drawn by its seed: a string, plucked anywhere, two polarisations, six body modes.

    Args:
        damping: range of the first polarisation's loss at low frequencies, in 1/s.
        body_db: range of the body's modes, below the string's peak.
    """
    random = np.random.default_rng(seed)
    low, high = map(math.log, f0_range_hz)
    f0 = float(np.exp(random.uniform(low, high)))
    stiffness = float(10 ** random.uniform(-5, -3.7))
    count = max(3, min(30, int(highest_hz / f0)))
    length, mass, modulus, area = 0.65, 1e-3, 2e11, 1e-7
    tension = mass * (2 * length * f0) ** 2
    d1 = 2 * mass * random.uniform(*damping)
    d3 = 2 * mass * random.uniform(1.0, 4.0) / (math.pi * 1_000 / (f0 * length)) ** 2
    second = stiffness * tension * length**2 / (math.pi**2 * modulus)
    string = StringParameters(length, area, second, mass / area, modulus, d1, d3, tension)
    law = resonator_of(string, count, grid_points=count + 2)
    split = 2 ** (random.uniform(0.4, 2.0, count) / 1200)
    slower = np.exp(random.uniform(-0.7, 0.7, count))  # than the first, or faster
    pair = np.arange(2 * count) // 2
    omega = np.stack([law.omega, law.omega * split], 1).ravel()
    sigma = np.stack([law.sigma, law.sigma * slower], 1).ravel()
    tables = law.coupling[pair], law.stretch[pair], law.tension_rise, law.shapes[pair], law.inverse[:, pair]
    resonator = Resonator(omega, sigma, *tables)
    k = np.arange(1, count + 1)
    place, listened = random.uniform(0.08, 0.4), random.uniform(0.05, 0.12)
    shape = np.sin(math.pi * k * place) / k**2
    share = random.uniform(0.25, 0.75)
    q = np.stack([share * shape, (1 - share) * shape], 1).ravel()
    wanted = 4 * (2 ** (rise_cents * random.uniform(0, 1) / 1200) - 1)
    q *= math.sqrt(max(wanted, 1e-9) / float(resonator.relative_tension_rise(q)))
    solver = SplittingSolver(resonator, RATE_HZ, substeps=4, silence=1e-7)
    modes = solver.solve(ModalState.at_rest(q[None]), round(seconds * RATE_HZ))[0]
    heard = np.repeat(k * np.sin(math.pi * k * listened), 2)
    sound = modes @ heard
    scale = 0.3 / float(np.abs(sound).max())
    sound = scale * sound
    t = np.arange(len(sound)) / RATE_HZ
    for _ in range(6):
        hz, quality = math.exp(random.uniform(math.log(90), math.log(900))), random.uniform(10, 40)
        phase, level = random.uniform(0, 2 * math.pi), 0.3 * 10 ** (random.uniform(*body_db) / 20)
        sound += level * np.exp(-math.pi * hz / quality * t) * np.sin(2 * math.pi * hz * t + phase)
    noise = float(np.sqrt(np.mean(sound[:RATE_HZ] ** 2))) * 10 ** (-snr_db / 20)
    sound = np.concatenate([np.zeros(round(LEAD_S * RATE_HZ)), sound])
    sound += noise * random.standard_normal(len(sound))
    s = -sigma + 1j * np.sqrt(omega**2 - sigma**2)
    a = scale * heard * q * np.exp(s.real * FIT_BEGINS_S)
    of_pairs = a.astype(complex).reshape(-1, 2), -s.real.reshape(-1, 2), s.imag.reshape(-1, 2)
    figures = np.stack(figures_of(*of_pairs), 1).tolist()
    partials = tuple(TruePartial(number, *each) for number, each in enumerate(figures, 1))
    return SyntheticNote(sound, RATE_HZ, f0, stiffness, partials)


def modelled_note(
    seed: int, polarisations: int, seconds: float = 1.0, cents: float = 0.0, loudness: float = 1.0
) -> tuple[LearnedNote, Note, PartialSeries]:
    """A note of the form that a fit has, drawn by its seed, its recording with a faint noise, and its series.

    Args:
        cents, loudness: of another take of the same string; its glide follows the square of its amplitude.
    """
    random = np.random.default_rng(seed)
    f0, stiffness = math.exp(random.uniform(math.log(90), math.log(300))), 10 ** random.uniform(-5, -3.7)
    poles, rate_hz, noise = [], 22_050, 1e-4
    for k in range(1, 9):
        hz = float(partial_hz(k, f0, stiffness))
        decay, a = random.uniform(1, 4) + hz / 1_000, 0.1 * k**-1.2 * np.exp(2j * math.pi * random.uniform())
        poles.append(Pole(complex(-decay, 2 * math.pi * hz), complex(a), k))
        if polarisations == 2:
            split, slower = 2 ** (random.uniform(1.5, 5) / 1200), random.uniform(0.4, 0.8)
            poles.append(Pole(complex(-slower * decay, 2 * math.pi * hz * split), 0.4j * complex(a), k))
    glide = Glide(random.uniform(2, 12, 3) * CENTS * loudness**2)
    higher = 2 ** (cents / 1200)
    poles = [replace(pole, s=pole.s * higher, a=pole.a * loudness) for pole in poles]
    learned = LearnedNote(rate_hz, f0 * higher, stiffness, glide, tuple(poles))
    samples = learned.render(np.arange(round(seconds * rate_hz)) / rate_hz - FIT_BEGINS_S)
    samples = samples + noise * random.standard_normal(len(samples))
    series = PartialSeries(f0 * higher, stiffness, tuple(range(1, 9)), 1.0, 0.0, 1.0)
    return learned, Note(samples, rate_hz, 0, noise**2), series


def figures_at_rest(poles: Sequence[Pole]) -> tuple[float, float, float]:
    """The mean frequency in Hz, σ and level in dB of a partial's poles."""
    a, s = np.array([[pole.a for pole in poles]]), np.array([[pole.s for pole in poles]])
    hz, decay, level = figures_of(a, -s.real, s.imag)
    return float(hz[0]), float(decay[0]), float(level[0])
