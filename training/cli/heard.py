"""evaluate --heard: how true presets sound, in words, and the table (`heard.csv`) from which the browser reads it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from training.cli.console import print_json, print_table, progress, say

if TYPE_CHECKING:
    from training.heard_file import Heard

COLUMNS = ("preset", "heard", "spectra dB", "level dB", "rise dB", "cents", "second cents", "runs away s", "hum dB")


def show_heard(files: Iterable[Path], write: bool, json: bool) -> None:
    """Compare the sound of presets with the truth and print the differences, the truest preset first.

    Presets that cannot be used are reported and left out.

    Args:
        write: add the results to the table beside each preset.
    """
    from engine.presets import PresetError
    from engine.schema import write as plain
    from training.heard_words import heard_word

    rows = []
    files = list(files)
    with progress("listen") as report:
        for number, path in enumerate(files):
            try:
                rows.append(
                    measure(path, write, lambda share, number=number: report((number + share) / len(files)))  # type: ignore[misc]
                )
            except (PresetError, ValueError) as error:
                say(str(error))
    rows.sort(key=lambda row: row.distance_db)
    if json:
        print_json([{**plain(row), "heard": heard_word(row)} for row in rows])
        return
    print_table(
        COLUMNS,
        [
            [
                row.name,
                heard_word(row),
                *(None if v is None else round(v, 2) + 0.0 for v in _figures(row)),
            ]
            for row in rows
        ],
    )


def measure(path: Path, write: bool, report: Callable[[float], None] = lambda share: None) -> Heard:
    """Compare the sound of a preset with the truth.

    Args:
        write: add the result to the table in the preset's folder.

    Raises:
        PresetError, ValueError: the file cannot be used, or its model cannot start from a displaced string at rest.
        OSError: the table cannot be written.
    """
    from engine.presets import load_preset
    from training.heard import listen_to
    from training.heard_file import add_heard

    row = listen_to(load_preset(path), report)
    if write:
        add_heard(path.parent, [row])
    return row


def _figures(row: Heard) -> tuple[float | None, ...]:
    return (
        row.distance_db,
        row.level_db,
        row.rise_db,
        row.pitch_cents,
        row.split_cents,
        row.runs_away_s,
        row.hum_db,
    )
