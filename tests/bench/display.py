"""Where a benchmark's window is shown: on the screen, or, without one, in memory."""

from __future__ import annotations

import os
import sys


def choose_display() -> None:
    """Make Qt draw offscreen on a Linux machine without a screen. Call it before the QApplication is made."""
    screens = ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM")
    if sys.platform.startswith("linux") and not any(map(os.environ.get, screens)):
        os.environ["QT_QPA_PLATFORM"] = "offscreen"
