"""Folders of presets, instruments and bodies: files read so that one hides no other, and copied in once."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import TypeVar

from engine.plain_text import name_text, one_line
from engine.whole_file import WriteError, explain, read_bounded, result_file

Entry = TypeVar("Entry")


def read_all(
    files: Iterable[Path], read: Callable[[Path], Entry], expected: type[ValueError], what: str
) -> tuple[dict[str, Entry], list[str]]:
    """The entries that `read` makes of files, by their names, and a line for each that cannot be used. Never raises.

    Of two files of one name the first counts.

    Args:
        expected: of errors whose message is for the user.
        what: such a file is, in words.
    """
    entries: dict[str, Entry] = {}
    problems = []
    for file in files:
        try:
            name, entry = name_text(file.stem), read(file)
            if name in entries:
                raise expected(f"{file}: {what} of this name exists already; rename the file to use it")
            entries[name] = entry
        except expected as error:
            problems.append(str(error))
        except OSError as error:  # such as a file that was deleted meanwhile
            problems.append(one_line(f"{file}: cannot be read ({error.strerror})"))
        except Exception as error:  # no fault of one file may keep the others from being listed
            problems.append(one_line(f"{file}: cannot be used ({type(error).__name__} {error}); remove the file"))
    return entries, problems


def install(data: bytes, name: str, folder: Path, present: Iterable[Path], taken: Iterable[str] = ()) -> Path:
    """The file with these bytes: one of `present`, else a new one in the folder, with a number where a name is taken.

    Args:
        name: of the file. Disks may ignore case, so that one that differs in case alone is taken, too.
        taken: further names without endings.

    Raises:
        WriteError: it cannot be written; no part of it is left.
    """
    present = list(present)
    for path in present:
        with suppress(OSError):  # one that cannot be read counts as another
            if path.stat().st_size == len(data) and read_bounded(path, len(data)) == data:
                return path
    make_folder(folder)
    taken = {*taken, *(path.stem.casefold() for path in (*present, *folder.iterdir()))}
    stem, ending = Path(name).stem, Path(name).suffix
    stems = (stem if number == 1 else f"{stem}_{number}" for number in count(1))
    target = folder / f"{next(free for free in stems if free.casefold() not in taken)}{ending}"
    with result_file(target) as copy:
        copy.write(data)
    return target


def make_folder(folder: Path) -> None:
    """Make a folder where there is none. Raises WriteError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise WriteError(explain(folder, error)) from error
