"""Numba's internals that this project replaces, as they are in Numba `VERSION`; a test says where another differs."""

from __future__ import annotations

from typing import Any

VERSION = "0.68"
NOWHERE = 1  # an address that is never called


def compile_once_for_all_numbers() -> None:
    """Let a function be compiled once for all numbers that its calls state, not once for each."""
    from numba.core.dispatcher import Dispatcher
    from numba.core.types.misc import unliteral

    usual = Dispatcher.get_call_template

    def template(dispatcher: Any, arguments: Any, named: Any) -> Any:
        return usual(dispatcher, tuple(map(unliteral, arguments)), named)

    Dispatcher.get_call_template = template  # type: ignore[method-assign, assignment]


def keep_bitcode_alone() -> None:
    """Let a function that is loaded keep its bitcode, not the module parsed from it: 30 MB of all together.

    The module is parsed again where another function that calls it is compiled.
    """
    from llvmlite import binding
    from numba.core.codegen import CPUCodeLibrary

    load, link = CPUCodeLibrary._unserialize.__func__, CPUCodeLibrary._get_module_for_linking

    def unserialize(kind: Any, codegen: Any, state: Any) -> Any:
        library = load(kind, codegen, state)
        _, form, data = state
        if form == "object":
            library._bitcode, library._shared_module = data[1], None
        return library

    def module_for_linking(library: Any) -> Any:
        if library._shared_module is None and hasattr(library, "_bitcode"):
            library._shared_module = binding.parse_bitcode(library._bitcode)
        return link(library)

    CPUCodeLibrary._unserialize = classmethod(unserialize)
    CPUCodeLibrary._get_module_for_linking = module_for_linking


def stop_before_machine_code() -> None:
    """Leave Numba's code as it is lowered: not optimised, not linked, not made into machine code.

    A dot is printed for each function. Nothing that is compiled in this process can be called afterwards.
    """
    import numba
    from numba.core.codegen import CPUCodeLibrary, JITCodeLibrary, JITCPUCodegen

    def finalize(library: Any) -> None:
        library._finalized = True
        print(".", end="", flush=True)

    numba.cfunc = lambda *_signature, **_options: lambda function: function  # what devices call is not asked for
    CPUCodeLibrary._optimize_functions = lambda library, module: None
    CPUCodeLibrary.finalize = finalize
    JITCodeLibrary.get_pointer_to_function = lambda library, name: NOWHERE
    JITCPUCodegen.set_env = lambda codegen, name, env: None


def keep_cache_when_moved() -> None:
    """Let compiled functions be found again where the whole program lies in another folder, also in a bundle."""
    from hashlib import sha256
    from pathlib import Path

    from numba.core.caching import UserProvidedCacheLocator

    def subpath(kind: Any, source: str) -> str:
        return "_".join(Path(source).parts[-3:-1])

    def stamp(locator: Any) -> bytes:
        return sha256(Path(locator._py_file).read_bytes()).digest()

    UserProvidedCacheLocator.get_suitable_cache_subpath = classmethod(subpath)
    UserProvidedCacheLocator.get_source_stamp = stamp
