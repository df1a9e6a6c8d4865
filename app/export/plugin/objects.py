"""Compiled kernels as object files of other systems: Numba's LLVM code, optimised and emitted for each target.

The code of `engine.kernels.plugin` is taken as text from a Numba that optimises nothing, for a generic processor.
Text and objects are kept by the digest of the kernels and of the compilers' versions.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path

from app.export.plugin import texts
from app.export.plugin.formats import TARGETS, System
from engine.python_process import python_command, python_environment
from engine.whole_file import explain, whole_file

WAIT_S = 0.1
FUNCTIONS = 150  # of a part, about: dots of `texts`
STEPS = 4  # of an object file after that
TEXT_SHARE = 0.6  # of the time, measured
# What the code may ask of the shell and of the C library; all else would be a reference to Python.
_LIBRARY = """
cos sin sincos sincosf exp exp2 expm1 log log10 log1p log2 pow ceil floor rint round sqrt fmod tan atan atan2
memcpy memset memmove bzero __sincos_stret __exp10 numba_attempt_nocopy_reshape
"""
_ERROR_PATHS = """
NRT_Allocate NRT_Free NRT_MemInfo_alloc NRT_MemInfo_alloc_aligned NRT_MemInfo_call_dtor
NRT_MemInfo_new_varsize_dtor NRT_MemInfo_varsize_realloc NRT_MemInfo_varsize_free NRT_MemInfo_varsize_alloc
PyErr_SetString PyErr_SetNone PyErr_Clear PyErr_WriteUnraisable PyExc_RuntimeError PyUnicode_FromString
PyUnicode_FromKindAndData PyBytes_FromStringAndSize PyObject_Hash PyTuple_Pack Py_DecRef Py_IncRef
numba_do_raise numba_gil_ensure numba_gil_release
numba_runtime_build_excinfo_struct numba_unpickle numba_unpickle_no_gil
"""
ALLOWED, STUBS = frozenset(_LIBRARY.split()), frozenset(_ERROR_PATHS.split())  # the shell answers with stubs


class ObjectError(ValueError):
    """The kernels cannot be compiled for a target; the message names it and what is in the way."""


def digest() -> str:
    """The digest of the kernels and of what compiles them: it changes with either."""
    kernels = Path(sys.modules["engine"].__file__ or "").parent / "kernels"
    sha256 = hashlib.sha256()
    for source in (*sorted(kernels.rglob("*.py")), Path(__file__), Path(texts.__file__)):
        sha256.update(source.read_bytes())
    for package in ("numba", "llvmlite"):
        sha256.update(version(package).encode())
    return sha256.hexdigest()[:16]


def objects_of(target: str, folder: Path, advanced: Callable[[float], None] = lambda share: None) -> tuple[Path, ...]:
    """Object files of the kernels for a target, for each of its processors (most of a minute the first time).

    Their entries have the prefix "ls0_", "ls1_" and so on.

    Args:
        folder: has them from an earlier call, or gets them.
        advanced: is called a few times a second meanwhile with the share that is done; may raise, to end it.

    Raises:
        ObjectError: an unknown target, or the code needs what no plug-in has.
    """
    if target not in TARGETS:
        raise ObjectError(f"target {target!r} is unknown; try {', '.join(TARGETS)}")
    kernels = f"kernels-{digest()}"
    text_files = {part: folder / f"{kernels}-{part}.ll" for part in texts.PARTS}
    object_files = {
        folder / f"{kernels}-{target}-{cpu}-{part}.o": [str(text), target, str(number)]
        for number, cpu in enumerate(TARGETS[target].cpus)
        for part, text in text_files.items()
    }
    if not all(path.exists() for path in object_files):
        folder.mkdir(parents=True, exist_ok=True)
        calls = {path: [part] for part, path in text_files.items()}
        _make(texts.__name__, calls, FUNCTIONS, lambda share: advanced(TEXT_SHARE * share))
        _make(__name__, object_files, STEPS, lambda share: advanced(TEXT_SHARE + (1 - TEXT_SHARE) * share))
    return tuple(object_files)


def _make(module: str, calls: Mapping[Path, Sequence[str]], steps: int, advanced: Callable[[float], None]) -> None:
    """Make files that are missing: a module writes each, with its arguments, all at once in processes of their own.

    Numba's settings hold for a whole process, and a process can be ended.

    Args:
        steps: how many dots each prints.

    Raises:
        ObjectError: one failed.
    """
    missing = {path: arguments for path, arguments in calls.items() if not path.exists()}
    if not missing:
        return
    with contextlib.ExitStack() as files:
        code, output = run_waiting(
            [
                python_command("-m", module, *arguments, str(files.enter_context(whole_file(path))))
                for path, arguments in missing.items()
            ],
            _environment(),
            lambda dots: advanced(min(dots / (steps * len(missing)), 1.0)),
        )
        if code:
            raise ObjectError(f"the kernels cannot be compiled: {reason_of(code, output)}")


def reason_of(code: int, output: str) -> str:
    """The reason why a process failed: its first line with an error, else its last; else its exit status."""
    lines = [line.strip() for line in output.splitlines() if line.strip()]
    named = [line for line in lines if "error:" in line.lower()]
    return next(iter(named or lines[-1:]), f"its process ended with status {code}; free some memory and try again")


def run_waiting(
    commands: Sequence[Sequence[str]], environment: Mapping[str, str] | None, waiting: Callable[[int], None]
) -> tuple[int, str]:
    """The first exit status that is not 0 of commands that run at once, and what they reported.

    They are ended where `waiting` raises, or when one has failed.

    Args:
        waiting: is called a few times a second with the number of bytes that the commands have printed.
    """
    with tempfile.TemporaryFile() as errors, tempfile.TemporaryFile() as printed:
        running = [subprocess.Popen(command, env=environment, stdout=printed, stderr=errors) for command in commands]
        try:
            for process in running:
                while process.poll() is None:
                    waiting(os.fstat(printed.fileno()).st_size)
                    with contextlib.suppress(subprocess.TimeoutExpired):
                        process.wait(WAIT_S)
                if process.returncode:
                    break
        finally:
            for process in running:
                process.kill()
                process.wait()
        errors.seek(0)
        status = next((process.returncode for process in running if process.returncode), 0)
        return status, errors.read().decode(errors="replace")


def _environment() -> dict[str, str]:
    """The environment of processes whose Numba optimises nothing, for a generic processor."""
    environment = {name: value for name, value in python_environment().items() if not name.startswith("NUMBA_")}
    processor = {"NUMBA_OPT": "0", "NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": ""}
    return {**environment, **processor, "NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING": "1"}


def _compiled(text: str, target: System, number: int) -> bytes:
    """The object file for a processor of the target: entries "ls0_render" …, all else internal, nothing of Python."""
    import llvmlite.binding as llvm

    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    machine = llvm.Target.from_triple(target.triple).create_target_machine(
        cpu=target.cpus[number], opt=3, reloc="pic", codemodel="default"
    )
    _step()
    entries = f"ls{number}_"
    text = text.replace(f"@{texts.PREFIX}", f"@{entries}")
    text = re.sub(r"^target datalayout = .*$", f'target datalayout = "{machine.target_data}"', text, flags=re.M)
    text = re.sub(r"^target triple = .*$", f'target triple = "{target.triple}"', text, flags=re.M)
    whole = llvm.parse_assembly(_without_counts(text))
    _step()
    for function in whole.functions:
        if function.name.startswith(entries):
            function.visibility = llvm.Visibility.hidden
        elif not function.is_declaration:
            function.linkage = llvm.Linkage.internal
    for variable in whole.global_variables:
        if not variable.is_declaration:
            variable.linkage = llvm.Linkage.internal
    options = llvm.create_pipeline_tuning_options(speed_level=3)
    options.loop_vectorization = options.slp_vectorization = True
    builder = llvm.create_pass_builder(machine, options)
    builder.getModulePassManager().run(whole, builder)
    _step()
    _check_names(whole, {entries + name for names in texts.PARTS.values() for name in names})
    emitted: bytes = machine.emit_object(whole)
    _step()
    return emitted


def _step() -> None:
    """Print a dot, which `_make` counts as progress."""
    print(".", end="", flush=True)


def _without_counts(text: str) -> str:
    """The code without the counting of references: no array of a plug-in's memory has an owner."""
    return re.sub(
        r"^define void @NRT_(incref|decref)\(ptr (%\S+)\)[^{]*\{.*?^\}",
        r"define void @NRT_\1(ptr \2) {\n  ret void\n}",
        text,
        flags=re.M | re.S,
    )


def _check_names(module: object, entries: set[str]) -> None:
    """Raise ObjectError where the code refers to anything that the shell or the C library does not give."""
    functions = module.functions  # type: ignore[attr-defined]
    declared = {
        function.name for function in functions if function.is_declaration and not function.name.startswith("llvm.")
    }
    unknown = declared - ALLOWED - STUBS - entries
    if unknown:
        raise ObjectError(f"the kernels refer to {', '.join(sorted(unknown))}, which no plug-in has")


if __name__ == "__main__":
    code, made_for, which, path = sys.argv[1:]
    try:
        made = _compiled(Path(code).read_text(encoding="utf-8"), TARGETS[made_for], int(which))
        Path(path).write_bytes(made)
    except ObjectError as error:
        sys.exit(str(error))
    except OSError as error:
        sys.exit(explain(Path(path).parent, error))
