"""Plug-ins under random events, in a host in C that counts allocations while they play."""

from __future__ import annotations

import json
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from app.export.plugin import build
from app.export.plugin.image import Image
from tests.app.export.plugin.pieces import LONG, MOVED, NAMES

SECONDS = 600 if LONG else 8  # of sound

pytestmark = [
    pytest.mark.skipif(find_spec("ziglang") is None, reason="needs ziglang, the extra [plugin]"),
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="counts allocations as GNU libc has them"),
]


@pytest.fixture(scope="module")
def attack(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The host, compiled."""
    path = tmp_path_factory.mktemp("attack") / "attack"
    headers = Path(build.__file__).parent / "shell"
    command = [sys.executable, "-m", "ziglang", "cc", "-O2", "-std=gnu23", "-rdynamic", f"-I{headers}", "-o", path]
    subprocess.run([*command, Path(__file__).with_name("attack.c"), "-ldl", "-lm"], check=True)
    return path


@pytest.mark.parametrize(
    "name", (MOVED, "fretless_bass", "concert_harp", "timpani") if LONG else (MOVED, "fretless_bass")
)
def test_nothing_random_does_harm_or_allocates(
    attack: Path, plugin_file: Path, images: list[Image], name: str
) -> None:
    id = images[NAMES.index(name)].id
    command = [attack, plugin_file, id, str(SECONDS), "3"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found.pop("seconds") >= SECONDS
    assert found.pop("blocks") > SECONDS
    assert 0.1 < found.pop("peak") <= 1.0
    assert found == {"wild": 0, "refused": 0, "allocations": 0}
