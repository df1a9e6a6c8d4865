"""What `pip install .` gives: an installed package, away from its sources, has all that it needs."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
LISTING = """
import json, sys
sys.path.insert(0, sys.argv[1])
from app.commands import cli
assert cli.__file__.startswith(sys.path[0])
for name in ("presets", "instruments"):
    assert cli.main([name, "--json"]) == 0
    print("\x1e")
from app.views.theme import SIGNS
from training.cell import load
from training.data.dataset import default_cache
from training.run import default_runs
assert not any(folder.is_relative_to(sys.path[0]) for folder in (default_runs(), default_cache()))
print(json.dumps([load("studio_nylon_b3").model, load("nylon_linear_noise_4k_lru").model, SIGNS.is_dir()]))
"""


def run(*command: object, folder: Path, **variables: str) -> str:
    folders = ("LEARNED_STRINGS_RUNS", "LEARNED_STRINGS_CACHE")
    environment = {name: value for name, value in os.environ.items() if name not in folders} | variables
    words = [str(part) for part in command]
    done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_wheel_has_presets_recipes_and_pictures(tmp_path):
    source, installed, elsewhere = (tmp_path / name for name in ("source", "installed", "elsewhere"))
    for name in ("engine", "training", "app", "presets"):
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    elsewhere.mkdir()
    pip = (sys.executable, "-m", "pip", "--disable-pip-version-check", "-q", "install", "--no-build-isolation")
    run(*pip, "--no-deps", "--no-compile", "--target", installed, source, folder=elsewhere)
    # the installed package alone: without the development install's paths
    command = (sys.executable, "-W", "ignore", "-c", LISTING, installed)
    presets, instruments, others = map(json.loads, run(*command, folder=elsewhere).split("\x1e"))
    shipped = sorted(path.stem for path in (ROOT / "presets").glob("*.safetensors"))
    assert sorted(each["name"] for each in presets) == shipped
    assert {each["name"] for each in instruments} == {
        path.stem for path in (ROOT / "presets/instruments").glob("*.json")
    }
    assert others == ["koopman_integrated", "lru", True]
    assert list(elsewhere.iterdir()) == []
