"""What modules take from each other, types too, runs in no circle; contracts in pyproject.toml say which way."""

import re
from graphlib import TopologicalSorter
from importlib.resources import files

import grimp


def test_imports_make_no_circle():
    imports = grimp.build_graph("engine", "training", "app", "bench", cache_dir=None)
    taken = {module: imports.find_modules_directly_imported_by(module) for module in imports.modules}
    TopologicalSorter(taken).prepare()  # raises CycleError, which names a circle


def test_headers_of_plugins_make_no_circle():
    """A source and its header are one module."""
    taken: dict[str, set[str]] = {}
    for file in files("app.export.plugin.shell").iterdir():
        name = file.name.partition(".")[0]
        taken.setdefault(name, set()).update(re.findall(r'#include "(\w+)\.h"', file.read_text()))
    TopologicalSorter({name: others - {name} for name, others in taken.items()}).prepare()
