"""Presets of every version load, sound as they were shipped, and fall silent; one of many strings plays each."""

import copy
import json
import math
import re
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from engine.pluck import Pluck
from engine.presets import preset_digest, preset_files
from engine.presets.migrations import FORMAT_VERSION, UnknownVersion, migrated
from engine.presets.of_string import STRINGS, find_string, of_string, read_described_string, read_string
from engine.schema import SchemaError
from engine.sources import ModelSource, Runaway, TruthSource
from engine.values.string import StringParameters
from tests.engine.sounds import initial_m, relative, shipped

SHIPPED = json.loads(Path(__file__).with_name("shipped.json").read_text(encoding="utf-8"))
FRAMES = 64  # from the pluck on: enough to tell any other weights or any other reading of them
EVERY = 8
APART = 0.02  # in units of 10 µm
FRNN_APART = 0.5  # what it computes in single precision differs by up to 0.2 between an AMD and an Intel processor
OFFSET_M = 1e-6  # a decoder's bias may leave so much, 80 dB below full scale; it does not sound
OFFSETS_M = {"nylon_nonlinear_noise_4k_koopman_400_published_epochs500": 1e-4}  # of random weights; constant
MOVES_M = 1e-9  # 140 dB below


@pytest.mark.parametrize("path", preset_files(), ids=lambda path: path.stem)
def test_a_shipped_preset_sounds_as_it_did_when_it_was_shipped_and_falls_silent(path):
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
def test_an_older_version_becomes_the_present_one_without_change_of_its_own(old, new):
    kept = copy.deepcopy(old)
    assert migrated(old) == {**new, "format_version": FORMAT_VERSION}
    assert old == kept


@pytest.mark.parametrize("wrong", [None, 5, "wide", [1], {"half_width": "wide"}, {"half_width": [1]}, {}])
def test_what_is_no_range_is_left_to_the_reader(wrong):
    for data in ({"trained_range": wrong}, {"trained_range": {}, "family": wrong}):
        assert migrated({"format_version": 4, **data})["format_version"] == FORMAT_VERSION


@pytest.mark.parametrize("version", [None, 0, -1, "1", True, 1.0, FORMAT_VERSION + 1])
def test_other_versions_are_refused(version):
    remedy = "update the program" if version == FORMAT_VERSION + 1 else "get the preset again"
    with pytest.raises(UnknownVersion, match=remedy):
        migrated({"format_version": version})
    with pytest.raises(UnknownVersion, match="input 'two_frames' is no longer read; train the model again"):
        migrated({"format_version": 3, "model_configuration": {"input": "two_frames"}})


STEEL = StringParameters(0.648, 5.0671e-08, 2.0432e-16, 7850.0, 2.2e11, 8e-06, 1.4e-06, 72.2016)
TOML = "".join(f"{name} = {value}\n" for name, value in asdict(STEEL).items())


def test_a_steel_string_is_played_by_the_same_preset():
    many = shipped("studio_any_string")
    preset = of_string(many, STEEL, 44_100)
    assert preset.info.rate_hz == 44_100
    assert preset.info.modes == STEEL.modes_below(20_000)
    assert math.isclose(preset.info.horizon_s, 0.5, rel_tol=1e-3)
    initial, found = initial_m(preset.info, Pluck(0.3, 2.0))[None], []
    for source in (ModelSource(preset), TruthSource(preset.info)):
        found.append(source.advance(source.start(initial), 4410)[0])
    assert relative(*found) ** 2 < 1e-9
    assert of_string(many) is many
    assert of_string(many, modes=7).info.modes == 7
    assert of_string(many, rate_hz=4_000).info.modes == many.info.string.modes_below(2_000)


def test_a_string_file_is_read_and_may_describe_its_string(tmp_path):
    file = tmp_path / "steel.toml"
    for described, words in (("", ""), ('description = """\nOf 7850\n kg/m³."""\n', "Of 7850 kg/m³.")):
        file.write_text(described + TOML, encoding="utf-8")
        assert read_described_string(file) == (STEEL, words)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("length_m = ", "not valid TOML"),
        ("length = 1.0", "unknown field 'length'"),
        ("description = 5", "description must be a text"),
        # none of the parameters is taken from the string of the paper
        (TOML.replace("tension_n", "# "), r"wrong\.toml: tension_n is missing"),
        ("", r"length_m, area_m2, .*, tension_n are missing; .*gives all of length_m, area_m2,"),
    ],
)
def test_a_wrong_string_file_is_named(tmp_path, text, words):
    file = tmp_path / "wrong.toml"
    file.write_text(text)
    with pytest.raises(SchemaError, match=words) as caught:
        read_string(file)
    assert str(file) in str(caught.value)


RINGS_S = {"piano_c2": 8.0, "piano_f3": 5.32, "piano_c4": 3.61, "piano_cs5": 1.86}
# where high modes ring too long, as warned of; pitch alone makes no error grow
BEYOND = {"bass_e1": "", "harp_c6": "", **{key: f"decay time near 3 kHz {s}" for key, s in RINGS_S.items()}}
NAMES = sorted(path.stem for path in STRINGS.glob("*.toml"))


@pytest.mark.parametrize("name", NAMES)
def test_every_shipped_string_is_a_preset_with_what_was_learned_at_its_pitch(name):
    """Inside the family, except those whose files say what is beyond."""
    many = shipped("studio_any_string")
    string = read_string(find_string(name))
    warnings = many.info.family.warnings(string)
    assert len(warnings) == bool(BEYOND.get(name))
    assert all(words.startswith(BEYOND[name]) for words in warnings)
    _, description = read_described_string(find_string(name))
    assert ("Beyond the family: " in description) == (name in BEYOND)
    own, expected = shipped(f"studio_any_{name}"), of_string(many, string)
    assert own.info.string == string
    assert own.info.description == f"{description} Played by the model of every string."
    for key, tensor in expected.model.state_dict().items():
        # logarithms differ in their last digit between makes of processor; so do places on the grid between NumPy
        # and the PyTorch that wrote these files, and the sine of mode 99 has 300 times that
        torch.testing.assert_close(own.model.state_dict()[key], tensor, rtol=1e-12, atol=1e-13)
    # its quiet first mode sounds the note of its name; those of two sources keep the tensions given there
    step, sharp, octave = re.fullmatch(r"[a-z]+_([a-g])(s?)([1-6])", name).groups()
    key = 12 * (int(octave) + 1) + {"c": 0, "d": 2, "e": 4, "f": 5, "g": 7, "a": 9, "b": 11}[step] + len(sharp)
    pitch_hz = math.sqrt(string.undamped_frequency(1) ** 2 - string.decay_rate(1) ** 2) / (2 * math.pi)
    cents = 1200 * math.log2(pitch_hz / 440) - 100 * (key - 69)
    assert abs(cents) < (11 if name.startswith("nylon") or name == "steel_ds3" else 0.2)
