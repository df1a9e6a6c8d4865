"""Slots hold what their tags in the layouts say: whole numbers (W) or real ones (R)."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from engine import kernels, voices
from engine.kernels import constants, layout

SOURCES = {"at": layout, "of": constants}
TAGS = {
    f"{short}.{slot}": kind
    for short, module in SOURCES.items()
    for slot, kind in re.findall(
        r"^([A-Z0-9_]+) = .*# ([WR])\b", Path(module.__file__).read_text(encoding="utf-8"), re.M
    )
}
# what arrays of whole numbers are called, or are made by
WHOLE = re.compile(r"counts|befores|whole|sizes|int64|players|tables|mixers|wishes|^notes?$")


def named(index: ast.AST) -> Iterator[str]:
    """The slots of an index, without those of an array within it, and without a slice's end."""
    if isinstance(index, ast.Attribute):
        yield ast.unparse(index)
    elif isinstance(index, ast.Slice):
        yield from named(index.lower) if index.lower is not None else ()
    elif not isinstance(index, ast.Subscript):
        for part in ast.iter_child_nodes(index):
            yield from named(part)


def uses(function: ast.FunctionDef) -> Iterator[tuple[str, str]]:
    """Every slot that a function reads or writes by its name, and as what."""
    assigned = [node for node in ast.walk(function) if isinstance(node, ast.Assign)]
    single = [node for node in assigned if not isinstance(node.value, ast.Tuple)]
    made = {ast.unparse(t) for node in single if "int64" in ast.unparse(node.value) for t in node.targets}
    for node in ast.walk(function):
        if not isinstance(node, ast.Subscript):
            continue
        array = ast.unparse(node.value)
        for slot in named(node.slice):
            yield slot, "W" if array in made or WHOLE.search(array) else "R"


def test_every_slot_is_used_as_its_tag_says() -> None:
    found = {}
    for package in (kernels, voices):
        for file in sorted(Path(package.__path__[0]).glob("*.py")):
            for function in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
                for slot, kind in uses(function) if isinstance(function, ast.FunctionDef) else ():
                    if slot in TAGS:
                        found[slot, kind] = f"{file.name}: {slot} is tagged {TAGS[slot]} and used as {kind}"
    assert len(found) > 80
    assert [words for (slot, kind), words in found.items() if TAGS[slot] != kind] == []
