"""The start of the window: it is shown first, and what takes long to load follows."""

from __future__ import annotations

import builtins
import contextlib
import gc
import sys
import threading
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

if sys.platform == "win32":
    import torch  # noqa: F401 - before Qt: the other order fails there

from PySide6.QtCore import QObject, Qt, QTimer, Signal
from PySide6.QtWidgets import QApplication

if hasattr(builtins, "__orig_import__"):
    # PySide's own import reads every module's source, for `from __feature__`, and so keeps it: 40 MB, with torch 70.
    builtins.__import__ = builtins.__orig_import__

from app.instruments.library import FIRST, InstrumentError, read_instrument
from app.shared.heap import collect_anywhere, collect_between_events, return_large_blocks
from app.shared.log import crashes_written, faults_logged, log_fault
from app.shared.thread_priority import leave_a_core
from app.views.theme import apply_theme
from app.window.display import check_display
from app.window.main_window import MainWindow
from app.window.settings import Settings, load_settings, settings_file
from app.window.signals import asked_to_end

if TYPE_CHECKING:
    from app.window.controller import Controller


Alive = Callable[["Controller"], None]
CANNOT_START = "The models cannot be loaded, so the program cannot be used."
UNEXPECTED = "An unexpected error. Sound and picture may continue; if they do not, restart the program."
PATIENCE_S = 5.0  # for the sound device and the instrument's preset, before a file is taken
LOOK_MS = 20  # between two looks whether a file can be taken


def with_instrument(settings: Settings) -> Settings:
    """The settings, with the instrument FIRST where none was ever chosen: keys play from the first start on."""
    if settings.choices.instrument is not None:
        return settings
    with contextlib.suppress(InstrumentError):  # without an instrument, keys pluck at ten places
        instrument = read_instrument(FIRST)
        update = {"instrument" if settings.choices.preset else "played": instrument}
        return settings.model_copy(update={"choices": settings.choices.changed(update)})
    return settings


class _Start(QObject):
    """The start: a thread loads the engine once the window is painted; then the controller is made.

    Args:
        path: of the settings' file.
        notice: about the settings, to be shown; "": none.
        alive: is called with the controller.
        files: are taken then, as if they were dropped on the window.

    Attributes:
        failure: why the engine or the controller could not be made; None: they could, or not yet.
    """

    _loaded = Signal()

    def __init__(
        self,
        window: MainWindow,
        settings: Settings,
        path: Path,
        notice: str,
        alive: Alive,
        files: Sequence[Path],
    ) -> None:
        super().__init__()
        self._files = list(files)
        self._window = window
        self._settings = settings
        self._path = path
        self._notice = notice
        self._alive = alive
        self._thread = threading.Thread(target=self._load, name="engine-loader")
        self._torch = threading.Thread(target=load_torch, name="torch-loader", daemon=True)
        self._controller: Controller | None = None
        self.failure: Exception | None = None
        self._loaded.connect(self._begin, Qt.ConnectionType.QueuedConnection)
        window.first_painted.connect(self._thread.start)

    def wait(self) -> None:
        """Return when the loading has ended."""
        if self._thread.ident is not None:
            self._thread.join()

    def _load(self) -> None:
        try:
            load_engine()
        except Exception as error:
            self.failure = error
        self._loaded.emit()

    def _begin(self) -> None:
        """Make the controller, in the window's thread; show a failure of it or of the loading."""
        try:
            if self.failure is not None:
                raise self.failure
            from app.window.controller import Controller

            self._controller = Controller(self._window, self._settings, self._path)
            self._collector = collect_between_events()
        except Exception as error:
            self.failure = error
            self._show_failure(error)
            return
        if self._notice:
            self._window.notices.report(self._notice)
        self._alive(self._controller)
        QTimer.singleShot(0, self._controller.instruments.recordings.offer_left)
        self._patience_s = time.monotonic() + PATIENCE_S
        self._controller.presets.browser.opened.connect(self._prepare)
        self._follow_up()

    def _follow_up(self) -> None:
        """Take one file after another, each once keys would sound or PATIENCE_S have passed.

        So the first notes of a MIDI file are heard. It looks again every LOOK_MS.
        """
        controller = self._controller
        assert controller is not None
        if controller.performance.playable or time.monotonic() > self._patience_s:
            if not self._files:
                return
            controller.take_file(self._files.pop(0))
            self._patience_s = time.monotonic() + PATIENCE_S
        QTimer.singleShot(LOOK_MS, self, self._follow_up)

    def _prepare(self) -> None:
        """Load torch while presets are looked at: models of one string need it, and the others save its 200 MB."""
        if self._torch.ident is None:
            self._torch.start()

    def _show_failure(self, error: Exception) -> None:
        """Show the error as a notice; the window stays until its user closes it."""
        collect_anywhere()
        self._window.show_failed()
        self._window.notices.faulted.emit(CANNOT_START, log_fault(error, "while the engine was loaded"))


def load_engine() -> None:
    """Load what the first sound needs and the first paint does not."""
    threading.Thread(target=_find_devices, name="sound-finder", daemon=True).start()
    from threadpoolctl import threadpool_limits

    from engine.warm import warm

    # NumPy's products are small here; the threads of its BLAS, one a core, would spin between them for nothing.
    threadpool_limits(limits=1, user_api="blas")
    warm()


def load_torch() -> None:
    """Load torch before a model needs it."""
    import torch  # noqa: F401


def _find_devices() -> None:
    """Load PortAudio, which looks for devices as it is loaded and may take long, beside the rest."""
    with contextlib.suppress(Exception):  # raised again where it is used
        import sounddevice  # noqa: F401


def run(
    watch: Callable[[MainWindow], None] = lambda window: None,
    alive: Alive = lambda controller: None,
    files: Sequence[Path] = (),
) -> int:
    """Open the app and return its exit status when it is closed.

    Args:
        watch: is given the window before it is shown.
        alive: is given the controller as soon as there is one.
        files: are then taken as if they were dropped on the window, in this order.

    Raises:
        NoDisplay: there is no screen.
        Exception: why the engine could not be loaded, after the window was closed.
    """
    check_display()
    gc.disable()  # until `collect_between_events`, or until loading fails: there is hardly any garbage before
    return_large_blocks()
    leave_a_core()
    path = settings_file()
    settings, notice = load_settings(path)
    settings = with_instrument(settings)
    application = QApplication.instance() or QApplication(sys.argv[:1])
    assert isinstance(application, QApplication)
    application.setApplicationName("Learned Strings")
    apply_theme(application, settings.look.theme, settings.look.size_percent)
    window = MainWindow()
    window.show_face(settings.choices.face)
    window.restore_geometry(settings.window_geometry)
    start = _Start(window, settings, path, notice, alive, files)

    def end() -> None:
        """End the app without a question: what is not saved is offered at the next start."""
        window.may_close = lambda: True
        window.close()
        application.quit()  # also loops of dialogs

    with (
        crashes_written(),
        faults_logged(partial(window.notices.faulted.emit, UNEXPECTED)),
        asked_to_end(end),
    ):
        watch(window)
        window.show()
        status = application.exec()
        if window.isVisible():  # it was asked about while it was closed
            window.close()
        start.wait()
    if start.failure is not None:
        raise start.failure
    return status
