"""The start of the bundle: the command line; for processes that the program starts, what `python -P` does."""

from __future__ import annotations

import multiprocessing
import os
import runpy
import sys

# Kernels in the bundle are compiled for any processor with these, x86 since 2013 or so, not for the one that made it.
COMMON_PROCESSOR = "x86-64-v3"
ITS_FEATURES = ("avx2", "bmi2", "fma")


def main() -> int:
    """Do what the words ask, and return the exit status."""
    multiprocessing.freeze_support()
    choose_processor()
    if sys.argv[1:2] == ["-P"]:
        run_python(sys.argv[2], sys.argv[3], sys.argv[4:])
        return 0
    from app.commands.cli import main

    return main()


def choose_processor() -> None:
    """Let Numba compile for COMMON_PROCESSOR where this one has its features: then it finds the bundle's kernels."""
    from llvmlite.binding import get_host_cpu_features

    present = get_host_cpu_features()
    if all(present.get(feature) for feature in ITS_FEATURES):
        os.environ |= {"NUMBA_CPU_NAME": COMMON_PROCESSOR, "NUMBA_CPU_FEATURES": ""}


def run_python(option: str, text: str, arguments: list[str]) -> None:
    """Run a module ("-m") or code ("-c") as Python does."""
    sys.argv = [text if option == "-m" else option, *arguments]
    if option == "-m":
        runpy.run_module(text, run_name="__main__", alter_sys=True)
    else:
        exec(compile(text, "<string>", "exec"), {"__name__": "__main__"})


if __name__ == "__main__":
    sys.exit(main())
