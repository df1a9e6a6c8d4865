"""run.py, on a copy of it beside a small .venv; no pip, no apt-get and no network."""

import ast
import contextlib
import importlib.util
import shutil
import subprocess
import sys
import threading
import tomllib
import venv
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import pytest
from packaging.specifiers import SpecifierSet

from engine.kernels import cache

SOURCE = Path(__file__).parents[1] / "run.py"


def load(path):
    """Import a copy of run.py from its path, as a module of its own."""
    spec = importlib.util.spec_from_file_location("run_under_test", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_all_sources_of_kernels_decide_whether_they_are_compiled_again():
    assert {*cache._sources()} <= {*load(SOURCE).kernel_sources()}


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
    package = run.site_packages() / "numpy-1.dist-info"
    package.mkdir()
    (package / "RECORD").write_text("numpy/__init__.py,,5\nnumpy/x.pyc,,9\nRECORD,,\n")  # as pip writes it
    monkeypatch.setattr(run, "pip", lambda *arguments: None)
    monkeypatch.setattr(run, "sound", lambda: True)
    run.torch_source_here, run.missing_here = run.torch_source, run.missing  # for the tests that ask for them
    monkeypatch.setattr(run, "torch_source", lambda: [])
    monkeypatch.setattr(run, "missing", lambda table: [])
    monkeypatch.setattr(subprocess, "Popen", lambda command, **_: pytest.fail(f"started {command}"))
    run.environment([])
    (tmp_path / "engine" / "kernels").mkdir(parents=True)
    (tmp_path / "engine" / "kernels" / "bank.py").write_text("1")
    run.COMPILED.write_text(run.kernels())
    return run


MEANT = {
    "": ("start", []),
    "--": ("start", []),
    "-- render -- a": ("start", ["render", "--", "a"]),
    "test -k x": ("test", ["-k", "x"]),
    "setup": ("setup", []),
    "docs": ("docs", []),
    "./setup song.mid": ("start", ["./setup", "song.mid"]),
}


def test_words_are_understood_and_files_open_in_the_app(run, monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    for name in ("setup", "test", "song.mid"):  # a command wins over a file of its name
        (tmp_path / name).touch()
    assert {words: run.parse(words.split()) for words in MEANT} == MEANT
    started = []
    monkeypatch.setattr(run, "start", started.append)
    run.main(["song.mid"])
    run.main(["--", "render", "a b"])  # nothing to do before it: silent, and no process is started
    assert started == [["song.mid"], ["render", "a b"]]
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("words", "status", "reported"),
    [
        ("song.mid now", 2, "not understood: song.mid now"),
        ("--frob.mid", 2, "not understood: --frob.mid"),
        ("song.mid gone.wav", 2, "run.py: no such file: gone.wav; check the name\n"),
        ("--help", 0, "python3 run.py -- render"),
    ],
)
def test_other_words_are_answered_with_the_usage(run, words, status, reported, monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "song.mid").touch()
    monkeypatch.setattr(run, "prepare", lambda *_, **__: pytest.fail("prepared"))
    with pytest.raises(SystemExit) as exit:
        run.main(words.split())
    assert exit.value.code == status
    assert reported in capsys.readouterr()[0 if status == 0 else 1]


@pytest.mark.parametrize(
    ("version", "taken"), [((3, 6), False), ((3, 10), False), ((3, 11), True), ((3, 14), True), ((3, 15), False)]
)
def test_all_places_state_the_same_versions_of_python_and_old_ones_read_it(version, taken, monkeypatch):
    ast.parse(SOURCE.read_text("utf-8"), feature_version=(3, 6))
    asked = tomllib.loads((SOURCE.parent / "pyproject.toml").read_text("utf-8"))["project"]["requires-python"]
    assert SpecifierSet(asked).contains(".".join(map(str, version))) == taken
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


SPOILED = {
    "no stamp": lambda run: run.STAMP.unlink(),
    "half a stamp": lambda run: run.STAMP.write_text(run.STAMP.read_text()[:40]),
    "a stamp of another kind": lambda run: run.STAMP.write_text("[]"),
    "other versions": lambda run: (run.ROOT / "constraints.txt").write_text("numpy==2\n"),
    "another project": lambda run: (run.ROOT / "pyproject.toml").write_text("[tool]\n"),
    "no configuration": lambda run: (run.VENV / "pyvenv.cfg").unlink(),
    "no Python": lambda run: run.PYTHON.replace(run.PYTHON.with_name("elsewhere")),
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
    step = Mock(side_effect=[run.SetupError("delete .venv"), None])
    monkeypatch.setattr(run, "run_step", step)
    run.prepare(action, True)
    step.assert_not_called()
    (run.ROOT / "engine" / "kernels" / "bank.py").write_text("2")
    with pytest.raises(run.SetupError):
        run.prepare(action, True)
    assert not run.compiled()
    for _ in range(2):  # the next start compiles them
        run.prepare(action, True)
    assert [call.args[0][1:] for call in step.call_args_list] == [["-m", "engine.warm"]] * 2
    assert r"delete .venv" in step.call_args.args[1]
    assert capsys.readouterr().err.count("compiling the sound engine") == 2


def test_a_sound_environment_is_installed_into_another_is_made_again_and_midi_may_fail(run, monkeypatch, capsys):
    steps = []

    def pip(*arguments):
        steps.append(arguments[-1])
        if arguments[-1] == ".[midi]":
            raise run.SetupError("no wheel")

    monkeypatch.setattr(run, "pip", pip)
    monkeypatch.setattr(run, "make_venv", lambda: steps.append("venv"))
    installed = ["setuptools", "torch", ".[dev]", ".[midi]"]
    for sound in (True, False):
        monkeypatch.setattr(run, "sound", lambda sound=sound: sound)
        run.environment([])
        assert run.read_stamp() and "warning: MIDI input was not installed" in capsys.readouterr().err
    assert steps == [*installed, "venv", *installed]


@pytest.mark.parametrize("case", ["no card", "a driver", "a program", "nobody answers", "a silent server"])
def test_torch_comes_without_cuda_only_where_no_card_is_and_the_builds_are_in_reach(
    run, case, monkeypatch, capsys, tmp_path
):
    silence = threading.Event()
    answers = {"nobody answers": Mock(side_effect=OSError), "a silent server": lambda *_, **__: silence.wait(20)}
    programs = {"nvidia-smi": "/usr/bin/nvidia-smi"} if case == "a program" else {}
    monkeypatch.setattr(run.sys, "platform", "linux")
    monkeypatch.setattr(run.shutil, "which", programs.get)
    monkeypatch.setattr(run, "NVIDIA", tmp_path / ("" if case == "a driver" else "nvidia"))
    monkeypatch.setattr(run, "ANSWER_S", 0.1)
    monkeypatch.setattr("urllib.request.urlopen", answers.get(case, lambda *_, **__: contextlib.nullcontext()))
    wanted = ["--extra-index-url", run.CPU_BUILDS] if case == "no card" else []
    assert run.torch_source_here() == wanted
    silence.set()
    err = capsys.readouterr().err
    silent = dict.fromkeys(("a driver", "a program"), "")
    said = ({"no card": "taking PyTorch's build without CUDA"} | silent).get(case, "out of reach")
    assert said in err and (said or err == "")


@pytest.mark.parametrize("cut", ["file", "size", "record"])
def test_a_package_cut_short_is_made_to_look_absent(run, cut):
    """Or pip would take it for installed and leave it as it is."""
    package, remnant = (run.site_packages() / name for name in ("numpy-1.dist-info", "~umpy"))
    remnant.mkdir()
    run.mend()
    assert package.exists() and not remnant.exists()
    source = run.site_packages() / "numpy" / "__init__.py"
    cuts = {"file": source.unlink, "size": lambda: source.write_text("12"), "record": (package / "RECORD").unlink}
    cuts[cut]()
    run.mend()
    assert not package.exists()


def test_a_failed_step_shows_its_last_lines_and_leaves_no_stamp(run, monkeypatch, capsys):
    monkeypatch.setattr(run, "pip", lambda *_: run.run_step(["pip"], "pip failed; remedy: again"))
    process = SimpleNamespace(returncode=1, stdout=[*(f"line {i}\n" for i in range(40)), "ERROR: disk full\n"])
    monkeypatch.setattr(subprocess, "Popen", lambda command, **_: contextlib.nullcontext(process))
    (run.ROOT / "constraints.txt").write_text("numpy==2\n")
    assert run.main(["setup"]) == 1
    out, err = capsys.readouterr()
    assert out == "" and "line 5\n" not in err
    assert "ERROR: disk full\n" in err
    assert err.endswith(f"run.py: cannot prepare {run.VENV}: pip failed; remedy: again\n")
    assert not run.STAMP.exists()


def test_a_second_set_up_waits_for_the_first_and_does_nothing_more(run, monkeypatch):
    begun, waited_for, made, environment = threading.Event(), threading.Event(), [], run.environment

    def slow(absent):
        begun.set()
        waited_for.wait(0.2 if run.WINDOWS else 20)  # there nothing is said
        made.append(absent)
        environment(absent)

    monkeypatch.setattr(run, "environment", slow)
    monkeypatch.setattr(run, "say", lambda message: waited_for.set() if "another set-up" in message else None)
    run.STAMP.unlink()
    first = threading.Thread(target=run.prepare, args=("start", False))
    first.start()
    assert begun.wait(10)
    run.prepare("start", False)
    first.join()
    assert made == [[]] and (run.WINDOWS or waited_for.is_set())


@pytest.fixture
def machine(run, monkeypatch):
    """Return run.py on a machine that lacks PortAudio and Xvfb, with a record of the commands it runs."""
    lacking, commands = {"libportaudio.so.2", "Xvfb"}, []
    monkeypatch.setattr(run, "missing", run.missing_here)
    monkeypatch.setattr(run, "present", lambda sign: sign not in lacking)
    monkeypatch.setattr(run, "start", lambda arguments: 0)
    monkeypatch.setattr(run.shutil, "which", {"apt-get": "/usr/bin/apt-get"}.get)
    monkeypatch.setattr(run, "run_step", lambda command, trouble, **_: commands.append(command))
    return SimpleNamespace(run=run, lacking=lacking, commands=commands)


LINUX = pytest.mark.skipif(sys.platform != "linux", reason="pip brings everything elsewhere")


@LINUX
def test_a_user_is_reported_the_line_once_and_again_only_for_the_window(machine, monkeypatch, capsys):
    monkeypatch.setattr(machine.run, "APT", False)
    machine.run.STAMP.unlink()
    line = "  sudo apt-get install --no-install-recommends libportaudio2\n"
    for words, said in ((["--", "render"], True), (["--", "render"], False), ([], True)):
        assert machine.run.main(words) == 0
        assert (line in capsys.readouterr().err) == said
    machine.lacking.clear()
    assert machine.run.main([]) == 0 and capsys.readouterr().err == "" and machine.commands == []


@LINUX
def test_root_installs_and_those_of_the_tests_only_for_them_and_a_failure_is_a_warning(machine, monkeypatch, capsys):
    monkeypatch.setattr(machine.run, "APT", True)
    machine.run.system_packages("start")
    assert [command[1] for command in machine.commands] == ["update", "install"]
    assert machine.commands[-1][-1] == "libportaudio2" and "--no-install-recommends" in machine.commands[-1]
    machine.run.system_packages("test")
    assert machine.commands[-1][-1] == "xvfb"

    monkeypatch.setattr(machine.run, "run_step", Mock(side_effect=machine.run.SetupError("apt-get install failed")))
    machine.run.STAMP.unlink()
    assert machine.run.main(["setup"]) == 0
    assert "warning: apt-get install failed; going on without" in capsys.readouterr().err
