"""A long session: the app is played by keys without a pause, and its sound is looked at for holes, itself weighed.

One instrument is played, or all of the factory in turn, each chosen in the window's browser.
"""

from __future__ import annotations

import math
import re
import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from random import Random
from typing import Any

import numpy as np

from app.audio.choices import Buffer
from app.instruments.instrument import Instrument
from app.window.settings import load_settings
from bench.play import analysis, hands
from bench.play.measure import DECAY_PATIENCE_S, SILENCE_S, STOP
from bench.play.program import Program, program
from bench.play.recording import CardClock
from bench.play.sound_server import RATE_HZ
from bench.printing import target
from training.cli.console import ProgressReport

RATE_OF_PLAYING_HZ = 12.0
PART_S = 60.0  # of one instrument alone
WEIGHED_S = 10  # at the end of a part: garbage comes and goes
CHOSEN_PATIENCE_S = 20.0
SAID_LINES = 20


@dataclass(frozen=True)
class Part:
    """A minute of one instrument, or its share of a session of many.

    Attributes:
        holes: silences of a millisecond or more while strings ring.
        peak_db: of the sound, re full scale.
        control_holes: of a steady tone that another process plays meanwhile in the same way.
        memory_mib: resident memory, the median of the last seconds.
    """

    instrument: str
    keys: int
    holes: int
    holes_ms: float
    peak_db: float
    control_holes: int
    memory_mib: float


@dataclass(frozen=True)
class Soak:
    """The figures of the whole session.

    Attributes:
        drift_mib: the largest distance of memory from the first part's, of parts of the same instrument.
        cores: processor time per second.
        said: the last lines that the program printed.
        faults: exceptions among them, and whether the program ended by itself.
    """

    seconds: float
    keys: int
    holes: int = field(metadata=target(0))
    control_holes: int
    drift_mib: float = field(metadata=target(20))
    cores: float
    said: tuple[str, ...]
    faults: int = field(metadata=target(0))


@dataclass(frozen=True)
class _Played:
    """A part when it was played: its keys, by `time.monotonic`, and the memory after it."""

    instrument: Instrument
    keys_s: list[float]
    memory_mib: float


def measure(
    seconds: float, seed: int, buffer: Buffer, instruments: Sequence[Instrument], report: ProgressReport
) -> dict[str, Any]:
    """Play for so long; each of several instruments for its share of the time."""
    part_s = min(PART_S, seconds / 2) if len(instruments) == 1 else seconds / len(instruments)
    parts = list(instruments) if len(instruments) > 1 else list(instruments) * round(seconds / part_s)
    random, played = Random(seed), []
    with program(instruments[0], buffer, report) as app:
        began_s, before_processor_s = time.monotonic(), app.processor_s()
        for number, instrument in enumerate(parts):
            if not app.alive:
                break
            report(number / len(parts), instrument.name)
            if number and instrument is not parts[number - 1]:
                _choose(app, instrument)
            played.append(_play(app, instrument, random, part_s))
        time.sleep(analysis.SOUNDS_S)
        alive, taken_s = app.alive, max(0.0, app.processor_s() - before_processor_s)
        cores = taken_s / (time.monotonic() - began_s)
        said = app.printed.read_text("utf-8", errors="replace").splitlines()
        clocks = app.recorded.clock(), app.control.clock()
        found = tuple(_judged(app, each, *clocks) for each in played)
    memory_mib = [each.memory_mib for each in found if each.instrument == found[0].instrument]
    soak = Soak(
        seconds=played[-1].keys_s[-1] - began_s,
        keys=sum(each.keys for each in found),
        holes=sum(each.holes for each in found),
        control_holes=sum(each.control_holes for each in found),
        drift_mib=max(abs(mib - memory_mib[0]) for mib in memory_mib),
        cores=cores,
        said=tuple(said[-SAID_LINES:]),
        faults=sum(line.startswith("Traceback") for line in said) + (not alive),
    )
    return {"parts": found, "soak": soak}


def _play(app: Program, instrument: Instrument, random: Random, seconds: float) -> _Played:
    keys_s, weights_mib = [], []
    for _ in range(max(1, round(seconds))):
        steps_s = hands.steady(random, RATE_OF_PLAYING_HZ, min(1.0, seconds))
        keys_s += hands.play(app.screen, random, steps_s, hands.keys_of(instrument))
        weights_mib.append(app.resident_mib())
    return _Played(instrument, keys_s, statistics.median(weights_mib[-WEIGHED_S:]))


def _choose(app: Program, instrument: Instrument) -> None:
    """Choose an instrument in the browser by its name, and the octave in which most of its keys sound."""
    if not app.recorded.wait_for_silence(SILENCE_S, 2 * SILENCE_S):
        hands.tap(app.screen, STOP)  # which in silence would pluck
        app.recorded.wait_for_silence(SILENCE_S, DECAY_PATIENCE_S)
    app.screen.key("Control_L", True)
    hands.press(app.screen, "i")
    app.screen.key("Control_L", False)
    time.sleep(0.3)
    for letter in re.sub(r"[^a-z0-9]+", " ", instrument.name.lower()):
        hands.press(app.screen, "space" if letter == " " else letter)
    time.sleep(0.2)
    hands.press(app.screen, "Return")
    octave, wanted = _octave_of_chosen(app, instrument), hands.octave_of(instrument)
    for _ in range(abs(wanted - octave)):
        hands.press(app.screen, hands.OCTAVE_UP if wanted > octave else hands.OCTAVE_DOWN)
    app.try_keys(hands.keys_of(instrument)[0])


def _octave_of_chosen(app: Program, instrument: Instrument) -> int:
    """The octave of the computer's keys, as soon as the settings file has the instrument."""
    deadline_s = time.monotonic() + CHOSEN_PATIENCE_S
    while time.monotonic() < deadline_s and app.alive:
        settings = load_settings(app.settings)[0]
        chosen = None if settings is None else settings.choices.instrument
        if settings is not None and chosen is not None and chosen.name == instrument.name:
            return settings.choices.octave
        time.sleep(0.1)
    raise RuntimeError(f"{instrument.name} could not be chosen in the window's browser")


def _judged(app: Program, played: _Played, clock: CardClock, tone_clock: CardClock) -> Part:
    begin, end = clock.frame(played.keys_s[0]), clock.frame(played.keys_s[-1] + analysis.SOUNDS_S)
    sound, keys = app.recorded.sound()[begin:end], [clock.frame(key_s) - begin for key_s in played.keys_s]
    holes = analysis.holes(sound, analysis.expected_sound(sound, keys, RATE_HZ), RATE_HZ)
    tone = app.control.sound()[tone_clock.frame(played.keys_s[0]) : tone_clock.frame(played.keys_s[-1])]
    return Part(
        played.instrument.name,
        len(keys),
        len(holes),
        sum(1000 * hole.frames / RATE_HZ for hole in holes),
        20 * math.log10(max(float(np.abs(sound).max(initial=0)), 1e-9)),
        len(analysis.tone_holes(tone, RATE_HZ)),
        played.memory_mib,
    )
