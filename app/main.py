"""The start of the window."""

from __future__ import annotations

import os
import sys


def run() -> int:
    """Opens the app and returns its exit status when it is closed."""
    import torch  # before Qt: on Windows the other order fails

    sys.setswitchinterval(
        0.0001
    )  # callback and rendering of a pluck must get the interpreter in time from the picture
    torch.set_num_threads(max(1, (os.cpu_count() or 2) - 1))  # one core stays for sound and picture

    from PySide6.QtWidgets import QApplication

    from app.controller import Controller
    from app.main_window import MainWindow
    from app.settings import load_settings, settings_file
    from app.views.theme import apply_theme

    application = QApplication.instance() or QApplication(sys.argv[:1])
    assert isinstance(application, QApplication)
    application.setApplicationName("Learned Strings")
    apply_theme(application)
    path = settings_file()
    settings, notice = load_settings(path)
    window = MainWindow()
    window.restore_geometry(settings.window_geometry)
    Controller(window, settings, path)
    if notice:
        window.notices.tell(notice)
    window.show()
    return application.exec()
