"""Presets: a round trip bit for bit, and every way in which a file can be wrong."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load_file, save_file

from engine.models.base import count_parameters
from engine.models.koopman_var import KoopmanVar
from engine.pluck import Pluck
from engine.presets import (
    PresetError,
    PresetInfo,
    described_parameters,
    find_preset,
    load_preset,
    outside_training,
    preset_files,
    read_info,
    save_preset,
)
from engine.presets.file import METADATA_KEY


def rewritten(
    path: Path,
    *,
    info: Callable[[dict[str, Any]], Any] = lambda data: None,
    tensors: Callable[[dict[str, torch.Tensor]], Any] = lambda data: None,
) -> Path:
    """The same file with its metadata or tensors changed in place by the given functions."""
    weights = load_file(path)
    with safe_open(path, framework="pt") as file:
        facts = json.loads(file.metadata()[METADATA_KEY])
    info(facts)
    tensors(weights)
    save_file(weights, path, metadata={METADATA_KEY: json.dumps(facts)})
    return path


def test_round_trip_bit_for_bit(preset_file: Path, model: KoopmanVar) -> None:
    preset = load_preset(preset_file)
    for name, tensor in model.state_dict().items():
        assert torch.equal(preset.model.state_dict()[name], tensor)
    assert preset.info == read_info(preset_file)
    assert preset.name == "small"
    assert described_parameters(preset_file, preset.info) == count_parameters(preset.model)
    again = preset_file.with_name("again.safetensors")
    save_preset(again, preset.info, preset.model)
    assert again.read_bytes() == preset_file.read_bytes()


@torch.no_grad()
def test_a_loaded_preset_computes_what_was_saved(preset_file: Path, model: KoopmanVar) -> None:
    initial = torch.randn(2, 101, generator=torch.Generator().manual_seed(0))
    assert torch.equal(load_preset(preset_file).model(initial, 30), model(initial, 30))


METADATA_FAULTS = {
    "newer format": (lambda d: d.update(format_version=99), "format_version 99 is newer .* update the program"),
    "no version": (lambda d: d.pop("format_version"), "format_version None is not known"),
    "unknown field": (lambda d: d.update(colour="red"), "unknown field 'colour'"),
    "missing field": (lambda d: d.pop("rate_hz"), "field 'rate_hz' is missing"),
    "wrong type": (lambda d: d.update(rate_hz="fast"), "rate_hz: must be a valid integer, found 'fast'"),
    "impossible rate": (lambda d: d.update(rate_hz=0), "rate_hz must be above 0"),
    "unknown model": (lambda d: d.update(model="oracle"), "model 'oracle' is not one of"),
    "unknown choice": (
        lambda d: d.update(initial="hammer"),
        "must be 'gaussian', 'noise' or 'pluck'",
    ),
    "bad string": (lambda d: d["string"].update(length_m=-1), "length_m must lie in"),
    "too many modes": (lambda d: d.update(modes=100), "cannot hold 100 modes"),
    "absurd model": (lambda d: d["model_configuration"].update(state_size=10**18), "state_size must lie in 1"),
    "other grid": (lambda d: d.update(grid_points=51), "grid_points is 51, the model's grid has 101"),
    "other size": (lambda d: d["model_configuration"].update(state_size=17), "has shape .* expected"),
    "unknown size": (lambda d: d["model_configuration"].update(depth=3), "unknown field 'depth'"),
}


@pytest.mark.parametrize("fault", METADATA_FAULTS)
def test_wrong_metadata_is_named(preset_file: Path, fault: str) -> None:
    change, message = METADATA_FAULTS[fault]
    with pytest.raises(PresetError, match=message) as caught:
        load_preset(rewritten(preset_file, info=change))
    assert str(preset_file) in str(caught.value)


TENSOR_FAULTS = {
    "missing": (lambda t: t.pop("nu_log"), "tensor 'nu_log' is missing"),
    "unknown": (lambda t: t.update(extra=torch.zeros(1)), "tensor 'extra' is unknown"),
    "re-shaped": (lambda t: t.update(nu_log=torch.zeros(15)), r"'nu_log' has shape \(15,\), expected \(16,\)"),
    "re-typed": (lambda t: t.update(nu_log=torch.zeros(16, dtype=torch.float64)), "of type F64, expected F32"),
    "NaN": (lambda t: t["encoder.weight"].view(-1)[5].fill_(float("nan")), "'encoder.weight' .* not finite"),
    "infinite": (lambda t: t["theta_log"][0].fill_(float("inf")), "'theta_log' .* not finite"),
}


@pytest.mark.parametrize("fault", TENSOR_FAULTS)
def test_wrong_tensors_are_named(preset_file: Path, fault: str) -> None:
    change, message = TENSOR_FAULTS[fault]
    with pytest.raises(PresetError, match=message):
        load_preset(rewritten(preset_file, tensors=change))


RESONATOR_FAULTS = {
    "another string": (lambda d: d["string"].update(tension_n=61.0), lambda t: None, "nu_log|theta_log"),
    "another rate": (lambda d: d.update(rate_hz=44_100), lambda t: None, "nu_log"),
    "another unit": (lambda d: d.update(scale_m=2e-3), lambda t: None, "stretch"),
    "no tension": (lambda d: d.update(tension_modulated=False), lambda t: None, "coupling"),
    "another frequency": (lambda d: None, lambda t: t["theta_log"][3].add_(1e-6), "theta_log"),
    "another coupling": (lambda d: None, lambda t: t["coupling"].mul_(1.0001), "coupling"),
    "another stretch": (lambda d: None, lambda t: t["stretch"][0].mul_(1.0001), "stretch"),
    "another shape": (lambda d: None, lambda t: t["shapes"][5].neg_(), "shapes"),
    "another analysis": (lambda d: None, lambda t: t["analysis"].mul_(2), "analysis"),
}


@pytest.mark.parametrize("fault", RESONATOR_FAULTS)
def test_a_string_that_is_heard_and_not_shown_is_refused(tmp_path: Path, fault: str) -> None:
    """A voice takes its string from the metadata, a picture from the tensors."""
    facts, tensors, name = RESONATOR_FAULTS[fault]
    copy = tmp_path / "copy.safetensors"
    copy.write_bytes(find_preset("studio_any_string").read_bytes())
    load_preset(copy)
    rewritten(copy, info=facts, tensors=tensors)
    words = rf"metadata\.string: tensor '({name})' is of another string, .*; get the preset again"
    with pytest.raises(PresetError, match=words) as caught:
        load_preset(copy)
    assert str(caught.value).startswith(f"{copy}: ")


@pytest.mark.parametrize("size", [0, 7, 200, 2000])
def test_a_truncated_file_is_reported(preset_file: Path, size: int) -> None:
    preset_file.write_bytes(preset_file.read_bytes()[:size])
    with pytest.raises(PresetError, match=r"not a whole safetensors file .* get the preset again"):
        load_preset(preset_file)


def test_other_files_are_reported(tmp_path: Path) -> None:
    with pytest.raises(PresetError, match="no such preset file"):
        load_preset(tmp_path / "nothing.safetensors")
    with pytest.raises(PresetError, match="not a file"):
        load_preset(tmp_path)
    foreign = tmp_path / "foreign.safetensors"
    save_file({"x": torch.zeros(3)}, foreign)
    with pytest.raises(PresetError, match="not a preset of this program"):
        load_preset(foreign)
    pickled = tmp_path / "pickled.safetensors"
    torch.save({"x": torch.zeros(3)}, pickled)
    with pytest.raises(PresetError, match="not a whole safetensors file"):
        load_preset(pickled)


def test_an_oversized_file_is_refused_before_it_is_read(tmp_path: Path) -> None:
    huge = tmp_path / "huge.safetensors"
    with huge.open("wb") as file:
        file.truncate(2**30)  # sparse: takes no room
    with pytest.raises(PresetError, match="1024 MiB is more than the 64 MiB"):
        load_preset(huge)


def test_a_model_that_is_not_finite_is_not_saved(tmp_path: Path, preset_file: Path, model: KoopmanVar) -> None:
    before = preset_file.read_bytes()
    with torch.no_grad():
        model.nu_log[0] = float("nan")
    with pytest.raises(PresetError, match="'nu_log' holds values that are not finite"):
        save_preset(preset_file, read_info(preset_file), model)
    assert preset_file.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == [preset_file.name]


def test_find_by_path_and_by_unknown_name(preset_file: Path) -> None:
    assert find_preset(str(preset_file)) == preset_file
    with pytest.raises(PresetError, match="no preset 'nonsense'; `learned-strings presets` lists all"):
        find_preset("nonsense")


def test_shipped_presets_load_and_are_better_than_the_paper() -> None:
    """Table 2a of the paper, Koopman_var, Gaussian, 4000 steps: relative MAE 0.0977 at 4 kHz, 0.0888 at 16 kHz."""
    bars = {4_000: 0.0977, 16_000: 0.0888}
    found = {}
    for path in preset_files():
        preset = load_preset(path)
        info = preset.info
        if (info.model, info.initial, info.horizon_steps, info.tension_modulated) == (
            "koopman_var",
            "gaussian",
            4000,
            True,
        ):
            assert count_parameters(preset.model) == 134_885
            found[info.rate_hz] = info.rel_mae
    for rate_hz, bar in bars.items():
        assert found[rate_hz] <= bar


def test_loading_presets_does_not_load_torchs_compiler() -> None:
    """It takes a second and more, and a start of the app would wait for it; an operation on a meta tensor may."""
    script = (
        "import sys; from engine.presets import load_preset, preset_files;"
        "[load_preset(path) for path in preset_files()]; print(len(preset_files()), 'torch._dynamo' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    count, loaded = done.stdout.split()
    assert int(count) > 0
    assert loaded == "False"


def test_plucks_outside_training_are_reported(preset_file: Path) -> None:
    info: PresetInfo = read_info(preset_file)
    assert outside_training(info, Pluck(0.5, 5.0, "gaussian", 0.05)) == []
    text = "; ".join(outside_training(info, Pluck(0.1, 15.0, "gaussian", 0.3)))
    for word in ("position 0.1 ", "width 0.3", "15"):
        assert word in text
    assert "not the trained gaussian" in "; ".join(outside_training(info, Pluck(0.5, 5.0, "triangular")))
    widths = {"gaussian": (0.02, 0.1), "raised_cosine": (0.1, 0.3)}
    any_shape = replace(info, initial="pluck", trained_range=replace(info.trained_range, width=widths))
    assert "width 0.09" in "; ".join(outside_training(any_shape, Pluck(0.5, 5.0, "raised_cosine", 0.09)))
    assert outside_training(any_shape, Pluck(0.5, 5.0, "gaussian", 0.09)) == []
    assert outside_training(any_shape, Pluck(0.5, 5.0, "triangular", 0.5)) == []
    assert "width 0.5" in "; ".join(outside_training(any_shape, Pluck(0.5, 5.0, "raised_cosine", 0.5)))
    free = replace(info, trained_range=replace(info.trained_range, position=None, width=None))
    assert not any("position" in line for line in outside_training(free, Pluck(0.1, 5.0, "gaussian", 0.05)))
    tense = replace(info, trained_range=replace(info.trained_range, tension_rise=0.01))
    assert outside_training(tense, Pluck(0.5, 1.0, "gaussian", 0.05)) == []
    assert "beyond the trained 1%" in "; ".join(outside_training(tense, Pluck(0.5, 5.0, "gaussian", 0.05)))


def any_string(name: str = "studio_any_string") -> PresetInfo:
    return read_info(find_preset(name))


@pytest.mark.parametrize("name", ["studio_any_string", "studio_any_harp_c6", "studio_any_nylon_e4"])
def test_a_model_of_many_strings_was_trained_in_rises_of_tension(name: str) -> None:
    """No peak: a loose string was pulled further than a tense one. Widths are those of each shape."""
    info = any_string(name)
    assert info.trained_range.peak_m is None
    assert info.trained_range.tension_rise == 0.5
    assert info.trained_range.width == {"gaussian": (0.04, 0.15), "raised_cosine": (0.08, 0.3)}
    pluck = Pluck(0.3, 4.0, "raised_cosine", 0.2)
    least_mm, largest_mm = info.trained_amplitudes_mm(pluck)
    assert least_mm == 0
    assert largest_mm == info.hardest_mm(pluck) == pytest.approx(4.0 * (0.5 / info.tension_rise(pluck)) ** 0.5)


@pytest.mark.parametrize(
    ("pluck", "words"),
    [
        (Pluck(0.12, 20.0, "triangular"), ""),  # 20 mm raise the tension of a nylon B3 by a fifth
        (Pluck(0.3, 0.01, "gaussian", 0.06), ""),
        (Pluck(0.3, 4.0, "gaussian", 0.19), ""),
        (Pluck(0.3, 4.0, "raised_cosine", 0.5), ""),
        (Pluck(0.3, 4.0, "gaussian", 0.25), "width 0.25 is outside the trained 0.04 … 0.15"),
        (Pluck(0.3, 4.0, "gaussian", 0.03), "width 0.03 is outside the trained 0.04 … 0.15"),
        (Pluck(0.3, 4.0, "raised_cosine", 0.06), "width 0.06 is outside the trained 0.08 … 0.3"),
        (Pluck(0.03, 4.0, "gaussian", 0.06), "position 0.03 is outside"),
        (Pluck(0.3, 20.0, "gaussian", 0.04), "beyond the trained 50%"),
    ],
)
def test_plucks_of_any_string_are_warned_of_where_the_error_grows(pluck: Pluck, words: str) -> None:
    found = outside_training(any_string(), pluck)
    assert len(found) == bool(words)
    assert words in "".join(found)


@pytest.mark.parametrize(("name", "words"), [("bass_e1", ""), ("harp_c6", ""), ("piano_c2", "decay time near 3 kHz")])
def test_strings_are_warned_of_where_the_error_grows(name: str, words: str) -> None:
    """Not of a pitch below or above the trained ones."""
    found = outside_training(any_string(f"studio_any_{name}"), Pluck(0.3, 1.0, "triangular"))
    assert len(found) == bool(words)
    assert words in "".join(found)


RANGE_FAULTS = {
    "nothing": (lambda d: d.update(peak_m=None), "peak_m or tension_rise must be given"),
    "a shape": (lambda d: d.update(width={"square": [0.1, 0.2]}), "width is of 'square', not of one of gaussian"),
    "an order": (lambda d: d.update(width={"gaussian": [0.2, 0.1]}), r"width.gaussian must be a range from 0 on"),
    "a table": (lambda d: d.update(width=[0.1, 0.2]), "width: must be a table"),
}


@pytest.mark.parametrize("fault", RANGE_FAULTS)
def test_a_wrong_trained_range_is_named(preset_file: Path, fault: str) -> None:
    change, message = RANGE_FAULTS[fault]
    with pytest.raises(PresetError, match=rf"metadata\.trained_range.*{message}"):
        load_preset(rewritten(preset_file, info=lambda data: change(data["trained_range"])))
