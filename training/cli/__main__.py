"""`python -m training.cli PLAN`: the command `sweep` alone, where no app is."""

import sys

import typer

from training.cli.console import Failure, say
from training.cli.sweep import sweep

commands = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
commands.command()(sweep)

if __name__ == "__main__":
    try:
        commands()
    except (Failure, OSError, ValueError) as error:
        say(str(error))
        sys.exit(1)
