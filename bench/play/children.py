"""Programs that the benchmark needs and starts: a check that they are installed, and that none outlives it."""

from __future__ import annotations

import contextlib
import shutil
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from typing import IO, Any

PATIENCE_S = 5.0  # from terminating a child to killing it
PACKAGES = {  # of Debian and its kin
    "pulseaudio": "pulseaudio",
    "pacat": "pulseaudio-utils",
    "parec": "pulseaudio-utils",
    "pactl": "pulseaudio-utils",
    "Xvfb": "xvfb",
    "jackd": "jackd2",
}


class Missing(RuntimeError):
    """Something of the computer that the benchmark cannot do without."""


def need_programs(*programs: str) -> None:
    """Raise `Missing` with the names of those that are absent, and what to install."""
    absent = [program for program in programs if shutil.which(program) is None]
    if absent:
        packages = " ".join(sorted({PACKAGES[program] for program in absent}))
        raise Missing(
            f"this benchmark needs {', '.join(absent)}: install {packages} (on Debian: apt install {packages})"
        )


@contextlib.contextmanager
def child(
    command: Sequence[str],
    environment: Mapping[str, str],
    stdout: IO[Any] | int | None = subprocess.DEVNULL,
    stderr: IO[Any] | int | None = subprocess.DEVNULL,
) -> Iterator[subprocess.Popen[bytes]]:
    """A process that is ended with the block, also where that raises; on Linux also where this process is killed."""
    with_parent = ("setpriv", "--pdeathsig", "TERM") if shutil.which("setpriv") else ()
    command = (*with_parent, *command)
    process = subprocess.Popen(command, env=environment, stdin=subprocess.DEVNULL, stdout=stdout, stderr=stderr)
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        if process.stdout is not None:
            process.stdout.close()
