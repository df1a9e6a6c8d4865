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
