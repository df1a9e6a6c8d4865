"""Numbers as people type them: either decimal sign, digits in groups, the unit that is shown. No locale is read.

One separator is the decimal sign, as in 2.5, 2,5 and 1.000. With separators of two kinds the last is: 1.000,5 and
1,000.5 are the same. Groups alone are taken where nothing else could be meant: 1.000.000, 10 000.
"""

from __future__ import annotations

import math
import re
import unicodedata

from engine.parameters import Parameter

_MINUS = str.maketrans(dict.fromkeys("\u2010\u2011\u2012\u2013\u2212", "-") | {"\u2019": "'"})
_PLAIN = r"[0-9]+(?:[.,][0-9]*)?|[.,][0-9]+"
_GROUPED = r"[1-9][0-9]{0,2}(?:(?P<group>[ '.,])[0-9]{3})(?:(?P=group)[0-9]{3})*"
_NUMBER = re.compile(
    rf"(?P<sign>[+-]?) ?(?:(?P<plain>{_PLAIN})|(?P<grouped>{_GROUPED})(?P<rest>(?!(?P=group))[.,][0-9]*)?)"
    r"(?P<exponent>[eE] ?[+-]?[0-9]+)?"
)
_BEGUN = re.compile(r"[+-]? ?[0-9., ']*(?:[eE] ?[+-]?[0-9]*)? ?")
SIGNS = "0123456789.,+-\u2212"  # with which a number begins


def typed_number(text: str, unit: str = "", prefix: str = "") -> float | None:
    """The number that a text means; None: it means none, or one of another unit.

    Args:
        unit: as it is shown behind the number; it may be left out.
        prefix: the same before it.
    """
    text, prefix = _plain(text), _plain(prefix)
    if prefix and text.startswith(prefix):
        text = text[len(prefix) :].strip()
    for spelling in _ways(unit):
        if spelling and text.casefold().endswith(spelling):
            text = text[: -len(spelling)].strip()
            break
    match = _NUMBER.fullmatch(text)
    if match is None:
        return None
    if match["plain"] is not None:
        digits = match["plain"].replace(",", ".")
    else:
        digits = match["grouped"].replace(match["group"], "") + (match["rest"] or "").replace(",", ".")
    number = float(match["sign"] + digits + (match["exponent"] or "").replace(" ", ""))
    return number if math.isfinite(number) else None


def typed_value(parameter: Parameter, text: str) -> float | None:
    """The value of a parameter that a text means, in or out of its range; None: it means none."""
    if text.strip().casefold() in parameter.words:
        return parameter.limits[0] + parameter.words.index(text.strip().casefold())
    number = typed_number(text, parameter.typed_unit, parameter.prefix)
    if number is None or (parameter.whole and not number.is_integer()):
        return None
    return number / 100 if parameter.typed_unit == "%" else number


def begins_number(text: str, unit: str = "", prefix: str = "") -> bool:
    """Return True if more characters could make a number of a text, or it is one."""
    text, prefix = _plain(text), _plain(prefix)
    if prefix.startswith(text):
        return True
    text = text.removeprefix(prefix).strip()
    return any(
        spelling.startswith(text[end:].strip().casefold())
        for spelling in _ways(unit)
        for end in range(len(text) + 1)
        if _BEGUN.fullmatch(text[:end])
    )


def _ways(unit: str) -> tuple[str, ...]:
    """The ways to type a unit: as it is shown, and with plain digits in place of raised ones."""
    return _plain(unit).casefold(), unicodedata.normalize("NFKC", _plain(unit)).casefold()


def _plain(text: str) -> str:
    """Normalise a text: one kind of space, minus and apostrophe, no space around it; µ as μ. 10² is not 102."""
    plain = "".join(c if c.isdigit() and not c.isdecimal() else unicodedata.normalize("NFKC", c) for c in text)
    return " ".join(plain.translate(_MINUS).split())
