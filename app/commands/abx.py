"""abx show: prints the result of a listening test."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

abx = typer.Typer(no_args_is_help=True, help="Results of listening tests.", rich_markup_mode=None)


@abx.callback()
def group() -> None:
    """Results of listening tests."""


@abx.command()
def show(file: Annotated[Path, typer.Argument(metavar="FILE", help="A result that the app has saved.")]) -> None:
    """Print the result of a listening test as text."""
    from app.analysis.abx.record import as_text, load_record
    from engine.plain_text import printable

    print(printable(as_text(load_record(file))), end="")
