"""Numba's internals that this project replaces, as they are in Numba `VERSION`; a test says where another differs."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

VERSION = "0.68"
NOWHERE = 1  # an address that is never called


def compile_for_callers_alone() -> None:
    """Compile what compiled code calls for that code alone, once for all numbers that its calls state.

    Numba would optimise each function with all that it calls, and make it callable from Python: what is called over
    eight levels was made into machine code eight times. Here that is made only of what Python or a device calls, from
    the code of all that it calls. So what Python and compiled code call is compiled twice.
    """
    from llvmlite.binding import Linkage
    from numba.core.codegen import CPUCodeLibrary, JITCodeLibrary, JITCPUCodegen
    from numba.core.dispatcher import Dispatcher
    from numba.core.environment import lookup_environment
    from numba.core.types.misc import unliteral

    template, overload = Dispatcher.get_call_template, Dispatcher.get_overload
    address, usual_set_env = JITCodeLibrary.get_pointer_to_function, JITCPUCodegen.set_env

    def called(dispatcher: Any) -> Any:
        """The dispatcher of the same function that compiled code calls: without an entry for Python."""
        if dispatcher.targetoptions.get("no_cpython_wrapper"):
            return dispatcher
        if not hasattr(dispatcher, "called"):
            options = {**dispatcher.targetoptions, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
            dispatcher.called = type(dispatcher)(dispatcher.py_func, dispatcher.locals, options)
        return dispatcher.called

    def get_call_template(dispatcher: Any, arguments: Any, named: Any) -> Any:
        return template(called(dispatcher), tuple(map(unliteral, arguments)), named)

    def get_overload(dispatcher: Any, signature: Any) -> Any:
        return overload(called(dispatcher), signature)

    def get_pointer_to_function(library: Any, name: str) -> Any:
        entries = {function.name for function in library._final_module.functions}
        return address(library, name) if library._finalized or name in entries else NOWHERE

    def set_env(codegen: Any, name: str, environment: Any) -> None:
        if codegen._engine.is_symbol_defined(name):
            usual_set_env(codegen, name, environment)

    def add_linking_library(library: Any, other: Any) -> None:
        library._linking_libraries.append(other)

    def finalize(library: Any) -> None:
        for other in list(libraries(library))[1:]:
            library._reload_init.update(other._reload_init)
            module = other._final_module.clone()
            for function in module.functions:
                if not function.is_declaration and function.linkage == Linkage.external:
                    function.linkage = "linkonce_odr"
            library._final_module.link_in(module)
        library._optimize_final_module()
        library._final_module.verify()
        library._finalize_final_module()
        for variable in library._final_module.global_variables:
            if environment := lookup_environment(variable.name):
                library.codegen.set_env(variable.name, environment)

    Dispatcher.get_call_template = get_call_template  # type: ignore[method-assign, assignment]
    Dispatcher.get_overload = get_overload  # type: ignore[method-assign, assignment]
    JITCodeLibrary.get_pointer_to_function = get_pointer_to_function
    JITCPUCodegen.set_env = set_env
    CPUCodeLibrary.add_linking_library = add_linking_library
    CPUCodeLibrary.finalize = finalize


def libraries(library: Any, seen: set[int] | None = None) -> Iterator[Any]:
    """A library and all that it calls, each once."""
    seen = set() if seen is None else seen
    if id(library) not in seen:
        seen.add(id(library))
        yield library
        for other in library._linking_libraries:
            yield from libraries(other, seen)


def keep_machine_code_alone() -> None:
    """Keep a function's machine code and names: nothing that is loaded is called by what is compiled."""
    from numba.core.codegen import CPUCodeLibrary

    def serialize(library: Any) -> Any:
        library._ensure_finalized()
        module = library._final_module
        defined = [each.name for each in (*module.functions, *module.global_variables) if not each.is_declaration]
        return library.name, library._get_compiled_object(), defined

    def unserialize(kind: Any, codegen: Any, state: Any) -> Any:
        name, code, defined = state
        library = codegen.create_library(name)
        library.enable_object_caching()
        library._set_compiled_object(code)
        library._finalize_final_module()
        codegen._engine._defined_symbols.update(defined)
        return library

    CPUCodeLibrary.serialize_using_object_code = serialize
    CPUCodeLibrary._unserialize = classmethod(unserialize)


def write_code_alone() -> None:
    """Leave Numba's code as it is lowered: not optimised, not linked, not made into machine code.

    It holds for functions without an entry for Python. A dot is printed for each.
    """
    import numba
    from numba.core.codegen import CPUCodeLibrary

    numba.cfunc = lambda *_signature, **_options: lambda function: function  # what devices call is not asked for
    CPUCodeLibrary._optimize_functions = lambda library, module: print(".", end="", flush=True)


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
