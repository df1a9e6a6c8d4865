"""A plan of runs that are small enough for a test."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from training.sweeping.plan import Plan, load_plan
from training.sweeping.sweep import Options
from training.sweeping.workers.base import Task

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
{more}

[[block]]
models = ["koopman_var", "koopman"]
strings = ["nonlinear", "linear"]
initials = ["noise"]
rates_hz = [4000]
horizons = [60]
seeds = [{seeds}]
"""


@pytest.fixture
def plan(tmp_path: Path) -> Callable[..., Plan]:
    def make(seeds: str = "0, 1", epochs: int = 4, more: str = "") -> Plan:
        path = tmp_path / "trial.toml"
        path.write_text(PLAN.format(seeds=seeds, epochs=epochs, more=more), encoding="utf-8")
        return load_plan(str(path))

    return make


@pytest.fixture
def options(tmp_path: Path) -> Options:
    return Options(tmp_path / "results.csv", tmp_path / "runs", tmp_path / "cache", "cpu", 1, checkpoint_every_s=0)


@pytest.fixture
def task(plan, options: Options) -> Task:
    made = plan()
    return options.task(made, made.runs[0])
