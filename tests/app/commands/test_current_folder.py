"""Files in the current folder that are named as modules are never run: not by a command, not by its processes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from engine.python_process import python_command, python_environment

ROOT = str(Path(__file__).parents[3])
PROJECT = ("app", "engine", "training", "presets", "run")
USED = ("ziglang", "numba", "llvmlite", "numpy", "scipy", "torch", "mido", "soundfile", "typer", "click", "psutil")
LIBRARY = ("json", "pickle", "socket", "struct", "tempfile", "subprocess", "runpy", "signal", "random", "threading")
SHADOW = "import pathlib\npathlib.Path(__file__).with_suffix('.ran').touch()\nraise SystemExit('shadowed')\n"

TEXTS = """
from pathlib import Path
from app.export.plugin import objects
try:
    objects._run("app.export.plugin.texts", [["no part", "x"]], 1, lambda share: None)
except objects.ObjectError as error:
    print("failed", error)
"""
LINKING = """
from pathlib import Path
from app.export.plugin import build
try:
    build._link(Path.cwd(), (), (), "linux-x64", Path("library"), lambda: None)
except build.PluginError as error:
    print(error)
"""
WARMING = """
from engine import warm
from engine.kernels import cache
warm.os.cpu_count = lambda: 2
with warm._beside("os.getpid") as process:  # a function that compiles nothing
    process.wait()
print(process.returncode)
"""
SWEEPING = """
from training.sweeping.processes import Layout, process_workers
if __name__ == "__main__":
    with process_workers(Layout("cpu", 1, ({},))) as workers:
        print(workers.submit({}).result(300.0))
"""
CHILDREN = {
    "plugin: the kernels' code": (TEXTS, "failed the kernels cannot be compiled: KeyError: 'no part'"),
    "plugin: the compiler": (LINKING, "linking for linux-x64 failed: zig: error:"),
    "warm": (WARMING, "0"),
    "sweep": (SWEEPING, "{'rows': [], 'error': "),
}
COMMANDS = (
    ("presets",),
    ("models",),
    ("instruments",),
    ("info", "no such file.safetensors"),
    ("plugin", "concert_harp", "--dry-run"),
    ("play", "no such file.mid", "--out", "x.wav"),
    ("render", "no such preset", "x.wav"),
    ("learn", "no such file.wav"),
    ("sampled", "concert_harp", "x.sfz", "--size-only"),
    ("simulate", "--help"),
    ("predict", "--help"),
    ("compare", "--help"),
    ("train", "no such configuration"),
    ("sweep", "no such plan"),
    ("evaluate", "--help"),
    ("table", "--help"),
    ("results", "--help"),
    ("family", "--help"),
    ("drums", "--help"),
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in (*PROJECT, *USED, *LIBRARY):
        (tmp_path / f"{name}.py").write_text(SHADOW, encoding="utf-8")
    return tmp_path


def started_in(folder: Path, code: str) -> subprocess.CompletedProcess[str]:
    """As the installed command starts: the current folder is not on its path."""
    script = folder.with_name(f"{folder.name}-script.py")  # a worker of `multiprocessing` reads it again
    script.write_text(code, encoding="utf-8")
    places = [path for path in sys.path if path and Path(path).is_absolute()]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(dict.fromkeys([ROOT, *places]))}
    return subprocess.run(
        [sys.executable, script], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize("child", CHILDREN)
def test_processes_of_commands_run_nothing_of_the_current_folder(folder: Path, child: str) -> None:
    code, wanted = CHILDREN[child]
    done = started_in(folder, code)
    assert not sorted(path.name for path in folder.glob("**/*.ran"))
    assert done.stdout.startswith(wanted), done.stderr


def test_commands_run_nothing_of_the_current_folder(folder: Path) -> None:
    words = f"for words in {COMMANDS!r}:\n    main(words)\n"
    done = started_in(folder, f"from app.commands.cli import main\n{words}print('all')\n")
    assert not sorted(path.name for path in folder.glob("**/*.ran"))
    assert done.stdout.endswith("all\n"), done.stderr


def test_a_process_finds_code_where_this_one_does(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Also after `python -m`, which puts the current folder on the path, and for a folder of the user's own."""
    own, current = tmp_path / "own", tmp_path / "current"
    for each in (own, current):
        each.mkdir()
    (own / "of_the_user.py").write_text("", encoding="utf-8")
    monkeypatch.chdir(current)
    monkeypatch.setattr(sys, "path", [str(current), "", ".", *sys.path, str(own)])
    code = "import sys, app, engine, of_the_user; print(app.__file__); print(*sys.path, sep='\\n')"
    done = subprocess.run(
        python_command("-c", code), env=python_environment(), capture_output=True, text=True, check=True
    )
    found, *places = done.stdout.splitlines()
    assert Path(found).parents[1] == Path(ROOT)
    assert str(own) in places and not {str(current), "", "."} & set(places)
