"""Identifiers of instruments: one for each name, the same in every build, and short enough for every host."""

from __future__ import annotations

import re
import unicodedata
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.export.plugin.formats import PluginError
from app.export.plugin.identity import MOST_BYTES, check_kept, held_in, identifier, lost_with
from app.export.plugin.image import Image
from app.instruments.library import SHIPPED, list_instruments

PREFIX = "org.learned-strings."
# Names that fold to one another; those of the factory differ from the last two.
FOLDING = "My bass!|my bass-|My bass|my bass|MY BASS|My-bass|My  bass|My bass -|Bäss|ﬁddle|Fiddle"
MORE = "Straße|STRASSE|İstanbul|istanbul|Ⅷ|²|2|!!!|???|---|| |عود|عود!|\u202eعود|Twelve string guitar|Ukulele  low G"
LONG = ("古琴" * 18, "古琴" * 18 + "!", "é" * 60, "é" * 59 + "è", "🎸" * 300, "🎸" * 299, "a" * 300, "A" + "a" * 299)
NAMES = (*FOLDING.split("|"), *MORE.split("|"), *LONG, unicodedata.normalize("NFD", "Bäss"))


def is_valid(id: str) -> bool:
    """It fits the shell's field, and an IRI of LV2 in Turtle."""
    return len(id.encode()) <= MOST_BYTES and re.fullmatch(r"[^\x00-\x20<>\"{}|^`\\]+", id) is not None


def test_other_names_have_other_identifiers() -> None:
    names = {*NAMES, *(each.instrument.name for each in list_instruments(SHIPPED)[0])}
    assert len({identifier(name) for name in names}) == len(names)
    assert all(is_valid(identifier(name)) for name in names)


def respelled(name: str) -> st.SearchStrategy[str]:
    """Another spelling: of case, of normalisation, of marks between letters, or the words of its identifier."""
    own = identifier(name).removeprefix(PREFIX)
    words = own.replace("-", " ")
    forms = [unicodedata.normalize(form, name) for form in ("NFC", "NFD", "NFKC", "NFKD")]
    others = [name.lower(), name.upper(), name.title(), name.swapcase(), name.capitalize(), name + "!", own, words]
    marks = [re.sub(r"\W", mark, name) for mark in " -_.!"]
    return st.sampled_from([*forms, *others, *marks, words[:1].upper() + words[1:], f"{name} ", f" {name}"])


@given(st.text(max_size=300), st.data())
@settings(max_examples=100, deadline=None)
def test_a_random_name_and_its_other_spellings_differ(name: str, data: st.DataObject) -> None:
    names = {name, data.draw(respelled(name)), data.draw(st.text(max_size=300))}
    again = {data.draw(respelled(each)) for each in sorted(names)}
    ids = {each: identifier(each) for each in names | again}
    assert len(set(ids.values())) == len(ids)
    assert all(is_valid(id) for id in ids.values())


def test_factory_instruments_and_plain_names_keep_theirs() -> None:
    for entry in list_instruments(SHIPPED)[0]:
        name = entry.instrument.name
        assert identifier(name) == PREFIX + "".join(c if c.isalnum() else "-" for c in name.lower())
    for name, wanted in (("My bass", "my-bass"), ("Bäss 2", "bäss-2"), ("古琴", "古琴")):
        assert identifier(name) == PREFIX + wanted
    assert identifier("My bass!") == f"{PREFIX}my-bass--b3dcc31a205f"  # songs find it by this


def image(id: str) -> Image:
    return Image(id, "", b"", (), ())


def test_what_a_plug_in_holds_is_read_from_it(tmp_path: Path) -> None:
    ids = {identifier(name) for name in NAMES}
    file, bundle = tmp_path / "bank.clap", tmp_path / "bank.lv2"
    noise = bytes(range(256)) * 50
    file.write_bytes(noise.join([b"", *(id.encode().ljust(128, b"\0") for id in sorted(ids)), b""]))
    bundle.mkdir()
    (bundle / "manifest.ttl").write_text("\n".join(f"<urn:{id}> a lv2:Plugin ." for id in sorted(ids)), "utf-8")
    for path in (file, bundle):
        assert held_in(path) == ids
        assert lost_with(path, ids) == frozenset()
        check_kept(path, ids)
        with pytest.raises(PluginError, match=r"holds 2 other instruments, as .*--replace"):
            check_kept(path, sorted(ids)[2:])
    assert lost_with(tmp_path / "none", ids) == frozenset()


@pytest.mark.parametrize("form", ("file", "folder"))
def test_what_is_no_plug_in_is_never_replaced(tmp_path: Path, form: str) -> None:
    path = tmp_path / "mine.lv2"
    inside = path if form == "file" else path / "manifest.ttl"
    inside.parent.mkdir(exist_ok=True)
    inside.write_text("<urn:org.others> a lv2:Plugin .", encoding="utf-8")
    with pytest.raises(PluginError, match="no plug-in of this program"):
        lost_with(path, {identifier("Concert harp")})
