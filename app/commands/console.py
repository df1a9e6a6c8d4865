"""What the commands say: results on standard output, everything else on standard error."""

from __future__ import annotations

import io
import json
import math
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Protocol

from app.shared.durations import duration
from engine.plain_text import one_line

LINE_EVERY_S = 10.0  # of progress, where standard error is not a terminal
WIDTH_WITHOUT_TERMINAL = 1000  # a line stays a line


class Report(Protocol):
    """Is told how far a piece of work is."""

    def __call__(self, share: float, text: str = "", left_s: float | None = None) -> None:
        """`share` in 0 … 1; `left_s` where the work knows better than its past speed what is left."""


class Shares:
    """Progress of several pieces of work of one length, one after the other."""

    def __init__(self, report: Report, pieces: int) -> None:
        self._report, self._pieces, self._begun = report, pieces, 0

    def next(self) -> Callable[[float], None]:
        """What the next piece tells its share to."""
        before, self._begun = self._begun, self._begun + 1
        return lambda share: self._report((before + share) / self._pieces)


class Failure(Exception):
    """A command cannot be done. The message is one line: what is wrong, where, and the remedy."""

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))


def say(text: str) -> None:
    """One line on standard error, whatever a file's text holds."""
    print(f"learned-strings: {one_line(text)}", file=sys.stderr, flush=True)


def use_any_output() -> None:
    """Output that is not UTF-8 shows what it can: other characters are written as their codes."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def print_json(value: Any) -> None:
    text = json.dumps(_finite(value), indent=2, allow_nan=False, ensure_ascii=False)
    print("".join(c if c.isprintable() or c == "\n" else json.dumps(c)[1:-1] for c in text))


def print_table(columns: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """A table; columns whose cells are numbers stand to the right."""
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
def progress(what: str) -> Iterator[Report]:
    """A function that shows how far the work is and how long it will take.

    A bar where standard error is a terminal, else a line now and then.
    """
    if not sys.stderr.isatty():
        yield _Lines(what)
        return
    from rich import progress as bars
    from rich.console import Console

    columns = (
        bars.TextColumn("{task.description}"),
        bars.BarColumn(bar_width=10),
        bars.TextColumn("{task.fields[left]}"),
        bars.TextColumn("{task.fields[text]}"),
    )
    started = time.monotonic()
    with bars.Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=1.0, left="", text="")

        def report(share: float, text: str = "", left_s: float | None = None) -> None:
            bar.update(task, completed=share, text=text, left=_left(started, share, left_s))

        yield report


class _Lines:
    """Progress for a log: a line at most every few seconds, none for what is quickly done."""

    def __init__(self, what: str) -> None:
        self._what = what
        self._started = self._last = time.monotonic()

    def __call__(self, share: float, text: str = "", left_s: float | None = None) -> None:
        now = time.monotonic()
        if now - self._last >= LINE_EVERY_S and share < 1:
            self._last = now
            say(f"{self._what}: {share:.0%}, {_left(self._started, share, left_s)} {text}")


def _left(started: float, share: float, left_s: float | None) -> str:
    if left_s is None:
        if share <= 0:
            return ""
        left_s = (time.monotonic() - started) * (1 - share) / share
    return f"{duration(left_s)} left"


def number(value: float | None) -> str:
    """An error for people: four digits, or a dash for one that is not known."""
    return "-" if value is None else f"{value:.4g}"


def _cell(value: object) -> str:
    if isinstance(value, float) or value is None:
        return number(value)
    return f"{value:,}" if isinstance(value, int) else one_line(str(value))


def _finite(value: Any) -> Any:
    """JSON knows neither infinity nor not-a-number: null stands for them."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(entry) for entry in value]
    return value
