"""bench solver, render, train, app, soak: what the program costs here."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer

from app.commands.arguments import Json
from app.commands.console import print_json, print_table, progress

if TYPE_CHECKING:
    from app.bench.machine import Machine

bench = typer.Typer(help="Measure speed on this machine: medians of repeats.", no_args_is_help=True)


@bench.command()
def solver(
    json: Json = False,
    batch: Annotated[int, typer.Option(min=1, max=1000, help="Trajectories at once.")] = 100,
    steps: Annotated[int, typer.Option(min=1, help="Samples of each trajectory.")] = 4000,
) -> None:
    """Cost and error of the fast solver against DOP853, on the worst case of the paper's data sets."""
    from app.bench.solver import measure

    with progress("bench solver") as report:
        found = measure(batch, steps, report)
    if json:
        protocol = [{**asdict(timing), "speed_up": timing.speed_up} for timing in found.protocol]
        print_json({**asdict(found), "protocol": protocol})
        return
    _print_machine(found.machine)
    columns = (
        "data",
        "rise",
        "sub-steps",
        "error",
        "fast s",
        "DOP853 s",
        "times faster",
        "loose",
        "error",
        "fast s",
    )
    rows = [
        (
            f"{t.initial} {t.rate_hz} Hz, {t.modes} modes",
            f"{t.tension_rise:.0%}",
            t.substeps,
            t.relative_l2,
            t.fast_s,
            t.dop853_s,
            round(t.speed_up),
            t.loose_substeps,
            t.loose_relative_l2,
            t.loose_fast_s,
        )
        for t in found.protocol
    ]
    print_table(columns, rows)
    for t in found.audio:
        left_out = f" without what is below {t.silence:g}, {t.relative_l2:.1g} off" if t.silence else ""
        print(
            f"{t.rate_hz} Hz, {t.modes} modes, {t.substeps} sub-steps, one thread: "
            f"real-time factor {t.real_time_factor:.3f}{left_out}"
        )


@bench.command()
def render(json: Json = False) -> None:
    """Real-time factor (below 1 is faster than it sounds) and first-block latency of every model, on one thread."""
    from app.bench.render import measure

    with progress("bench render") as report:
        found = measure(report)
    if json:
        print_json(asdict(found))
        return
    _print_machine(found.machine)
    columns = ("model", "rate Hz", "modes", "grid", "floor", "point", "floor", "first block ms", "worst ms")
    rows = [
        (
            t.model,
            t.rate_hz,
            t.modes,
            t.grid,
            t.grid_floor,
            t.point,
            t.point_floor,
            1000 * t.first_block_s,
            1000 * t.worst_first_block_s,
        )
        for t in found.models
    ]
    print_table(columns, rows)


@bench.command()
def train(json: Json = False) -> None:
    """Seconds of a train step of every model: 50 trajectories, 400 frames."""
    from app.bench.train import measure

    with progress("bench train") as report:
        found = measure(report)
    if json:
        print_json(asdict(found))
        return
    _print_machine(found.machine)
    print_table(
        ("model", "batch", "frames", "step s"), [(t.model, t.batch, t.frames, t.step_s) for t in found.models]
    )


@bench.command()
def app(
    json: Json = False,
    seconds: Annotated[float, typer.Option(min=0.1, help="How long the picture is watched.")] = 5.0,
    starts: Annotated[int, typer.Option(min=1, help="Starts that are timed, after one that is not.")] = 3,
) -> None:
    """The window: its start, how soon a pluck sounds, how smoothly the picture moves. It opens for a minute."""
    from app.bench.app import measure

    with progress("bench app") as report:
        found = measure(starts, seconds, report)
    if json:
        print_json(asdict(found))
        return
    _print_machine(found.machine)
    width, height = found.size
    print(f"{found.preset}; {width} × {height} on {found.platform}; views: string, {', '.join(found.views)}")
    rows = [(f.name, f.value, f.worst, f.target, f.unit) for f in found.figures]
    print_table(("what", "here", "worst", "target", ""), rows)


@bench.command()
def soak(
    json: Json = False,
    minutes: Annotated[float, typer.Option(min=0.01, help="How long.")] = 10.0,
    seed: Annotated[int, typer.Option(min=0, help="Of what is random.")] = 0,
) -> None:
    """The window under a restless user: underruns, memory, threads, faults. Status 1 where there were faults."""
    from app.bench.soak import soak as run_soak

    with progress("bench soak") as report:
        found = run_soak(60 * minutes, seed, report)
    if json:
        print_json(asdict(found))
    else:
        _print_machine(found.machine)
        rows = [
            ("plucks", found.plucks, None),
            ("changes", found.changes, None),
            ("underruns", found.underruns, 0),
            ("late callbacks of the device", found.late_callbacks, None),
            ("share of the time waiting for rendering", found.waited_share, 0),
            ("longest stall of the window, s", found.longest_stall_s, 0.1),
            ("memory when settled, MiB", found.settled_mib, None),
            ("memory at the end, MiB", found.end_mib, None),
            ("highest above settled, MiB", found.drift_mib, 20),
            ("memory at its most, MiB", found.peak_mib, None),
            ("threads left", len(found.threads_left), 0),
            ("faults", sum(times for _, times in found.faults), 0),
        ]
        print_table(("what", "here", "target"), rows)
        for kind, told in (("fault", found.faults), ("notice", found.notices)):
            for text, times in told:
                print(f"{kind}, {times} times: {text}")
    if found.faults or found.threads_left:
        raise typer.Exit(1)


def _print_machine(machine: Machine) -> None:
    print(
        f"{machine.processor}, {machine.cpu_count} cores, {machine.threads} threads, "
        f"torch {machine.torch}, Python {machine.python}, {machine.system}"
    )
