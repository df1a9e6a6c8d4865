"""The text of the About dialog."""

from __future__ import annotations

import platform
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from app.shared.log import log_file
from app.shared.version import PROGRAM, program_version
from engine.folders import user_folder

LIBRARIES = (
    "torch",
    "numpy",
    "scipy",
    "numba",
    "safetensors",
    "PySide6-Essentials",
    "pyqtgraph",
    "sounddevice",
    "soundfile",
    "pydantic",
)

CITATION = (
    "R. Diaz, C. De La Vega Martin and M. Sandler, “Towards Efficient Modelling of String Dynamics: A Comparison "
    "of State Space and Koopman based Deep Learning Methods”, Proceedings of the 27th International Conference "
    "on Digital Audio Effects (DAFx24), 2024."
)


def library_versions() -> dict[str, str]:
    """Distribution -> installed version."""
    return {name: _version(name) for name in LIBRARIES}


def about_text(settings: Path, presets: Path) -> str:
    """Program, licence, paper, files and folders, and versions of libraries; the first line is the title."""
    return "\n".join(
        [
            f"{PROGRAM} {program_version()}",
            "Licence: MIT",
            "",
            f"After {CITATION}",
            "",
            f"Settings: {settings}",
            f"Factory presets: {presets}",
            f"Your own presets: {user_folder()}",
            f"Log: {log_file()}",
            "",
            f"Python {platform.python_version()} on {platform.platform()}, {sys.maxsize.bit_length() + 1} bit",
            *(f"{name} {number}" for name, number in library_versions().items()),
        ]
    )


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"
