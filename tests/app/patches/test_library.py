"""Patches as files: listed, read, saved, renamed; nothing of a stranger's harms the others."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from app.patches import library
from app.patches.library import (
    SHIPPED,
    PatchError,
    file_stem,
    find_patch,
    list_patches,
    own_patches,
    read_patch,
    rename_patch,
    save_patch,
)
from app.patches.patch import Patch

Make = Callable[..., Patch]


@pytest.fixture(autouse=True)
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The user's folder of patches, not made yet."""
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(tmp_path / "own"))
    return tmp_path / "own" / "patches"


def write(path: Path, facts: object) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(facts))
    return path


def test_what_is_saved_is_listed_and_read_again(make_patch: Make, own: Path) -> None:
    entry = save_patch(make_patch(name="Čembalo, 8′", category="keys"))
    assert entry.path == own / "čembalo_8.json" and entry.own
    listed, problems = list_patches()
    assert entry in listed and not problems
    assert find_patch("Čembalo, 8′") == find_patch("ČEMBALO_8") == find_patch(str(entry.path)) == entry


def test_a_patch_is_replaced_only_where_that_is_meant(make_patch: Make) -> None:
    save_patch(make_patch(name="Mine"))
    with pytest.raises(PatchError, match=r"mine: .* exists already; choose another"):
        save_patch(make_patch(name="mine", level_db=3))
    file = own_patches() / "mine.json"
    assert read_patch(save_patch(make_patch(name="mine", level_db=3), file).path).level_db == 3


def test_a_patch_replaces_its_own_file_and_no_other(make_patch: Make, own: Path) -> None:
    """A file that was put there may have any name, whatever the patch in it is called."""
    save_patch(make_patch(name="My-Bass"))
    friends = write(own / "friend.json", make_patch(name="My bass").model_dump(mode="json"))
    saved = save_patch(make_patch(name="My bass", level_db=3), friends)
    assert (saved.path, read_patch(friends).level_db) == (friends, 3)
    assert read_patch(own / "my_bass.json").name == "My-Bass"


def test_two_patches_of_one_name_are_reported_apart(make_patch: Make, own: Path) -> None:
    save_patch(make_patch(name="Mine"))
    long = "M" * 60
    for name, file in (("Mine", "mine (copy)"), ("mine", "mine_3"), (long, "long"), (long, "longer")):
        write(own / f"{file}.json", make_patch(name=name).model_dump(mode="json"))
    entries, problems = list_patches(own)
    assert not problems
    names = {entry.name: entry.patch.name for entry in entries}
    assert len({name.casefold() for name in names.values()}) == 5
    assert {names["mine (copy)"], names["mine"]} == {"Mine", "Mine 2"}
    assert names["longer"] == f"{'M' * 58} 2"


def test_a_shipped_patch_is_neither_overwritten_nor_renamed(make_patch: Make, own: Path) -> None:
    shipped = list_patches(SHIPPED)[0][0]
    for replace in (None, shipped.path):
        with pytest.raises(PatchError, match="factory"):
            save_patch(make_patch(name=shipped.patch.name), replace)
    with pytest.raises(PatchError, match="shipped with"):
        rename_patch(shipped, "Other")
    assert not own.exists()


def test_renaming(make_patch: Make, own: Path) -> None:
    first = save_patch(make_patch(name="First"))
    save_patch(make_patch(name="Taken"))
    for name, reported in (("taken", "exists already"), ("../up", "name"), ("", "name"), ("a\nb", "name")):
        with pytest.raises(PatchError, match=reported):
            rename_patch(first, name)
    second = rename_patch(first, "Second")
    assert sorted(path.name for path in own.iterdir()) == ["second.json", "taken.json"]
    spelt = rename_patch(second, "SECOND")
    assert spelt.path == second.path and read_patch(spelt.path).name == "SECOND"


@pytest.mark.parametrize("name", ["..", "../../etc/passwd", "a/b", "a\\b", "C:x", ".hidden", "CON", "!!!", "名前"])
def test_a_file_name_is_never_a_path(name: str) -> None:
    stem = file_stem(name)
    assert stem and Path(stem).name == stem and stem.casefold() not in library.DEVICES
    assert all(c.isalnum() or c == "_" for c in stem)


def test_one_bad_file_hides_no_other(make_patch: Make, own: Path) -> None:
    good = save_patch(make_patch(name="Good"))
    facts = json.loads(good.path.read_text())
    (own / "folder.json").mkdir()
    (own / ".hidden.json").write_text("{")
    write(own / "newer.json", {**facts, "version": 2})
    write(own / "colour.json", {**facts, "colour": 1})
    write(own / "high.json", {**facts, "pluck": {"position": 3}})
    write(own / "long.json", {**facts, "author": "x" * 5000})
    (own / "big.json").write_bytes(b" " * (2**20 + 1))
    (own / "deep.json").write_text("[" * 100_000)
    (own / "number.json").write_text(good.path.read_text().replace("440.0", "9" * 5000))
    (own / "nan.json").write_text(good.path.read_text().replace("440.0", "NaN"))
    (own / "bytes.json").write_bytes(b"\xff\xfe{}")
    if hasattr(os, "mkfifo"):
        os.mkfifo(own / "pipe.json")
    expected = {path.name for path in own.iterdir()} - {"good.json", ".hidden.json"}
    entries, problems = list_patches(own)
    assert entries == [good]
    assert all(problem.isprintable() and len(problem) <= 500 for problem in problems)
    reported = {Path(problem.split(".json: ")[0] + ".json").name: problem for problem in problems}
    assert set(reported) == expected
    for name, words in (
        ("newer", "version: made by a newer version"),
        ("colour", "colour"),
        ("high", "pluck.position: must be less than or equal to 0.98, found 3"),
        ("long", "author"),
        ("nan", "tuning.a4_hz"),
        ("big", "larger than"),
    ):
        assert words in reported[f"{name}.json"], reported[f"{name}.json"]


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("strings", {}, "strings: field 'kind' is missing"),
        ("strings", {"kind": "x"}, "strings.kind: must be one of 'fretted', 'set', 'drums', found 'x'"),
        ("room", -1, "room: must be a table of fields, found -1"),
        ("macros", "x", "macros: must be a list, found 'x'"),
        ("name", "\t ", "name: must be one line of printable characters; remove the others"),
        ("name", "  ", "name: must not be blank; give a name"),
        ("macros", [5], r"macros\[0\]: must be a table of fields, found 5"),
    ],
)
def test_faults_are_named_in_plain_words(make_patch: Make, own: Path, field: str, value: object, words: str) -> None:
    data = json.loads(save_patch(make_patch(name="One")).path.read_text())
    (own / "a.json").write_text(json.dumps(data | {field: value}))
    with pytest.raises(PatchError, match=f"a.json: {words}; mend this field"):
        read_patch(own / "a.json")


def test_of_two_patches_of_one_name_the_shipped_one_counts(own: Path) -> None:
    shipped = list_patches(SHIPPED)[0][0]
    write(own / shipped.path.name, json.loads(shipped.path.read_text(encoding="utf-8")))
    entries, problems = list_patches()
    assert [entry for entry in entries if entry.name == shipped.name] == [shipped]
    assert len(problems) == 1 and "exists already; rename the file" in problems[0]
