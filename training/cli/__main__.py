"""A command by itself, where no app is: `python -m training.cli PLAN` is `sweep`."""

import sys
from collections.abc import Callable
from typing import Any

import typer

from training.cli.console import Failure, say
from training.cli.sweep import sweep


def main(command: Callable[..., Any]) -> None:
    """Run one command with the words of this process; what it refuses is one line."""
    commands = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
    commands.command()(command)
    try:
        commands()
    except (Failure, OSError, ValueError) as error:
        say(str(error))
        sys.exit(1)


if __name__ == "__main__":
    main(sweep)
