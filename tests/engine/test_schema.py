"""Plain data to dataclasses and back, and what is refused."""

from dataclasses import dataclass, field
from typing import Literal

import pytest

from engine.schema import SchemaError, read, write


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
    assert read(Outer, {"name": "x"}, "here") == Outer("x")


def test_a_whole_number_serves_as_a_float() -> None:
    assert read(Outer, {"name": "x", "share": 1}, "here").share == 1.0


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ([], "here: expected a table of fields, found list"),
        ({}, "here: field 'name' is missing"),
        ({"name": "x", "wide": 1}, "here: unknown field 'wide'; known are name"),
        ({"name": 3}, "here.name: expected str, found int 3"),
        ({"name": "x", "kind": "c"}, "here.kind: 'c' is not one of 'a', 'b'"),
        ({"name": "x", "share": True}, "here.share: expected float, found bool"),
        ({"name": "x", "share": float("nan")}, "here.share: must be a finite number"),
        ({"name": "x", "share": 2.0}, "here: share must be at most 1"),
        ({"name": "x", "on": 1}, "here.on: expected bool, found int"),
        ({"name": "x", "sizes": [1, "2"]}, r"here.sizes\[1\]: expected int, found str"),
        ({"name": "x", "sizes": 4}, "here.sizes: expected a list"),
        ({"name": "x", "pair": [1.0]}, "here.pair: expected 2 entries, found 1"),
        ({"name": "x", "inner": {"size": 1.5}}, "here.inner.size: expected int, found float"),
    ],
)
def test_what_does_not_fit_is_named(data: object, message: str) -> None:
    with pytest.raises(SchemaError, match=message):
        read(Outer, data, "here")
