"""Several presets on one pluck: errors, null depth of the sound, speed and size."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.presets.library import PresetEntry
from app.rendering.line import BLOCK_FRAMES
from app.rendering.subject import StringOf, load_subject
from app.shared.worker import Cancelled, Job
from engine.compare.relative import NULL_FLOOR_DB, ErrorSums
from engine.pluck import Pluck
from engine.presets import PresetInfo
from engine.resonators.sine_transform import listening_weights, project, synthesis_matrix, to_modes
from engine.sources import ModelSource, Runaway, StringSource, TruthSource
from engine.values.string import StringParameters

Floats = NDArray[np.floating]
FRAMES_AT_ONCE = BLOCK_FRAMES  # as the window renders
WARM_UP_FRAMES = 64  # rendered before time is taken, so that compilation and caches do not count


@dataclass(frozen=True)
class ComparedRow:
    """The figures of a preset; None: no such figure, or not yet.

    Attributes:
        mse, mae: relative, over the whole string and the trained horizon.
        past_mse, past_mae: of all that comes after it; infinite where the output ran away.
        null_db: null depth at the listening point over the whole pluck: the level of model minus truth relative to
            the truth's.
        real_time: seconds of motion of the whole string that one core renders in a second.
        note: why there are no figures, or a remark on them.
    """

    name: str
    file: str
    title: str
    model: str
    rate_hz: int
    parameters: int
    mse: float | None = None
    mae: float | None = None
    past_mse: float | None = None
    past_mae: float | None = None
    null_db: float | None = None
    real_time: float | None = None
    note: str = ""

    @classmethod
    def of(cls, entry: PresetEntry) -> ComparedRow:
        """A row with what is known without computing."""
        return cls(entry.name, entry.path.name, entry.title, entry.info.model, entry.info.rate_hz, entry.parameters)


@dataclass(frozen=True)
class Basis:
    """The conditions that the presets are compared on.

    Attributes:
        listen: the listening point, 0 … 1.
        string: which string presets of many strings are plucked as; None: their own.
    """

    pluck: Pluck
    seconds: float
    listen: float
    string: StringParameters | None = None


def compare(entries: list[PresetEntry], basis: Basis, job: Job) -> None:
    """Report a `ComparedRow` for each preset, one after the other. A preset that fails has a row that says why."""
    truths = _Truths(basis)
    for done, entry in enumerate(entries):
        try:
            row = _compare_one(entry, basis, truths, done / len(entries), 1 / len(entries), job)
        except Cancelled:
            raise
        except Exception as error:  # the other presets are still compared
            row = replace(ComparedRow.of(entry), note=str(error) or type(error).__name__)
        job.report((done + 1) / len(entries), so_far=row)


def same_string(info: PresetInfo, other: PresetInfo) -> bool:
    """Return True if two presets have learned the same string, at any rate."""
    return (info.string, info.tension_modulated) == (other.string, other.tension_modulated)


class _Truths:
    """The true motion of the pluck as modal amplitudes, once for each string and rate."""

    def __init__(self, basis: Basis) -> None:
        self._basis = basis
        self._known: dict[tuple[object, ...], Floats] = {}

    def amplitudes(self, info: PresetInfo, job: Job) -> Floats:
        """Return the amplitudes, float32 (frames, modes) in m, of the frames after the first."""
        key = (info.string, info.tension_modulated, info.rate_hz, info.modes, info.grid_points)
        if key not in self._known:
            blocks = []
            for block, _ in _frames(TruthSource(info), self._basis, info, job):
                blocks.append(to_modes(block[0], info.modes).astype(np.float32))
            self._known[key] = np.concatenate(blocks)
        return self._known[key]


def _compare_one(
    entry: PresetEntry, basis: Basis, truths: _Truths, before: float, share: float, job: Job
) -> ComparedRow:
    preset = load_subject(entry.path if basis.string is None else StringOf(entry.path, basis.string))
    info = preset.info
    source = ModelSource(preset)
    job.check()
    true = truths.amplitudes(info, job)
    synthesis = synthesis_matrix(info.grid_points, info.modes).astype(np.float32)
    ear = listening_weights(np.array([basis.listen]), info.grid_points).astype(np.float32)
    steps = len(true)
    string, sound = ErrorSums(steps), ErrorSums(steps)
    first = 0
    work_s = 0.0
    note = ""
    try:
        source.advance(source.start(_initial(basis, info)), WARM_UP_FRAMES)
        for predicted, spent_s in _frames(source, basis, info, job):
            block = (true[first : first + predicted.shape[1]] @ synthesis)[None]
            predicted = predicted.astype(np.float32)
            string.add(predicted, block, first)
            sound.add(predicted @ ear, block @ ear, first)
            first, work_s = first + predicted.shape[1], work_s + spent_s
            job.report(before + share * first / steps)
    except Runaway as error:
        note = f"diverges {error.time_s:.2f} s after the pluck"
        for start in range(first, steps, FRAMES_AT_ONCE):
            block = (true[start : start + FRAMES_AT_ONCE] @ synthesis)[None]
            string.add(np.full_like(block, np.nan), block, start)
            sound.add(np.full_like(block @ ear, np.nan), block @ ear, start)
    end_s = max(steps / info.rate_hz, info.horizon_s)
    windows = string.windows(info.rate_hz, (0.0, info.horizon_s, end_s))
    past = windows[1] if len(windows) > 1 else None
    null_db = sound.total().null_depth_db
    return replace(
        ComparedRow.of(entry),
        mse=windows[0].rel_mse,
        mae=windows[0].rel_mae,
        past_mse=past.rel_mse if past else None,
        past_mae=past.rel_mae if past else None,
        null_db=None if null_db == NULL_FLOOR_DB and basis.pluck.amplitude_mm == 0 else null_db,
        real_time=first / info.rate_hz / work_s if work_s > 0 else None,
        note=note,
    )


def _frames(source: StringSource, basis: Basis, info: PresetInfo, job: Job) -> Iterator[tuple[Floats, float]]:
    """Blocks (1, frames, grid_points) in m, and the processor seconds that each took."""
    state = source.start(_initial(basis, info))
    steps = max(1, round(basis.seconds * info.rate_hz))
    for first in range(0, steps, FRAMES_AT_ONCE):
        started_s = time.thread_time()  # of this thread alone
        block, state = source.advance(state, min(FRAMES_AT_ONCE, steps - first))
        yield block, time.thread_time() - started_s
        job.check()


def _initial(basis: Basis, info: PresetInfo) -> NDArray[np.float64]:
    return project(basis.pluck.displacement(info.grid_points), info.modes)[None]
