"""The spectrum of a note in warped time, its poles there, and the steps of its glide.

The spectrum of a decaying exponential over N samples is known in closed form, (1 - q^N)/(1 - q). So a note falls into
bands, one around each partial, that are fitted each by itself in a few hundred bins; what other bands leak into it is
subtracted. `sweeps` has the steps of its poles. The glide is shared by all bands: its columns border their Jacobians,
and a Schur complement eliminates all that belongs to one band alone.

Poles that do not glide (body, neighbouring strings) bend in warped time. They are one more block, fitted together;
their spectra are computed by FFT at a lower rate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy import fft, linalg

from engine.resonators.base import Array
from training.recording.glide import CENTS, PRIOR_CENTS, PRIOR_PITCH_CENTS, Glide, basis, warped

Complex = NDArray[np.complex128]

LEAST_DECAY = 0.05  # σ, in 1/s
MOST_FREE_DECAY = 250.0  # of a pole that does not glide, in 1/s
WIDEST = 0.4  # σ of a string's pole, of a band's width in Hz
RIDGE = 1e-4  # of the bins' squares, on amplitudes: two near poles must not cancel each other
GLIDE_FIRMNESS = 1000.0  # how many times a residual counts that is correlated from bin to bin
OVERLAP = 0.5  # of a band's width, that its fit looks into its neighbours
LEAK_HZ = 4_000.0  # how far the strongest pole is followed into other bands
COARSE = 8  # times fewer samples for free poles
MOST_GLIDE = (-0.02, 0.08)  # of each share
MOST_PITCH = 0.02  # of a take, above the first or below
LARGEST_STEP = 60.0  # of ω in rad/s
MOST_SPLIT_CENTS = 25.0  # between two polarisations
MOST_DECAYS_APART = 8.0  # times one's σ, the other's
LONGEST_WINDOW = 120  # steps of an envelope, of the subspace
FREE = -1  # the place of the poles that do not glide, behind all bands


@dataclass(frozen=True)
class Pole:
    """A pole s = -σ + iω in 1/s with its amplitude: Re(a exp(s τ)); partial 0: free, Re(a exp(s t))."""

    s: complex
    a: complex = 0j
    partial: int = 0

    @property
    def hz(self) -> float:
        return self.s.imag / (2 * math.pi)

    @property
    def decay(self) -> float:
        return -self.s.real


@dataclass
class Fit:
    """A note's poles while they are refined, and its spectrum in warped time.

    A band is the range of frequencies around one partial; band n holds partial n + 1. A bin is a frequency of the
    FFT. Free poles are those that do not glide; their number is `FREE`.

    Attributes:
        samples: that are fitted, (frames,).
        edges_hz: of the bands, ascending, (partials + 1,).
        partials_hz: where partials are expected, (partials,).
        poles: of each band, and last those that do not glide.
        tuned: whether its pitch differs from that of the poles, which it shares with another take.
    """

    samples: Array
    rate_hz: int
    edges_hz: Array
    partials_hz: Array
    glide: Glide
    poles: list[list[Pole]] = field(default_factory=list)
    tuned: bool = False

    def __post_init__(self) -> None:
        self.poles = self.poles or [[] for _ in range(len(self.partials_hz) + 1)]
        self.width_hz = np.diff(self.edges_hz)
        # samples of the FFT with zeros behind the note; a multiple of COARSE
        self.size = COARSE * fft.next_fast_len(math.ceil((1.04 * len(self.samples) + 64) / COARSE))
        self.step_hz = self.rate_hz / self.size  # from bin to bin
        first = np.floor((self.edges_hz[:-1] - OVERLAP * self.width_hz) / self.step_hz).astype(int)
        last = np.ceil((self.edges_hz[1:] + OVERLAP * self.width_hz) / self.step_hz).astype(int)
        self.highest = int(min(last.max(), self.size // 2))  # number of bins that are used
        self.bands = [slice(max(1, low), min(high, self.highest)) for low, high in zip(first, last, strict=True)]
        self.omega = 2 * math.pi * self.step_hz * np.arange(self.highest)  # rad/s, (bins,)
        self.turn = np.exp(-1j * self.omega / self.rate_hz)
        self._look()

    def _look(self) -> None:
        """Compute `data`, the spectrum (bins,) of the samples as the glide warps them, and their `times` in s."""
        data, times = warped(self.samples, self.rate_hz, self.glide)
        data, self.times = data[: self.size], times[: self.size]  # a large glide stretches time beyond the spectrum's
        self.count = len(data)
        self.data = fft.rfft(data, self.size)[: self.highest]
        self.last_turn = np.exp(-1j * self.omega * (self.count / self.rate_hz))
        self.energy = float(np.sum(data**2)) * self.size / 2

    def set_glide(self, glide: Glide) -> None:
        """Set the glide, and compute the spectrum again."""
        self.glide = glide
        self._look()

    # Spectra

    def spectra(self, pole: Pole, bins: slice, slope: bool = True) -> tuple[Complex, Complex]:
        """The spectra of exp(sτ) or exp(st), and of its derivative by s, each with the conjugate's, (2, bins)."""
        if pole.partial == 0:
            return self._bent(pole, bins)
        both = np.array([[pole.s], [pole.s.conjugate()]]) / self.rate_hz
        q = np.exp(both) * self.turn[bins]
        last = np.exp(both * self.count) * self.last_turn[bins]
        below = 1 / (1 - q)
        value = (1 - last) * below
        return value, ((q * value - self.count * last) * below / self.rate_hz if slope else value)

    def _bent(self, pole: Pole, bins: slice) -> tuple[Complex, Complex]:
        """The result of `spectra` for a free pole: sums over samples by the trapezoidal rule over every eighth."""
        t = self.times[::COARSE]
        shape = np.exp(pole.s * t)
        spectrum = COARSE * fft.fft(np.stack([shape, shape * t]), self.size // COARSE)
        spectrum[0] -= (COARSE - 1) / 2 * shape[0]
        most = self.size // (2 * COARSE)
        index = np.arange(bins.start, bins.stop)
        inside = index < most
        value, slope = np.zeros((2, len(index)), complex), np.zeros((2, len(index)), complex)
        value[0, inside], slope[0, inside] = spectrum[:, index[inside]]
        value[1, inside], slope[1, inside] = spectrum[:, -index[inside]].conj()
        return value, slope

    def model(self, poles: list[Pole] | None = None, derivative: bool = False) -> Complex:
        """The spectrum of poles, all by default, as far as they leak; or of their derivative by τ."""
        chosen = self.every() if poles is None else poles
        total = np.zeros(self.highest, complex)
        loudest = max((abs(pole.a) for pole in chosen), default=0.0)
        for pole in chosen:
            if pole.a:
                where = self.reach(pole, loudest)
                total[where] += self.part([replace(pole, a=pole.a * pole.s) if derivative else pole], where)
        return total

    def gliding(self) -> list[Pole]:
        """The poles of all bands."""
        return [pole for band in self.poles[:FREE] for pole in band]

    def every(self) -> list[Pole]:
        """The poles of all bands, then the free ones."""
        return self.gliding() + self.poles[FREE]

    def bins(self, number: int) -> slice:
        """The bins in which the poles of a band, or the free ones, are fitted."""
        if number != FREE:
            return self.bands[number]
        reach = max((pole.hz + 4 * pole.decay + 30 for pole in self.poles[FREE]), default=0.0)
        return slice(1, min(self.highest, max(2, round(reach / self.step_hz))))

    # Steps

    def start(self, number: int, count: int) -> list[Pole]:
        """The first poles in the band `number`, `count` or fewer, without amplitudes, by its complex envelope."""
        first, last = (round(self.edges_hz[edge] / self.step_hz) for edge in (number, number + 1))
        envelope = fft.ifft(self.data[first:last])
        step = self.size / ((last - first) * self.rate_hz)
        usable = int((last - first) * self.count / self.size)
        roots = subspace_poles(envelope[1 : max(2, usable - 1)], count)
        poles = []
        for z in roots:
            decay = -math.log(max(abs(z), 1e-9)) / step
            hz = (first * self.step_hz) + np.mod(np.angle(z), 2 * math.pi) / (2 * math.pi * step)
            if abs(hz - self.partials_hz[number]) < self._far_hz(number):
                decay = min(max(decay, 0.3), 0.5 * WIDEST * self.width_hz[number])
                poles.append(Pole(complex(-decay, 2 * math.pi * hz), partial=number + 1))
        return poles

    def _far_hz(self, number: int) -> float:
        """The farthest that a pole of a band may lie from its partial's place."""
        return 0.3 * float(self.width_hz[number])

    def solve(self, poles: list[Pole], target: Complex, where: slice) -> tuple[float, list[Pole], Complex]:
        """Find amplitudes by least squares; return the energy left, the poles with them, and the residual (bins,)."""
        columns, _ = self.columns(poles, where)
        amplitudes = projector(columns) @ real_rows(target)
        pairs = amplitudes.reshape(-1, 2)
        solved = [replace(pole, a=complex(*pair)) for pole, pair in zip(poles, pairs, strict=True)]
        residual = target - columns @ amplitudes
        return float(np.vdot(residual, residual).real), solved, residual

    def columns(self, poles: list[Pole], where: slice) -> tuple[Complex, Complex]:
        """The columns of Re a, Im a of each pole, and of log σ, ω: (bins, 2 poles) each."""
        linear, bent = [], []
        for pole in poles:
            value, slope = self.spectra(pole, where)
            linear += [0.5 * (value[0] + value[1]), 0.5j * (value[0] - value[1])]
            moved, mirrored = pole.a * slope[0], pole.a.conjugate() * slope[1]
            bent += [0.5 * pole.s.real * (moved + mirrored), 0.5j * (moved - mirrored)]
        return np.stack(linear, 1), np.stack(bent, 1)

    def moved(self, pole: Pole, step: Array) -> Pole:
        """A pole after a step (2,) of log σ and of ω in rad/s, held within its bounds; its amplitude stays."""
        decay = pole.decay * math.exp(float(np.clip(step[0], -1.0, 1.0)))
        omega = pole.s.imag + float(np.clip(step[1], -LARGEST_STEP, LARGEST_STEP))
        if number := pole.partial:
            decay = min(max(decay, LEAST_DECAY), WIDEST * self.width_hz[number - 1])
            middle, far = (2 * math.pi * hz for hz in (self.partials_hz[number - 1], self._far_hz(number - 1)))
            omega = min(max(omega, middle - far), middle + far)
        else:
            decay = min(max(decay, LEAST_DECAY), MOST_FREE_DECAY)
            omega = min(max(omega, 2 * math.pi * 15.0), 0.8 * math.pi * self.rate_hz / COARSE)
        return Pole(complex(-decay, omega), pole.a, pole.partial)

    def part(self, poles: list[Pole], where: slice) -> Complex:
        """The spectrum (bins,) of poles with their amplitudes, in some bins."""
        total = np.zeros(where.stop - where.start, complex)
        for pole in poles:
            value, _ = self.spectra(pole, where, slope=False)
            total += 0.5 * (pole.a * value[0] + pole.a.conjugate() * value[1])
        return total

    def reach(self, pole: Pole, loudest: float) -> slice:
        """The bins into which a pole leaks, the more the nearer its |a| is to `loudest`, that of the loudest one."""
        reach = 2.5 * float(self.width_hz.max()) + LEAK_HZ * abs(pole.a) / max(loudest, 1e-300) + pole.decay
        low, high = (round((pole.hz + side * reach) / self.step_hz) for side in (-1, 1))
        return slice(min(self.highest, max(1, low)), max(1, min(self.highest, high)))

    def step_glide(self) -> Glide:
        """The glide that leaves less, to first order, when every pole of the string may follow."""
        square, right, prior = self._border()
        present = np.append(self.glide.shares, self.glide.pitch)[: len(right)]
        step = np.linalg.solve(square + np.diag(prior), right - prior * present)
        shares = np.clip(self.glide.shares + step[: len(self.glide.shares)], *MOST_GLIDE)
        pitch = self.glide.pitch + (step[-1] if self.tuned else 0.0)
        return Glide(shares, float(np.clip(pitch, -MOST_PITCH, MOST_PITCH)))

    def _border(self) -> tuple[Array, Array, Array]:
        """The glide's normal equations once all poles are eliminated, and its prior.

        Returns:
            matrix (n, n), right side (n,) and the prior's diagonal (n,), where n counts the shares, and the pitch
            last where it is tuned.
        """
        residual = self.data - self.model()
        slope = self.model(self.gliding(), derivative=True)
        slope = fft.irfft(np.pad(slope, (0, self.size // 2 + 1 - len(slope))), self.size)
        moves, cents = basis(self.times), PRIOR_CENTS
        if self.tuned:
            moves, cents = np.column_stack([moves, self.times]), np.append(cents, PRIOR_PITCH_CENTS)
        shifted = moves.T * slope[: self.count]
        columns = fft.rfft(shifted, self.size)[:, : self.highest].T
        square, right = np.zeros((len(shifted), len(shifted))), np.zeros(len(shifted))
        left, bins = 0.0, 0
        for number, where in enumerate(self.bands):
            if not self.poles[number]:
                continue
            tangent = np.concatenate([real_rows(part) for part in self.columns(self.poles[number], where)], 1)
            tangent = tangent / (np.linalg.norm(tangent, axis=0) + 1e-300)
            border, rest = real_rows(columns[where]), real_rows(residual[where])
            inverse = np.linalg.pinv(tangent.T @ tangent, rcond=1e-9)
            border, rest = (
                border - tangent @ (inverse @ (tangent.T @ border)),
                rest - tangent @ (inverse @ (tangent.T @ rest)),
            )
            square += border.T @ border
            right += border.T @ rest
            left += float(rest @ rest)
            bins += 2 * (where.stop - where.start)
        variance = left / max(bins, 1)
        return square, right, variance * GLIDE_FIRMNESS / (cents * CENTS) ** 2


def polarisations(poles: list[Pole], most_decays_apart: float = MOST_DECAYS_APART) -> list[Pole]:
    """The loudest pole of a partial and the one that may be its other polarisation, the lower one first.

    A pole that is far off, or decays at another rate altogether, is the body's.

    Args:
        most_decays_apart: the largest ratio of their decay rates.
    """
    if not poles:
        return []
    main, *others = sorted(poles, key=lambda pole: -(abs(pole.a) ** 2) / pole.decay)
    kept = [
        pole
        for pole in others
        if abs(1200 * math.log2(pole.hz / main.hz)) < MOST_SPLIT_CENTS
        and 1 / most_decays_apart < pole.decay / main.decay < most_decays_apart
    ]
    return sorted([main, *kept[:1]], key=lambda pole: pole.hz)


def subspace_poles(envelope: Complex, count: int) -> Complex:
    """`count` factors z a step with envelope ≈ Σ a z^m, fewer where it is too short, (poles,).

    By the shift invariance of their subspace (ESPRIT; Roy, Kailath 1989): erratic on real notes, so a start only.
    """
    length = min(len(envelope) // 2, LONGEST_WINDOW)
    if length <= count:
        return np.zeros(0, complex)
    rows = linalg.hankel(envelope[: len(envelope) - length + 1], envelope[len(envelope) - length :])
    _, vectors = linalg.eigh(rows.conj().T @ rows, subset_by_index=(length - count, length - 1))
    space = vectors.conj()
    turned, *_ = linalg.lstsq(space[:-1], space[1:])
    return np.asarray(linalg.eigvals(turned))


def moments(a: Complex, s: Complex) -> tuple[Array, Array, Array]:
    """∫ |z|², its moment in time and ∫ Im z' z̄ of z = Σ a exp(st), for poles (…, poles)."""
    sums = s[..., :, None] + s[..., None, :].conj()
    pairs = a[..., :, None] * a[..., None, :].conj()
    energy = -pairs / sums
    moment = pairs / sums**2
    turn = -pairs * s[..., :, None] / sums
    return energy.sum((-2, -1)).real, moment.sum((-2, -1)).real, turn.sum((-2, -1)).imag


def real_rows(columns: Complex) -> Array:
    """Real parts above imaginary ones: (bins, …) to (2 bins, …)."""
    return np.concatenate([columns.real, columns.imag])


def projector(columns: Complex) -> Array:
    """The matrix (2 poles, 2 bins) that turns a spectrum, as `real_rows`, into amplitudes by ridge regression.

    Args:
        columns: of amplitudes, (bins, 2 poles).
    """
    a = real_rows(columns)
    square = a.T @ a
    square[np.diag_indices_from(square)] *= 1 + RIDGE
    square[np.diag_indices_from(square)] += 1e-300
    return np.asarray(np.linalg.solve(square, a.T), np.float64)
