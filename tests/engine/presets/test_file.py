"""Presets: a round trip bit for bit, every way in which a file can be wrong, and what lies outside training."""

from __future__ import annotations

import json
import shutil
import struct
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest
import torch
from safetensors.torch import load, save, save_file

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


@dataclass(frozen=True)
class Fault:
    """A change of a preset's file, and the words with which it is refused.

    Attributes:
        facts: changes its metadata; `text` and `raw` change them and the whole file as they are written.
        many: of the preset of many strings, whose tensors hold its string.
    """

    words: str
    facts: Callable[[dict[str, Any]], Any] = lambda facts: None
    text: Callable[[str], str] = str
    tensors: Callable[[dict[str, torch.Tensor]], Any] | None = None
    raw: Callable[[bytes], bytes] | None = None
    many: bool = False

    @property
    def described(self) -> bool:
        """Return True if the description alone shows it."""
        return self.tensors is None and self.raw is None

    def write(self, path: Path) -> None:
        data = path.read_bytes()
        (length,) = struct.unpack_from("<Q", data)
        facts = json.loads(json.loads(data[8 : 8 + length])["__metadata__"][METADATA_KEY])
        tensors = load(data)
        self.facts(facts)
        if self.tensors is not None:
            self.tensors(tensors)
        written = save(tensors, {METADATA_KEY: self.text(json.dumps(facts))})
        path.write_bytes(self.raw(written) if self.raw is not None else written)


def sets(**values: Any) -> Callable[[dict[str, Any]], None]:
    """Fields of the metadata; those of the string, the model's sizes or the trained range by their own name."""

    def change(facts: dict[str, Any]) -> None:
        for name, value in values.items():
            parts = ("string", "model_configuration", "trained_range")
            inside = [facts[part] for part in parts if name in facts[part]]
            (inside[0] if inside else facts)[name] = value

    return change


def sizes(model: str, **values: int) -> Callable[[dict[str, Any]], None]:
    return lambda facts: facts.update(model=model, model_configuration=values)


OTHER_STRING = r"metadata\.string: tensor '(%s)' is of another string, .*; get the preset again"
FAULTS = {
    "newer format": Fault("format_version 99 is newer .* update the program", sets(format_version=99)),
    "no version": Fault("format_version None is not known", lambda facts: facts.pop("format_version")),
    "unknown field": Fault("unknown field 'colour'", sets(colour="red")),
    "missing field": Fault("field 'rate_hz' is missing", lambda facts: facts.pop("rate_hz")),
    "wrong type": Fault("rate_hz: must be a valid integer, found 'fast'", sets(rate_hz="fast")),
    "impossible rate": Fault("rate_hz must be above 0", sets(rate_hz=0)),
    "unknown model": Fault("model 'oracle' is not one of", sets(model="oracle")),
    "unknown choice": Fault("must be 'gaussian', 'noise' or 'pluck'", sets(initial="hammer")),
    "bad string": Fault("length_m must lie in", sets(length_m=-1)),
    "too many modes": Fault("cannot hold 100 modes", sets(modes=100)),
    "other grid": Fault("grid_points is 51, the model's grid has 101", lambda facts: facts.update(grid_points=51)),
    "other size": Fault("has shape .* expected", sets(state_size=17), tensors=dict),
    "unknown size": Fault("unknown field 'depth'", lambda facts: facts["model_configuration"].update(depth=3)),
    "no bounds": Fault(r"metadata\.trained_range.*peak_m or tension_rise must be given", sets(peak_m=None)),
    "a shape": Fault("width is of 'square', not of one of gaussian", sets(width={"square": [0.1, 0.2]})),
    "an order": Fault("width.gaussian must be a range from 0 on", sets(width={"gaussian": [0.2, 0.1]})),
    "no table": Fault("width: must be a table", sets(width=[0.1, 0.2])),
    # small files that would hang or eat memory: refused by what they ask for, before anything is built
    "nested a thousand deep": Fault(
        "nested|recursion", text=lambda text: text[:-1] + ', "training": ' + "[" * 1000 + "]" * 1000 + "}"
    ),
    "nested a hundred thousand deep": Fault("recursion", text=lambda text: "[" * 100_000 + "]" * 100_000),
    "5000 digits": Fault("digits", text=lambda text: text[:-1] + ', "seed": ' + "7" * 5000 + "}"),
    "no object": Fault("no JSON object", text=lambda text: "[1, 2]"),
    "an error of 10**400": Fault("rel_mae: must be a number of at most 64 bits", sets(rel_mae=10**400)),
    "2**63 states": Fault("state_size: must be a number of at most 64 bits", sets(state_size=2**63)),
    "10**9 states": Fault("state_size must lie in", sets(state_size=10**9)),
    "300,000 widths": Fault("50000 entries", sets(multiplier_widths=[8] * 300_000)),
    "wide layers": Fault("multiplier_widths must lie in", sets(multiplier_widths=[10**9])),
    "a billion layers of frnn": Fault("depth must lie in", sizes("frnn", depth=10**9)),
    "a billion layers of lru": Fault("layers must lie in", sizes("lru", layers=10**9)),
    "a billion lags": Fault("lags must lie in", sizes("dmd", lags=10**9)),
    "a string of 1000 km": Fault("length_m must lie in 0.01 … 100", sets(length_m=1e6)),
    "a stiffness beyond any": Fault("second_moment_m4 must lie in", sets(second_moment_m4=1e10)),
    "too high a mode": Fault("too high for a rate_hz|sub-steps", sets(second_moment_m4=1e-6, youngs_modulus_pa=1e13)),
    "10,001 points at 1 MHz": Fault(
        "grid_points times rate_hz", lambda facts: facts.update(grid_points=10_001, rate_hz=1_000_000)
    ),
    "an overdamped mode": Fault("mode 1 is overdamped", sets(damping_d3_kg_m_s=10.0)),
    "no unit": Fault("scale_m must lie in", sets(scale_m=1e-300)),
    "a title of 100 kB": Fault("title: has 100000 characters", sets(title="x" * 100_000)),
    "a field of 100 kB": Fault("unknown field", sets(**{"y" * 100_000: 1})),
    "an escape in a field": Fault("unknown field", sets(**{"\x1b]0;owned\x07\nfield": 1})),
    "metadata of 2 MB": Fault("header|longer", text=lambda text: text[:-1] + " " * 2_000_000 + "}"),
    # weights
    "missing": Fault("tensor 'nu_log' is missing", tensors=lambda t: t.pop("nu_log")),
    "unknown": Fault("tensor 'extra' is unknown", tensors=lambda t: t.update(extra=torch.zeros(1))),
    "re-shaped": Fault(
        r"'nu_log' has shape \(15,\), expected \(16,\)", tensors=lambda t: t.update(nu_log=torch.zeros(15))
    ),
    "re-typed": Fault(
        "of type F64, expected F32", tensors=lambda t: t.update(nu_log=torch.zeros(16, dtype=torch.float64))
    ),
    "NaN": Fault(
        "'encoder.weight' .* not finite", tensors=lambda t: t["encoder.weight"].view(-1)[5].fill_(float("nan"))
    ),
    "infinite": Fault("'theta_log' .* not finite", tensors=lambda t: t["theta_log"][0].fill_(float("inf"))),
    **{
        f"cut to {size} bytes": Fault(
            "not a whole safetensors file .* get the preset again", raw=lambda data, size=size: data[:size]
        )
        for size in (0, 7, 200, 2000)
    },
    # a voice takes its string from the metadata, a picture from the tensors
    **{
        name: Fault(OTHER_STRING % tensor, facts=facts, tensors=tensors, many=True)
        for name, tensor, facts, tensors in (
            ("another string", "nu_log|theta_log", sets(tension_n=61.0), lambda t: None),
            ("another rate", "nu_log", sets(rate_hz=44_100), lambda t: None),
            ("another unit", "stretch", sets(scale_m=2e-3), lambda t: None),
            ("no tension", "coupling", sets(tension_modulated=False), lambda t: None),
            ("another frequency", "theta_log", sets(), lambda t: t["theta_log"][3].add_(1e-6)),
            ("another coupling", "coupling", sets(), lambda t: t["coupling"].mul_(1.0001)),
            ("another stretch", "stretch", sets(), lambda t: t["stretch"][0].mul_(1.0001)),
            ("another shape", "shapes", sets(), lambda t: t["shapes"][5].neg_()),
            ("another analysis", "analysis", sets(), lambda t: t["analysis"].mul_(2)),
        )
    },
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_wrong_or_hostile_file_is_refused_in_one_line_that_names_it(preset_file: Path, name: str) -> None:
    fault = FAULTS[name]
    if fault.many:
        shutil.copy(find_preset("studio_any_string"), preset_file)
    fault.write(preset_file)
    for reader in (read_info, load_preset) if fault.described else (load_preset,):
        with pytest.raises(PresetError, match=fault.words) as caught:
            reader(preset_file)
        reported = str(caught.value)
        assert str(preset_file) in reported and len(reported) <= 500 and reported.isprintable()


def test_round_trip_bit_for_bit(preset_file: Path, model: KoopmanVar) -> None:
    preset = load_preset(preset_file)
    assert all(torch.equal(preset.model.state_dict()[name], tensor) for name, tensor in model.state_dict().items())
    assert preset.info == read_info(preset_file)
    assert preset.name == "small"
    assert described_parameters(preset_file, preset.info) == count_parameters(preset.model)
    again = preset_file.with_name("again.safetensors")
    save_preset(again, preset.info, preset.model)
    assert again.read_bytes() == preset_file.read_bytes()


def test_other_files_are_refused(tmp_path: Path) -> None:
    save_file({"x": torch.zeros(3)}, tmp_path / "foreign")
    torch.save({"x": torch.zeros(3)}, tmp_path / "pickled")
    with (tmp_path / "huge").open("wb") as file:
        file.truncate(2**30)  # sparse: takes no room
    for name, words in (
        ("nothing", "no such preset file"),
        ("", "not a file"),
        ("foreign", "not a preset of this program"),
        ("pickled", "not a whole safetensors file"),
        ("huge", "1024 MiB is more than the 64 MiB"),
    ):
        with pytest.raises(PresetError, match=words):
            load_preset(tmp_path / name)


def test_a_model_that_is_not_finite_is_not_saved(tmp_path: Path, preset_file: Path, model: KoopmanVar) -> None:
    before = preset_file.read_bytes()
    with torch.no_grad():
        model.nu_log[0] = float("nan")
    with pytest.raises(PresetError, match="'nu_log' holds values that are not finite"):
        save_preset(preset_file, read_info(preset_file), model)
    assert preset_file.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == [preset_file.name]


def test_a_preset_is_found_by_its_path_and_an_unknown_name_is_an_error(preset_file: Path) -> None:
    assert find_preset(str(preset_file)) == preset_file
    with pytest.raises(PresetError, match="no preset 'nonsense'; `learned-strings presets` lists all"):
        find_preset("nonsense")


def test_shipped_presets_are_better_than_the_paper() -> None:
    """Table 2a of the paper, Koopman_var, Gaussian, 4000 steps: relative MAE 0.0977 at 4 kHz, 0.0888 at 16 kHz."""
    found = {}
    for info in map(read_info, preset_files()):
        if (info.model, info.initial, info.horizon_steps) == ("koopman_var", "gaussian", 4000) and (
            info.tension_modulated
        ):
            found[info.rate_hz] = info.rel_mae
    assert found[4_000] <= 0.0977 and found[16_000] <= 0.0888


def test_loading_presets_does_not_load_torchs_compiler() -> None:
    """It takes a second and more, and a start of the app would wait for it; an operation on a meta tensor may."""
    script = (
        "import sys; from engine.presets import load_preset, preset_files, read_info\n"
        "paths = {read_info(path).model: path for path in preset_files()}\n"
        "[load_preset(path) for path in paths.values()]; print(len(paths) > 4, 'torch._dynamo' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True", "False"]


SMALL: dict[str, Any] = {}
FREE = {"position": None, "width": None}
ANY_SHAPE = {"width": {"gaussian": (0.02, 0.1), "raised_cosine": (0.1, 0.3)}}


@pytest.mark.parametrize(
    ("initial", "changed", "pluck", "words"),
    [
        ("gaussian", SMALL, Pluck(0.5, 5.0, "gaussian", 0.05), ()),
        ("gaussian", SMALL, Pluck(0.1, 15.0, "gaussian", 0.3), ("position 0.1 ", "width 0.3", "15")),
        ("gaussian", SMALL, Pluck(0.5, 5.0, "triangular"), ("not the trained gaussian",)),
        ("pluck", ANY_SHAPE, Pluck(0.5, 5.0, "raised_cosine", 0.09), ("width 0.09",)),
        ("pluck", ANY_SHAPE, Pluck(0.5, 5.0, "gaussian", 0.09), ()),
        ("pluck", ANY_SHAPE, Pluck(0.5, 5.0, "triangular", 0.5), ()),
        ("pluck", ANY_SHAPE, Pluck(0.5, 5.0, "raised_cosine", 0.5), ("width 0.5",)),
        ("gaussian", FREE, Pluck(0.1, 5.0, "gaussian", 0.05), ()),
        ("gaussian", {"tension_rise": 0.01}, Pluck(0.5, 1.0, "gaussian", 0.05), ()),
        ("gaussian", {"tension_rise": 0.01}, Pluck(0.5, 5.0, "gaussian", 0.05), ("beyond the trained 1%",)),
    ],
)
def test_plucks_outside_training_are_reported(
    small_preset: Path, initial: Any, changed: dict[str, Any], pluck: Pluck, words: tuple[str, ...]
) -> None:
    info = read_info(small_preset)
    info = replace(info, initial=initial, trained_range=replace(info.trained_range, **changed))
    found = outside_training(info, pluck)
    assert len(found) == len(words)
    assert all(word in "; ".join(found) for word in words)


def any_string(name: str) -> PresetInfo:
    return read_info(find_preset(name))


@pytest.mark.parametrize("name", ["studio_any_string", "studio_any_harp_c6", "studio_any_nylon_e4"])
def test_a_model_of_many_strings_was_trained_in_rises_of_tension(name: str) -> None:
    """No peak: a loose string was pulled further than a tense one. Widths are those of each shape."""
    info, pluck = any_string(name), Pluck(0.3, 4.0, "raised_cosine", 0.2)
    assert (info.trained_range.peak_m, info.trained_range.tension_rise) == (None, 0.5)
    assert info.trained_range.width == {"gaussian": (0.04, 0.15), "raised_cosine": (0.08, 0.3)}
    hardest_mm = pytest.approx(4.0 * (0.5 / info.tension_rise(pluck)) ** 0.5)
    assert info.trained_amplitudes_mm(pluck) == (0, hardest_mm)
    assert info.hardest_mm(pluck) == hardest_mm


@pytest.mark.parametrize(
    ("name", "pluck", "words"),
    [
        ("string", Pluck(0.12, 20.0, "triangular"), ""),  # 20 mm raise the tension of a nylon B3 by a fifth
        ("string", Pluck(0.3, 0.01, "gaussian", 0.06), ""),
        ("string", Pluck(0.3, 4.0, "gaussian", 0.19), ""),
        ("string", Pluck(0.3, 4.0, "raised_cosine", 0.5), ""),
        ("string", Pluck(0.3, 4.0, "gaussian", 0.25), "width 0.25 is outside the trained 0.04 … 0.15"),
        ("string", Pluck(0.3, 4.0, "gaussian", 0.03), "width 0.03 is outside the trained 0.04 … 0.15"),
        ("string", Pluck(0.3, 4.0, "raised_cosine", 0.06), "width 0.06 is outside the trained 0.08 … 0.3"),
        ("string", Pluck(0.03, 4.0, "gaussian", 0.06), "position 0.03 is outside"),
        ("string", Pluck(0.3, 20.0, "gaussian", 0.04), "beyond the trained 50%"),
        # not of a pitch below or above the trained ones
        ("bass_e1", Pluck(0.3, 1.0, "triangular"), ""),
        ("harp_c6", Pluck(0.3, 1.0, "triangular"), ""),
        ("piano_c2", Pluck(0.3, 1.0, "triangular"), "decay time near 3 kHz"),
    ],
)
def test_plucks_and_strings_are_warned_of_where_the_error_grows(name: str, pluck: Pluck, words: str) -> None:
    found = outside_training(any_string(f"studio_any_{name}"), pluck)
    assert len(found) == bool(words)
    assert words in "".join(found)
