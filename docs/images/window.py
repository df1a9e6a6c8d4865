"""Draw the pictures of the window without a screen: `PYTHONPATH=. .venv/bin/python docs/images/window.py`.

`window.png`: the Lab, a model trained on 25 ms after a hard pluck, with the playhead past the training.
`play.png`: the face Play, with a chord on the neck of a guitar.
`string.webp`: the string from the pluck on, slowed as under a stroboscope.
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from PIL import Image
from PySide6.QtCore import QTimer
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QAbstractButton, QWidget

from app.views.instrument.neck import Neck
from app.views.string.view import StringView
from app.window import main as start
from app.window.controller import Controller

HERE = Path(__file__).resolve().parent
PRESET = "nylon_nonlinear_gaussian_16k_lru_400"
CHOICES = {
    "face": "lab",
    "single": PRESET,
    "pluck": {"amplitude_mm": 9.0},
    "seconds": 0.5,
    "left_view": "spectrum",
    "right_view": "space_time",
}
AT_S = 0.1
CHORD = (40, 47, 52, 56, 59, 64)  # E major, open
FRAMES, FRAME_MS = 60, 70
FLASH_S = 1 / 246.9 + 0.00027  # a period of the string and a little more


def main() -> None:
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    folder = tempfile.mkdtemp()
    os.environ["LEARNED_STRINGS_SETTINGS"] = str(Path(folder, "settings.json"))
    Path(folder, "settings.json").write_text(json.dumps({"choices": CHOICES}), "utf-8")

    def watch(controller: Controller) -> None:
        window = controller.window
        window.resize(1280, 900)
        steps = iter(_steps(controller))
        timer = QTimer(window, interval=200)
        timer.timeout.connect(lambda: next(steps, None))
        timer.start()

    raise SystemExit(start.run(alive=watch))


def _steps(controller: Controller) -> Iterator[None]:
    """The steps of the film, one each fifth of a second."""
    performance, window = controller.performance, controller.window
    while not (performance.ready and performance.settled):
        yield
    performance.stop()
    window.notices.hide()
    for button in window.findChildren(QAbstractButton):
        if button.text() == "Error":
            button.click()
    performance.seek(AT_S)
    for _ in range(15):
        yield
    window.rate_label.hide()  # there is no sound device here
    window.grab().save(str(HERE / "window.png"))
    view, frames = window.findChild(StringView), []
    for number in range(FRAMES):
        performance.seek(number * FLASH_S)
        yield
        frames.append(picture(view))
    first, *others = frames
    first.save(HERE / "string.webp", save_all=True, append_images=others, duration=FRAME_MS, loop=0, quality=60)
    yield from _play(controller)
    window.close()
    yield


def _play(controller: Controller) -> Iterator[None]:
    """Switches to Play, waits for the guitar and plays a chord."""
    window = controller.window
    controller.session.update(face="play", speed=0.004, seconds=4.0)
    controller.instruments.choose("classical_guitar")
    window.instrument.show_surface("neck")
    window.resize(1280, 800)
    while controller.performance.notes.keys.player is None:
        yield
    for _ in range(5):
        yield
    for key in CHORD:
        window.instrument.pressed.emit(key, 80, None)
    neck = window.findChild(Neck)
    while not all(neck.level(key) > 0 for key in CHORD):
        yield
    for _ in range(5):  # its motion is being computed
        yield
    window.notices.hide()
    window.notices.bell.set_unseen(0)
    window.rate_label.hide()  # there is no sound device here
    window.grab().save(str(HERE / "play.png"))


def picture(widget: QWidget) -> Image.Image:
    """The picture of a widget, at two thirds of its size."""
    shot = widget.grab().toImage().convertToFormat(QImage.Format.Format_RGB888)
    image = Image.frombytes(
        "RGB", (shot.width(), shot.height()), bytes(shot.constBits()), "raw", "RGB", shot.bytesPerLine()
    )
    return image.resize((shot.width() * 2 // 3, shot.height() * 2 // 3), Image.Resampling.LANCZOS)


if __name__ == "__main__":
    main()
