"""family: one model of many strings, trained and measured."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.commands.arguments import Cache, Json, PresetName, open_preset
from app.commands.console import Failure, number, print_json, print_table, progress

if TYPE_CHECKING:
    from app.commands.console import Report

family = typer.Typer(help="One model of many strings.", no_args_is_help=True)
DESCRIBED = ("geometric mean", "worst", "share above 1e-2", "processor s a second", "worst at")
RISES = (0.0, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0)


@family.command()
def train(
    config: Annotated[
        Path | None, typer.Argument(metavar="CONFIG", help="A .toml file; default that of studio_any_string.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option(help="The preset to write; default presets/CONFIG.safetensors.")
    ] = None,
    cache: Cache = None,
) -> None:
    """Learn from the motions of many strings, and write the preset."""
    import torch

    from engine.presets import SHIPPED
    from training.family.preset import CONFIGURATION, read_configuration, train_preset

    torch.set_num_threads(1)
    path = config or CONFIGURATION
    configuration = read_configuration(path)
    file = output or SHIPPED / f"{path.stem}.safetensors"
    with progress("family train") as report:
        info = train_preset(
            configuration,
            file,
            cache=cache,
            made=lambda share: report(0.5 * share, "true motions"),
            report=lambda p: report(
                0.5 + 0.5 * p.step / p.steps, f"step {p.step}, validation {p.validation:.3g}", p.left_s
            ),
        )
    print(
        f"{file}: rel. MSE {number(info.rel_mse)}, rel. MAE {number(info.rel_mae)} on validation; "
        f"{number(info.test_rel_mse)}, {number(info.test_rel_mae)} on test"
    )


@family.command()
def evaluate(
    preset: PresetName,
    strings: Annotated[int, typer.Option(min=1, max=10_000, help="Held-out strings of each column.")] = 200,
    tenth: Annotated[int, typer.Option(min=0, max=1_000, help="Of these, so many for ten seconds.")] = 0,
    baselines: Annotated[bool, typer.Option("--baselines", help="What knows the physics alone, too.")] = False,
    rate: Annotated[int, typer.Option(min=1_000, max=192_000, metavar="HZ", help="Sample rate.")] = 48_000,
    seed: Annotated[int, typer.Option(min=0, help="Of the strings.")] = 0,
    json: Json = False,
) -> None:
    """Errors on strings that no training has seen, inside the family and beyond it."""
    import torch

    from training.family.errors import (
        Player,
        averaged_flow,
        averaging,
        by_rise,
        linear_string,
        measure,
        player,
        untrained,
    )
    from training.family.strings import COLUMNS

    torch.set_num_threads(1)
    loaded = open_preset(preset)
    if loaded.info.family is None:
        raise Failure(f"{loaded.path}: learned one string; give a preset of many, as studio_any_string")
    players: dict[str, Player] = {loaded.name: player(loaded.model)}
    if baselines:
        players |= {
            "kicks without corrections": untrained("kicks"),
            "backward error analysis (1/12)": untrained("series"),
            "slow flow, third order": averaged_flow,
            "averaging": averaging,
            "linear string": linear_string,
        }
    found: dict[str, Any] = {}
    with progress("family evaluate") as report:
        for place, column in enumerate(COLUMNS):
            errors = measure(
                players,
                column,
                "test",
                strings,
                rate,
                (0.0, 1.0),
                seed=seed,
                report=partial(_report, report, place / 2, 0.2 if tenth else 0.5),
            )
            of_column = {name: _facts(one) for name, one in errors.items()}
            of_column[loaded.name]["by_rise"] = [
                {"from": low, "to": high, "strings": len(part.strings), **_facts(part)}
                for low, high, part in by_rise(errors[loaded.name].strings, RISES)
            ]
            if tenth:
                own = {loaded.name: players[loaded.name]}
                told = partial(_report, report, place / 2 + 0.2, 0.3)
                last = measure(own, column, "test", tenth, rate, (9.0, 10.0), seed=seed, report=told)[loaded.name]
                first = errors[loaded.name].strings[:tenth]
                of_column[loaded.name]["tenth_second"] = _facts(last) | {
                    "over_first": last.geometric_mean / type(last)(tuple(first)).geometric_mean
                }
            found[column] = of_column
    if json:
        print_json({"preset": loaded.name, "strings": strings, "rate_hz": rate, "seed": seed, **found})
        return
    for column_name, of_column in found.items():
        print(f"{column_name}, {strings} strings, first second at {rate} Hz, rel. MSE over the whole string")
        figures = ("geometric_mean", "worst", "share_large", "processor_s")
        rows = [[who, *(number(f[name]) for name in figures), f["worst_at"]] for who, f in of_column.items()]
        print_table(("", *DESCRIBED), rows)
        parts = of_column[loaded.name]["by_rise"]
        rows = [
            [f"{p['from']:g} … {p['to']:g}", p["strings"], number(p["geometric_mean"]), number(p["worst"])]
            for p in parts
        ]
        print_table(("rise of tension", "strings", "geometric mean", "worst"), rows)
        if tenth:
            last = of_column[loaded.name]["tenth_second"]
            print(
                f"tenth second, {tenth} strings: {number(last['geometric_mean'])}, worst {number(last['worst'])}; "
                f"{last['over_first']:.3g} times the first"
            )


@family.command()
def shelf(preset: Annotated[str, typer.Argument(metavar="PRESET")] = "studio_any_string") -> None:
    """Write a preset for each string that is shipped, with what PRESET learned."""
    from engine.presets import SHIPPED
    from training.family.shelf import put_on_shelf

    for path in put_on_shelf(open_preset(preset), SHIPPED):
        print(path)


def _report(report: Report, start: float, length: float, share: float) -> None:
    report(start + length * share)


def _facts(errors: Any) -> dict[str, Any]:
    worst = errors.worst
    place = f"{worst.pitch_hz:.0f} Hz, B {worst.inharmonicity:.1e}, rise {worst.tension_rise:.2f}"
    return {
        "geometric_mean": errors.geometric_mean,
        "worst": worst.rel_mse,
        "share_large": errors.share_large,
        "processor_s": errors.processor_s,
        "worst_at": place,
    }
