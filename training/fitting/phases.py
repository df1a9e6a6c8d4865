"""A start from the displacement alone: shapes, eigenvalues, and how energies shift frequencies.

For an integrated phase, which has that form; `training.research.fourier_wiring` adds the Fourier cells.

The shapes that the motions show (`modes`) keep theirs while their frequencies move. A string starts at rest. Mode
n then moves, with its start q_n and all starts' energies E_m(t) = q_m² e^{-2σ_m t}, by

    q_n(t) = q_n Re s_n exp[(-σ_n + iω_n) t + i Σ_m κ_nm ∫₀ᵗ E_m(s) ds],     s_n ≈ 1,

where σ_n, ω_n, s_n and the row κ_n are found by least squares, one mode after another. A phase can only be followed
while it is known to less than half a turn. So the first fit sees a dozen frames, and each further one more of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.optimize import least_squares

from engine.models.base import StringModes
from training.fitting.modes import SLOWEST, Modes

FIRST_FRAMES = 12
MORE_FRAMES = 1.4  # times as many in each further fit
SAMPLES = 10_000  # of all motions' frames, which a fit sees
EVALUATIONS = 12  # of a fit, at most: the next one continues from there

Floats = NDArray[np.float64]


def _store_in_integrated_phase(model: Any, modes: Modes, seed: int) -> None:
    model.store_modes(fit_phases(modes, seed))


# by model: gives it what the motions of the modes that were found show
STORES: dict[str, Callable[[Any, Modes, int], None]] = {"koopman_integrated": _store_in_integrated_phase}
WIRED = "its start is computed: train it with .venv/bin/python -m training.research.fourier_wiring RUN"


def fit_phases(modes: Modes, seed: int) -> StringModes:
    """The least-squares fits of the module to all frames of `modes.motions`."""
    motions = modes.motions.numpy()
    trajectories, frames, count = motions.shape
    generator = np.random.default_rng(seed)
    energies = motions[:, 0] ** 2
    guesses = [first_guess(motions[..., mode], count) for mode in range(count)]
    slowest = SLOWEST / (frames - 1)  # of energies: a fit to a few frames may find them growing
    for last in horizons(frames):
        rows, times = generator.integers(trajectories, size=SAMPLES), generator.integers(1, last + 1, size=SAMPLES)
        sigma = np.array([max(guess[1], slowest) for guess in guesses])
        integrals = energies[rows] * -np.expm1(-2 * sigma * times[:, None]) / (2 * sigma)
        for mode, guess in enumerate(guesses):
            motion = ModeMotion(motions[rows, 0, mode], motions[rows, times, mode], times.astype(float), integrals)
            guesses[mode] = motion.fitted(guess)
    return string_modes([upright(guess) for guess in guesses], slowest, modes)


def horizons(frames: int) -> Iterator[int]:
    """The last frame of each fit, up to the last of all."""
    last = min(FIRST_FRAMES, frames - 1)
    yield last
    while last < frames - 1:
        last = min(frames - 1, int(MORE_FRAMES * last) + 1)
        yield last


def string_modes(motions: list[Floats], slowest: float, modes: Modes) -> StringModes:
    """The modes as fitted.

    Args:
        motions: of each mode ω, σ, Re s, Im s and its κ (modes,); without κ the modes are uncoupled.
        slowest: least σ in nepers a sample.
        modes: their shapes, and their motions for the starts.
    """
    omega, sigma, real, imag = np.array(motions)[:, :4].T
    count = len(motions)
    coupling = np.array(motions)[:, 4:] if len(motions[0]) > 4 else np.zeros((count, count))
    return StringModes(
        modes.shapes,
        torch.from_numpy(-np.maximum(sigma, slowest) + 1j * omega),
        torch.from_numpy(real + 1j * imag),
        torch.from_numpy(coupling),
        modes.motions[:, 0].square(),
    )


def first_guess(motions: Floats, count: int) -> Floats:
    """The guess of ω, σ, Re s, Im s and κ (count,) from the first frames of a mode's motions (trajectories, frames).

    ω is the frequency at which u(t+1) + u(t-1) = 2 cos ω u(t).
    """
    first = motions[:, : 4 * FIRST_FRAMES]
    now = first[:, 1:-1]
    cosine = np.sum(now * (first[:, 2:] + first[:, :-2])) / (2 * np.sum(now**2))
    return np.array([np.arccos(np.clip(cosine, -1, 1)), 0.0, 1.0, 0.0, *np.zeros(count)])


def upright(guess: Floats) -> Floats:
    """The same motion with ω ≥ 0: its cosine does not tell a phase from the negative one."""
    omega, sigma, real, imag = guess[:4]
    sign = math.copysign(1.0, omega)
    return np.array([sign * omega, sigma, real, sign * imag, *sign * guess[4:]])


@dataclass(frozen=True)
class ModeMotion:
    """Samples of a mode's motion, each of some trajectory at some time.

    Attributes:
        start, displacement: the mode's amplitude at frame 0 and at the sample, (samples,).
        times: in frames, (samples,).
        integrals: of the energy of each mode up to the sample, (samples, modes).
    """

    start: Floats
    displacement: Floats
    times: Floats
    integrals: Floats

    def fitted(self, guess: Floats) -> Floats:
        """A better guess by least squares; numbers and their order are those of `first_guess`."""
        fit = least_squares(
            self._error, guess, self._slopes, method="lm", x_scale="jac", ftol=1e-4, max_nfev=EVALUATIONS
        )
        return np.asarray(fit.x)

    def _error(self, guess: Floats) -> Floats:
        return self._latent(guess).real - self.displacement

    def _slopes(self, guess: Floats) -> Floats:
        """The derivatives of `_error` by ω, σ, Re s, Im s and each κ, (samples, unknowns)."""
        latent = self._latent(guess)
        turn = latent / complex(guess[2], guess[3])
        along = np.stack([-latent.imag * self.times, -latent.real * self.times, turn.real, -turn.imag], axis=1)
        return np.concatenate([along, -latent.imag[:, None] * self.integrals], axis=1)

    def _latent(self, guess: Floats) -> NDArray[np.complex128]:
        """The complex amplitude at each sample, (samples,), whose real part is the displacement."""
        omega, sigma, real, imag = guess[:4]
        phase = omega * self.times + self.integrals @ guess[4:]
        return self.start * complex(real, imag) * np.exp(-sigma * self.times + 1j * phase)
