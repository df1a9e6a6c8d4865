"""S5 against its reference vector and a plain recurrence, its sizes and its initialisation."""

from pathlib import Path

import numpy as np
import pytest
import torch

from engine.models.base import Physics, count_parameters
from engine.models.configurations import S5Configuration
from engine.models.s5 import S5, S5Layer, hippo_normal
from engine.resonators.string import resonator_of
from engine.values.string import StringParameters

REFERENCE = Path(__file__).parent / "references" / "s5.npz"
STORED = ("B", "C", "D", "Lambda_re", "Lambda_im", "log_step")


def reference_model() -> tuple[S5, torch.Tensor, torch.Tensor]:
    """A float64 model with the reference's weights, its input, and its exact output."""
    arrays = {name: torch.from_numpy(array) for name, array in np.load(REFERENCE).items()}
    model = S5(S5Configuration(11, state_size=16, hippo_blocks=1, layers=2)).double()
    weights = model.state_dict()
    for ours, theirs in (
        ("first_layer", "first_layer"),
        ("layers.0.seq", "layers_0/seq"),
        ("layers.1.seq", "layers_1/seq"),
    ):
        stored = {
            name: arrays[f"params/{theirs}/{name}"] for name in ("B", "C", "D", "Lambda_re", "Lambda_im", "log_step")
        }
        stored["B"] = stored["B"].mT
        weights |= {f"{ours}.{name}": array for name, array in stored.items()}
    for layer in range(2):
        theirs = f"layers_{layer}"
        dense = [f"params/{theirs}/out{number}" for number in (1, 2)]
        statistics = f"batch_stats/{theirs}/normalization"
        block = {
            "gate.weight": torch.cat([arrays[f"{name}/kernel"].T for name in dense]),
            "gate.bias": torch.cat([arrays[f"{name}/bias"] for name in dense]),
            "normalization.weight": arrays[f"params/{theirs}/normalization/scale"],
            "normalization.bias": arrays[f"params/{theirs}/normalization/bias"],
            "normalization.running_mean": arrays[f"{statistics}/mean"],
            "normalization.running_var": arrays[f"{statistics}/var"],
        }
        weights |= {f"layers.{layer}.{name}": array for name, array in block.items()}
    model.load_state_dict(weights)
    return model.eval(), arrays["input_displacement"], arrays["output_trajectory"]


def test_parameter_count_is_the_papers() -> None:
    assert count_parameters(S5(S5Configuration())) == 307_879


def test_agrees_with_the_reference_vector_on_both_routes() -> None:
    model, initial, expected = reference_model()
    torch.testing.assert_close(model(initial, expected.shape[1]).detach(), expected, rtol=0, atol=1e-13)
    with torch.no_grad():
        torch.testing.assert_close(model(initial, expected.shape[1]), expected, rtol=0, atol=1e-13)


@torch.no_grad()
def test_agrees_with_a_plain_recurrence() -> None:
    """The equations, one step after the other, in NumPy."""
    model, initial, _ = reference_model()

    def layer(ssm: S5Layer) -> tuple[np.ndarray, ...]:
        stored = {name: weight.numpy() for name, weight in ssm.named_parameters()}
        rate = stored["Lambda_re"] + 1j * stored["Lambda_im"]
        eigenvalue = np.exp(rate * np.exp(stored["log_step"][:, 0]))
        B = ((eigenvalue - 1) / rate)[:, None] * (stored["B"][:, 0] + 1j * stored["B"][:, 1])
        C = 2 * (stored["C"][..., 0] + 1j * stored["C"][..., 1])
        return eigenvalue, B, C, stored["D"]

    eigenvalue, B, C, _ = layer(model.first_layer)  # type: ignore[arg-type]
    first = initial.numpy() @ B.T
    blocks = [(block, *layer(block.seq)) for block in model.layers]  # type: ignore[arg-type]
    states = [np.zeros((3, len(eigenvalue)), complex) for _ in blocks]
    for frame in model(initial, 200).unbind(1):
        first = eigenvalue * first
        y = (first @ C.T).real
        for i, (block, block_eigenvalue, block_B, block_C, D) in enumerate(blocks):
            norm = block.normalization
            u = (y - norm.running_mean.numpy()) / np.sqrt(norm.running_var.numpy() + 1e-5)
            u = u * norm.weight.numpy() + norm.bias.numpy()
            states[i] = block_eigenvalue * states[i] + u @ block_B.T
            v = (states[i] @ block_C.T).real + D * u
            v = 0.5 * v * (1 + np.tanh(np.sqrt(2 / np.pi) * (v + 0.044715 * v**3)))
            value, gate = np.split(v @ block.gate.weight.numpy().T + block.gate.bias.numpy(), 2, axis=-1)
            y = y + value / (1 + np.exp(-gate))
        np.testing.assert_allclose(frame.numpy(), y, rtol=0, atol=1e-12)


def drawn_model() -> S5:
    model = S5(S5Configuration(21, state_size=32, hippo_blocks=4, layers=2))
    model.initialise("paper", Physics(resonator_of(StringParameters(), 10), 4_000), torch.Generator().manual_seed(0))
    return model.eval()


def test_hippo_is_normal_up_to_its_rank_one_part() -> None:
    """A_nk = -√(2n+1)√(2k+1) below the diagonal, -(n+1) on it; plus p pᵀ with p_n = √(n+½) it is normal."""
    n = torch.arange(8, dtype=torch.float64)
    root = torch.sqrt(2 * n + 1)
    legs = -torch.tril(torch.outer(root, root), -1) - torch.diag(n + 1)
    normal = legs + torch.outer(torch.sqrt(n + 0.5), torch.sqrt(n + 0.5))
    rates, vectors = hippo_normal(8)
    torch.testing.assert_close(vectors @ torch.diag(rates) @ vectors.mH, normal.to(rates), rtol=0, atol=1e-12)
    torch.testing.assert_close(rates[:4].conj().resolve_conj(), rates[4:].flip(0), rtol=0, atol=1e-12)


@torch.no_grad()
def test_paper_initialisation_is_hippo_in_blocks_with_steps_in_range() -> None:
    for block in drawn_model().layers:
        seq = block.seq
        rates, _ = hippo_normal(8)
        torch.testing.assert_close(seq.Lambda_im, rates.imag[:4].repeat(4).float())
        assert (seq.Lambda_re == -0.5).all()
        step = seq.log_step.exp()
        assert 0.0001 <= float(step.min()) < float(step.max()) <= 0.1


@pytest.mark.parametrize(("how", "fan_in", "smallest"), [("paper", 128 * 101, 1e-4), ("physics", 128, 1e-3)])
@torch.no_grad()
def test_the_papers_code_counts_the_outputs_in_the_fan_in_and_begins_with_shorter_steps(
    how: str, fan_in: int, smallest: float
) -> None:
    layer = S5Layer(64, 101, 101, 16)
    layer.initialise(how, torch.Generator().manual_seed(0))
    # real and imaginary parts of variance 1/fan_in each; half of V's columns keep it
    assert float(layer.C.square().mean()) * fan_in == pytest.approx(1, rel=0.05)
    assert float(layer.log_step.exp().min()) == pytest.approx(smallest, rel=0.5)


@torch.no_grad()
def test_an_eigenvalue_may_lie_outside_the_unit_circle() -> None:
    model = drawn_model()
    assert torch.isfinite(model(torch.ones(1, 21), 20_000)).all()
    model.layers[1].seq.Lambda_re[2] = 0.3
    growing = torch.cat(model.log_eigenvalues()).real > 0
    assert int(growing.sum()) == 2  # a pair


@pytest.mark.parametrize("sizes", [{"grid_points": 0}, {"state_size": 0}, {"hippo_blocks": 0}, {"layers": -1}])
def test_impossible_sizes_are_named(sizes: dict) -> None:
    with pytest.raises(ValueError, match=f"{next(iter(sizes))} must lie in"):
        S5Configuration(**sizes)
    with pytest.raises(ValueError, match="state_size must be a multiple of twice the 16 hippo_blocks, not 100"):
        S5Configuration(state_size=100)
