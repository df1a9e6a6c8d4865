"""The memory of the running app: in Play, after notes, in the Lab, and there with a model of one string.

The window opens with default settings.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import psutil

if TYPE_CHECKING:
    from app.window.controller import Controller

START_S, LAB_S = 20.0, 15.0
OF_ONE_STRING = "nylon_nonlinear_gaussian_16k_koopman_integrated"  # needs torch
NOTES, NOTE_S = 20, 0.2
FIRST_KEY = 45


def main() -> int:
    """Run the app as its command does, print what it takes, and end it."""
    from app.shared.thread_priority import wait_asleep
    from app.window.main import run

    wait_asleep()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["LEARNED_STRINGS_SETTINGS"] = str(Path(folder) / "settings.json")
        return run(alive=_watch)


def _watch(controller: Controller) -> None:
    from PySide6.QtCore import QTimer

    from app.player.events import NoteOff, NoteOn

    def play(number: int) -> None:
        key = FIRST_KEY + number
        controller.inputs.play(NoteOn(key, 90))
        QTimer.singleShot(round(900 * NOTE_S), lambda: controller.inputs.play(NoteOff(key)))

    def lab() -> None:
        _print(f"Play, after {NOTES} notes")
        controller.window.face_asked.emit("lab")

    def choose() -> None:
        _print("Lab")
        controller.presets.choose(OF_ONE_STRING)
        controller.pluck()

    def close() -> None:
        _print(f"Lab, {OF_ONE_STRING}")
        controller.window.close()

    for number in range(NOTES):
        QTimer.singleShot(round(1000 * (START_S + number * NOTE_S)), lambda number=number: play(number))
    played_s = START_S + NOTES * NOTE_S + 5
    for time_s, work in (
        (START_S, lambda: _print("Play")),
        (played_s, lab),
        (played_s + LAB_S, choose),
        (played_s + 2 * LAB_S, close),
    ):
        QTimer.singleShot(round(1000 * time_s), work)


def _print(what: str) -> None:
    memory = psutil.Process().memory_full_info()
    print(
        f"{what}: {memory.rss / 1e6:.0f} MB resident, {memory.uss / 1e6:.0f} MB of it in no other process", flush=True
    )
