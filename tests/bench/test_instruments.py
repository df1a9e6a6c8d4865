"""The benchmark of timbre."""

from __future__ import annotations

import json


def test_instruments_are_measured_beside_ranges(run) -> None:
    found = json.loads(run("timbre", "harpsichord", "koto", "--json").out)
    assert set(found["instruments"]) == {"harpsichord", "koto"}
    harpsichord = found["instruments"]["harpsichord"]
    assert harpsichord["figures"]["key"] == 60
    assert harpsichord["ranges"]["centroid_hz"] == [1500, 3000]
    for figure, met in harpsichord["met"].items():
        low, high = harpsichord["ranges"][figure]
        value = harpsichord["figures"][figure]
        assert met == (low <= value and (high is None or value <= high)), figure
    assert list(found["distances_db"]) == ["harpsichord, koto"]
    assert all(each["taken"] for each in found["references"])


def test_an_unknown_instrument_is_named(run) -> None:
    assert "no instrument" in run("timbre", "theremin").err
