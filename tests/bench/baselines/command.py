"""baseline: a model by others, trained and measured on the strings of the family."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from training.cli.arguments import Json
from training.cli.console import Shares, number, print_json, progress
from training.cli.family import Rate, Seed, Strings, facts_of, measured_errors, print_column


def baseline(
    name: Annotated[str, typer.Argument(metavar="NAME", help="koopman_var or dmsp, made to take any string.")],
    minutes: Annotated[float, typer.Option(min=0.01, max=10_000, help="Processor minutes of one core.")] = 40.0,
    train_strings: Annotated[
        int | None,
        typer.Option(min=1, max=100_000, help="Strings to learn from; default as studio_any_string."),
    ] = None,
    runs: Annotated[Path | None, typer.Option(help="Folder of runs: a stopped one continues there.")] = None,
    strings: Strings = 40,
    rate: Rate = 48_000,
    seed: Seed = 0,
    json: Json = False,
) -> None:
    """Train and measure a model by others on the same strings.

    A stopped training continues. It is measured as `family evaluate` does, and no preset is written.
    """
    import torch

    from tests.bench.baselines.fit import FRAMES, ROWS, checkpoint_file, fit_baseline
    from tests.bench.baselines.models import BASELINES, baseline_player
    from training.family.preset import read_configuration
    from training.run import default_runs

    torch.set_num_threads(1)
    if name not in BASELINES:
        raise typer.BadParameter(f"{name!r} is not one of {', '.join(BASELINES)}", param_hint="NAME")
    with progress(f"bench baseline {name}") as report:
        fitted = fit_baseline(
            name,
            read_configuration(),
            checkpoint_file(runs or default_runs(), name),
            minutes,
            strings=train_strings,
            made=lambda share: report(0.0, f"{share:.0%} of the true motions"),
            report=lambda p: report(
                p.share, f"step {p.steps}, train {p.train:.3g}, validation {p.validation:.3g}", p.left_s
            ),
        )
    with progress("bench baseline") as report:
        measured = measured_errors({name: baseline_player(fitted.model)}, strings, rate, seed, Shares(report, 2))
    found = {column: {name: facts_of(errors[name])} for column, errors in measured.items()}
    reported = {
        "parameters": sum(parameter.numel() for parameter in fitted.model.parameters()),
        "steps": fitted.steps,
        "train": fitted.train,
        "validation": fitted.validation,
    }
    if json:
        facts = {"baseline": name, "minutes": minutes, "strings": strings, "rate_hz": rate, "seed": seed}
        print_json({**facts, **reported, **found})
        return
    print(
        f"{name}: {reported['parameters']:,} numbers, {fitted.steps:,} steps of {ROWS} strings and {FRAMES} "
        f"frames; geometric mean {number(fitted.train)} in training, {number(fitted.validation)} in validation"
    )
    for column_name, of_column in found.items():
        print_column(column_name, of_column, strings, rate)
