"""patches: the instruments that can be played."""

from __future__ import annotations

from training.cli.arguments import Json
from training.cli.console import print_json, print_table, say

FIELDS = ("name", "title", "category", "own", "description", "file")


def patches(json: Json = False) -> None:
    """List the patches, shipped and your own. Files that cannot be used are reported on standard error."""
    from app.patches.library import list_patches

    entries, problems = list_patches()
    for problem in problems:
        say(problem)
    found = [
        dict(
            zip(
                FIELDS,
                (e.name, e.patch.name, e.patch.category, e.own, e.patch.description, str(e.path)),
                strict=True,
            )
        )
        for e in entries
    ]
    if json:
        print_json(found)
    else:
        columns = ("name", "title", "category", "description")
        print_table(columns, [[each[column] for column in columns] for each in found])
