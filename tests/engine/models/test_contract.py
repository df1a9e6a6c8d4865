"""Every learned string of the registry keeps the laws of `laws.py`."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

from engine.models import MODELS, build_model
from engine.schema import SchemaError
from tests.engine.models.laws import subclasses


def test_every_model_has_its_laws_tested() -> None:
    for path in Path(__file__).parent.glob("test_*.py"):
        importlib.import_module(f"tests.engine.models.{path.stem}")
    assert {kind.name for kind in subclasses() if hasattr(kind, "name")} == MODELS.keys()


def test_sizes_are_checked_by_name() -> None:
    with pytest.raises(SchemaError, match="unknown field 'depht'"):
        build_model("frnn", {"depht": 3})
