"""Files that other programs are given: in folders of the system's temporary one, until this process ends."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

from engine.whole_file import WriteError, explain, lasting_folder

LARGEST_BYTES = 2**30  # of all files together; the latest are there however large they are


class HandedFiles:
    """Folders for the files, one for each time that some are given, as programs may read earlier ones of a name."""

    def __init__(self) -> None:
        self._root: Path | None = None
        self._folders: list[Path] = []  # the oldest first

    def new_folder(self) -> Path:
        """A new folder, for which the oldest make room. What killed processes have left is removed with the first.

        Raises:
            WriteError: it cannot be made.
        """
        parent = Path(tempfile.gettempdir())
        try:
            if self._root is None or not self._root.is_dir():  # the system may have cleaned up
                self._root, self._folders = lasting_folder(parent, "learned-strings-files"), []
            while sum(file.stat().st_size for file in self._root.glob("*/*")) > LARGEST_BYTES:
                shutil.rmtree(self._folders.pop(0), ignore_errors=True)
            self._folders.append(Path(tempfile.mkdtemp(dir=self._root)))
        except OSError as error:
            raise WriteError(explain(parent, error)) from error
        return self._folders[-1]

    def close(self) -> None:
        """Remove all of them; may be called again."""
        if self._root is not None:
            shutil.rmtree(self._root, ignore_errors=True)
