"""Listens to a preset: a few plucks as the app plays them, model and truth, well past the training."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from engine.bounds import LARGEST_AMPLITUDE_MM
from engine.compare.audible import FLOOR_DB, AudibleErrors, audible_errors, heard_level_db
from engine.pluck import DEFAULT_LISTEN, Pluck
from engine.presets import Preset, PresetInfo, load_preset, preset_digest
from engine.sources import ModelSource, Runaway
from engine.values.ear import Ear
from engine.voices import Program, model_program, render_voice, truth_program, voice_blocks
from engine.voices.voice import SILENT_DB
from training.heard_file import Heard, add_heard

RATE_HZ = 48_000  # of the device: what is above half the preset's rate is heard of the truth
AMPLITUDES_MM = (1.5, 4.0, 8.0)  # soft, normal, hard
LEAST_S, MOST_S = 4.0, 12.0  # that a pluck is listened to
UNTIL_DB = 60.0  # … or until the truth has fallen so far
HUM_S = 0.5  # before a voice ends: there its hum, what a model still sounds then, is measured
LONGEST_HUM_S = 300.0  # a voice that ends later is not measured so
EAR = Ear((DEFAULT_LISTEN,))
GLIDE_S = 0.25  # pitch is listened to from here on, and past the training


def standard_plucks(info: PresetInfo) -> list[Pluck]:
    """The app's own pluck, soft, normal and hard, as far as the preset was trained to be pulled."""
    return [Pluck(amplitude_mm=_bearable(info, amplitude_mm)) for amplitude_mm in AMPLITUDES_MM]


def listen_to(
    preset: Preset,
    report: Callable[[float], None] = lambda share: None,
    plucks: Sequence[Pluck] = (),
    ear: Ear = EAR,
    seconds: float | None = None,
) -> Heard:
    """The audible errors of a preset; of plucks that are given, without the hum at their end.

    Args:
        report: receives the share that is done, 0 … 1.
        plucks: empty: `standard_plucks`.
        ear: where and how they are listened to.
        seconds: how long, unless they have decayed before; None: twice the training, 4 s to 12 s.

    Raises:
        ValueError: its model cannot be released from rest, or a pluck is shorter than a frame of a spectrum.
        PresetError: its file cannot be read any more.
    """
    source, digest = ModelSource(preset), preset_digest(preset.path)
    info, standard = preset.info, not plucks
    programs = model_program(preset, RATE_HZ), truth_program(info, RATE_HZ)
    partials_hz = (info.resonator.omega / (2 * math.pi)).tolist()
    below_hz = [hz for hz in partials_hz if hz < info.rate_hz / 2]
    wanted_s = seconds or min(max(LEAST_S, 2 * info.horizon_s), MOST_S)
    plucks = plucks or standard_plucks(info)
    errors: list[AudibleErrors] = []
    runs_away_s: list[float] = []
    longest_s = 0.0

    def part_of(number: int) -> Callable[[float], None]:
        return lambda share: report((number + share) / (len(plucks) + standard))  # the last is the end of one

    for number, pluck in enumerate(plucks):
        truth = render_voice(programs[1], None, info, pluck, ear, wanted_s, until_db=UNTIL_DB)[:, 0]
        longest_s = max(longest_s, len(truth) / RATE_HZ)
        try:
            model = render_voice(programs[0], source, info, pluck, ear, len(truth) / RATE_HZ, part_of(number))[:, 0]
        except Runaway as error:
            runs_away_s.append(error.time_s)
        else:
            after_s = max(GLIDE_S, info.horizon_s)
            errors.append(audible_errors(model, truth, RATE_HZ, below_hz, after_s))
    hum_db = None
    if standard and not runs_away_s:
        hum_db = _hum_db(programs[0], source, info, plucks[len(plucks) // 2], ear, part_of(len(plucks)))
    report(1.0)
    splits = [e.split_cents for e in errors if e.split_cents is not None]
    return Heard(
        name=preset.name,
        sha256=digest,
        seconds=longest_s,
        distance_db=float(np.mean([*(e.distance_db for e in errors), *(FLOOR_DB for _ in runs_away_s)])),
        level_db=_median([e.level_db for e in errors]) or 0.0,
        rise_db=_median([e.rise_db for e in errors]) or 0.0,
        pitch_cents=_median([e.pitch_cents for e in errors if e.pitch_cents is not None]),
        split_cents=_median(splits) if 2 * len(splits) > len(errors) else None,
        runs_away_s=min(runs_away_s, default=None),
        hum_db=hum_db,
    )


def measure(path: Path, write: bool, report: Callable[[float], None] = lambda share: None) -> Heard:
    """The audible errors of a preset's file; `write`: add them to the table in its folder.

    Raises:
        PresetError, ValueError: the file cannot be used, or its model cannot start from a displaced string at rest.
        OSError: the table cannot be written.
    """
    row = listen_to(load_preset(path), report)
    if write:
        add_heard(path.parent, [row])
    return row


def _hum_db(
    program: Program, source: ModelSource, info: PresetInfo, pluck: Pluck, ear: Ear, advanced: Callable[[float], None]
) -> float | None:
    """The level of a model at the end of its voice, in dB of full scale.

    None: it is silent by then, runs away before, or ends too late to be measured.

    Args:
        advanced: receives the share that is rendered, 0 … 1.
    """
    if program.ends_s > LONGEST_HUM_S:
        return None
    frames, last = round(program.ends_s * program.rate_hz), round(HUM_S * program.rate_hz)
    kept = np.zeros(0, np.float32)
    try:
        for block in voice_blocks(program, source, info, pluck, ear, frames / program.rate_hz, advanced):
            kept = np.concatenate([kept, block[:, 0]])[-last:]
    except Runaway:
        return None
    level_db = heard_level_db(kept, program.rate_hz)
    return level_db if level_db > SILENT_DB else None


def _bearable(info: PresetInfo, amplitude_mm: float) -> float:
    """An amplitude of the app's own pluck within the trained range."""
    low_mm, high_mm = info.trained_amplitudes_mm(Pluck())
    return min(max(amplitude_mm, low_mm), high_mm, info.hardest_mm(Pluck()), LARGEST_AMPLITUDE_MM)


def _median(values: Sequence[float]) -> float | None:
    """The median; None: there are no values."""
    return statistics.median(values) if values else None
