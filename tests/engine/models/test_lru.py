"""LRU against its reference vector and a plain recurrence, its sizes and its initialisation."""

from pathlib import Path

import numpy as np
import pytest
import torch

from engine.models.base import Physics, count_parameters
from engine.models.configurations import LRUConfiguration
from engine.models.lru import LRU, LRULayer
from engine.resonators.string import resonator_of
from engine.values.string import StringParameters

REFERENCE = Path(__file__).parent / "references" / "lru.npz"
STORED = ("B_re", "B_im", "C_re", "C_im", "D", "nu_log", "theta_log", "gamma_log")


def reference_model() -> tuple[LRU, torch.Tensor, torch.Tensor]:
    """A float64 model with the reference's weights, its input, and its exact output."""
    arrays = {name: torch.from_numpy(array) for name, array in np.load(REFERENCE).items()}
    model = LRU(LRUConfiguration(11, state_size=8, layers=2)).double()
    weights = model.state_dict()
    for ours, theirs in (
        ("first_layer", "first_layer"),
        ("layers.0.seq", "layers_0/seq"),
        ("layers.1.seq", "layers_1/seq"),
    ):
        stored = {
            name: arrays[f"params/{theirs}/{name}"]
            for name in ("B_re", "B_im", "C_re", "C_im", "D", "nu_log", "theta_log", "gamma_log")
        }
        for matrix, axis in (("B", 1), ("C", -1)):
            stored[matrix] = torch.stack([stored.pop(f"{matrix}_re"), stored.pop(f"{matrix}_im")], axis)
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
    assert count_parameters(LRU(LRUConfiguration())) == 636_221


def test_agrees_with_the_reference_vector_on_both_routes() -> None:
    model, initial, expected = reference_model()
    torch.testing.assert_close(model(initial, expected.shape[1]).detach(), expected, rtol=0, atol=1e-13)
    with torch.no_grad():
        torch.testing.assert_close(model(initial, expected.shape[1]), expected, rtol=0, atol=1e-13)


@torch.no_grad()
def test_agrees_with_a_plain_recurrence() -> None:
    """The equations, one step after the other, in NumPy."""
    model, initial, _ = reference_model()

    def layer(ssm: LRULayer) -> tuple[np.ndarray, ...]:
        stored = {name: weight.numpy() for name, weight in ssm.named_parameters()}
        eigenvalue = np.exp(-np.exp(stored["nu_log"]) + 1j * np.exp(stored["theta_log"]))
        B = np.exp(stored["gamma_log"])[:, None] * (stored["B"][:, 0] + 1j * stored["B"][:, 1])
        C = stored["C"][..., 0] + 1j * stored["C"][..., 1]
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


def drawn_model() -> LRU:
    model = LRU(LRUConfiguration(21, state_size=24, layers=2))
    model.initialise("paper", Physics(resonator_of(StringParameters(), 10), 4_000), torch.Generator().manual_seed(0))
    return model.eval()


@torch.no_grad()
def test_paper_initialisation_lies_in_the_ring_with_its_gamma() -> None:
    for block in drawn_model().layers:
        seq = block.seq
        radius = torch.exp(-seq.nu_log.exp())
        assert float(radius.min()) >= 0.99 - 1e-6
        assert float(radius.max()) <= 1
        torch.testing.assert_close(seq.gamma_log.exp(), torch.sqrt(1 - radius**2), rtol=1e-3, atol=1e-4)


@torch.no_grad()
def test_long_renders_stay_finite_and_no_weight_is_unstable() -> None:
    """|λ| < 1 for every parameter value: even wild ones cannot grow."""
    model = drawn_model()
    generator = torch.Generator().manual_seed(0)
    for name, weight in model.named_parameters():
        if name.endswith("nu_log"):
            weight.uniform_(-8, 3, generator=generator)
    frames = model(torch.randn(1, 21, generator=generator), 20_000)
    assert torch.isfinite(frames).all()
    assert float(frames[:, -5_000:].abs().max()) <= float(frames[:, :5_000].abs().max())


@pytest.mark.parametrize("sizes", [{"grid_points": 0}, {"state_size": 0}, {"layers": -1}])
def test_impossible_sizes_are_named(sizes: dict) -> None:
    with pytest.raises(ValueError, match=f"{next(iter(sizes))} must lie in"):
        LRUConfiguration(**sizes)
