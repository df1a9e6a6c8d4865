"""Where compiled functions are kept; in processes of their own, since that is settled when the first is made."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from engine import warm

# no folder but the temporary one can be written, as of a program in a read-only image without a home
READ_ONLY = (
    "import tempfile; from pathlib import Path; temporary = tempfile.TemporaryFile\n"
    "def refused(*a, dir=None, **k):\n"
    "    if str(dir).startswith(tempfile.gettempdir()): return temporary(*a, dir=dir, **k)\n"
    "    raise OSError(dir)\n"
    "tempfile.TemporaryFile = refused\n"
    "from engine.kernels import cache; from engine.kernels.compiled import tanh\n"
)
REPORT = (
    "place = cache.folder()\n"
    "print(place, place and place.is_dir(), cache.is_whole(), cache.set_whole(), cache.is_whole(), round(tanh(9.5)),"
    " place and len(list(place.rglob('*.nbc'))), flush=True)\n"
)


def reported(code: str, **environment: str) -> list[str]:
    paths = {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, **paths, **environment}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_all_compiled_functions_are_kept_in_one_folder_which_is_known_without_the_compiler() -> None:
    code = (
        "import sys; from engine.kernels import cache; cache.is_whole(); print('numba' in sys.modules)\n"
        "from engine.models._ssm_kernel import stream; from engine.truth._splitting_kernel import advance\n"
        "print(all(str(cache.folder()) in f._cache.cache_path for f in (stream, advance)))"
    )
    assert reported(code) == ["False", "True"]


def test_the_users_own_folder_is_used_and_known_to_be_empty(tmp_path: Path) -> None:
    code = "from engine.kernels import cache; from engine.kernels.compiled import config, tanh\n" + REPORT
    found = reported(code + "print(config.CACHE_DIR)", NUMBA_CACHE_DIR=str(tmp_path))
    assert found == [str(tmp_path), "True", "False", "None", "True", "1", "1", str(tmp_path)]


def test_where_nothing_can_be_written_a_temporary_folder_is_taken_and_left_to_nobody(tmp_path: Path) -> None:
    """What a killed run left there goes at the next start."""
    killed = reported(READ_ONLY + REPORT + "import os; os._exit(0)", TMPDIR=str(tmp_path))
    assert killed[1:] == ["True", "False", "None", "True", "1", "1"]
    assert Path(killed[0]).is_dir()
    ended = reported(READ_ONLY + REPORT, TMPDIR=str(tmp_path))
    assert ended[0] != killed[0] and ended[1:] == killed[1:]
    assert not list(tmp_path.iterdir())


def test_without_any_folder_at_all_it_is_compiled_and_not_kept() -> None:
    code = READ_ONLY.replace("temporary = ", "tempfile.tempdir = '/dev/null/nowhere'; temporary = ")
    assert reported(code + REPORT) == ["None", "None", "False", "None", "False", "1", "None"]


def test_every_kind_of_voice_and_compiled_model_runs() -> None:
    warm.voices()
    warm.apart()
