"""The instruments: shipped ones and the user's own, each a small JSON file; listing, reading, saving, renaming.

An instrument is known by its file's name without `.json`, which is made from its title and is never a path.
"""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

from app.instruments.fields import LONGEST_NAME
from app.instruments.instrument import CATEGORIES, Instrument
from app.shared.user_files import make_folder, read_all
from engine import bounds
from engine.folders import user_folder
from engine.plain_text import LineError, name_text, one_line
from engine.schema import SchemaError, explained, parse_json
from engine.whole_file import WriteError, explain, read_bounded, result_file

SHIPPED = Path(__file__).parents[2] / "presets" / "instruments"
SUFFIX = ".json"
FIRST = SHIPPED / f"classical_guitar{SUFFIX}"  # which is played where none is chosen
DEVICES = {"con", "prn", "aux", "nul", *(f"{port}{n}" for port in ("com", "lpt") for n in range(10))}  # on Windows


class InstrumentError(LineError, ValueError):
    """An instrument cannot be used or saved. The message names file, field and remedy, in one line."""


@dataclass(frozen=True)
class InstrumentEntry:
    """An instrument and its file."""

    path: Path
    instrument: Instrument

    @property
    def name(self) -> str:
        """The name of its file without `.json`."""
        return name_text(self.path.stem)

    @property
    def own(self) -> bool:
        """Return True if it is the user's, not shipped with the program."""
        return self.path.parent != SHIPPED


def own_instruments() -> Path:
    """The user's folder of instruments, in that of presets; it may not exist."""
    return user_folder() / "instruments"


def instrument_folders() -> tuple[Path, ...]:
    """The folders of instruments: the shipped one, the user's, and the user's of earlier versions."""
    return SHIPPED, own_instruments(), user_folder() / "patches"  # of earlier versions


def read_instrument(path: Path) -> Instrument:
    """The instrument of a file, checked.

    Raises:
        InstrumentError: it is missing, too large, damaged, impossible, or of a newer version.
    """
    try:
        raw = read_bounded(path, bounds.LARGEST_TEXT_BYTES)
    except OSError as error:
        raise InstrumentError(
            f"{path}: cannot be read ({error.strerror}); check the name and its permissions"
        ) from error
    try:
        data = parse_json(raw, str(path))
        if isinstance(data, dict) and isinstance(data.get("version"), int) and data["version"] > 1:
            raise InstrumentError(f"{path}: version: made by a newer version of the program; update it")
        return Instrument.model_validate(data)
    except SchemaError as error:
        raise InstrumentError(f"{error}; give the JSON of an instrument") from error
    except InstrumentError:
        raise
    except (ValueError, OverflowError) as error:
        reason = explained(error) if isinstance(error, ValueError) else str(error)
        raise InstrumentError(
            f"{path}: {one_line(reason, 300)}; mend this field, or save the instrument again"
        ) from error


def list_instruments(*folders: Path) -> tuple[list[InstrumentEntry], list[str]]:
    """The usable instruments, by category and name, and a line for each file that cannot be used. Never raises.

    Of two of one name the later one is given a number, as a file that was copied has the name of the first.

    Args:
        folders: by default the shipped and the user's. Of two files of one name, that of the first folder is used.
    """
    files: list[Path] = []
    unreadable = []
    for folder in folders or instrument_folders():
        try:
            files += sorted(path for path in folder.glob(f"*{SUFFIX}") if not path.name.startswith("."))
        except OSError as error:
            unreadable.append(one_line(f"{folder}: cannot be read ({error.strerror}); check its permissions"))
    instruments, problems = read_all(
        files, lambda path: (path, read_instrument(path)), InstrumentError, "an instrument"
    )
    names: set[str] = set()
    entries = []
    for path, instrument in instruments.values():
        name = _free_name(names, instrument.name)
        names.add(name.casefold())
        entries.append(InstrumentEntry(path, instrument.model_copy(update={"name": name})))
    entries.sort(key=lambda entry: (CATEGORIES.index(entry.instrument.category), entry.instrument.name.casefold()))
    return entries, unreadable + problems


def _free_name(taken: set[str], name: str) -> str:
    """The name, with a number from 2 on where it is taken; `taken`: names after `casefold`."""
    number, free_name = 2, name
    while free_name.casefold() in taken:
        end = f" {number}"
        number, free_name = number + 1, name[: LONGEST_NAME - len(end)] + end
    return free_name


def find_instrument(name_or_path: str) -> InstrumentEntry:
    """An instrument by the name it is known by, by its title, or by its file's path.

    Raises:
        InstrumentError: there is none, or its file cannot be used; the message lists like names, else all.
    """
    entries, _ = list_instruments()
    folded_name = name_or_path.casefold()
    for entry in entries:
        if folded_name in (entry.name.casefold(), entry.instrument.name.casefold()):
            return entry
    path = Path(name_or_path)
    if path.suffix == SUFFIX:
        return InstrumentEntry(path, read_instrument(path))
    for folder in instrument_folders():
        for file in folder.glob(f"*{SUFFIX}"):
            if file.stem.casefold() == folded_name:  # one that cannot be used: the error says why
                return InstrumentEntry(file, read_instrument(file))
    names = [entry.name for entry in entries]
    if close := get_close_matches(file_stem(folded_name), names, cutoff=0.55):
        raise InstrumentError(f"no instrument {bounds.brief(name_or_path)}; did you mean {' or '.join(close)}?")
    choices = ", ".join(names) or "none is installed"
    raise InstrumentError(f"no instrument {bounds.brief(name_or_path)}; give a {SUFFIX} file or one of: {choices}")


def save_instrument(instrument: Instrument, file: Path | None = None) -> InstrumentEntry:
    """Write the instrument, in a folder that is made if need be; whole or not at all.

    Args:
        file: where it is written, whatever is there; None: a new one in the user's folder.

    Raises:
        InstrumentError: the name is that of another instrument, or a shipped one would be replaced or hidden.
        WriteError: the folder or the file cannot be written.
    """
    path = file or own_instruments() / f"{file_stem(instrument.name)}{SUFFIX}"
    if path.parent in instrument_folders() and (SHIPPED / path.name).exists():
        raise InstrumentError(f"{instrument.name}: a factory instrument has this name; choose another")
    if file is None and any((folder / path.name).exists() for folder in instrument_folders()):
        raise InstrumentError(
            f"{instrument.name}: an instrument of this name or a like one exists already; choose another"
        )
    make_folder(path.parent)
    with result_file(path) as output:
        output.write((instrument.model_dump_json(indent=2) + "\n").encode("utf-8"))
    return InstrumentEntry(path, instrument)


def add_instrument(file: Path) -> tuple[InstrumentEntry, bool]:
    """The instrument of a file as one of the library's, and whether it is new there.

    One that is there already, maybe with a number, stays alone. Another is copied to the user's folder, with a number
    where an instrument of its name is there.

    Raises:
        InstrumentError: see `read_instrument`.
        WriteError: the folder or the file cannot be written.
    """
    instrument, entries = read_instrument(file), list_instruments()[0]
    numbered = re.compile(rf"{re.escape(instrument.name)}( \d+)?")
    for entry in entries:
        same = numbered.fullmatch(entry.instrument.name) and entry.instrument == instrument.model_copy(
            update={"name": entry.instrument.name}
        )
        if same or (entry.path.exists() and entry.path.samefile(file)):
            return entry, False
    names = {entry.instrument.name.casefold() for entry in entries}
    stems = {path.stem for folder in instrument_folders() for path in folder.glob(f"*{SUFFIX}")}
    name = _free_name(names, instrument.name)
    while file_stem(name) in stems:
        names.add(name.casefold())
        name = _free_name(names, instrument.name)
    return save_instrument(instrument.model_copy(update={"name": name})), True


def rename_instrument(entry: InstrumentEntry, name: str) -> InstrumentEntry:
    """The user's own instrument under another name; its former file is removed after the new one is whole.

    Raises:
        InstrumentError: it is a shipped one, or the name is impossible or that of another instrument.
        WriteError: the folder cannot be written, or the former file not be deleted.
    """
    if not entry.own:
        raise InstrumentError(
            f"{entry.instrument.name}: is shipped with the program; save it under another name instead"
        )
    try:
        renamed = Instrument.model_validate({**dict(entry.instrument), "name": name})
    except ValueError as error:
        raise InstrumentError(explained(error)) from error
    same = file_stem(renamed.name) == entry.name
    saved = save_instrument(renamed, entry.path if same else None)
    if not same:
        try:
            entry.path.unlink(missing_ok=True)
        except OSError as error:
            raise WriteError(explain(entry.path, error)) from error
    return saved


def file_stem(name: str) -> str:
    """The name of an instrument's file, on every system: letters and digits in lower case, the rest underscores."""
    stem = "_".join(re.findall(r"[^\W_]+", unicodedata.normalize("NFC", name.casefold()))) or "instrument"
    return f"{stem}_" if stem in DEVICES else stem
