"""The bodies that an instrument may name: those of the engine, and the user's own impulse responses, by their files.

The user's lie in a folder beside the instruments. A body is known by its file's name without ending, never by a path.
"""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from app.audio.impulse_file import ImpulseError, read_impulse
from app.instruments.fields import LONGEST_NAME
from app.instruments.instrument import Reference
from app.instruments.library import file_stem
from app.shared.user_files import install
from engine.bounds import LARGEST_IMPULSE_BYTES
from engine.effects import BODIES, Impulse
from engine.folders import user_folder
from engine.whole_file import read_bounded

ENDINGS = (".wav", ".wave", ".bwf", ".flac", ".aif", ".aiff", ".aifc")
_NAME: TypeAdapter[str] = TypeAdapter(Reference)


def own_bodies() -> Path:
    """The user's folder of bodies, which may not exist."""
    return user_folder() / "bodies"


def body_names() -> list[str]:
    """The names of all bodies, the engine's first. Never raises: files are read only when they are used."""
    return [*BODIES, *_own_files()]


def body_titles() -> list[tuple[str, str]]:
    """The name and the title of each body, as `body_names`. The user's own are called what their files are."""
    return [(name, BODIES[name].title if name in BODIES else name) for name in body_names()]


def own_impulse(name: str) -> Impulse:
    """The impulse response of one of the user's bodies; the same object while its file is unchanged.

    Raises:
        ImpulseError: there is none of this name, or its file cannot be used.
    """
    path = _own_files().get(name)
    if path is None:
        raise ImpulseError(f"the body {name} is not here: drop its impulse response on the window")
    try:
        state = path.stat()
    except OSError as error:
        raise ImpulseError(f"{path}: cannot be read ({error.strerror}); drop it on the window again") from error
    return _read(path, state.st_mtime_ns, state.st_size)


def body_digest(name: str) -> str:
    """The SHA-256 of the file of one of the user's bodies, in hex; "" for any other."""
    path = _own_files().get(name)
    if path is None:
        return ""
    try:
        state = path.stat()
        return _digest(path, state.st_mtime_ns, state.st_size)
    except OSError:  # reported where the body is used
        return ""


def install_body(file: Path) -> str:
    """Copy an impulse response into the user's folder, and return the name of the body.

    The same file is not copied twice; a name that is taken gets a number.

    Raises:
        ImpulseError: it is no impulse response that can be used.
        WriteError: the copy cannot be written; nothing is left.
    """
    read_impulse(file)
    try:
        data = read_bounded(file, LARGEST_IMPULSE_BYTES)
    except OSError as error:
        raise ImpulseError(f"{file}: cannot be read ({error.strerror}); check the name") from error
    name = f"{file_stem(file.stem)[: LONGEST_NAME - 5]}{file.suffix.lower()}"
    return install(data, name, own_bodies(), _own_files().values(), BODIES).stem


def _own_files() -> dict[str, Path]:
    """Name -> file. Of two files of one name the first; none of the name of an engine's body."""
    files: dict[str, Path] = {}
    try:
        paths = sorted(path for path in own_bodies().iterdir() if path.suffix.lower() in ENDINGS)
    except OSError:  # most often it is not there
        return files
    for path in paths:
        try:
            _NAME.validate_python(path.stem)
        except ValidationError:  # no instrument could name it
            continue
        if path.stem not in BODIES and path.is_file():
            files.setdefault(path.stem, path)
    return files


@lru_cache(maxsize=16)
def _digest(path: Path, time_ns: int, size: int) -> str:
    """The SHA-256 of a file, in hex, remembered for one time and size of it: a changed file is read again."""
    return hashlib.sha256(read_bounded(path, LARGEST_IMPULSE_BYTES)).hexdigest()


@lru_cache(maxsize=16)
def _read(path: Path, time_ns: int, size: int) -> Impulse:
    """The impulse response of a file, remembered as by `_digest`."""
    return read_impulse(path)
