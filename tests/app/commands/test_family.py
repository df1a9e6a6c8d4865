"""family on the command line: errors on strings of the family, their map, and models by others beside them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from training.family import fit_baseline


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
    shown = run(*words)
    assert "rise of tension and inharmonicity B" in shown.out
    assert picture.read_text() == drawn
    assert "choose one of these suffixes" in run(*words[:-4], "--picture", folder / "map.bmp").failure


def test_a_baseline_is_trained_and_stands_beside_the_preset(
    run, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fit_baseline, "FRAMES_VALIDATED", 8)
    few = ("--strings", 1, "--rate", 8_000, "--json")
    words = ("family", "baseline", "koopman_var", "--minutes", 0.01, "--train-strings", 1, "--runs", folder)
    facts = json.loads(run(*words, *few).out)
    assert (facts["baseline"], facts["minutes"]) == ("koopman_var", 0.01)
    beside = json.loads(run("family", "evaluate", "studio_any_string", "--runs", folder, *few).out)
    for column in ("inside", "beyond"):
        error = facts[column]["koopman_var"]["geometric_mean"]
        assert beside[column]["koopman_var, trained"]["geometric_mean"] == error
        assert beside[column]["studio_any_string"]["geometric_mean"] < error
    assert (
        "no baseline was trained here"
        in run("family", "evaluate", "studio_any_string", "--runs", folder / "none", *few).failure
    )
    assert "is not one of koopman_var, dmsp" in run("family", "baseline", "lru").usage
