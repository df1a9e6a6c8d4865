"""The contract of `engine.models.base`, for every model in the table at the paper's sizes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch

from engine.models import MODELS, build_model, model_class
from engine.models.base import AnyFrameModel, Physics, StringModel, count_parameters
from engine.pluck import Pluck
from engine.presets import load_preset, read_info, save_preset
from engine.resonators.sine_transform import project
from engine.resonators.string import resonator_of
from engine.schema import SchemaError, write
from engine.sources import ModelSource
from engine.values.string import StringParameters
from tests.engine.tensors import displacement_of, listening_weights

PAPER_COUNTS = {
    "koopman": 191_077,
    "koopman_var": 134_885,
    "lru": 636_221,
    "s5": 307_879,
    "fgru": 640_033,
    "frnn": 643_201,
}
PHYSICS = Physics(resonator_of(StringParameters(), 10), 4_000, 1e-3)


def made(name: str, seed: int = 0) -> StringModel[Any]:
    model = build_model(name)
    model.initialise(model.own_initialisation(), PHYSICS, torch.Generator().manual_seed(seed))
    return model.eval()


@pytest.fixture(scope="module", params=list(MODELS))
def named_model(request: pytest.FixtureRequest) -> tuple[str, StringModel[Any]]:
    return request.param, made(request.param)


@pytest.mark.parametrize("name", PAPER_COUNTS)
def test_the_counts_are_those_of_table_2(name: str) -> None:
    with torch.device("meta"):
        assert count_parameters(build_model(name)) == PAPER_COUNTS[name]


@torch.inference_mode()
def test_any_splitting_into_blocks_is_the_same_motion(named_model: tuple[str, StringModel[Any]]) -> None:
    _, model = named_model
    initial = (displacement_of(Pluck()) / 1e-3).float()[None]
    whole = model(initial, 700)
    state, parts = model.encode(initial), []
    for steps in (1, 64, 65, 257, 313):
        part, state = model.advance(state, steps)
        parts.append(part)
    torch.testing.assert_close(torch.cat(parts, 1), whole, rtol=0, atol=1e-5 * float(whole.abs().max()))


@torch.inference_mode()
def test_some_frames_are_those_of_all(named_model: tuple[str, StringModel[Any]]) -> None:
    """From any state, of any of the next frames, none among them, and the state after them continues the same."""
    _, model = named_model
    if not isinstance(model, AnyFrameModel):
        pytest.skip("it steps through every frame")
    initial = (displacement_of(Pluck()) / 1e-3).float()[None]
    whole = model(initial, 1900)
    near = 1e-5 * float(whole.abs().max())
    state, done = model.encode(initial), 0
    for steps, frames in ((1, [1]), (300, [1, 2, 12, 299]), (650, []), (900, [7, 500, 900]), (49, [48])):
        numbers = torch.tensor(frames, dtype=torch.int64)
        some, state = model.sample(state, numbers, steps)
        expected = whole[:, done + numbers - 1]
        torch.testing.assert_close(some, expected, rtol=0, atol=near)
        done += steps


@torch.inference_mode()
def test_a_state_can_be_gone_on_from_twice(named_model: tuple[str, StringModel[Any]]) -> None:
    _, model = named_model
    initial = (displacement_of(Pluck()) / 1e-3).float()[None]
    _, state = model.advance(model.encode(initial), 50)
    first, _ = model.advance(state, 30)
    again, _ = model.advance(state, 30)
    assert torch.equal(first, again)


@torch.inference_mode()
def test_listening_is_the_grid_at_that_point(named_model: tuple[str, StringModel[Any]]) -> None:
    _, model = named_model
    initial = (displacement_of(Pluck()) / 1e-3).float()[None]
    weights = listening_weights([0.37, 0.61], 101).float()
    grid = model(initial, 64)
    heard = model(initial, 64, weights)
    assert heard.shape == (1, 64, 2)
    torch.testing.assert_close(heard, grid @ weights.to(grid), rtol=0, atol=2e-5 * float(grid.abs().max()))


def test_the_seed_decides_all(named_model: tuple[str, StringModel[Any]]) -> None:
    name, model = named_model
    again = made(name).state_dict()
    assert all(torch.equal(again[key], tensor) for key, tensor in model.state_dict().items())


def test_an_unknown_initialisation_is_named(named_model: tuple[str, StringModel[Any]]) -> None:
    _, model = named_model
    with pytest.raises(ValueError, match="'guess'"):
        model.initialise("guess", PHYSICS, torch.Generator())


def test_a_preset_of_it_renders_what_the_model_does(
    named_model: tuple[str, StringModel[Any]], preset_file: Path, tmp_path: Path
) -> None:
    name, model = named_model
    info = replace(
        read_info(preset_file),
        model=name,
        model_configuration=write(model.configuration),
        initialisation=model.own_initialisation(),
    )
    path = tmp_path / f"{name}.safetensors"
    save_preset(path, info, model)
    preset = load_preset(path)
    for key, tensor in model.state_dict().items():
        assert torch.equal(preset.model.state_dict()[key], tensor)
    source = ModelSource(preset)
    initial = project(Pluck(0.4, 3.0).displacement(101), info.modes)[None]
    frames, _ = source.advance(source.start(initial), 16)
    with torch.inference_mode():
        expected = model(torch.from_numpy(initial / info.scale_m).float(), 16) * info.scale_m
    torch.testing.assert_close(torch.from_numpy(frames), expected)


def test_sizes_are_checked_by_name() -> None:
    with pytest.raises(SchemaError, match="unknown field 'depht'"):
        build_model("frnn", {"depht": 3})


@pytest.mark.parametrize(
    ("name", "how"),
    [(name, how) for name in MODELS for how in model_class(name).initialisations if how != "paper"],
)
def test_a_string_without_losses_can_be_started_from(name: str, how: str) -> None:
    string = StringParameters(damping_d1_kg_m_s=0.0, damping_d3_kg_m_s=0.0)
    model = build_model(name)
    model.initialise(how, Physics(resonator_of(string, 10), 16_000, 1e-3), torch.Generator().manual_seed(0))
    assert all(part.isfinite().all() for part in model.state_dict().values())
