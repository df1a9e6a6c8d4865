"""evaluate: a preset that is nearly the linear string, on the data of the linear string."""

import json
import math
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from engine.presets import find_preset, preset_digest
from engine.resonators.string import decay_rates
from tests.app.commands.conftest import DATA, Run
from training.configuration import DatasetConfiguration
from training.data.dataset import Dataset, load_dataset
from training.heard_file import read_heard
from training.heard_words import heard_word


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("cache")


def facts_of(run: Run, line: str) -> Any:
    return json.loads(run(f"{line} --json").out)


def test_the_papers_figures_are_printed_too(run, folder, monkeypatch):
    def few(data: DatasetConfiguration, folder: Path | None) -> Dataset:
        return load_dataset(replace(data, count=20, steps=400), folder)

    monkeypatch.setattr("training.cli.evaluation.load_data", few)
    shutil.copy(find_preset("nylon_nonlinear_noise_4k_s5_400"), folder / "mine.safetensors")  # not the cell's name
    out = run("evaluate {folder}/mine.safetensors --split both --cache {cache}").out
    assert out.count("paper       rel. MSE 0.0057, rel. MAE 0.0672 (validation)") == 1
    assert out.count("project     rel. MSE 0.000306, rel. MAE") == 1
    reported = facts_of(run, "evaluate {folder}/mine.safetensors --split test --cache {cache}")
    assert "rel_mae" in reported and "paper" not in reported
    many = facts_of(run, "evaluate studio_any_string --on nylon_nonlinear_noise_4k_s5_400 --cache {cache}")
    assert many["validation"]["stored_rel_mse"] is None and many["validation"]["rel_mse"] < 1e-9


def test_fresh_plucks_that_nobody_trained_on(run):
    held_out = "evaluate {tiny} --cache {cache} --held-out 12"
    reported = run(f"{held_out} --past 0.5 --partials")
    assert (reported.status, reported.err) == (0, "")
    assert reported.out.startswith("held out: rel. MSE") and "past the training horizon" in reported.out
    assert "stored in the preset" not in reported.out
    found = facts_of(run, held_out)
    assert (found["split"], found["held_out"]["trajectories"]) == ("held_out", 12)
    assert 0 < found["held_out"]["rel_mse_se"] < found["rel_mse"]
    # of the same draw, and of the linear string, whose every pluck loses a tenth too much
    split = facts_of(run, "evaluate {tiny} --cache {cache}")
    assert found["rel_mse"] == pytest.approx(split["rel_mse"], rel=0.5)
    assert facts_of(run, f"{held_out} --seed 2")["rel_mse"] not in (found["rel_mse"], split["rel_mse"])
    assert facts_of(run, held_out)["rel_mse"] == found["rel_mse"]


def test_past_the_horizon_a_row_a_second_and_partials(run):
    evaluate = "evaluate {tiny} --past 2.5 --partials --cache {cache}"
    reported, found = run(evaluate), facts_of(run, evaluate)["validation"]
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
    at_horizon = facts_of(run, "evaluate {tiny} --cache {cache}")["validation"]
    assert "first_second" not in at_horizon
    for name in ("rel_mse", "rel_mse_se"):
        assert found[name] == pytest.approx(at_horizon[name], rel=1e-4)

    assert "validation, partials of 0 … 0.125 s: medians of the magnitudes" in reported.out
    horizon, past, *windows = found["partials"]
    assert [(w["start_s"], w["stop_s"]) for w in (horizon, past)] == [(0, 0.125), (0.125, 2.625)]
    assert len(windows) == 7
    assert [mode["mode"] for mode in horizon["modes"]] == list(range(1, 11))
    third = past["modes"][2]
    assert third["frequency_hz"] == pytest.approx(741.9, abs=0.1)
    assert third["t60_s"] == pytest.approx(3 * math.log(10) / float(decay_rates(DATA.string, 3)[2]), rel=1e-5)
    assert third["t60_error_percent"] == pytest.approx(100 - 100 / 1.1, rel=1e-3)
    assert horizon["modes"][7]["level_db"] is None  # not resolved: at half the rate
    assert horizon["weighted"]["cents"] < 0.01


def test_a_preset_of_many_strings_is_measured_on_plucks_of_one(run):
    many = "evaluate studio_any_string"
    found = facts_of(run, f"{many} --string steel_e4 --rate 16000 --partials")
    assert (found["split"], found["rate_hz"], found["held_out"]["trajectories"]) == ("held_out", 16_000, 10)
    assert 0 < found["rel_mse"] < 1e-4
    groups = found["held_out"]["by_rise"]
    assert [group["trajectories"] for group in groups] == [5, 3, 1, 1]
    rises = [rise for group in groups for rise in (group["from_rise"], group["to_rise"])]
    assert rises == sorted(rises) and rises[-1] < 0.51  # as hard as the family is plucked
    assert sum(group["share"] for group in groups) == pytest.approx(1)
    assert all(0 < group["largest"] <= group["share"] for group in groups)
    first = found["held_out"]["partials"][0]["modes"][0]
    assert first["frequency_hz"] == pytest.approx(330, abs=5)
    assert first["glide_cents"] > 1
    assert all(first[name] < 0.01 for name in ("level_db", "cents", "t60_error_percent", "glide_error_cents"))
    other = facts_of(run, f"{many} --rate 8000 --modes 5 --held-out 11")
    assert (other["rate_hz"], other["held_out"]["trajectories"]) == (8_000, 11)  # the preset's own string
    beyond = run(f"{many} --string piano_c2 --modes 5 --rate 8000").err
    assert "decay time near 3 kHz 8.02 s is outside the trained 0.1 … 1 s" in beyond
    assert "decay time 27.6" not in beyond  # of the first mode: the error does not grow with it


def test_heard_differences_are_printed_and_kept(run, tiny, monkeypatch):
    reported = run("evaluate {tiny} --heard")
    assert reported.status == 0 and "tiny" in reported.out and "spectra dB" in reported.out
    assert read_heard(tiny.parent) == ({}, [])
    (tiny.parent / "broken.safetensors").write_bytes(b"not a preset")
    monkeypatch.setattr("engine.presets.finding.SHIPPED", tiny.parent)
    reported = run("evaluate --heard --all --write --json")
    assert reported.status == 0
    (facts,) = json.loads(reported.out)
    ((digest, kept),) = read_heard(tiny.parent)[0].items()
    assert (facts["name"], facts["heard"], digest) == ("tiny", heard_word(kept), preset_digest(tiny))
    assert facts["distance_db"] == pytest.approx(kept.distance_db, abs=1e-3)
    assert kept.level_db == pytest.approx(-1.0, abs=0.3)  # its own decay is a tenth faster than 2.9 dB a second
    assert "broken.safetensors: not a whole safetensors file" in reported.err


def test_errors_on_strings_of_a_family_are_by_rise_of_tension(run):
    facts = facts_of(run, "family evaluate studio_any_string --strings 2 --rate 8000")
    for column in ("inside", "beyond"):
        parts = facts[column]["studio_any_string"]["by_rise"]
        assert sum(part["strings"] for part in parts) == 2
        assert all(0 < part["geometric_mean"] <= 1.001 * part["worst"] for part in parts)
    out = run("family evaluate studio_any_string --strings 1 --tenth 1 --baselines --rate 4000 --seed 2").out
    assert out.count("rise of tension") == 2 and "1 strings still sound: -, worst -; - times their first" in out
    assert (
        float(re.findall(r"tenth second, 1 of 1 strings still sound: (\S+), worst \S+; [\d.]+ times", out)[0]) < 1e-9
    )
    means = {who: float(mean) for who, mean in re.findall(r"(?m)^  (any\w+|[a-z].*?)   +([\d.e-]+) ", out)}
    untrained = ["backward error analysis (1/12)", "kicks without corrections", "averaging", "linear string"]
    assert sorted(means, key=lambda who: means[who]) == ["studio_any_string", *untrained]


def test_errors_on_drums_are_printed_and_measured_once(run):
    evaluate = "family evaluate studio_any_string --drums 1 --tenth 1 --rate 4000 --runs {folder}"
    out, players = run(evaluate).out, facts_of(run, evaluate)["players"]  # the second continues where the first ended
    for player in players:
        for figure in ("geometric_mean", "processor_s", "tenth_worst", "tenth_first"):
            assert re.search(rf"(?m)^  {re.escape(player['player'])} .* {player[figure]:.4g} ", out)
    assert players[0]["worst"] < 1e-10 < players[2]["worst"] < 1e-6 < 1 < players[3]["worst"]
    assert "tenth second, 1 of 1 drums of long decays still sound" in out
