"""The laws of every learned string: the base of a test class of each model, which adds its own numbers.

A new model inherits them: `class TestMine(ModelLaws)` with its name, its number of parameters and small sizes.
"""

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
import pytest
import torch
from torch import Tensor

from engine.models import MODELS, build_model, model_class
from engine.models._diagonal import DiagonalModel
from engine.models.base import Physics, StringModel, count_parameters
from engine.presets import load_preset, read_info, save_preset
from engine.resonators.string import resonator_of
from engine.schema import write
from engine.sources import ModelSource
from engine.truth import ModalState
from engine.values.string import StringParameters
from tests.engine.tensors import listening_weights, solve_linear, to_grid

MODES, POINTS, SCALE_M = 10, 21, 1e-3
PHYSICS = Physics(resonator_of(StringParameters(), MODES, grid_points=POINTS), 4_000, SCALE_M)
LINEAR = Physics(resonator_of(StringParameters(), MODES, tension_modulated=False, grid_points=POINTS), 8_000, SCALE_M)
REFERENCES = Path(__file__).parent / "references"


class Motion(NamedTuple):
    """Three strings that were released, and their frames."""

    model: StringModel[Any]
    released: Tensor
    whole: Tensor


def relative(found: Tensor, expected: Tensor) -> float:
    """The largest difference, as a share of the largest value."""
    assert found.shape == expected.shape
    return float((found.double() - expected.double()).abs().max() / expected.double().abs().max())


def released(batch: int = 3, points: int = POINTS) -> Tensor:
    """Displacements whose modes fall as those of a pluck, (batch, points), in the model's unit."""
    amplitudes = torch.randn(batch, MODES, generator=torch.Generator().manual_seed(1))
    return to_grid(amplitudes / torch.arange(1, MODES + 1), points)


class ModelLaws:
    """Laws of one model.

    Attributes:
        count: parameters at the default sizes.
        sizes: small ones, of `POINTS` points; `variants` change them for the laws of motion.
        near: of the largest value, between two ways to the same motion.
        linear: the error of each start that knows the string at rest, on that string.
        too_small: sizes that a start with knowledge refuses, and its words.
        unused: parameters that no frame depends on.
        reference: the error against the authors' code, whose weights and output `references` has by our names.
        stable: whether no value of a weight brings an eigenvalue out of the unit circle.
    """

    name: ClassVar[str]
    count: ClassVar[int]
    sizes: ClassVar[dict[str, Any]]
    variants: ClassVar[tuple[dict[str, Any], ...]] = ({},)
    blocks: ClassVar[tuple[int, ...]] = (1, 64, 65, 2047, 2823)
    near: ClassVar[float] = 1e-5
    linear: ClassVar[dict[str, float]] = {}
    too_small: ClassVar[tuple[dict[str, Any], str] | None] = None
    unused: ClassVar[frozenset[str]] = frozenset()
    drawn: ClassVar[bool] = True
    reference: ClassVar[float | None] = None
    reference_sizes: ClassVar[dict[str, Any]] = {}
    stable: ClassVar[bool] = True

    def stir(self, model: Any, generator: torch.Generator) -> None:
        """Give a model that starts from its source weights with which it uses all it has."""
        for parameter in model.parameters():
            if not parameter.any():
                parameter.normal_(0, 0.1, generator=generator)

    def made(self, how: str | None = None, seed: int = 0, physics: Physics = PHYSICS, **sizes: Any) -> Any:
        model = build_model(self.name, {"grid_points": POINTS, **self.sizes, **sizes})
        model.initialise(how or model.own_initialisation(), physics, torch.Generator().manual_seed(seed))
        return model.eval()

    @torch.no_grad()
    def stirred(self, **sizes: Any) -> Any:
        model = self.made(**sizes)
        self.stir(model, torch.Generator().manual_seed(5))
        return model

    @pytest.fixture(scope="class")
    @classmethod
    def motion(cls, request: pytest.FixtureRequest) -> Motion:
        model = cls().stirred(**request.param)
        with torch.no_grad():
            return Motion(model, released(), model(released(), sum(cls.blocks)))

    def test_it_has_as_many_parameters_as_are_stated_and_can_be_built_without_memory(self):
        with torch.device("meta"):
            model = build_model(self.name)
        assert count_parameters(model) == self.count
        assert all(tensor.is_meta for tensor in model.parameters())

    @torch.no_grad()
    def test_it_is_the_reference_vector_on_both_routes(self):
        if self.reference is None:
            pytest.skip("its source has none")
        arrays = {name: torch.from_numpy(array) for name, array in np.load(REFERENCES / f"{self.name}.npz").items()}
        start, expected = arrays.pop("input_displacement"), arrays.pop("output_trajectory")
        model = build_model(self.name, self.reference_sizes).to(expected.dtype).eval()
        model.load_state_dict(model.state_dict() | arrays)
        with torch.enable_grad():
            trained = model(start, expected.shape[1])
        assert trained.requires_grad
        for found in (trained.detach(), model(start, expected.shape[1])):
            torch.testing.assert_close(found, expected, rtol=0, atol=self.reference)
        precise = model.double()(start.double(), expected.shape[1])
        torch.testing.assert_close(precise.to(expected), expected, rtol=0, atol=self.reference)

    @torch.no_grad()
    def test_any_splitting_into_blocks_is_the_same_motion_also_where_a_state_is_gone_on_from_twice(self, motion):
        state, parts = motion.model.encode(motion.released), []
        for steps in self.blocks:
            motion.model.advance(state, 30)
            part, state = motion.model.advance(state, steps)
            parts.append(part)
        assert relative(torch.cat(parts, 1), motion.whole) < self.near

    @torch.no_grad()
    def test_a_frame_does_not_depend_on_those_after_it_nor_on_other_strings(self, motion):
        for row, released in enumerate(motion.released):
            assert relative(motion.model(released[None], 50), motion.whole[row : row + 1, :50]) < self.near

    @torch.no_grad()
    def test_listening_is_the_grid_at_that_point(self, motion):
        weights, total = listening_weights([0.37, 0.123], POINTS), sum(self.blocks)
        state, parts = motion.model.encode(motion.released), []
        for steps in (total // 3, total - total // 3):
            part, state = motion.model.advance(state, steps, weights)
            parts.append(part)
        assert relative(torch.cat(parts, 1), motion.whole @ weights.to(motion.whole)) < 2 * self.near

    @torch.no_grad()
    def test_some_frames_are_those_of_all(self, motion):
        """From any state, of any of the next frames, none among them, and the state after them continues the same."""
        model = motion.model
        if not model.any_frame:
            pytest.skip("it steps through every frame")
        state, done = model.encode(motion.released), 0
        for steps, frames in ((1, [1]), (300, [1, 2, 12, 299]), (650, []), (900, [7, 500, 900]), (49, [48])):
            numbers = torch.tensor(frames, dtype=torch.int64)
            some, state = model.sample(state, numbers, steps)
            expected = motion.whole[:, done + numbers - 1]
            torch.testing.assert_close(some, expected, rtol=0, atol=self.near * float(motion.whole.abs().max()))
            done += steps

    def test_training_takes_the_same_path_and_a_gradient_reaches_every_weight(self, motion):
        model = motion.model
        model.zero_grad()
        found = model(motion.released, 300)
        assert relative(found.detach(), motion.whole[:, :300]) < self.near
        found[:, :40].square().mean().backward()
        gradients = {name: parameter.grad for name, parameter in model.named_parameters()}
        unreached = {name for name, gradient in gradients.items() if gradient is None or not gradient.any()}
        assert unreached == self.unused
        assert all(gradients[name].isfinite().all() for name in gradients.keys() - unreached)

    @torch.no_grad()
    def test_phases_stay_exact_after_a_million_steps(self):
        """Latents of eigenvalues that do not decay, against extended precision."""
        model = self.stirred()
        if not isinstance(model, DiagonalModel):
            pytest.skip("its latents have no powers")
        for parameter in (model.get_parameter(name) for name in ("nu_log", "magnitude_log") if hasattr(model, name)):
            parameter.fill_(-math.inf if parameter is getattr(model, "nu_log", None) else 0.0)
        (log,) = model.log_eigenvalues()
        frames = np.arange(1_000_000, 1_000_100)
        angle = np.multiply.outer(frames.astype(np.longdouble), log.imag.numpy().astype(np.longdouble))
        expected = torch.from_numpy(np.exp(1j * np.remainder(angle, 2 * np.longdouble(np.pi)).astype(float)))
        for kind, near in ((torch.complex128, 1e-8), (torch.complex64, 1e-6)):
            origin = torch.ones(1, len(log), dtype=kind)
            for found in (
                model.latents(origin, torch.from_numpy(frames)),
                model.successive_latents(origin, 1_000_000, 100),
            ):
                assert float((found[0] - expected).abs().max()) < near

    @torch.no_grad()
    def test_eigenvalues_lie_inside_the_unit_circle(self):
        """As the model starts; and whatever the weights, where it promises so."""
        model = self.made()
        assert all(float(log.real.max()) <= 0 for log in model.log_eigenvalues())
        if not self.stable:
            return
        generator = torch.Generator().manual_seed(0)
        for name, parameter in model.named_parameters():
            if name.rpartition(".")[2] in model.eigenvalue_parameters:
                parameter.uniform_(-12, 3, generator=generator)
        assert all(float(log.real.max()) < 0 for log in model.log_eigenvalues())
        if isinstance(model, DiagonalModel):
            radii = model.latents(model.encode(released()).origin, torch.tensor([0, 1000, 10_000_000])).abs()
            assert bool((radii.diff(dim=1) <= 0).all())

    def test_the_seed_decides_all(self):
        for how in model_class(self.name).initialisations:
            first, again, other = (self.made(how, seed).state_dict() for seed in (1, 1, 2))
            assert all(torch.equal(first[name], again[name]) for name in first)
            assert self.drawn == any(not torch.equal(first[name], other[name]) for name in first)

    @torch.no_grad()
    def test_a_start_that_knows_the_string_at_rest_moves_as_it(self):
        amplitudes = 0.3 * torch.randn(2, MODES, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
        state, times_s = ModalState.at_rest(amplitudes), torch.arange(401).double() / LINEAR.rate_hz
        truth = to_grid(solve_linear(LINEAR.resonator, state, times_s), POINTS)
        for how, error in self.linear.items():
            found = self.made(how, physics=LINEAR).double()(truth[:, 0], 400)
            assert float((found - truth[:, 1:]).norm() / truth[:, 1:].norm()) < error, how

    def test_a_string_without_losses_can_be_started_from(self):
        string = StringParameters(damping_d1_kg_m_s=0.0, damping_d3_kg_m_s=0.0)
        physics = Physics(resonator_of(string, MODES, grid_points=POINTS), 16_000, SCALE_M)
        for how in model_class(self.name).initialisations:
            assert all(part.isfinite().all() for part in self.made(how, physics=physics).state_dict().values())

    def test_impossible_sizes_and_starts_are_named(self):
        kind = MODELS[self.name][1]
        for field in dataclasses.fields(kind):
            if isinstance(field.default, tuple | int | float) and not isinstance(field.default, bool):
                with pytest.raises(ValueError, match=f"{field.name} must lie in"):
                    kind(**{field.name: (4, 0) if isinstance(field.default, tuple) else -1})
        with pytest.raises(ValueError, match="'guess' is not one of"):
            self.made("guess")
        if self.too_small is not None:
            sizes, words = self.too_small
            with pytest.raises(ValueError, match=words):
                self.made(next(iter(self.linear)), **sizes)

    def test_a_preset_of_it_renders_what_the_model_does(self, preset_file, tmp_path):
        model, path = self.stirred(), tmp_path / f"{self.name}.safetensors"
        info = replace(
            read_info(preset_file),
            model=self.name,
            model_configuration=write(model.configuration),
            initialisation=model.own_initialisation(),
            grid_points=POINTS,
        )
        save_preset(path, info, model)
        preset = load_preset(path)
        assert all(torch.equal(preset.model.state_dict()[key], tensor) for key, tensor in model.state_dict().items())
        source, initial = ModelSource(preset), SCALE_M * released().double().numpy()
        frames, _ = source.advance(source.start(initial), 16)
        with torch.inference_mode():
            expected = model(torch.from_numpy(initial / SCALE_M).float(), 16) * SCALE_M
        torch.testing.assert_close(torch.from_numpy(frames), expected)


def subclasses(kind: type = ModelLaws) -> Iterator[type[ModelLaws]]:
    for each in kind.__subclasses__():
        yield each
        yield from subclasses(each)
