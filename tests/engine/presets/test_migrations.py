"""Presets of every version load, and those that were shipped sound as they did then."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load_file, save_file

from engine.pluck import Pluck
from engine.presets import PresetError, load_preset, preset_digest, preset_files, read_info
from engine.presets.file import METADATA_KEY
from engine.presets.migrations import FORMAT_VERSION, MIGRATIONS, UnknownVersion, migrated
from engine.resonators.sine_transform import project
from engine.sources import ModelSource

SHIPPED = json.loads(Path(__file__).with_name("shipped.json").read_text(encoding="utf-8"))
FRAMES = 64  # from the pluck on: enough to tell any other weights or any other reading of them
EVERY = 8
APART = 0.02  # in units of 10 µm
FRNN_APART = 0.5  # what it computes in single precision differs by up to 0.2 between an AMD and an Intel processor


def beginning(path: Path) -> list[float]:
    """The middle of the string in units of 10 µm, every so many frames after a pluck, from a preset's model."""
    preset = load_preset(path)
    source = ModelSource(preset)
    pluck = Pluck(shape="gaussian", position=0.4, amplitude_mm=4.0, width=0.05)
    state = source.start(project(pluck.displacement(preset.info.grid_points), preset.info.modes)[None])
    frames, _ = source.advance(state, FRAMES)
    return [round(float(value) * 1e5, 3) for value in frames[0, ::EVERY, preset.info.grid_points // 2]]


@pytest.mark.parametrize("path", preset_files(), ids=lambda path: path.stem)
def test_a_shipped_preset_sounds_as_it_did_when_it_was_shipped(path: Path) -> None:
    """Where one is added or trained again: add what the message shows to shipped.json."""
    digest = preset_digest(path)
    assert digest in SHIPPED, f"not in shipped.json: {json.dumps(digest)}: {beginning(path)}"
    apart = FRNN_APART if read_info(path).model == "frnn" else APART
    np.testing.assert_allclose(beginning(path), SHIPPED[digest], rtol=0, atol=apart)


def test_the_chain_is_whole() -> None:
    assert sorted(MIGRATIONS) == list(range(1, FORMAT_VERSION))


@pytest.mark.parametrize(
    ("model", "initialisation", "knows"),
    [
        ("koopman_integrated", "averaging", "the modes of the string at rest, and how tension couples them"),
        (
            "koopman_integrated",
            "phases of the displacement",
            "that a string may be mirrored and its sign turned, and how many modes it has",
        ),
        ("fgru", "phases of the displacement", "that a string may be mirrored and its sign turned"),
        ("koopman", "blind matching pursuit", "that a string may be mirrored and its sign turned"),
        ("koopman", "paper", ""),
    ],
)
def test_version_1_is_reported_what_its_start_knew(model: str, initialisation: str, knows: str) -> None:
    old = {"format_version": 1, "model": model, "initialisation": initialisation, "title": "as it was"}
    assert migrated(old) == {**old, "format_version": FORMAT_VERSION, "knows": knows}
    assert old["format_version"] == 1  # the input stays as it is


def test_the_input_of_version_3_is_what_every_model_sets_out_from() -> None:
    old = {"format_version": 3, "model_configuration": {"state_size": 3, "input": "displacement"}}
    assert migrated(old) == {"format_version": FORMAT_VERSION, "model_configuration": {"state_size": 3}}
    with pytest.raises(UnknownVersion, match="input 'two_frames' is no longer read; train the model again"):
        migrated({"format_version": 3, "model_configuration": {"input": "two_frames"}})


@pytest.mark.parametrize(
    ("initial", "family", "width", "peak_m", "expected"),
    [
        ("gaussian", None, [0.02, 0.1], [1e-3, 1e-2], {"gaussian": [0.02, 0.1]}),
        ("noise", None, None, [1e-3, 1e-2], None),
        ("pluck", None, [0.03, 0.3], [5e-4, 1e-2], {"gaussian": [0.03, 0.3], "raised_cosine": [0.03, 0.3]}),
        (
            "pluck",
            {"half_width": [0.04, 0.15]},
            [0.04, 0.3],
            [5e-4, 1e-2],
            {"gaussian": [0.04, 0.15], "raised_cosine": [0.08, 0.3]},
        ),
    ],
)
def test_version_4_states_widths_by_shape_and_no_peak_of_a_family(
    initial: str, family: Any, width: Any, peak_m: Any, expected: Any
) -> None:
    of_plucks = {"position": None, "width": width, "peak_m": peak_m, "tension_rise": 0.5}
    old = {"format_version": 4, "initial": initial, "family": family, "trained_range": of_plucks}
    found = migrated(old)
    assert found["format_version"] == FORMAT_VERSION
    assert found["trained_range"] == {**of_plucks, "width": expected, "peak_m": None if family else peak_m}
    assert old["trained_range"] is of_plucks  # the input stays as it is
    assert of_plucks["width"] == width


@pytest.mark.parametrize("wrong", [None, 5, "wide", [1], {"half_width": "wide"}, {"half_width": [1]}, {}])
def test_what_is_no_range_is_left_to_the_reader(wrong: Any) -> None:
    for data in ({"trained_range": wrong}, {"trained_range": {}, "family": wrong}):
        assert migrated({"format_version": 4, **data})["format_version"] == FORMAT_VERSION


@pytest.mark.parametrize("version", [None, 0, -1, "1", True, 1.0, FORMAT_VERSION + 1])
def test_other_versions_are_refused(version: Any) -> None:
    remedy = "update the program" if version == FORMAT_VERSION + 1 else "get the preset again"
    with pytest.raises(UnknownVersion, match=remedy):
        migrated({"format_version": version})


def test_metadata_that_is_no_object_is_refused(small_preset: Path, tmp_path: Path) -> None:
    path = tmp_path / "list.safetensors"
    save_file(load_file(small_preset), path, metadata={METADATA_KEY: "[1, 2]"})
    with pytest.raises(PresetError, match="no JSON object"):
        read_info(path)


def test_a_preset_of_version_1_loads_with_the_same_weights(small_preset: Path, tmp_path: Path) -> None:
    with safe_open(small_preset, "pt") as file:
        facts = json.loads(file.metadata()[METADATA_KEY])
    del facts["knows"]
    facts["format_version"] = 1
    facts["model_configuration"]["input"] = "displacement"
    facts["trained_range"]["width"] = facts["trained_range"]["width"]["gaussian"]
    path = tmp_path / "old.safetensors"
    save_file(load_file(small_preset), path, metadata={METADATA_KEY: json.dumps(facts)})
    old, new = load_preset(path), load_preset(small_preset)
    assert old.info.format_version == FORMAT_VERSION
    for name, weight in new.model.state_dict().items():
        assert torch.equal(weight, old.model.state_dict()[name])
