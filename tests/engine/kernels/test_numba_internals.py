"""The installed Numba is the one whose internals are replaced; on another, each of these says what to look at."""

from __future__ import annotations

import inspect
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import pytest
from numba import njit
from numba.core.codegen import CPUCodeLibrary
from numba.core.cpu import CPUContext
from numba.core.types.misc import unliteral

from engine.kernels import numba_internals
from engine.kernels.compiled import COMPILED

READ = "read engine/kernels/numba_internals.py beside its source"


def test_the_version_is_the_one_that_was_read() -> None:
    installed = ".".join(numba.__version__.split(".")[:2])
    assert installed == numba_internals.VERSION, f"Numba is {numba.__version__}: {READ}, then raise VERSION"


@pytest.mark.parametrize(
    ("kept", "parameters"),
    [
        (CPUCodeLibrary.add_ir_module, ["self", "ir_module"]),
        (CPUCodeLibrary._optimize_final_module, ["self"]),
        (CPUCodeLibrary._finalize_final_module, ["self"]),
        (CPUContext.get_executable, ["self", "library", "fndesc", "env"]),
        (unliteral, ["lit_type"]),
    ],
)
def test_what_stays_is_called_as_it_was(kept: Callable[..., Any], parameters: list[str]) -> None:
    assert list(inspect.signature(kept).parameters) == parameters, f"{kept.__qualname__}: {READ}"


def test_a_function_is_compiled_for_its_callers_once_for_all_numbers_and_for_python_where_that_calls_it() -> None:
    options = {**COMPILED, "cache": False}

    @njit(**options)
    def add(one: int, other: int) -> int:
        return one + other

    @njit(**options)
    def calls(one: int) -> int:
        return int(add(one, 1) + add(one, 2) + add(one, 3))

    assert calls(1) == 9
    assert len(add.called.signatures) == 1
    assert not next(iter(add.called.overloads.values())).library._finalized
    assert add.signatures == []
    assert add(1, 2) == 3
    assert calls.inspect_llvm(calls.signatures[0])


CALLED = """
from numba import njit
from engine.kernels.compiled import COMPILED
called = njit("int64(int64)", **COMPILED)(lambda x: 3 * x + 1)
"""


def printed(code: str, *arguments: str, **environment: str) -> list[str]:
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], env={**os.environ, **environment}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_a_function_that_is_loaded_can_still_be_called_by_one_that_is_compiled(tmp_path: Path) -> None:
    """Of what is loaded only machine code was kept: it is compiled again for the other."""
    (tmp_path / "called.py").write_text(CALLED)
    code = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "from called import called\n"
        "print(sum(called.stats.cache_hits.values()), called(2))\n"
        "from numba import njit\n"
        "print(njit(lambda x: called(x) + called(x + 1))(4))\n"
    )
    first, again = (printed(code, str(tmp_path), NUMBA_CACHE_DIR=str(tmp_path / "cache")) for _ in range(2))
    assert first[1] == "29"
    assert again == ["1 7", "29"]


def test_a_function_is_loaded_where_the_program_was_moved_and_compiled_where_its_source_changed(
    tmp_path: Path,
) -> None:
    code = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "from called import called\n"
        "print(sum(called.stats.cache_hits.values()), called(2))\n"
    )
    places = [tmp_path / name / "engine" / "package" for name in ("first", "second")]
    for place in places:
        place.mkdir(parents=True)
        (place / "called.py").write_text(CALLED)
    kept = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    assert [printed(code, str(place), **kept) for place in places] == [["0 7"], ["1 7"]]
    (places[1] / "called.py").write_text(CALLED.replace("3 * x", "5 * x"))
    assert printed(code, str(places[1]), **kept) == ["0 11"]


def test_code_is_neither_optimised_nor_made_into_machine_code_where_text_alone_is_wanted() -> None:
    code = (
        "from engine.kernels.compiled import COMPILED\n"
        "from engine.kernels.numba_internals import NOWHERE, write_code_alone\n"
        "write_code_alone()\n"
        "from numba import njit\n"
        "f = njit('int64(int64)', no_cpython_wrapper=True, no_cfunc_wrapper=True)(lambda x: x + 1)\n"
        "library = next(iter(f.overloads.values())).library\n"
        "assert library.get_pointer_to_function('anything') == NOWHERE\n"
        "assert not library._finalized\n"
    )
    assert set("".join(printed(code))) == {"."}
