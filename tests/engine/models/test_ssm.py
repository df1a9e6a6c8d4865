"""The laws of the contract for both state-space strings, and the recurrence that they share."""

from __future__ import annotations

import pytest
import torch

from engine.models._ssm_kernel import stream
from engine.models.base import Physics
from engine.models.configurations import LRUConfiguration, S5Configuration
from engine.models.lru import LRU
from engine.models.s5 import S5
from engine.models.ssm import Block, SSMString, evolve, recur
from engine.resonators.string import resonator_of
from engine.truth import ModalState
from engine.values.string import StringParameters
from tests.engine.tensors import listening_weights, solve_linear, to_grid

PHYSICS = Physics(resonator_of(StringParameters(), 10, grid_points=21), 4_000)
NAMES = ("lru", "s5")


def small_model(name: str, seed: int = 0, how: str = "paper") -> SSMString:
    model: SSMString
    if name == "lru":
        model = LRU(LRUConfiguration(21, state_size=24, layers=3))
    else:
        model = S5(S5Configuration(21, state_size=32, hippo_blocks=4, layers=3))
    model.initialise(how, PHYSICS, torch.Generator().manual_seed(seed))
    return model.eval()


def initial(batch: int = 2, points: int = 21) -> torch.Tensor:
    return torch.randn(batch, points, generator=torch.Generator().manual_seed(1))


def random_recurrence(steps: int) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """v, log λ and x₀, all in double precision."""
    generator = torch.Generator().manual_seed(3)

    def draw(*shape: int) -> torch.Tensor:
        return torch.randn(*shape, dtype=torch.complex128, generator=generator)

    log_eigenvalues = torch.complex(-0.1 * draw(5).abs(), 2 * draw(5).real)
    return draw(steps, 2, 5), log_eigenvalues, draw(2, 5)


@pytest.mark.parametrize("steps", [1, 2, 31, 32, 33, 64, 100])
def test_both_routes_are_the_plain_recurrence(steps: int) -> None:
    inputs, log_eigenvalues, state = random_recurrence(steps)
    expected, x = [], state
    for v in inputs:
        x = log_eigenvalues.exp() * x + v
        expected.append(x)
    parallel, last = recur(inputs, log_eigenvalues, state)
    torch.testing.assert_close(parallel, torch.stack(expected), rtol=0, atol=1e-12)
    torch.testing.assert_close(last, expected[-1], rtol=0, atol=1e-12)
    sequential, last = torch.stack([inputs.real, inputs.imag], dim=-2), state.clone()
    stream(sequential.numpy(), torch.view_as_real(log_eigenvalues.exp()).numpy(), torch.view_as_real(last).numpy())
    torch.testing.assert_close(torch.complex(*sequential.unbind(-2)), torch.stack(expected), rtol=0, atol=1e-12)
    torch.testing.assert_close(last, expected[-1], rtol=0, atol=1e-12)


@pytest.mark.parametrize("steps", [1, 34])
def test_the_adjoint_is_the_derivative(steps: int) -> None:
    given = tuple(tensor[..., :1].clone().requires_grad_() for tensor in random_recurrence(steps))
    assert torch.autograd.gradcheck(recur, given)
    assert torch.autograd.gradcheck(lambda a, x: evolve(a, x, steps, torch.complex128), given[1:])


def test_phases_stay_exact_after_a_million_steps() -> None:
    log_eigenvalues = torch.tensor([-1e-7 + 0.3j, -1e-8 + 3.1j], dtype=torch.complex128)
    state, done = torch.ones(1, 2, dtype=torch.complex128), 0
    for steps in (1000, 1, 997, 2) * 500:
        _, state = evolve(log_eigenvalues, state, steps, torch.complex64)
        done += steps
    assert done == 1_000_000
    phase = torch.remainder(done * log_eigenvalues.imag, 2 * torch.pi)
    expected = torch.polar(torch.exp(done * log_eigenvalues.real), phase)
    torch.testing.assert_close(state[0], expected, rtol=0, atol=1e-8)


@pytest.mark.parametrize("name", NAMES)
@torch.no_grad()
def test_any_splitting_into_blocks_is_the_same_motion(name: str) -> None:
    model = small_model(name)
    whole = model(initial(), 5000)
    state, parts = model.encode(initial()), []
    for steps in (1, 64, 65, 1, 1, 31, 2047, 2790):
        part, state = model.advance(state, steps)
        parts.append(part)
    torch.testing.assert_close(torch.cat(parts, 1), whole, rtol=0, atol=1e-5 * float(whole.abs().max()))


@pytest.mark.parametrize("name", NAMES)
def test_training_and_rendering_take_the_same_path(name: str) -> None:
    """With gradients the chunks run in parallel; without them batch norm is folded and a loop runs over time."""
    model, generator = small_model(name), torch.Generator().manual_seed(4)
    for block in model.layers:
        for weight in (block.gate.bias, *block.normalization.parameters(), *block.normalization.buffers()):
            if weight.is_floating_point():
                weight.data.uniform_(0.5, 1.5, generator=generator)
    parallel = model(initial(), 300)
    assert parallel.requires_grad
    with torch.no_grad():
        sequential = model(initial(), 300)
        assert torch.isnan(model(initial().fill_(torch.nan), 3)).all()
    torch.testing.assert_close(parallel.detach(), sequential, rtol=0, atol=1e-5 * float(sequential.abs().max()))


@pytest.mark.parametrize("name", NAMES)
def test_training_normalises_over_batch_and_time_and_reaches_every_weight(name: str) -> None:
    model = small_model(name).train()
    model(initial(3), 40).square().mean().backward()
    unreached = [name for name, weight in model.named_parameters() if weight.grad is None or not weight.grad.any()]
    assert unreached == ["first_layer.D"]  # as in the source: counted, not used
    assert all(block.normalization.running_mean.any() for block in model.layers)


@pytest.mark.parametrize("name", NAMES)
@torch.no_grad()
def test_listening_is_the_grid_at_that_point(name: str) -> None:
    model = small_model(name)
    weights = listening_weights([0.37, 0.123], 21)
    heard = model(initial(), 50, weights)
    torch.testing.assert_close(heard, model(initial(), 50) @ weights.float(), rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("name", NAMES)
@torch.no_grad()
def test_physics_initialisation_is_the_linear_string(name: str) -> None:
    model = small_model(name, how="physics")
    amplitudes = torch.randn(1, 10, dtype=torch.float64, generator=torch.Generator().manual_seed(2))
    times_s = torch.arange(201, dtype=torch.float64) / PHYSICS.rate_hz
    truth = to_grid(solve_linear(PHYSICS.resonator, ModalState.at_rest(amplitudes), times_s), 21).float()
    torch.testing.assert_close(model(truth[:, 0], 200), truth[:, 1:], rtol=0, atol=2e-3 * float(truth.abs().max()))


@pytest.mark.parametrize("name", NAMES)
def test_the_seed_decides_all(name: str) -> None:
    first, again, other = (small_model(name, seed).state_dict() for seed in (1, 1, 2))
    assert all(torch.equal(first[key], again[key]) for key in first)
    assert not torch.equal(first["layers.1.seq.B"], other["layers.1.seq.B"])


@pytest.mark.parametrize("name", NAMES)
def test_models_can_be_built_without_memory(name: str) -> None:
    with torch.device("meta"):
        model = LRU(LRUConfiguration()) if name == "lru" else S5(S5Configuration())
    assert all(weight.is_meta for weight in model.state_dict().values())


@pytest.mark.parametrize("name", NAMES)
def test_physics_initialisation_needs_a_state_for_each_mode(name: str) -> None:
    model = small_model(name)
    with pytest.raises(ValueError, match="each of the 30 modes"):
        model.initialise("physics", Physics(resonator_of(StringParameters(), 30), 4_000), torch.Generator())
    with pytest.raises(ValueError, match="'guess' is not one of paper, physics"):
        model.initialise("guess", PHYSICS, torch.Generator())


def changed_by(model: SSMString, how: str) -> None:
    """Another weight, or another statistic of a batch norm."""
    block = model.layers[1]
    assert isinstance(block, Block)
    if how == "in place":
        with torch.no_grad():
            block.seq.C.mul_(2.0)
    elif how == "memory":
        block.seq.D.data = block.seq.D.data * 2 + 1
    elif how == "parameter":
        block.seq.B = torch.nn.Parameter(2 * block.seq.B.detach())
    elif how == "loaded":
        model.load_state_dict({name: 1.5 * value for name, value in model.state_dict().items()})
    elif how == "optimiser":
        optimiser = torch.optim.AdamW(model.parameters(), lr=0.1)
        model.train()(initial(), 8).square().mean().backward()
        block.normalization.eval()
        optimiser.step()
    else:
        model.train()(10 * initial(), 8)
    model.eval()


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("how", ["in place", "memory", "parameter", "loaded", "optimiser", "statistics"])
def test_what_was_folded_for_rendering_follows_the_weights(name: str, how: str) -> None:
    model = small_model(name)
    with torch.no_grad():
        before = model(initial(), 40)
        assert torch.equal(model(initial(), 40), before)
    changed_by(model, how)
    with torch.no_grad():
        rendered = model(initial(), 40)
    assert not torch.allclose(rendered, before, rtol=1e-3)
    with torch.enable_grad():
        plain = model(initial(), 40).detach()  # by the definition: nothing is folded
    torch.testing.assert_close(rendered, plain, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("name", NAMES)
@torch.no_grad()
def test_blocks_are_folded_once_for_a_motion(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """And nothing of it stays in the model."""
    model, folds = small_model(name), []
    fold = Block.fold
    monkeypatch.setattr(Block, "fold", lambda block: folds.append(block) or fold(block))
    first = model(initial(), 40)
    assert len(folds) == len(model.layers)
    state = model.encode(initial())
    for _ in range(3):
        _, state = model.advance(state, 7)
    assert len(folds) == 2 * len(model.layers)
    changed_by(model, "in place")
    kept, _ = model.advance(state, 19)  # by the weights with which it began
    torch.testing.assert_close(kept, first[:, 21:], rtol=0, atol=1e-5 * float(first.abs().max()))
