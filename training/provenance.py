"""The origin of a result: the code and the machine."""

from __future__ import annotations

import os
import platform
import subprocess
from datetime import UTC, datetime
from pathlib import Path

import torch

COMMIT_VARIABLE = "LEARNED_STRINGS_COMMIT"  # names the commit where the code runs without its history
_ROOT = Path(__file__).parents[1]


def commit() -> str:
    """The commit of the code, with "+" where files differ from it; "" where neither git nor COMMIT_VARIABLE tell."""
    reported = os.environ.get(COMMIT_VARIABLE, "")
    if reported or not (_ROOT / ".git").exists():
        return reported
    try:
        return _git("rev-parse", "--short=10", "HEAD") + ("+" if _git("status", "--porcelain", "-uno") else "")
    except (OSError, subprocess.SubprocessError):
        return ""


def processor() -> str:
    """The processor's name; Linux has it in a file alone."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def hardware(device: torch.device | str) -> str:
    """The name of what computes on `device`."""
    device = torch.device(device)
    return torch.cuda.get_device_name(device) if device.type == "cuda" else processor()


def now() -> str:
    """UTC, ISO 8601, to the second."""
    return datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def _git(*words: str) -> str:
    done = subprocess.run(["git", *words], cwd=_ROOT, capture_output=True, text=True, check=True, timeout=10)
    return done.stdout.strip()
