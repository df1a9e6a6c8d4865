from __future__ import annotations

import os
import subprocess
import sys
import types
from pathlib import Path

import pytest
import typer

from app.commands import cli, render
from app.export.sound import SOURCES
from app.shared.vocabulary import BITS
from engine.values.ear import PICKUPS
from training.cli import arguments

ROOT = Path(__file__).parents[3]
COMMANDS = [
    "presets",
    "models",
    "simulate",
    "predict",
    "render",
    "info",
    "sampled",
    "compare",
    "train",
    "evaluate",
]


def python(code: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)


def test_help_is_there_without_the_heavy_imports() -> None:
    done = python(
        "import sys; from app.commands.cli import main; status = main(['--help'])\n"
        "assert not {'torch', 'numpy', 'scipy', 'numba', 'soundfile', 'PySide6'} & set(sys.modules)\n"
        "sys.exit(status)"
    )
    assert (done.returncode, done.stderr) == (0, "")
    for name in COMMANDS:
        assert f"\n  {name} " in done.stdout


@pytest.mark.skipif(sys.platform != "linux", reason="GNU's OpenMP prints its settings")
@pytest.mark.parametrize(("chosen", "turns"), [({}, "0"), ({"GOMP_SPINCOUNT": "123"}, "123")])
def test_threads_of_a_command_sleep_while_they_wait(chosen: dict[str, str], turns: str) -> None:
    """They spin for so many turns, by torch's own OpenMP, unless the user wants otherwise."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("OMP_", "GOMP_"))}
    done = subprocess.run(
        [sys.executable, "-m", "app.commands.cli", "models"],
        cwd=ROOT,
        env={**environment, "OMP_DISPLAY_ENV": "VERBOSE", **chosen},
        capture_output=True,
        text=True,
        check=True,
    )
    assert f"GOMP_SPINCOUNT = '{turns}'" in done.stderr


def test_commands_need_neither_window_nor_sound_packages() -> None:
    # pydantic is not among them: newer versions of typer themselves need it
    done = python(
        "import sys\n"
        "for name in ('PySide6', 'pyqtgraph', 'sounddevice', 'soundfile', 'psygnal'):\n"
        "    sys.modules[name] = None\n"
        "import app.commands.arrays, training.run\n"
        "from app.commands.cli import main\n"
        "assert main(['models', '--json']) == 0\n"
        "pluck = ['--position', '.5', '--amplitude-mm', '1', '--seconds', '1']\n"
        "sys.exit(main(['render', 'x', 'y.wav', *pluck]))"
    )
    assert done.returncode == 1
    assert '"parameters": 134885' in done.stdout
    assert done.stderr.startswith("learned-strings: this needs soundfile, which cannot be imported")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("words", [[], *([name] for name in COMMANDS)])
def test_everything_has_help(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([*words, "--help"]) == 0
    assert "Usage: learned-strings" in capsys.readouterr().out


def test_without_a_command_the_app_opens_and_gives_its_status(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "app.window.main", types.SimpleNamespace(run=lambda: 3))  # type: ignore[arg-type]
    assert cli.main([]) == 3


def test_files_open_in_the_app_and_a_command_wins_over_a_file_of_its_name(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    opened: list[Path] = []

    def run(files: list[Path]) -> int:
        opened.extend(files)
        return 3

    monkeypatch.setitem(sys.modules, "app.window.main", types.SimpleNamespace(run=run))  # type: ignore[arg-type]
    monkeypatch.chdir(tmp_path)
    for name in ("song.mid", "models"):
        Path(name).touch()
    assert cli.main(["song.mid", "./models"]) == 3
    assert opened == [tmp_path / "song.mid", tmp_path / "models"]
    assert cli.main(["models", "--json"]) == 0
    assert len(opened) == 2 and "koopman" in capsys.readouterr().out


def test_an_absent_file_is_named_and_nothing_opens(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "app.window.main", None)  # type: ignore[arg-type]
    (tmp_path / "song.mid").touch()
    assert cli.main([str(tmp_path / "song.mid"), "gone.wav"]) == 2
    assert capsys.readouterr().err == "learned-strings: gone.wav: no such file; check the name\n"


def test_the_version_is_reported(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["--version"]) == 0
    assert capsys.readouterr().out.strip()


@pytest.mark.parametrize("words", [["unknown"], ["render"], ["models", "--nonsense"]])
def test_bad_usage_is_status_2(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(words) == 2
    found = capsys.readouterr()
    assert found.out == ""
    assert "Error: " in found.err


def _failing(monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
    def run() -> int:
        raise error

    monkeypatch.setitem(sys.modules, "app.window.main", types.SimpleNamespace(run=run))  # type: ignore[arg-type]


def test_a_failure_is_one_line_without_a_traceback(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    _failing(monkeypatch, ValueError("first\nsecond"))
    assert cli.main([]) == 1
    assert capsys.readouterr().err == "learned-strings: first second\n"


def test_a_failure_shows_its_traceback_on_demand(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    _failing(monkeypatch, ValueError("reported"))
    monkeypatch.setenv(cli.DEBUG_VARIABLE, "1")
    assert cli.main([]) == 1
    assert "Traceback" in capsys.readouterr().err


def test_an_interruption_is_status_130(monkeypatch: pytest.MonkeyPatch) -> None:
    _failing(monkeypatch, KeyboardInterrupt())
    assert cli.main([]) == 130


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (ModuleNotFoundError("No module named 'mido'", name="mido"), "this needs mido"),
        (PermissionError(13, "Permission denied", "/x/y"), "/x/y: Permission denied; check the path"),
        (
            OSError(28, "No space left on device", "/x/y"),
            "/x/y: cannot be written (No space left on device); free some",
        ),
        (OSError("/x/y: cannot be written; free some space"), "/x/y: cannot be written; free some space"),
        (MemoryError(), "not enough memory"),
        (KeyError("z"), "internal error: KeyError 'z'; set LEARNED_STRINGS_DEBUG=1"),
        (RuntimeError(), "internal error: RuntimeError"),
        (RuntimeError("DOP853 failed"), "DOP853 failed"),
    ],
)
def test_a_failure_names_what_and_the_remedy(error: Exception, expected: str) -> None:
    assert cli.describe(error).startswith(expected)


def test_what_is_known_without_soundfile_is_what_they_say() -> None:
    assert render.Bits.__args__ == BITS
    assert render.Source.__args__ == SOURCES
    assert render.Pickup.__args__ == PICKUPS


@pytest.mark.parametrize("value", [-0.1, 1.1, float("nan"), float("inf")])
def test_a_range_error_names_option_value_and_range(value: float) -> None:
    with pytest.raises(typer.BadParameter, match=rf"must lie in 0 … 1 mm, not {value:g}") as reported:
        arguments.check_range("--option", value, 0, 1, "mm")
    assert reported.value.param_hint == "--option"
