"""Data and runs that are small enough for a test."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from training.configuration import DatasetConfiguration, Run, TrainingConfiguration
from training.data.dataset import Dataset, load_dataset
from training.fitting.fit import Diverged, FitProgress, FitResult, fit_seeds
from training.results import Row

DATA = {"count": 20, "steps": 450, "modes": 5}  # what a cell's data must have to be the small ones


@pytest.fixture(scope="session")
def small_dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """20 strings of 5 modes at 4 kHz over 450 frames, tension-modulated."""
    configuration = DatasetConfiguration("gaussian", 4000, 5, steps=450, count=20)
    return load_dataset(configuration, tmp_path_factory.mktemp("cache"))


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    return tmp_path / "runs"


def fit(
    configuration: TrainingConfiguration,
    dataset: Dataset,
    folder: Path,
    report: Callable[[FitProgress], None] = lambda progress: None,
    **options: Any,
) -> FitResult:
    """Train or continue one run alone; raise Diverged where it diverges."""
    run = Run(folder.name, "", configuration)
    (outcome,) = fit_seeds([run], dataset, folder.parent, report=lambda _, progress: report(progress), **options)
    if isinstance(outcome, Diverged):
        raise outcome
    return outcome


def row(digest: str = "a", name: str = "", **changes: Any) -> Row:
    fields = {"status": "done", "model": "koopman", "string": "linear", "initial": "noise", "rate_hz": 4000}
    fields |= {"horizon": 400, "recipe": "ours", "seed": 0, "rel_mae": 0.125, "finished": "2026-01-01T00:00:00Z"}
    return Row(digest, name or f"run_{digest}", **(fields | changes))
