"""Instruments as files: listed, read, saved, renamed; nothing of a stranger's harms the others."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from app.instruments import library
from app.instruments.instrument import Instrument
from app.instruments.library import (
    SHIPPED,
    InstrumentError,
    file_stem,
    find_instrument,
    list_instruments,
    own_instruments,
    read_instrument,
    rename_instrument,
    save_instrument,
)

Make = Callable[..., Instrument]


@pytest.fixture(autouse=True)
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The user's folder of instruments, not made yet."""
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(tmp_path / "own"))
    return tmp_path / "own" / "instruments"


def write(path: Path, facts: object) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(facts))
    return path


def test_what_is_saved_is_listed_and_read_again(make_instrument: Make, own: Path) -> None:
    entry = save_instrument(make_instrument(name="Čembalo, 8′", category="keys"))
    assert entry.path == own / "čembalo_8.json" and entry.own
    listed, problems = list_instruments()
    assert entry in listed and not problems
    assert find_instrument("Čembalo, 8′") == find_instrument("ČEMBALO_8") == find_instrument(str(entry.path)) == entry


def test_a_instrument_is_replaced_only_where_that_is_meant(make_instrument: Make) -> None:
    save_instrument(make_instrument(name="Mine"))
    with pytest.raises(InstrumentError, match=r"mine: .* exists already; choose another"):
        save_instrument(make_instrument(name="mine", level_db=3))
    file = own_instruments() / "mine.json"
    assert read_instrument(save_instrument(make_instrument(name="mine", level_db=3), file).path).level_db == 3


def test_a_instrument_replaces_its_own_file_and_no_other(make_instrument: Make, own: Path) -> None:
    """A file that was put there may have any name, whatever the instrument in it is called."""
    save_instrument(make_instrument(name="My-Bass"))
    friends = write(own / "friend.json", make_instrument(name="My bass").model_dump(mode="json"))
    saved = save_instrument(make_instrument(name="My bass", level_db=3), friends)
    assert (saved.path, read_instrument(friends).level_db) == (friends, 3)
    assert read_instrument(own / "my_bass.json").name == "My-Bass"


def test_two_instruments_of_one_name_are_reported_apart(make_instrument: Make, own: Path) -> None:
    save_instrument(make_instrument(name="Mine"))
    long = "M" * 60
    for name, file in (("Mine", "mine (copy)"), ("mine", "mine_3"), (long, "long"), (long, "longer")):
        write(own / f"{file}.json", make_instrument(name=name).model_dump(mode="json"))
    entries, problems = list_instruments(own)
    assert not problems
    names = {entry.name: entry.instrument.name for entry in entries}
    assert len({name.casefold() for name in names.values()}) == 5
    assert {names["mine (copy)"], names["mine"]} == {"Mine", "Mine 2"}
    assert names["longer"] == f"{'M' * 58} 2"


def test_a_shipped_instrument_is_neither_overwritten_nor_renamed(make_instrument: Make, own: Path) -> None:
    shipped = list_instruments(SHIPPED)[0][0]
    for replace in (None, shipped.path):
        with pytest.raises(InstrumentError, match="factory"):
            save_instrument(make_instrument(name=shipped.instrument.name), replace)
    with pytest.raises(InstrumentError, match="shipped with"):
        rename_instrument(shipped, "Other")
    assert not own.exists()


def test_renaming(make_instrument: Make, own: Path) -> None:
    first = save_instrument(make_instrument(name="First"))
    save_instrument(make_instrument(name="Taken"))
    for name, reported in (("taken", "exists already"), ("../up", "name"), ("", "name"), ("a\nb", "name")):
        with pytest.raises(InstrumentError, match=reported):
            rename_instrument(first, name)
    second = rename_instrument(first, "Second")
    assert sorted(path.name for path in own.iterdir()) == ["second.json", "taken.json"]
    spelt = rename_instrument(second, "SECOND")
    assert spelt.path == second.path and read_instrument(spelt.path).name == "SECOND"


@pytest.mark.parametrize("name", ["..", "../../etc/passwd", "a/b", "a\\b", "C:x", ".hidden", "CON", "!!!", "名前"])
def test_a_file_name_is_never_a_path(name: str) -> None:
    stem = file_stem(name)
    assert stem and Path(stem).name == stem and stem.casefold() not in library.DEVICES
    assert all(c.isalnum() or c == "_" for c in stem)


def test_one_bad_file_hides_no_other(make_instrument: Make, own: Path) -> None:
    good = save_instrument(make_instrument(name="Good"))
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
    entries, problems = list_instruments(own)
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
def test_faults_are_named_in_plain_words(
    make_instrument: Make, own: Path, field: str, value: object, words: str
) -> None:
    data = json.loads(save_instrument(make_instrument(name="One")).path.read_text())
    (own / "a.json").write_text(json.dumps(data | {field: value}))
    with pytest.raises(InstrumentError, match=f"a.json: {words}; mend this field"):
        read_instrument(own / "a.json")


def test_of_two_instruments_of_one_name_the_shipped_one_counts(own: Path) -> None:
    shipped = list_instruments(SHIPPED)[0][0]
    write(own / shipped.path.name, json.loads(shipped.path.read_text(encoding="utf-8")))
    entries, problems = list_instruments()
    assert [entry for entry in entries if entry.name == shipped.name] == [shipped]
    assert len(problems) == 1 and "exists already; rename the file" in problems[0]
