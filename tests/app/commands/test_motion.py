"""Motions as arrays, of strings and drums: simulate, predict, compare."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from app.commands import arrays
from engine.compare.relative import relative_error
from engine.pluck import Pluck
from engine.presets import find_string, load_preset, read_string
from engine.resonators.sine_transform import project, to_grid, to_modes
from engine.resonators.string import resonator_of
from engine.sources import ModelSource, TruthSource
from engine.truth import ModalState
from engine.values.string import StringParameters
from tests.app.commands.conftest import Run
from tests.engine.tensors import solve_linear

STEEL_E4 = "steel_e4"


def simulate(u0: Path, out: Path, string: str = "linear", steps: int = 200, *more: Any) -> list[Any]:
    return ["simulate", u0, out, "--string", string, "--rate", 4000, "--modes", 10, "--steps", steps, *more]


def relative_l2(found: np.ndarray, truth: np.ndarray) -> float:
    return float(np.linalg.norm(found - truth) / np.linalg.norm(truth))


def test_the_linear_string_is_the_closed_form(run: Run, u0: Path, folder: Path) -> None:
    found = run(*simulate(u0, folder / "out.npy"))
    assert (found.status, found.out, found.err) == (0, "", "")
    motion_m = np.load(folder / "out.npy")
    assert (motion_m.dtype, motion_m.shape) == (np.float64, (3, 201, 101))
    start = ModalState.at_rest(torch.from_numpy(to_modes(np.load(u0), 10)))
    times_s = torch.arange(201).double() / 4000
    truth = to_grid(solve_linear(resonator_of(StringParameters(), start.modes), start, times_s).numpy(), 101)
    assert relative_l2(motion_m, truth) < 1e-12
    assert list(folder.iterdir()) == [folder / "out.npy"]


def test_the_fast_solver_agrees_with_dop853_and_fewer_substeps_are_a_choice(run: Run, u0: Path, folder: Path) -> None:
    found = {}
    for name, more in {"fast": (), "dop853": ("--solver", "dop853"), "coarse": ("--substeps", 1)}.items():
        assert run(*simulate(u0, folder / f"{name}.npy", "nonlinear", 60, *more)).status == 0
        found[name] = np.load(folder / f"{name}.npy")
    assert relative_l2(found["fast"], found["dop853"]) < 1e-7
    assert relative_l2(found["coarse"], found["dop853"]) > 1e-6


@pytest.mark.parametrize("batch", [1, 3])
def test_blocks_do_not_show_in_the_file(
    run: Run, u0: Path, folder: Path, small_preset: Path, batch: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    np.save(u0, np.load(u0)[:batch])
    for command in (
        ["predict", small_preset, u0, folder / "out.npy", "--steps", 150],
        simulate(u0, folder / "out.npy", "nonlinear", 150),
    ):
        assert run(*command).status == 0
        whole = np.load(folder / "out.npy")
        with monkeypatch.context() as small:
            small.setattr(arrays, "FRAMES_AT_ONCE", 7)
            small.setattr(arrays, "BYTES_AT_ONCE", 1)
            assert run(*command).status == 0
        assert np.load(folder / "out.npy") == pytest.approx(whole, abs=1e-8)
        assert whole[:, 0] == pytest.approx(project(np.load(u0), 10), abs=1e-15)  # frame 0, on the modes


def test_a_prediction_is_the_models_in_metres(run: Run, u0: Path, small_preset: Path, folder: Path) -> None:
    assert run("predict", small_preset, u0, folder / "out.npy", "--steps", 50).status == 0
    preset = load_preset(small_preset)
    start, scale_m = project(np.load(u0), 10), preset.info.scale_m
    with torch.no_grad():
        frames = preset.model(torch.from_numpy(start / scale_m).float(), 50).numpy() * scale_m
    found = np.load(folder / "out.npy")
    assert (found.dtype, found.shape) == (np.float64, (3, 51, 101))
    assert found[:, 1:] == pytest.approx(frames, abs=1e-9)


def test_metres_that_look_like_millimetres_are_reported_and_no_endless_motion_is_written(
    run: Run, u0: Path, folder: Path
) -> None:
    plucks = np.load(u0)
    np.save(u0, plucks * 1000)
    found = run(*simulate(u0, folder / "out.npy"))
    assert found.status == 0 and "displacement is in metres" in found.err
    (folder / "out.npy").unlink()
    np.save(u0, plucks * 1e6)
    found = run(*simulate(u0, folder / "out.npy", "nonlinear"))
    assert found.status == 1 and "the motion is not finite; displacement is in m" in found.err
    assert list(folder.iterdir()) == []


def test_compare_is_the_papers_metric_over_grid_and_time(
    run: Run, small_preset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(arrays, "FRAMES_AT_ONCE", 123)
    words = ["compare", small_preset, "--position", 0.4, "--seconds", 0.2, "--json", "--amplitude-mm"]
    found = run(*words, 3)
    assert (found.status, found.err) == (0, "")
    facts = json.loads(found.out)
    preset = load_preset(small_preset)
    start = project(Pluck(0.4, 3).displacement(101), 10)[None]
    model, truth = (s.advance(s.start(start), 800)[0] for s in (ModelSource(preset), TruthSource(preset.info)))
    for part, errors in ((slice(None), facts), (slice(400, None), facts["windows"][1])):
        expected = relative_error(model[:, part], truth[:, part])
        assert errors["rel_mse"] == pytest.approx(expected.rel_mse, rel=1e-5)
        assert errors["rel_mae"] == pytest.approx(expected.rel_mae, rel=1e-5)
    assert [w["past_horizon"] for w in facts["windows"]] == [False, True]
    silent = json.loads(run(*words, 0).out)["rel_mse"]
    assert silent is None or math.isfinite(silent)


def test_a_preset_of_many_strings_predicts_the_string_that_is_named(run: Run, folder: Path) -> None:
    u, m, t = (folder / f"{name}.npy" for name in "umt")
    np.save(u, Pluck(0.3, 1.0).displacement(101)[None])
    of_string = ("--string", STEEL_E4, "--steps", 300)
    assert run("predict", "studio_any_string", u, m, *of_string).status == 0
    modes = read_string(find_string(STEEL_E4)).modes_below(20_000)
    assert run("simulate", u, t, *of_string, "--rate", 48_000, "--modes", modes).status == 0
    assert np.load(m).shape == np.load(t).shape == (1, 301, 101)
    assert relative_l2(np.load(m), np.load(t)) < 1e-5
    (folder / "mine.toml").write_bytes(find_string(STEEL_E4).read_bytes())
    of_file = ("--string", folder / "mine.toml", "--rate", 22_050, "--modes", 12, "--steps", 40)
    assert run("predict", "studio_any_string", u, m, *of_file).status == 0
    assert np.load(m).shape == (1, 41, 101)
    pluck = ("--position", 0.3, "--amplitude-mm", 1, "--seconds", 0.02)
    compared = run("compare", "studio_any_string", *pluck, "--string", STEEL_E4, "--json")
    assert json.loads(compared.out)["rel_mse"] < 1e-9


def test_a_string_beyond_the_family_is_rendered_and_reported(run: Run, folder: Path) -> None:
    np.save(folder / "u.npy", Pluck(0.3, 20.0, "triangular").displacement(101)[None])
    text = find_string(STEEL_E4).read_text(encoding="utf-8")
    slack = re.sub("d3_kg_m_s = .*", "d3_kg_m_s = 1e-8", text.replace("tension_n = 72.592", "tension_n = 0.72592"))
    (folder / "slack.toml").write_text(slack, encoding="utf-8")
    string = ("--string", folder / "slack.toml")
    motion_file = ("predict", "studio_any_string", folder / "u.npy", folder / "m.npy", "--steps", 9)
    pluck = ("--position", 0.41, "--amplitude-mm", 3.3, "--seconds", 0.15)
    for words in (motion_file, ("render", "studio_any_string", folder / "a.wav", *pluck)):
        found = run(*words, *string)
        assert found.status == 0
        assert "decay time near 3 kHz" in found.err and "raises the tension" in found.err
        assert "pitch" not in found.err  # below the trained ones, where the error does not grow


# Drums

FILES = sorted((Path(__file__).parents[3] / "presets" / "drums").glob("*.toml"))
# Frequencies that are published, and how far off a mode may be. Timpani: Christian et al., JASA 76 (1984), 1336, a
# head of 65.6 cm without its kettle. Tom: Rossing, Science of Percussion Instruments (2000), 26.
MEASURED: dict[str, dict[tuple[int, int], tuple[float, float]]] = {
    "timpani_head_26": {(m, 1): (hz, 0.04) for m, hz in enumerate((82, 155, 229, 297, 366, 431))},
    "tom_12": {
        (0, 1): (142, 0.015),
        (1, 1): (142 * 2.15, 0.05),
        (2, 1): (142 * 3.17, 0.05),
        (0, 2): (142 * 3.42, 0.05),
        (3, 1): (142 * 4.09, 0.05),
        (1, 2): (142 * 4.80, 0.11),
        (4, 1): (142 * 4.94, 0.05),
    },
}


def test_model_and_solver_move_a_drum_as_the_oracle_does(run: Run, tmp_path: Path) -> None:
    """A bar of an instrument, on a grid, from rest; its ends stay at rest. Without tension modulation it differs."""
    motions = {}
    for name, (command, *more) in {
        "fast": ("simulate",),
        "dop853": ("simulate", "--solver", "dop853"),
        "linear": ("simulate", "--linear"),
        "linear dop853": ("simulate", "--linear", "--solver", "dop853"),
        "model": ("predict",),
    }.items():
        options = ("--key", "72", "--velocity", "127", "--steps", "1500", "--points", "21")
        done = run("drums", command, "thin_bars", tmp_path / "m.npy", *options, *more)
        assert done.status == 0, done.err
        motions[name] = np.load(tmp_path / "m.npy")
    truth, linear = motions["dop853"], motions["linear dop853"]
    assert truth.shape == (1501, 7, 21)
    assert (truth[0] == 0).all()
    assert (np.abs(truth[:, :, [0, -1]]) < 1e-15).all()
    assert np.ptp(truth, axis=1).max() < 1e-12, "a bar moves alike across its width"
    size = np.square(truth).mean()
    for name, other in (("fast", truth), ("linear", linear), ("model", truth)):
        assert np.square(motions[name] - other).mean() < 1e-9 * size
    assert np.square(linear - truth).mean() > 1e-6 * size


def test_the_motion_of_a_drums_file_is_within_its_circle(run: Run, tmp_path: Path) -> None:
    (file,) = (file for file in FILES if file.stem == "tom_13")
    options = ("--steps", "100", "--points", "12", "--place", "0.5", "0", "--rate", "8000")
    done = run("drums", "simulate", file, tmp_path / "tom.npy", *options)
    assert done.status == 0, done.err
    found = np.load(tmp_path / "tom.npy")
    assert found.shape == (101, 13, 13)
    y, x = np.mgrid[1:-1:13j, -1:1:13j]
    assert (found[:, np.hypot(x, y) > 1] == 0).all()
    first = np.abs(found[4])
    assert np.unravel_index(first.argmax(), first.shape) == (6, 9), "it moves first where it is struck"


def test_errors_of_a_drum_are_those_of_the_blow_at_the_place_by_second(run: Run) -> None:
    found = {}
    for place in ("0", "0.6"):
        words = ("--key", "72", "--place", place, "0", "--seconds", "1.5", "--rate", "16000", "--json")
        found[place] = json.loads(run("drums", "compare", "thin_bars", *words).out)
        assert [(w["start_s"], w["stop_s"]) for w in found[place]["windows"]] == [(0, 1), (1, 1.5)]
        for errors in (found[place], found[place]["windows"][0]):
            assert errors["rel_mse"]["studio_any_string"] < 1e-9 < errors["rel_mse"]["linear drum"]
            assert errors["rel_mse"]["r = p = 1/12"] < 1e-9
    assert found["0"]["tension_rise"] != found["0.6"]["tension_rise"]


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_every_file_of_a_drum_is_read_and_its_modes_are_as_measured(run: Run, file: Path) -> None:
    done = run("drums", "modes", file, "--count", "20", "--json")
    assert done.status == 0, done.err
    lowest = json.loads(done.out)["lowest"]
    hz = {(mode["m"], mode["n"]): mode["hz"] for mode in reversed(lowest)}  # of a pair the lower
    for mode, (measured_hz, off) in MEASURED.get(file.stem, {}).items():
        assert hz[mode] == pytest.approx(measured_hz, rel=off)
