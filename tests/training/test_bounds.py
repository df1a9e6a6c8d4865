"""Plans and configurations that would take for ever are refused when they are read, before data are made."""

import pytest

from engine.schema import SchemaError
from training.cell import load
from training.sweeping.plan import load_plan

CONFIGURATION = """
title = "a run"
model = "koopman_var"
[data]
initial = "gaussian"
rate_hz = 4000
modes = 10
[recipe]
epochs = 1
"""

FAULTS = {
    "impossible sizes": (
        CONFIGURATION + "[model_configuration]\nstate_size = 1_000_000_000\n",
        "state_size must lie in",
    ),
    "unknown size": (CONFIGURATION + "[model_configuration]\ncolour = 3\n", "unknown field 'colour'"),
    "another grid": (
        CONFIGURATION + "[model_configuration]\ngrid_points = 51\n",
        "grid_points is 51, the data's are 101",
    ),
    "unknown start": (CONFIGURATION + 'start = "guess"\n', "start 'guess' is not one of"),
    "too much data": (CONFIGURATION.replace("modes = 10", "modes = 10\ncount = 100_000_000"), "GiB of data"),
    "too many sub-steps": (
        CONFIGURATION.replace("modes = 10", "modes = 10\nsubsteps = 10_000_000"),
        "substeps must lie in",
    ),
    "too many modes": (CONFIGURATION.replace("modes = 10", "modes = 100"), "cannot hold 100 modes"),
    "nested": ("title = " + "[" * 60 + "]" * 60, "nested"),
    "nested for ever": ("title = " + "[" * 30_000 + "]" * 30_000, "recursion"),
    "not UTF-8": ("title = '\udcff'", "not valid TOML"),
    "a long number": (CONFIGURATION.replace("4000", "4" * 5000), "digits"),
}


@pytest.mark.parametrize("kind", FAULTS)
def test_a_configuration_is_refused_by_file_and_field(kind, tmp_path):
    text, message = FAULTS[kind]
    path = tmp_path / "run.toml"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(SchemaError, match=message) as caught:
        load(str(path))
    reported = str(caught.value)
    assert str(path) in reported and len(reported) <= 500 and reported.isprintable()


def test_a_plan_of_sixteen_million_cells_is_refused_before_one_is_made(tmp_path, monkeypatch):
    monkeypatch.setattr("training.sweeping.plan.Cell", None)
    seeds = ", ".join(map(str, range(1000)))
    path = tmp_path / "plan.toml"
    path.write_text(
        f"""description = "all"
[[block]]
models = [{", ".join(['"koopman"'] * 1000)}]
strings = ["linear"]
initials = ["gaussian", "noise"]
rates_hz = [4000, 16000]
horizons = [400, 800, 1600, 4000]
seeds = [{seeds}]
"""
    )
    with pytest.raises(SchemaError, match="a block of 16000000 cells is too large") as caught:
        load_plan(str(path))
    assert str(path) in str(caught.value)
