"""A step of training: the terms of the loss, written out; SOAP against Adam; steps that a GPU records."""

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace

import pytest
import torch

from engine.models import build_model
from engine.models.base import Physics
from engine.models.configurations import KoopmanVarConfiguration
from engine.models.koopman_var import KoopmanVar
from engine.resonators.string import resonator_of
from engine.values.string import StringParameters
from tests.training.conftest import DATA
from training.cell import Cell, configuration_of
from training.configuration import Recipe
from training.data.batches import Batch
from training.fitting import losses, recorded
from training.fitting.fit import Steps, TrainingState, take_step
from training.fitting.losses import training_loss
from training.fitting.soap import EVERY, SOAP

RECIPE = Recipe(epochs=1, consistency_weight=0.3)
PHYSICS = Physics(resonator_of(StringParameters(), 6), 4_000)


def model_and_batch() -> tuple[KoopmanVar, Batch]:
    model = KoopmanVar(KoopmanVarConfiguration(101, 6, (5,))).double()
    model.initialise("paper", PHYSICS, torch.Generator().manual_seed(1))
    draw = torch.Generator().manual_seed(2)
    frames = torch.tensor([1, 3, 4])
    target = torch.randn(2, 3, 101, generator=draw, dtype=torch.float64)
    return model, Batch(torch.randn(2, 101, generator=draw, dtype=torch.float64), frames, target)


def mean_square(values: torch.Tensor) -> float:
    return float(values.detach().square().mean())


@pytest.mark.parametrize("terms", ["text", "published"])
def test_the_loss_is_the_sum_of_its_terms(terms):
    """Written out with real numbers; published: as `lindyn_loss` of rodrigodzf/physmodjax takes its means."""
    model, batch = model_and_batch()
    loss, prediction = training_loss(model, batch, replace(RECIPE, koopman_terms=terms))

    frames = torch.cat([batch.initial[:, None], batch.target], dim=1)
    encoded = model.encoder(frames)  # real parts first
    eigenvalues = torch.exp(torch.complex(-model.nu_log.exp(), model.theta_log.exp()))
    origin = torch.complex(*encoded[:, 0].chunk(2, dim=-1))
    latents = torch.stack([origin * eigenvalues**k for k in (1, 3, 4)], dim=1)

    def multiplied(z: torch.Tensor) -> torch.Tensor:
        z = z * torch.complex(*model.multiplier(z.abs().square()).chunk(2, dim=-1))
        return torch.cat([z.real, z.imag], dim=-1)

    predicted = mean_square(model.decoder(multiplied(latents)) - batch.target)
    if terms == "text":
        encoding = mean_square(model.decoder(multiplied(origin)) - batch.initial)
        parts = torch.cat([latents.real, latents.imag], dim=-1)
        others = encoding + 0.3 * 2 * mean_square(encoded[:, 1:] - parts)  # of complex numbers
    else:
        reconstruction = mean_square(model.decoder(encoded) - frames)
        others = reconstruction + 2 * 0.3 * mean_square(multiplied(latents) - encoded[:, 1:])
    assert float(prediction) == pytest.approx(predicted, rel=1e-9)
    assert float(loss.detach()) == pytest.approx(predicted + others, rel=1e-9)


def test_frames_that_were_drawn_twice_are_compared_with_themselves():
    """As many frames as the last one's number need not be all of them."""
    model = build_model("lru", {"layers": 0, "state_size": 4})
    model.initialise("paper", PHYSICS, torch.Generator().manual_seed(1))
    model.eval()
    initial, frames = torch.randn(2, 101, generator=torch.Generator().manual_seed(2)), torch.tensor([1, 3, 3, 4])
    whole = model(initial, 4).detach()
    _, prediction = training_loss(model, Batch(initial, frames, whole[:, frames - 1]), RECIPE)
    assert float(prediction) < 1e-12
    assert float(training_loss(model, Batch(initial, frames, whole), RECIPE)[1]) > 1e-9


@pytest.mark.parametrize("terms", ["text", "published"])
@pytest.mark.parametrize("name", ["koopman", "koopman_var", "koopman_integrated"])
def test_parts_of_a_batch_have_its_gradients_and_error(name, terms, monkeypatch):
    model = build_model(name, {"grid_points": 101}).double()
    model.initialise(model.own_initialisation(), PHYSICS, torch.Generator().manual_seed(1))
    target = torch.randn(7, 4, 101, generator=torch.Generator().manual_seed(2), dtype=torch.float64)
    batch = Batch(target[:, 0], torch.tensor([1, 3, 4]), target[:, 1:])
    recipe = replace(RECIPE, koopman_terms=terms)

    def gradients(frames_at_once: int) -> tuple[list[torch.Tensor], float]:
        monkeypatch.setattr(losses, "FRAMES_AT_ONCE", frames_at_once)
        model.zero_grad()
        error = losses.backward(model, batch, recipe)
        return [p.grad.clone() for p in model.parameters() if p.grad is not None], float(error)

    (whole, error), (parts, same) = gradients(1000), gradients(6)
    assert same == pytest.approx(error, rel=1e-12)
    assert len(parts) == len(whole) > 4
    for own, all_at_once in zip(parts, whole, strict=True):
        torch.testing.assert_close(own, all_at_once, rtol=1e-9, atol=1e-12)


def draw(*shape: int, seed: int = 0) -> torch.Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def descend(optimiser: torch.optim.Optimizer, loss: Callable[[], torch.Tensor], steps: int) -> float:
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


def test_vectors_take_adams_step_and_weights_decay_and_no_gradient_changes_nothing():
    wanted = draw(8)
    found = []
    for kind in (SOAP, torch.optim.AdamW):
        vector = torch.ones(8, dtype=torch.float64, requires_grad=True)
        settings = {} if kind is SOAP else {"betas": (0.95, 0.95)}
        optimiser = kind([{"params": [vector]}], lr=0.03, weight_decay=0.1, **settings)
        descend(optimiser, lambda v=vector: (v - wanted).square().sum(), 25)
        found.append(vector.detach())
    torch.testing.assert_close(*found)
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


CPU = torch.device("cpu")
MODELS = ("koopman", "koopman_var", "lru", "s5", "fgru", "frnn")


@pytest.mark.parametrize(
    ("recipe", "changes", "repeats"),
    [
        ("published", {}, True),
        ("paper", {}, True),
        ("ours", {}, False),  # other frames each time
        ("published", {"flip": True}, False),
        ("published", {"batch_size": 5}, False),  # 16 trajectories: the last batch has one
    ],
)
def test_a_step_on_all_frames_of_as_many_strings_repeats_itself(small_dataset, recipe, changes, repeats):
    cell = Cell("koopman_var", True, "gaussian", 4000, 400, recipe)
    made = configuration_of(cell, DATA, {"batch_size": 4, **changes})
    assert TrainingState(made, small_dataset, CPU).repeats_itself is repeats


def test_work_is_done_some_times_then_recorded_and_repeated(monkeypatch):
    """Each call is one time; what the recording itself runs is not a further one."""
    seen: list[str] = []
    stream = SimpleNamespace(wait_stream=lambda other: None)
    graph = SimpleNamespace(replay=lambda: seen.append("repeated"))
    for name in ("Stream", "current_stream"):
        monkeypatch.setattr(torch.cuda, name, lambda: stream)
    monkeypatch.setattr(torch.cuda, "stream", lambda which: nullcontext())
    monkeypatch.setattr(torch.cuda, "CUDAGraph", lambda: graph)
    monkeypatch.setattr(torch.cuda, "graph", lambda which: nullcontext(seen.append("recorded")))
    precision = torch.get_float32_matmul_precision()
    work = recorded.RecordedWork(lambda: seen.append(torch.get_float32_matmul_precision()))
    for _ in range(recorded.BEFORE + 2):
        work()
    assert seen == [recorded.PRECISION] * recorded.BEFORE + ["recorded", recorded.PRECISION, "repeated", "repeated"]
    assert torch.get_float32_matmul_precision() == precision


@pytest.mark.skipif(not torch.cuda.is_available(), reason="there is no CUDA device")
@pytest.mark.parametrize("name", MODELS)
def test_a_repeated_step_is_the_launched_one(name, small_dataset, monkeypatch):
    monkeypatch.setattr(recorded, "PRECISION", "highest")
    cells = [Cell(name, True, "gaussian", 4000, 20, "paper", seed) for seed in range(2)]
    changes = {"batch_size": 4, "schedule": "one_cycle"}
    made = [configuration_of(cell, DATA, changes) for cell in cells]
    cuda, steps = torch.device("cuda"), Steps()
    repeated, launched = ([TrainingState(each, small_dataset, cuda) for each in made] for _ in range(2))
    for _ in range(11):
        steps.take(repeated)
        for run in launched:
            run.begin_step()
        take_step(launched)
        for run in launched:
            run.end_step()
    for one, other in zip(repeated, launched, strict=True):
        assert one.loss == pytest.approx(other.loss, rel=1e-4)
