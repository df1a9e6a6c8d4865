"""A copy of the small preset that a test may damage."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from engine.models import KoopmanVar
from engine.preset import load_preset


@pytest.fixture
def preset_file(small_preset: Path, tmp_path: Path) -> Path:
    return Path(shutil.copy(small_preset, tmp_path))


@pytest.fixture
def model(small_preset: Path) -> KoopmanVar:
    model = load_preset(small_preset).model
    assert isinstance(model, KoopmanVar)
    return model
