"""abx show: prints the record of a listening test."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

abx = typer.Typer(no_args_is_help=True, help="Records of listening tests.", rich_markup_mode=None)


@abx.callback()
def group() -> None:
    """Records of listening tests."""


@abx.command()
def show(file: Annotated[Path, typer.Argument(metavar="FILE", help="A record that the app has saved.")]) -> None:
    """Check the record of a listening test and print it as text."""
    from app.analysis.abx.record import load_record
    from app.analysis.abx.text import as_text
    from engine.plain_text import printable

    print(printable(as_text(load_record(file))), end="")
