"""A plan of runs that are small enough for a test."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from tests.training.conftest import row
from training.configuration import Run
from training.results import Row
from training.sweeping.plan import Plan, load_plan
from training.sweeping.sweep import Options
from training.sweeping.task import Task

PLAN = """
description = "Tiny."
[data]
count = 10
steps = 60
[recipe_fields]
epochs = {epochs}
batch_size = 8
steps_per_batch = 8
first_horizon = 20
validate_every = 4
latent_polish = 0
[[block]]
models = ["koopman_var", "koopman"]
strings = ["nonlinear", "linear"]
initials = ["noise"]
rates_hz = [4000]
horizons = [60]
seeds = [{seeds}]
"""


def plan_in(folder: Path, seeds: str = "0, 1", epochs: int = 4) -> Plan:
    path = folder / "trial.toml"
    path.write_text(PLAN.format(seeds=seeds, epochs=epochs), encoding="utf-8")
    return load_plan(str(path))


@pytest.fixture
def plan(tmp_path: Path) -> Callable[..., Plan]:
    return partial(plan_in, tmp_path)


@pytest.fixture
def options(tmp_path: Path) -> Options:
    return Options(tmp_path / "results.csv", tmp_path / "runs", tmp_path / "cache", "cpu", 1, checkpoint_every_s=0)


@pytest.fixture
def task(plan: Callable[..., Plan], options: Options) -> Task:
    made = plan()
    return options.task(made, made.runs[0])


def row_of(run: Run, **changes: object) -> Row:
    return row(run.digest, run.name, **changes)
