"""A copy of the small preset that a test may damage, its model, and the laws of motion of each variant."""

import shutil
from pathlib import Path

import pytest


@pytest.fixture
def preset_file(small_preset: Path, tmp_path: Path) -> Path:
    return Path(shutil.copy(small_preset, tmp_path))


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """The laws of motion hold for every variant of a model's sizes."""
    if "motion" in metafunc.fixturenames and metafunc.cls is not None:
        metafunc.parametrize("motion", metafunc.cls.variants, indirect=True, scope="class", ids=str)
