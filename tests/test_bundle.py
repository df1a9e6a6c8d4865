"""Away from its sources, a bundle of `python3 run.py bundle` and an installed wheel have all that they need."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import soundfile

from app.commands import bundled, cli

ROOT = Path(__file__).parents[1]
LINUX = pytest.mark.skipif(sys.platform != "linux", reason="the bundle was tried on Linux alone")
NOTE = ("--position", "0.3", "--amplitude-mm", "2", "--seconds", "0.5", "--bits", "32f")
WINDOW = """
import sys
from PySide6.QtCore import QTimer
from app.window.main import run

def close_when_playable(controller):
    timer = QTimer(controller, interval=20)
    timer.timeout.connect(lambda: controller.performance.playable and controller.window.close())
    timer.start()

sys.exit(run(alive=close_when_playable))
"""
LISTING = """
import json, sys
sys.path.insert(0, sys.argv[1])
from app.commands import bundled, cli
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


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bundle, made and moved to another place: a few minutes."""
    pytest.importorskip("PyInstaller", reason="PyInstaller is not installed: pip install 'learned-strings[bundle]'")
    made, elsewhere = (tmp_path_factory.mktemp(name) for name in ("made", "elsewhere"))
    options = ("--noconfirm", "--log-level", "ERROR", "--distpath", made, "--workpath", made / "build")
    subprocess.run([sys.executable, "-m", "PyInstaller", *options, "learned-strings.spec"], cwd=ROOT, check=True)
    subprocess.run([made / "learned-strings/learned-strings", "-P", "-m", "engine.warm"], check=True)
    folder = Path(shutil.move(made / "learned-strings", elsewhere))
    return folder / "learned-strings"


def run(*words: object, folder: Path, status: int = 0, environment: dict[str, str] | None = None) -> str:
    """The output of a program, its errors where it fails; in an environment without anything of Python's."""
    bare = {"PATH": "", "HOME": str(folder), "QT_QPA_PLATFORM": "offscreen", "LANG": "C.UTF-8"}
    command = [str(word) for word in words]
    done = subprocess.run(command, cwd=folder, env=environment or bare, capture_output=True, text=True)
    assert done.returncode == status, done.stderr
    return done.stderr if status else done.stdout


@pytest.mark.parametrize(
    ("words", "printed"),
    [
        (["models"], "koopman_tension"),
        (["-P", "-c", "import sys; print(__name__, sys.argv)", "a"], "__main__ ['-c', 'a']"),
        (["-P", "-m", "calendar", "1970", "1"], "January 1970"),
    ],
)
def test_the_start_of_a_bundle_is_the_command_line_or_python(words, printed, capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["learned-strings", *words])
    for name in ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES"):  # which it sets
        monkeypatch.setenv(name, "")
    assert bundled.main() == 0 and printed in capsys.readouterr().out


@LINUX
def test_a_bundle_renders_the_same_note_opens_its_window_and_finds_its_kernels(program, tmp_path):
    kernels = program.parent / "_internal/engine/kernels/__pycache__"
    before = {path: path.stat().st_mtime_ns for path in kernels.rglob("*.nb?")}
    run(program, "render", "studio_any_string", "bundle.wav", *NOTE, folder=tmp_path)
    assert cli.main(["render", "studio_any_string", str(tmp_path / "source.wav"), *NOTE]) == 0
    bundle, source = (soundfile.read(tmp_path / f"{name}.wav")[0] for name in ("bundle", "source"))
    np.testing.assert_allclose(bundle, source, atol=2e-5)  # other instructions of the processor round differently

    run(program, "-P", "-c", WINDOW, folder=tmp_path)
    assert list(tmp_path.rglob("settings.json"))
    assert "start the program with Python" in run(program, "plugin", "concert_harp", folder=tmp_path, status=1)
    run(program, "-P", "-m", "engine.warm", folder=tmp_path)
    assert before and {path: path.stat().st_mtime_ns for path in kernels.rglob("*.nb?")} == before


def test_a_wheel_has_presets_recipes_and_pictures(tmp_path):
    source, installed, elsewhere = (tmp_path / name for name in ("source", "installed", "elsewhere"))
    for name in ("engine", "training", "app", "presets"):
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    elsewhere.mkdir()
    folders = ("LEARNED_STRINGS_RUNS", "LEARNED_STRINGS_CACHE")
    own = {name: value for name, value in os.environ.items() if name not in folders}
    pip = (sys.executable, "-m", "pip", "--disable-pip-version-check", "-q", "install", "--no-build-isolation")
    run(*pip, "--no-deps", "--no-compile", "--target", installed, source, folder=elsewhere, environment=own)
    # the installed package alone: without the development install's paths
    listed = run(sys.executable, "-W", "ignore", "-c", LISTING, installed, folder=elsewhere, environment=own)
    presets, instruments, others = map(json.loads, listed.split("\x1e"))
    shipped = sorted(path.stem for path in (ROOT / "presets").glob("*.safetensors"))
    assert sorted(each["name"] for each in presets) == shipped
    assert {each["name"] for each in instruments} == {
        path.stem for path in (ROOT / "presets/instruments").glob("*.json")
    }
    assert others == ["koopman_integrated", "lru", True]
    assert list(elsewhere.iterdir()) == []
