"""A batch: positions × amplitudes × presets × strings × sources, a WAV file each, and an index of them as CSV.

A batch that was stopped continues: a file with the same recipe and a row in the index is kept. The index is written
after every pluck; files that have no row yet, because the process was killed, are rendered again.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from app.export.batch_index import INDEX, BatchIndex, BatchRow
from app.export.files import ExportError, WavReport, default_file_name, export_sounds, settings_of
from app.export.recipe import Recipe, RecipeError, read_recipe
from app.export.recording import blocks
from app.export.sound import SoundRequest, Voices
from app.export.wav import WavSettings
from app.shared.vocabulary import Pickup, Source
from app.shared.worker import Progress
from engine.pluck import Pluck
from engine.presets import Preset, load_preset, of_string, outside_training
from engine.resonators.string import StringParameters
from engine.sources import Runaway


@dataclass(frozen=True)
class NamedString:
    """A string for presets of many strings, with its name in the index and in file names."""

    name: str
    parameters: StringParameters


@dataclass(frozen=True)
class Instrument:
    """A preset, and the string that it plays; None: its own."""

    preset: Path
    string: NamedString | None

    @property
    def name(self) -> str:
        """As in file names."""
        return f"{self.preset.stem}_{self.string.name}" if self.string else self.preset.stem


@dataclass(frozen=True)
class BatchPlan:
    """What a batch renders. Fields that are no lists are the same for all files, as in `SoundRequest`.

    Attributes:
        pluck: gives shape and width; position and amplitude come from the lists.
        overwrite: render files again that are there already.
        strings: each preset plays all of these; empty: its own string.
        modes: how many a preset of many strings has; None: all below 20 kHz. Its model plays at the files' rate.

    Raises:
        ValueError: a list is empty or has a value twice, a pluck is out of its range, or two sounds would have the
            same file.
    """

    presets: tuple[Path, ...]
    positions: tuple[float, ...]
    amplitudes_mm: tuple[float, ...]
    sources: tuple[Source, ...]
    folder: Path
    seconds: float
    listen: float
    pluck: Pluck = field(default_factory=Pluck)
    listen_right: float | None = None
    pickup: Pickup = "displacement"
    difference_gain_db: float = 0.0
    decay_db: float | None = None
    settings: WavSettings = field(default_factory=WavSettings)
    overwrite: bool = False
    strings: tuple[NamedString, ...] = ()
    modes: int | None = None

    def __post_init__(self) -> None:
        for name in ("presets", "positions", "amplitudes_mm", "sources"):
            values, word = getattr(self, name), name.removesuffix("_mm")
            if not values:
                raise ValueError(f"{word}: give at least one")
            if len(set(values)) < len(values):
                raise ValueError(f"{word}: one is given twice")
        if len({string.name for string in self.strings}) < len(self.strings):
            raise ValueError("strings: one is given twice")
        names: set[str] = set()
        for instrument in self.instruments():
            for pluck in self.plucks():
                name = default_file_name(instrument.name, pluck, 0, "model").casefold()
                if name in names:
                    raise ValueError(
                        f"two sounds would have the same file: {instrument.name}; rename a preset or string"
                    )
                names.add(name)

    @property
    def files(self) -> int:
        """How many there are in all."""
        strings = max(1, len(self.strings))
        return len(self.presets) * strings * len(self.positions) * len(self.amplitudes_mm) * len(self.sources)

    def plucks(self) -> Iterator[Pluck]:
        for position in self.positions:
            for amplitude_mm in self.amplitudes_mm:
                yield replace(self.pluck, position=position, amplitude_mm=amplitude_mm)

    def instruments(self) -> Iterator[Instrument]:
        for path in self.presets:
            for string in self.strings or (None,):
                yield Instrument(path, string)

    def load(self, instrument: Instrument) -> Preset:
        """Raises PresetError: the file cannot be used, or is of one string and another is wanted."""
        preset, string = load_preset(instrument.preset), instrument.string
        rate_hz = None if preset.info.family is None else self.settings.rate_hz
        return of_string(preset, string.parameters if string else None, rate_hz, self.modes)

    def request(self, preset: Preset, pluck: Pluck, source: Source) -> SoundRequest:
        return SoundRequest(
            preset,
            pluck,
            self.listen,
            self.seconds,
            source,
            self.listen_right,
            self.pickup,
            self.difference_gain_db,
            self.decay_db,
        )


@dataclass(frozen=True)
class _Job:
    """One pluck of one instrument: what is to be rendered of it."""

    instrument: Instrument
    pluck: Pluck
    sources: tuple[Source, ...]


def run_batch(plan: BatchPlan, progress: Progress = lambda *_: None) -> list[BatchRow]:
    """Renders the files and writes the index, in the plan's folder, which is made if needed.

    Where a preset or a pluck fails, its row says why, and the others are still rendered.

    Returns:
        A row for each file.

    Raises:
        Cancelled: `progress` raised it; whole files and their rows stay.
        ExportError: the folder or the index cannot be written.
    """
    try:
        plan.folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ExportError(f"{plan.folder}: cannot be made ({error.strerror}); choose another folder") from error
    index = BatchIndex(plan.folder / INDEX)
    jobs, rows = _sorted_out(plan, index)
    index.add(rows)
    loaded: Instrument | None = None
    for done, job in enumerate(jobs):
        if job.instrument != loaded:
            preset, loaded = plan.load(job.instrument), job.instrument
        text = f"{job.instrument.name}, position {job.pluck.position:g}, {job.pluck.amplitude_mm:g} mm"

        def part(share: float, *_: object, done: int = done, text: str = text) -> None:
            progress((done + share) / len(jobs), text)

        part(0.0)
        made = _rendered(plan, preset, job, part)
        rows += made
        index.add(made)
    return rows


def _sorted_out(plan: BatchPlan, index: BatchIndex) -> tuple[list[_Job], list[BatchRow]]:
    """What is to be rendered, and the rows of all else: files that are kept, or a preset that cannot be used."""
    jobs, rows = [], []
    for instrument in plan.instruments():
        try:
            preset = plan.load(instrument)
            plan.request(preset, plan.pluck, plan.sources[0])
        except ValueError as error:
            string = instrument.string
            message = f"{string.name}: {error}" if string else str(error)
            rows += [_row(plan, instrument, 0, pluck, s, message) for pluck in plan.plucks() for s in plan.sources]
            continue
        for pluck in plan.plucks():
            sources = []
            for source in plan.sources:
                row = None if plan.overwrite else _kept(plan, instrument, preset, pluck, source, index)
                rows += [row] if row else []
                sources += [] if row else [source]
            if sources:
                jobs.append(_Job(instrument, pluck, tuple(sources)))
    return jobs, rows


def _kept(
    plan: BatchPlan, instrument: Instrument, preset: Preset, pluck: Pluck, source: Source, index: BatchIndex
) -> BatchRow | None:
    """The row of a file that is there, "failed" where it is another sound; None where it is to be rendered."""
    row = _row(plan, instrument, preset.info.rate_hz, pluck, source)
    path = plan.folder / row.file
    if not path.exists():
        return None
    request = plan.request(preset, pluck, source)
    wanted = Recipe.of(request, settings_of(request, plan.settings))
    try:
        same = _essence(read_recipe(path)) == _essence(wanted)
    except RecipeError:
        same = False
    if not same:
        return replace(
            row, message=f"{path}: there is another sound of this name; overwrite it, or choose another folder"
        )
    former = index.rows.get(row.file)
    return None if former is None or former.status == "failed" else replace(former, status="kept")


def _essence(recipe: Recipe) -> dict[str, object]:
    return recipe.model_dump(exclude={"program", "version"})


def _rendered(plan: BatchPlan, preset: Preset, job: _Job, progress: Progress) -> list[BatchRow]:
    blank = {s: _row(plan, job.instrument, preset.info.rate_hz, job.pluck, s) for s in job.sources}
    paths = {source: plan.folder / row.file for source, row in blank.items()}
    request = plan.request(preset, job.pluck, job.sources[0])
    try:
        reports, voices = export_sounds(request, paths, plan.settings, measured=True, progress=progress)
    except Runaway as error:
        failed = [replace(row, message=str(error)) for source, row in blank.items() if source != "truth"]
        if "truth" not in blank:
            return failed
        truth = replace(job, sources=("truth",))
        return [*failed, *_rendered(plan, preset, truth, progress)]
    except ExportError as error:
        return [replace(row, message=str(error)) for row in blank.values()]
    errors, told = _errors(preset, voices), _outside(job, preset)
    return [
        _measured(blank[source], report, *(((None, None), "") if source == "truth" else (errors, told)))
        for source, report in zip(blank, reports, strict=True)
    ]


def _outside(job: _Job, preset: Preset) -> str:
    """A warning that string or pluck lie outside what a model of many strings has learned; "" where they do not."""
    words = outside_training(preset.info, job.pluck) if preset.info.family else []
    return f"warning: {job.instrument.name}: {'; '.join(words)}" if words else ""


def _measured(row: BatchRow, report: WavReport, errors: tuple[float | None, float | None], message: str) -> BatchRow:
    return replace(
        row,
        status="written",
        seconds=report.seconds,
        peak_db=round(report.peak_db, 2),
        clipped=report.clipped,
        rel_mae_trained=errors[0],
        rel_mae=errors[1],
        message=message,
    )


def _errors(preset: Preset, voices: Voices) -> tuple[float | None, float | None]:
    """Relative MAE up to the training horizon, and over all; None where there is nothing to compare."""
    if len(voices.sounds) < 2:
        return None, None
    model, truth = voices.sounds["model"], voices.sounds["truth"]
    sums = np.zeros((2, 2))  # up to the training horizon and past it: of |error| and |truth|
    for first, true in blocks(truth):
        error = np.abs(model[first : first + len(true)] - true)
        frame = np.arange(first, first + len(true))
        within = (frame >= 1) & (frame <= preset.info.horizon_steps)
        for row, part in enumerate((within, frame > preset.info.horizon_steps)):
            sums[row] += error[part].sum(), np.abs(true[part]).sum()
    if len(truth) < 2:
        return None, None
    trained, whole = (_ratio(*found) for found in (sums[0], sums.sum(0)))
    return trained, whole


def _ratio(error: float, truth: float) -> float:
    """With four digits. Where the truth is silent: 0 for silence, else infinite."""
    return float(f"{error / truth:.4g}") if truth else 0.0 if error == 0 else math.inf


def _row(
    plan: BatchPlan, instrument: Instrument, preset_rate_hz: int, pluck: Pluck, source: Source, message: str = ""
) -> BatchRow:
    rate_hz = plan.settings.rate_hz or preset_rate_hz
    name = default_file_name(instrument.name, pluck, rate_hz, source)
    return BatchRow(
        name,
        "failed",
        instrument.preset.stem,
        pluck.position,
        pluck.amplitude_mm,
        source,
        rate_hz,
        message=message,
        string=instrument.string.name if instrument.string else "",
    )


__all__ = ["INDEX", "BatchPlan", "BatchRow", "NamedString", "run_batch"]
