"""family on the command line: errors on strings of the family, and their picture."""

from __future__ import annotations

import json
from pathlib import Path


def test_evaluate_draws_the_errors(run, folder: Path) -> None:
    picture = folder / "map.svg"
    words = (
        "family",
        "evaluate",
        "studio_any_string",
        "--strings",
        2,
        "--picture",
        picture,
        "--rate",
        8_000,
    )
    found = run(*words, "--json")
    facts = json.loads(found.out)
    for column in ("inside", "beyond"):
        parts = facts[column]["studio_any_string"]["by_rise"]
        assert sum(part["strings"] for part in parts) == 2
        assert all(0 < part["geometric_mean"] <= 1.001 * part["worst"] for part in parts)
    drawn = picture.read_text()
    assert "studio_any_string: 4 strings" in drawn
    assert "beyond the family" in drawn
    shown = run(*words)
    assert "rise of tension" in shown.out
    assert picture.read_text() == drawn
    assert "choose one of these suffixes" in run(*words[:-4], "--picture", folder / "map.bmp").failure


def test_more_strings_for_the_tenth_second_than_there_are_is_reported_at_once(run) -> None:
    found = run("family", "evaluate", "studio_any_string", "--strings", 1, "--tenth", 2)
    assert "is 2 of 1 strings; give at most as many" in found.usage
