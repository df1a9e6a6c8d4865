"""Plug-ins that the tests share: built once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.export.plugin.build import build_plugin
from app.export.plugin.formats import this_target
from app.export.plugin.image import Image, image_of
from app.export.plugin.parts import STEPS
from engine.kernels import cache
from engine.kernels.playing_layout import KEYS
from engine.presets import SHIPPED, load_preset
from tests.app.export.plugin.host import Library
from tests.app.export.plugin.pieces import BARS, MOVED, NAMES, patch_of


@pytest.fixture(scope="package")
def images() -> list[Image]:
    """Levels at moved macros take a second per instrument: two have them."""
    found = []
    for name in NAMES:
        patch = patch_of(name)
        with pytest.MonkeyPatch.context() as patched:
            if name not in (MOVED, BARS):
                shape = (len(patch.macros), STEPS, KEYS)
                patched.setattr("app.export.plugin.image.levels", lambda *_, shape=shape: np.zeros(shape))
            found.append(image_of(patch, load_preset(SHIPPED / f"{patch.preset}.safetensors")))
    return found


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
def bank(plugin_file: Path) -> Library:
    return Library(plugin_file)
