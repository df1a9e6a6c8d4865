"""Several presets on one pluck: errors, what an ear finds, null depth of the sound, speed and size."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.presets.library import PresetEntry
from app.rendering.line import BLOCK_FRAMES
from app.rendering.note_sound import NoteSound
from app.shared.worker import Cancelled, Job
from engine.compare.relative import NULL_FLOOR_DB, ErrorSums
from engine.plain_text import one_line
from engine.presets import Preset, PresetInfo
from engine.resonators.sine_transform import listening_weights, project, synthesis_matrix, to_modes
from engine.sources import ModelSource, Runaway, StringSource, TruthSource
from training.heard_words import heard_sentence, heard_word

Floats = NDArray[np.floating]
_Truths = dict[tuple[object, ...], Floats]  # amplitudes (frames, modes) in m, by string, rate, modes and grid points
FRAMES_AT_ONCE = BLOCK_FRAMES  # as the window renders
WARM_UP_FRAMES = 64  # rendered before time is taken, so that compilation and caches do not count


@dataclass(frozen=True, order=True)
class Audible:
    """The difference of a sound from the truth's that an ear finds; sorts by the distance of the spectra.

    Attributes:
        distance_db: see `AudibleErrors`.
        word: the worst fault; `sentence`: all of them.
    """

    distance_db: float
    word: str
    sentence: str

    def __str__(self) -> str:
        return self.word


@dataclass(frozen=True)
class ComparedRow:
    """The figures of a preset; None: no such figure, or not yet.

    Attributes:
        mse, mae: relative, over the whole string and the trained horizon.
        past_mse, past_mae: of all that comes after it; infinite where the output ran away.
        heard: the audible difference from the truth at the first listening point, through the pick-up; None also of a
            pluck that is too short for it.
        null_db: null depth of the displacement at the listening point over the whole pluck: the level of model minus
            truth relative to the truth's.
        real_time: seconds of motion of the whole string that one core renders in a second.
        note: why there are no figures, or a remark on them.
        sound: the pluck that they are of; None: no figures, or of an earlier pluck.
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
    heard: Audible | None = None
    null_db: float | None = None
    real_time: float | None = None
    note: str = ""
    sound: NoteSound | None = None

    @classmethod
    def of(cls, entry: PresetEntry) -> ComparedRow:
        """A row with what is known without computing."""
        return cls(entry.name, entry.path.name, entry.title, entry.info.model, entry.info.rate_hz, entry.parameters)

    @property
    def figures(self) -> dict[str, Any]:
        """The figures by the names that files have for them."""
        heard = self.heard
        return {
            "preset": self.name,
            "title": self.title,
            "model": self.model,
            "rate_hz": self.rate_hz,
            "rel_mae": self.mae,
            "past_rel_mae": self.past_mae,
            "heard": None if heard is None else str(heard),
            "distance_db": None if heard is None else heard.distance_db,
            "rel_mse": self.mse,
            "past_rel_mse": self.past_mse,
            "null_db": self.null_db,
            "real_time": self.real_time,
            "parameters": self.parameters,
            "note": one_line(self.note),
        }


def compare(sounds: list[tuple[PresetEntry, NoteSound]], job: Job) -> None:
    """Report a `ComparedRow` for each preset, one after the other. A preset that fails has a row that says why.

    Args:
        sounds: one pluck, of a string of each preset.
    """
    truths: _Truths = {}
    for done, (entry, sound) in enumerate(sounds):
        try:
            row = _compare_one(entry, sound, truths, done / len(sounds), 1 / len(sounds), job)
        except Cancelled:
            raise
        except Exception as error:  # the other presets are still compared
            row = replace(ComparedRow.of(entry), sound=sound, note=str(error) or type(error).__name__)
        job.report((done + 1) / len(sounds), so_far=row)


def same_string(info: PresetInfo, other: PresetInfo) -> bool:
    """Return True if two presets have learned the same string, at any rate."""
    return (info.string, info.tension_modulated) == (other.string, other.tension_modulated)


def _true_amplitudes(truths: _Truths, plucked: NoteSound, info: PresetInfo, job: Job) -> Floats:
    """The true motion, float32 (frames, modes) in m, of the frames after the first; once for each string and rate."""
    key = (info.string, info.tension_modulated, info.rate_hz, info.modes, info.grid_points)
    if key not in truths:
        blocks = _frames(TruthSource(info), plucked, info, job)
        truths[key] = np.concatenate([to_modes(block[0], info.modes).astype(np.float32) for block, _ in blocks])
    return truths[key]


def _compare_one(
    entry: PresetEntry, plucked: NoteSound, truths: _Truths, before: float, share: float, job: Job
) -> ComparedRow:
    """Render one preset's model, compare it with the truth, and return its row.

    Where the model runs away, the frames from there on count as infinitely wrong, and a note gives the time.

    Args:
        entry: the preset, as the library lists it.
        plucked: the pluck, on the string of this preset.
        truths: the true motions computed so far; the one of this string is added where it is missing.
        before: the share of the whole comparison, 0 … 1, that was done before this preset.
        share: the share of the whole comparison that this preset takes.

    Raises:
        Cancelled: the job was cancelled.
    """
    preset = plucked.load()
    info = preset.info
    source = ModelSource(preset)
    share /= 2  # for the motion; `_audible` takes the other half
    job.check()
    true = _true_amplitudes(truths, plucked, info, job)
    synthesis = synthesis_matrix(info.grid_points, info.modes).astype(np.float32)
    ear = listening_weights(np.array(plucked.ear.points[:1]), info.grid_points).astype(np.float32)
    steps = len(true)
    string, sound = ErrorSums(steps), ErrorSums(steps)  # of the whole string; of its first listening point
    first = 0  # frames done
    work_s = 0.0  # processor seconds that the model took for them
    note = ""
    try:
        source.advance(source.start(_initial(plucked, info)), WARM_UP_FRAMES)
        for predicted, spent_s in _frames(source, plucked, info, job):
            block = (true[first : first + predicted.shape[1]] @ synthesis)[None]  # the truth's, as `predicted`
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
        sound=plucked,
        mse=windows[0].rel_mse,
        mae=windows[0].rel_mae,
        past_mse=past.rel_mse if past else None,
        past_mae=past.rel_mae if past else None,
        heard=_audible(preset, plucked, before + share, share, job),
        null_db=None if null_db == NULL_FLOOR_DB and plucked.pluck.amplitude_mm == 0 else null_db,
        real_time=first / info.rate_hz / work_s if work_s > 0 else None,
        note=note,
    )


def _audible(preset: Preset, plucked: NoteSound, before: float, share: float, job: Job) -> Audible | None:
    """The audible difference of a preset's model from the truth; None where the pluck is too short to be judged.

    Args:
        before, share: of the whole comparison, 0 … 1: what was done before, and what this takes.
    """
    from training.heard import listen_to  # and SciPy, 60 MB which a window need not have

    with suppress(ValueError):
        heard = listen_to(
            preset, lambda done: job.report(before + share * done), [plucked.pluck], plucked.ear, plucked.seconds
        )
        return Audible(heard.distance_db, heard_word(heard), heard_sentence(heard, heard.name))
    return None


def _frames(source: StringSource, plucked: NoteSound, info: PresetInfo, job: Job) -> Iterator[tuple[Floats, float]]:
    """Blocks of a pluck's motion, (1, frames, grid_points) in m, and the processor seconds that each took."""
    state = source.start(_initial(plucked, info))
    steps = max(1, round(plucked.seconds * info.rate_hz))
    for first in range(0, steps, FRAMES_AT_ONCE):
        started_s = time.thread_time()  # of this thread alone
        block, state = source.advance(state, min(FRAMES_AT_ONCE, steps - first))
        yield block, time.thread_time() - started_s
        job.check()


def _initial(plucked: NoteSound, info: PresetInfo) -> NDArray[np.float64]:
    """The displacement at the release, (1, grid_points) in m, made of the preset's modes alone."""
    return project(plucked.pluck.displacement(info.grid_points), info.modes)[None]
