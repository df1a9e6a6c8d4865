"""A private X screen (Xvfb): windows are drawn on it, and keys are sent to it."""

from __future__ import annotations

import contextlib
import os
import subprocess
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

from bench.play.children import Missing, child

if TYPE_CHECKING:
    from Xlib.xobject.drawable import Window

SIZE = (1920, 1080)
DEPTH = 24


class Screen:
    """A connection to an X server, for one thread."""

    def __init__(self, name: str) -> None:
        try:
            from Xlib import display, error
        except ImportError as missing:
            raise Missing("this benchmark needs the Python package python-xlib: pip install python-xlib") from missing
        self.name = name
        try:
            self._display = display.Display(name)
        except error.DisplayError as failed:
            raise Missing(f"the private screen {name} cannot be opened ({failed})") from failed
        self._root = self._display.screen().root

    def close(self) -> None:
        self._display.close()

    def find(self, title: str) -> Window | None:
        """The visible window whose title begins with `title`; None where there is none."""
        from Xlib import X, error

        for window in self._root.query_tree().children:
            with contextlib.suppress(error.BadWindow):  # it has vanished between two calls
                name = window.get_wm_name() or ""
                if str(name).startswith(title) and window.get_attributes().map_state == X.IsViewable:
                    return window
        return None

    def take(self, window: Window) -> None:
        """Make a window as large as the screen and give it the keyboard, as a window manager does."""
        from Xlib import X

        window.configure(x=0, y=0, width=SIZE[0], height=SIZE[1], stack_mode=X.Above)
        window.set_input_focus(X.RevertToParent, X.CurrentTime)
        self._display.sync()

    def key(self, name: str, down: bool) -> float:
        """Press or release a key, by the name of its keysym; return when it was sent (`time.monotonic`)."""
        from Xlib import XK, X
        from Xlib.ext import xtest

        code = self._display.keysym_to_keycode(XK.string_to_keysym(name))
        if not code:
            raise Missing(f"the private screen has no key {name}")
        now_s = time.monotonic()
        xtest.fake_input(self._display, X.KeyPress if down else X.KeyRelease, code)
        self._display.flush()
        return now_s


@contextlib.contextmanager
def private_screen() -> Iterator[Screen]:
    """Start an X server on a free display number, and end it afterwards.

    Raises:
        Missing: it did not start, or python-xlib is missing.
    """
    command = ["Xvfb", "-displayfd", "1", "-screen", "0", f"{SIZE[0]}x{SIZE[1]}x{DEPTH}", "-nolisten", "tcp"]
    with child(command, os.environ, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        number = process.stdout.readline().decode().strip()
        if not number:
            raise Missing("Xvfb did not start")
        screen = Screen(f":{number}")
        try:
            yield screen
        finally:
            screen.close()
