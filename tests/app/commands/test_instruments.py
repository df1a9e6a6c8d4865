"""The command that lists instruments."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from app.patches.library import SHIPPED, find_patch
from app.shared.parameters import OF_PATCHES


def test_factory_instruments_are_listed(run) -> None:
    found = run("instruments", "--json")
    assert found.status == 0 and found.err == ""
    listed = json.loads(found.out)
    assert {each["file"] for each in listed} == {str(path) for path in SHIPPED.glob("*.json")}
    table = run("instruments").out
    for each in listed:
        assert set(each) == {"name", "title", "category", "own", "description", "file"} and not each["own"]
        assert each["name"] in table and each["title"] in table


def test_an_instruments_parameters_are_listed_with_its_values(run) -> None:
    own = find_patch("classical_guitar").patch
    listed = {each["id"]: each for each in json.loads(run("instruments", "classical_guitar", "--json").out)}
    assert set(listed) == {id for id in OF_PATCHES if own.has(id)}
    for id, each in listed.items():
        parameter = OF_PATCHES[id]
        assert each == {
            "id": id,
            "name": parameter.name,
            "unit": parameter.unit,
            "value": own.value(id),
            "lowest": parameter.limits[0],
            "highest": parameter.limits[1],
            "default": parameter.default,
        }
    assert "damping.release_t60_s" in run("instruments", "classical_guitar").out
    assert "did you mean classical_guitar" in run("instruments", "clasical_guitar").failure


def test_a_broken_instrument_is_reported_and_hides_no_other(
    run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(tmp_path))
    own = tmp_path / "patches"
    own.mkdir()
    some = json.loads(next(SHIPPED.glob("*.json")).read_text(encoding="utf-8"))
    (own / "mine.json").write_text(json.dumps({**some, "name": "Mine"}))
    (own / "broken.json").write_text("{")
    found = run("instruments", "--json")
    assert found.status == 0
    assert found.err.startswith(f"learned-strings: {own / 'broken.json'}: not JSON") and found.err.count("\n") == 1
    (mine,) = (each for each in json.loads(found.out) if each["own"])
    assert (mine["name"], mine["title"]) == ("mine", "Mine")
