"""Learning an instrument from recordings: its own file, its preset and its body, in the user's folders.

`learn_files` and `keep` are what the command calls, and what a dialog of the window calls in a worker's thread.
"""

from __future__ import annotations

import io
import json
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import soundfile
from numpy.typing import NDArray
from pydantic import TypeAdapter

from app.audio.note_file import read_note
from app.instruments.fields import Name
from app.instruments.instrument import BodyChoice, Category, Fretted, Instrument, Pickup, PluckChoices
from app.instruments.library import SHIPPED, SUFFIX, InstrumentError, file_stem, instrument_folders, save_instrument
from app.player.bodies import own_bodies
from app.player.learned_attack import attack_of, with_attack
from app.shared.user_files import make_folder
from engine.effects.responses import resampled
from engine.folders import usable_files, user_folder
from engine.kernels import velocities
from engine.presets import load_preset
from engine.schema import explained
from engine.whole_file import result_file
from training.recording.fit import FREE_POLES
from training.recording.learn import Learned, combined, examined, learn
from training.recording.note import FIT_BEGINS_S, FIT_LASTS_S, RecordingError
from training.recording.physics import Kind
from training.recording.preset import Source, body_response, listening_point, recorded_note, write_preset
from training.recording.table import as_data

CATEGORIES: dict[Kind, Category] = {"guitar": "guitar", "bass": "bass", "harp": "harp", "piano": "keys"}
REACH_KEYS = 12  # range of the instrument: an octave to both sides of the recorded note
BODY_RATE_HZ = 48_000
HARDEST = 1.5  # amplitude of velocity 127, over that of the recorded pluck
RECORDED_VELOCITY = 100
_NAME: TypeAdapter[str] = TypeAdapter(Name)


@dataclass(frozen=True)
class Kept:
    """The files of a learned instrument."""

    preset: Path
    instrument: Path
    body: Path
    report: Path


def learn_files(
    paths: Sequence[Path],
    *,
    kind: Kind = "guitar",
    length_m: float | None = None,
    gauge_mm: float | None = None,
    anyway: bool = False,
    progress: Callable[[float], None] = lambda share: None,
) -> list[Learned]:
    """Learn recordings; the first is the note that gives the string, and those of its pitch are fitted together.

    Args:
        progress: is called with the share that is done; may raise, to cancel. The same call continues later from a
            checkpoint in `unfinished_folder`, with the same result.

    Raises:
        NoteFileError, RecordingError: a file cannot be learned from; the message names it and the remedy.
        SchemaError: a checkpoint is damaged; the message names it.
        WriteError, OSError: a checkpoint cannot be written or read.
    """
    notes = []
    for number, path in enumerate(paths):
        file = read_note(path)
        source = Source(path.name, file.digest, file.rate_hz, len(file.samples))
        try:
            notes.append((examined(file.samples, file.rate_hz), source))
        except RecordingError as error:
            raise RecordingError(f"{path}: {error}") from error
        progress(0.05 * (number + 1) / len(paths))
    return learn(
        notes,
        kind=kind,
        length_m=length_m,
        gauge_mm=gauge_mm,
        anyway=anyway,
        progress=lambda share: progress(0.05 + 0.95 * share),
        checkpoints=unfinished_folder(),
    )


def unfinished_folder() -> Path:
    """The folder of checkpoints of recordings that are being learned; they are deleted at the end."""
    return user_folder() / "unfinished"


@dataclass(frozen=True)
class Reasons:
    """Reasons against a recording, in words with the remedy; a refusal says that no string can be fitted to it."""

    refusals: list[str]
    warnings: list[str]


def reasons_against(path: Path) -> Reasons:
    """List the reasons against a file as a note of a string; empty lists: there are none.

    Raises:
        NoteFileError, RecordingError: nothing can be learned from it in any case.
    """
    file = read_note(path)
    words: dict[bool, list[str]] = {True: [], False: []}  # by whether the reason is a refusal
    for finding in examined(file.samples, file.rate_hz).findings:
        words[finding.refused].append(f"{finding.reason}: {finding.remedy}")
    return Reasons(words[True], words[False])


def both_sounds(learned: Learned, rate_hz: int) -> dict[str, NDArray[np.float32]]:
    """Recording and learned note, (frames, 1) each at a rate, ±1 being full scale, as `--as-recorded` renders it.

    One gain for both: the recording peaks at -6 dBFS.
    """
    recording = resampled(learned.note.samples[:, None], learned.note.rate_hz, rate_hz)[:, 0]
    note = recorded_note(learned.note, learned.fitted, learned.source).sound(rate_hz)
    frames = min(len(recording), len(note))
    gain = 0.5 / max(float(np.abs(recording).max()), 1e-9)
    return {
        name: np.ascontiguousarray(gain * sound[:frames, None], np.float32)
        for name, sound in (("recording", recording), ("learned", note))
    }


def check_name(name: str) -> str:
    """The stem of an instrument's files. Raises InstrumentError: the name is impossible, or a file is there."""
    try:
        stem = file_stem(_NAME.validate_python(name))
    except ValueError as error:
        raise InstrumentError(f"the name: {explained(error)}") from error
    if (SHIPPED / f"{stem}{SUFFIX}").exists():
        raise InstrumentError(f"{name}: a factory instrument has this name; choose another")
    if stem in {path.stem for path in usable_files()}:
        raise InstrumentError(f"{name}: a preset of this name exists already; choose another")
    instruments = [folder / f"{stem}{SUFFIX}" for folder in instrument_folders()]
    for path in (*instruments, own_bodies() / f"{stem}.wav"):
        if path.exists():
            raise InstrumentError(f"{path}: exists already; choose another name, or remove it")
    return stem


def keep(name: str, learned: Sequence[Learned], kind: Kind = "guitar") -> Kept:
    """Write preset, body, instrument and report of a string; where one fails, none is left.

    Raises:
        InstrumentError: the name is taken or impossible.
        WriteError, OSError: a file cannot be written.
    """
    stem, first = check_name(name), learned[0]
    settings: dict[str, Any] = {
        "free_poles": FREE_POLES,
        "begins_s": FIT_BEGINS_S,
        "seconds": FIT_LASTS_S,
        "recordings": [recording.source.digest for recording in learned],
    }
    recorded = combined(learned, settings)
    instrument = _instrument(name, stem, first, len(recorded.cents), kind)
    body = own_bodies() / f"{stem}.wav"
    preset = user_folder() / f"{stem}.safetensors"
    report = user_folder() / f"{stem}.report.json"
    make_folder(body.parent)
    response = body_response(first.physics, first.strung, len(recorded.cents), BODY_RATE_HZ)
    encoded = io.BytesIO()  # libsndfile cannot pass on the error of a full disk
    soundfile.write(encoded, 0.9 * response, BODY_RATE_HZ, subtype="PCM_24", format="WAV")
    with _all_or_none(body, preset, report):
        with result_file(body) as file:
            file.write(encoded.getvalue())
        attack = attack_of(instrument, first.note, recorded.note)  # through the body
        if attack is not None:
            recorded = replace(recorded, attack=attack[0])
        write_preset(preset, name, first.strung, recorded)
        if attack is not None:
            instrument = with_attack(instrument, load_preset(preset), first.note, first.physics.f0_hz, attack[1])
        with result_file(report) as file:
            file.write(json.dumps([as_data(recording) for recording in learned], indent=2).encode())
        return Kept(preset, save_instrument(instrument).path, body, report)


@contextmanager
def _all_or_none(*paths: Path) -> Iterator[None]:
    """Remove new files where what is done within the context fails."""
    try:
        yield
    except BaseException:
        for path in paths:
            with suppress(OSError):
                path.unlink()
        raise


def _instrument(name: str, stem: str, learned: Learned, partials: int, kind: Kind) -> Instrument:
    """The instrument of a learned string, which plays the recorded pluck at RECORDED_VELOCITY.

    Args:
        stem: the name of its preset and its body.
        partials: how many were learned, for the listening point.

    Raises:
        InstrumentError: a learned value is out of the bounds of instruments.
    """
    key = round(69 + 12 * math.log2(learned.physics.f0_hz / 440))
    amplitude_mm = 1000 * learned.strung.amplitude_m
    hardest_mm = min(10.0, HARDEST * amplitude_mm)
    share = velocities.share(RECORDED_VELOCITY, 0.0)
    softest_mm = (amplitude_mm / hardest_mm**share) ** (1 / (1 - share))
    try:
        return Instrument(
            name=name,
            category=CATEGORIES[kind],
            description=f"Learned from a recording of {learned.physics.f0_hz:.1f} Hz.",
            preset=stem,
            strings=Fretted(string=learned.strung.string),
            range=(max(0, key - REACH_KEYS), min(127, key + REACH_KEYS)),
            pluck=PluckChoices(
                shape="triangular",
                position=learned.strung.position,
                softest_mm=max(0.01, softest_mm),
                hardest_mm=hardest_mm,
            ),
            pickup=Pickup(points=(listening_point(partials),)),
            body=BodyChoice(name=stem, mix=1.0, size=1.0),
        )
    except ValueError as error:
        raise InstrumentError(f"{name}: {explained(error)}") from error
