"""DMD: the linear map that carries every frame, with its predecessors, closest to the next; fitted, not trained.

Source: the paper, §3.1 (after Tu et al. 2014) and §4.3: exact DMD of a Hankel matrix of two lags, rank 50. With the
embedding h_k = [u_k, u_{k-1}, …] of `lags` frames, h_{k+1} ≈ A h_k in least squares over all frames of all
trajectories; with the eigenvalues λ of A's projection on the leading singular vectors, and its modes Φ,

    b = encoder(u₀),    û_k = Re(Φ λᵏ b).

A standing wave has frames of zero displacement with a velocity: with one lag no linear map can follow it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import ClassVar

import torch
from torch import Tensor, nn

from engine.models import eigenvalues
from engine.models._diagonal import DiagonalModel, KoopmanState, dense, read_weight
from engine.models.base import LINEAR_STRING, Physics
from engine.models.configurations import DMDConfiguration

_ROWS_AT_ONCE = 16_384  # of the Hankel matrix: bounds the memory of a fit
_VANISHED = -700.0  # log |λ| of a mode that is not there: finite in a file, and λ¹ is as good as 0


class DMD(DiagonalModel):
    """See the module. What was fitted are the parameters; the encoder follows from them and is a buffer.

    Eigenvalues are float64: phases are exact at any frame. One may lie outside the unit circle: a fit
    to noisy or non-linear motion may find a mode that grows.
    """

    initialisations: ClassVar = {"physics": LINEAR_STRING}

    def __init__(self, configuration: DMDConfiguration) -> None:
        super().__init__(configuration)
        r = configuration.rank
        self.magnitude_log = nn.Parameter(torch.full((r,), _VANISHED, dtype=torch.float64))  # log |λ| a sample
        self.angle = nn.Parameter(torch.zeros(r, dtype=torch.float64))  # of λ, in rad a sample
        self.modes = nn.Parameter(torch.zeros(self.grid_points, 2 * r))  # Φ of one frame, real parts first
        self.encoder: Tensor
        self.register_buffer("encoder", torch.zeros(self.grid_points, 2 * r))  # b = u₀ @ encoder, real parts first

    @classmethod
    def fit(cls, trajectories: Tensor, configuration: DMDConfiguration) -> DMD:
        """The DMD of one trajectory or of many.

        Args:
            trajectories: successive frames in the model's units, (batch, frames, grid_points).

        Raises:
            ValueError: another grid, too few frames, or values that are not finite.
        """
        c = configuration
        if trajectories.ndim != 3 or trajectories.shape[-1] != c.grid_points:
            raise ValueError(
                f"trajectories must be of shape (batch, frames, {c.grid_points}), not {tuple(trajectories.shape)}"
            )
        if trajectories.shape[1] <= c.lags:
            raise ValueError(f"a fit with lags of {c.lags} needs more frames than {trajectories.shape[1]}")
        if not bool(torch.isfinite(trajectories).all()):
            raise ValueError("trajectories hold values that are not finite")
        model = cls(configuration)
        model._store(*_exact_dmd(trajectories, c))
        return model

    def encode(self, displacement: Tensor) -> KoopmanState:
        """The amplitudes b of a string at rest that agree best, in least squares: Φ b = u₀ and Φ (b log λ) = 0.

        With one lag the modes hold no velocity, and only the first is asked. Frames alone do not tell a mode above
        half the sample rate from its alias, whose velocity is another one.
        """
        b = displacement @ self.encoder
        return KoopmanState(torch.complex(*b.chunk(2, dim=-1)), 0)

    def powers(self, frames: Tensor) -> Tensor:
        return eigenvalues.powers(self._eigenvalue_logs(), frames)

    def decode(self, latents: Tensor, readout: Tensor | None = None) -> Tensor:
        real, imaginary = read_weight(self.modes, readout).chunk(2, dim=-1)
        return dense(latents, torch.cat([real, -imaginary], dim=-1))

    @torch.no_grad()
    def log_eigenvalues(self) -> list[Tensor]:
        return [self._eigenvalue_logs()]

    def _eigenvalue_logs(self) -> Tensor:
        return torch.complex(self.magnitude_log.double(), self.angle.double())

    def set_weights(self, how: str, physics: Physics, generator: torch.Generator) -> None:
        """physics: the linear string itself, which is what a fit finds in linear motion. The source has no other."""
        c, modes = self.configuration, physics.modes
        if c.rank < 2 * modes:
            raise ValueError(
                f"initialisation 'physics' needs a rank of at least {2 * modes}, two a mode, not {c.rank}"
            )
        half = torch.exp(physics.log_eigenvalues)
        eigenvalues = torch.cat([half, half.conj()])
        frame = physics.shapes.repeat(1, 2)  # (grid_points, 2 modes)
        self._store(eigenvalues, torch.cat([frame * eigenvalues**-lag for lag in range(c.lags)]))

    def _store(self, eigenvalues: Tensor, modes: Tensor) -> None:
        """Take eigenvalues (n,) and modes of the embedding (lags · grid_points, n) with n ≤ rank; others vanish."""
        points = self.grid_points
        r = self.configuration.rank
        n = len(eigenvalues)
        magnitude_log = eigenvalues.abs().log().clamp(min=_VANISHED)
        encoder = _encoder(self.configuration, magnitude_log, eigenvalues.angle(), modes)
        with torch.no_grad():
            self.magnitude_log.fill_(_VANISHED)[:n] = magnitude_log
            self.angle.zero_()[:n] = eigenvalues.angle()
            for stored, complex_matrix in ((self.modes, modes[:points]), (self.encoder, encoder.T)):
                stored.zero_()
                stored[:, :n], stored[:, r : r + n] = complex_matrix.real, complex_matrix.imag


def _exact_dmd(trajectories: Tensor, c: DMDConfiguration) -> tuple[Tensor, Tensor]:
    """Eigenvalues (n,) and modes (lags · grid_points, n), complex128, the slowest decay first; n is at most the rank.

    With the Hankel matrix H = QR of `lags + 1` frames a row, both snapshot matrices are columns of H. The SVD of
    R's columns is theirs: Q is never needed, R can be gathered block by block, and nothing is squared.
    """
    r = torch.empty(0, (c.lags + 1) * c.grid_points, dtype=torch.float64)  # R so far
    for rows in _hankel_rows(trajectories, c.lags + 1):
        r = torch.linalg.qr(torch.cat([r, rows]), mode="r").R
    after, before = r[:, : -c.grid_points].T, r[:, c.grid_points :].T
    u, s, v = torch.linalg.svd(before, full_matrices=False)
    # beyond the rank of the data there is only rounding, which shows no mode
    noise = s[0] * torch.finfo(trajectories.dtype).eps * len(before)
    kept = min(c.rank, int((s > noise).sum()))
    if kept == 0:
        return torch.empty(0, dtype=torch.complex128), torch.empty(len(before), 0, dtype=torch.complex128)
    u = u[:, :kept]
    s = s[:kept]
    v = v[:kept].T
    carried = after @ v / s  # A times the kept singular vectors
    eigenvalues, w = torch.linalg.eig(u.T @ carried)
    order = eigenvalues.abs().argsort(descending=True)
    eigenvalues, w = eigenvalues[order], w[:, order]
    present = eigenvalues.abs() > math.exp(_VANISHED)
    eigenvalues, w = eigenvalues[present], w[:, present]
    return eigenvalues, carried.to(w) @ w / eigenvalues


def _hankel_rows(trajectories: Tensor, frames: int) -> Iterator[Tensor]:
    """Blocks of rows [u_k, u_{k-1}, …] of `frames` frames each, float64 (rows, frames · grid_points)."""
    for trajectory in trajectories:
        windows = trajectory.detach().cpu().double().unfold(0, frames, 1).flip(-1).transpose(1, 2)
        yield from windows.flatten(1).split(_ROWS_AT_ONCE)


def _encoder(c: DMDConfiguration, magnitude_log: Tensor, angle: Tensor, modes: Tensor) -> Tensor:
    """The matrix, complex128 (n, grid_points), from a displacement to its amplitudes b; see `DMD.encode`.

    Args:
        magnitude_log, angle: of the eigenvalues, (n,).
        modes: of the embedding, (lags · grid_points, n).
    """
    frame = modes[: c.grid_points]
    if c.lags == 1:
        return torch.linalg.pinv(frame)
    # a real λ < 0 alternates from frame to frame: at rest it is a cosine
    turning = torch.where(angle.abs() < math.pi, angle, 0.0)
    rate = torch.complex(magnitude_log, turning)
    # velocity and displacement weigh alike
    unit = rate.abs().square().mean().sqrt()
    return torch.linalg.pinv(torch.cat([frame, frame * (rate / unit)]))[:, : c.grid_points]
