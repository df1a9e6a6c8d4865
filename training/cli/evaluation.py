"""evaluate: the errors of a preset on its data set, over the horizon that it was trained on and past it."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from engine.bounds import LARGEST_SEED, MOST_TRAJECTORIES
from engine.pluck import DEFAULT_LISTEN
from training.cli import arguments
from training.cli.arguments import Cache, Json, check_range, open_preset_of_string
from training.cli.console import Shares, number, print_json, print_table, progress, say
from training.cli.training import Known, known_errors, load_data, print_known

if TYPE_CHECKING:
    from engine.compare.relative import RelativeError
    from engine.presets import Preset
    from training.configuration import DatasetConfiguration
    from training.data.dataset import Dataset
    from training.evaluate import SpectralDistance

Split = Literal["validation", "test", "both"]
WINDOWS = 4  # of the horizon
SCRIPT_BATCH, SCRIPT_TOLERANCE = 50, 0.01  # of the authors' script; what differs by less is not printed
LONGEST_PAST_S = 60.0
FEWEST_PLUCKS = 10  # of a string that none was trained on
HELD_OUT = "held_out"  # what fresh trajectories are called in place of a split
HEARD_FIGURES = ("distance_db", "level_db", "rise_db", "pitch_cents", "split_cents", "runs_away_s", "hum_db")
HEARD_HEADS = ("spectra dB", "level dB", "rise dB", "cents", "second cents", "runs away s", "hum dB")
REPORTED = {
    "se": "standard error over trajectories (bootstrap)",
    "spread": "spread over the trajectories",
    "400": "first 400 frames",
}


def evaluate(
    preset: Annotated[
        str | None, typer.Argument(metavar="PRESET", help="A preset's name or the path of its file.")
    ] = None,
    split: Annotated[
        Split, typer.Option(help="Which trajectories; the paper's tables are of validation.")
    ] = "validation",
    past: Annotated[float, typer.Option(metavar="S", help="Measure so many s past the training horizon, too.")] = 0.0,
    partials: Annotated[
        bool, typer.Option("--partials", help="Level, phase, frequency, decay and glide of each mode, too.")
    ] = False,
    trajectories: Annotated[
        int | None,
        typer.Option(min=1, max=MOST_TRAJECTORIES, metavar="N", help="Only the first N of a split; default all."),
    ] = None,
    fresh: Annotated[
        int | None,
        typer.Option(
            "--held-out",
            min=FEWEST_PLUCKS,
            max=10_000,
            metavar="N",
            help=f"Measure N new plucks instead of a split; default {FEWEST_PLUCKS} for a preset of many strings.",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, max=LARGEST_SEED, help="Of the draw of --held-out.")] = 1,
    string: arguments.StringName = None,
    rate: arguments.StringRate = None,
    modes: arguments.StringModes = None,
    on: Annotated[
        str | None,
        typer.Option("--on", metavar="CONFIG", help="For a preset of many strings: measure it on this run's data."),
    ] = None,
    heard: Annotated[
        bool, typer.Option("--heard", help="Instead, say in words what a listener would notice on a few plucks.")
    ] = False,
    everything: Annotated[bool, typer.Option("--all", help="With --heard: all presets.")] = False,
    write: Annotated[
        bool, typer.Option("--write", help="With --heard: add it to heard.csv beside the preset, for the app.")
    ] = False,
    cache: Cache = None,
    json: Json = False,
) -> None:
    """Measure a preset's errors on its own data set.

    They are printed beside those stored in the preset. A preset of many strings is measured on new plucks of one.
    """
    of_heard = {"--all": everything, "--write": write}
    of_string = {"--string": string, "--rate": rate, "--modes": modes}
    of_data = {"--past": past, "--partials": partials, "--trajectories": trajectories, "--held-out": fresh}
    if heard:
        _refuse({**of_data, "--on": on, **of_string}, "does not go with --heard")
    else:
        _refuse(of_heard, "does not go without --heard")
    if on is not None:
        _refuse(of_string, "does not go with --on, whose run has a string")
    if heard:
        _evaluate_heard(preset, everything, write, json)
        return
    if preset is None:
        raise typer.BadParameter("is missing: give a preset's name or file", param_hint="PRESET")
    check_range("--past", past, 0, LONGEST_PAST_S, "s")
    loaded = open_preset_of_string(preset, string, rate, modes)
    if on is not None:
        loaded, configuration = _on(loaded, on)
    else:
        configuration = _data_of(loaded)
    info = loaded.info
    if info.family is not None and on is None:
        fresh = fresh or FEWEST_PLUCKS
    if 0 < past * info.rate_hz < 1:
        raise typer.BadParameter(f"must hold a sample of {info.rate_hz} Hz, not {past:g} s", param_hint="--past")
    splits: tuple[str, ...] = ("validation", "test") if split == "both" else (split,)
    if fresh is not None:
        splits, configuration = ("all",), replace(configuration, count=fresh)
    from training.data.dataset import split_rows
    from training.evaluate import held_out
    from training.run import configuration_of

    for rows in (split_rows(configuration.count, name) for name in splits):
        if trajectories is not None:
            check_range("--trajectories", trajectories, 1, rows.stop - rows.start)

    if fresh is None:
        data = replace(load_data(configuration, cache), scale_m=info.scale_m)
    else:
        try:
            data = held_out(configuration, info.scale_m, fresh, seed)
        except ValueError as error:
            raise typer.BadParameter(str(error), param_hint="--seed") from error
    with progress("evaluate") as report:
        shares = Shares(report, len(splits) * (2 if partials else 1))
        measurement = _Measurement(loaded, data, past, partials, trajectories, shares)
        measured = {HELD_OUT if name == "all" else name: measurement.of(name) for name in splits}
    for words in info.family.warnings(info.string) if info.family is not None and on is None else ():
        say(f"warning: {words}")
    known: Known = {}
    if info.family is None and "validation" in measured:
        known = known_errors(configuration_of(info, str(loaded.path)))
    if json:
        first = next(iter(measured.values()))
        facts = {
            "preset": loaded.name,
            "file": str(loaded.path),
            "split": split if fresh is None else HELD_OUT,
            "rate_hz": info.rate_hz,
            "horizon_s": info.horizon_s,
            "past_s": past,
            "listen": DEFAULT_LISTEN,
        }
        others = {whose: {"rel_mse": mse, "rel_mae": mae} for whose, (mse, mae) in known.items()}
        print_json({**facts, "rel_mse": first["rel_mse"], "rel_mae": first["rel_mae"], **others, **measured})
        return
    for name, errors in measured.items():
        _print_errors(name, errors, info.horizon_s, known if name == "validation" else {})
        for window_errors in errors.get("partials", [])[: 2 if past else 1]:  # the whole horizon, and all past it
            _print_partials(name, window_errors)


def _refuse(options: dict[str, Any], words: str) -> None:
    """Raise typer.BadParameter at the first of these options that was given."""
    for option, value in options.items():
        if value:
            raise typer.BadParameter(words, param_hint=option)


def _evaluate_heard(preset: str | None, everything: bool, write: bool, json: bool) -> None:
    """Compare the sound of presets with the truth and print the differences, the truest preset first.

    Presets that cannot be used are reported and left out.
    """
    from engine.folders import usable_files
    from engine.presets import PresetError, find_preset
    from engine.schema import write as plain
    from training.heard import measure
    from training.heard_words import heard_word

    if everything == (preset is not None):
        raise typer.BadParameter("give a preset, or --all for all of them", param_hint="PRESET")
    files, rows = list(usable_files()), []
    if preset is not None:
        files = [find_preset(preset, files)]
    with progress("listen") as report:
        shares = Shares(report, len(files))
        for path in files:
            try:
                rows.append(measure(path, write, shares.next()))
            except (PresetError, ValueError) as error:
                say(str(error))
    rows.sort(key=lambda row: row.distance_db)
    if json:
        print_json([{**plain(row), "heard": heard_word(row)} for row in rows])
        return
    table = []
    for row in rows:
        figures = (getattr(row, name) for name in HEARD_FIGURES)
        table.append([row.name, heard_word(row), *(None if v is None else round(v, 2) + 0.0 for v in figures)])
    print_table(("preset", "heard", *HEARD_HEADS), table)


@dataclass(frozen=True)
class _Measurement:
    """Measures a preset on a data set, as the options of `evaluate` ask for.

    Attributes:
        past_s: that are measured past the training horizon; 0: none.
        partials: measure each mode, too.
        trajectories: only the first so many of a split; None: all.
        report: of the progress; each split takes one piece of it, or two with partials.
    """

    preset: Preset
    data: Dataset
    past_s: float
    partials: bool
    trajectories: int | None
    report: Shares

    def of(self, split: str) -> dict[str, Any]:
        """The figures of a split, all by name."""
        from training.evaluate import errors_by_rise, evaluate_past_horizon, figures
        from training.results import SHORT_HORIZON

        info = self.preset.info
        windows = self._windows()
        motion = evaluate_past_horizon(
            self.preset.model,
            self.data,
            split,
            self.past_s,
            horizon=info.horizon_steps,
            windows_s=[(0.0, info.horizon_s), *windows],
            trajectories=slice(self.trajectories),
            report=self.report.next(),
        )
        facts: dict[str, Any] = {
            "trajectories": len(motion.string.per_trajectory()[0]),
            **figures(motion.string.total(info.horizon_steps)),
            **figures(motion.string.standard_error(first=0, last=info.horizon_steps), "{}_se"),
            **self._stored(split),
            **_sound(motion.sound.total(info.horizon_steps), motion.spectra[0]),
        }
        if not self.past_s:  # a trajectory's own error is over all that was measured
            facts |= figures(motion.string.spread(), "{}_spread")
            facts |= figures(motion.string.mean_of_batches(SCRIPT_BATCH), "{}_batches")
            if info.tension_modulated:
                groups = errors_by_rise(motion.string, self.data.configuration, split)
                facts["by_rise"] = [asdict(group) for group in groups]
        if info.horizon_steps > SHORT_HORIZON:
            facts |= figures(motion.string.total(SHORT_HORIZON), f"{{}}_{SHORT_HORIZON}")
        edges = [0.0, *(stop_s for _, stop_s in windows)]
        sums = (motion.string.windows(info.rate_hz, edges), motion.sound.windows(info.rate_hz, edges))
        facts["windows"] = []
        for window, of_window, spectrum in zip(*sums, motion.spectra[1:], strict=True):
            first, last = (round(at_s * info.rate_hz) for at_s in (window.start_s, window.stop_s))
            facts["windows"].append(
                {
                    **asdict(window),
                    "past_horizon": self._is_past(window.start_s),
                    **figures(motion.string.standard_error(first=first, last=last), "{}_se"),
                    **_sound(of_window, spectrum),
                }
            )
        end_s = windows[-1][1]
        if self.past_s and end_s >= 2:  # whether it rings true: the question of every long run
            for name, start_s in (("first_second", 0.0), ("last_second", end_s - 1)):
                (second,) = motion.string.windows(info.rate_hz, [start_s, start_s + 1])
                facts[name] = figures(second)
        if self.partials:
            facts["partials"] = self._partials(split, windows)
        return facts

    def _stored(self, split: str) -> dict[str, float | None]:
        """The errors on a split that the preset itself states; none of new plucks."""
        info = self.preset.info
        if split == "all":
            return {}
        mse, mae = (info.test_rel_mse, info.test_rel_mae) if split == "test" else (info.rel_mse, info.rel_mae)
        return {"stored_rel_mse": mse, "stored_rel_mae": mae}

    def _partials(self, split: str, windows: list[tuple[float, float]]) -> list[dict[str, Any]]:
        """The errors of each mode over the whole horizon, over all past it, then in every window: a dict each."""
        from training.evaluate import evaluate_partials

        horizon_s, end_s = self.preset.info.horizon_s, windows[-1][1]
        windows = [(0.0, horizon_s), *([(horizon_s, end_s)] if self.past_s else []), *windows]
        errors = evaluate_partials(
            self.preset.model,
            self.data,
            split,
            windows,
            trajectories=slice(self.trajectories),
            report=self.report.next(),
        )
        return [
            {
                "start_s": start_s,
                "stop_s": stop_s,
                "past_horizon": self._is_past(start_s),
                "modes": [asdict(mode) for mode in errors.by_mode(place)],
                "weighted": asdict(errors.weighted(place)),
            }
            for place, (start_s, stop_s) in enumerate(windows)
        ]

    def _windows(self) -> list[tuple[float, float]]:
        """Windows (start, stop) in s: parts of the horizon, then every second past it; on frames, none empty."""
        info = self.preset.info
        last = info.horizon_steps + round(self.past_s * info.rate_hz)
        inside = {round(info.horizon_steps * part / WINDOWS) for part in range(WINDOWS + 1)}
        edges = sorted(inside | {*range(info.horizon_steps, last, info.rate_hz), last})
        return list(pairwise(edge / info.rate_hz for edge in edges))

    def _is_past(self, start_s: float) -> bool:
        return start_s >= self.preset.info.horizon_s


def _sound(errors: RelativeError, distance: SpectralDistance) -> dict[str, float]:
    """The figures of the sound at the listening point over one window, by name, as they are printed."""
    return {
        "null_depth_db": errors.null_depth_db,
        "spectral_convergence": distance.convergence,
        "log_spectrum_db": distance.log_db,
    }


def _on(preset: Preset, run: str) -> tuple[Preset, DatasetConfiguration]:
    """A preset of many strings with the string, rate, modes and horizon of a run's data; and these data."""
    from engine.presets import of_string
    from training.cell import load

    data = load(run).data
    reported = replace(preset.info, tension_modulated=data.tension_modulated)
    described = of_string(replace(preset, info=reported), data.string, data.rate_hz, data.modes)
    # the errors that it reports are those of the family
    info = replace(described.info, rel_mse=None, rel_mae=None, test_rel_mse=None, test_rel_mae=None)
    return replace(described, info=replace(info, horizon_steps=data.steps)), data


def _data_of(preset: Preset) -> DatasetConfiguration:
    """The data set of a preset; of a string of many, its plucks are as hard as the family's."""
    from training.configuration import DatasetConfiguration
    from training.run import data_of

    info = preset.info
    if info.family is not None:
        return DatasetConfiguration(
            initial="pluck",
            rate_hz=info.rate_hz,
            modes=info.modes,
            tension_modulated=info.tension_modulated,
            steps=info.horizon_steps,
            count=FEWEST_PLUCKS,
            grid_points=info.grid_points,
            seed=-1,  # no pluck of it was trained on, whatever --seed
            string=info.string,
            largest_tension_rise=info.family.tension_rise[1],
        )
    return data_of(preset)


def _print_errors(split: str, errors: dict[str, Any], horizon_s: float, known: Known) -> None:
    """Print the figures of a split, as `_Measurement.of` gives them, with those known from elsewhere."""

    def pair(form: str) -> list[Any]:
        return [errors[form.format(name)] for name in ("rel_mse", "rel_mae")]

    def tell(words: str, form: str) -> None:
        if form.format("rel_mse") in errors:
            print(f"{words}: {', '.join(map(number, pair(form)))}")

    print(f"{split.replace('_', ' ')}: rel. MSE {number(errors['rel_mse'])}, rel. MAE {number(errors['rel_mae'])}")
    if "rel_mse_batches" in errors:
        both = zip(pair("{}"), pair("{}_batches"), strict=True)
        if not all(math.isclose(whole, mean, rel_tol=SCRIPT_TOLERANCE) for whole, mean in both):
            tell(f"mean over batches of {SCRIPT_BATCH}, as the authors' script has it", "{}_batches")
    tell("stored in the preset", "stored_{}")
    print_known(known)
    for key, words in REPORTED.items():
        tell(words, f"{{}}_{key}")
    print(
        f"{errors['trajectories']} trajectories, trained to {horizon_s:g} s; "
        f"sound at {DEFAULT_LISTEN:g} of the length: null depth {errors['null_depth_db']:.1f} dB, "
        f"spectral convergence {number(errors['spectral_convergence'])}, "
        f"spectra {number(errors['log_spectrum_db'])} dB apart"
    )
    if "first_second" in errors:
        first, last = errors["first_second"]["rel_mse"], errors["last_second"]["rel_mse"]
        times = f", {last / first:.3g} times as much" if first > 0 else ""
        print(f"rel. MSE of the first second {number(first)}, of the last {number(last)}{times}")
    if "by_rise" in errors:
        heads = ("plucks", "tension rises %", "to %", "rel. MSE", "rel. MAE", "of squared error %", "one pluck %")
        print_table(heads, [_by_rise(group) for group in errors["by_rise"]])
    columns = ("from s", "to s", "rel. MSE", "± se", "rel. MAE", "± se", "null dB", "convergence", "spectra dB", "")
    figures = ("rel_mse", "rel_mse_se", "rel_mae", "rel_mae_se", "null_depth_db", "spectral_convergence")
    keys = ("start_s", "stop_s", *figures, "log_spectrum_db")
    past = {True: "past the training horizon", False: ""}
    print_table(columns, [[*(w[key] for key in keys), past[w["past_horizon"]]] for w in errors["windows"]])


def _by_rise(group: dict[str, Any]) -> list[object]:
    """The row of a group of plucks, a `RiseErrors` as a dict, with shares in %."""
    low, high, share, largest = (100 * group[name] for name in ("from_rise", "to_rise", "share", "largest"))
    return [group["trajectories"], low, high, group["rel_mse"], group["rel_mae"], share, largest]


def _print_partials(split: str, partials: dict[str, Any]) -> None:
    """Print a row for each mode of one window, as `_Measurement` measured them, and the means by energy."""
    past = ", past the training horizon" if partials["past_horizon"] else ""
    print(f"{split}, partials of {partials['start_s']:g} … {partials['stop_s']:g} s{past}: medians of the magnitudes")
    figures = ("Hz", "level dB", "phase cycles", "cents", "T60 s", "T60 error %", "glide cents", "glide error")
    columns = ("mode", "trajectories", *figures)
    rows = [list(mode.values()) for mode in partials["modes"]]
    w = partials["weighted"]
    means = [w["level_db"], w["phase_cycles"], w["cents"], "", "", "", w["glide_error_cents"]]
    print_table(columns, [*rows, ["all, by energy", "", "", *means]])
