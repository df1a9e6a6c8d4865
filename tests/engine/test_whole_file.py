"""Files and folders appear whole; what a killed run has left goes when something is written there again."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import pytest

from engine.whole_file import whole_file, whole_folder, working_folder

KILLED = """
import os, signal, sys
from pathlib import Path
from engine.whole_file import whole_file, working_folder
path = Path(sys.argv[1])
with whole_file(path) as unfinished, working_folder(path.parent, "many files") as folder:
    unfinished.write_text("half")
    (folder / "one").write_text("half")
    os.kill(os.getpid(), signal.SIGKILL if hasattr(signal, "SIGKILL") else signal.SIGTERM)
"""


@pytest.mark.parametrize("again", (whole_file, whole_folder))
def test_leftovers_of_the_dead_go_and_those_of_the_living_stay(
    tmp_path: Path, again: Callable[[Path], AbstractContextManager[Path]]
) -> None:
    path = tmp_path / "out.wav"
    for name in (path, tmp_path / "other.wav"):
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
        subprocess.run([sys.executable, "-c", KILLED, str(name)], env=environment, check=False)
    left = sorted(tmp_path.glob(".*.unfinished"))
    assert [each.is_dir() for each in left] == [True, False]  # those of the first run are gone already
    assert not path.exists()
    stem, _, _ = left[1].name.rpartition("-")
    alive = {tmp_path / f"{stem}-{os.getppid()}{mark}.unfinished" for mark in ("", "-folder")}
    foreign = tmp_path / ".out.wav.00000000-1.unfinished"  # another computer's, in a shared folder
    others = tmp_path / f"{stem}-999999999.unfinished.wav"  # of the user's own
    aside = tmp_path / "aside"
    for each in (*alive, foreign, others):
        each.write_text("under way")
    aside.mkdir()
    (aside / "kept").touch()
    (tmp_path / f"{stem}-999999999-link.unfinished").symlink_to(aside)
    with again(path) as unfinished:
        (unfinished / "file" if unfinished.is_dir() else unfinished).write_text("whole")
    assert ((path / "file") if path.is_dir() else path).read_text() == "whole"
    assert {*tmp_path.iterdir()} == {*alive, foreign, others, aside, path}
    assert [each.name for each in aside.iterdir()] == ["kept"]


def test_a_folder_replaces_another_as_a_whole_and_an_error_changes_nothing(tmp_path: Path) -> None:
    path = tmp_path / "bundle"
    for names in (("one", "two"), ("two", "three")):
        with whole_folder(path) as made:
            for name in names:
                (made / name).touch()
        assert sorted(each.name for each in path.iterdir()) == sorted(names)
    with pytest.raises(RuntimeError), whole_folder(path) as made:
        (made / "half").touch()
        raise RuntimeError
    assert sorted(each.name for each in path.iterdir()) == ["three", "two"]
    assert [each.name for each in tmp_path.iterdir()] == ["bundle"]


@pytest.mark.parametrize("name", ("古" * 80, "é" * 120, "🎸" * 60, "a" * 250))
def test_long_names_in_any_script_can_be_written(tmp_path: Path, name: str) -> None:
    with whole_file(tmp_path / name) as unfinished, working_folder(tmp_path, name) as folder:
        unfinished.write_text(folder.name)
    assert [each.name for each in tmp_path.iterdir()] == [name]
