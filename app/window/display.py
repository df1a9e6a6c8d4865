"""A check for a screen to open a window on: Qt would end the process where there is none."""

from __future__ import annotations

import ctypes
import os
import sys
from contextlib import suppress


class NoDisplay(RuntimeError):
    """The error that there is no screen. The message says what to do."""


def check_display() -> None:
    """Raise NoDisplay on Linux without a screen that answers, unless Qt has another way to show itself."""
    if sys.platform != "linux" or os.environ.get("QT_QPA_PLATFORM") or os.environ.get("WAYLAND_DISPLAY"):
        return
    name = os.environ.get("DISPLAY")
    if not name:
        raise NoDisplay(
            "there is no screen to open a window on (neither DISPLAY nor WAYLAND_DISPLAY is set); start it from a"
            " desktop, or use a command: learned-strings --help"
        )
    if not _answers():
        raise NoDisplay(f"the screen DISPLAY={name} does not answer; set DISPLAY to one that does, or use a command")


def _answers() -> bool:
    """Return True if a display answers, asked in the way that Qt will ask. True where that cannot be known."""
    with suppress(OSError, AttributeError):
        xcb = ctypes.CDLL("libxcb.so.1")
        xcb.xcb_connect.restype = ctypes.c_void_p
        connection = ctypes.c_void_p(xcb.xcb_connect(None, None))
        failed = xcb.xcb_connection_has_error(connection)
        xcb.xcb_disconnect(connection)
        return not failed
    return True
