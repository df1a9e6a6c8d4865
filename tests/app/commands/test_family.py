"""family on the command line: errors on strings of the family, their map, and models by others beside them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from training.cli.console import number
from training.research import fit_baseline


def test_evaluate_tells_the_map_and_draws_it(run, folder: Path) -> None:
    picture = folder / "map.svg"
    words = (
        "family",
        "evaluate",
        "studio_any_string",
        "--strings",
        2,
        "--map",
        "--picture",
        picture,
        "--rate",
        8_000,
    )
    found = run(*words, "--json")
    facts = json.loads(found.out)
    assert sum(cell["strings"] for cell in facts["map"]) == 4
    assert all(0 < cell["geometric_mean"] <= 1.001 * cell["worst"] for cell in facts["map"])
    drawn = picture.read_text()
    assert "studio_any_string: 4 strings" in drawn
    assert "beyond the family" in drawn
    shown = run(*words)
    assert "rise of tension and inharmonicity B" in shown.out
    assert picture.read_text() == drawn
    assert "choose one of these suffixes" in run(*words[:-4], "--picture", folder / "map.bmp").failure


def test_partials_over_the_family(run) -> None:
    words = ("family", "partials", "studio_any_string", "--strings", 2, "--seconds", 0.25, "--rate", 8_000)
    found = json.loads(run(*words, "--json").out)
    for column in ("inside", "beyond"):
        assert found[column]["quiet_first_cents"]["worst"] < 1e-4
        assert found[column]["quiet_first_cents"]["worst"] <= found[column]["quiet_cents_largest"]["worst"]
        for name in ("quiet_cents", "level_db", "t60_percent", "glide_cents"):
            mean, largest = (found[column][f"{name}_{kind}"] for kind in ("mean", "largest"))
            assert 0 < mean["median"] < mean["worst"] <= largest["worst"] < 1
            assert "Hz, B " in mean["worst_at"]
    shown = run(*words)
    assert "quiet pluck, the first mode's pitch, cents" in shown.out
    assert shown.out.count("glide of any, cents") == 2
    assert "must lie in 0.25 … 10 s" in run(*words[:5], "--seconds", 0.1).usage
    assert "learned one string" in run("family", "partials", "studio_steel_e4").failure


def test_a_baseline_is_trained_and_stands_beside_the_preset(
    run, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fit_baseline, "FRAMES_VALIDATED", 8)
    few = ("--strings", 1, "--rate", 8_000, "--json")
    words = ("family", "baseline", "koopman_var", "--minutes", 0.01, "--train-strings", 1, "--runs", folder)
    facts = json.loads(run(*words, *few).out)
    assert (facts["baseline"], facts["minutes"]) == ("koopman_var", 0.01)
    assert facts["parameters"] == 156_259
    assert all(facts[name] > 0 for name in ("steps", "train", "validation"))
    told = run(*words, *few[:-1]).out  # the training is at its end
    assert told.startswith(f"koopman_var: 156,259 numbers, {facts['steps']:,} steps of 16 strings and 48 frames")
    assert f"{number(facts['train'])} in training, {number(facts['validation'])} in validation" in told
    beside = json.loads(run("family", "evaluate", "studio_any_string", "--runs", folder, *few).out)
    for column in ("inside", "beyond"):
        error = facts[column]["koopman_var"]["geometric_mean"]
        assert beside[column]["koopman_var, trained"]["geometric_mean"] == error
        assert beside[column]["studio_any_string"]["geometric_mean"] < error
    checkpoint = folder / "family_koopman_var" / "checkpoint.safetensors"
    checkpoint.write_bytes(checkpoint.read_bytes()[:1000])
    for damaged in (words, ("family", "evaluate", "studio_any_string", "--runs", folder)):
        failure = run(*damaged, *few).failure
        assert f"{checkpoint}: damaged checkpoint" in failure
        assert "delete it to start the run again" in failure
    assert (
        "no baseline was trained here"
        in run("family", "evaluate", "studio_any_string", "--runs", folder / "none", *few).failure
    )
    assert "is not one of koopman_var, dmsp" in run("family", "baseline", "lru").usage


def test_more_strings_for_the_tenth_second_than_there_are_is_told_at_once(run) -> None:
    found = run("family", "evaluate", "studio_any_string", "--strings", 1, "--tenth", 2)
    assert "is 2 of 1 strings; give at most as many" in found.usage
