"""A run trained alone."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from training.configuration import TrainingConfiguration
from training.data.dataset import Dataset
from training.fitting.fit import Diverged, FitProgress, FitResult, Seed, fit_seeds


def fit(
    configuration: TrainingConfiguration,
    dataset: Dataset,
    folder: Path,
    report: Callable[[FitProgress], None] = lambda progress: None,
    **options: Any,
) -> FitResult:
    """Train or continue one run; raise Diverged where it diverges."""
    (outcome,) = fit_seeds([Seed(configuration, folder, report)], dataset, **options)
    if isinstance(outcome, Diverged):
        raise outcome
    return outcome
