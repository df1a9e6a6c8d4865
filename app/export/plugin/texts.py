"""LLVM code of the kernels' entries as text, without any machine code: `python -m app.export.plugin.texts FILE`.

Numba would optimise and emit each function with all that it calls, several times over. Here it stops at its own code,
which is linked once. Its first lines name the entries. A dot is printed for each function.
"""

from __future__ import annotations

import gc
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ENTRIES = ("render", "begin", "partition")
SELDOM = 50_000, 20, 50  # of objects and passes: a fifth of the time went to collections that freed next to nothing
NOWHERE = 1  # an address that is never called


def _stop_early() -> None:
    """Leaves Numba's code as it is lowered: not optimised, not linked, not made into machine code."""
    from numba.core.codegen import CPUCodeLibrary, JITCodeLibrary, JITCPUCodegen

    def finalize(library: Any) -> None:
        library._finalized = True
        print(".", end="", flush=True)

    CPUCodeLibrary._optimize_functions = lambda library, module: None
    CPUCodeLibrary.finalize = finalize
    JITCodeLibrary.get_pointer_to_function = lambda library, name: NOWHERE
    JITCPUCodegen.set_env = lambda codegen, name, env: None


def _libraries(library: Any, seen: set[int]) -> Iterator[Any]:
    """A library and all that it calls, each once."""
    if id(library) not in seen:
        seen.add(id(library))
        yield library
        for each in library._linking_libraries:
            yield from _libraries(each, seen)


def texts() -> str:
    """LLVM code of all entries together, as Numba has it for the processor of its settings."""
    _stop_early()
    import llvmlite.binding as llvm
    from numba import njit

    from engine.kernels import compiled

    compiled.COMPILED["cache"] = False
    compiled.COMPILED["no_cpython_wrapper"] = compiled.COMPILED["no_cfunc_wrapper"] = True
    from engine.kernels import plugin

    own = llvm.Linkage.internal, llvm.Linkage.private
    whole, heads, seen, defined = llvm.parse_assembly(""), [], set[int](), set[str]()
    for name in ENTRIES:
        entry = njit(getattr(plugin, name.upper()), **compiled.COMPILED)(getattr(plugin, name).py_func)
        overload = entry.overloads[entry.signatures[0]]
        heads.append(f"; {name} {overload.fndesc.llvm_func_name}\n")
        for library in _libraries(overload.library, seen):
            module = library._final_module
            for function in module.functions:
                if not function.is_declaration and function.linkage not in own:
                    function.linkage = "linkonce_odr" if function.name in defined else "external"
                    defined.add(function.name)
            whole.link_in(module)
    return "".join(heads) + str(whole)


if __name__ == "__main__":
    gc.set_threshold(*SELDOM)
    Path(sys.argv[1]).write_text(texts(), encoding="utf-8")
