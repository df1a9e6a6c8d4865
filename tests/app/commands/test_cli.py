"""The program's own behaviour: help, files that open in the app, failures, progress, the current folder."""

import json
import os
import re
import subprocess
import sys
import types
from pathlib import Path
from typing import Any

import pytest
import typer

from app.commands import cli, render
from app.export.sound import SOURCES
from app.shared.vocabulary import BITS
from engine.python_process import python_command, python_environment
from engine.values.ear import PICKUPS
from training.cli import console

ROOT = Path(__file__).parents[3]


def python(code: str, **variables: str) -> subprocess.CompletedProcess[str]:
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("OMP_", "GOMP_"))}
    command = [sys.executable, "-c", code]
    return subprocess.run(command, cwd=ROOT, env={**environment, **variables}, capture_output=True, text=True)


def test_help_needs_none_of_the_heavy_imports():
    done = python(
        "import sys; from app.commands.cli import main; status = main(['--help'])\n"
        "assert not {'torch', 'numpy', 'scipy', 'numba', 'soundfile', 'PySide6'} & set(sys.modules)\n"
        "sys.exit(status)"
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_commands_need_neither_window_nor_sound_packages_and_sleep_while_they_wait():
    """OpenMP spins for no turns; pydantic is needed: newer versions of typer themselves need it."""
    done = python(
        "import sys\n"
        "for name in ('PySide6', 'pyqtgraph', 'sounddevice', 'soundfile', 'psygnal'):\n"
        "    sys.modules[name] = None\n"
        "from app.commands.cli import main\n"
        "assert main(['models', '--json']) == 0\n"
        "import app.commands.arrays, training.run\n"
        "pluck = ['--position', '.5', '--amplitude-mm', '1', '--seconds', '1']\n"
        "sys.exit(main(['render', 'x', 'y.wav', *pluck]))",
        OMP_DISPLAY_ENV="VERBOSE",
    )
    assert done.returncode == 1
    assert '"parameters": 134885' in done.stdout
    (reported,) = [line for line in done.stderr.splitlines() if line.startswith("learned-strings")]
    assert reported.startswith("learned-strings: this needs soundfile, which cannot be imported")
    assert sys.platform != "linux" or "GOMP_SPINCOUNT = '0'" in done.stderr


def test_help_cuts_no_summary(run, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    listed = {name: run(f"{name} --help").out for name in ("", "render", "family", "drums")}
    assert all("Usage: learned-strings" in text for text in listed.values())
    for command in typer.main.get_command(cli.cli).commands:  # type: ignore[attr-defined]
        assert f"\n  {command} " in listed[""]
    for name in ("family", "drums"):
        lines = listed[name].partition("Commands:")[2].strip().splitlines()
        assert all(line.endswith(".") and not line.endswith("...") for line in lines)


def test_files_open_in_the_app_and_a_command_wins_over_a_file_of_its_name(run, monkeypatch, folder):
    opened: list[list[Path]] = []
    main = types.SimpleNamespace(run=lambda files=(): opened.append(list(files)) or 3)  # it ends with status 3
    monkeypatch.setitem(sys.modules, "app.window.main", main)  # type: ignore[arg-type]
    monkeypatch.chdir(folder)
    for name in ("song.mid", "models"):
        Path(name).touch()
    assert [run(line).status for line in ("", "song.mid ./models", "models")] == [3, 3, 0]
    assert opened == [[], [folder / "song.mid", folder / "models"]]
    absent = run("song.mid gone.wav")
    assert (absent.status, absent.err) == (2, "learned-strings: gone.wav: no such file; check the name\n")
    assert len(opened) == 2
    assert run("--version").out.strip()


def test_a_failure_is_one_line_and_an_interruption_status_130(run, monkeypatch):
    errors: list[BaseException] = [ValueError("first\nsecond"), ValueError("again"), KeyboardInterrupt()]

    def fail() -> int:
        raise errors.pop(0)

    monkeypatch.setitem(sys.modules, "app.window.main", types.SimpleNamespace(run=fail))  # type: ignore[arg-type]
    assert run("").failure == "learned-strings: first second"
    monkeypatch.setenv(cli.DEBUG_VARIABLE, "1")
    shown = run("")
    assert shown.status == 1 and "Traceback" in shown.err
    assert run("").status == 130


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (ModuleNotFoundError("No module named 'mido'", name="mido"), "this needs mido, which cannot be imported"),
        (PermissionError(13, "Permission denied", "/x/y"), "/x/y: Permission denied; check the path"),
        (OSError(28, "No space left on device", "/x"), "/x: cannot be written (No space left on device); free some"),
        (OSError("/x/y: cannot be written; free some space"), "/x/y: cannot be written; free some space"),
        (MemoryError(), "not enough memory"),
        (KeyError("z"), "internal error: KeyError 'z'; set LEARNED_STRINGS_DEBUG=1"),
        (RuntimeError(), "internal error: RuntimeError"),
        (RuntimeError("DOP853 failed"), "DOP853 failed"),
    ],
)
def test_a_failure_names_what_and_the_remedy(error, expected):
    assert cli.describe(error).startswith(expected)


def test_choices_that_are_known_without_soundfile_are_its_own():
    assert (render.Bits.__args__, render.Source.__args__, render.Pickup.__args__) == (BITS, SOURCES, PICKUPS)


def test_progress_is_lines_or_a_bar(monkeypatch, capsys):
    now_s = 0.0
    with monkeypatch.context() as instrumented:
        instrumented.setattr(console.time, "monotonic", lambda: now_s)
        with console.progress("work") as report:
            for now_s in range(31):
                report(now_s / 60, f"step {now_s}")
    assert capsys.readouterr().err.splitlines() == [
        "learned-strings: work: 17%, 50 s left step 10",
        "learned-strings: work: 33%, 40 s left step 20",
        "learned-strings: work: 50%, 30 s left step 30",
    ]
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    monkeypatch.setenv("COLUMNS", "150")
    with console.progress("[/b].mid by [red]") as report:
        report(0.5, "[/i]", left_s=90)
    found = capsys.readouterr()
    assert found.out == "" and all(words in found.err for words in ("[/b].mid by [red]", "1 min 30 s left", "[/i]"))


def test_json_is_valid_and_a_table_keeps_a_long_cell(capsys):
    console.print_json({"a": [float("inf"), float("nan"), 1.5], "b": (1, None)})
    assert json.loads(capsys.readouterr().out) == {"a": [None, None, 1.5], "b": [1, None]}
    console.print_table(("a", "b"), [("x" * 300, 1234.5678), ("y", None)])
    lines = capsys.readouterr().out.splitlines()
    assert any("x" * 300 in line and "1235" in line for line in lines)
    assert any("y" in line and "-" in line for line in lines)


# Files in the current folder that are named as modules are never run: not by a command, not by its processes.

MODULES = """app engine training presets run ziglang numba llvmlite numpy scipy torch mido soundfile typer click
psutil json pickle socket struct tempfile subprocess runpy signal random threading"""
SHADOW = "import pathlib\npathlib.Path(__file__).with_suffix('.ran').touch()\nraise SystemExit('shadowed')\n"
CHILDREN = """
import subprocess, sys
from app.commands.cli import main
from engine.python_process import python_command, python_environment
from training.sweeping.processes import Layout, process_workers
if __name__ == "__main__":
    for words in ("presets", "instruments", "play none.mid --out x.wav", "learn none.wav", "train none"):
        main(words.split())
    subprocess.run(python_command("-m", "ziglang", "version"), env=python_environment(), stdin=subprocess.DEVNULL)
    with process_workers(Layout("cpu", 1, ({},))) as workers:
        print(workers.submit({}).result(300.0))
"""


def test_commands_and_their_processes_run_nothing_of_the_current_folder(tmp_path):
    """As the installed command starts: the current folder is not on its path."""
    (folder := tmp_path / "current").mkdir()
    for name in MODULES.split():
        (folder / f"{name}.py").write_text(SHADOW, encoding="utf-8")
    script = tmp_path / "script.py"  # a worker of `multiprocessing` reads it again
    script.write_text(CHILDREN, encoding="utf-8")
    places = [path for path in sys.path if path and Path(path).is_absolute()]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(dict.fromkeys([str(ROOT), *places]))}
    done = subprocess.run([sys.executable, script], cwd=folder, env=environment, capture_output=True, text=True)
    assert not sorted(path.name for path in folder.glob("**/*.ran"))
    assert done.stdout.splitlines()[-1].startswith("{'rows': [], 'error': "), done.stderr


def test_every_process_leaves_the_current_folder_out(monkeypatch, tmp_path):
    """Also after `python -m`, which puts the current folder on the path, and for a folder of the user's own."""
    product = [path for name in ("app", "engine", "training") for path in (ROOT / name).rglob("*.py")]
    starting = re.compile(r"[(\[]\s*sys\.executable")
    starters = {path.name for path in product if starting.search(path.read_text(encoding="utf-8"))}
    assert starters == {"python_process.py"}
    own, current = tmp_path / "own", tmp_path / "current"
    for each in (own, current):
        each.mkdir()
    (own / "of_the_user.py").write_text("", encoding="utf-8")
    monkeypatch.chdir(current)
    monkeypatch.setattr(sys, "path", [str(current), "", ".", *sys.path, str(own)])
    code = "import sys, app, engine, of_the_user; print(app.__file__); print(*sys.path, sep='\\n')"
    options: dict[str, Any] = {"env": python_environment(), "capture_output": True, "text": True, "check": True}
    found, *places = subprocess.run(python_command("-c", code), **options).stdout.splitlines()
    assert Path(found).parents[1] == ROOT
    assert str(own) in places and not {str(current), "", "."} & set(places)
