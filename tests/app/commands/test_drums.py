"""Commands for drums: sounds and errors of a blow at a place."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import soundfile

FILES = sorted((Path(__file__).parents[3] / "presets" / "drums").glob("*.toml"))


def test_a_blow_at_another_place_is_another_sound_and_model_and_truth_agree(run, tmp_path: Path) -> None:
    sounds = {}
    for name, options in {
        "own": (),
        "centre": ("--place", "0", "0"),
        "truth": ("--place", "0", "0", "--source", "truth"),
    }.items():
        out = tmp_path / f"{name}.wav"
        assert run("drums", "strike", "thin_bars", "72", out, "--seconds", "0.2", *options).status == 0
        sounds[name] = soundfile.read(out)[0]
    largest = np.abs(sounds["centre"]).max()
    assert largest > 0.01
    assert np.abs(sounds["own"] - sounds["centre"]).max() > 0.1 * largest
    assert np.abs(sounds["truth"] - sounds["centre"]).max() < 1e-3 * largest


def test_errors_are_those_of_the_blow_at_the_place(run) -> None:
    found = {}
    for place in ("0", "0.6"):
        done = run("drums", "compare", "thin_bars", "72", "--place", place, "0", "--seconds", "0.1", "--json")
        assert done.status == 0
        found[place] = json.loads(done.out)
    for errors in found.values():
        assert errors["rel_mse"]["studio_any_string"] < 1e-9 < errors["rel_mse"]["linear drum"]
    assert found["0"]["tension_rise"] != found["0.6"]["tension_rise"]


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_every_file_of_a_drum_is_read(run, file: Path) -> None:
    found = run("drums", "modes", file, "--json")
    assert found.status == 0, found.err


def test_the_head_of_a_timpani_is_as_measured(run) -> None:
    """Christian et al., JASA 76 (1984), 1336: a head of 65.6 cm without its kettle."""
    (file,) = (file for file in FILES if file.stem == "timpani_head_26")
    modes = json.loads(run("drums", "modes", file, "--count", "20", "--json").out)["lowest"]
    found = {(mode["m"], mode["n"]): mode["hz"] for mode in modes}
    for number, measured_hz in enumerate((82, 155, 229, 297, 366, 431)):
        assert found[number, 1] == pytest.approx(measured_hz, rel=0.04)


def test_a_place_beside_the_drum_is_refused(run, tmp_path: Path) -> None:
    for command in (("strike", "tuned_toms", "48", tmp_path / "x.wav"), ("compare", "tuned_toms", "48")):
        refused = run("drums", *command, "--place", "0.8", "0.7")
        assert refused.status == 2
        assert "must be on the drum, not 0.8 0.7; choose one nearer the centre" in " ".join(refused.err.split())
    assert not (tmp_path / "x.wav").exists()
