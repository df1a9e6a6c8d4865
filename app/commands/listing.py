"""Commands `presets`, `models`, `instruments`: lists of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from engine.plain_text import name_text
from training.cli.arguments import Json
from training.cli.console import print_json, print_table, say

if TYPE_CHECKING:
    from collections.abc import Container, Iterator
    from pathlib import Path

    from app.instruments.instrument import Instrument
    from training.heard_file import Heard


def presets(json: Json = False) -> None:
    """List the presets, shipped and your own. Files that cannot be used are reported on standard error."""
    from engine.folders import usable_files
    from engine.presets import PresetError
    from training.heard_file import read_heard

    files = usable_files()
    records_by_digest: dict[str, Heard] = {}
    for folder in dict.fromkeys(path.parent for path in files):
        records, problems = read_heard(folder)
        records_by_digest |= records
        for problem in problems:
            say(problem)
    rows = []
    for path in files:
        try:
            rows.append(_facts(path, records_by_digest))
        except PresetError as error:
            say(str(error))
        except Exception as error:  # no fault of one file may keep the others from being listed
            say(f"{path}: cannot be used ({type(error).__name__} {error}); remove the file")
    _show(rows, json)


def models(json: Json = False) -> None:
    """List the models, with their parameters at the paper's sizes."""
    import torch

    from engine.models import MODELS, build_model
    from engine.models.base import count_parameters

    rows = []
    with torch.device("meta"):  # sizes without memory
        for name in MODELS:
            rows.append({"name": name, "parameters": count_parameters(build_model(name))})
    _show(rows, json)


def instruments(
    instrument: Annotated[
        str | None,
        typer.Argument(metavar="[INSTRUMENT]", help="List this one's parameters instead: a name or a file."),
    ] = None,
    json: Json = False,
) -> None:
    """List the instruments, factory and your own, or the parameters of one.

    Files that cannot be used are reported on standard error. Plug-ins and files name parameters by the same id.
    """
    from app.instruments.library import find_instrument, list_instruments

    if instrument is not None:
        _show(list(_parameters(find_instrument(instrument).instrument)), json)
        return
    entries, problems = list_instruments()
    for problem in problems:
        say(problem)
    rows = []
    for entry in entries:
        named = entry.instrument
        facts = {"name": entry.name, "title": named.name, "category": named.category, "own": entry.own}
        rows.append({**facts, "description": named.description, "file": str(entry.path)})
    _show(rows, json, but=("own", "file"))


def _parameters(instrument: Instrument) -> Iterator[dict[str, Any]]:
    """The table's rows: the parameters that an instrument has, with its own values."""
    from engine.parameters import OF_INSTRUMENTS

    for id, parameter in OF_INSTRUMENTS.items():
        if instrument.has(id):
            low, high = parameter.limits
            numbers = {"value": instrument.value(id), "lowest": low, "highest": high, "default": parameter.default}
            yield {"id": id, "name": parameter.name, "unit": parameter.unit, **numbers}


def _show(rows: list[dict[str, Any]], json: bool, but: Container[str] = ()) -> None:
    """Print facts as JSON, or as a table without the columns `but`."""
    if json:
        print_json(rows)
    elif rows:
        columns = [name for name in rows[0] if name not in but]
        print_table(columns, [[facts[name] for name in columns] for facts in rows])


def _facts(path: Path, records_by_digest: dict[str, Heard]) -> dict[str, Any]:
    """The row of a preset; `records_by_digest`: audible errors by the digest of the file. Raises PresetError."""
    from engine.presets import described_parameters, preset_digest, read_info
    from training.heard_words import heard_word

    info = read_info(path)
    return {
        "name": name_text(path.stem),
        "model": info.model,
        "string": info.string_kind,
        **{name: getattr(info, name) for name in ("initial", "rate_hz", "horizon_steps")},
        "parameters": described_parameters(path, info),
        **{name: getattr(info, name) for name in ("rel_mse", "rel_mae", "test_rel_mse", "test_rel_mae")},
        "heard": heard_word(records_by_digest.get(preset_digest(path))),
        "file": str(path),
    }
