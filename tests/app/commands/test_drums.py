"""Commands for drums: sounds and errors of a blow at a place."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import soundfile

from tests.bench.drums import measured_modes

FILES = sorted((Path(__file__).parents[3] / "presets" / "drums").glob("*.toml"))


def test_a_blow_at_another_place_is_another_sound_and_model_and_truth_agree(run, tmp_path: Path) -> None:
    sounds = {}
    for name, options in {
        "own": (),
        "centre": ("--place", "0", "0"),
        "truth": ("--place", "0", "0", "--source", "truth"),
    }.items():
        out = tmp_path / f"{name}.wav"
        assert run("drums", "render", "thin_bars", out, "--key", "72", "--seconds", "0.2", *options).status == 0
        sounds[name] = soundfile.read(out)[0]
    largest = np.abs(sounds["centre"]).max()
    assert largest > 0.01
    assert np.abs(sounds["own"] - sounds["centre"]).max() > 0.1 * largest
    assert np.abs(sounds["truth"] - sounds["centre"]).max() < 1e-3 * largest


def test_errors_are_those_of_the_blow_at_the_place(run) -> None:
    found = {}
    for place in ("0", "0.6"):
        done = run(
            "drums", "compare", "thin_bars", "--key", "72", "--place", place, "0", "--seconds", "0.1", "--json"
        )
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


def test_a_tom_is_as_measured() -> None:
    """All but (1,2), which is 10 % low."""
    found = {mode.mode: mode.error_percent for mode in measured_modes() if mode.drum == "tom_12"}
    assert abs(found.pop("(0,1)")) < 1.5
    assert abs(found.pop("(1,2)")) < 11
    assert max(map(abs, found.values())) < 5


def test_model_and_solver_move_a_drum_as_the_oracle_does(run, tmp_path: Path) -> None:
    """A bar of an instrument, on a grid, from rest; its ends stay at rest. Without tension modulation it differs."""
    motions = {}
    for name, command in {
        "fast": ("simulate",),
        "dop853": ("simulate", "--solver", "dop853"),
        "linear": ("simulate", "--linear"),
        "linear dop853": ("simulate", "--linear", "--solver", "dop853"),
        "model": ("predict",),
    }.items():
        out = tmp_path / f"{name}.npy"
        options = ("--key", "72", "--velocity", "127", "--steps", "1500", "--points", "21")
        done = run("drums", command[0], "thin_bars", out, *options, *command[1:])
        assert done.status == 0, done.err
        motions[name] = np.load(out)
    truth, linear = motions["dop853"], motions["linear dop853"]
    assert truth.shape == (1501, 7, 21)
    assert (truth[0] == 0).all()
    assert (np.abs(truth[:, :, [0, -1]]) < 1e-15).all()
    assert np.ptp(truth, axis=1).max() < 1e-12, "a bar moves alike across its width"
    size = np.square(truth).mean()
    assert np.square(motions["fast"] - truth).mean() < 1e-9 * size
    assert np.square(motions["linear"] - linear).mean() < 1e-9 * size
    assert np.square(motions["model"] - truth).mean() < 1e-9 * size
    assert np.square(linear - truth).mean() > 1e-6 * size


def test_the_motion_of_a_drums_file_is_within_its_circle(run, tmp_path: Path) -> None:
    (file,) = (file for file in FILES if file.stem == "tom_13")
    out = tmp_path / "tom.npy"
    done = run(
        "drums", "simulate", file, out, "--steps", "100", "--points", "12", "--place", "0.5", "0", "--rate", "8000"
    )
    assert done.status == 0, done.err
    motion = np.load(out)
    assert motion.shape == (101, 13, 13)
    y, x = np.mgrid[1:-1:13j, -1:1:13j]
    assert (motion[:, np.hypot(x, y) > 1] == 0).all()
    first = np.abs(motion[4])
    assert np.unravel_index(first.argmax(), first.shape) == (6, 9), "it moves first where it is struck"


def test_errors_are_printed_by_second(run) -> None:
    done = run("drums", "compare", "thin_bars", "--key", "72", "--seconds", "1.5", "--rate", "16000", "--json")
    windows = json.loads(done.out)["windows"]
    assert [(each["start_s"], each["stop_s"]) for each in windows] == [(0, 1), (1, 1.5)]
    names = {"studio_any_string", "r = p = 1/12", "linear drum"}
    assert all(each["rel_mse"].keys() == names for each in windows)
    assert windows[0]["rel_mse"]["r = p = 1/12"] < 1e-9 < windows[0]["rel_mse"]["linear drum"]


def test_an_instrument_needs_a_key_and_a_preset_of_many(run) -> None:
    refused = run("drums", "modes", "concert_toms")
    assert refused.status == 2
    assert "36" in refused.err
    refused = run("drums", "compare", "thin_bars", "--key", "72", "--preset", "studio_nylon_b3")
    assert refused.status == 1
    assert "choose a preset of many strings" in " ".join(refused.err.split())


def test_a_place_beside_the_drum_is_refused(run, tmp_path: Path) -> None:
    for command in (("render", "tuned_toms", tmp_path / "x.wav"), ("compare", "tuned_toms")):
        refused = run("drums", *command, "--key", "48", "--place", "0.8", "0.7")
        assert refused.status == 2
        assert "must be on the drum, not 0.8 0.7; choose one nearer the centre" in " ".join(refused.err.split())
    assert not (tmp_path / "x.wav").exists()
