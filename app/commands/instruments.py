"""instruments: those that can be played."""

from __future__ import annotations

from training.cli.arguments import Json
from training.cli.console import print_json, print_table, say


def instruments(json: Json = False) -> None:
    """List the instruments, factory and your own. Files that cannot be used are reported on standard error."""
    from app.patches.library import list_patches

    entries, problems = list_patches()
    for problem in problems:
        say(problem)
    found = [
        {
            "name": entry.name,
            "title": entry.patch.name,
            "category": entry.patch.category,
            "own": entry.own,
            "description": entry.patch.description,
            "file": str(entry.path),
        }
        for entry in entries
    ]
    if json:
        print_json(found)
    else:
        columns = ("name", "title", "category", "description")
        print_table(columns, [[each[column] for column in columns] for each in found])
