"""A start for Koopman from the training data: eigenvalues by matching pursuit, and what its encoder shall yield.

With a linear decoder and given eigenvalues the best latents of a trajectory are a least-squares fit. So the
eigenvalues are chosen first: for each mode the exponentials that explain most of all its motions, one
after the other. They come from a grid of frequencies that it may have and of decay rates (simultaneous
orthogonal matching pursuit; Tropp, Gilbert, Strauss 2006). The decoder sums them, each in its mode's shape. Then
the encoder learns the fitted latents, in orthonormal coordinates: the distance there *is* the error of the prediction
over every frame of the horizon, at the cost of no rollout.

The modes are those of the string, which the paper's models do not know, or found in the data (`modes`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import torch
from torch import Tensor, nn

from engine.models.base import StringModel
from engine.models.koopman import Koopman
from training.configuration import Recipe
from training.data.batches import flips
from training.data.dataset import Dataset
from training.fitting.modes import found_modes, known_modes

TRAJECTORIES = 400  # of the training split that choose the eigenvalues
POLISH_ITERATIONS = 100
APART = 1e-3  # share of an exponential that no chosen one explains, at least


@dataclass(frozen=True)
class LatentFit:
    """The goal of the encoder on the training split.

    Attributes:
        initial: displacement (count, grid_points) in normalised units.
        targets: orthonormal coordinates of the fitted latents, (count, 2 state_size), of mean square 1: what a
            network is at ease with.
        unit: of the coordinates. Their squares, times its own, sum up to the mean over frames of the squared modal
            amplitudes.
        mirror: factors (2 state_size,) of the coordinates of a string seen from its other end.
        mixing: from the coordinates to the latents, (2 state_size, 2 state_size), real parts first.
    """

    initial: Tensor
    targets: Tensor
    unit: float
    mirror: Tensor
    mixing: Tensor

    def to(self, device: torch.device) -> LatentFit:
        """The same on a device."""
        moved = {name: getattr(self, name).to(device) for name in ("initial", "targets", "mirror", "mixing")}
        return replace(self, **moved)

    def loss(self, model: StringModel, recipe: Recipe, rows: Tensor, iteration: int) -> tuple[Tensor, Tensor]:
        """The error of the coordinates, and the mean square of the prediction's, of the trajectories `rows`."""
        assert isinstance(model, Koopman)
        rows = rows.to(self.initial.device)
        initial, targets = self.initial[rows], self.targets[rows]
        if recipe.flip:
            generator = torch.Generator().manual_seed((recipe.seed + 1) * 1_000_003 + iteration)
            sign, mirrored = flips(len(rows), generator, initial.device)
            initial = sign * torch.where(mirrored, initial.flip(1), initial)
            targets = sign * torch.where(mirrored, targets * self.mirror, targets)
        error = (model.encoder(initial) - targets).square().mean()
        return error, self._of_prediction(error)

    def polish(self, model: StringModel, recipe: Recipe) -> Tensor:
        """POLISH_ITERATIONS of L-BFGS on all trajectories at once; the mean square of the prediction's error before.

        It knows nothing of the iterations before it, so that a run can be cut between any two calls. The recipe's
        weight_decay is a penalty here, on the squares of the weights.
        """
        assert isinstance(model, Koopman)
        initial, targets = self.initial, self.targets
        if recipe.flip:
            initial, targets = torch.cat([initial, initial.flip(1)]), torch.cat([targets, targets * self.mirror])
            initial, targets = torch.cat([initial, -initial]), torch.cat([targets, -targets])
        weights = [weight for weight in model.encoder.parameters() if weight.ndim > 1]
        optimiser = torch.optim.LBFGS(
            model.encoder.parameters(),
            max_iter=POLISH_ITERATIONS,
            history_size=POLISH_ITERATIONS,
            tolerance_grad=0.0,
            tolerance_change=0.0,
            line_search_fn="strong_wolfe",
        )

        def closure() -> Tensor:
            optimiser.zero_grad()
            error = (model.encoder(initial) - targets).square().mean()
            size = sum((weight.square().sum() for weight in weights), start=error.new_zeros(()))
            loss = error + recipe.weight_decay / 2 * size
            loss.backward()
            errors.append(error.detach())
            return loss

        errors: list[Tensor] = []
        optimiser.step(closure)
        return self._of_prediction(errors[0])

    def _of_prediction(self, error: Tensor) -> Tensor:
        """The prediction's error from the coordinates': a mode's over the string is half its amplitude's."""
        return (error * self.targets.shape[1] * self.unit**2 / 2).detach()

    @torch.no_grad()
    def yield_latents(self, model: StringModel) -> None:
        """Make an encoder that has learned the coordinates yield the latents."""
        assert isinstance(model, Koopman)
        last = model.encoder[-1]
        assert isinstance(last, nn.Linear)
        last.bias.copy_(self.mixing @ last.bias.double())
        last.weight.copy_(self.mixing @ last.weight.double())


def pursue(
    model: StringModel, dataset: Dataset, steps: int, generator: torch.Generator, blind: bool = False
) -> LatentFit:
    """Give a Koopman its eigenvalues and its decoder, and return what its encoder shall learn.

    Args:
        steps: frames of the horizon.
        blind: nothing is known of the string but its displacement.

    Raises:
        ValueError: the model is no Koopman with a mixing layer, or its data are strided.
    """
    c = dataset.configuration
    if not isinstance(model, Koopman) or not model.configuration.mixing_layer:
        raise ValueError("latent_epochs needs the model 'koopman' with its mixing layer; set it to 0")
    if c.stride != 1:
        raise ValueError(f"latent_epochs needs every frame: the data's stride must be 1, not {c.stride}")
    modes = found_modes(dataset, steps) if blind else known_modes(dataset, steps)
    n, count = model.configuration.state_size, len(modes.grids)
    most = min(n, 3 * (-(-n // count)))  # exponentials of a mode: three times an even share
    motions = modes.motions[:, 1:]
    chains = [_pursuit(grid, motions[:TRAJECTORIES, :, mode], most) for mode, grid in enumerate(modes.grids)]
    lengths = _share_out([chain.gains for chain in chains], n)

    log_eigenvalues = torch.full((n,), complex(-1.0 / steps, math.pi / 2), dtype=torch.complex128)
    shapes = torch.zeros(n, c.grid_points, dtype=torch.float64)
    mixing = torch.zeros(2 * n, 2 * n, dtype=torch.float64)
    targets = torch.zeros(len(motions), 2 * n, dtype=torch.float64)
    mirror = torch.ones(2 * n)
    first = 0
    for mode, (chain, length) in enumerate(zip(chains, lengths, strict=True)):
        here = torch.arange(first, first + length)  # latents of this mode
        log_eigenvalues[here] = chain.log_eigenvalues[:length]
        shapes[here] = modes.shapes[mode]
        basis = chain.basis[:, : 2 * length]
        exponentials = torch.exp(chain.log_eigenvalues[:length] * _frames(steps)[:, None])
        columns = torch.cat([exponentials.real, -exponentials.imag], dim=1)
        places = torch.cat([here, n + here])
        coordinates = torch.arange(2 * first, 2 * (first + length))
        mixing[places[:, None], coordinates] = math.sqrt(steps) * torch.linalg.inv(basis.T @ columns)
        targets[:, coordinates] = motions[:, :, mode] @ basis / math.sqrt(steps)
        mirror[coordinates] = modes.mirror[mode]
        first += length
    unit = float(targets.square().mean().sqrt())
    model.store_basis(log_eigenvalues, shapes, generator)
    initial = (modes.motions[:, 0] @ modes.shapes).float()
    return LatentFit(initial, (targets / unit).float(), unit, mirror, unit * mixing)


@dataclass(frozen=True)
class _Chain:
    """A mode's exponentials in the order of their choice.

    Attributes:
        log_eigenvalues: complex128 (length,).
        gains: what each explains of the motions' squares.
        basis: orthonormal columns (steps, 2 length), two for each.
    """

    log_eigenvalues: Tensor
    gains: list[float]
    basis: Tensor


def _pursuit(grid: Tensor, motions: Tensor, most: int) -> _Chain:
    """Choose at most `most` exponentials of `grid` that explain real motions (count, steps) together.

    It is simultaneous orthogonal matching pursuit. It ends early where no exponential differs from the chosen ones.
    """
    exponentials = torch.exp(grid[:, None] * _frames(motions.shape[1]))
    pairs = torch.stack([exponentials.real, exponentials.imag], dim=1)  # (grid, 2, steps)
    pairs = pairs / pairs.square().sum(-1, keepdim=True).sqrt()
    products = torch.einsum("st,gkt->gks", motions, pairs)
    chosen = []
    gains = []
    basis = []
    for _ in range(most):  # (grid, 2, 2): products of each pair with itself, and with the motions
        gram = pairs @ pairs.mT
        determinant = gram[:, 0, 0] * gram[:, 1, 1] - gram[:, 0, 1].square()
        apart = (gram[:, 0, 0] > APART) & (gram[:, 1, 1] > APART) & (determinant > 0.1 * APART**2)
        if not bool(apart.any()):
            break
        squares = products @ products.mT
        explained = gram[:, 1, 1] * squares[:, 0, 0] + gram[:, 0, 0] * squares[:, 1, 1]
        explained = (explained - 2 * gram[:, 0, 1] * squares[:, 0, 1]) / determinant
        best = int(torch.where(apart, explained, -1.0).argmax())
        columns = torch.linalg.qr(pairs[best].T).Q
        chosen.append(grid[best])
        gains.append(float(explained[best]))
        basis.append(columns)
        overlap = pairs @ columns
        products = products - overlap @ (motions @ columns).T
        pairs = pairs - overlap @ columns.T
    return _Chain(torch.stack(chosen), gains, torch.cat(basis, dim=1))


def _share_out(gains: list[list[float]], size: int) -> list[int]:
    """The number of exponentials for each mode: `size` in all, or all there are, the greatest gains first.

    Args:
        gains: of each mode's exponentials, in the order of their choice.
    """
    lengths = [0] * len(gains)
    for _ in range(min(size, sum(map(len, gains)))):
        open_modes = [mode for mode, chain in enumerate(gains) if lengths[mode] < len(chain)]
        lengths[max(open_modes, key=lambda mode: gains[mode][lengths[mode]])] += 1
    return lengths


def _frames(steps: int) -> Tensor:
    """The frame numbers 1 … steps, float64 (steps,)."""
    return torch.arange(1, steps + 1, dtype=torch.float64)
