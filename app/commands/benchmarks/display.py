"""Where a benchmark's window is shown: on the screen, or nowhere where there is none."""

from __future__ import annotations

import os
import sys


def choose_display() -> None:
    """Lets Qt draw without a screen on a machine that has none. To be called before Qt's application is made."""
    screens = ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM")
    if sys.platform.startswith("linux") and not any(map(os.environ.get, screens)):
        os.environ["QT_QPA_PLATFORM"] = "offscreen"
