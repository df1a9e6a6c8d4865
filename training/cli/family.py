"""family: one model of many strings, trained and measured."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from engine.bounds import LARGEST_SEED
from training.cli.arguments import Json, PresetName, open_preset
from training.cli.console import Failure, Shares, number, print_json, print_table, progress

if TYPE_CHECKING:
    from collections.abc import Sequence

    from engine.presets import Preset
    from training.family.errors import FamilyErrors, StringError

family = typer.Typer(help="Train and measure one model of many strings.", no_args_is_help=True)
FIGURES = ("geometric_mean", "worst", "share_large", "processor_s")
DESCRIBED = ("geometric mean", "worst", "share above 1e-2", "processor s a second", "worst at")
TENTH = 9  # the place of the tenth second among all, from 0
RISES = (0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.8)  # ΔT/T₀: edges of the ranges that are printed
Strings = Annotated[
    int, typer.Option(min=1, max=10_000, help="Held-out strings inside the family, and as many beyond.")
]
Rate = Annotated[int, typer.Option(min=1_000, max=192_000, metavar="HZ", help="Sample rate.")]
Seed = Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Seed of the strings that are drawn.")]


@family.command()
def train(
    config: Annotated[
        Path | None, typer.Argument(metavar="CONFIG", help="A .toml file; default that of studio_any_string.")
    ] = None,
    output: Annotated[
        Path | None, typer.Option(help="The preset to write; default CONFIG.safetensors in the folder of runs.")
    ] = None,
) -> None:
    """Learn from the motions of many strings, and write the preset."""
    import torch

    from training.family.preset import CONFIGURATION, read_configuration, train_preset
    from training.run import default_runs

    torch.set_num_threads(1)
    path = config or CONFIGURATION
    configuration = read_configuration(path)
    file = output or default_runs() / f"{path.stem}.safetensors"
    file.parent.mkdir(parents=True, exist_ok=True)
    with progress("family train") as report:
        info = train_preset(configuration, file, report=report)
    print(
        f"{file}: rel. MSE {number(info.rel_mse)}, rel. MAE {number(info.rel_mae)} on validation; "
        f"{number(info.test_rel_mse)}, {number(info.test_rel_mae)} on test"
    )


@family.command()
def evaluate(
    preset: PresetName,
    strings: Strings = 200,
    tenth: Annotated[
        int, typer.Option(min=0, max=1_000, help="Measure so many over ten seconds, too; drums of longer decays.")
    ] = 0,
    baselines: Annotated[
        bool, typer.Option("--baselines", help="Measure what knows the physics alone, too.")
    ] = False,
    runs: Annotated[
        Path | None, typer.Option(help="Folder of the errors on drums: a stopped measurement continues there.")
    ] = None,
    drums: Annotated[
        int,
        typer.Option(
            min=0, max=10_000, metavar="N", help="Measure on so many drums instead, which no model has seen."
        ),
    ] = 0,
    keep: Annotated[bool, typer.Option("--keep", help="Add the errors on drums to training/drums.csv.")] = False,
    rate: Rate = 48_000,
    seed: Seed = 0,
    json: Json = False,
) -> None:
    """Errors on held-out strings, or on drums.

    Strings are drawn inside the family and beyond it. Errors on drums are written to a table in `--runs`, or the
    folder of runs, after each drum: a stopped measurement continues.
    """
    import torch

    from training.family.errors import by_rise, knowing_physics, measure, player
    from training.family.motion import Player
    from training.family.strings import COLUMNS

    torch.set_num_threads(1)
    if drums:
        _evaluate_drums(preset, drums, tenth, runs, rate, seed, keep, json)
        return
    if tenth > strings:
        raise typer.BadParameter(f"is {tenth} of {strings} strings; give at most as many", param_hint="--tenth")
    loaded = _open_preset_of_many(preset)
    players: dict[str, Player] = {loaded.name: player(loaded.model)}
    if baselines:
        players |= knowing_physics()
    facts_by_column: dict[str, dict[str, Any]] = {}
    with progress("family evaluate") as report:
        shares = Shares(report, 2 * (1 + (tenth > 0)))
        for column in COLUMNS:
            errors = measure(players, column, strings, rate, seed=seed, report=shares.next())
            facts_by_column[column] = {name: _facts(one) for name, one in errors.items()}
            of_preset, facts = errors[loaded.name].strings, facts_by_column[column][loaded.name]
            facts["by_rise"] = [
                {"from": low, "to": high, "strings": len(part.strings), **_facts(part)}
                for (low, high), part in by_rise(of_preset, RISES)
            ]
            if tenth:
                alone, reported = {loaded.name: players[loaded.name]}, shares.next()
                last = measure(alone, column, tenth, rate, TENTH, seed=seed, report=reported)[loaded.name]
                facts["tenth_second"] = _tenth_second(of_preset[:tenth], last.strings)
    if json:
        print_json({"preset": loaded.name, "strings": strings, "rate_hz": rate, "seed": seed, **facts_by_column})
        return
    for column_name, of_column in facts_by_column.items():
        print(f"{column_name}, {strings} strings, first second at {rate} Hz, rel. MSE over the whole string")
        print_table(
            ("", *DESCRIBED),
            [[who, *(number(f[name]) for name in FIGURES), f["worst_at"]] for who, f in of_column.items()],
        )
        facts = of_column[loaded.name]
        rows = [
            [f"{p['from']:g} … {p['to']:g}", p["strings"], number(p["geometric_mean"]), number(p["worst"])]
            for p in facts["by_rise"]
        ]
        print_table(("rise of tension", "strings", "geometric mean", "worst"), rows)
        if tenth:
            last = facts["tenth_second"]
            print(
                f"tenth second, {last['strings']} of {tenth} strings still sound: "
                f"{number(last.get('geometric_mean'))}, worst {number(last.get('worst'))}; "
                f"{number(last.get('over_first'))} times their first"
            )


@family.command()
def shelf(preset: Annotated[str, typer.Argument(metavar="PRESET")] = "studio_any_string") -> None:
    """Write a preset of each shipped string with what PRESET learned."""
    from engine.presets import SHIPPED
    from training.family.shelf import put_on_shelf

    for path in put_on_shelf(open_preset(preset), SHIPPED):
        print(path)


def _evaluate_drums(
    preset: str, drums: int, tenth: int, runs: Path | None, rate_hz: int, seed: int, keep: bool, json: bool
) -> None:
    """Measure a preset and untrained players on drums, and print the errors; see `evaluate` for the options."""
    from dataclasses import asdict

    from training.family import drums as of_drums
    from training.family import motion
    from training.run import default_runs

    if tenth > drums:
        raise typer.BadParameter(f"is {tenth} of {drums} drums; give at most as many", param_hint="--tenth")
    loaded = _open_preset_of_many(preset)
    players: dict[str, motion.Player] = {
        loaded.name: motion.model_player(loaded.model),
        "backward error analysis (1/12)": motion.untrained_player("series"),
        "kicks without corrections": motion.untrained_player("kicks"),
        "linear drum": motion.linear_motion,
    }
    checkpoint = of_drums.checkpoint_file(runs or default_runs(), loaded.name, rate_hz, seed)
    with progress("family evaluate") as report:
        errors = of_drums.measure_drums(players, drums, tenth, rate_hz, seed, checkpoint, report)
    rows = [of_drums.summary(errors, name, rate_hz, seed) for name in players]
    if keep:
        of_drums.store(rows)
    if json:
        print_json({"drums": drums, "rate_hz": rate_hz, "seed": seed, "players": [asdict(row) for row in rows]})
        return
    print(f"{drums} drums of {rows[0].modes} modes below 4 kHz, first second at {rate_hz} Hz, over the whole surface")
    first = [(row.geometric_mean, row.worst, row.blows, row.pressed, row.processor_s) for row in rows]
    print_table(
        ("", "geometric mean", "worst", "blows", "pressed", "processor s a second", "worst at"),
        [[row.player, *map(number, figures), row.worst_at] for row, figures in zip(rows, first, strict=True)],
    )
    if tenth:
        late = [(row.tenth_geometric_mean, row.tenth_worst, row.tenth_first) for row in rows]
        still = f"tenth second, {rows[0].tenth_drums} of {tenth} drums of long decays still sound"
        print_table(
            (still, "geometric mean", "worst", "first"),
            [[row.player, *map(number, figures)] for row, figures in zip(rows, late, strict=True)],
        )


def _open_preset_of_many(name_or_path: str) -> Preset:
    """Load a preset of many strings. Raises Failure: it is of one."""
    loaded = open_preset(name_or_path)
    if loaded.info.family is None:
        raise Failure(f"{loaded.path}: learned one string; give a preset of many, as studio_any_string")
    return loaded


def _tenth_second(first: Sequence[StringError], tenth: Sequence[StringError]) -> dict[str, Any]:
    """The errors in the tenth second, of those strings that still sound then, by name.

    Args:
        first, tenth: the same strings in the first and in the tenth second.
    """
    from training.family.errors import FamilyErrors

    pairs = [(early, late) for early, late in zip(first, tenth, strict=True) if late.sounds]
    if not pairs:
        return {"strings": 0}
    early, late = (FamilyErrors(tuple(part)) for part in zip(*pairs, strict=True))
    return {"strings": len(pairs), **_facts(late), "over_first": late.geometric_mean / early.geometric_mean}


def _facts(errors: FamilyErrors) -> dict[str, Any]:
    """The main figures of many strings by name, see `FIGURES`, and the worst string in words."""
    worst = errors.worst
    return {
        "geometric_mean": errors.geometric_mean,
        "worst": worst.rel_mse,
        "share_large": errors.share_large,
        "processor_s": errors.processor_s,
        "worst_at": f"{worst.pitch_hz:.0f} Hz, B {worst.inharmonicity:.1e}, rise {worst.tension_rise:.2f}",
    }
