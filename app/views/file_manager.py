"""The system's file manager: it shows a file in its folder, or opens a folder. No shell has any part in it."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QCoreApplication, QProcess, QUrl
from PySide6.QtGui import QDesktopServices

SERVICE = "org.freedesktop.FileManager1"
Report = Callable[[str], object]


def reveal(file: Path, report: Report) -> None:
    """Show a file, selected in its folder; `report` is given the words where that fails."""
    if not file.exists():
        report(f"{file} is not there any more.")
    elif sys.platform == "win32":
        explorer = Path(os.environ.get("WINDIR", r"C:\Windows")) / "explorer.exe"
        _start(str(explorer), ["/select,", str(file)], file, report)
    elif sys.platform == "darwin":
        _start("/usr/bin/open", ["-R", str(file)], file, report)
    else:
        _show_item(file, lambda: open_folder(file.parent, report))


def open_folder(folder: Path, report: Report) -> None:
    """Open a folder; `report` is given the words where that fails."""
    if not QDesktopServices.openUrl(QUrl.fromLocalFile(str(folder))):
        report(f"No file manager was found here; the folder is {folder}.")


def _start(program: str, arguments: list[str], file: Path, report: Report) -> None:
    if not QProcess.startDetached(program, arguments)[0]:
        open_folder(file.parent, report)


def _show_item(file: Path, otherwise: Callable[[], None]) -> None:
    """Ask the desktop's file manager, which may have to be started, without waiting for it."""
    try:
        from PySide6.QtDBus import QDBusConnection, QDBusMessage, QDBusPendingCallWatcher
    except ImportError:
        otherwise()
        return
    bus = QDBusConnection.sessionBus()
    if not bus.isConnected():
        otherwise()
        return
    asked = QDBusMessage.createMethodCall(SERVICE, f"/{SERVICE.replace('.', '/')}", SERVICE, "ShowItems")
    asked.setArguments([[file.absolute().as_uri()], ""])
    watcher = QDBusPendingCallWatcher(bus.asyncCall(asked), QCoreApplication.instance())
    watcher.finished.connect(lambda: otherwise() if watcher.isError() else None)
    watcher.finished.connect(watcher.deleteLater)
