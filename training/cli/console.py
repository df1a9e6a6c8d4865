"""Output of the commands: results on standard output, notes, progress and failures on standard error."""

from __future__ import annotations

import io
import json
import math
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Protocol

from engine.plain_text import LineError, one_line, time_left

LINE_EVERY_S = 10.0  # between two lines of progress
WIDTH_WITHOUT_TERMINAL = 1000  # characters: no row of a table is wrapped


class ProgressReport(Protocol):
    """The report that receives the progress of a piece of work."""

    def __call__(self, share: float, text: str = "", left_s: float | None = None) -> None:
        """`share`: done, 0 … 1; `left_s`: the time left; None: it is estimated from the time taken so far."""


class Shares:
    """Progress of several pieces of work of equal length, one after the other."""

    def __init__(self, report: ProgressReport, pieces: int) -> None:
        self._report = report
        self._pieces = pieces  # in all
        self._begun = 0  # pieces

    def next(self) -> Callable[[float], None]:
        """Begin the next piece; return a function that is called with the share of it that is done, 0 … 1."""
        before, self._begun = self._begun, self._begun + 1
        return lambda share: self._report((before + share) / self._pieces)


class Failure(LineError):
    """A command cannot be carried out. The message, one line, says what is wrong, where, and the remedy."""


def say(text: str) -> None:
    """Print one line on standard error; line breaks and control characters in `text` are escaped."""
    print(f"learned-strings: {one_line(text)}", file=sys.stderr, flush=True)


def use_any_output() -> None:
    """Make output in an encoding without some characters print their codes instead of failing."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def print_json(value: Any) -> None:
    """Print JSON, with null for infinity and not-a-number, and unprintable characters escaped."""
    text = json.dumps(_finite(value), indent=2, allow_nan=False, ensure_ascii=False)
    print("".join(c if c.isprintable() or c == "\n" else json.dumps(c)[1:-1] for c in text))


def print_table(columns: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """Print a table; columns of numbers are aligned to the right."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD)
    for place, name in enumerate(columns):
        numbers = any(isinstance(row[place], int | float) for row in rows)
        table.add_column(name, justify="right" if numbers else "left", overflow="fold")
    for row in rows:
        table.add_row(*(_cell(value) for value in row))
    Console(width=None if sys.stdout.isatty() else WIDTH_WITHOUT_TERMINAL, markup=False, highlight=False).print(table)


@contextmanager
def bars(every_s: float = LINE_EVERY_S) -> Iterator[Callable[[str], ProgressReport]]:
    """A function that begins the progress of a named piece of work; several may be under way.

    In a terminal each has a bar with the time left until its share is 1; elsewhere each prints lines.

    Args:
        every_s: between two lines of a piece of work, at least.
    """
    if not sys.stderr.isatty():
        yield lambda what: _Lines(what, every_s)
        return
    from rich import progress as rich
    from rich.console import Console

    columns = (
        rich.TextColumn("{task.description}", markup=False),
        rich.BarColumn(bar_width=10),
        rich.TextColumn("{task.fields[left]}", markup=False),
        rich.TextColumn("{task.fields[text]}", markup=False),
    )
    with rich.Progress(*columns, console=Console(stderr=True), transient=True) as bar:

        def begin(what: str) -> ProgressReport:
            task, started = bar.add_task(what, total=1.0, left="", text=""), time.monotonic()

            def report(share: float, text: str = "", left_s: float | None = None) -> None:
                left = time_left(started, share, left_s)
                bar.update(task, completed=share, text=text, left=left, visible=share < 1)

            return report

        yield begin


@contextmanager
def progress(what: str) -> Iterator[ProgressReport]:
    """A function that shows the progress of one piece of work, as `bars` does."""
    with bars() as begin:
        yield begin(what)


class _Lines:
    """Progress for a log: a line now and then, none for work that takes less."""

    def __init__(self, what: str, every_s: float) -> None:
        self._what, self._every_s = what, every_s  # the work's name, and the least time between two lines
        self._started = self._last = time.monotonic()  # when work began, and the last line was printed

    def __call__(self, share: float, text: str = "", left_s: float | None = None) -> None:
        now = time.monotonic()
        if now - self._last >= self._every_s and share < 1:
            self._last = now
            say(f"{self._what}: {share:.0%}, {time_left(self._started, share, left_s)} {text}")


def number(value: float | None) -> str:
    """A number for people: four digits, or "-" for None."""
    return "-" if value is None else f"{value:.4g}"


def _cell(value: object) -> str:
    if isinstance(value, float) or value is None:
        return number(value)
    return f"{value:,}" if isinstance(value, int) else one_line(str(value))


def _finite(value: Any) -> Any:
    """`value` with None for infinity and not-a-number, which JSON does not have."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(entry) for entry in value]
    return value
