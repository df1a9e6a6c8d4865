"""Where compiled functions are kept; in processes of their own, since that is settled when the first is made."""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path

import pytest

from engine import warm
from engine.kernels import cache


def reported(code: str, **environment: str) -> str:
    paths = {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, **paths, **environment}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_it_is_reported_without_the_compiler() -> None:
    code = "import sys; from engine.kernels import cache; cache.is_whole(); print('numba' in sys.modules)"
    assert reported(code) == "False"


def test_all_compiled_functions_are_kept_in_one_folder() -> None:
    code = (
        "from engine.models._ssm_kernel import stream; from engine.truth._splitting_kernel import advance;"
        "from engine.kernels import cache;"
        "print(all(str(cache.folder()) in f._cache.cache_path for f in (stream, advance)))"
    )
    assert reported(code) == "True"


def test_the_users_own_folder_is_used_and_known_to_be_empty(tmp_path: Path) -> None:
    code = (
        "from engine.kernels import cache, compiled;"
        "print(cache.folder(), compiled.config.CACHE_DIR, cache.is_whole(), cache.set_whole(), cache.is_whole())"
    )
    assert reported(code, NUMBA_CACHE_DIR=str(tmp_path)) == f"{tmp_path} {tmp_path} False None True"


def test_where_nothing_can_be_written_a_temporary_folder_is_taken_and_left_to_nobody() -> None:
    code = (
        "from pathlib import Path; from engine.kernels import cache;"
        "cache._places = lambda: [Path('/dev/null/there')];"
        "from engine.kernels.compiled import tanh;"
        "print(cache.folder(), cache.folder().is_dir(), round(tanh(9.5)), len(list(cache.folder().rglob('*.nbc'))))"
    )
    folder, there, value, kept = reported(code, NUMBA_CACHE_DIR="/dev/null/chosen").split()
    assert (there, value, kept) == ("True", "1", "1")
    assert not Path(folder).exists()  # once the process has ended


def test_what_a_killed_run_left_in_the_temporary_folder_goes_at_the_next_start(tmp_path: Path) -> None:
    code = (
        "import os; from pathlib import Path; from engine.kernels import cache;"
        "cache._places = lambda: [Path('/dev/null/there')];"
        "print(cache.folder().name, flush=True);"
    )
    killed = code + "os._exit(0)"  # as after a kill, nothing is tidied
    first = reported(killed, TMPDIR=str(tmp_path))
    assert (tmp_path / first).is_dir()
    second = reported(killed, TMPDIR=str(tmp_path))
    assert [path.name for path in tmp_path.iterdir()] == [second]
    reported(code, TMPDIR=str(tmp_path))
    assert not list(tmp_path.iterdir())


def test_without_any_folder_at_all_it_is_compiled_and_not_kept() -> None:
    code = (
        "import tempfile; from pathlib import Path; from engine.kernels import cache;"
        "cache._places = lambda: [Path('/dev/null/there')]; tempfile.tempdir = '/dev/null/nowhere';"
        "from engine.kernels.compiled import tanh;"
        "print(cache.folder(), cache.is_whole(), cache.set_whole(), cache.is_whole(), round(tanh(9.5)))"
    )
    assert reported(code) == "None False None False 1"


@pytest.mark.parametrize("whole", [True, False])
def test_all_is_compiled_once(whole: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[str] = []
    monkeypatch.setattr(cache, "is_whole", lambda: whole)
    monkeypatch.setattr(warm, "_beside", lambda work: nullcontext(done.append(work)))
    for place, name in ((warm, "models"), (warm, "unheard"), (warm, "voices"), (cache, "set_whole")):
        monkeypatch.setattr(place, name, lambda name=name: done.append(name))
    warm.warm()
    assert done == ([] if whole else ["playing", "models", "unheard", "voices", "set_whole"])


def test_every_kind_of_voice_and_compiled_model_runs() -> None:
    warm.voices()
    warm.models()
