"""The patches: shipped ones and the user's own, each a small JSON file; listing, reading, saving, renaming.

A patch is known by its file's name without `.json`. That name is made from the patch's own, and is never a path.
"""

from __future__ import annotations

import re
import unicodedata
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

from app.patches.fields import LONGEST_NAME
from app.patches.patch import CATEGORIES, Patch
from app.shared.user_files import make_folder, read_all
from engine import bounds
from engine.folders import user_folder
from engine.plain_text import LineError, name_text, one_line
from engine.schema import SchemaError, explained, parse_json
from engine.whole_file import WriteError, explain, read_bounded, result_file

SHIPPED = Path(__file__).parents[2] / "presets" / "patches"
SUFFIX = ".json"
FIRST = SHIPPED / f"classical_guitar{SUFFIX}"  # which is played where none is chosen
DEVICES = {"con", "prn", "aux", "nul", *(f"{port}{n}" for port in ("com", "lpt") for n in range(10))}  # on Windows


class PatchError(LineError, ValueError):
    """A patch cannot be used or saved. The message names file, field and remedy, in one line."""


@dataclass(frozen=True)
class PatchEntry:
    """A patch and its file."""

    path: Path
    patch: Patch

    @property
    def name(self) -> str:
        """The name of its file without `.json`."""
        return name_text(self.path.stem)

    @property
    def own(self) -> bool:
        """Return True if it is the user's, not shipped with the program."""
        return self.path.parent != SHIPPED


def own_patches() -> Path:
    """The user's folder of patches, in that of presets; it may not exist."""
    return user_folder() / "patches"


def patch_folders() -> tuple[Path, ...]:
    """The folders of patches: the shipped one, the user's, and the user's of earlier versions."""
    return SHIPPED, own_patches(), user_folder() / "patches"  # until 0.2


def read_patch(path: Path) -> Patch:
    """The patch of a file, checked.

    Raises:
        PatchError: it is missing, too large, damaged, impossible, or of a newer version.
    """
    try:
        raw = read_bounded(path, bounds.LARGEST_TEXT_BYTES)
    except OSError as error:
        raise PatchError(f"{path}: cannot be read ({error.strerror}); check the name and its permissions") from error
    try:
        data = parse_json(raw, str(path))
        if isinstance(data, dict) and isinstance(data.get("version"), int) and data["version"] > 1:
            raise PatchError(f"{path}: version: made by a newer version of the program; update it")
        return Patch.model_validate(data)
    except SchemaError as error:
        raise PatchError(f"{error}; give the JSON of an instrument") from error
    except PatchError:
        raise
    except (ValueError, OverflowError) as error:
        reason = explained(error) if isinstance(error, ValueError) else str(error)
        raise PatchError(f"{path}: {one_line(reason, 300)}; mend this field, or save the instrument again") from error


def list_patches(*folders: Path) -> tuple[list[PatchEntry], list[str]]:
    """The usable patches, sorted by category and name, and a line for each file that cannot be used. Never raises.

    Of two patches of one name the later one is given a number, as a file that was copied has the name of the first.

    Args:
        folders: by default the shipped and the user's. Of two files of one name, that of the first folder is used.
    """
    files: list[Path] = []
    unreadable = []
    for folder in folders or patch_folders():
        try:
            files += sorted(path for path in folder.glob(f"*{SUFFIX}") if not path.name.startswith("."))
        except OSError as error:
            unreadable.append(one_line(f"{folder}: cannot be read ({error.strerror}); check its permissions"))
    patches, problems = read_all(files, lambda path: (path, read_patch(path)), PatchError, "an instrument")
    names: set[str] = set()
    entries = []
    for path, patch in patches.values():
        name = _free_name(names, patch.name)
        names.add(name.casefold())
        entries.append(PatchEntry(path, patch.model_copy(update={"name": name})))
    entries.sort(key=lambda entry: (CATEGORIES.index(entry.patch.category), entry.patch.name.casefold()))
    return entries, unreadable + problems


def _free_name(taken: set[str], name: str) -> str:
    """The name, with a number where it is taken."""
    number, free_name = 2, name
    while free_name.casefold() in taken:
        end = f" {number}"
        number, free_name = number + 1, name[: LONGEST_NAME - len(end)] + end
    return free_name


def find_patch(name_or_path: str) -> PatchEntry:
    """A patch by the name it is known by, by its title, or by its file's path.

    Raises:
        PatchError: there is none, or its file cannot be used; the message lists like names, else all.
    """
    entries, _ = list_patches()
    folded_name = name_or_path.casefold()
    for entry in entries:
        if folded_name in (entry.name.casefold(), entry.patch.name.casefold()):
            return entry
    path = Path(name_or_path)
    if path.suffix == SUFFIX:
        return PatchEntry(path, read_patch(path))
    names = [entry.name for entry in entries]
    if close := get_close_matches(file_stem(folded_name), names, cutoff=0.55):
        raise PatchError(f"no instrument {bounds.brief(name_or_path)}; did you mean {' or '.join(close)}?")
    choices = ", ".join(names) or "none is installed"
    raise PatchError(f"no instrument {bounds.brief(name_or_path)}; give a {SUFFIX} file or one of: {choices}")


def save_patch(patch: Patch, file: Path | None = None) -> PatchEntry:
    """Write the patch, in a folder that is made if need be; whole or not at all.

    Args:
        file: where it is written, whatever is there; None: a new one in the user's folder.

    Raises:
        PatchError: the name is that of another patch, or a shipped one would be replaced or hidden.
        WriteError: the folder or the file cannot be written.
    """
    path = file or own_patches() / f"{file_stem(patch.name)}{SUFFIX}"
    if path.parent in (SHIPPED, own_patches()) and (SHIPPED / path.name).exists():
        raise PatchError(f"{patch.name}: a factory instrument has this name; choose another")
    if file is None and any((folder / path.name).exists() for folder in patch_folders()):
        raise PatchError(f"{patch.name}: an instrument of this name or a like one exists already; choose another")
    make_folder(path.parent)
    with result_file(path) as output:
        output.write((patch.model_dump_json(indent=2) + "\n").encode("utf-8"))
    return PatchEntry(path, patch)


def add_patch(file: Path) -> tuple[PatchEntry, bool]:
    """The patch of a file as one of the library's, and whether it is new there.

    One that is there already, maybe with a number, stays alone. Another is copied to the user's folder, with a number
    where a patch of its name is there.

    Raises:
        PatchError: see `read_patch`.
        WriteError: the folder or the file cannot be written.
    """
    patch, entries = read_patch(file), list_patches()[0]
    numbered = re.compile(rf"{re.escape(patch.name)}( \d+)?")
    for entry in entries:
        same = numbered.fullmatch(entry.patch.name) and entry.patch == patch.model_copy(
            update={"name": entry.patch.name}
        )
        if same or (entry.path.exists() and entry.path.samefile(file)):
            return entry, False
    names = {entry.patch.name.casefold() for entry in entries}
    stems = {path.stem for folder in patch_folders() for path in folder.glob(f"*{SUFFIX}")}
    name = _free_name(names, patch.name)
    while file_stem(name) in stems:
        names.add(name.casefold())
        name = _free_name(names, patch.name)
    return save_patch(patch.model_copy(update={"name": name})), True


def rename_patch(entry: PatchEntry, name: str) -> PatchEntry:
    """The user's own patch under another name; its former file is removed after the new one is whole.

    Raises:
        PatchError: it is a shipped one, or the name is impossible or that of another patch.
        WriteError: the folder cannot be written, or the former file not be deleted.
    """
    if not entry.own:
        raise PatchError(f"{entry.patch.name}: is shipped with the program; save it under another name instead")
    try:
        renamed = Patch.model_validate({**dict(entry.patch), "name": name})
    except ValueError as error:
        raise PatchError(explained(error)) from error
    same = file_stem(renamed.name) == entry.name
    saved = save_patch(renamed, entry.path if same else None)
    if not same:
        try:
            entry.path.unlink(missing_ok=True)
        except OSError as error:
            raise WriteError(explain(entry.path, error)) from error
    return saved


def file_stem(name: str) -> str:
    """The name of a patch's file, on every system: its letters and digits in lower case, the rest underscores."""
    stem = "_".join(re.findall(r"[^\W_]+", unicodedata.normalize("NFC", name.casefold()))) or "patch"
    return f"{stem}_" if stem in DEVICES else stem
