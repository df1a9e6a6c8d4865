"""What a killed run has left of a file is removed when the same file is written again."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from engine.whole_file import whole_file

KILLED = """
import os, signal, sys
from pathlib import Path
from engine.whole_file import whole_file
with whole_file(Path(sys.argv[1])) as unfinished:
    unfinished.write_text("half")
    os.kill(os.getpid(), signal.SIGKILL if hasattr(signal, "SIGKILL") else signal.SIGTERM)
"""


def test_leftovers_of_the_dead_go_and_those_of_the_living_stay(tmp_path: Path) -> None:
    path = tmp_path / "out.wav"
    for name in (path, tmp_path / "other.wav"):
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
        subprocess.run([sys.executable, "-c", KILLED, str(name)], env=environment, check=False)
    left = sorted(tmp_path.glob(".*.unfinished"))
    assert len(left) == 2 and not path.exists()
    dead = next(each for each in left if each.name.startswith(".out.wav."))
    stem, _, _ = dead.name.rpartition("-")
    alive = tmp_path / f"{stem}-{os.getppid()}.unfinished"
    foreign = tmp_path / ".out.wav.00000000-1.unfinished"  # another computer's, in a shared folder
    for each in (alive, foreign):
        each.write_text("under way")
    with whole_file(path) as unfinished:
        unfinished.write_text("whole")
    assert path.read_text() == "whole"
    kept = {each.name for each in tmp_path.glob(".*")}
    assert kept == {alive.name, foreign.name, next(each.name for each in left if "other" in each.name)}
