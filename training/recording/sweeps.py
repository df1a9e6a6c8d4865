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

SETTLED = 1e-6  # of the energy: a band that gained less in a visit rests
REST = 3  # sweeps that leave out such a band
FIRST_DAMPING = 1e-2  # of Levenberg and Marquardt: share of the diagonal that is added to it
LEAST_DAMPING = 1e-4
MOST_DAMPING = 1e4


@dataclass
class Takes:
    """Takes of one note, that is recordings of it, with the poles of each.

    All have the same bands of the spectrum, one around each partial, by number from 0. The number `FREE` stands for
    the free poles, which do not glide with the string. Lists of poles, targets and bins have an entry per take.

    Attributes:
        fits: one for each take.
        free_damping: of the next step of the free poles.
        damping: of the next step of each band, (bands,).
        rests: number of coming sweeps that leave out each band, (bands,); 0: the next one visits it.
    """

    fits: Sequence[Fit]
    free_damping: float = FIRST_DAMPING
    damping: Array = field(init=False)
    rests: NDArray[np.int_] = field(init=False)

    def __post_init__(self) -> None:
        bands = len(self.fits[0].partials_hz)
        self.damping, self.rests = np.full(bands, FIRST_DAMPING), np.zeros(bands, int)
        # by take: the energies of all, so weighted, are that of the first
        self.weights = [self.fits[0].energy / fit.energy for fit in self.fits]

    def residuals(self) -> list[Complex]:
        """The part of each take's spectrum that all poles leave, (bins,) each."""
        return [fit.data - fit.model() for fit in self.fits]

    def poles(self, number: int) -> list[list[Pole]]:
        """The poles of a band, or the free ones, in each take."""
        return [fit.poles[number] for fit in self.fits]

    def set_poles(self, number: int, poles: Sequence[list[Pole]]) -> None:
        """Set the poles of a band, or the free ones, in each take."""
        for fit, of_take in zip(self.fits, poles, strict=True):
            fit.poles[number] = of_take

    def bins(self, number: int) -> list[slice]:
        """The bins in which a band, or the free poles, are fitted in each take."""
        return [fit.bins(number) for fit in self.fits]

    def targets(
        self, poles: Sequence[list[Pole]], residuals: Sequence[Complex], wheres: Sequence[slice]
    ) -> list[Complex]:
        """The part of each take's spectrum that `poles` have to explain: all that its other poles leave.

        Args:
            residuals: of `residuals`, whole spectra.
            wheres: the bins of the part.
        """
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
        """The poles after one step towards the targets, the weighted energy that they leave, and the next damping.

        Args:
            poles: of a band, or the free ones, by take.
            targets: of `targets`, in the bins `wheres`.
            tries: how often a step that leaves more is tried again, each time damped more; at last none is taken.
        """
        left, solved, rests = self.solve(poles, targets, wheres)
        # normal equations of log σ and ω of each pole, which all takes share
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
            # (poles, 2): changes of log σ and of ω in rad/s
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
        """The weighted energy that the best amplitudes leave; by take, the poles with them, and the residuals."""
        parts = zip(self.fits, poles, targets, wheres, strict=True)
        by_take = [fit.solve(take_poles, target, where) for fit, take_poles, target, where in parts]
        energies, solved, rests = zip(*by_take, strict=True)
        total = sum(weight * left for weight, left in zip(self.weights, energies, strict=True))
        return total, list(solved), list(rests)

    def sweep(self, steps: int = 1) -> None:
        """Visit each band once, in the order of partials, and refine its poles against what all others leave.

        A band without poles, or that rests, is left out.

        Args:
            steps: of Levenberg and Marquardt in each visit.
        """
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
            after, left = before, had  # `had`: the weighted energy before the visit
            for _ in range(steps):
                damping = float(self.damping[number])
                after, left, self.damping[number] = self.improved(after, targets, wheres, damping)
            if had - left < SETTLED * self.fits[0].energy * len(self.fits):
                self.rests[number] = REST
            self.set_poles(number, after)
            for fit, rest, old, new, most in zip(self.fits, residuals, before, after, loudest, strict=True):
                # the residual follows: without the old poles, with the new ones
                for sign, poles in ((1, old), (-1, new)):
                    for pole in poles:
                        if pole.a:
                            changed = fit.reach(pole, most)
                            rest[changed] += sign * fit.part([pole], changed)

    def sweep_free(self, steps: int = 1) -> None:
        """Refine all free poles together, in so many steps, against what the string leaves."""
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
        """Refine the glide of each take by one step, and the pitch of all but the first."""
        for fit in self.fits:
            fit.set_glide(fit.step_glide())
