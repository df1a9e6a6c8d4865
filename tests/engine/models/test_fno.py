"""FGRU and FRNN against their reference vectors, plain recurrences, and the laws of the contract."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch

from engine.models._fno_transform import transform_matrices
from engine.models.base import Physics, count_parameters
from engine.models.configurations import FGRUConfiguration, FRNNConfiguration
from engine.models.fno import FGRU, FRNN, FieldState, FourierConvolution
from engine.resonators.string import resonator_of
from engine.values.string import StringParameters
from tests.engine.tensors import convolved, listening_weights

REFERENCES = Path(__file__).parent / "references"
Model = FGRU | FRNN
Make = Callable[..., Model]


def fgru(grid_points: int = 11, width: int = 6, **others: str) -> FGRU:
    return FGRU(FGRUConfiguration(grid_points, width, **others))


def frnn(grid_points: int = 11, width: int = 6, **others: str) -> FRNN:
    return FRNN(FRNNConfiguration(grid_points, width, **others))


both = pytest.mark.parametrize("make", [fgru, frnn])


def drawn(model: Model, seed: int = 0) -> Model:
    """With weights under which the motion neither dies nor grows at once."""
    generator = torch.Generator().manual_seed(seed)
    with torch.no_grad():
        for module in model.modules():
            if isinstance(module, FourierConvolution):
                module.weight.normal_(0, 0.5 * module.weight.shape[1] ** -0.5, generator=generator)
                module.bias.normal_(0, 0.5, generator=generator)
            elif isinstance(module, torch.nn.Linear):
                module.weight.normal_(0, 0.5 * module.in_features**-0.5, generator=generator)
    return model.eval()


def initial(batch: int, points: int) -> torch.Tensor:
    return torch.randn(batch, points, generator=torch.Generator().manual_seed(1))


def reference(make: Make) -> tuple[Model, torch.Tensor, torch.Tensor]:
    """A model with the reference's weights, its input, and its output."""
    file = np.load(REFERENCES / f"{make.__name__}.npz")
    arrays = {name.removeprefix("params/"): torch.from_numpy(array) for name, array in file.items()}
    model = make()
    if isinstance(model, FGRU):
        convolutions = {name: name for name in ("z_layer", "r_layer", "h_layer")}
    else:
        convolutions = {f"fourier_layers.{i}": f"fourier_conv_layers/{i}" for i in range(3)}
    dense = {"in_mapping": "in_mapping", "out_mapping": "out_mapping"}
    if isinstance(model, FRNN):
        dense |= {f"pointwise_layers.{i}": f"w/{i}" for i in range(3)}
    weights = {}
    for ours, theirs in convolutions.items():  # in, out, frequency, real/imaginary
        weights[f"{ours}.weight"] = arrays[f"{theirs}/weights"].permute(2, 0, 3, 1)
        weights[f"{ours}.bias"] = arrays[f"{theirs}/biases"].permute(1, 2, 0)
    for ours, theirs in dense.items():
        weights[f"{ours}.bias"] = arrays[f"{theirs}/bias"]
        weights[f"{ours}.weight"] = arrays[f"{theirs}/weight"].reshape(len(weights[f"{ours}.bias"]), -1)
    model.load_state_dict(weights)
    return model, arrays["input_displacement"], arrays["output_trajectory"]


def test_parameter_counts_are_the_papers() -> None:
    assert count_parameters(FGRU(FGRUConfiguration())) == 640_033
    assert count_parameters(FRNN(FRNNConfiguration())) == 643_201


@both
def test_agrees_with_the_reference_vector(make: Make) -> None:
    model, start, expected = reference(make)
    trained = model(start, expected.shape[1])
    assert trained.requires_grad  # the roll-out
    torch.testing.assert_close(trained, expected, rtol=0, atol=1e-6)
    with torch.no_grad():  # the kernel
        torch.testing.assert_close(model(start, expected.shape[1]), expected, rtol=0, atol=1e-6)
        precise = model.double()(start.double(), expected.shape[1])
    torch.testing.assert_close(precise.float(), expected, rtol=0, atol=1e-6)


@both
@torch.no_grad()
def test_agrees_with_a_plain_recurrence(make: Make) -> None:
    """Complex DFT sums over the doubled string, one frequency and its conjugate after the other."""
    model = drawn(make().double())
    w = {name: tensor.numpy() for name, tensor in model.state_dict().items()}
    points = model.grid_points
    t = np.arange(points)

    def convolve(name: str, field: np.ndarray) -> np.ndarray:
        total = np.zeros_like(field)
        for k in range(points):
            wave = np.exp(1j * np.pi * k * t / points)
            re, im = w[f"{name}.weight"][k].transpose(1, 0, 2)
            coefficient = wave.conj() @ field @ (re + 1j * im) + np.array([1, 1j]) @ w[f"{name}.bias"][k]
            total += (1 if k == 0 else 2) * (wave[:, None] * coefficient).real / (2 * points)
        return total

    def sigmoid(x: np.ndarray) -> np.ndarray:
        return 1 / (1 + np.exp(-x))

    start = initial(1, points).double()
    h = start.numpy()[0][:, None] * w["in_mapping.weight"][:, 0] + w["in_mapping.bias"]
    for frame in model(start, 30)[0].numpy():
        if isinstance(model, FGRU):
            z, r = sigmoid(convolve("z_layer", h)), sigmoid(convolve("r_layer", h))
            h = (1 - z) * h + z * np.tanh(convolve("h_layer", r * h))
        else:
            for i in range(3):
                straight = h @ w[f"pointwise_layers.{i}.weight"].T + w[f"pointwise_layers.{i}.bias"]
                h = np.maximum(convolve(f"fourier_layers.{i}", h), 0) + straight
        np.testing.assert_allclose(frame, h @ w["out_mapping.weight"][0] + w["out_mapping.bias"], rtol=0, atol=1e-11)


@pytest.mark.parametrize("points", [1, 2, 3, 10, 101])
@both
@torch.no_grad()
def test_the_kernel_agrees_with_the_rollout(make: Make, points: int) -> None:
    model = drawn(make(points, 8))
    start = initial(2, points)
    fast, state = model.advance(model.encode(start), 50)
    exact, last = model.double().advance(FieldState(model.encode(start.double()).hidden), 50)
    size = float(exact.abs().max())
    torch.testing.assert_close(fast.double(), exact, rtol=0, atol=1e-5 * size)
    torch.testing.assert_close(state.hidden.double(), last.hidden, rtol=0, atol=1e-5 * float(last.hidden.abs().max()))


def by_definition(model: Model, hidden: torch.Tensor, steps: int) -> tuple[torch.Tensor, torch.Tensor]:
    frames = []
    for _ in range(steps):
        if isinstance(model, FGRU):
            z, r = convolved(model.z_layer, hidden).sigmoid(), convolved(model.r_layer, hidden).sigmoid()
            hidden = (1 - z) * hidden + z * convolved(model.h_layer, r * hidden).tanh()
        else:
            for layer, pointwise in zip(model._convolutions, model.pointwise_layers, strict=True):
                hidden = convolved(layer, hidden).relu() + pointwise(hidden)
        frames.append(model.out_mapping(hidden)[..., 0])
    return torch.stack(frames, dim=1), hidden


@pytest.mark.parametrize("kept_bytes", [10**9, 50_000])
@pytest.mark.parametrize("points", [1, 2, 3, 10, 101])
@both
def test_what_learns_agrees_with_the_definition(
    make: Make, points: int, kept_bytes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Frames, last state and every gradient; also where steps are computed again for want of memory."""
    monkeypatch.setattr("engine.models.fno.KEPT_BYTES", kept_bytes)
    model = drawn(make(points, 6)).double()
    start, wanted = initial(3, points).double(), torch.randn(3, 7, points, generator=torch.Generator().manual_seed(2))
    found = []
    for advance in (partial(by_definition, model), model._advance_plain):
        model.zero_grad()
        frames, last = advance(model.encode(start).hidden, 7)
        ((frames - wanted).square().mean() + last.square().mean()).backward()
        found.append([frames, last, *(parameter.grad for parameter in model.parameters())])
    for expected, fast in zip(*found, strict=True):
        torch.testing.assert_close(fast, expected, rtol=1e-9, atol=1e-12)


def test_the_folded_transform_and_its_inverse_undo_each_other() -> None:
    """Up to the one frequency that is not kept."""
    field = initial(1, 100)[0].double().numpy()
    forward, inverse = transform_matrices(100)
    mirrored = np.concatenate([[0], field[:50:-1], [0]])
    halves = inverse @ (forward @ np.stack([field[:51] + mirrored, field[:51] - mirrored])[..., None])
    highest = (field * (-1.0) ** np.arange(100)).sum() / 200
    np.testing.assert_allclose(halves.sum(0)[:, 0], field[:51] - highest * (-1.0) ** np.arange(51), rtol=0, atol=1e-5)


@pytest.mark.parametrize(("width", "blocks"), [(6, (1, 64, 65, 513, 57)), (3, (1, 2, 7))])
@both
@torch.no_grad()
def test_any_splitting_into_blocks_is_the_same_motion(make: Make, width: int, blocks: tuple[int, ...]) -> None:
    """By the kernel, and by the roll-out, which takes an odd width."""
    model = drawn(make(width=width))
    start = initial(2, 11)
    whole = model(start, sum(blocks))
    state, parts = model.encode(start), []
    for steps in blocks:
        part, state = model.advance(state, steps)
        parts.append(part)
    torch.testing.assert_close(torch.cat(parts, 1), whole, rtol=0, atol=1e-6)


@both
@torch.no_grad()
def test_a_state_is_a_value(make: Make) -> None:
    model = drawn(make())
    state = model.encode(initial(1, 11))
    assert torch.equal(model.advance(state, 20)[0], model.advance(state, 20)[0])


@both
@torch.no_grad()
def test_listening_is_the_grid_at_that_point(make: Make) -> None:
    model = drawn(make())
    weights = listening_weights([0.37, 0.123], 11)
    heard = model(initial(2, 11), 50, weights)
    torch.testing.assert_close(heard, model(initial(2, 11), 50) @ weights.float(), rtol=1e-4, atol=1e-5)


@both
def test_the_gradient_reaches_every_weight_through_the_steps(make: Make) -> None:
    model = make()
    model.initialise("paper", Physics(resonator_of(StringParameters(), 5), 4_000), torch.Generator().manual_seed(0))
    frames, _ = model.advance(model.encode(initial(2, 11)), 12)
    frames.square().mean().backward()
    for name, parameter in model.named_parameters():
        assert parameter.grad is not None
        assert torch.isfinite(parameter.grad).all(), name
        assert parameter.grad.abs().max() > 0, name


@torch.no_grad()
def test_an_fgru_stays_bounded() -> None:
    """Each step is a mean of the field and of a tanh: no weights can make it grow."""
    model = drawn(fgru(width=2))
    for parameter in model.parameters():
        parameter.mul_(10)
    state = model.encode(initial(1, 11))
    first = max(1.0, float(state.hidden.abs().max()))
    _, state = model.advance(state, 40_000)
    assert float(state.hidden.abs().max()) <= first + 1e-5


@torch.no_grad()
def test_an_frnn_that_blows_up_shows_it() -> None:
    model = drawn(frnn())
    for layer in model.pointwise_layers:
        layer.weight.mul_(10)
    frames = model(initial(1, 11), 400)
    assert torch.isfinite(frames[:, 0]).all()
    assert not torch.isfinite(frames[:, -1]).any()


@both
def test_the_seed_decides_all(make: Make) -> None:
    states = []
    for seed in (1, 1, 2):
        model = make()
        model.initialise(
            "paper", Physics(resonator_of(StringParameters(), 5), 4_000), torch.Generator().manual_seed(seed)
        )
        states.append(model.state_dict())
    first, again, other = states
    assert all(torch.equal(first[name], again[name]) for name in first)
    assert not any(torch.equal(first[name], other[name]) for name in first)
    with pytest.raises(ValueError, match="'physics' is not one of paper"):
        model.initialise("physics", Physics(resonator_of(StringParameters(), 5), 4_000), torch.Generator())


@both
def test_paper_initialisation_is_uniform_and_positive(make: Make) -> None:
    model = make()
    model.initialise("paper", Physics(resonator_of(StringParameters(), 5), 4_000), torch.Generator().manual_seed(0))
    for name, tensor in model.state_dict().items():
        if name.startswith(("z_layer", "r_layer", "h_layer", "fourier_layers")):
            largest = 1 / 36 if name.endswith("weight") else 1 / 6
            assert 0 <= float(tensor.min()) < 0.1 * largest < 0.9 * largest < float(tensor.max()) <= largest


@both
def test_is_made_without_memory(make: Make) -> None:
    with torch.device("meta"):
        model = make()
    model.load_state_dict(drawn(make()).state_dict(), assign=True)
    assert torch.isfinite(model(initial(1, 11), 3)).all()


@pytest.mark.parametrize("sizes", [{"grid_points": 0}, {"width": -1}, {"depth": 0}])
def test_impossible_sizes_are_named(sizes: dict[str, int]) -> None:
    (name,) = sizes
    for kind in (FGRUConfiguration, FRNNConfiguration):
        if name in kind.__dataclass_fields__:
            with pytest.raises(ValueError, match=f"{name} must lie in 1"):
                kind(**sizes)
