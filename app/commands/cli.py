"""The command line: `learned-strings` opens the app, with files where some are named; commands have no window.

Exit status: 0 on success, 2 on bad usage, 130 when interrupted, 1 on any other failure. One line on standard error
explains it, after its traceback where the environment variable LEARNED_STRINGS_DEBUG is set.
"""

from __future__ import annotations

import errno
import os
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from app.commands import drums, info, learn, listing, motion, play, plugin, render, sampled
from app.shared.thread_priority import wait_asleep
from engine.whole_file import explain
from training.cli import evaluation, family, sweep, tables, training
from training.cli.console import say, use_any_output

DEBUG_VARIABLE = "LEARNED_STRINGS_DEBUG"
NAME = "learned-strings"

cli = typer.Typer(
    name=NAME,
    invoke_without_command=True,
    add_completion=False,
    rich_markup_mode=None,  # plain text: quick to start, and a message stays on its line
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@cli.callback()
def start(
    context: typer.Context, version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False
) -> None:
    """Play learned strings, compare them with the physics, and export them as WAV or FLAC.

    Without a command, the app opens; files that are named instead open in it, as learned-strings song.mid take.wav.
    Every command has its own --help.
    """
    if context.invoked_subcommand is not None:
        return
    if version:
        from app.shared.version import program_version

        print(program_version())
        return
    from app.window.main import run

    raise typer.Exit(run())


for command in (
    listing.presets,
    listing.models,
    listing.instruments,
    motion.simulate,
    motion.predict,
    render.render,
    learn.learn,
    play.play,
    sampled.sampled,
    plugin.plugin,
    info.info,
    motion.compare,
    training.train,
    sweep.sweep,
    evaluation.evaluate,
    tables.table,
):
    cli.command()(command)
cli.add_typer(sweep.results, name="results")
cli.add_typer(family.family, name="family")
cli.add_typer(drums.drums, name="drums")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command line (default: the process's own) and return the exit status."""
    return carry_out(cli, arguments, NAME)


def carry_out(commands: typer.Typer, arguments: Sequence[str] | None, name: str) -> int:
    """Run a command line of some commands; failures are printed in one line. Return the exit status."""
    wait_asleep()
    use_any_output()
    words = list(sys.argv[1:] if arguments is None else arguments)
    try:
        if commands is cli and words and is_file_name(words[0]):
            return open_files(words)
        typer.main.get_command(commands).main(words, prog_name=name)
    except SystemExit as exit:
        return exit.code if isinstance(exit.code, int) else 0 if exit.code is None else 1
    except Exception as error:
        if os.environ.get(DEBUG_VARIABLE):
            traceback.print_exc()
        say(describe(error))
        return 1
    return 0


def is_file_name(word: str) -> bool:
    """Return True if a word has a folder or an ending, as no command and no option has."""
    separators = {os.sep, os.altsep or os.sep}
    return not word.startswith("-") and bool(Path(word).suffix or separators & set(word))


def open_files(words: Sequence[str]) -> int:
    """Open the app with files, as if they were dropped on its window. Return its exit status, or 2 for no file."""
    files = [Path(word).absolute() for word in words]
    for word, file in zip(words, files, strict=True):
        if not file.is_file():
            say(f"{word}: no such file; check the name")
            return 2
    from app.window.main import run

    return run(files=files)


def describe(error: Exception) -> str:
    """A failure in words, meant for one line: what failed, where, and the remedy."""
    if isinstance(error, ImportError) and error.name:
        return f"this needs {error.name}, which cannot be imported ({error}); install it, or use another command"
    if isinstance(error, OSError):
        if error.filename and error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS):
            return explain(Path(os.fsdecode(error.filename)), error)
        if error.errno is None and str(error):  # raised by this program, with its own message
            return str(error)
        place = f"{error.filename}: " if error.filename else ""
        return f"{place}{error.strerror or error}; check the path, its permissions and the free space"
    if isinstance(error, MemoryError):
        return "not enough memory; ask for less at once"
    text = str(error)
    if text and not isinstance(error, KeyError | IndexError | AttributeError | TypeError | AssertionError):
        return text
    return f"internal error: {type(error).__name__} {text}; set {DEBUG_VARIABLE}=1 to see where, and report it"


if __name__ == "__main__":
    sys.exit(main())
