"""Text made fit for one line of a terminal or a label.

It comes from a file, or gives a duration in words.
"""

from __future__ import annotations

import time

LONGEST_MESSAGE = 500  # characters


def printable(text: str) -> str:
    """The text with its lines, and without anything that commands a terminal."""
    return "".join(c if c.isprintable() or c == "\n" else " " for c in text)


def one_line(text: str, most: int = LONGEST_MESSAGE) -> str:
    """The text in one line of printable characters, its middle left out where it is longer than `most`.

    Control characters, escapes, line ends and marks that turn the direction of text become spaces. Nothing can
    forge a second line or command a terminal. Beginning and end stay: a message names its file at the beginning
    and the remedy at the end.
    """
    if len(text) > 4 * most:  # what is left out need not be looked at
        text = f"{text[: 2 * most]}{text[-2 * most :]}"
    line = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    if len(line) <= most:
        return line
    end = most // 3
    return f"{line[: most - end - 3].rstrip()} … {line[-end:].lstrip()}"


class LineError(Exception):
    """An error whose message is one line, whatever is quoted in it."""

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message))


def name_text(name: str) -> str:
    """A file's name as text that can be written anywhere: bytes of it that are no characters become "�"."""
    return "".join("\ufffd" if "\ud800" <= c <= "\udfff" else c for c in name)


def duration(seconds: float) -> str:
    """A duration in words, such as "25 ms", "0.25 s", "8.24 s", "32 s", "3 min 20 s", "2 h 5 min"."""
    if seconds < 59.5:
        short = f"{1000 * seconds:.3g} ms" if 0 < seconds < 0.0995 else f"{seconds:.3g} s"
        return short if seconds < 9.95 else f"{seconds:.0f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"


def time_left(began_s: float, share: float, left_s: float | None = None) -> str:
    """The time left of work that began at a time of `time.monotonic`, as "5 s left"; "" where it is not known."""
    if left_s is None and share > 0:
        left_s = (time.monotonic() - began_s) * (1 - share) / share
    return f"{duration(max(left_s, 1.0))} left" if left_s else ""
