"""The partials of a take, mode by mode, as rows of a table. A note says why a row has no figures."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from app.rendering import Take
from app.shared.worker import Job
from engine.compare.partials import (
    LEAST_SEGMENTS,
    MOST_SIMILAR,
    PartialErrors,
    PartialTrack,
    partial_errors,
    segment_frames,
    track_partials,
    true_phasors,
)
from engine.pluck import Pluck
from engine.resonators.base import Array
from engine.resonators.sine_transform import analysis_matrix, project, to_modes

FRAMES_AT_ONCE = 2000
WINDOWS = {"trained": "as trained", "past": "past it", "all": "all of it"}  # parts of a take, with their words


@dataclass(frozen=True)
class PartialRow:
    """A mode in a window. None: there is no such figure. Differences are the model's minus the truth's.

    Attributes:
        mode: from 1.
        cents: of the frequencies.
        level_db: of the levels.
        note: why the row is grey, in a few words; empty for a mode that can be heard and compared.
    """

    mode: int
    truth_hz: float | None
    model_hz: float | None
    cents: float | None
    truth_t60_s: float | None
    model_t60_s: float | None
    t60_error_percent: float | None
    level_db: float | None
    note: str


def take_partials(take: Take, job: Job) -> dict[str, list[PartialRow]]:
    """Rows by window (`WINDOWS`); a window of which the take has too little is left out.

    Model and truth are rendered again, mode by mode, because a take holds pictures and not every frame. The truth
    takes steps shorter than a frame, which its phasors need.

    Raises:
        Cancelled: the job was cancelled.
    """
    info = take.info
    last = round((take.seconds if take.model_ends_s is None else take.model_ends_s) * info.rate_hz)
    modes_hz = info.resonator.eigenvalues().imag / (2 * math.pi)
    length = segment_frames(info.rate_hz, modes_hz[0])  # frames of a segment
    if last < length:
        return {}
    block = max(1, FRAMES_AT_ONCE // length) * length
    tracks, first = [], 0  # of each block; frames done
    true = true_phasors(info.resonator, _initial(take.pluck, info.grid_points, info.modes), info.rate_hz, last, block)
    for truth, model in zip(true, _model_modes(take, last, block), strict=True):
        tracks.append(track_partials(model, truth, length))
        first += truth.shape[1]
        job.report(first / last)
    track = PartialTrack.join(tracks)
    end_s, seconds = (last + 1) / info.rate_hz, LEAST_SEGMENTS * length / info.rate_hz
    spans = {"trained": (0.0, min(info.horizon_s, end_s)), "past": (info.horizon_s, end_s), "all": (0.0, end_s)}
    spans = {name: span for name, span in spans.items() if span[1] - span[0] >= seconds}
    errors = partial_errors(track, info.rate_hz, modes_hz.tolist(), list(spans.values()))
    similar = (np.abs(track.square).sum(1) >= MOST_SIMILAR * track.power.sum(1))[0]
    rows: dict[str, list[PartialRow]] = {}
    for window, name in enumerate(spans):
        rows[name] = [
            _row(mode + 1, errors, window, _note(float(modes_hz[mode]), info.rate_hz, bool(similar[mode])))
            for mode in range(info.modes)
        ]
    return rows


def _model_modes(take: Take, steps: int, block: int) -> Iterator[Array]:
    """The model's modal amplitudes in m, (1, up to `block`, modes), of frames 1 … steps."""
    info, source = take.info, take.model
    if source is None or take.stride == 1:  # the take holds every frame
        motion = take.motions["model"]
        for first in range(1, steps + 1, block):
            frames = motion.read(first, min(first + block, steps + 1))
            yield to_modes(frames[None].astype(np.float64), info.modes)
        return
    analysis = analysis_matrix(info.grid_points, info.modes)
    state = source.start(project(take.pluck.displacement(info.grid_points), info.modes)[None])
    for first in range(0, steps, block):
        amplitudes, state = source.advance(state, min(block, steps - first), analysis)
        yield amplitudes.astype(np.float64)


def _row(mode: int, errors: PartialErrors, window: int, note: str) -> PartialRow:
    """The row of a mode, counted from 1, in a window of `errors`, counted from 0.

    `note`: of `_note`; where it is "", a mode that is hardly heard gets a note here.
    """
    truth_hz, level_db, cents, t60_s, t60_error_percent = (
        _figure(values[0, window, mode - 1])
        for values in (errors.frequency_hz, errors.level_db, errors.cents, errors.t60_s, errors.t60_error_percent)
    )
    if truth_hz is None and not note:
        note = "not heard: 60 dB below the loudest"
    elif level_db is not None and level_db < -60:
        note = note or "the model hardly excites it"
    model_hz = truth_hz * 2 ** (cents / 1200) if truth_hz is not None and cents is not None else None
    model_t60_s = t60_s * (1 + t60_error_percent / 100) if t60_s and t60_error_percent is not None else None
    return PartialRow(mode, truth_hz, model_hz, cents, t60_s, model_t60_s, t60_error_percent, level_db, note)


def _note(mode_hz: float, rate_hz: int, similar: bool) -> str:
    """The reason why a mode cannot be compared at its own frequency; "": there is none.

    `similar`: the truth's phasor of this mode keeps its phase up to the sign, as at half the sample rate.
    """
    if similar:
        return "not resolved: at half the sample rate"
    if mode_hz > rate_hz / 2:
        folded_hz = abs(mode_hz - rate_hz * round(mode_hz / rate_hz))
        return f"above half the sample rate: heard at {folded_hz:.0f} Hz"
    return ""


def _initial(pluck: Pluck, grid_points: int, modes: int) -> Array:
    """Modal amplitudes at the release, (1, modes) in m."""
    return to_modes(project(pluck.displacement(grid_points), modes)[None], modes)


def _figure(value: float) -> float | None:
    return None if np.isnan(value) else float(value)
