"""Checkpoints of a fit: its poles and glides after so many steps, as JSON that is checked when it is read.

A fit has no random numbers and computes its residuals again in each step. So these values are all that a
continuation with the same result, bit for bit, needs (same machine, same libraries).
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from engine import bounds
from engine.schema import SchemaError, parse_json, read, write
from engine.whole_file import UnusableFile, WriteError, explain, read_bounded, result_file
from training.recording.glide import TIMES_S, Glide
from training.recording.note import Note
from training.recording.numbering import PartialSeries
from training.recording.refine import Fit, Pole
from training.recording.sweeps import Takes

VERSION = 1  # of the steps of a fit: a checkpoint of other steps is not continued


@dataclass(frozen=True)
class PoleState:
    """A pole s and its amplitude a, as `Pole`; partial 0: it does not glide."""

    partial: int
    real: float
    imaginary: float
    amplitude_real: float
    amplitude_imaginary: float


@dataclass(frozen=True)
class TakeState:
    """The part of the state that one take has of its own; `glide` and `pitch` as in `Glide`."""

    glide: tuple[float, ...]
    pitch: float
    poles: tuple[PoleState, ...]

    def __post_init__(self) -> None:
        if len(self.glide) != len(TIMES_S):
            raise ValueError(f"glide must have {len(TIMES_S)} values")


@dataclass(frozen=True)
class State:
    """A fit between two steps.

    Attributes:
        steps: of the fit that are done, see `fit_takes`.
        damping, free_damping, rests: as in `Takes`.
    """

    steps: int
    damping: tuple[float, ...]
    rests: tuple[int, ...]
    free_damping: float
    takes: tuple[TakeState, ...]


def checkpoint_of(folder: Path, notes: Sequence[tuple[Note, PartialSeries]]) -> Path:
    """The file of a fit of these notes: its name is a digest of all that the fit depends on."""
    digest = hashlib.sha256(json.dumps(VERSION).encode())
    for note, series in notes:
        numbers = [note.rate_hz, note.onset, series.f0_hz, series.stiffness, list(series.present)]
        digest.update(json.dumps(numbers).encode())
        digest.update(np.ascontiguousarray(note.samples).tobytes())
    return folder / f"{digest.hexdigest()[:32]}.json"


def save(path: Path, takes: Takes, steps: int) -> None:
    """Write whole or not at all. Raises WriteError."""
    damping, rests = tuple(takes.damping.tolist()), tuple(takes.rests.tolist())
    state = State(steps, damping, rests, float(takes.free_damping), tuple(map(_take, takes.fits)))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise WriteError(explain(path.parent, error)) from error
    with result_file(path) as file:
        file.write(json.dumps(write(state)).encode())


def restore(path: Path, takes: Takes, steps: int) -> int:
    """Set the takes to a checkpoint; return how many of all `steps` are done, 0 where there is no file.

    Raises:
        SchemaError: the file is damaged; the message names it and the remedy.
        OSError: it cannot be read.
    """
    if not path.exists():
        return 0
    try:
        text = read_bounded(path, bounds.LARGEST_TEXT_BYTES)
        state = read(State, parse_json(text, "checkpoint"), "checkpoint")
        bands = len(takes.damping)
        bounds.check("steps", state.steps, (1, steps))
        if len(state.takes) != len(takes.fits) or {len(state.damping), len(state.rests)} != {bands}:
            raise SchemaError("takes, damping and rests do not fit the recording")
        for take in state.takes:
            for pole in take.poles:
                bounds.check("partial", pole.partial, (0, bands))
    except (UnusableFile, ValueError) as error:
        raise SchemaError(f"{path}: damaged checkpoint ({error}); delete it to start again") from error
    takes.damping, takes.rests = np.array(state.damping), np.array(state.rests, int)
    takes.free_damping = state.free_damping
    for fit, take in zip(takes.fits, state.takes, strict=True):
        fit.poles = [[] for _ in range(bands + 1)]
        for p in take.poles:
            s, a = complex(p.real, p.imaginary), complex(p.amplitude_real, p.amplitude_imaginary)
            fit.poles[p.partial - 1].append(Pole(s, a, p.partial))  # the last are free
        fit.set_glide(Glide(np.array(take.glide), take.pitch))
    return state.steps


def _take(fit: Fit) -> TakeState:
    poles = (
        PoleState(pole.partial, float(pole.s.real), float(pole.s.imag), float(pole.a.real), float(pole.a.imag))
        for pole in fit.every()
    )
    return TakeState(tuple(fit.glide.shares.tolist()), float(fit.glide.pitch), tuple(poles))
