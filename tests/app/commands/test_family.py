"""family on the command line: errors on strings of the family."""

from __future__ import annotations

import json


def test_evaluate_has_errors_by_rise_of_tension(run) -> None:
    words = (
        "family",
        "evaluate",
        "studio_any_string",
        "--strings",
        2,
        "--rate",
        8_000,
    )
    found = run(*words, "--json")
    facts = json.loads(found.out)
    for column in ("inside", "beyond"):
        parts = facts[column]["studio_any_string"]["by_rise"]
        assert sum(part["strings"] for part in parts) == 2
        assert all(0 < part["geometric_mean"] <= 1.001 * part["worst"] for part in parts)
    shown = run(*words)
    assert "rise of tension" in shown.out


def test_more_strings_for_the_tenth_second_than_there_are_is_reported_at_once(run) -> None:
    found = run("family", "evaluate", "studio_any_string", "--strings", 1, "--tenth", 2)
    assert "is 2 of 1 strings; give at most as many" in found.usage
