"""Kinds of plug-ins, the systems that they are built for, and where hosts look for them."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from engine.python_process import is_bundled

EXTRA = "learned-strings[plugin]"
_HERE = {"Linux": "linux", "Windows": "windows", "Darwin": "macos"}
_MACHINES = {"x86_64": "x64", "amd64": "x64", "arm64": "arm64", "aarch64": "arm64"}


class PluginError(ValueError):
    """A plug-in cannot be built; the message names what is missing and the remedy."""


# By format and system, where hosts of one user look for it, below the home folder
FORMATS: Mapping[str, Mapping[str, str]] = {
    "clap": {
        "linux": ".clap",
        "windows": "AppData/Local/Programs/Common/CLAP",
        "macos": "Library/Audio/Plug-Ins/CLAP",
    },
    "vst3": {
        "linux": ".vst3",
        "windows": "AppData/Local/Programs/Common/VST3",
        "macos": "Library/Audio/Plug-Ins/VST3",
    },
    "lv2": {"linux": ".lv2", "windows": "AppData/Roaming/LV2", "macos": "Library/Audio/Plug-Ins/LV2"},
}


@dataclass(frozen=True)
class System:
    """A system that plug-ins are built for.

    Attributes:
        triple: of LLVM; `linker`: of the linker, where it has another name for it.
        cpus: processors whose kernels are built in, the oldest first. The plug-in takes the last of which the
            computer has all instructions.
    """

    triple: str
    cpus: tuple[str, ...]
    linker: str


X64 = "x86-64-v2", "x86-64-v3"
TARGETS: Mapping[str, System] = {
    "linux-x64": System("x86_64-unknown-linux-gnu", X64, "x86_64-linux-gnu.2.17"),
    "linux-arm64": System("aarch64-unknown-linux-gnu", ("generic",), "aarch64-linux-gnu.2.17"),
    "windows-x64": System("x86_64-w64-windows-gnu", X64, "x86_64-windows-gnu"),
    "macos-x64": System("x86_64-apple-macosx11.0.0", X64, "x86_64-macos.11.0"),
    "macos-arm64": System("arm64-apple-macosx11.0.0", ("apple-m1",), "aarch64-macos.11.0"),
}


def this_target() -> str:
    """The target of this computer. Raises PluginError: it is none of `TARGETS`."""
    target = f"{_HERE.get(platform.system(), '')}-{_MACHINES.get(platform.machine().lower(), '')}"
    if target not in TARGETS:
        raise PluginError(f"no plug-ins are built for this system; choose one of {', '.join(TARGETS)}")
    return target


def install_folder(form: str, target: str) -> Path:
    """The folder where the hosts of this user look for plug-ins of a format."""
    return Path.home() / FORMATS[form][target.partition("-")[0]]


def check_compiler() -> None:
    """Raise PluginError: the compiler is not installed."""
    if find_spec("ziglang") is None:
        remedy = (
            "start the program with Python, as docs/install.md says" if is_bundled() else f"pip install '{EXTRA}'"
        )
        raise PluginError(f"building a plug-in needs a C compiler, which is not here; {remedy}")
