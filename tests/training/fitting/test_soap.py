from collections.abc import Callable

import pytest
import torch
from torch import Tensor

from training.fitting.soap import EVERY, SOAP


def draw(*shape: int, seed: int = 0) -> Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def descend(optimiser: torch.optim.Optimizer, loss: Callable[[], Tensor], steps: int) -> float:
    for _ in range(steps):
        optimiser.zero_grad()
        loss().backward()
        optimiser.step()
    return float(loss().detach())


@pytest.mark.parametrize(("kind", "turns"), [(SOAP, True), (torch.optim.AdamW, False)])
def test_a_turned_problem_has_the_turned_solution(kind, turns):
    """What Adam does depends on the axes; in the gradients' own basis it does not."""
    left, right, wanted = draw(9, 6), draw(5, 7, seed=1), draw(9, 7, seed=2)
    turn, other = (torch.linalg.qr(draw(n, n, seed=n)).Q for n in (6, 5))
    problems = (left, right), (left @ turn.T, other @ right)
    found = []
    for a, b in problems:
        weights = torch.zeros(6, 5, dtype=torch.float64, requires_grad=True)
        optimiser = kind([{"params": [weights]}], lr=0.05)
        descend(optimiser, lambda a=a, w=weights, b=b: (a @ w @ b - wanted).square().sum(), 3 * EVERY + 2)
        found.append(weights.detach())
    deviation = (turn @ found[0] @ other.T - found[1]).norm() / found[1].norm()
    assert (deviation < 1e-4) == turns


def test_vectors_take_adams_step_and_weights_decay():
    wanted = draw(8)
    found = []
    for kind in (SOAP, torch.optim.AdamW):
        vector = torch.ones(8, dtype=torch.float64, requires_grad=True)
        settings = {} if kind is SOAP else {"betas": (0.95, 0.95)}
        optimiser = kind([{"params": [vector]}], lr=0.03, weight_decay=0.1, **settings)
        descend(optimiser, lambda v=vector: (v - wanted).square().sum(), 25)
        found.append(vector.detach())
    torch.testing.assert_close(*found)


@pytest.mark.parametrize("shape", [(6, 5), (3, 2, 5), (5, 3, 2)])
def test_it_gets_further_than_adam_where_the_axes_are_correlated(shape):
    mixing = torch.linalg.qr(draw(30, 30)).Q * torch.logspace(0, 1.5, 30, dtype=torch.float64)
    mixing = mixing @ torch.linalg.qr(draw(30, 30, seed=1)).Q
    wanted = draw(30, seed=2)
    losses = []
    for kind in (SOAP, torch.optim.AdamW):
        weights = torch.zeros(shape, dtype=torch.float64, requires_grad=True)
        optimiser = kind([{"params": [weights]}], lr=0.02, weight_decay=0.0)
        losses.append(descend(optimiser, lambda w=weights: (mixing @ (w.flatten() - wanted)).square().sum(), 100))
    assert losses[0] < losses[1]


def test_a_gradient_of_zero_or_of_no_number_at_first_changes_nothing():
    """The loss has it; eigenvectors of it there are none."""
    still = torch.ones(4, 3, requires_grad=True)
    descend(SOAP([{"params": [still]}], 0.1), lambda: (still * 0).sum(), EVERY + 2)
    assert torch.equal(still.detach(), torch.ones(4, 3))
    weights = torch.ones(3, 3, requires_grad=True)
    optimiser = SOAP([{"params": [weights]}], lr=0.1)
    weights.grad = torch.full((3, 3), float("nan"))
    optimiser.step()
    assert torch.equal(weights.detach(), torch.ones(3, 3))
    descend(optimiser, lambda: weights.square().sum(), 5)
    assert weights.isfinite().all() and float(weights.detach().square().sum()) < 9
