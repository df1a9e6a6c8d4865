"""Draw `family-errors.png`: `PYTHONPATH=. .venv/bin/python docs/images/family_errors.py` (minutes of one core).

Distributions of the error of `studio_any_string` by rise of tension, inside and beyond the trained family.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import style
import torch
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from engine.presets import find_preset, load_preset
from training.family.errors import StringError, measure, player
from training.family.strings import COLUMNS

RISES = (0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.8)
WIDTH = 0.36
PRESET, STRINGS, RATE_HZ = "studio_any_string", 200, 48_000


def family_errors(errors: Mapping[str, Sequence[StringError]], name: str) -> Figure:
    """Box plots of the relative MSE per class of tension rise; whiskers span all strings.

    Args:
        errors: by column of the family ("inside", "beyond").
        name: of the model.
    """
    classes = list(pairwise(RISES))
    with style.styled():
        figure = Figure(figsize=(9, 4.4), layout="constrained")
        axes = figure.subplots()
        for column, found in enumerate(errors.values()):
            grouped = [[one.rel_mse for one in found if low <= one.tension_rise < high] for low, high in classes]
            places = [i + (column - 0.5) * WIDTH for i, group in enumerate(grouped) if group]
            boxes = axes.boxplot(
                [group for group in grouped if group],
                positions=places,
                widths=WIDTH * 0.9,
                whis=(0, 100),
                patch_artist=True,
                manage_ticks=False,
                medianprops={"color": "black"},
            )
            for box in boxes["boxes"]:
                box.set_facecolor(style.COLOURS[column])
        axes.set_yscale("log")
        axes.set_xticks(range(len(classes)), [f"{low:g} – {high:g}" for low, high in classes])
        axes.set_xlabel("relative rise of tension at the pluck")
        axes.set_ylabel("relative MSE, first second")
        handles = [Patch(color=style.COLOURS[i], label=f"{label} the family") for i, label in enumerate(errors)]
        axes.legend(handles=handles, loc="upper left")
        total = sum(map(len, errors.values()))
        figure.suptitle(f"{name}: {total} strings outside its training data (box: quartiles, whiskers: all)")
    return figure


def main() -> None:
    torch.set_num_threads(1)
    play = {PRESET: player(load_preset(find_preset(PRESET)).model)}
    found = {c: measure(play, c, STRINGS, RATE_HZ)[PRESET].strings for c in COLUMNS}
    style.save_figure(family_errors(found, PRESET), Path(__file__).with_name("family-errors.png"))


if __name__ == "__main__":
    main()
