"""A private X screen (Xvfb): windows are drawn on it, keys are sent to it, and pictures are taken of it.

Xlib is called directly: a key is sent within microseconds, and no Python package is needed for it.
"""

from __future__ import annotations

import contextlib
import ctypes
import ctypes.util
import os
import subprocess
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.commands.benchmarks.play.children import Missing, child

SIZE = (1920, 1080)
DEPTH = 24
VIEWABLE = 2  # IsViewable
Z_PIXMAP = 2
REVERT_TO_PARENT = 2


class _Attributes(ctypes.Structure):
    """XWindowAttributes."""

    _fields_ = (
        *((name, ctypes.c_int) for name in ("x", "y", "width", "height", "border_width", "depth")),
        ("visual", ctypes.c_void_p),
        ("root", ctypes.c_ulong),
        *((name, ctypes.c_int) for name in ("klass", "bit_gravity", "win_gravity", "backing_store")),
        *((name, ctypes.c_ulong) for name in ("backing_planes", "backing_pixel")),
        ("save_under", ctypes.c_int),
        ("colormap", ctypes.c_ulong),
        *((name, ctypes.c_int) for name in ("map_installed", "map_state")),
        *((name, ctypes.c_long) for name in ("all_event_masks", "your_event_mask", "do_not_propagate_mask")),
        ("override_redirect", ctypes.c_int),
        ("screen", ctypes.c_void_p),
    )


class _Image(ctypes.Structure):
    """The beginning of XImage."""

    _fields_ = (
        *((name, ctypes.c_int) for name in ("width", "height", "xoffset", "format")),
        ("data", ctypes.c_void_p),
        *((name, ctypes.c_int) for name in ("byte_order", "bitmap_unit", "bitmap_bit_order", "bitmap_pad", "depth")),
        *((name, ctypes.c_int) for name in ("bytes_per_line", "bits_per_pixel")),
    )


class Screen:
    """One connection to an X server, for one thread."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._x, self._xtest = _library("X11", "libx11-6"), _library("Xtst", "libxtst6")
        self._ignore = _ERROR_HANDLER(lambda _display, _event: 0)  # a window may vanish between two calls
        self._x.XSetErrorHandler(self._ignore)
        self._display = self._x.XOpenDisplay(name.encode())
        if not self._display:
            raise Missing(f"the private screen {name} cannot be opened")
        self._root = self._x.XDefaultRootWindow(self._display)

    def close(self) -> None:
        self._x.XCloseDisplay(self._display)

    def find(self, title: str) -> int | None:
        """The visible window whose title begins with `title`; None where there is none."""
        root, parent, count = ctypes.c_ulong(), ctypes.c_ulong(), ctypes.c_uint()
        children = ctypes.POINTER(ctypes.c_ulong)()
        self._x.XQueryTree(
            self._display,
            self._root,
            ctypes.byref(root),
            ctypes.byref(parent),
            ctypes.byref(children),
            ctypes.byref(count),
        )
        windows = children[: count.value]
        if children:
            self._x.XFree(children)
        return next(
            (window for window in windows if self._title(window).startswith(title) and self._seen(window)), None
        )

    def take(self, window: int) -> None:
        """Makes a window as large as the screen and gives it the keyboard, as a window manager does."""
        self._x.XMoveResizeWindow(self._display, window, 0, 0, *SIZE)
        self._x.XRaiseWindow(self._display, window)
        self._x.XSetInputFocus(self._display, window, REVERT_TO_PARENT, 0)
        self._x.XSync(self._display, 0)

    def size(self, window: int) -> tuple[int, int]:
        found = self._attributes(window)
        return found.width, found.height

    def key(self, name: str, down: bool) -> float:
        """Presses or releases a key, by the name of its keysym; returns when it was sent (`time.monotonic`)."""
        code = self._x.XKeysymToKeycode(self._display, self._x.XStringToKeysym(name.encode()))
        if not code:
            raise Missing(f"the private screen has no key {name}")
        now_s = time.monotonic()
        self._xtest.XTestFakeKeyEvent(self._display, code, int(down), 0)
        self._x.XFlush(self._display)
        return now_s

    def grab(self, x: int, y: int, width: int, height: int) -> NDArray[np.uint8]:
        """The picture of a part of the screen, (height, width, 4): blue, green, red, unused."""
        image = self._x.XGetImage(self._display, self._root, x, y, width, height, ctypes.c_ulong(-1), Z_PIXMAP)
        if not image:
            raise Missing("the private screen gives no picture")
        try:
            told = ctypes.cast(image, ctypes.POINTER(_Image)).contents
            data = ctypes.string_at(told.data, told.bytes_per_line * told.height)
        finally:
            self._x.XDestroyImage(image)
        return np.frombuffer(data, np.uint8).reshape(height, -1)[:, : 4 * width].reshape(height, width, 4)

    def _title(self, window: int) -> str:
        name = ctypes.c_char_p()
        if not self._x.XFetchName(self._display, window, ctypes.byref(name)) or name.value is None:
            return ""
        try:
            return name.value.decode("latin-1")
        finally:
            self._x.XFree(name)

    def _seen(self, window: int) -> bool:
        return bool(self._attributes(window).map_state == VIEWABLE)

    def _attributes(self, window: int) -> _Attributes:
        found = _Attributes()
        self._x.XGetWindowAttributes(self._display, window, ctypes.byref(found))
        return found


_ERROR_HANDLER = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)


def _library(name: str, package: str) -> Any:
    path = ctypes.util.find_library(name)
    if path is None:
        raise Missing(f"bench play needs lib{name}: install {package}")
    library = ctypes.CDLL(path)
    if name == "X11":
        unsigned, pointer, number = ctypes.c_ulong, ctypes.c_void_p, ctypes.c_int
        size = ctypes.c_uint
        library.XOpenDisplay.restype = pointer
        library.XDefaultRootWindow.restype = unsigned
        library.XDefaultRootWindow.argtypes = [pointer]
        library.XStringToKeysym.restype = unsigned
        library.XKeysymToKeycode.restype = ctypes.c_ubyte
        library.XKeysymToKeycode.argtypes = [pointer, unsigned]
        library.XGetImage.restype = pointer
        library.XGetImage.argtypes = [pointer, unsigned, number, number, size, size, unsigned, number]
        library.XDestroyImage.argtypes = [pointer]
        library.XMoveResizeWindow.argtypes = [pointer, unsigned, number, number, size, size]
        library.XSetInputFocus.argtypes = [pointer, unsigned, number, unsigned]
        library.XQueryTree.argtypes = [pointer, unsigned, *[pointer] * 4]
        library.XFetchName.argtypes = library.XGetWindowAttributes.argtypes = [pointer, unsigned, pointer]
        library.XRaiseWindow.argtypes = [pointer, unsigned]
        library.XSync.argtypes = [pointer, number]
        for called in (library.XFlush, library.XFree, library.XCloseDisplay):
            called.argtypes = [pointer]
    else:
        library.XTestFakeKeyEvent.argtypes = [ctypes.c_void_p, ctypes.c_uint, ctypes.c_int, ctypes.c_ulong]
    return library


@contextlib.contextmanager
def private_screen() -> Iterator[Screen]:
    """Starts an X server on a free display number, and ends it afterwards.

    Raises:
        Missing: it did not start, or libX11 or libXtst is missing.
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
