"""The system's file manager: it shows a file in its folder, or opens a folder. No shell has any part in it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QProcess, QUrl
from PySide6.QtGui import QDesktopServices

# The program that selects a file in its folder, and its option; on Linux none is everywhere.
SELECTING = {"win32": (r"C:\Windows\explorer.exe", "/select,"), "darwin": ("/usr/bin/open", "-R")}


def reveal(file: Path, report: Callable[[str], object]) -> None:
    """Show a file in its folder; `report` is given the words where that fails."""
    program, option = SELECTING.get(sys.platform, ("", ""))
    if not file.exists():
        report(f"{file} is not there any more.")
    elif not program or not QProcess.startDetached(program, [option, str(file)])[0]:
        open_folder(file.parent, report)


def open_folder(folder: Path, report: Callable[[str], object]) -> None:
    """Open a folder; `report` is given the words where that fails."""
    if not QDesktopServices.openUrl(QUrl.fromLocalFile(str(folder))):
        report(f"No file manager was found here; the folder is {folder}.")
