"""A run trained alone."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from training.configuration import Run, TrainingConfiguration
from training.data.dataset import Dataset
from training.fitting.fit import Diverged, FitProgress, FitResult, fit_seeds


def fit(
    configuration: TrainingConfiguration,
    dataset: Dataset,
    folder: Path,
    report: Callable[[FitProgress], None] = lambda progress: None,
    **options: Any,
) -> FitResult:
    """Train or continue one run; raise Diverged where it diverges."""
    run = Run(folder.name, "", configuration)
    (outcome,) = fit_seeds([run], dataset, folder.parent, report=lambda _, progress: report(progress), **options)
    if isinstance(outcome, Diverged):
        raise outcome
    return outcome
