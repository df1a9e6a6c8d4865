"""family: one model of many strings, trained and measured."""

from __future__ import annotations

from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.commands.arguments import Cache, Json, PresetName, open_preset
from app.commands.console import Failure, number, print_json, print_table, progress

if TYPE_CHECKING:
    from collections.abc import Sequence

    from app.commands.console import Report
    from training.family.errors import StringError

family = typer.Typer(help="One model of many strings.", no_args_is_help=True)
DESCRIBED = ("geometric mean", "worst", "share above 1e-2", "processor s a second", "worst at")
RISES = (0.0, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0)
MAP_RISES = (0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.8)
MAP_INHARMONICITIES = (2e-6, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3)  # the first and the last range are beyond the family
Strings = Annotated[int, typer.Option(min=1, max=10_000, help="Held-out strings of each column.")]
Rate = Annotated[int, typer.Option(min=1_000, max=192_000, metavar="HZ", help="Sample rate.")]
Seed = Annotated[int, typer.Option(min=0, help="Of the strings.")]


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
    strings: Strings = 200,
    tenth: Annotated[int, typer.Option(min=0, max=1_000, help="Of these, so many for ten seconds.")] = 0,
    baselines: Annotated[bool, typer.Option("--baselines", help="What knows the physics alone, too.")] = False,
    runs: Annotated[Path | None, typer.Option(help="And the baselines that `family baseline` trained there.")] = None,
    error_map: Annotated[
        bool, typer.Option("--map", help="And errors by rise of tension and inharmonicity.")
    ] = False,
    picture: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Errors by rise and inharmonicity, a dot each string: .png, .svg or .pdf."),
    ] = None,
    rate: Rate = 48_000,
    seed: Seed = 0,
    json: Json = False,
) -> None:
    """Errors on strings that no training has seen, inside the family and beyond it."""
    import torch

    from training.family.errors import Player, by_cell, by_rise, knowing_physics, measure, player
    from training.family.strings import COLUMNS

    torch.set_num_threads(1)
    if picture is not None:
        from training.figures.style import check_format

        check_format(picture)
    loaded = open_preset(preset)
    if loaded.info.family is None:
        raise Failure(f"{loaded.path}: learned one string; give a preset of many, as studio_any_string")
    players: dict[str, Player] = {loaded.name: player(loaded.model)}
    players |= knowing_physics() if baselines else {}
    players |= _trained(runs) if runs else {}
    found: dict[str, Any] = {}
    own: list[Any] = []  # errors of the preset, both columns
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
            of_preset = errors[loaded.name].strings
            own += of_preset
            of_column[loaded.name]["by_rise"] = [
                {"from": low, "to": high, "strings": len(part.strings), **_facts(part)}
                for low, high, part in by_rise(of_preset, RISES)
            ]
            if tenth:
                alone = {loaded.name: players[loaded.name]}
                told = partial(_report, report, place / 2 + 0.2, 0.3)
                last = measure(alone, column, "test", tenth, rate, (9.0, 10.0), seed=seed, report=told)[loaded.name]
                of_column[loaded.name]["tenth_second"] = _tenth_second(of_preset[:tenth], last.strings)
            found[column] = of_column
    cells = [
        {"rise": rises, "inharmonicity": edges, "strings": len(part.strings), **_facts(part)}
        for rises, edges, part in (by_cell(own, MAP_RISES, MAP_INHARMONICITIES) if error_map else ())
    ]
    if picture is not None:
        from training.figures.family_map import family_map
        from training.figures.style import save_figure

        save_figure(family_map(own, loaded.name), picture)
    if json:
        told_map = {"map": cells} if error_map else {}
        print_json({"preset": loaded.name, "strings": strings, "rate_hz": rate, "seed": seed, **found, **told_map})
        return
    for column_name, of_column in found.items():
        _print_column(column_name, of_column, strings, rate)
        parts = of_column[loaded.name]["by_rise"]
        rows = [
            [f"{p['from']:g} … {p['to']:g}", p["strings"], number(p["geometric_mean"]), number(p["worst"])]
            for p in parts
        ]
        print_table(("rise of tension", "strings", "geometric mean", "worst"), rows)
        if tenth:
            last = of_column[loaded.name]["tenth_second"]
            print(
                f"tenth second, {last['strings']} of {tenth} strings still sound: "
                f"{number(last.get('geometric_mean'))}, worst {number(last.get('worst'))}; "
                f"{number(last.get('over_first'))} times their first"
            )
    if error_map:
        _print_map(cells)


@family.command()
def baseline(
    name: Annotated[str, typer.Argument(metavar="NAME", help="koopman_var or dmsp, made to take any string.")],
    minutes: Annotated[float, typer.Option(min=0.01, max=10_000, help="Of one core, for the training.")] = 40.0,
    train_strings: Annotated[
        int | None, typer.Option(min=1, max=100_000, help="To learn from; default those of studio_any_string.")
    ] = None,
    runs: Annotated[Path | None, typer.Option(help="Folder of runs: a stopped one goes on there.")] = None,
    strings: Strings = 40,
    rate: Rate = 48_000,
    seed: Seed = 0,
    json: Json = False,
) -> None:
    """Train a model by others on the family's strings, or go on, and measure it as `evaluate` does. No preset."""
    import torch

    from training.family.baselines import BASELINES, baseline_player
    from training.family.errors import measure
    from training.family.fit_baseline import checkpoint_file, fit_baseline
    from training.family.preset import read_configuration
    from training.family.strings import COLUMNS
    from training.run import default_runs

    torch.set_num_threads(1)
    if name not in BASELINES:
        raise typer.BadParameter(f"{name!r} is not one of {', '.join(BASELINES)}", param_hint="NAME")
    with progress(f"family baseline {name}") as report:
        model = fit_baseline(
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
    players, found = {name: baseline_player(model)}, {}
    with progress("family evaluate") as report:
        for place, column in enumerate(COLUMNS):
            told = partial(_report, report, place / 2, 0.5)
            errors = measure(players, column, "test", strings, rate, (0.0, 1.0), seed=seed, report=told)
            found[column] = {name: _facts(errors[name])}
    if json:
        print_json({"baseline": name, "minutes": minutes, "strings": strings, "rate_hz": rate, "seed": seed, **found})
        return
    for column_name, of_column in found.items():
        _print_column(column_name, of_column, strings, rate)


@family.command()
def shelf(preset: Annotated[str, typer.Argument(metavar="PRESET")] = "studio_any_string") -> None:
    """Write a preset for each string that is shipped, with what PRESET learned."""
    from engine.presets import SHIPPED
    from training.family.shelf import put_on_shelf

    for path in put_on_shelf(open_preset(preset), SHIPPED):
        print(path)


def _report(report: Report, start: float, length: float, share: float) -> None:
    report(start + length * share)


def _trained(runs: Path) -> dict[str, Any]:
    """Players of the baselines that were trained in a folder."""
    from training.family.baselines import BASELINES, baseline_player
    from training.family.fit_baseline import checkpoint_file, trained_baseline

    files = {name: checkpoint_file(runs, name) for name in BASELINES}
    found = {name: baseline_player(trained_baseline(file)) for name, file in files.items() if file.exists()}
    if not found:
        raise Failure(f"{runs}: no baseline was trained here; `family baseline NAME --runs {runs}` does")
    return {f"{name}, trained": play for name, play in found.items()}


def _print_column(column: str, of_column: dict[str, Any], strings: int, rate_hz: int) -> None:
    print(f"{column}, {strings} strings, first second at {rate_hz} Hz, rel. MSE over the whole string")
    figures = ("geometric_mean", "worst", "share_large", "processor_s")
    rows = [[who, *(number(f[name]) for name in figures), f["worst_at"]] for who, f in of_column.items()]
    print_table(("", *DESCRIBED), rows)


def _tenth_second(first: Sequence[StringError], tenth: Sequence[StringError]) -> dict[str, Any]:
    """Of those strings that still sound then."""
    from training.family.errors import FamilyErrors

    pairs = [(early, late) for early, late in zip(first, tenth, strict=True) if late.sounds]
    if not pairs:
        return {"strings": 0}
    early, late = (FamilyErrors(tuple(part)) for part in zip(*pairs, strict=True))
    return {"strings": len(pairs), **_facts(late), "over_first": late.geometric_mean / early.geometric_mean}


def _print_map(cells: list[dict[str, Any]]) -> None:
    print("both columns: geometric mean; worst (strings), by rise of tension and inharmonicity B")
    told = {
        (
            cell["rise"],
            cell["inharmonicity"],
        ): f"{cell['geometric_mean']:.1e}; {cell['worst']:.1e} ({cell['strings']})"
        for cell in cells
    }
    edges = list(pairwise(MAP_INHARMONICITIES))
    rows = [
        [f"{low:g} … {high:g}", *(told.get(((low, high), edge), "") for edge in edges)]
        for low, high in pairwise(MAP_RISES)
    ]
    print_table(("rise", *(f"B {low:g} … {high:g}" for low, high in edges)), rows)


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
