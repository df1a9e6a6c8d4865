"""A training step compared with the code of the paper's authors, in one run on the same cores."""

from __future__ import annotations

import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from subprocess import PIPE
from typing import Any

import torch

from bench import train
from engine.models.base import count_parameters
from training.cli.console import Failure, ProgressReport

MODELS = ("koopman_var", "koopman", "s5", "lru")
DRIVER = Path(__file__).with_name("physmodjax_step.py")
TURNS = 10


@dataclass(frozen=True)
class AuthorsTiming:
    """The fastest step of ours and of theirs.

    Attributes:
        ratio: ours over theirs.
        processor_ratio: of the times of all threads together, which other programs lengthen little.
    """

    model: str
    batch: int
    frames: int
    parameters: int
    step_s: float
    authors_s: float
    ratio: float
    processor_ratio: float


def measure(python: Path, source: Path, report: ProgressReport) -> dict[str, Any]:
    """Take steps of ours and of theirs in turns, on as many threads, with AdamW and the loss of the paper's text.

    Args:
        python: has jax, flax, optax and einops.
        source: a clone of rodrigodzf/physmodjax.

    Raises:
        Failure: their code cannot be run, or its model has another size.
    """
    found = []
    for number, name in enumerate(MODELS):
        model, step = train.training_step(name, train.FRAMES)
        sizes = train.BATCH, train.FRAMES, model.grid_points, torch.get_num_threads()
        own, others = [], []
        with _driver(*map(str, (python, DRIVER, source, name, *sizes))) as answer:
            parameters = count_parameters(model)
            if [parameters] != (theirs := answer()):
                raise Failure(f"{name} has {parameters} parameters, but {theirs[0]:.0f} in {source}")
            for turn in range(1 + TURNS):  # the first of each does not count
                report((number + turn / (1 + TURNS)) / len(MODELS), name)
                began, busy = time.perf_counter(), time.process_time()
                step()
                own.append((time.perf_counter() - began, time.process_time() - busy))
                others.append(answer())
        step_s, busy_s = map(min, zip(*own[1:], strict=True))
        authors_s, authors_busy_s = map(min, zip(*others[1:], strict=True))
        ratios = step_s / authors_s, busy_s / authors_busy_s
        found.append(AuthorsTiming(name, train.BATCH, train.FRAMES, parameters, step_s, authors_s, *ratios))
    return {"models": tuple(found)}


@contextmanager
def _driver(*command: str) -> Iterator[Callable[[], list[float]]]:
    """A process of another Python that answers each line with one of numbers; what asks it."""
    with tempfile.TemporaryFile("w+") as errors:
        try:
            process = subprocess.Popen(command, stdin=PIPE, stdout=PIPE, stderr=errors, text=True)
        except OSError as error:
            raise Failure(
                f"{command[0]}: cannot be started ({error.strerror}); name a Python that has jax"
            ) from error

        def answer() -> list[float]:
            assert process.stdin is not None and process.stdout is not None
            with suppress(BrokenPipeError):
                print(file=process.stdin, flush=True)
            if line := process.stdout.readline():
                return [float(number) for number in line.split()]
            errors.seek(0)
            last = (errors.read().splitlines() or ["it ended"])[-1]
            raise Failure(f"the authors' code in {command[2]} cannot be run by {command[0]}: {last}")

        with process:
            try:
                yield answer
            finally:
                process.kill()
