"""evaluate: a preset that is nearly the linear string, on the data of the linear string."""

from __future__ import annotations

import json
import math
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch

from engine.models import build_model
from engine.models.base import Physics
from engine.presets import find_preset, load_preset, preset_digest, save_preset
from engine.resonators.string import decay_rates, resonator_of
from engine.schema import write
from training.configuration import DatasetConfiguration, Recipe, TrainingConfiguration
from training.data.dataset import Dataset, load_dataset
from training.heard_file import read_heard
from training.heard_words import heard_word

DATA = DatasetConfiguration(initial="gaussian", rate_hz=4000, modes=10, tension_modulated=False, steps=600, count=20)
HORIZON = 500  # frames


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> list[Any]:
    return ["--cache", tmp_path_factory.mktemp("cache")]


@pytest.fixture
def preset(small_preset: Path, tmp_path: Path) -> Path:
    """The linear string in closed form, its decay rates too high by a tenth."""
    model = build_model("koopman_integrated")
    physics = Physics(resonator_of(DATA.string, DATA.modes, tension_modulated=False), DATA.rate_hz, 1e-3)
    model.initialise("physics", physics, torch.Generator().manual_seed(0))
    with torch.no_grad():
        model.get_parameter("nu_log").add_(math.log(1.1))
    run = TrainingConfiguration("Tiny", "koopman_integrated", DATA, Recipe(epochs=1), horizon=HORIZON)
    info = replace(
        load_preset(small_preset).info,
        model="koopman_integrated",
        model_configuration={},
        tension_modulated=False,
        horizon_steps=HORIZON,
        training=write(run),
        test_rel_mse=0.75,
    )
    path = tmp_path / "tiny.safetensors"
    save_preset(path, info, model)
    return path


def test_the_papers_figures_stand_beside_the_measured(
    run, tmp_path: Path, cache: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    def few(data: DatasetConfiguration, folder: Path | None) -> Dataset:
        return load_dataset(replace(data, count=20, steps=400), folder)

    monkeypatch.setattr("training.cli.evaluation.load_data", few)
    file = tmp_path / "mine.safetensors"  # its name need not be the cell's
    shutil.copy(find_preset("nylon_nonlinear_noise_4k_s5_400"), file)
    out = run("evaluate", file, "--split", "both", *cache).out
    assert out.count("paper       rel. MSE 0.0057, rel. MAE 0.0672 (validation)") == 1
    assert out.count("project     rel. MSE 0.000306, rel. MAE") == 1
    reported = json.loads(run("evaluate", file, "--json", *cache).out)
    assert reported["paper"] == {"rel_mse": 0.0057, "rel_mae": 0.0672}
    assert "paper" not in run("evaluate", file, "--split", "test", *cache).out


def test_the_horizon_and_what_is_stored(run, preset: Path, cache: list[Any]) -> None:
    reported = run("evaluate", preset, "--split", "both", *cache)
    assert (reported.status, reported.err) == (0, "")
    assert "validation: rel. MSE" in reported.out
    assert "stored in the preset: 0.5, 0.25" in reported.out
    assert "stored in the preset: 0.75, -" in reported.out
    assert "2 trajectories, trained to 0.125 s" in reported.out
    assert "past the training horizon" not in reported.out

    found = json.loads(run("evaluate", preset, "--split", "both", "--json", *cache).out)
    validation, test = found["validation"], found["test"]
    assert found["rel_mse"] == validation["rel_mse"]
    assert (found["horizon_s"], found["past_s"]) == (0.125, 0)
    assert (validation["stored_rel_mse"], test["stored_rel_mse"], test["stored_rel_mae"]) == (0.5, 0.75, None)
    assert validation["rel_mse"] != test["rel_mse"]
    assert 0 < validation["rel_mse_spread"] < validation["rel_mse"]
    assert validation["rel_mse_400"] < validation["rel_mse"]  # too much decay shows with time
    assert [w["stop_s"] for w in test["windows"]] == [0.03125, 0.0625, 0.09375, 0.125]
    assert not any(w["past_horizon"] for w in test["windows"])
    # the sound's null depth is about that of the whole string
    assert test["null_depth_db"] == pytest.approx(10 * math.log10(test["rel_mse"]), abs=6)
    assert test["spectral_convergence"] > 0


def test_fresh_plucks_that_nobody_trained_on(run, preset: Path, cache: list[Any]) -> None:
    words = ["evaluate", preset, "--held-out", "12", *cache]
    reported = run(*words)
    assert (reported.status, reported.err) == (0, "")
    assert reported.out.startswith("held out: rel. MSE")
    assert "stored in the preset" not in reported.out
    assert "12 trajectories, trained to 0.125 s" in reported.out
    found = json.loads(run(*words, "--json").out)
    assert (found["split"], found["held_out"]["trajectories"]) == ("held_out", 12)
    assert 0 < found["held_out"]["rel_mse_se"] < found["rel_mse"]
    # of the same draw, and of the linear string, whose every pluck loses a tenth too much
    split = json.loads(run("evaluate", preset, "--json", *cache).out)
    assert found["rel_mse"] == pytest.approx(split["rel_mse"], rel=0.5)
    other = json.loads(run(*words, "--seed", "2", "--json").out)["rel_mse"]
    assert other not in (found["rel_mse"], split["rel_mse"])
    assert json.loads(run(*words, "--json").out)["rel_mse"] == found["rel_mse"]
    assert "past the training horizon" in run(*words, "--past", "0.5", "--partials").out
    assert "its plucks were trained on; take another" in run(*words, "--seed", "0").usage
    assert "--held-out" in run("evaluate", preset, "--held-out", "3", *cache).usage


def test_the_errors_by_how_far_a_pluck_raises_the_tension(run, preset: Path, folder: Path) -> None:
    """Played on the tension-modulated string, a linear model has its largest error where it is plucked hardest."""
    loaded = load_preset(preset)
    data = {**loaded.info.training["data"], "tension_modulated": True}
    info = replace(loaded.info, tension_modulated=True, training={**loaded.info.training, "data": data})
    path = folder / "hard.safetensors"
    save_preset(path, info, loaded.model)
    words = ["evaluate", path, "--held-out", "40"]
    reported = run(*words)
    assert "tension rises %" in reported.out
    groups = json.loads(run(*words, "--json").out)["held_out"]["by_rise"]
    assert [group["trajectories"] for group in groups] == [20, 10, 6, 2, 2]
    rises = [rise for group in groups for rise in (group["from_rise"], group["to_rise"])]
    assert rises == sorted(rises)
    assert sum(group["share"] for group in groups) == pytest.approx(1)
    assert all(0 < group["largest"] <= group["share"] for group in groups)
    assert groups[0]["rel_mse"] < 0.5 * groups[3]["rel_mse"]  # at half the rate soon out of step, too


def test_past_the_horizon_a_row_a_second(run, preset: Path, cache: list[Any]) -> None:
    words = ["evaluate", preset, "--past", "2.5", *cache]
    reported = run(*words)
    assert reported.status == 0
    assert reported.out.count("past the training horizon") == 3
    found = json.loads(run(*words, "--json").out)["validation"]
    late = [w for w in found["windows"] if w["past_horizon"]]
    assert all(0 < w["rel_mse_se"] < w["rel_mse"] and 0 < w["rel_mae_se"] < w["rel_mae"] for w in late)
    assert [(w["start_s"], w["stop_s"]) for w in late] == [(0.125, 1.125), (1.125, 2.125), (2.125, 2.625)]
    # the first mode is left, and exp(-0.1 σt) of it: so much is known of the error
    sigma, middle_s = decay_rates(DATA.string, 1).item(), 2.375
    assert late[2]["rel_mse"] == pytest.approx((1 - math.exp(-0.1 * sigma * middle_s)) ** 2, rel=0.1)
    # damped a tenth less, its error grows: the last second's figure lies between those of its windows
    assert late[1]["rel_mse"] < found["last_second"]["rel_mse"] < late[2]["rel_mse"]
    assert found["first_second"]["rel_mse"] < late[0]["rel_mse"]
    times = found["last_second"]["rel_mse"] / found["first_second"]["rel_mse"]
    assert f"{times:.3g} times as much" in reported.out
    at_horizon = json.loads(run("evaluate", preset, "--json", *cache).out)
    assert "first_second" not in at_horizon["validation"]
    assert found["rel_mse"] == pytest.approx(at_horizon["rel_mse"], rel=1e-4)
    assert found["rel_mse_se"] == pytest.approx(at_horizon["validation"]["rel_mse_se"], rel=1e-4)


def test_partials(run, preset: Path, cache: list[Any]) -> None:
    words = ["evaluate", preset, "--past", "1", "--partials", *cache]
    reported = run(*words)
    assert "validation, partials of 0 … 0.125 s: medians of the magnitudes" in reported.out
    assert "validation, partials of 0.125 … 1.125 s, past the training horizon" in reported.out
    assert reported.out.count("all, by energy") == 2
    found = json.loads(run(*words, "--json").out)["validation"]["partials"]
    horizon, past, *windows = found
    assert [(w["start_s"], w["stop_s"]) for w in (horizon, past)] == [(0, 0.125), (0.125, 1.125)]
    assert len(windows) == 5
    assert [mode["mode"] for mode in horizon["modes"]] == list(range(1, 11))
    third = past["modes"][2]
    assert third["frequency_hz"] == pytest.approx(741.9, abs=0.1)
    assert third["t60_s"] == pytest.approx(3 * math.log(10) / float(decay_rates(DATA.string, 3)[2]), rel=1e-5)
    assert third["t60_error_percent"] == pytest.approx(100 - 100 / 1.1, rel=1e-3)
    assert horizon["modes"][7]["level_db"] is None  # not resolved: at half the rate
    assert horizon["weighted"]["cents"] < 0.01


def test_a_preset_of_many_strings_is_measured_on_plucks_of_one(run, folder: Path) -> None:
    words = ["evaluate", "studio_any_string", "--string", "steel_e4", "--rate", "16000", "--partials"]
    found = json.loads(run(*words, "--json").out)
    assert (found["split"], found["rate_hz"], found["held_out"]["trajectories"]) == ("held_out", 16_000, 10)
    assert 0 < found["rel_mse"] < 1e-4
    assert found["held_out"]["by_rise"][-1]["to_rise"] < 0.51  # as hard as the family is plucked
    first = found["held_out"]["partials"][0]["modes"][0]
    assert first["frequency_hz"] == pytest.approx(330, abs=5)
    assert first["glide_cents"] > 1
    assert all(first[name] < 0.01 for name in ("level_db", "cents", "t60_error_percent", "glide_error_cents"))
    reported = run(*words)
    assert reported.err == ""
    assert "held out: rel. MSE" in reported.out
    assert "glide error" in reported.out
    other = json.loads(run(*words[:2], "--rate", "8000", "--modes", "5", "--held-out", "11", "--json").out)
    assert (other["rate_hz"], other["held_out"]["trajectories"]) == (8_000, 11)  # the preset's own string
    beyond = run(*words[:2], "--string", "piano_c2", "--modes", "5").err
    assert "decay time near 3 kHz 8.02 s is outside the trained 0.1 … 1 s" in beyond
    assert "decay time 27.6" not in beyond  # of the first mode: the error does not grow with it


def test_some_trajectories(run, preset: Path, cache: list[Any]) -> None:
    found = json.loads(run("evaluate", preset, "--trajectories", "1", "--json", *cache).out)["validation"]
    assert (found["trajectories"], found["rel_mse_spread"]) == (1, 0)
    reported = run("evaluate", preset, "--trajectories", "3", *cache)
    assert "--trajectories: must lie in 1 … 2, not 3" in reported.usage.replace("'", "")


def test_a_model_that_grows_is_shown_as_infinite(run, preset: Path, cache: list[Any], folder: Path) -> None:
    loaded = load_preset(preset)
    weights = loaded.model.get_parameter("decoder.weight")
    with torch.no_grad():
        weights.fill_(3e38)
    path = folder / "grown.safetensors"
    save_preset(path, loaded.info, loaded.model)
    reported = run("evaluate", path, "--partials", *cache)
    assert reported.status == 0
    assert "rel. MSE inf, rel. MAE inf" in reported.out
    assert "null depth inf dB" in reported.out
    assert json.loads(run("evaluate", path, "--json", *cache).out)["rel_mse"] is None


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--past", "-1"], "must lie in 0 … 60 s, not -1"),
        (["--past", "61"], "must lie in 0 … 60 s, not 61"),
        (["--past", "1e-5"], "must hold a sample of 4000 Hz"),
        (["--past", "nan"], "must lie in 0 … 60 s, not nan"),
        (["--split", "train"], "is not one of"),
        (["--trajectories", "0"], "--trajectories"),
    ],
)
def test_bad_usage(run, preset: Path, words: list[str], message: str) -> None:
    assert message in run("evaluate", preset, *words).usage


def test_a_preset_that_says_nothing_of_its_training_is_reported(run, small_preset: Path) -> None:
    assert "metadata.training: field 'title' is missing" in run("evaluate", small_preset).failure


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"count": 10_000_000}, "GiB of data; ask for less"),
        ({"rate_hz": 8000}, "metadata.training.data.rate_hz is 8000, the model's is 4000"),
        ({"grid_points": 51}, "grid_points is 101, the data's are 51"),
    ],
)
def test_a_data_set_that_is_not_the_models_is_reported(
    run, preset: Path, folder: Path, changes: dict[str, Any], message: str
) -> None:
    loaded = load_preset(preset)
    training = {**loaded.info.training, "data": {**loaded.info.training["data"], **changes}}
    path = folder / "other.safetensors"
    save_preset(path, replace(loaded.info, training=training), loaded.model)
    assert message in run("evaluate", path).failure


def test_what_is_heard_is_printed_and_kept_where_it_is_asked(run, preset: Path) -> None:
    reported = run("evaluate", preset, "--heard")
    assert reported.status == 0
    assert "tiny" in reported.out
    assert "spectra dB" in reported.out
    assert read_heard(preset.parent) == ({}, [])
    (facts,) = json.loads(run("evaluate", preset, "--heard", "--write", "--json").out)
    known, _ = read_heard(preset.parent)
    kept = known[preset_digest(preset)]
    assert facts["heard"] == heard_word(kept)
    assert facts["distance_db"] == pytest.approx(kept.distance_db, abs=1e-3)
    assert kept.level_db == pytest.approx(-1.0, abs=0.3)  # its own decay is a tenth faster than 2.9 dB a second


def test_all_presets_are_listened_to_and_a_broken_one_is_reported(
    run, preset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (preset.parent / "broken.safetensors").write_bytes(b"not a preset")
    monkeypatch.setattr("engine.presets.finding.SHIPPED", preset.parent)
    reported = run("evaluate", "--heard", "--all", "--write", "--json")
    assert reported.status == 0
    assert [facts["name"] for facts in json.loads(reported.out)] == ["tiny"]
    assert "broken.safetensors: not a whole safetensors file" in reported.err
    assert set(read_heard(preset.parent)[0]) == {preset_digest(preset)}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "PRESET"),
        (["--heard"], "give a preset, or --all"),
        (["tiny", "--heard", "--all"], "give a preset, or --all"),
        (["tiny", "--all"], "--all: does not go without --heard"),
        (["tiny", "--write"], "--write: does not go without --heard"),
        (["tiny", "--heard", "--partials"], "--partials: does not go with --heard"),
        (["tiny", "--heard", "--past", "1"], "--past: does not go with --heard"),
        (["tiny", "--heard", "--string", "steel_e4"], "--string: does not go with --heard"),
        (["tiny", "--on", "nylon", "--rate", "8000"], "--rate: does not go with --on"),
    ],
)
def test_bad_usage_of_heard(run, words: list[str], message: str) -> None:
    assert message in run("evaluate", *words).usage
