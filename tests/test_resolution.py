"""What run.py and extras install has wheels, resolved by uv for each Python and system of docs/install.md."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PYTHONS = ("3.11", "3.14")  # the oldest and the newest
SYSTEMS = {  # uv's names, and those of docs/install.md
    "x86_64-manylinux_2_34": "| Linux, x86-64 | glibc 2.34:",
    "aarch64-manylinux_2_39": "| Linux, ARM64 | glibc 2.39:",
    "aarch64-apple-darwin": "| macOS, Apple silicon | macOS 14 |",
    "x86_64-pc-windows-msvc": "| Windows, x64 |",
}
# Nothing is built, and no other Python is fetched: this one stands in for it.
COMPILE = ("pip", "compile", "--quiet", "--no-header", "--no-annotate", "--no-build", "--no-python-downloads")
EXTRAS = ("dev", "midi", "docs", "cluster", "bundle")
WHAT = ("pyproject.toml", "--constraints", "constraints.txt", *(word for e in EXTRAS for word in ("--extra", e)))
CUDA = ("cuda-", "nvidia-", "triton")  # comes with torch's usual build for Linux, which pins it itself


def test_every_python_and_system_installs_from_wheels():
    uv = pytest.importorskip("uv", reason="uv is not installed")
    environment = {**os.environ, "MACOSX_DEPLOYMENT_TARGET": "14.0", "UV_HTTP_TIMEOUT": "20", "UV_HTTP_RETRIES": "1"}

    def resolve(python: str, system: str) -> subprocess.CompletedProcess[str]:
        target = ("--python", sys.executable, "--python-version", python, "--python-platform", system)
        command = [uv.find_uv_bin(), *COMPILE, *target, *WHAT]
        return subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)

    with ThreadPoolExecutor(8) as pool:
        found = list(pool.map(resolve, *zip(*product(PYTHONS, SYSTEMS), strict=True)))
    if unreachable := [done.stderr for done in found if "Failed to fetch" in done.stderr]:
        pytest.skip(f"the package index cannot be reached: {unreachable[0].strip()}")
    assert [(done.args, done.stderr) for done in found if done.returncode != 0] == []
    installed = {line.split("==")[0] for done in found for line in done.stdout.splitlines()}
    lines = (ROOT / "constraints.txt").read_text("utf-8").splitlines()
    pinned = {line.split("==")[0].lower().replace("_", "-") for line in lines}
    assert sorted(name for name in installed - pinned if not name.startswith(CUDA)) == []


def test_documents_name_these_pythons_and_systems():
    readme, install = ((ROOT / name).read_text("utf-8") for name in ("README.md", "docs/install.md"))
    assert [row for row in SYSTEMS.values() if row not in install] == []
    for text in (readme, install):
        assert f"Python {PYTHONS[0]} to {PYTHONS[-1]}" in text
