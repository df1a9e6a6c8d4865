"""Errors of a model of many strings by rise of tension and inharmonicity: a dot each string."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from training.family.errors import StringError
from training.family.strings import FAMILY
from training.figures import style

LEAST_ERROR = 1e-13  # the true motions' own
RISES = (0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.8)


def family_map(errors: Sequence[StringError], name: str) -> Figure:
    """One figure; hard cases are drawn last.

    Args:
        name: of the model.
    """
    drawn = sorted(errors, key=lambda one: one.rel_mse)
    inside = FAMILY["inside"]
    with style.styled():
        figure = Figure(figsize=(9, 5.6), layout="constrained")
        axes = figure.subplots()
        dots = axes.scatter(
            [one.inharmonicity for one in drawn],
            [one.tension_rise for one in drawn],
            c=np.maximum([one.rel_mse for one in drawn], LEAST_ERROR),
            norm=LogNorm(LEAST_ERROR, 1e-1, clip=True),
            cmap="viridis",
            s=34,
            linewidths=0,
        )
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_yticks(RISES, [f"{rise:g}" for rise in RISES])
        axes.minorticks_off()
        for edge in inside.inharmonicity[0]:
            axes.axvline(edge, color=style.MARKED, linewidth=1, linestyle="--")
        axes.axhline(inside.tension_rise[1], color=style.MARKED, linewidth=1, linestyle="--")
        axes.set_xlabel("inharmonicity B")
        axes.set_ylabel("relative rise of tension at the pluck")
        figure.colorbar(dots, ax=axes, label="relative MSE, first second")
        figure.suptitle(f"{name}: {len(drawn)} strings that no training has seen; dashed: the trained family")
    return figure
