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
from app.export.files import default_file_name, export_sounds, settings_of
from app.export.recipe import Recipe, RecipeError, read_recipe
from app.export.recording import blocks
from app.export.sound import SoundRequest, Voices
from app.export.wav import WavSettings
from app.shared.vocabulary import Pickup, Source
from app.shared.worker import Progress
from engine.pluck import Pluck
from engine.presets import Preset, PresetError, load_preset, of_string, outside_training
from engine.resonators.string import StringParameters
from engine.result_file import WriteError
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


def run_batch(plan: BatchPlan, progress: Progress = lambda *_: None) -> list[BatchRow]:
    """Renders the files and writes the index, in the plan's folder, which is made if needed.

    Where a preset or a pluck fails, its row says why, and the others are still rendered.

    Returns:
        A row for each file.

    Raises:
        Cancelled: `progress` raised it; whole files and their rows stay.
        WriteError: the folder or the index cannot be written.
    """
    try:
        plan.folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise WriteError(f"{plan.folder}: cannot be made ({error.strerror}); choose another folder") from error
    index = BatchIndex(plan.folder / INDEX)
    instruments, plucks = list(plan.instruments()), list(plan.plucks())
    rows: list[BatchRow] = []
    for number, instrument in enumerate(instruments):
        try:
            preset = plan.load(instrument)
            plan.request(preset, plan.pluck, plan.sources[0])
        except ValueError as error:
            message = f"{instrument.string.name}: {error}" if instrument.string else str(error)
            rows += [_row(plan, instrument, 0, pluck, s, message) for pluck in plucks for s in plan.sources]
            index.add(rows)
            continue
        for place, pluck in enumerate(plucks):
            done = number * len(plucks) + place
            text = f"{instrument.name}, position {pluck.position:g}, {pluck.amplitude_mm:g} mm"

            def part(share: float, *_: object, done: int = done, text: str = text) -> None:
                progress((done + share) / (len(instruments) * len(plucks)), text)

            part(0.0)
            made, sources = [], []
            for source in plan.sources:
                row = None if plan.overwrite else _kept(plan, instrument, preset, pluck, source, index)
                made += [row] if row else []
                sources += [] if row else [source]
            if sources:
                made += _rendered(plan, instrument, preset, pluck, sources, part)
            index.add(made)
            rows += made
    return rows


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


def _rendered(
    plan: BatchPlan, instrument: Instrument, preset: Preset, pluck: Pluck, sources: list[Source], progress: Progress
) -> list[BatchRow]:
    blank = {source: _row(plan, instrument, preset.info.rate_hz, pluck, source) for source in sources}
    paths = {source: plan.folder / row.file for source, row in blank.items()}
    request = plan.request(preset, pluck, sources[0])
    try:
        reports, voices = export_sounds(request, paths, plan.settings, measured=True, progress=progress)
    except Runaway as error:
        failed = [replace(row, message=str(error)) for source, row in blank.items() if source != "truth"]
        if "truth" not in blank:
            return failed
        return [*failed, *_rendered(plan, instrument, preset, pluck, ["truth"], progress)]
    except (PresetError, WriteError) as error:
        return [replace(row, message=str(error)) for row in blank.values()]
    words = outside_training(preset.info, pluck) if preset.info.family else []
    warning = f"warning: {instrument.name}: {'; '.join(words)}" if words else ""
    errors = _errors(preset, voices)
    return [
        replace(
            blank[source],
            status="written",
            seconds=report.seconds,
            peak_db=round(report.peak_db, 2),
            clipped=report.clipped,
            rel_mae_trained=None if source == "truth" else errors[0],
            rel_mae=None if source == "truth" else errors[1],
            message="" if source == "truth" else warning,
        )
        for source, report in zip(blank, reports, strict=True)
    ]


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
