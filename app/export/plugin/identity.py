"""The identifier of an instrument for hosts, and the identifiers that a built plug-in holds.

Songs find a plug-in by it, so an instrument of the same name keeps its identifier in every build.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Collection
from functools import cache
from pathlib import Path

from app.export.plugin.formats import PluginError
from app.instruments.library import SHIPPED, list_instruments

PREFIX = "org.learned-strings."
MOST_BYTES = 127  # of the shell's field; hosts of CLAP and LV2 have no more room either
DIGITS = 12
_HELD = re.compile(rb"org\.learned-strings\.([^\x00-\x20\"<>.]{1,107})[\0>]")


def identifier(name: str) -> str:
    """The identifier of an instrument: other names have other ones.

    It has the letters and digits of the name in lower case, the rest as dashes. One name alone has an identifier
    without more: the factory instrument's, else the one of words with spaces between them, the first capitalised. All
    others, as those too long, end with a digest of the name.
    """
    folded = _folded_name(name)
    plain = PREFIX + folded
    digested = re.search(rf"-[0-9a-f]{{{DIGITS}}}$", folded)
    if folded and name == _default_spelling(folded) and not digested and len(plain.encode()) <= MOST_BYTES:
        return plain
    digest = hashlib.sha256(name.encode(errors="surrogatepass")).hexdigest()[:DIGITS]
    short = plain.encode(errors="ignore")[: MOST_BYTES - DIGITS - 1].decode(errors="ignore")
    return f"{short}-{digest}"


def held_in(path: Path) -> frozenset[str]:
    """Identifiers of the instruments of a built plug-in: a file, or a folder of files. Empty: it is none of ours.

    Raises:
        OSError: it cannot be read.
    """
    files = [file for file in path.rglob("*") if file.is_file()] if path.is_dir() else [path]
    suffixes = {match.decode(errors="replace") for file in files for match in _HELD.findall(file.read_bytes())}
    return frozenset(PREFIX + suffix for suffix in suffixes)


def lost_with(path: Path, ids: Collection[str]) -> frozenset[str]:
    """Identifiers of the instruments that are lost where a plug-in of `ids` takes this place.

    Raises:
        PluginError: there is something else than a plug-in of this program, or it cannot be read.
    """
    if not path.exists():
        return frozenset()
    try:
        identifiers = held_in(path)
    except OSError as error:
        raise PluginError(f"{path}: cannot be read ({error.strerror}); remove it, or choose another name") from error
    if not identifiers:
        raise PluginError(f"{path}: is no plug-in of this program; remove it, or choose another name")
    return identifiers.difference(ids)


def check_kept(path: Path, ids: Collection[str]) -> None:
    """Raise PluginError: something would be lost where a plug-in of `ids` takes this place."""
    if lost := lost_with(path, ids):
        raise PluginError(f"{path}: {holding(lost)}; build in another folder (--out), or replace it (--replace)")


def holding(ids: frozenset[str]) -> str:
    """The other instruments that a plug-in holds, in words."""
    first, *rest = sorted(id.removeprefix(PREFIX) for id in ids)
    return f"holds {f'{len(ids)} other instruments, as' if rest else 'another instrument,'} {first}"


def _folded_name(name: str) -> str:
    return "".join(c if c.isalnum() else "-" for c in name.lower())


def _default_spelling(folded: str) -> str:
    """The name that has an identifier without a digest."""
    words = folded.replace("-", " ")
    return _factory_names().get(folded, words[:1].upper() + words[1:])


@cache
def _factory_names() -> dict[str, str]:
    return {_folded_name(entry.instrument.name): entry.instrument.name for entry in list_instruments(SHIPPED)[0]}
