"""Plain data to dataclasses and back; files and folders appear whole, and a killed run's go at the next writing."""

import os
import subprocess
import sys
from dataclasses import dataclass, field
from datetime import date
from typing import Literal

import pytest

from engine.schema import SchemaError, parse_json, read, read_toml, write
from engine.whole_file import whole_file, whole_folder, working_folder


@dataclass(frozen=True)
class Inner:
    size: int = 3


@dataclass(frozen=True)
class Outer:
    name: str
    kind: Literal["a", "b"] = "a"
    share: float = 0.5
    on: bool = True
    sizes: tuple[int, ...] = ()
    pair: tuple[float, float] | None = None
    inner: Inner = field(default_factory=Inner)

    def __post_init__(self) -> None:
        if self.share > 1:
            raise ValueError("share must be at most 1")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ([], "here: must be a table of fields, found list"),
        ({}, "here: field 'name' is missing"),
        ({"name": "x", "wide": 1}, "here: unknown field 'wide'; known are name"),
        ({"name": 3}, "here.name: must be a valid string, found 3"),
        ({"name": "x", "kind": "c"}, "here.kind: must be 'a' or 'b', found 'c'"),
        ({"name": "x", "share": True}, "here.share: must be a valid number, found True"),
        ({"name": "x", "share": float("nan")}, "here.share: must be a finite number"),
        ({"name": "x", "share": 2.0}, "here: share must be at most 1"),
        ({"name": "x", "on": 1}, "here.on: must be true or false, found 1"),
        ({"name": "x", "sizes": [1, "2"]}, r"here.sizes\[1\]: must be a valid integer, found '2'"),
        ({"name": "x", "pair": [1.0]}, "here.pair: field 1 is missing"),
        ({"name": "x", "inner": {"sizes": 1}}, "here.inner: unknown field 'sizes'; known are size"),
        ({"name": "x", "pair": [1.0, 2.0, 3.0]}, "here.pair: must have at most 2 items"),
        ({"name": "x", "share": 10**400}, "here.share: must be a number of at most 64 bits"),
        ({"name": "x", "sizes": [1] * 1001}, "here.sizes: has 1001 entries"),
        ({"name": "x" * 10_001}, "here.name: has 10001 characters"),
        ({"name": date(2020, 1, 1)}, "here.name: must be a number or a text"),
    ],
)
def test_what_does_not_fit_is_named(data, message):
    with pytest.raises(SchemaError, match=message):
        read(Outer, data, "here")


def test_what_is_written_is_read_without_a_byte_order_mark_and_with_no_field_twice(tmp_path):
    value = Outer("x", "b", 0.25, False, (1, 2), (0.5, 1.5), Inner(9))
    assert read(Outer, write(value), "here") == value
    assert read(Outer, {"name": "x", "share": 1}, "here") == Outer("x", share=1.0)
    (tmp_path / "a.toml").write_bytes(b"\xef\xbb\xbflength_m = 0.65\r\n")  # as Windows' Notepad may write
    assert read_toml(tmp_path / "a.toml") == {"length_m": 0.65}
    assert parse_json('{"a": {"b": 1}, "b": 2}', "here") == {"a": {"b": 1}, "b": 2}
    with pytest.raises(SchemaError, match=r"here: not JSON that can be read \(field 'b' is given twice\)"):
        parse_json('{"a": {"b": 1, "c": 3, "b": 2}}', "here")


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
def test_leftovers_of_the_dead_go_and_those_of_the_living_stay(tmp_path, again):
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


def test_a_folder_replaces_another_as_a_whole_and_an_error_changes_nothing(tmp_path):
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
def test_long_names_in_any_script_can_be_written(tmp_path, name):
    with whole_file(tmp_path / name) as unfinished, working_folder(tmp_path, name) as folder:
        unfinished.write_text(folder.name)
    assert [each.name for each in tmp_path.iterdir()] == [name]
