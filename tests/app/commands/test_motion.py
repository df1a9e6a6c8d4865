"""Motions as arrays, of strings and drums: simulate, predict, compare."""

import json
import math
from collections.abc import Callable
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

MANY, STEEL_E4 = "studio_any_string", find_string("steel_e4")
PLUCK = "--position 0.3 --amplitude-mm 1"
SIMULATE = "simulate {u0} {out}.npy --string linear --rate 4000 --modes 10 --steps"
Moved = Callable[..., np.ndarray]


@pytest.fixture
def moved(run: Run, folder: Path) -> Moved:
    """Run a command that prints nothing: the motion in the only file that it makes."""

    def of(line: str, *more: Any) -> np.ndarray:
        done = run(line, *more)
        assert (done.status, done.out, done.err) == (0, "", "")
        assert list(folder.iterdir()) == [folder / "out.npy"]
        motion_m: np.ndarray = np.load(folder / "out.npy")
        assert motion_m.dtype == np.float64
        return motion_m

    return of


def relative_l2(found: np.ndarray, truth: np.ndarray) -> float:
    return float(np.linalg.norm(found - truth) / np.linalg.norm(truth))


def test_simulations_are_the_closed_form_and_dop853s(moved, run, u0):
    motion_m = moved(f"{SIMULATE} 200")
    assert motion_m.shape == (3, 201, 101)
    start = ModalState.at_rest(torch.from_numpy(to_modes(np.load(u0), 10)))
    times_s = torch.arange(201).double() / 4000
    linear = to_grid(solve_linear(resonator_of(StringParameters(), start.modes), start, times_s).numpy(), 101)
    assert relative_l2(motion_m, linear) < 1e-12
    choices = ("", " --solver dop853", " --substeps 1")
    fast, truth, coarse = (moved(f"{SIMULATE} 60 --string nonlinear{more}") for more in choices)
    assert relative_l2(fast, truth) < 1e-7 and relative_l2(coarse, truth) > 1e-6
    warned = run("simulate {made:millimetres.npy} {out}.npy --string linear --steps 9")
    assert warned.status == 0 and "displacement is in metres" in warned.err


@pytest.mark.parametrize("batch", [1, 3])
def test_blocks_do_not_show_in_the_file(moved, u0, small_preset, batch, monkeypatch):
    np.save(u0, np.load(u0)[:batch])
    start = project(np.load(u0), 10)
    predict = "predict {small_preset} {u0} {out}.npy --steps"
    for line in (f"{predict} 150", f"{SIMULATE} 150 --string nonlinear"):
        whole = moved(line)
        with monkeypatch.context() as small:
            small.setattr(arrays, "FRAMES_AT_ONCE", 7)
            small.setattr(arrays, "BYTES_AT_ONCE", 1)
            assert moved(line) == pytest.approx(whole, abs=1e-8)
        assert whole[:, 0] == pytest.approx(start, abs=1e-15)  # frame 0, on the modes
    preset = load_preset(small_preset)
    with torch.no_grad():
        frames = preset.model(torch.from_numpy(start / preset.info.scale_m).float(), 50).numpy() * preset.info.scale_m
    found = moved(f"{predict} 50")
    assert found.shape == (batch, 51, 101) and found[:, 1:] == pytest.approx(frames, abs=1e-9)


def test_compare_is_the_papers_metric(run, small_preset, monkeypatch):
    """Over grid and time."""
    monkeypatch.setattr(arrays, "FRAMES_AT_ONCE", 123)
    compare = "compare {small_preset} --position 0.4 --seconds 0.2 --json --amplitude-mm"
    found = run(f"{compare} 3")
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
    silent = json.loads(run(f"{compare} 0").out)["rel_mse"]
    assert silent is None or math.isfinite(silent)


def test_a_preset_of_many_strings_predicts_the_one_that_is_named(run, moved, u0):
    np.save(u0, Pluck(0.3, 1.0).displacement(101)[None])
    predict, modes = f"predict {MANY} {{u0}} {{out}}.npy", read_string(STEEL_E4).modes_below(20_000)
    model = moved(f"{predict} --string steel_e4 --steps 300")
    truth = moved(f"{SIMULATE} 300 --string steel_e4 --rate 48000 --modes {modes}")
    assert model.shape == truth.shape == (1, 301, 101)
    assert relative_l2(model, truth) < 1e-5
    of_file = moved(f"{predict} --string {STEEL_E4} --rate 22050 --modes 12 --steps 40")
    assert of_file.shape == (1, 41, 101)
    compared = run(f"compare {MANY} {PLUCK} --seconds 0.02 --string steel_e4 --json")
    assert json.loads(compared.out)["rel_mse"] < 1e-9


# Drums

FILES = sorted((Path(__file__).parents[3] / "presets" / "drums").glob("*.toml"))
# Frequencies that are published, and how far off a mode may be. Timpani: Christian et al., JASA 76 (1984), 1336, a
# head of 65.6 cm without its kettle. Tom: Rossing, Science of Percussion Instruments (2000), 26.
TIMPANI = {(m, 1): (hz, 0.04) for m, hz in enumerate((82, 155, 229, 297, 366, 431))}
TOM = {(0, 1): 1, (1, 1): 2.15, (2, 1): 3.17, (0, 2): 3.42, (3, 1): 4.09, (1, 2): 4.80, (4, 1): 4.94}
OFF = {(0, 1): 0.015, (1, 2): 0.11}
MEASURED = {
    "timpani_head_26": TIMPANI,
    "tom_12": {mode: (142 * ratio, OFF.get(mode, 0.05)) for mode, ratio in TOM.items()},
}


def test_model_and_solver_move_a_drum_as_the_oracle_does(moved):
    """A bar of an instrument, on a grid, from rest; its ends stay at rest. Without tension modulation it differs."""
    options = "thin_bars {out}.npy --key 72 --velocity 127 --steps 400 --points 21"
    solver = " --solver dop853"
    fast, truth, linear, linear_truth = (
        moved(f"drums simulate {options}{more}") for more in ("", solver, " --linear", f" --linear{solver}")
    )
    assert truth.shape == (401, 7, 21)
    assert (truth[0] == 0).all()
    assert (np.abs(truth[:, :, [0, -1]]) < 1e-15).all()
    assert np.ptp(truth, axis=1).max() < 1e-12, "a bar moves alike across its width"
    size = np.square(truth).mean()
    for found, other in ((fast, truth), (linear, linear_truth), (moved(f"drums predict {options}"), truth)):
        assert np.square(found - other).mean() < 1e-9 * size
    assert np.square(linear_truth - truth).mean() > 1e-6 * size


def test_errors_of_a_drum_are_those_of_the_blow_at_the_place_by_second(run):
    compare = "drums compare thin_bars --key 72 --seconds 1.5 --rate 16000 --json --place {} 0"
    centre, side = (json.loads(run(compare.format(place)).out) for place in (0, 0.6))
    for found in (centre, side):
        assert [(w["start_s"], w["stop_s"]) for w in found["windows"]] == [(0, 1), (1, 1.5)]
        for errors in (found["rel_mse"], found["windows"][0]["rel_mse"]):
            assert errors[MANY] < 1e-9 < errors["linear drum"] and errors["r = p = 1/12"] < 1e-9
    assert centre["tension_rise"] != side["tension_rise"]


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_every_file_of_a_drum_is_read_and_its_modes_are_as_measured(run, file):
    lowest = json.loads(run(f"drums modes {file} --count 20 --json").out)["lowest"]
    hz = {(mode["m"], mode["n"]): mode["hz"] for mode in reversed(lowest)}  # of a pair the lower
    for mode, (measured_hz, off) in MEASURED.get(file.stem, {}).items():
        assert hz[mode] == pytest.approx(measured_hz, rel=off)
