"""Instruments as files: listed, read, saved, renamed; nothing of a stranger's harms the others."""

import json
import os
from pathlib import Path

import pytest

from app.instruments import library
from tests.app.instruments.conftest import make_instrument


@pytest.fixture(autouse=True)
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The user's folder of instruments, not made yet."""
    monkeypatch.setenv("LEARNED_STRINGS_PRESETS", str(tmp_path / "own"))
    return tmp_path / "own" / "instruments"


def write(path: Path, facts: object) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(facts))
    return path


def test_what_is_saved_is_listed_and_read_again(own):
    entry = library.save_instrument(make_instrument(name="Čembalo, 8′", category="keys"))
    assert entry.path == own / "čembalo_8.json" and entry.own
    listed, problems = library.list_instruments()
    assert entry in listed and not problems
    for name in ("Čembalo, 8′", "ČEMBALO_8", str(entry.path)):
        assert library.find_instrument(name) == entry


def test_an_instrument_replaces_its_own_file_where_that_is_meant_and_no_other(own):
    library.save_instrument(make_instrument(name="My-Bass"))
    with pytest.raises(library.InstrumentError, match=r"my bass: .* exists already; choose another"):
        library.save_instrument(make_instrument(name="my bass", level_db=3))
    friends = write(own / "friend.json", make_instrument(name="My bass").model_dump(mode="json"))
    saved = library.save_instrument(make_instrument(name="My bass", level_db=3), friends)
    assert (saved.path, library.read_instrument(friends).level_db) == (friends, 3)
    assert library.read_instrument(own / "my_bass.json").name == "My-Bass"


def test_two_instruments_of_one_name_are_reported_apart(own):
    library.save_instrument(make_instrument(name="Mine"))
    long = "M" * 60
    for name, file in (("Mine", "mine (copy)"), ("mine", "mine_3"), (long, "long"), (long, "longer")):
        write(own / f"{file}.json", make_instrument(name=name).model_dump(mode="json"))
    entries, problems = library.list_instruments(own)
    assert not problems
    names = {entry.name: entry.instrument.name for entry in entries}
    assert len({name.casefold() for name in names.values()}) == 5
    assert {names["mine (copy)"], names["mine"]} == {"Mine", "Mine 2"}
    assert names["longer"] == f"{'M' * 58} 2"


def test_a_shipped_instrument_is_neither_overwritten_nor_renamed_and_counts_before_ones_own(own):
    shipped = library.list_instruments(library.SHIPPED)[0][0]
    for replace in (None, shipped.path):
        with pytest.raises(library.InstrumentError, match="factory"):
            library.save_instrument(make_instrument(name=shipped.instrument.name), replace)
    with pytest.raises(library.InstrumentError, match="shipped with"):
        library.rename_instrument(shipped, "Other")
    assert not own.exists()
    write(own / shipped.path.name, json.loads(shipped.path.read_text(encoding="utf-8")))
    entries, (problem,) = library.list_instruments()
    assert [entry for entry in entries if entry.name == shipped.name] == [shipped]
    assert "exists already; rename the file" in problem


def test_renaming(own):
    first = library.save_instrument(make_instrument(name="First"))
    library.save_instrument(make_instrument(name="Taken"))
    for name, reported in (("taken", "exists already"), ("../up", "name"), ("", "name"), ("a\nb", "name")):
        with pytest.raises(library.InstrumentError, match=reported):
            library.rename_instrument(first, name)
    second = library.rename_instrument(first, "Second")
    assert sorted(path.name for path in own.iterdir()) == ["second.json", "taken.json"]
    spelt = library.rename_instrument(second, "SECOND")
    assert spelt.path == second.path and library.read_instrument(spelt.path).name == "SECOND"


def test_a_file_name_is_never_a_path():
    for name in ("..", "../../etc/passwd", "a/b", "a\\b", "C:x", ".hidden", "CON", "!!!", "名前"):
        stem = library.file_stem(name)
        assert stem and Path(stem).name == stem and stem.casefold() not in library.DEVICES
        assert all(c.isalnum() or c == "_" for c in stem)


def test_one_bad_file_hides_no_other(own):
    good = library.save_instrument(make_instrument(name="Good"))
    text, facts = good.path.read_text(), json.loads(good.path.read_text())
    (own / "folder.json").mkdir()
    (own / ".hidden.json").write_text("{")
    too_high = "pluck.position: must be less than or equal to 0.98, found 3"
    bad: dict[str, tuple[object, str]] = {  # file -> facts, text or bytes, and words of the report
        "newer": ({**facts, "version": 2}, "version: made by a newer version"),
        "colour": ({**facts, "colour": 1}, "colour"),
        "high": ({**facts, "pluck": {"position": 3}}, too_high),
        "long": ({**facts, "author": "x" * 5000}, "author"),
        "big": (b" " * (2**20 + 1), "larger than"),
        "deep": ("[" * 100_000, ""),
        "number": (text.replace("440.0", "9" * 5000), ""),
        "nan": (text.replace("440.0", "NaN"), "tuning.a4_hz"),
        "bytes": (b"\xff\xfe{}", ""),
        "folder": (None, ""),
    }
    for name, (content, _) in bad.items():
        if isinstance(content, str | bytes):
            (own / f"{name}.json").write_bytes(content.encode() if isinstance(content, str) else content)
        elif content:
            write(own / f"{name}.json", content)
    if hasattr(os, "mkfifo"):
        os.mkfifo(own / "pipe.json")
        bad["pipe"] = (None, "")
    entries, problems = library.list_instruments(own)
    assert entries == [good] and all(each.isprintable() and len(each) <= 500 for each in problems)
    reported = {Path(each.split(".json: ")[0]).name: each for each in problems}
    assert set(reported) == set(bad) and all(words in reported[name] for name, (_, words) in bad.items())


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
def test_faults_are_named_in_plain_words(own, field, value, words):
    write(own / "a.json", make_instrument(name="One").model_dump(mode="json") | {field: value})
    with pytest.raises(library.InstrumentError, match=f"a.json: {words}; mend this field"):
        library.read_instrument(own / "a.json")
