"""Calls at the edges of what functions take: each row of `calls.txt` is refused by name, or has the value stated."""

from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

ROWS: list[tuple[list[str], str]] = []  # modules whose names a row may use, after lines that name values; the row
heading: list[str] = []
for line in Path(__file__).with_name("calls.txt").read_text(encoding="utf-8").splitlines():
    if " | " in line or " → " in line:
        ROWS.append((list(heading), line))
    elif line.startswith("["):
        heading = [line.strip("[]")]
    elif line and not line.startswith("#"):
        heading.append(line)


@pytest.mark.parametrize(("heading", "row"), ROWS, ids=[row for _, row in ROWS])
def test_a_call_is_refused_by_name_or_has_its_value(heading, row, tmp_path):
    modules, *named = heading
    names: dict[str, Any] = {}
    for module in modules.split():
        names |= vars(import_module(module))
    names |= {"folder": tmp_path, "approx": pytest.approx}
    for line in named:
        exec(line, names)
    call, refused, words = row.rpartition(" | ")
    if refused:
        with pytest.raises(Exception, match=words):
            eval(call, names)
    else:
        call, _, value = row.partition(" → ")
        assert eval(call, names) == eval(value, names)
