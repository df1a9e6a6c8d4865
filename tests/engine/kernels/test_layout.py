"""Slots hold what their tags in `layout.py` say: whole numbers (W) or real ones (R)."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from engine import kernels, voices
from engine.kernels import layout

TAGS = dict(re.findall(r"^([A-Z0-9_]+) = .*# ([WR])\b", Path(layout.__file__).read_text(encoding="utf-8"), re.M))
WHOLE = re.compile(r"counts|befores|whole|sizes|int64")  # what arrays of whole numbers are called, or are made by


def uses(function: ast.FunctionDef) -> Iterator[tuple[str, str]]:
    """Every slot that a function reads or writes by its name, and as what."""
    assigned = [node for node in ast.walk(function) if isinstance(node, ast.Assign)]
    single = [node for node in assigned if not isinstance(node.value, ast.Tuple)]
    made = {ast.unparse(t) for node in single if "int64" in ast.unparse(node.value) for t in node.targets}
    for node in ast.walk(function):
        if isinstance(node, ast.Subscript) and re.fullmatch(r"at\.[A-Z0-9_]+", slot := ast.unparse(node.slice)):
            array = ast.unparse(node.value)
            yield slot.removeprefix("at."), "W" if array in made or WHOLE.search(array) else "R"


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
