"""Steps of the poles of one note, or of several takes that share them, by variable projection.

Amplitudes are linear and eliminated (Golub, Pereyra 1973; Kaufman 1975); steps are Levenberg's and Marquardt's. Takes
share s of each pole; amplitude, glide and pitch are each take's own. All takes count alike, however loud they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from engine.resonators.base import Array
from training.recording.refine import FREE, Complex, Fit, Pole, projector, real_rows

SETTLED = 1e-6  # of the energy: a band that gained less is visited less often
REST = 3  # sweeps, for such a band
FIRST_DAMPING = 1e-2
LEAST_DAMPING = 1e-4
MOST_DAMPING = 1e4


@dataclass
class Takes:
    """Takes of one note; all have the same bands.

    Attributes:
        damping: of the steps of each band; `free_damping`: of the poles that do not glide.
        rests: sweeps in which each band is not visited.
    """

    fits: Sequence[Fit]
    free_damping: float = FIRST_DAMPING
    damping: Array = field(init=False)
    rests: NDArray[np.int_] = field(init=False)

    def __post_init__(self) -> None:
        bands = len(self.fits[0].partials_hz)
        self.damping, self.rests = np.full(bands, FIRST_DAMPING), np.zeros(bands, int)
        self.weights = [self.fits[0].energy / fit.energy for fit in self.fits]

    def residuals(self) -> list[Complex]:
        """The part of each take's spectrum that all poles leave."""
        return [fit.data - fit.model() for fit in self.fits]

    def poles(self, number: int) -> list[list[Pole]]:
        """The poles of a band, or the free ones, in each take."""
        return [fit.poles[number] for fit in self.fits]

    def set_poles(self, number: int, poles: Sequence[list[Pole]]) -> None:
        for fit, of_take in zip(self.fits, poles, strict=True):
            fit.poles[number] = of_take

    def bins(self, number: int) -> list[slice]:
        return [fit.bins(number) for fit in self.fits]

    def targets(
        self, poles: Sequence[list[Pole]], residuals: Sequence[Complex], wheres: Sequence[slice]
    ) -> list[Complex]:
        """The part of each take's spectrum that its poles have to explain: all that the others leave."""
        parts = zip(self.fits, poles, residuals, wheres, strict=True)
        return [rest[where] + fit.part(take_poles, where) for fit, take_poles, rest, where in parts]

    def improved(
        self,
        poles: Sequence[list[Pole]],
        targets: Sequence[Complex],
        wheres: Sequence[slice],
        damping: float,
        tries: int = 2,
    ) -> tuple[list[list[Pole]], float, float]:
        """Poles of each take after a step towards the targets, the weighted energy that is left, the next damping."""
        left, solved, rests = self.solve(poles, targets, wheres)
        square: Array = np.zeros((2 * len(poles[0]),) * 2)
        slope: Array = np.zeros(2 * len(poles[0]))
        for fit, take_poles, where, rest, weight in zip(self.fits, solved, wheres, rests, self.weights, strict=True):
            columns, bent = fit.columns(take_poles, where)
            jacobian = real_rows(bent - columns @ (projector(columns) @ real_rows(bent)))
            square += weight * jacobian.T @ jacobian
            slope += weight * jacobian.T @ real_rows(rest)
        scale = np.diag(np.diag(square) + 1e-9 * np.trace(square) + 1e-300)
        lead = self.fits[0]
        for _ in range(tries):
            step: Array = np.asarray(np.linalg.solve(square + damping * scale, slope), np.float64).reshape(-1, 2)
            moved = [
                [lead.moved(pole, change) for pole, change in zip(take_poles, step, strict=True)]
                for take_poles in solved
            ]
            after, moved, _ = self.solve(moved, targets, wheres)
            if after < left:
                return moved, after, max(LEAST_DAMPING, 0.3 * damping)
            damping = min(MOST_DAMPING, 6 * damping)
        return solved, left, damping

    def solve(
        self, poles: Sequence[list[Pole]], targets: Sequence[Complex], wheres: Sequence[slice]
    ) -> tuple[float, list[list[Pole]], list[Complex]]:
        """The weighted energy that is left with the best amplitudes, the poles with them, and the residuals."""
        parts = zip(self.fits, poles, targets, wheres, strict=True)
        by_take = [fit.solve(take_poles, target, where) for fit, take_poles, target, where in parts]
        energies, solved, rests = zip(*by_take, strict=True)
        total = sum(weight * left for weight, left in zip(self.weights, energies, strict=True))
        return total, list(solved), list(rests)

    def sweep(self, steps: int = 1) -> None:
        """Steps of all bands in turn, each against what all others leave."""
        residuals = self.residuals()
        loudest = [max((abs(pole.a) for pole in fit.every()), default=0.0) for fit in self.fits]
        for number in range(len(self.damping)):
            before = self.poles(number)
            if not before[0]:
                continue
            if self.rests[number]:
                self.rests[number] -= 1
                continue
            wheres = self.bins(number)
            targets = self.targets(before, residuals, wheres)
            parts = zip(self.weights, residuals, wheres, strict=True)
            had = sum(weight * float(np.vdot(rest[where], rest[where]).real) for weight, rest, where in parts)
            after, left = before, had
            for _ in range(steps):
                damping = float(self.damping[number])
                after, left, self.damping[number] = self.improved(after, targets, wheres, damping)
            if had - left < SETTLED * self.fits[0].energy * len(self.fits):
                self.rests[number] = REST
            self.set_poles(number, after)
            for fit, rest, old, new, most in zip(self.fits, residuals, before, after, loudest, strict=True):
                for sign, poles in ((1, old), (-1, new)):
                    for pole in poles:
                        if pole.a:
                            changed = fit.reach(pole, most)
                            rest[changed] += sign * fit.part([pole], changed)

    def sweep_free(self, steps: int = 1) -> None:
        """Steps of all free poles together, against what the string leaves."""
        free, wheres = self.poles(FREE), self.bins(FREE)
        if not free[0]:
            return
        targets = [
            fit.data[where] - fit.model(fit.gliding())[where] for fit, where in zip(self.fits, wheres, strict=True)
        ]
        for _ in range(steps):
            free, _, self.free_damping = self.improved(free, targets, wheres, self.free_damping)
        self.set_poles(FREE, free)

    def step_glides(self) -> None:
        """The glide of each take, and the pitch of all but the first."""
        for fit in self.fits:
            fit.set_glide(fit.step_glide())
