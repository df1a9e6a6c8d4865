"""Plug-ins that the tests share: built once."""

import functools
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from app.export.plugin.build import build_plugin
from app.export.plugin.formats import this_target
from app.export.plugin.image import Image, image_of
from engine.kernels import cache
from tests.app.export.plugin.host import Library
from tests.app.export.plugin.pieces import NAMES, instrument_of, preset_of


@pytest.fixture(scope="package")
def images() -> dict[str, Image]:
    return {name: image_of(instrument_of(name), preset_of(name)) for name in NAMES}


@pytest.fixture(scope="package")
def objects(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where object files are kept; without the extra [plugin], tests that build are skipped."""
    pytest.importorskip("ziglang")
    return cache.folder() or tmp_path_factory.mktemp("objects")


@pytest.fixture(scope="package")
def built(images: dict[str, Image], objects: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    @functools.cache
    def build(form: str) -> Path:
        return build_plugin(
            [*images.values()], form, this_target(), tmp_path_factory.mktemp(form) / "a bank", objects
        )

    return build


@pytest.fixture(scope="package")
def loaded(built: Callable[[str], Path]) -> Library:
    return Library(built("clap"))


@pytest.fixture
def bank(loaded: Library) -> Iterator[Library]:
    """Its instances are destroyed after the test, each with its thread."""
    yield loaded
    loaded.destroy_instances()
