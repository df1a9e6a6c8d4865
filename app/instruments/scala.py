"""Readers of Scala's scales (.scl) and keyboard mappings (.kbm), by the texts of the two formats.

Source: Manuel Op de Coul, "Scala scale file format", and the template of a keyboard mapping in Scala's help. What
programs write besides is read where it has one meaning: empty lines, tabs, spaces before a comment.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from engine.bounds import brief

MOST_NOTES = 1_000  # of a scale
MOST_KEYS = 20_000  # of a mapping's pattern, and the largest degree in one
LARGEST_CENTS = 240_000.0  # of an interval: 200 octaves
MOST_DIGITS = 400  # of a number
HIGHEST_KEY = 127

_LINE_END = re.compile(r"\r\n|\r|\n")
# Text may follow a number, but nothing that would change it.
_BEHIND = r"(?![0-9/]|[\\^*][ \t]*[0-9(]|[.,:][0-9]|[eE+-][+-]?[0-9])"
_COUNT = re.compile(r"[0-9]+(?=\s|!|$)")
_WHOLE = re.compile(r"[+-]?[0-9]+(?=\s|!|$)")
_FREQUENCY = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?" + _BEHIND)
_CENTS = re.compile(r"[+-]?(?:[0-9]+\.[0-9]*|\.[0-9]+)" + _BEHIND)
_RATIO = re.compile(r"([+-]?[0-9]+)(?:[ \t]*/[ \t]*([0-9]+)|(?![ \t]*/[ \t]*[0-9]))" + _BEHIND)
_UNMAPPED = re.compile(r"[xX](?=\s|!|$)")
_NUMBER = re.compile(r"[+-]?\.?[0-9]")  # the beginning of one


@dataclass(frozen=True)
class Scale:
    """The pitch of each degree, in octaves above degree 0.

    Attributes:
        octaves: of degrees 1 … n; the last is the interval after which the scale repeats.
    """

    octaves: tuple[float, ...]

    def octaves_of(self, degree: int) -> float:
        """The pitch of any degree: the scale is repeated above and below."""
        if not self.octaves:
            return 0.0  # 1/1 alone, repeated at 1/1
        periods, rest = divmod(degree, len(self.octaves))
        return periods * self.octaves[-1] + (self.octaves[rest - 1] if rest else 0.0)


@dataclass(frozen=True)
class Keymap:
    """A mapping of keys to degrees of a scale.

    Attributes:
        first, last: the keys that are retuned.
        middle: the key of the pattern's first entry.
        reference: the key whose frequency is given.
        octave: the degrees between a pattern and its repetition; 0: the scale's highest degree.
        pattern: the degree of each key, None where it has none; empty: each key is one degree above the one below it.
    """

    first: int
    last: int
    middle: int
    reference: int
    reference_hz: float
    octave: int
    pattern: tuple[int | None, ...]

    def degree(self, key: int, scale: Scale) -> int | None:
        """The degree that a key plays; None: it is left out."""
        place = key - self.middle
        if not self.pattern:
            return place
        repeats, rest = divmod(place, len(self.pattern))
        degree = self.pattern[rest]
        return None if degree is None else degree + repeats * (self.octave or len(scale.octaves))


EQUAL_STEPS = Scale(tuple(step / 12 for step in range(1, 13)))  # twelve to the octave


def parse_scale(text: str) -> Scale:
    """The scale in the text of a .scl file.

    Raises:
        ValueError: it is none, or one beyond the bounds of this module; the message quotes the line.
    """
    lines = [line for line in _LINE_END.split(text) if not line.startswith("!")]
    count_line, *pitch_lines = _filled_lines(lines[1:]) or [""]  # the first, which may be empty, is the description
    count_match = _COUNT.match(count_line)
    if count_match is None:
        raise ValueError(f"its number of notes, below its description, is {brief(count_line)}; it is no scale")
    digits = count_match.group().lstrip("0") or "0"
    count = int(digits[:9])
    if count <= min(len(pitch_lines), MOST_NOTES):
        octaves = tuple(_octaves(line) for line in pitch_lines[:count])
        if not any(map(_NUMBER.match, pitch_lines[count:])):  # other text below the notes is a remark
            return Scale(octaves)
    numbers = sum(map(bool, map(_NUMBER.match, pitch_lines)))
    if str(numbers) == digits:
        raise ValueError(f"has {count} notes, at most {MOST_NOTES} may be given")
    raise ValueError(f"says {digits[:20]} notes and lists {numbers}; correct its count or its list of notes")


def parse_keymap(text: str) -> Keymap:
    """The mapping in the text of a .kbm file.

    Raises:
        ValueError: it is none, or one beyond the bounds of this module; the message names the entry.
    """
    lines = _filled_lines(_LINE_END.split(text))
    if len(lines) < 7:
        raise ValueError(f"has {len(lines)} numbers before its keys, 7 are needed; it may have been cut off")
    size = _whole_number(lines[0], "size of map", 0, MOST_KEYS)
    first = _whole_number(lines[1], "first key", 0, HIGHEST_KEY)
    last = _whole_number(lines[2], "last key", 0, HIGHEST_KEY)
    middle = _whole_number(lines[3], "middle key", 0, HIGHEST_KEY)
    reference = _whole_number(lines[4], "reference key", 0, HIGHEST_KEY)
    frequency = _FREQUENCY.match(lines[5])
    reference_hz = float(frequency.group()) if frequency else 0.0
    if not 0 < reference_hz < math.inf:
        raise ValueError(f"its reference frequency is {brief(lines[5])}, and must be a number above 0, as 440.0")
    octave = _whole_number(lines[6], "formal octave", -MOST_KEYS, MOST_KEYS)
    if first > last:
        raise ValueError(f"its first key {first} is above its last key {last}")
    entries = [_entry(line) for line in lines[7:]]
    if len(entries) > size:
        raise ValueError(f"lists {len(entries)} keys, and its size of map is {size}")
    pattern = (*entries, *[None] * (size - len(entries)))
    return Keymap(first, last, middle, reference, reference_hz, octave, pattern)


def _filled_lines(lines: list[str]) -> list[str]:
    """The lines that are neither comments nor empty, without white space around them."""
    stripped = (line.strip() for line in lines)
    return [line for line in stripped if line and not line.startswith("!")]


def _octaves(line: str) -> float:
    """The pitch of a line: cents where its number has a full stop, else a ratio. Text behind it is ignored."""
    if match := _CENTS.match(line):
        cents = float(match.group())
    elif match := _RATIO.match(line):
        above, below = match.group(1), match.group(2) or "1"
        if max(len(above), len(below)) > MOST_DIGITS:
            raise ValueError(f"{brief(line)} has a number of more than {MOST_DIGITS} digits")
        if int(above) <= 0 or int(below) <= 0:
            raise ValueError(f"{brief(line)} is a ratio, and must be above 0")
        cents = 1200 * (math.log2(int(above)) - math.log2(int(below)))
    else:
        raise ValueError(f"{brief(line)} is no pitch: give a ratio, as 3/2, or cents with a full stop, as 701.955")
    if not abs(cents) <= LARGEST_CENTS:
        raise ValueError(f"{brief(line)} is an interval of more than {LARGEST_CENTS:g} cents")
    return cents / 1200


def _whole_number(line: str, name: str, low: int, high: int) -> int:
    """The number at the beginning of a line; `name` is for the error. Raises ValueError: none in low … high."""
    match = _WHOLE.match(line)
    if match is None or len(match.group()) > MOST_DIGITS or not low <= int(match.group()) <= high:
        raise ValueError(f"its {name} is {brief(line)}, and must be a whole number of {low} … {high}")
    return int(match.group())


def _entry(line: str) -> int | None:
    """The degree of one key in a line of a mapping; None: the key is left out ("x")."""
    return None if _UNMAPPED.match(line) else _whole_number(line, "entry", -MOST_KEYS, MOST_KEYS)
