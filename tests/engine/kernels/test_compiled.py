"""Compiled functions: Numba's replaced internals, where what is compiled is kept, and the order of writes."""

import inspect
import os
import re
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
from numba import njit
from numba.core.codegen import CPUCodeLibrary
from numba.core.cpu import CPUContext
from numba.core.types.misc import unliteral

from engine import warm
from engine.effects import Effects
from engine.kernels import cache, numba_internals
from engine.kernels.compiled import COMPILED
from engine.kernels.fields import slot
from engine.kernels.memory import publish
from engine.kernels.mixer_records import MIXER
from engine.kernels.voice_records import VOICE
from engine.levels import FULL_SCALE_M
from engine.resonators.string import resonator_of
from engine.values.ear import Ear
from engine.values.effects import Room
from engine.values.string import StringParameters
from engine.voices import Mixer, Voice, plain_program
from engine.voices import memory as memory_module
from engine.voices.programs import solver_program
from tests.engine.sounds import EAR, PLUCK, RATE_HZ

READ = "read engine/kernels/numba_internals.py beside its source"


def test_numba_is_the_one_whose_internals_were_read_and_what_stays_is_called_as_it_was():
    installed = ".".join(numba.__version__.split(".")[:2])
    assert installed == numba_internals.VERSION, f"Numba is {numba.__version__}: {READ}, then raise VERSION"
    for kept, parameters in (
        (CPUCodeLibrary.add_ir_module, ["self", "ir_module"]),
        (CPUCodeLibrary._optimize_final_module, ["self"]),
        (CPUCodeLibrary._finalize_final_module, ["self"]),
        (CPUContext.get_executable, ["self", "library", "fndesc", "env"]),
        (unliteral, ["lit_type"]),
    ):
        assert list(inspect.signature(kept).parameters) == parameters, f"{kept.__qualname__}: {READ}"


CALLED = """
from numba import njit
from engine.kernels.compiled import COMPILED
called = njit("int64(int64)", **COMPILED)(lambda x: 3 * x + 1)
"""
LOADS = """
import sys; sys.path.insert(0, sys.argv[1])
from called import called
print(sum(called.stats.cache_hits.values()), called(2))
"""


def printed(code: str, *arguments: str, **environment: str) -> list[str]:
    """The words that a program prints."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **environment}
    done = subprocess.run([sys.executable, "-c", code, *arguments], env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_a_function_is_loaded_where_the_program_was_moved_and_compiled_where_its_source_changed(tmp_path):
    """Of what is loaded only machine code was kept: it is compiled again for a caller that is compiled."""
    places = [tmp_path / name / "engine" / "package" for name in ("first", "second")]
    for place in places:
        place.mkdir(parents=True)
        (place / "called.py").write_text(CALLED)
    kept = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    code = LOADS + "from numba import njit; print(njit(lambda x: called(x) + called(x + 1))(4))"
    assert [printed(code, str(place), **kept) for place in places] == [["0", "7", "29"], ["1", "7", "29"]]
    (places[1] / "called.py").write_text(CALLED.replace("3 * x", "5 * x"))
    assert printed(LOADS, str(places[1]), **kept) == ["0", "11"]


def test_what_is_compiled_is_kept_by_the_order_of_values(monkeypatch):
    places = {*cache._places()}
    monkeypatch.setattr(cache, "PLAYED", cache.PLAYED[::-1])
    cache._version.cache_clear()
    assert places.isdisjoint(cache._places())
    cache._version.cache_clear()


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


def test_the_users_own_folder_is_used_and_without_any_it_is_compiled_and_not_kept(tmp_path):
    code = "from engine.kernels import cache; from engine.kernels.compiled import tanh\n" + REPORT
    found = printed(code, NUMBA_CACHE_DIR=str(tmp_path))
    (kept,) = tmp_path.iterdir()
    assert found == [str(kept), "True", "False", "None", "True", "1", "1"]
    code = READ_ONLY.replace("temporary = ", "tempfile.tempdir = '/dev/null/nowhere'; temporary = ")
    assert printed(code + REPORT) == ["None", "None", "False", "None", "False", "1", "None"]


def test_where_nothing_can_be_written_a_temporary_folder_is_taken_and_left_to_nobody(tmp_path):
    """What a killed run left there goes at the next start."""
    killed = printed(READ_ONLY + REPORT + "import os; os._exit(0)", TMPDIR=str(tmp_path))
    assert killed[1:] == ["True", "False", "None", "True", "1", "1"]
    assert Path(killed[0]).is_dir()
    ended = printed(READ_ONLY + REPORT, TMPDIR=str(tmp_path))
    assert ended[0] != killed[0] and ended[1:] == killed[1:]
    assert not list(tmp_path.iterdir())


def test_every_kind_of_voice_and_compiled_model_runs():
    warm.voices()
    warm.models()


def test_what_is_published_lies_between_two_fences():
    """x86 keeps the order of writes by itself, so that only the code can be looked at."""
    uncached = njit(**{**COMPILED, "cache": False})(publish.py_func)
    uncached(np.zeros(4, np.int64), 2, 7)
    (code,) = uncached.inspect_llvm().values()
    function = re.search(r"^define [^@]*i32 @.*?^}", code, re.DOTALL | re.MULTILINE)
    steps = re.findall(r"^\s*(fence seq_cst|store i64 %arg\.whole)", function[0], re.MULTILINE)
    assert steps == ["fence seq_cst", "store i64 %arg.whole", "fence seq_cst"]


def test_what_a_device_shall_see_is_published_when_it_is_there(monkeypatch):
    """The numbers that show samples, voices, places and responses to its thread change in no other way."""
    published: list[int] = []  # slots, while nothing of it is written
    monkeypatch.setattr(memory_module, "publish", lambda slots, slot, whole: published.append(slot))
    program = solver_program(resonator_of(StringParameters(), 4), RATE_HZ)
    voice = Voice(program, PLUCK.displacement(program.grid_points), EAR)
    rendered = Voice(plain_program(RATE_HZ), np.full(3, FULL_SCALE_M), Ear((0.5,)), 1.0, 1.0, RATE_HZ)
    rendered.append(np.full((100, 1), 0.25, np.float32))
    mixer = Mixer(RATE_HZ)
    mixer.add(voice, rendered)
    voice.listen(Ear((0.2,)))
    mixer.set_effects(Effects(room=Room(mix=0.5)))
    added = [slot(VOICE, "ready"), slot(MIXER, "pushed"), slot(VOICE, "next_weights")]
    assert published == [*added, slot(MIXER, "convolver"), slot(MIXER, "effects")]  # a response after the convolver
    assert (rendered.record["ready"], voice.record["next_weights"], mixer.record["pushed"]) == (0, 0, 0)
