"""LLVM code of the kernels' entries as text, without any machine code: `python -m app.export.plugin.texts PART FILE`.

Numba stops at its own code, which is linked once. The parts are written by processes of their own, at once. A dot is
printed for each function.
"""

from __future__ import annotations

import gc
import sys
from pathlib import Path
from typing import Any

from engine.kernels.numba_internals import libraries, write_code_alone
from engine.whole_file import explain

PREFIX = "ls_"  # of the entries' names
# Entries of each; those that mixers call stand in its namespace under the same names
PARTS = {
    "mixing": ("render", "drive", "begin_convolver", "measure", "prepare", "weigh", "mix"),
    "playing": ("play", "sound", "sympathise", "begin", "kit_begin", "kit_follow", "kit_prepare"),
}
SELDOM = 50_000, 20, 50  # of objects and passes: a fifth of the time went to collections that freed next to nothing


def _external_entry(name: str) -> Any:
    """A stand-in for an entry of another part: it calls that symbol with two addresses."""
    from llvmlite import ir
    from numba import types
    from numba.core import cgutils
    from numba.extending import intrinsic

    place, whole = ir.IntType(8).as_pointer(), ir.IntType(64)

    @intrinsic
    def entry(typing_context, one, other):  # type: ignore[no-untyped-def]
        def generate(context, builder, _signature, arguments):  # type: ignore[no-untyped-def]
            kind = ir.FunctionType(ir.IntType(32), [place.as_pointer(), place.as_pointer(), whole, whole])
            function = cgutils.get_or_insert_function(builder.module, kind, PREFIX + name)
            nothing = [cgutils.alloca_once(builder, place) for _ in range(2)]
            builder.call(function, [*nothing, *arguments])
            return context.get_dummy_value()

        return types.void(types.int64, types.int64), generate

    return entry


def text(part: str) -> str:
    """LLVM code of all entries of a part together, as Numba has it for the processor of its settings."""
    write_code_alone()
    import llvmlite.binding as llvm
    from numba import njit, types

    from engine.kernels import compiled

    compiled.COMPILED["cache"] = False
    compiled.COMPILED["no_cpython_wrapper"] = compiled.COMPILED["no_cfunc_wrapper"] = True
    from engine.kernels import bank, mixer, plugin, rendered

    for kind in (bank, rendered):  # of voices, which the compiled player does not make
        kind.generate = njit(lambda *_: None)  # type: ignore[attr-defined]
    for name in (entry for entries in PARTS.values() for entry in entries if hasattr(mixer, entry)):
        if name not in PARTS[part]:
            setattr(mixer, name, _external_entry(name))
    private = llvm.Linkage.internal, llvm.Linkage.private
    whole = llvm.parse_assembly("")
    seen = set[int]()  # ids of libraries that are linked already
    defined = set[str]()  # names of functions that have a body already
    for name in PARTS[part]:
        kernel, arguments = plugin.ENTRIES[name]
        entry = njit(types.void(*arguments), **compiled.COMPILED)(kernel.py_func)
        overload = entry.overloads[entry.signatures[0]]
        for library in libraries(overload.library, seen):
            module = library._final_module
            for function in module.functions:
                if not function.is_declaration and function.linkage not in private:
                    function.linkage = "linkonce_odr" if function.name in defined else "external"
                    defined.add(function.name)
            whole.link_in(module)
        whole.get_function(overload.fndesc.llvm_func_name).name = PREFIX + name
    return str(whole)


if __name__ == "__main__":
    gc.set_threshold(*SELDOM)
    written, place = text(sys.argv[1]), Path(sys.argv[2])
    try:
        place.write_text(written, encoding="utf-8")
    except OSError as error:
        sys.exit(explain(place.parent, error))
