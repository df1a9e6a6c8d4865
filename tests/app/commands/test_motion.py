from __future__ import annotations

import errno
import json
import math
import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from app.commands import arrays, motion
from engine.compare.relative import relative_error
from engine.pluck import Pluck
from engine.presets import find_string, load_preset, read_string
from engine.resonators.sine_transform import project, to_grid, to_modes
from engine.resonators.string import resonator_of
from engine.sources import ModelSource, TruthSource
from engine.truth import ModalState
from engine.values.string import StringParameters
from tests.engine.tensors import solve_linear


def simulate(u0: Path, out: Path, string: str = "linear", steps: int = 200, modes: int = 10, *more: Any) -> list[Any]:
    return [
        "simulate",
        u0,
        out,
        "--string",
        string,
        "--rate",
        4000,
        "--modes",
        modes,
        "--steps",
        steps,
        *more,
    ]


def relative_l2(found: np.ndarray, truth: np.ndarray) -> float:
    return float(np.linalg.norm(found - truth) / np.linalg.norm(truth))


def test_the_linear_string_is_the_closed_form(run, u0: Path, folder: Path) -> None:
    found = run(*simulate(u0, folder / "out.npy"))
    assert (found.status, found.out, found.err) == (0, "", "")
    motion_m = np.load(folder / "out.npy")
    assert (motion_m.dtype, motion_m.shape) == (np.float64, (3, 201, 101))
    start = ModalState.at_rest(torch.from_numpy(to_modes(np.load(u0), 10)))
    truth = to_grid(
        solve_linear(resonator_of(StringParameters(), start.modes), start, torch.arange(201).double() / 4000).numpy(),
        101,
    )
    assert relative_l2(motion_m, truth) < 1e-12
    assert list(folder.iterdir()) == [folder / "out.npy"]


def test_frame_0_is_the_displacement_projected_on_the_modes(run, u0: Path, small_preset: Path, folder: Path) -> None:
    expected = project(np.load(u0), 10)
    assert np.abs(expected - np.load(u0)).max() > 1e-6
    run(*simulate(u0, folder / "s.npy", "nonlinear", 3))
    run("predict", small_preset, u0, folder / "p.npy", "--steps", 3)
    for name in ("s.npy", "p.npy"):
        assert np.load(folder / name)[:, 0] == pytest.approx(expected, abs=1e-15)


def test_the_fast_solver_agrees_with_dop853(run, u0: Path, folder: Path) -> None:
    for solver in ("fast", "dop853"):
        assert run(*simulate(u0, folder / f"{solver}.npy", "nonlinear", 60, 10, "--solver", solver)).status == 0
    fast, oracle = (np.load(folder / f"{name}.npy") for name in ("fast", "dop853"))
    assert relative_l2(fast, oracle) < 1e-7


def test_fewer_substeps_are_a_choice(run, u0: Path, folder: Path) -> None:
    for substeps in (1, 20):
        run(*simulate(u0, folder / f"{substeps}.npy", "nonlinear", 60, 10, "--substeps", substeps))
    assert relative_l2(np.load(folder / "1.npy"), np.load(folder / "20.npy")) > 1e-6


@pytest.mark.parametrize("points", [12, 57])
def test_any_grid_that_holds_the_modes_will_do(run, folder: Path, points: int) -> None:
    np.save(folder / "u0.npy", Pluck().displacement(points)[None].astype(np.float32))
    assert run(*simulate(folder / "u0.npy", folder / "out.npy")).status == 0
    assert np.load(folder / "out.npy").shape == (1, 201, points)


@pytest.mark.parametrize("batch", [1, 3])
def test_blocks_do_not_show_in_the_file(run, u0, folder: Path, small_preset: Path, batch: int, monkeypatch) -> None:
    np.save(u0, np.load(u0)[:batch])
    commands = {
        "model": ["predict", small_preset, u0, folder / "model.npy", "--steps", 150],
        "truth": simulate(u0, folder / "truth.npy", "nonlinear", 150),
    }
    for name, command in commands.items():
        assert run(*command).status == 0
        whole = np.load(folder / f"{name}.npy")
        with monkeypatch.context() as small:
            small.setattr(arrays, "FRAMES_AT_ONCE", 7)
            small.setattr(arrays, "BYTES_AT_ONCE", 1)
            assert run(*command).status == 0
        assert np.load(folder / f"{name}.npy") == pytest.approx(whole, abs=1e-8)


def test_a_prediction_is_the_models_in_metres(run, u0: Path, small_preset: Path, folder: Path) -> None:
    assert run("predict", small_preset, u0, folder / "out.npy", "--steps", 50).status == 0
    preset = load_preset(small_preset)
    start = project(np.load(u0), 10)
    with torch.no_grad():
        frames = preset.model(torch.from_numpy(start / preset.info.scale_m).float(), 50).numpy() * preset.info.scale_m
    found = np.load(folder / "out.npy")
    assert (found.dtype, found.shape) == (np.float64, (3, 51, 101))
    assert found[:, 1:] == pytest.approx(frames, abs=1e-9)


BAD_INPUTS = {
    "missing": (None, "no such file"),
    "text": (b"1 2 3", "not a whole NumPy .npy file"),
    "empty": (b"", "not a whole NumPy .npy file"),
    "flat": (np.zeros(101), r"shape (101,), expected (batch, points); for one string save u[None]"),
    "deep": (np.zeros((1, 2, 101)), "expected (batch, points)"),
    "no strings": (np.zeros((0, 101)), "expected (batch, points)"),
    "complex": (np.zeros((1, 101), complex), "holds complex128, expected real numbers"),
    "words": (np.full((1, 101), "a"), "expected real numbers"),
    "objects": (np.full((1, 101), None), "not a whole NumPy .npy file"),
    "not a number": (np.full((1, 101), np.nan), "entry [0, 0] is nan; replace it"),
    "infinite": (np.full((1, 101), np.inf), "entry [0, 0] is inf; replace it"),
}


@pytest.mark.parametrize("command", ["simulate", "predict"])
@pytest.mark.parametrize("name", BAD_INPUTS)
def test_a_bad_input_is_reported_in_one_line(run, folder, tmp_path, small_preset, name: str, command: str) -> None:
    content, message = BAD_INPUTS[name]
    path = tmp_path / "bad.npy"
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content is not None:
        np.save(path, content, allow_pickle=True)
    out = folder / "out.npy"
    words = simulate(path, out) if command == "simulate" else ["predict", small_preset, path, out, "--steps", 5]
    failure = run(*words).failure
    assert failure.startswith(f"learned-strings: {path}: ")
    assert message in failure
    assert list(folder.iterdir()) == []


def test_a_truncated_input_and_an_archive_are_reported(run, folder: Path, u0: Path, tmp_path: Path) -> None:
    u0.write_bytes(u0.read_bytes()[:-100])
    assert "not a whole NumPy .npy file" in run(*simulate(u0, folder / "out.npy")).failure
    np.savez(tmp_path / "many.npz", a=np.zeros((1, 101)))
    assert "an archive of arrays" in run(*simulate(tmp_path / "many.npz", folder / "out.npy")).failure


def test_the_grid_of_a_preset_is_reported(run, folder: Path, tmp_path: Path, small_preset: Path) -> None:
    np.save(tmp_path / "u0.npy", np.zeros((2, 50)))
    failure = run("predict", small_preset, tmp_path / "u0.npy", folder / "out.npy", "--steps", 5).failure
    assert "u0.npy: has shape (2, 50), expected (batch, 101), the grid of small" in failure


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--modes", 100], "--modes: a grid of 101 points holds 1 … 99 modes, not 100"),
        (["--modes", 0], "--modes"),
        (["--steps", 0], "--steps"),
        (["--rate", 0], "--rate: must lie in 1 … 1000000 Hz, not 0"),
        (["--rate", "nan"], "--rate: must lie in 1 … 1000000 Hz, not nan"),
        (["--string", "rubber"], "--string"),
        (["--substeps", 2], "--substeps: only the fast solver of the nonlinear string"),
    ],
)
def test_options_out_of_range_are_bad_usage(run, u0: Path, folder: Path, more: list[Any], message: str) -> None:
    usage = run(*simulate(u0, folder / "out.npy"), *more).usage
    assert message in usage.replace("'", "")
    assert list(folder.iterdir()) == []


def test_a_result_that_would_not_fit_is_refused_before_the_work(run, u0: Path, folder: Path) -> None:
    failure = run(*simulate(u0, folder / "out.npy", steps=10**9)).failure
    assert "would take 2257.5 GiB, more than the 4 GiB allowed; lower --steps" in failure


def test_metres_that_look_like_millimetres_are_reported(run, u0: Path, folder: Path) -> None:
    np.save(u0, np.load(u0) * 1000)
    found = run(*simulate(u0, folder / "out.npy"))
    assert found.status == 0
    assert "displacement is in metres" in found.err


def test_a_motion_that_is_not_finite_leaves_no_file(run, u0: Path, folder: Path) -> None:
    np.save(u0, np.load(u0) * 1e6)
    found = run(*simulate(u0, folder / "out.npy", "nonlinear"))
    assert found.status == 1
    assert "the motion is not finite; displacement is in m" in found.err
    assert list(folder.iterdir()) == []


def test_a_folder_that_cannot_be_written_is_reported(run, u0: Path, folder: Path) -> None:
    out = folder / "missing" / "out.npy"
    assert f"{out}: cannot be written" in run(*simulate(u0, out)).failure


def test_a_full_disk_leaves_no_file(run, u0: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(self: Path, target: Path) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, "replace", full)
    assert "free some space" in run(*simulate(u0, folder / "out.npy")).failure
    assert list(folder.iterdir()) == []


def compare(
    preset: Path, *more: Any, position: float = 0.4, amplitude_mm: float = 3, seconds: float = 0.2
) -> list[Any]:
    pluck = ["--position", position, "--amplitude-mm", amplitude_mm]
    return ["compare", preset, *pluck, "--seconds", seconds, *more]


def test_compare_is_the_papers_metric_over_grid_and_time(run, small_preset: Path, monkeypatch) -> None:
    monkeypatch.setattr(arrays, "FRAMES_AT_ONCE", 123)
    found = run(*compare(small_preset, "--json"))
    assert (found.status, found.err) == (0, "")
    facts = json.loads(found.out)
    preset = load_preset(small_preset)
    start = project(Pluck(0.4, 3).displacement(101), 10)[None]
    model, truth = (s.advance(s.start(start), 800)[0] for s in (ModelSource(preset), TruthSource(preset.info)))
    expected = relative_error(model, truth)
    assert facts["rel_mse"] == pytest.approx(expected.rel_mse, rel=1e-5)
    assert facts["rel_mae"] == pytest.approx(expected.rel_mae, rel=1e-5)
    late = relative_error(model[:, 400:], truth[:, 400:])
    assert [w["past_horizon"] for w in facts["windows"]] == [False, True]
    assert facts["windows"][1]["rel_mse"] == pytest.approx(late.rel_mse, rel=1e-5)


def test_windows_meet_at_whole_seconds_and_at_the_horizon(small_preset: Path) -> None:
    info = load_preset(small_preset).info
    assert motion.window_edges(2.5, info) == [0, 0.1, 1, 2, 2.5]
    assert motion.window_edges(2.0, info) == [0, 0.1, 1, 2]
    assert motion.window_edges(0.1, info) == [0, 0.1]
    assert motion.window_edges(0.05, info) == [0, 0.05]


def test_a_pluck_outside_the_training_is_reported_and_compared(run, small_preset: Path) -> None:
    found = run(*compare(small_preset, "--width", 0.3, position=0.1, amplitude_mm=15))
    assert found.status == 0
    assert found.err.splitlines() == [
        "learned-strings: warning: position 0.1 is outside the trained 0.3 … 0.7",
        "learned-strings: warning: width 0.3 is outside the trained 0.02 … 0.1",
        "learned-strings: warning: amplitude 15 mm is outside the trained 1 … 10 mm",
    ]
    assert "past the training horizon" in found.out


def test_silence_compared_with_what_a_model_makes_of_it_is_valid_json(run, small_preset: Path) -> None:
    facts = json.loads(run(*compare(small_preset, "--json", amplitude_mm=0)).out)
    assert facts["rel_mse"] is None or math.isfinite(facts["rel_mse"])


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"position": 1.5}, "--position: must lie in 0.02 … 0.98, not 1.5"),
        ({"amplitude_mm": -1}, "--amplitude-mm: must lie in 0 … 20 mm, not -1"),
        ({"amplitude_mm": float("nan")}, "--amplitude-mm: must lie in 0 … 20 mm, not nan"),
        ({"seconds": 0}, "--seconds: must hold a sample of 4000 Hz, not 0 s"),
        ({"seconds": 1e9}, "--seconds: must lie in 0 … 600 s, not 1000000000"),
    ],
)
def test_a_pluck_out_of_range_is_bad_usage(run, small_preset: Path, changed: dict[str, float], message: str) -> None:
    assert message in run(*compare(small_preset, **changed)).usage


STEEL_E4 = "steel_e4"


def test_a_preset_of_many_strings_predicts_the_string_that_is_named(run, folder: Path) -> None:
    initial = Pluck(0.3, 1.0).displacement(101)[None]
    np.save(folder / "u.npy", initial)
    of_string = ("--string", STEEL_E4, "--steps", 300)
    assert run("predict", "studio_any_string", folder / "u.npy", folder / "model.npy", *of_string).status == 0
    modes = read_string(find_string(STEEL_E4)).modes_below(20_000)
    solved = ("--rate", 48_000, "--modes", modes)
    assert run("simulate", folder / "u.npy", folder / "truth.npy", *of_string, *solved).status == 0
    found, truth = np.load(folder / "model.npy"), np.load(folder / "truth.npy")
    assert found.shape == truth.shape == (1, 301, 101)
    assert relative_l2(found, truth) < 1e-5


def test_a_string_file_rate_and_modes_are_taken(run, folder: Path) -> None:
    np.save(folder / "u.npy", Pluck(0.3, 1.0).displacement(101)[None])
    (folder / "mine.toml").write_bytes(find_string(STEEL_E4).read_bytes())
    reported = ("--string", folder / "mine.toml", "--rate", 22_050, "--modes", 12, "--steps", 40)
    assert run("predict", "studio_any_string", folder / "u.npy", folder / "m.npy", *reported).status == 0
    assert np.load(folder / "m.npy").shape == (1, 41, 101)


def test_a_string_beyond_the_family_is_rendered_and_reported(run, folder: Path) -> None:
    np.save(folder / "u.npy", Pluck(0.3, 20.0, "triangular").displacement(101)[None])
    text = find_string(STEEL_E4).read_text(encoding="utf-8")
    slack = text.replace("tension_n = 72.592", "tension_n = 0.72592")
    slack = re.sub("d3_kg_m_s = .*", "d3_kg_m_s = 1e-8", slack)
    (folder / "slack.toml").write_text(slack, encoding="utf-8")
    files = (folder / "u.npy", folder / "m.npy")
    found = run("predict", "studio_any_string", *files, "--string", folder / "slack.toml", "--steps", 9)
    assert found.status == 0
    assert "decay time near 3 kHz" in found.err
    assert "pitch" not in found.err  # below the trained ones, where the error does not grow
    assert "raises the tension" in found.err


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("length_m = 0.648", "length_m = -1", "length_m must lie in"),
        ("length_m = 0.648", "size = 3", "unknown field 'size'"),
        ("length_m = 0.648\n", "", "bad.toml: length_m is missing; "),
        ("d1_kg_m_s = 0.00039498", "d1_kg_m_s = 900.0", "overdamped"),
    ],
)
def test_an_impossible_string_is_one_line(run, folder: Path, old: str, new: str, words: str) -> None:
    np.save(folder / "u.npy", Pluck().displacement(101)[None])
    text = find_string(STEEL_E4).read_text(encoding="utf-8")
    assert old in text
    (folder / "bad.toml").write_text(text.replace(old, new), encoding="utf-8")
    files = (folder / "u.npy", folder / "m.npy")
    found = run("predict", "studio_any_string", *files, "--string", folder / "bad.toml", "--steps", 9)
    assert found.status == 1
    assert words in found.err
    assert found.err.count("\n") == 1
    assert not (folder / "m.npy").exists()


def test_a_preset_of_one_string_refuses_another(run, small_preset: Path, folder: Path) -> None:
    np.save(folder / "u.npy", Pluck().displacement(101)[None])
    found = run("predict", small_preset, folder / "u.npy", folder / "m.npy", "--string", STEEL_E4, "--steps", 9)
    assert (found.status, "choose a preset of many strings" in found.err) == (1, True)


def test_compare_takes_a_string(run) -> None:
    pluck = ("--position", 0.3, "--amplitude-mm", 1, "--seconds", 0.02)
    found = run("compare", "studio_any_string", *pluck, "--string", STEEL_E4, "--json")
    assert found.status == 0
    assert json.loads(found.out)["rel_mse"] < 1e-9
