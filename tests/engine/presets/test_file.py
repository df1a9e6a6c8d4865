"""Presets: a round trip bit for bit, every way in which a file can be wrong, and what lies outside training."""

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from operator import itemgetter
from pathlib import Path
from typing import Any

import pytest
import torch
from safetensors import safe_open
from safetensors.torch import load, save, save_file

from engine.models.base import count_parameters
from engine.pluck import Pluck
from engine.presets import (
    PresetError,
    find_preset,
    load_preset,
    outside_training,
    read_info,
    save_preset,
)
from engine.presets.file import METADATA_KEY, described_parameters


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

    def write(self, path: Path) -> None:
        with safe_open(path, "pt") as file:
            facts = json.loads(file.metadata()[METADATA_KEY])
        tensors = load(path.read_bytes())
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


OTHER_STRING = r"metadata\.string: tensor '(%s)' is of another string, .*; get the preset again"
FAULTS = {
    "newer format": Fault("format_version 99 is newer .* update the program", sets(format_version=99)),
    "no version": Fault("format_version None is not known", lambda facts: facts.pop("format_version")),
    "impossible rate": Fault("rate_hz must be above 0", sets(rate_hz=0)),
    "unknown model": Fault("model 'oracle' is not one of", sets(model="oracle")),
    "too many modes": Fault("cannot hold 100 modes", sets(modes=100)),
    "other grid": Fault("grid_points is 51, the model's grid has 101", lambda facts: facts.update(grid_points=51)),
    "other size": Fault("has shape .* expected", sets(state_size=17), tensors=dict),
    "an order": Fault("width.gaussian must be a range from 0 on", sets(width={"gaussian": [0.2, 0.1]})),
    "no bounds": Fault(r"metadata\.trained_range.*peak_m or tension_rise must be given", sets(peak_m=None)),
    "a shape": Fault("width is of 'square', not of one of gaussian", sets(width={"square": [0.1, 0.2]})),
    # small files that would hang or eat memory: refused by what they ask for, before anything is built
    "nested a thousand deep": Fault(
        "nested|recursion", text=lambda text: text[:-1] + ', "training": ' + "[" * 1000 + "]" * 1000 + "}"
    ),
    "nested a hundred thousand deep": Fault("recursion", text=lambda text: "[" * 100_000 + "]" * 100_000),
    "5000 digits": Fault("digits", text=lambda text: text[:-1] + ', "seed": ' + "7" * 5000 + "}"),
    "no object": Fault("no JSON object", text=lambda text: "[1, 2]"),
    "2**63 states": Fault("state_size: must be a number of at most 64 bits", sets(state_size=2**63)),
    "10**9 states": Fault("state_size must lie in", sets(state_size=10**9)),
    "300,000 widths": Fault("50000 entries", sets(multiplier_widths=[8] * 300_000)),
    "a billion layers of frnn": Fault("depth must lie in", sets(model="frnn", model_configuration={"depth": 10**9})),
    "too high a mode": Fault("too high for a rate_hz|sub-steps", sets(second_moment_m4=1e-6, youngs_modulus_pa=1e13)),
    "10,001 points at 1 MHz": Fault(
        "grid_points times rate_hz", lambda facts: facts.update(grid_points=10_001, rate_hz=1_000_000)
    ),
    "an overdamped mode": Fault("mode 1 is overdamped", sets(damping_d3_kg_m_s=10.0)),
    "no unit": Fault("scale_m must lie in", sets(scale_m=1e-300)),
    "a field of 100 kB": Fault("unknown field", sets(**{"y" * 100_000: 1})),
    "an escape in a field": Fault("unknown field", sets(**{"\x1b]0;owned\x07\nfield": 1})),
    "metadata of 2 MB": Fault("header|longer", text=lambda text: text[:-1] + " " * 2_000_000 + "}"),
    # weights
    "missing": Fault("tensor 'nu_log' is missing", tensors=lambda t: t.pop("nu_log")),
    "unknown": Fault("tensor 'extra' is unknown", tensors=lambda t: t.update(extra=torch.zeros(1))),
    "re-shaped": Fault(
        r"'nu_log' has shape \(15,\), expected \(16,", tensors=lambda t: t.update(nu_log=torch.zeros(15))
    ),
    "re-typed": Fault("of type F64, expected F32", tensors=lambda t: t.update(nu_log=t["nu_log"].double())),
    "NaN": Fault("'encoder.weight' .* not finite", tensors=lambda t: t["encoder.weight"][0, 5].fill_(float("nan"))),
    "infinite": Fault("'theta_log' .* not finite", tensors=lambda t: t["theta_log"][0].fill_(float("inf"))),
    "cut": Fault("not a whole safetensors .* get the preset again", raw=itemgetter(slice(2000))),
    # a voice takes its string from the metadata, a picture from the tensors
    "another string": Fault(OTHER_STRING % "nu_log|theta_log", sets(tension_n=61.0), many=True),
    "another rate": Fault(OTHER_STRING % "nu_log", sets(rate_hz=44_100), many=True),
    "another unit": Fault(OTHER_STRING % "stretch", sets(scale_m=2e-3), many=True),
    "no tension": Fault(OTHER_STRING % "coupling", sets(tension_modulated=False), many=True),
    **{
        f"another {name}": Fault(OTHER_STRING % name, tensors=change, many=True)
        for name, change in (
            ("theta_log", lambda t: t["theta_log"][3].add_(1e-6)),
            ("coupling", lambda t: t["coupling"].mul_(1.0001)),
            ("stretch", lambda t: t["stretch"][0].mul_(1.0001)),
            ("shapes", lambda t: t["shapes"][5].neg_()),
            ("analysis", lambda t: t["analysis"].mul_(2)),
        )
    },
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_wrong_or_hostile_file_is_refused_in_one_line_that_names_it(preset_file, name):
    fault = FAULTS[name]
    if fault.many:
        shutil.copy(find_preset("studio_any_string"), preset_file)
    fault.write(preset_file)
    described = not (fault.tensors or fault.raw or fault.many)  # the description alone shows it
    for reader in (read_info, load_preset) if described else (load_preset,):
        with pytest.raises(PresetError, match=fault.words) as caught:
            reader(preset_file)
        reported = str(caught.value)
        assert str(preset_file) in reported and len(reported) <= 500 and reported.isprintable()


def test_round_trip_bit_for_bit_and_a_model_that_is_not_finite_is_not_saved(preset_file):
    preset, again = load_preset(preset_file), preset_file.with_name("again")
    before = preset_file.read_bytes()
    assert preset.info == read_info(preset_file)
    assert preset.name == "small"
    assert described_parameters(preset_file, preset.info) == count_parameters(preset.model)
    save_preset(again, preset.info, preset.model)
    assert again.read_bytes() == before
    with torch.no_grad():
        preset.model.nu_log[0] = float("nan")
    with pytest.raises(PresetError, match="'nu_log' holds values that are not finite"):
        save_preset(preset_file, preset.info, preset.model)
    assert preset_file.read_bytes() == before
    assert {path.name for path in preset_file.parent.iterdir()} == {preset_file.name, "again"}


def test_other_files_are_refused_and_names_are_found(tmp_path, preset_file):
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
    assert find_preset(str(preset_file)) == preset_file
    with pytest.raises(PresetError, match="no preset 'nonsense'; `learned-strings presets` lists all"):
        find_preset("nonsense")


def test_loading_presets_does_not_load_torchs_compiler():
    """It takes a second and more, and a start of the app would wait for it; an operation on a meta tensor may."""
    script = (
        "import sys; from engine.presets import load_preset, preset_files, read_info\n"
        "paths = {read_info(path).model: path for path in preset_files()}\n"
        "[load_preset(path) for path in paths.values()]; print(len(paths) > 4, 'torch._dynamo' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True", "False"]


ANY_SHAPE = {"width": {"gaussian": (0.02, 0.1), "raised_cosine": (0.1, 0.3)}}
TENSE = {"tension_rise": 0.01}


@pytest.mark.parametrize(
    ("name", "changed", "pluck", "words"),
    [
        ("small", {}, Pluck(0.5, 5.0, "gaussian", 0.05), ()),
        ("small", {}, Pluck(0.1, 15.0, "gaussian", 0.3), ("position 0.1 ", "width 0.3", "15")),
        ("small", {}, Pluck(0.5, 5.0, "triangular"), ("not the trained gaussian",)),
        ("small", ANY_SHAPE, Pluck(0.5, 5.0, "raised_cosine", 0.09), ("width 0.09",)),
        ("small", ANY_SHAPE, Pluck(0.5, 5.0, "gaussian", 0.09), ()),
        ("small", {"position": None, "width": None}, Pluck(0.1, 5.0, "gaussian", 0.05), ()),
        ("small", TENSE, Pluck(0.5, 5.0, "gaussian", 0.05), ("beyond the trained 1%",)),
        # where the error grows: not of a pitch below or above the trained ones
        ("string", {}, Pluck(0.12, 20.0, "triangular"), ()),  # 20 mm raise the tension of a nylon B3 by a fifth
        ("string", {}, Pluck(0.3, 4.0, "gaussian", 0.19), ()),
        (
            "string",
            {},
            Pluck(0.03, 4.0, "raised_cosine", 0.06),
            ("position 0.03 is", "trained 0.08 … 0.3"),
        ),
        ("string", {}, Pluck(0.3, 20.0, "gaussian", 0.04), ("beyond the trained 50%",)),
        ("bass_e1", {}, Pluck(0.3, 1.0, "triangular"), ()),
        ("piano_c2", {}, Pluck(0.3, 1.0, "triangular"), ("decay time near 3 kHz",)),
    ],
)
def test_plucks_and_strings_outside_training_are_reported(small_preset, name, changed, pluck, words):
    info = read_info(small_preset if name == "small" else find_preset(f"studio_any_{name}"))
    initial = "pluck" if changed is ANY_SHAPE else info.initial
    info = replace(info, initial=initial, trained_range=replace(info.trained_range, **changed))
    found = outside_training(info, pluck)
    assert len(found) == len(words)
    assert all(word in "; ".join(found) for word in words)
    assert "is not the noise" in "; ".join(outside_training(replace(info, initial="noise"), pluck))
