"""The app played by keys: holes, clicks and latency of its sound, as the sound card receives it."""

from __future__ import annotations

import contextlib
import os
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from random import Random
from typing import Any

import numpy as np

from app.audio.choices import Buffer
from app.instruments.instrument import Instrument
from bench.play import analysis, hands
from bench.play.calibration import Holding, transit
from bench.play.children import child
from bench.play.program import Program, program
from bench.play.sound_server import RATE_HZ
from bench.printing import target
from training.cli.console import ProgressReport

SINGLES = 60
RINGS_S, QUIET_S = 0.4, 0.3  # of a single pluck, before and after it is stopped
SILENCE_S = 1.0
DECAY_PATIENCE_S = 30.0
IDLE_S = 5.0
HOLDING_LOOKS = 40
STOP = "space"


@dataclass(frozen=True)
class Spread:
    """Statistics of several times, in ms."""

    median: float
    p99: float
    worst: float

    @classmethod
    def of(cls, values_s: list[float]) -> Spread | None:
        """Return those of times in s; None where there are none."""
        if not values_s:
            return None
        ms = 1000 * np.array(values_s)
        return cls(float(np.median(ms)), float(np.quantile(ms, 0.99)), float(ms.max()))


@dataclass(frozen=True)
class Chosen:
    """The choices of a measurement, and the load before it.

    Attributes:
        instrument: its name, or that of a single string's preset.
        plucks_hz: plucks per second.
        busy: beside a process that keeps a core busy.
        load: the system's load averages.
    """

    instrument: str
    buffer: Buffer
    plucks_hz: float
    busy: bool
    load: tuple[float, float, float]


@dataclass(frozen=True)
class Playing:
    """The figures of single plucks, and of plucks at a rate.

    Attributes:
        start_to_window_s, start_to_sound_s: the latter by a key that was tried again and again.
        idle_cores: processor time of the program per second while nothing sounds; None where it does not fall silent.
        singles: single plucks out of silence; `unheard` of them had no sound within half a second.
        latency_ms: from the key until the sound is in the recording.
        beyond_device_ms: the same less `device_ms`, the share of the device's buffer.
        plucks: at the rate. What follows is of these, times in s since the first of their keys.
        holes: number of silences of a millisecond or more while strings ring.
        untimely: plucks that began 40 ms or more before or after a key's usual time.
        clicks: steps that are no pluck's beginning.
        loudest: the largest sample, ±1 being full scale.
        cores: processor time of the program per second while it was played.
        control_holes: of a steady tone that another process plays meanwhile in the same way.
        clock_uncertainty_ms, device_uncertainty_ms: of the recording's clock, and of the device's share of latency.
    """

    start_to_window_s: float
    start_to_sound_s: float
    idle_cores: float | None
    singles: int
    unheard: int = field(metadata=target(0))
    latency_ms: Spread | None
    beyond_device_ms: Spread | None
    device_ms: float | None
    plucks: int
    seconds: float
    holes: int = field(metadata=target(0))
    holes_ms: float
    longest_hole_ms: float
    untimely: int = field(metadata=target(0))
    clicks: int = field(metadata=target(0))
    hole_times_s: tuple[float, ...]
    click_times_s: tuple[float, ...]
    loudest: float
    cores: float
    control_holes: int
    control_longest_ms: float
    clock_uncertainty_ms: float
    device_uncertainty_ms: float


@dataclass(frozen=True)
class _Played:
    """The times of all keys, and what was measured meanwhile; `held_s`: the sound that the server had buffered."""

    singles_s: list[float]
    keys_s: list[float]
    held_s: float | None
    cores: float


def measure(
    seconds: float,
    plucks_hz: float,
    buffer: Buffer,
    busy: bool,
    seed: int,
    instrument: Instrument | str,
    report: ProgressReport,
) -> dict[str, Any]:
    """Play single plucks of an instrument, or of a preset's string, then for `seconds` so many notes per second."""
    random, keys = Random(seed), hands.keys_of(instrument)
    with program(instrument, buffer, report, calibrated=True) as app:
        app.recorded.wait_for_silence(SILENCE_S, DECAY_PATIENCE_S)
        load = os.getloadavg()
        with contextlib.ExitStack() as beside:
            if busy:
                beside.enter_context(child([sys.executable, "-c", "while True: pass"], os.environ))
            played = _play(app, random, keys, hands.steady(random, plucks_hz, seconds), report)
        report(0.85, "idle")
        idle_cores = _idle_cores(app)
        report(0.9, "analysis")
        name = instrument if isinstance(instrument, str) else instrument.name
        return {"chosen": Chosen(name, buffer, plucks_hz, busy, load), "playing": _judged(app, played, idle_cores)}


def _play(
    app: Program, random: Random, keys: Sequence[str], steps_s: Sequence[float], report: ProgressReport
) -> _Played:
    singles_s = []
    for number in range(SINGLES):
        report(0.1 + 0.4 * number / SINGLES, "single plucks")
        time.sleep(QUIET_S + random.uniform(0, 0.1))  # at random offsets from the device's blocks
        singles_s.append(hands.tap(app.screen, random.choice(keys)))
        time.sleep(RINGS_S)
        hands.tap(app.screen, STOP)
    time.sleep(QUIET_S)
    report(0.5, "plucks at a rate")
    holding = Holding()
    for _ in range(HOLDING_LOOKS):
        holding.look(app.server)
    before_s, before_processor_s = time.monotonic(), app.processor_s()
    keys_s = hands.play(app.screen, random, steps_s, keys)
    cores = (app.processor_s() - before_processor_s) / (time.monotonic() - before_s)
    time.sleep(analysis.SOUNDS_S)
    return _Played(singles_s, keys_s, holding.held_s, cores)


def _judged(app: Program, played: _Played, idle_cores: float | None) -> Playing:
    clock, sound, way = app.recorded.clock(), app.recorded.sound(), transit(app.clicks, app.recorded)
    first = np.flatnonzero(np.abs(sound[(start := clock.frame(app.started_s)) :, 0]) > analysis.FAINTEST_PLUCK)
    onsets = [analysis.onset(sound[:, 0], clock.frame(key_s), RATE_HZ) for key_s in played.singles_s]
    latencies_s = [
        clock.time_s(place) - key_s
        for place, key_s in zip(onsets, played.singles_s, strict=True)
        if place is not None
    ]
    device_s = None if played.held_s is None else way.at(played.held_s)
    first_s, last_s = played.keys_s[0], played.keys_s[-1]
    begin = clock.frame(first_s) - RATE_HZ // 10
    part = sound[begin : clock.frame(last_s) + RATE_HZ]
    places = [clock.frame(key_s) - begin for key_s in played.keys_s]
    usual = round(np.median(latencies_s) * RATE_HZ) if latencies_s else 0
    found = analysis.faults(part, places, usual, RATE_HZ)
    holes_ms = [1000 * hole.frames / RATE_HZ for hole in found.holes]
    tone_clock = app.control.clock()
    tone = app.control.sound()[tone_clock.frame(first_s) : tone_clock.frame(last_s)]
    control_ms = [1000 * hole.frames / RATE_HZ for hole in analysis.tone_holes(tone, RATE_HZ)]

    def since_s(frame: int) -> float:
        return round((frame - places[0]) / RATE_HZ, 4)

    return Playing(
        start_to_window_s=app.shown_s - app.started_s,
        start_to_sound_s=clock.time_s(start + int(first[0])) - app.started_s,
        idle_cores=idle_cores,
        singles=len(onsets),
        unheard=onsets.count(None),
        latency_ms=Spread.of(latencies_s),
        beyond_device_ms=None if device_s is None else Spread.of([each - device_s for each in latencies_s]),
        device_ms=None if device_s is None else 1000 * device_s,
        plucks=len(places),
        seconds=last_s - first_s,
        holes=len(holes_ms),
        holes_ms=sum(holes_ms),
        longest_hole_ms=max(holes_ms, default=0.0),
        untimely=len(found.untimely),
        clicks=len(found.clicks),
        hole_times_s=tuple(since_s(hole.start) for hole in found.holes),
        click_times_s=tuple(since_s(click) for click in found.clicks),
        loudest=float(np.abs(part).max()),
        cores=played.cores,
        control_holes=len(control_ms),
        control_longest_ms=max(control_ms, default=0.0),
        clock_uncertainty_ms=1000 * clock.spread_s,
        device_uncertainty_ms=1000 * way.spread_s,
    )


def _idle_cores(app: Program) -> float | None:
    if not app.recorded.wait_for_silence(SILENCE_S, DECAY_PATIENCE_S):
        return None
    before_s, before_processor_s = time.monotonic(), app.processor_s()
    time.sleep(IDLE_S)
    return (app.processor_s() - before_processor_s) / (time.monotonic() - before_s)
