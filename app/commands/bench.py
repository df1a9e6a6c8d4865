"""bench solver, render, voices, effects, tune, take, train, app, play, notes, unplug, soak: what it costs."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from app.commands.arguments import Json
from app.commands.console import print_json, print_table, progress

if TYPE_CHECKING:
    from app.audio.choices import Buffer
    from app.commands.benchmarks.machine import Machine
    from app.commands.benchmarks.play.spread import Spread

bench = typer.Typer(help="Measure speed, sound and memory on this machine.", no_args_is_help=True)


@bench.command()
def solver(
    json: Json = False,
    batch: Annotated[int, typer.Option(min=1, max=1000, help="Trajectories at once.")] = 100,
    steps: Annotated[int, typer.Option(min=1, help="Samples of each trajectory.")] = 4000,
) -> None:
    """Cost and error of the fast solver against DOP853.

    On the worst trajectory of each of the paper's data sets.
    """
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
    """Real-time factor and first-block latency of every model.

    On one thread. A factor below 1 is faster than real time.
    """
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
    """Cost and error of a voice, and the cost of a pluck.

    Of the models of all studio presets and of the truth, and how many voices fit on a core.
    """
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
    """Cost of body and room.

    Shares of a core, the slowest quantum, and the time to set them.
    """
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
    every: Annotated[int, typer.Option(min=1, max=24, help="Semitones from one measured key to the next.")] = 6,
    json: Json = False,
) -> None:
    """Pitch and loudness of patches over their range.

    Also the level of a chord, and the model's error against the truth while a key is bent and plucked again.
    """
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
    """Time and memory of a pluck's pictures and signals.

    Of ten seconds, and after its listening point has moved.
    """
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
    """Time of a training step of every model.

    With 50 trajectories of 400 frames (of 50 frames for fgru and frnn).
    """
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
    seconds: Annotated[
        float, typer.Option(min=0.1, metavar="S", help="How long the picture is observed, in s.")
    ] = 5.0,
    starts: Annotated[int, typer.Option(min=1, help="Starts that are timed, after one that is not.")] = 3,
) -> None:
    """Time until the window can be played, and its frame rate.

    A window opens for a minute.
    """
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
    seconds: Annotated[float, typer.Option(min=1.0, metavar="S", help="How long it is played, in s.")] = 60.0,
    rate: Annotated[float, typer.Option(min=0.5, max=20.0, help="Plucks per second.")] = 12.0,
    buffer: Annotated[
        str, typer.Option(help="The device's: low, medium, high, or 128, 256, 512, 1024 or 2048 frames.")
    ] = "medium",
    busy: Annotated[
        bool | None,
        typer.Option(
            "--busy/--alone", help="Only beside a process that keeps a core busy, or only without; default both."
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Of the random keys.")] = 0,
    patch: Annotated[
        str, typer.Option(metavar="PATCH", help="What is played; the default rings on after a key's release.")
    ] = "concert_harp",
) -> None:
    """Holes, clicks and latency of the app's sound, recorded.

    The app runs on a private screen and is played by keys. Linux only. Needs PulseAudio and Xvfb; starts a sound
    server and a screen of its own, and leaves yours alone.
    """
    from app.commands.benchmarks.play.measure import measure
    from app.commands.console import Failure
    from app.patches.library import PatchError, find_patch

    chosen = _buffer(buffer)
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
        ("holes of another process's steady tone", *(phase.control_holes for phase in found.phases)),
        ("these together, ms", *(phase.control_holes_ms for phase in found.phases)),
        ("the longest of these, ms", *(phase.control_longest_ms for phase in found.phases)),
        ("fades", *(phase.fades for phase in found.phases)),
        ("clicks", *(phase.clicks for phase in found.phases)),
        ("plucks 40 ms or more from a key's usual time", *(phase.untimely for phase in found.phases)),
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


@bench.command()
def notes(
    json: Json = False,
    by: Annotated[Literal["midi", "keys", "both"], typer.Option(help="What the notes are played by.")] = "both",
    buffer: Annotated[
        str, typer.Option(help="The device's: low, medium, high, or 128, 256, 512, 1024 or 2048 frames.")
    ] = "medium",
    seed: Annotated[int, typer.Option(min=0, help="Of the random single notes.")] = 0,
    patch: Annotated[
        str, typer.Option(metavar="PATCH", help="What is played, without its body and room.")
    ] = "classical_guitar",
) -> None:
    """Pitch, loudness, damping and latency of notes, recorded.

    A melody, chords, repeats, bends and a pedal are played by MIDI and by keys. Linux only. Needs PulseAudio, Xvfb
    and, for MIDI, JACK; starts a sound server and a screen of its own, and leaves yours alone.
    """
    from app.commands.benchmarks.play.notes import measure
    from app.commands.console import Failure
    from app.patches.library import PatchError, find_patch

    chosen = _buffer(buffer)
    try:
        found_patch = find_patch(patch).patch
    except PatchError as error:
        raise Failure(str(error)) from error
    if found_patch.damping.let_ring:
        raise Failure(f"{found_patch.name}: its strings ring on when a key is let go; choose one with dampers")
    with progress("bench notes") as report:
        found = measure(by, chosen, seed, found_patch, report)
    if json:
        print_json(asdict(found))
        return
    _print_machine(found.machine)
    loads = ", ".join(f"{each.load_before:.1f}" for each in found.heard)
    print(f"{found.patch}, without body and room; {found.buffer} buffer; seed {found.seed}; load before: {loads}")
    hands, told = found.heard, [each.judgement for each in found.heard]
    t60_s = told[0].wanted_t60_s
    restrikes = "soft strikes of a loud string, "
    restrikes += "softest to loudest" if found_patch.pluck.stops else "largest fall of the level"
    rows: list[tuple[object, ...]] = [
        ("quiet notes off their tuning, worst, cents", *(each.melody_cents for each in told), 0.5),
        ("resting bends off theirs, worst, cents", *(each.bend_cents for each in told), 0.5),
        ("tones of chords off theirs, worst, cents", *(each.chord_cents for each in told), None),
        ("tones of chords that stand out", *(f"{each.tones_heard} of {each.chord_tones}" for each in told), "all"),
        ("repeats that are heard", *(f"{each.repeats_heard} of {each.repeats}" for each in told), "all"),
        ("single notes that are not heard", *(each.unheard for each in hands), 0),
        ("quiet notes from softest to loudest, dB", *(each.loudness_spread_db for each in told), "below 3"),
        ("damper's T60, shortest, s", *(each.release_t60_s[0] for each in told), t60_s),
        ("damper's T60, longest, s", *(each.release_t60_s[1] for each in told), t60_s),
        ("held by the pedal from held by a finger, dB", *(each.pedal_db for each in told), 0),
        ("damper's T60 as the pedal rises, s", *(each.pedal_t60_s for each in told), t60_s),
        (f"{restrikes}, dB", *(each.restrike_db for each in told), 0),
        ("holes", *(each.holes for each in told), 0),
        ("holes together, ms", *(each.holes_ms for each in told), 0),
        ("holes of a steady tone beside it", *(each.control_holes for each in hands), None),
        ("these together, ms", *(each.control_holes_ms for each in hands), None),
        ("fades", *(each.fades for each in told), 0),
        ("clicks", *(each.clicks for each in told), 0),
        *((*row, None) for row in _spread_rows("to sound", [each.latency_ms for each in hands])),
        *(
            (*row, None)
            for row in _spread_rows("to sound, beyond the device", [each.beyond_device_ms for each in hands])
        ),
        ("of it the MIDI cable, median, ms", *(each.cable_ms for each in hands), None),
        ("messages that the cable lost", *(each.lost for each in hands), 0),
        ("the device's own buffer, ms", *(each.device_ms for each in hands), None),
        ("loudest sample", *(each.loudest for each in told), "below 1"),
    ]
    print_table(("what", *(f"by {each.by}" for each in found.heard), "wanted"), rows)


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
    minutes: Annotated[float, typer.Option(min=0.01, metavar="MIN", help="Duration in minutes.")] = 10.0,
    playing: Annotated[bool, typer.Option("--playing", help="Twelve keys per second, without a pause.")] = False,
    seed: Annotated[int, typer.Option(min=0, help="Of the random plucks and changes.")] = 0,
    buffer: Annotated[
        str, typer.Option(help="The device's: low, medium, high, or 128, 256, 512, 1024 or 2048 frames.")
    ] = "medium",
) -> None:
    """Holes, memory, threads and faults of a long session.

    Of random plucks and changes, or, with --playing, of keys alone. Exit status 1 where there are faults. Linux only.
    Needs PulseAudio; starts a sound server of its own, and leaves yours alone.
    """
    from app.commands.benchmarks.soak import soak as run_soak

    with progress("bench soak") as report:
        found = run_soak(60 * minutes, seed, playing, _buffer(buffer), report)
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
            ("holes of another process's steady tone", holes.control, None),
            ("these together, ms", holes.control_ms, None),
            ("a thread that only wakes, later than 3 ms", holes.late, None),
            ("the latest, ms", holes.latest_ms, None),
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


def _buffer(text: str) -> Buffer:
    from pydantic import ValidationError

    from app.audio.choices import SoundChoice

    try:
        return SoundChoice.model_validate({"buffer": int(text) if text.isdecimal() else text}).buffer
    except ValidationError:
        raise typer.BadParameter("low, medium, high, 128, 256, 512, 1024 or 2048", param_hint="--buffer") from None


def _print_machine(machine: Machine) -> None:
    print(
        f"{machine.processor}, {machine.cpu_count} cores, {machine.threads} threads, "
        f"torch {machine.torch}, Python {machine.python}, {machine.system}"
    )
