"""Command `plugin`: instruments as a native plug-in for a DAW."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import typer

from engine.plain_text import one_line
from training.cli.console import Failure, ProgressReport, progress, say

ALL = "all"
BANK = "Learned Strings"
LONGEST_BANK_NAME = 60  # characters, as of an instrument's


def plugin(
    instruments: Annotated[
        list[str],
        typer.Argument(metavar="INSTRUMENT...", help="Names or paths of files; all: every factory instrument."),
    ],
    form: Annotated[
        Literal["clap", "vst3", "lv2", "all"], typer.Option("--format", help="The kind of plug-in.")
    ] = "clap",
    target: Annotated[
        Literal["this", "linux-x64", "linux-arm64", "windows-x64", "macos-x64", "macos-arm64", "all"],
        typer.Option("--for", help="The system that it is for."),
    ] = "this",
    out: Annotated[Path | None, typer.Option("--out", "-o", metavar="FOLDER", help="Default: this folder.")] = None,
    install: Annotated[bool, typer.Option("--install", help="Put it where this user's hosts look for it.")] = False,
    replace: Annotated[
        bool, typer.Option("--replace", help="Replace a plug-in that holds other instruments, too.")
    ] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Build nothing; print sizes.")] = False,
) -> None:
    """Build a plug-in that plays instruments in a DAW, without Python inside.

    Several instruments make one bank, named by them. The first build takes about a minute, later ones seconds. It
    needs the extra learned-strings[plugin].
    """
    from app.export.plugin.build import build_plugin, plugin_path
    from app.export.plugin.formats import FORMATS, TARGETS, install_folder, this_target
    from app.export.plugin.identity import check_kept
    from app.export.plugin.image import image_of
    from app.instruments.library import SHIPPED, find_instrument, list_instruments
    from engine.kernels import cache
    from training.cli.arguments import open_preset

    if install and (out is not None or target != "this"):
        raise typer.BadParameter("leave out --out and --for: --install puts the plug-in of this system in its place")
    try:
        if instruments == [ALL]:
            chosen = [entry.instrument for entry in list_instruments(SHIPPED)[0]]
        else:
            chosen = [find_instrument(name).instrument for name in instruments]
        images = []
        for instrument in chosen:
            images.append(image_of(instrument, open_preset(instrument.preset)))
            if images[-1].left_out:
                say(f"note: {instrument.name}: macros do not move {', '.join(images[-1].left_out)} in the plug-in")
        if dry_run:
            for image in images:  # beside the code, a third of a megabyte in every plug-in
                in_a_bank_mb = len(image.content) / 1e6
                print(f"{one_line(image.name)}: {image.bytes / 1e6:.2f} MB, {in_a_bank_mb:.2f} MB in a bank")
            return
        cache_folder = cache.folder() or Path(tempfile.gettempdir())
        targets = tuple(TARGETS) if target == ALL else (this_target() if target == "this" else target,)
        ids = {image.id for image in images}
        name = BANK if instruments == [ALL] else _bank_name([instrument.name for instrument in chosen])
        outputs = list[tuple[str, str, Path]]()
        for system in targets:
            for kind in FORMATS if form == ALL else (form,):
                folder = (
                    install_folder(kind, system) if install else (out or Path()) / (system if target == ALL else "")
                )
                outputs.append((kind, system, plugin_path(folder / name, kind)))
        if not replace:
            for _, _, path in outputs:  # all before the first is written
                check_kept(path, ids)
        for kind, system, path in outputs:
            began_s, replaces = time.monotonic(), path.exists()
            with progress(path.name) as report:
                advanced = partial(_advance, report)
                build_plugin(images, kind, system, path, cache_folder, advanced, replace=replace)
            done = f"{_size(path) / 1e6:.1f} MB, {time.monotonic() - began_s:.1f} s"
            print(f"{one_line(str(path))}: {done}{', replaces the one before' if replaces else ''}")
    except (ValueError, OSError) as error:
        raise Failure(str(error)) from error


def _bank_name(names: Sequence[str]) -> str:
    """The name of the file, by what it holds; where two banks have one name, the second is refused."""
    whole = " + ".join(names)
    return whole if len(names) == 1 or len(whole) <= LONGEST_BANK_NAME else f"{names[0]} + {len(names) - 1} others"


def _advance(report: ProgressReport, step: str, share: float) -> None:
    report(share, step)


def _size(path: Path) -> int:
    return sum(file.stat().st_size for file in path.rglob("*")) if path.is_dir() else path.stat().st_size
