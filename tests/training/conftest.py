"""Data and runs that are small enough for a test."""

from pathlib import Path

import pytest

from training.configuration import DatasetConfiguration
from training.data.dataset import Dataset, load_dataset


@pytest.fixture(scope="session")
def small_dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """20 strings of 5 modes at 4 kHz over 450 frames, tension-modulated."""
    configuration = DatasetConfiguration("gaussian", 4000, 5, steps=450, count=20)
    return load_dataset(configuration, tmp_path_factory.mktemp("cache"))


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    return tmp_path / "runs"
