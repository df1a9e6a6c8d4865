"""Plug-ins that the tests share: built once."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from app.export.plugin.build import build_plugin
from app.export.plugin.formats import this_target
from app.export.plugin.image import Image, image_of
from engine.kernels import cache
from tests.app.export.plugin.host import Library
from tests.app.export.plugin.pieces import NAMES, instrument_of, preset_of


@pytest.fixture(scope="package")
def images() -> list[Image]:
    return [image_of(instrument_of(name), preset_of(name)) for name in NAMES]


@pytest.fixture(scope="package")
def objects(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where object files are kept."""
    return cache.folder() or tmp_path_factory.mktemp("objects")


@pytest.fixture(scope="package")
def plugin_file(images: list[Image], objects: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = build_plugin(images, "clap", this_target(), tmp_path_factory.mktemp("clap") / "bank", objects)
    assert path.suffix == ".clap"
    return path


@pytest.fixture(scope="package")
def loaded(plugin_file: Path) -> Library:
    return Library(plugin_file)


@pytest.fixture
def bank(loaded: Library) -> Iterator[Library]:
    """Its instances are destroyed after the test, each with its thread."""
    yield loaded
    loaded.destroy_instances()
