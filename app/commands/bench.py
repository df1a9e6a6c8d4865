"""bench solver, render, voices, effects, tune, take, train, app, play, unplug, soak: what the program costs here."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated

import typer

from app.commands.arguments import Json
from app.commands.console import print_json, print_table, progress

if TYPE_CHECKING:
    from app.commands.benchmarks.machine import Machine
    from app.commands.benchmarks.play.measure import Spread

bench = typer.Typer(help="Measure speed on this machine: medians of repeats.", no_args_is_help=True)


@bench.command()
def solver(
    json: Json = False,
    batch: Annotated[int, typer.Option(min=1, max=1000, help="Trajectories at once.")] = 100,
    steps: Annotated[int, typer.Option(min=1, help="Samples of each trajectory.")] = 4000,
) -> None:
    """Cost and error of the fast solver against DOP853, on the worst case of the paper's data sets."""
    from app.commands.benchmarks.solver import measure

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
    from app.commands.benchmarks.render import measure

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
def voices(json: Json = False) -> None:
    """What a voice of a model or the truth costs and how exact it is, how many fit on a core, what a strike costs."""
    from app.commands.benchmarks import voices as bench

    with progress("bench voices") as report:
        found = bench.measure(report)
    if json:
        print_json(asdict(found))
        return
    _print_machine(found.machine)
    rows = [
        (
            v.preset,
            v.kind,
            v.modes,
            *(f"{100 * part:.2f}" for part in (v.onset, v.first_second, v.later, v.mean)),
            v.voices_at(bench.MODEL_SHARE),
            v.voices_at(bench.TRUTH_SHARE),
            f"{v.error:.1e}",
        )
        for v in found.voices
    ]
    ages = ("to 0.05 s, %", "to 1 s, %", "1 to 4 s, %", "to 4 s, %")
    print_table(("preset", "voice", "modes", *ages, "at 25 %", "at 50 %", "error"), rows)
    print_table(
        ("strike of both", "median ms", "worst ms"), [(s.preset, s.median_ms, s.worst_ms) for s in found.strikes]
    )
    print(
        f"targets: {bench.MODEL_VOICES} model voices at {bench.MODEL_SHARE:.0%} of a core,"
        f" {bench.TRUTH_VOICES} truth voices at {bench.TRUTH_SHARE:.0%} and an error of {bench.TRUTH_ERROR:g} at most"
    )


@bench.command()
def effects(json: Json = False) -> None:
    """What body and room cost: shares of a core, the dearest quantum, and what it takes to set them."""
    from app.commands.benchmarks.effects import measure

    with progress("bench effects") as report:
        found = measure(report)
    if json:
        print_json(asdict(found))
        return
    _print_machine(found.machine)
    rows = [
        (
            cost.name,
            f"{cost.response_s:.2f}",
            f"{100 * cost.share:.2f}",
            f"{100 * cost.at_rest:.2f}",
            f"{cost.worst_us:.0f}",
            f"{100 * cost.worst_us / cost.quantum_us:.1f}",
            f"{cost.first_ms:.0f}",
            f"{cost.set_ms:.0f}",
        )
        for cost in found.effects
    ]
    costs = ("of a core, %", "at rest, %", "worst quantum, µs", "of it, %", "first set, ms", "set again, ms")
    print_table(("effects", "s", *costs), rows)


@bench.command()
def tune(
    patch: Annotated[
        list[str] | None, typer.Argument(metavar="PATCH", help="Names or files of patches; default: all.")
    ] = None,
    every: Annotated[int, typer.Option(min=1, max=24, help="So many semitones between two keys.")] = 6,
    json: Json = False,
) -> None:
    """Patches as they are heard: pitch and loudness over their range, chords, and the model beside the truth."""
    from app.commands.arguments import open_preset
    from app.commands.benchmarks.tune import measure
    from app.commands.console import Failure
    from app.patches.library import PatchError, find_patch, list_patches

    try:
        chosen = [find_patch(name).patch for name in patch] if patch else [e.patch for e in list_patches()[0]]
    except PatchError as error:
        raise Failure(str(error)) from error
    presets = {name: open_preset(name) for name in {each.preset for each in chosen}}
    with progress("bench tune") as report:
        found = measure([(each, presets[each.preset]) for each in chosen], every, report)
    if json:
        print_json(asdict(found))
        return
    _print_machine(found.machine)
    columns = (
        "patch",
        "keys",
        "worst cents",
        "spread dB",
        "level dB",
        "chord dBFS",
        "shortest s",
        "model/truth rel. MSE",
    )
    print_table(
        columns,
        [
            (
                each.patch,
                len(each.keys),
                each.cents,
                each.spread_db,
                each.level_db,
                each.chord_peak_db,
                each.shortest_s,
                each.hands_rel_mse,
            )
            for each in found.patches
        ],
    )


@bench.command()
def take(json: Json = False) -> None:
    """What the pictures and signals of a pluck of ten seconds cost: time, memory, a listening point that moves."""
    from app.commands.benchmarks.take import measure

    with progress("bench take") as report:
        found = measure(report)
    if json:
        print_json(asdict(found))
        return
    _print_machine(found.machine)
    columns = ("preset", "s", "pictures Hz", "rendered, processor s", "MB a source", "moved, processor s", "moved, s")
    print_table(columns, [tuple(asdict(cost).values()) for cost in found.takes])


@bench.command()
def train(json: Json = False) -> None:
    """Seconds of a train step of every model: 50 trajectories, 400 frames (50 for fgru and frnn)."""
    from app.commands.benchmarks.train import measure

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
    """The window: how soon it is there and can be plucked, how smoothly the picture moves. It opens for a minute."""
    from app.commands.benchmarks.app import measure

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
def play(
    json: Json = False,
    seconds: Annotated[float, typer.Option(min=1.0, help="How long it is played.")] = 60.0,
    rate: Annotated[float, typer.Option(min=0.5, max=20.0, help="Plucks a second.")] = 12.0,
    buffer: Annotated[str, typer.Option(help="low, medium, high, or 128 ... 2048 frames.")] = "medium",
    busy: Annotated[
        bool | None,
        typer.Option("--busy/--alone", help="Only beside a process that keeps a core busy, or only without one."),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of what is random.")] = 0,
    patch: Annotated[
        str, typer.Option(metavar="PATCH", help="What is played; the default rings on when a key is let go.")
    ] = "concert_harp",
) -> None:
    """What its user hears: the app on a private screen, played by keys from outside, and its sound recorded.

    Linux only; needs PulseAudio and Xvfb, and touches nothing of the sound and the screen in use.
    """
    from pydantic import ValidationError

    from app.audio.choices import SoundChoice
    from app.commands.benchmarks.play.measure import measure
    from app.commands.console import Failure
    from app.patches.library import PatchError, find_patch

    try:
        chosen = SoundChoice.model_validate({"buffer": int(buffer) if buffer.isdecimal() else buffer}).buffer
    except ValidationError:
        raise typer.BadParameter("low, medium, high, 128, 256, 512, 1024 or 2048", param_hint="--buffer") from None
    try:
        found_patch = find_patch(patch).patch
    except PatchError as error:
        raise Failure(str(error)) from error
    with progress("bench play") as report:
        beside = (False, True) if busy is None else (busy,)
        found = measure(seconds, rate, chosen, beside, seed, found_patch, report)
    if json:
        print_json(asdict(found))
        return
    _print_machine(found.machine)
    width, height = found.size
    print(
        f"{found.patch}; {found.buffer} buffer; {found.rate_hz:g} notes/s for {found.phases[0].seconds:.0f} s, "
        f"seed {found.seed}; "
        f"{width} × {height}; views: string, {', '.join(found.views)}; "
        f"load before: {', '.join(f'{phase.load_before[0]:.1f}' for phase in found.phases)}"
    )
    rows: list[tuple[object, ...]] = [
        ("holes", *(phase.holes for phase in found.phases)),
        ("holes together, ms", *(phase.holes_ms for phase in found.phases)),
        ("longest hole, ms", *(phase.longest_hole_ms for phase in found.phases)),
        ("holes of a steady tone beside it", *(phase.control_holes for phase in found.phases)),
        ("these together, ms", *(phase.control_holes_ms for phase in found.phases)),
        ("the longest of these, ms", *(phase.control_longest_ms for phase in found.phases)),
        ("fades", *(phase.fades for phase in found.phases)),
        ("clicks", *(phase.clicks for phase in found.phases)),
        ("single plucks that were not heard", *(phase.unheard for phase in found.phases)),
        *_spread_rows("key to sound", [phase.latency_ms for phase in found.phases]),
        *_spread_rows("key to sound, beyond the device", [phase.beyond_device_ms for phase in found.phases]),
        ("the device's own buffer, ms", *(phase.device_ms for phase in found.phases)),
        ("loudest sample", *(phase.loudest for phase in found.phases)),
        ("cores while playing", *(phase.cpu_cores for phase in found.phases)),
    ]
    print_table(("what", *("beside a busy process" if phase.busy else "alone" for phase in found.phases)), rows)
    lag = found.picture_lag_ms
    rows = [
        ("start to the window, s", found.start_to_window_s),
        ("start to the first sound, s", found.start_to_sound_s),
        ("cores while idle", found.idle_cpu_cores),
        ("of these the window's thread; most others are the sound system's", found.idle_window_cores),
        *_spread_rows("sound to its picture", [lag]),
        ("uncertainty of the recording's clock, ms", found.clock_uncertainty_ms),
        ("uncertainty of the device's buffer, ms", found.device_uncertainty_ms),
    ]
    print_table(("what", "here"), rows)


def _spread_rows(name: str, spreads: Sequence[Spread | None]) -> list[tuple[object, ...]]:
    return [
        (f"{name}, {word}, ms", *(getattr(spread, field, None) for spread in spreads))
        for word, field in (("median", "median"), ("99 %", "p99"), ("worst", "worst"))
    ]


@bench.command()
def unplug(
    json: Json = False,
    times: Annotated[int, typer.Option(min=1, max=1000, help="How often the device goes and comes back.")] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Of what is random.")] = 0,
    patch: Annotated[str, typer.Option(metavar="PATCH", help="What is played meanwhile.")] = "concert_harp",
) -> None:
    """The sound device is taken away and given back while the app is played. Status 1 where sound is not back in 2 s.

    In turn the card goes, and the sound server. Linux only; needs PulseAudio and Xvfb, and touches nothing of the
    sound and the screen in use.
    """
    from app.commands.benchmarks.play import unplug as bench
    from app.commands.console import Failure
    from app.patches.library import PatchError, find_patch

    try:
        found_patch = find_patch(patch).patch
    except PatchError as error:
        raise Failure(str(error)) from error
    with progress("bench unplug") as report:
        found = bench.measure(times, seed, found_patch, report)
    if json:
        print_json({**asdict(found), "in_time": found.in_time})
    else:
        _print_machine(found.machine)
        print(f"{found.patch}; seed {found.seed}; loudest sample before {found.loudest_before:.3f}")
        rows = [
            (number, loss.kind, f"{loss.gone_s:.1f}", loss.back_s, f"{loss.loudest:.3f}", loss.holes)
            for number, loss in enumerate(found.losses, 1)
        ]
        print_table(("", "what goes", "gone, s", "sound back, s", "loudest sample", "holes then"), rows)
        if found.back_s:
            print(f"sound back: median {statistics.median(found.back_s):.2f} s, worst {max(found.back_s):.2f} s")
        print(f"within {bench.TARGET_S:g} s: {found.in_time} of {times}")
        ends = "not within a few seconds" if found.ends_s is None else f"{found.ends_s:.2f} s after the key"
        print(f"all notes stopped: {ends}; the app {'goes on' if found.alive else 'has ended'}")
    if not found.passed:
        raise typer.Exit(1)


@bench.command()
def soak(
    json: Json = False,
    minutes: Annotated[float, typer.Option(min=0.01, help="How long.")] = 10.0,
    playing: Annotated[bool, typer.Option("--playing", help="Twelve keys a second, without a pause.")] = False,
    seed: Annotated[int, typer.Option(min=0, help="Of what is random.")] = 0,
) -> None:
    """The window under a restless user: holes in the sound, memory, threads, faults. Status 1 where there are faults.

    Linux only; needs PulseAudio, and touches nothing of the sound in use.
    """
    from app.commands.benchmarks.soak import soak as run_soak

    with progress("bench soak") as report:
        found = run_soak(60 * minutes, seed, playing, report)
    if json:
        print_json({**asdict(found), "holes": {**asdict(found.holes), "a_minute": found.holes.a_minute}})
    else:
        _print_machine(found.machine)
        holes = found.holes
        rows = [
            ("plucks", found.plucks, None),
            ("changes", found.changes, None),
            ("holes in the recording", holes.heard, 0),
            ("holes a minute", holes.a_minute, 0),
            ("holes together, ms", holes.heard_ms, 0),
            ("longest hole, ms", holes.longest_ms, 0),
            ("gaps that the mixer tells", sum(holes.told.values()), 0),
            *((f"of them {cause}", count, None) for cause, count in holes.told.items()),
            ("longest stall of the window, s", found.longest_stall_s, 0.1),
            ("memory when settled, MiB", found.settled_mib, None),
            ("memory at the end, MiB", found.end_mib, None),
            ("furthest from settled, MiB", found.drift_mib, 20),
            ("memory at its most, MiB", found.peak_mib, None),
            ("threads left", len(found.threads_left), 0),
            ("faults", sum(times for _, times in found.faults), 0),
        ]
        print_table(("what", "here", "target"), rows)
        when = "at each minute" if found.playing else "at rest"
        print(f"memory {when}, MiB: " + ", ".join(f"{mib:.0f}" for mib in found.memory_mib))
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
