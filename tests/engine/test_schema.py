"""Plain data to dataclasses and back, and what is refused."""

from dataclasses import dataclass, field
from datetime import date
from pathlib import Path
from typing import Literal

import pytest

from engine.schema import SchemaError, parse_json, read, read_toml, write


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


def test_round_trip() -> None:
    value = Outer("x", "b", 0.25, False, (1, 2), (0.5, 1.5), Inner(9))
    assert read(Outer, write(value), "here") == value
    assert read(Outer, {"name": "x", "share": 1}, "here") == Outer("x", share=1.0)


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
        ({"name": "x", "sizes": 4}, "here.sizes: must be a list, found 4"),
        ({"name": "x", "pair": [1.0]}, "here.pair: field 1 is missing"),
        ({"name": "x", "inner": {"sizes": 1}}, "here.inner: unknown field 'sizes'; known are size"),
        ({"name": "x", "pair": [1.0, 2.0, 3.0]}, "here.pair: must have at most 2 items"),
        ({"name": "x", "share": 10**400}, "here.share: must be a number of at most 64 bits"),
        ({"name": "x", "sizes": [1] * 1001}, "here.sizes: has 1001 entries"),
        ({"name": "x", "sizes": [1, float("inf")]}, r"here.sizes\[1\]: must be a finite number"),
        ({"name": "x" * 10_001}, "here.name: has 10001 characters"),
        ({"name": date(2020, 1, 1)}, "here.name: must be a number or a text"),
        ({"name": "x", "inner": {"size": 1.5}}, "here.inner.size: must be a valid integer"),
    ],
)
def test_what_does_not_fit_is_named(data: object, message: str) -> None:
    with pytest.raises(SchemaError, match=message):
        read(Outer, data, "here")


def test_a_byte_order_mark_is_no_part_of_toml_and_a_field_that_json_gives_twice_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_bytes(b"\xef\xbb\xbflength_m = 0.65\r\n")  # as Windows' Notepad may write
    assert read_toml(tmp_path / "a.toml") == {"length_m": 0.65}
    assert parse_json('{"a": {"b": 1}, "b": 2}', "here") == {"a": {"b": 1}, "b": 2}
    with pytest.raises(SchemaError, match=r"here: not JSON that can be read \(field 'b' is given twice\)"):
        parse_json('{"a": {"b": 1, "c": 3, "b": 2}}', "here")
