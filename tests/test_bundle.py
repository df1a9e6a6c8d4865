"""The bundle of `python3 run.py bundle`: it starts without Python, and sounds as the source does."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import soundfile

from app.commands import cli

ROOT = Path(__file__).parents[1]
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the bundle was tried on Linux alone")
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


def run(program: Path, *words: str, folder: Path, status: int = 0) -> str:
    """The errors of the bundle's program in an environment without anything of Python's."""
    environment = {"PATH": "", "HOME": str(folder), "QT_QPA_PLATFORM": "offscreen", "LANG": "C.UTF-8"}
    done = subprocess.run([program, *words], cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == status, done.stderr
    return done.stderr


def test_its_command_line_renders_the_same_note(program, tmp_path):
    run(program, "render", "studio_any_string", "bundle.wav", *NOTE, folder=tmp_path)
    assert cli.main(["render", "studio_any_string", str(tmp_path / "source.wav"), *NOTE]) == 0
    bundle, source = (soundfile.read(tmp_path / f"{name}.wav")[0] for name in ("bundle", "source"))
    np.testing.assert_allclose(bundle, source, atol=2e-5)  # other instructions of the processor round differently


def test_it_finds_its_compiled_kernels_where_it_was_moved(program, tmp_path):
    kernels = program.parent / "_internal/engine/kernels/__pycache__"
    before = {path: path.stat().st_mtime_ns for path in kernels.rglob("*.nb?")}
    run(program, "-P", "-m", "engine.warm", folder=tmp_path)
    assert before
    assert {path: path.stat().st_mtime_ns for path in kernels.rglob("*.nb?")} == before


def test_its_window_opens_and_it_says_that_it_builds_no_plugins(program, tmp_path):
    run(program, "-P", "-c", WINDOW, folder=tmp_path)
    assert list(tmp_path.rglob("settings.json"))
    assert "start the program with Python" in run(program, "plugin", "concert_harp", folder=tmp_path, status=1)
