"""run.py, on a copy of it beside a small .venv; no pip, no apt-get and no network."""

import ast
import collections
import contextlib
import csv
import http.server
import importlib.util
import shutil
import socket
import subprocess
import sys
import threading
import tomllib
import venv
from pathlib import Path

import pytest
from packaging.specifiers import SpecifierSet

SOURCE = Path(__file__).parents[1] / "run.py"


def load(path):
    """Import a copy of run.py from its path, as a module of its own."""
    spec = importlib.util.spec_from_file_location("run_under_test", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def record(package, files):
    """Write a package's RECORD as pip does: a path and a size in each row."""
    package.mkdir(parents=True)
    with (package / "RECORD").open("w", newline="") as rows:
        csv.writer(rows).writerows([*((name, "", size) for name, size in files), ("RECORD", "", "")])


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Return run.py in a project whose set-up is done, where any process that it starts fails the test."""
    (tmp_path / "pyproject.toml").write_text("[project]\n")
    (tmp_path / "constraints.txt").write_text("numpy==1\n")
    shutil.copy(SOURCE, tmp_path)
    run = load(tmp_path / "run.py")
    venv.create(run.VENV, with_pip=False, symlinks=not run.WINDOWS)
    run.APP.touch()
    (run.site_packages() / "numpy").mkdir()
    (run.site_packages() / "numpy" / "__init__.py").write_text("12345")
    record(run.site_packages() / "numpy-1.dist-info", [("numpy/__init__.py", 5), ("numpy/x.pyc", 9)])
    monkeypatch.setattr(run, "pip", lambda *arguments: None)
    monkeypatch.setattr(run, "sound", lambda: True)
    run.torch_source_here = run.torch_source  # for the tests that ask for it
    monkeypatch.setattr(run, "torch_source", lambda: [])
    monkeypatch.setattr(run, "missing", lambda table: [])
    monkeypatch.setattr(subprocess, "Popen", lambda command, **_: pytest.fail(f"started {command}"))
    run.environment([])
    (tmp_path / "engine" / "kernels").mkdir(parents=True)
    (tmp_path / "engine" / "kernels" / "bank.py").write_text("1")
    run.COMPILED.write_text(run.kernels())
    return run


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        ([], ("start", [])),
        (["--"], ("start", [])),
        (["--", "render", "--", "a b"], ("start", ["render", "--", "a b"])),
        (["test", "-k", "x"], ("test", ["-k", "x"])),
        (["setup"], ("setup", [])),
        (["docs"], ("docs", [])),
        (["./setup", "song.mid"], ("start", ["./setup", "song.mid"])),
    ],
)
def test_words_are_understood(run, words, meant, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for name in ("setup", "test", "song.mid"):  # a command wins over a file of its name
        (tmp_path / name).touch()
    assert run.parse(words) == meant


@pytest.mark.parametrize(
    "words", [["render"], ["setup", "now"], ["docs", "now"], ["--frob"], ["song.mid", "now"], ["--frob.mid"]]
)
def test_other_words_are_answered_with_the_usage(run, words, capsys):
    with pytest.raises(SystemExit) as exit:
        run.main(words)
    out, err = capsys.readouterr()
    assert (exit.value.code, out) == (2, "")
    assert "python3 run.py setup" in err and f"not understood: {' '.join(words)}" in err


def test_files_open_in_the_app_once_they_are_there_and_help_is_printed(run, monkeypatch, capsys, tmp_path):
    started = []
    monkeypatch.setattr(run, "start", started.append)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "take.wav").touch()
    run.main(["take.wav"])
    run.main(["--", "render", "a b"])  # nothing to do before it: silent, and no process is started
    assert started == [["take.wav"], ["render", "a b"]]
    assert capsys.readouterr() == ("", "")
    monkeypatch.setattr(run, "prepare", lambda *_, **__: pytest.fail("prepared"))
    for words, status, out, err in (
        (["take.wav", "gone.wav"], 2, "", "run.py: no such file: gone.wav; check the name\n"),
        (["--help"], 0, "python3 run.py -- render", ""),
    ):
        with pytest.raises(SystemExit) as exit:
            run.main(words)
        assert exit.value.code == status
        printed = capsys.readouterr()
        assert out in printed.out and printed.err == err


@pytest.mark.parametrize(
    ("version", "taken"), [((3, 6), False), ((3, 10), False), ((3, 11), True), ((3, 14), True), ((3, 15), False)]
)
def test_all_places_state_the_same_versions_of_python_and_old_ones_read_it(version, taken, monkeypatch):
    ast.parse(SOURCE.read_text("utf-8"), feature_version=(3, 6))
    asked = tomllib.loads((SOURCE.parent / "pyproject.toml").read_text("utf-8"))["project"]["requires-python"]
    assert SpecifierSet(asked).contains(".".join(map(str, version))) == taken
    assert "Python 3.11 to 3.14" in (SOURCE.parent / "README.md").read_text("utf-8")
    monkeypatch.setattr(sys, "version_info", (*version, 0))
    with contextlib.nullcontext() if taken else pytest.raises(SystemExit, match=r"needs Python 3\.11 to 3\.14"):
        load(SOURCE)


@pytest.mark.skipif(sys.platform == "win32", reason="links need rights there")
def test_a_set_up_never_empties_a_folder_that_is_linked(run, tmp_path):
    other = tmp_path / "other"
    run.VENV.rename(other)
    run.VENV.symlink_to(other)
    with run.locked():
        assert not run.VENV.is_symlink()
    assert (other / "pyvenv.cfg").is_file()


def dangle(run):
    run.PYTHON.unlink()
    run.PYTHON.symlink_to("/nonexistent/python")


SPOILED = {
    "no stamp": lambda run: run.STAMP.unlink(),
    "half a stamp": lambda run: run.STAMP.write_text(run.STAMP.read_text()[:40]),
    "a stamp of another kind": lambda run: run.STAMP.write_text("[]"),
    "other versions": lambda run: (run.ROOT / "constraints.txt").write_text("numpy==2\n"),
    "another project": lambda run: (run.ROOT / "pyproject.toml").write_text("[tool]\n"),
    "no configuration": lambda run: (run.VENV / "pyvenv.cfg").unlink(),
    "no Python": dangle,
    "no app": lambda run: run.APP.unlink(),
    "a package gone": lambda run: shutil.rmtree(run.site_packages() / "numpy"),
    "every package gone": lambda run: shutil.rmtree(run.site_packages()),
    ".venv gone": lambda run: shutil.rmtree(run.VENV),
}


@pytest.mark.parametrize("spoil", SPOILED.values(), ids=SPOILED)
def test_a_spoiled_environment_is_seen(run, spoil):
    assert run.read_stamp()
    spoil(run)
    assert run.read_stamp() is None


@pytest.mark.parametrize("action", ["start", "setup", "test"])
def test_changed_kernels_are_compiled_once_and_that_is_said(run, action, monkeypatch, capsys):
    steps = []

    def step(command, trouble, **_):
        steps.append(command[1:])
        if len(steps) == 1:
            raise run.SetupError(trouble)

    monkeypatch.setattr(run, "run_step", step)
    run.prepare(action, True)
    assert steps == []
    (run.ROOT / "engine" / "kernels" / "bank.py").write_text("2")
    with pytest.raises(run.SetupError, match=r"delete \.venv"):
        run.prepare(action, True)
    assert not run.compiled()
    for _ in range(2):  # the next start compiles them
        run.prepare(action, True)
    assert steps == [["-m", "engine.warm"]] * 2
    assert capsys.readouterr().err.count("compiling the sound engine") == 2


def test_a_moved_folder_is_seen(run, tmp_path):
    before = run.fingerprint()
    moved = tmp_path / "moved"
    moved.mkdir()
    for name in ("run.py", "pyproject.toml", "constraints.txt", ".venv"):
        (tmp_path / name).rename(moved / name)
    run = load(moved / "run.py")
    assert run.fingerprint() != before
    assert run.read_stamp() is None
    assert not run.sound()


def test_a_sound_environment_is_installed_into_and_another_is_made_again(run, monkeypatch):
    steps = []
    monkeypatch.setattr(run, "pip", lambda *arguments: steps.append(arguments[-1]))
    monkeypatch.setattr(run, "make_venv", lambda: steps.append("venv"))
    run.environment([])
    installed = ["setuptools", "torch", ".[dev]", ".[midi]"]
    assert steps == installed
    monkeypatch.setattr(run, "sound", lambda: False)
    run.environment([])
    assert steps == [*installed, "venv", *installed]
    assert run.read_stamp()


def test_midi_that_cannot_be_installed_is_a_warning(run, monkeypatch, capsys):
    def pip(*arguments):
        if arguments[-1] == ".[midi]":
            raise run.SetupError("no wheel")

    monkeypatch.setattr(run, "pip", pip)
    run.STAMP.unlink()
    run.prepare("start", True)
    assert run.read_stamp()
    assert "warning: MIDI input was not installed" in capsys.readouterr().err


def test_the_site_installs_what_it_needs_once_and_builds_with_warnings_as_errors(run, monkeypatch):
    installed, called = [], []

    def pip(*arguments):
        installed.append(arguments[-1])
        for name in ("mkdocs", "material", "mkdocstrings"):
            (run.site_packages() / name).mkdir()

    monkeypatch.setattr(run, "pip", pip)
    monkeypatch.setattr(run.subprocess, "call", lambda command, **_: called.append(command[1:]) or 3)
    assert [run.main(["docs"]), run.main(["docs"])] == [3, 3]
    assert installed == [".[docs]"]
    assert called == [["-m", "mkdocs", "build", "--strict"]] * 2
    assert run.read_stamp()


@pytest.fixture
def cardless(run, monkeypatch, tmp_path):
    """Return run.py on Linux without an NVIDIA card, with a server of PyTorch's builds that answers."""

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200 if self.path == "/cpu/torch/" else 404)
            self.end_headers()

        def log_message(self, *_):
            pass

    monkeypatch.setattr(run, "torch_source", run.torch_source_here)
    monkeypatch.setattr(run.sys, "platform", "linux")
    monkeypatch.setattr(run.shutil, "which", lambda name: None)
    monkeypatch.setattr(run, "NVIDIA", tmp_path / "nvidia")
    monkeypatch.setenv("no_proxy", "*")
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        monkeypatch.setattr(run, "CPU_BUILDS", f"http://127.0.0.1:{server.server_port}/cpu")
        threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
        yield run
        server.shutdown()


@pytest.mark.parametrize(
    "case", ["no card", "a driver", "a program", "nobody answers", "no such page", "a silent server"]
)
def test_torch_comes_without_cuda_only_where_no_card_is_and_the_builds_are_in_reach(
    cardless, case, monkeypatch, capsys
):
    monkeypatch.setattr(cardless, "ANSWER_S", 0.3)
    builds, reported = cardless.CPU_BUILDS, "no NVIDIA card: taking PyTorch's build without CUDA"
    with socket.create_server(("127.0.0.1", 0)) as silent:
        if case == "a driver":
            cardless.NVIDIA.mkdir()
        elif case == "a program":
            monkeypatch.setattr(cardless.shutil, "which", {"nvidia-smi": "/usr/bin/nvidia-smi"}.get)
        elif case == "no such page":
            monkeypatch.setattr(cardless, "CPU_BUILDS", f"{builds}/absent")
        elif case != "no card":
            port = silent.getsockname()[1] if case == "a silent server" else 9
            monkeypatch.setattr(cardless, "CPU_BUILDS", f"http://127.0.0.1:{port}/cpu")
        assert cardless.torch_source() == (["--extra-index-url", builds] if case == "no card" else [])
    err = capsys.readouterr().err
    wanted = {"no card": reported, "a driver": "", "a program": ""}.get(case, "out of reach")
    assert wanted in err and (wanted or err == "")


def test_a_new_environment_keeps_nothing_but_the_lock(run, monkeypatch):
    monkeypatch.setattr(run, "run_step", lambda command, trouble: None)
    with run.locked():
        run.make_venv()
    assert list(run.VENV.iterdir()) == [run.LOCK]


@pytest.mark.parametrize("cut", ["file", "size", "record"])
def test_a_package_cut_short_is_made_to_look_absent(run, cut):
    """Or pip would take it for installed and leave it as it is."""
    package = run.site_packages() / "numpy-1.dist-info"
    remnant = run.site_packages() / "~umpy"
    remnant.mkdir()
    run.mend()
    assert package.exists() and not remnant.exists()
    source = run.site_packages() / "numpy" / "__init__.py"
    {
        "file": source.unlink,
        "size": lambda: source.write_text("12"),
        "record": (package / "RECORD").unlink,
    }[cut]()
    run.mend()
    assert not package.exists()


def fake_process(status, lines):
    """Return a stand-in for Popen whose process says these lines and ends with this status."""

    class Process:
        returncode = status
        stdout = lines

        def __init__(self, command, **_):
            self.command = command

        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

    return Process


def test_a_failed_step_shows_its_last_lines_and_leaves_no_stamp(run, monkeypatch, capsys):
    def failing(*_):
        run.run_step(["pip"], "pip failed; remedy: again")

    monkeypatch.setattr(run, "pip", failing)
    monkeypatch.setattr(
        subprocess, "Popen", fake_process(1, [*(f"line {i}\n" for i in range(40)), "ERROR: disk full\n"])
    )
    (run.ROOT / "constraints.txt").write_text("numpy==2\n")
    assert run.main(["setup"]) == 1
    out, err = capsys.readouterr()
    assert out == "" and "line 5\n" not in err
    assert "ERROR: disk full\n" in err
    assert err.endswith(f"run.py: cannot prepare {run.VENV}: pip failed; remedy: again\n")
    assert not run.STAMP.exists()


def test_a_second_set_up_waits_for_the_first_and_does_nothing_more(run, monkeypatch, capsys):
    begun, waited_for, made = threading.Event(), threading.Event(), []

    def slow(absent):
        begun.set()
        waited_for.wait(0.2 if run.WINDOWS else 20)  # there nothing is said
        made.append(absent)
        environment(absent)

    def tell(message):
        say(message)
        waited_for.set()

    environment, say = run.environment, run.say
    monkeypatch.setattr(run, "environment", slow)
    monkeypatch.setattr(run, "say", tell)
    run.STAMP.unlink()
    first = threading.Thread(target=run.prepare, args=("start", False))
    first.start()
    assert begun.wait(10)
    run.prepare("start", False)
    first.join()
    assert made == [[]]
    assert run.WINDOWS or "waiting for another set-up" in capsys.readouterr().err


@pytest.mark.skipif(sys.platform != "linux", reason="pip brings everything elsewhere")
class TestSystemPackages:
    @pytest.fixture
    def machine(self, run, monkeypatch):
        """Return run.py on a machine that lacks PortAudio and Xvfb, with a record of the commands it runs."""
        lacking = {"libportaudio.so.2", "Xvfb"}
        monkeypatch.undo()
        monkeypatch.setattr(run, "torch_source", lambda: [])
        monkeypatch.setattr(run, "present", lambda sign: sign not in lacking)
        monkeypatch.setattr(run, "pip", lambda *arguments: None)
        monkeypatch.setattr(run, "sound", lambda: True)
        monkeypatch.setattr(run.shutil, "which", {"apt-get": "/usr/bin/apt-get"}.get)
        commands = []
        monkeypatch.setattr(run, "run_step", lambda command, trouble, **_: commands.append(command))
        return collections.namedtuple("Machine", "run lacking commands")(run, lacking, commands)

    def test_signs_are_found_where_they_are(self, run):
        assert run.present("import ensurepip") and not run.present("import nothing_of_the_kind")
        assert run.present("libc.so.6") and not run.present("libnothing.so.6")
        assert run.present("/proc/*/stat") and not run.present("/proc/nothing")
        assert run.present("sh") and not run.present("nothing-of-the-kind")

    def test_a_user_is_reported_the_line_once_and_again_only_for_the_window(self, machine, monkeypatch, capsys):
        run = machine.run
        monkeypatch.setattr(run, "APT", False)
        monkeypatch.setattr(run, "start", lambda arguments: 0)
        line = "  sudo apt-get install --no-install-recommends libportaudio2\n"
        run.STAMP.unlink()
        assert run.main(["--", "render"]) == 0
        assert line in capsys.readouterr().err
        assert run.main(["--", "render"]) == 0
        assert capsys.readouterr().err == ""
        assert run.main([]) == 0
        assert line in capsys.readouterr().err
        machine.lacking.clear()
        assert run.main([]) == 0
        assert capsys.readouterr().err == ""
        assert machine.commands == []

    def test_root_installs_and_those_of_the_tests_only_for_them(self, machine, monkeypatch):
        monkeypatch.setattr(machine.run, "APT", True)
        machine.run.system_packages("start")
        assert [command[1] for command in machine.commands] == ["update", "install"]
        assert machine.commands[-1][-1] == "libportaudio2"
        assert "--no-install-recommends" in machine.commands[-1]
        machine.run.system_packages("test")
        assert machine.commands[-1][-1] == "xvfb"

    def test_a_failing_apt_get_is_a_warning(self, machine, monkeypatch, capsys):
        def failing(command, trouble, **_):
            raise machine.run.SetupError(trouble)

        monkeypatch.setattr(machine.run, "APT", True)
        monkeypatch.setattr(machine.run, "run_step", failing)
        machine.run.STAMP.unlink()
        assert machine.run.main(["setup"]) == 0
        err = capsys.readouterr().err
        assert "warning: apt-get install failed; going on without" in err
        assert "  apt-get install --no-install-recommends libportaudio2\n" in err

    @pytest.mark.parametrize(
        ("tool", "line"), [("dnf", "sudo dnf install "), ("pacman", "sudo pacman "), ("", "Debian calls libx")]
    )
    def test_other_systems_are_given_a_hint(self, run, tool, line, monkeypatch, capsys):
        monkeypatch.setattr(run.shutil, "which", {tool: tool}.get)
        run.say_absent(["libx"])
        assert line in capsys.readouterr().err


@pytest.fixture
def checks(run, monkeypatch):
    """Return run.py, the lints that are to fail, and a record of pytest's command and environment."""
    failing, pytests = set(), []

    def lint(command, **_):
        return subprocess.CompletedProcess(command, int(command[2] in failing if len(command) > 2 else 0), b"")

    monkeypatch.setattr(run.subprocess, "run", lint)
    monkeypatch.setattr(run.subprocess, "call", lambda command, cwd, env: pytests.append((command, env)))
    return collections.namedtuple("Checks", "run failing pytests")(run, failing, pytests)


@pytest.mark.parametrize("lint", [None, "mypy"])
def test_the_check_runs_the_tests_in_parallel_and_names_a_failed_lint(checks, lint, monkeypatch, capsys):
    monkeypatch.delenv("QT_QPA_PLATFORM", raising=False)
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    checks.failing.update([lint] if lint else [])
    assert checks.run.main(["test", *(["tests/test_run.py"] if lint else [])]) == (1 if lint else None)
    ((command, env),) = checks.pytests
    out, err = capsys.readouterr()
    assert env["QT_QPA_PLATFORM"] == "offscreen"
    assert out.count("passed") == len(checks.run.LINTS) - bool(lint)
    if lint:
        assert command[3:] == ["tests/test_run.py"]
        assert "mypy: FAILED" in out and err == "run.py: failed before the tests: mypy\n"
    else:
        assert command[3] == "-n" and command[-2:] == ["--dist", "loadfile"] and err == ""
        assert env["OMP_NUM_THREADS"] == "1"
