"""Presets of every version load; those that were shipped sound as they did then, and fall silent."""

from __future__ import annotations

import copy
import json
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from engine.pluck import Pluck
from engine.presets import load_preset, preset_digest, preset_files
from engine.presets.migrations import FORMAT_VERSION, UnknownVersion, migrated
from engine.sources import ModelSource, Runaway
from tests.engine.presets.test_file import Fault
from tests.engine.sounds import initial_m, shipped

SHIPPED = json.loads(Path(__file__).with_name("shipped.json").read_text(encoding="utf-8"))
FRAMES = 64  # from the pluck on: enough to tell any other weights or any other reading of them
EVERY = 8
APART = 0.02  # in units of 10 µm
FRNN_APART = 0.5  # what it computes in single precision differs by up to 0.2 between an AMD and an Intel processor
OFFSET_M = 1e-6  # a decoder's bias may leave so much, 80 dB below full scale; it does not sound
OFFSETS_M = {"nylon_nonlinear_noise_4k_koopman_400_published_epochs500": 1e-4}  # of random weights; constant
MOVES_M = 1e-9  # 140 dB below


@pytest.mark.parametrize("path", preset_files(), ids=lambda path: path.stem)
def test_a_shipped_preset_sounds_as_it_did_when_it_was_shipped_and_falls_silent(path: Path) -> None:
    """Where one is added or trained again: add what the message shows to shipped.json."""
    digest, preset = preset_digest(path), shipped(path.stem)
    source, info = ModelSource(preset), preset.info
    points, rate_hz = info.grid_points, info.rate_hz
    pluck = Pluck(shape="gaussian", position=0.4, amplitude_mm=4.0, width=0.05)
    state = source.start(initial_m(info, pluck)[None])
    frames, _ = source.advance(state, FRAMES)
    beginning = [round(float(value) * 1e5, 3) for value in frames[0, ::EVERY, points // 2]]
    assert digest in SHIPPED, f"not in shipped.json: {json.dumps(digest)}: {beginning}"
    apart = FRNN_APART if info.model == "frnn" else APART
    np.testing.assert_allclose(beginning, SHIPPED[digest], rtol=0, atol=apart)
    late = 3600 * rate_hz  # long after the last of its latents is too small to count
    place = next((name for name in ("time", "step") if hasattr(state.inner, name)), None)
    if place is None:  # a recurrence cannot jump: finite, or reported
        with suppress(Runaway):
            assert np.isfinite(source.advance(state, 300)[0]).all()
        return
    state = replace(state, inner=replace(state.inner, **{place: late}), frame=late)
    for readout in (None, np.eye(points)[:, ::50]):  # the string, and some points of it, by another way
        frames, _ = source.advance(state, 600, readout)
        assert float(np.abs(frames).max()) < OFFSETS_M.get(path.stem, OFFSET_M)
        assert float(np.abs(np.diff(frames, axis=1)).max()) < MOVES_M


MIRRORED = "that a string may be mirrored and its sign turned"
AVERAGED = "the modes of the string at rest, and how tension couples them"


def started(model: str, how: str, knows: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Of version 1: what its start knew of the resonator."""
    old = {"format_version": 1, "model": model, "initialisation": how, "title": "as it was"}
    return old, {**old, "knows": knows}


def ranged(initial: str, half_width: Any, width: Any, widths: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """Of version 4: widths by shape, and no peak of a family."""
    family = half_width and {"half_width": half_width}
    plucks = {"position": None, "width": width, "peak_m": [1e-3, 1e-2], "tension_rise": 0.5}
    old = {"format_version": 4, "initial": initial, "family": family, "trained_range": plucks}
    return old, {**old, "trained_range": {**plucks, "width": widths, "peak_m": None if family else plucks["peak_m"]}}


@pytest.mark.parametrize(
    ("old", "new"),
    [
        started("koopman_integrated", "averaging", AVERAGED),
        started("koopman_integrated", "phases of the displacement", f"{MIRRORED}, and how many modes it has"),
        started("fgru", "phases of the displacement", MIRRORED),
        started("koopman", "blind matching pursuit", MIRRORED),
        started("koopman", "paper", ""),
        (
            {"format_version": 3, "model_configuration": {"state_size": 3, "input": "displacement"}},
            {"model_configuration": {"state_size": 3}},
        ),
        ranged("gaussian", None, [0.02, 0.1], {"gaussian": [0.02, 0.1]}),
        ranged("noise", None, None, None),
        ranged("pluck", None, [0.03, 0.3], {"gaussian": [0.03, 0.3], "raised_cosine": [0.03, 0.3]}),
        ranged("pluck", [0.04, 0.15], [0.04, 0.3], {"gaussian": [0.04, 0.15], "raised_cosine": [0.08, 0.3]}),
    ],
)
def test_an_older_version_becomes_the_present_one_without_change_of_its_own(
    old: dict[str, Any], new: dict[str, Any]
) -> None:
    kept = copy.deepcopy(old)
    assert migrated(old) == {**new, "format_version": FORMAT_VERSION}
    assert old == kept


@pytest.mark.parametrize("wrong", [None, 5, "wide", [1], {"half_width": "wide"}, {"half_width": [1]}, {}])
def test_what_is_no_range_is_left_to_the_reader(wrong: Any) -> None:
    for data in ({"trained_range": wrong}, {"trained_range": {}, "family": wrong}):
        assert migrated({"format_version": 4, **data})["format_version"] == FORMAT_VERSION


@pytest.mark.parametrize("version", [None, 0, -1, "1", True, 1.0, FORMAT_VERSION + 1])
def test_other_versions_are_refused(version: Any) -> None:
    remedy = "update the program" if version == FORMAT_VERSION + 1 else "get the preset again"
    with pytest.raises(UnknownVersion, match=remedy):
        migrated({"format_version": version})
    with pytest.raises(UnknownVersion, match="input 'two_frames' is no longer read; train the model again"):
        migrated({"format_version": 3, "model_configuration": {"input": "two_frames"}})


def test_a_preset_of_version_1_loads_with_the_same_weights(small_preset: Path, preset_file: Path) -> None:
    def age(facts: dict[str, Any]) -> None:
        del facts["knows"]
        facts["model_configuration"]["input"] = "displacement"
        facts["trained_range"]["width"] = facts["trained_range"]["width"]["gaussian"]
        facts["format_version"] = 1

    Fault("", age).write(preset_file)
    old, new = load_preset(preset_file), load_preset(small_preset)
    assert old.info == replace(new.info, knows=old.info.knows) and old.info.format_version == FORMAT_VERSION
    for name, weight in new.model.state_dict().items():
        assert torch.equal(weight, old.model.state_dict()[name])
