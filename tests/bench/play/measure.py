"""The whole measurement: a private sound card and screen, the program, simulated playing, and the recording.

The program is driven from outside: by its command, its window's title, its keys and its settings file.
"""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import psutil

from app.audio.choices import Buffer, SoundChoice
from app.patches.instrument import Instrument, SingleString
from app.session.choices import Choices
from app.window.settings import Settings
from tests.bench.machine import Machine
from tests.bench.play import analysis, hands, program
from tests.bench.play.calibration import Holding, Transit, click_through, transit
from tests.bench.play.children import SOUND_AND_SCREEN, child, need_programs
from tests.bench.play.control import holes_ms, steady_tone
from tests.bench.play.picture import picture_lags
from tests.bench.play.recording import CardClock, Recording, recording
from tests.bench.play.screen import Screen, private_screen
from tests.bench.play.sound_server import RATE_HZ, SoundServer, sound_server
from tests.bench.play.spread import Spread

SINGLES = 60
RINGS_S, QUIET_S = 0.4, 0.3  # of a single pluck, before and after it is stopped
SILENCE_S = 1.0
DECAY_PATIENCE_S = 30.0
IDLE_S = 5.0
HOLDING_LOOKS = 40
STOP = "space"
PICTURES = 20


@dataclass(frozen=True)
class Phase:
    """What was measured with or without another busy process.

    Attributes:
        load_before: the system's load averages.
        singles: single plucks out of silence; `unheard` of them had no sound within half a second.
        latency_ms: from the key until the sound is in the recording.
        beyond_device_ms: the same less `device_ms`, the share of the device's buffer.
        plucks: at the rate of playing. What follows is of these, times in s since the first of their keys.
        holes: number of silences of a millisecond or more while strings ring.
        fades: drops of the level by 40 dB from which it recovers, other than holes.
        untimely: plucks that began 40 ms or more before or after a key's usual time.
        clicks: steps that are no pluck's beginning.
        loudest: the largest sample, ±1 being full scale.
        cpu_cores: processor time of the program per second while it was played.
        control_holes: of a steady tone that another process plays meanwhile in the same way.
    """

    busy: bool
    load_before: tuple[float, float, float]
    singles: int
    unheard: int
    latency_ms: Spread | None
    beyond_device_ms: Spread | None
    device_ms: float | None
    plucks: int
    seconds: float
    holes: int
    holes_ms: float
    longest_hole_ms: float
    fades: int
    untimely: int
    clicks: int
    hole_times_s: tuple[float, ...]
    fade_times_s: tuple[float, ...]
    click_times_s: tuple[float, ...]
    loudest: float
    cpu_cores: float
    control_holes: int
    control_holes_ms: float
    control_longest_ms: float


@dataclass(frozen=True)
class PlayBenchmark:
    """The whole measurement.

    Attributes:
        instrument: its name, or that of a single string's preset.
        rate_hz: plucks per second.
        buffer: as chosen; `buffer_ms`: its length where it was chosen in frames.
        size: of the window in pixels.
        views: those beside the string.
        idle_cpu_cores, idle_window_cores: processor time per second while nothing sounds, of the program and of the
            window's thread.
        picture_lag_ms: from the first sound of a pluck in the recording to the first changed picture of the string.
        clock_uncertainty_ms, device_uncertainty_ms: of the recording's clock, and of the device's share of latency.
    """

    machine: Machine
    seed: int
    instrument: str
    rate_hz: float
    buffer: Buffer
    buffer_ms: float | None
    size: tuple[int, int]
    views: tuple[str, str]
    start_to_window_s: float
    start_to_sound_s: float
    idle_cpu_cores: float | None
    idle_window_cores: float | None
    picture_lag_ms: Spread | None
    phases: tuple[Phase, ...]
    clock_uncertainty_ms: float
    device_uncertainty_ms: float


@dataclass(frozen=True)
class _Played:
    """What was played in a phase, with times by `time.monotonic`."""

    busy: bool
    load: tuple[float, float, float]
    singles_s: list[float]
    held_s: float | None
    keys_s: list[float]
    cpu_cores: float


def measure(
    seconds: float,
    rate_hz: float,
    buffer: Buffer,
    busy: tuple[bool, ...],
    seed: int,
    instrument: Instrument,
    report: Callable[..., None],
) -> PlayBenchmark:
    """Play `instrument` for `seconds` at `rate_hz` notes per second, once for each entry of `busy`.

    A single string is played in the Lab.

    Raises:
        Missing: a program or library is not there.
        RuntimeError: the app did not open, or no sound of it was recorded.
    """
    need_programs(*SOUND_AND_SCREEN)
    one_s = SINGLES * (RINGS_S + QUIET_S + 0.05) + seconds + 10
    whole_s = 60 + one_s * len(busy)
    began_s = time.monotonic()

    def shown(text: str) -> None:
        report(min((time.monotonic() - began_s) / whole_s, 0.99), text)

    random = Random(seed)
    with contextlib.ExitStack() as stack:
        stack.enter_context(program.ended_politely())
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="play")))
        shown("sound card and screen")
        server = stack.enter_context(sound_server(folder))
        screen = stack.enter_context(private_screen())
        recorded = stack.enter_context(recording(server, folder / "recording"))
        time.sleep(0.5)
        shown("clicks")
        clicks = click_through(server)
        shown("start")
        single, keys = isinstance(instrument, SingleString), hands.keys_of(instrument)
        choices = Choices(instrument=instrument, octave=hands.octave_of(instrument), face="lab" if single else "play")
        settings = Settings(choices=choices, sound=SoundChoice(rate_hz=RATE_HZ, buffer=buffer))
        control = stack.enter_context(steady_tone(server, folder, buffer))
        started_s = time.monotonic()
        process = stack.enter_context(program.app(folder, settings, server, screen))
        window, window_s = program.open_window(screen, process)
        program.try_keys(screen, recorded, process, started_s, keys[0])
        recorded.wait_for_silence(SILENCE_S, DECAY_PATIENCE_S)
        played = [_phase(screen, server, recorded, process, random, seconds, rate_hz, b, keys, shown) for b in busy]
        shown("idle")
        idle = _idle(recorded, process)
        shown("picture")
        seen = picture_lags(screen, recorded, PICTURES, keys, STOP)
        size = screen.size(window)
        time.sleep(0.5)
        shown("analysis")
        clock, way = recorded.clock(), transit(clicks, recorded)
        sound = recorded.sound()
        phases = tuple(_judged(each, sound, clock, way, control) for each in played)
        first = np.flatnonzero(np.abs(sound[(start := clock.frame(started_s)) :, 0]) > analysis.FAINTEST_PLUCK)
        lags_s = [
            changed_s - clock.time_s(heard)
            for key_s, changed_s in seen
            if (heard := analysis.onset(sound[:, 0], clock.frame(key_s), RATE_HZ)) is not None
        ]
        return PlayBenchmark(
            Machine.here(),
            seed,
            instrument.preset if isinstance(instrument, SingleString) else instrument.name,
            rate_hz,
            buffer,
            1000 * buffer / RATE_HZ if isinstance(buffer, int) else None,
            size,
            (choices.left_view, choices.right_view),
            window_s - started_s,
            clock.time_s(start + int(first[0])) - started_s,
            *idle,
            Spread.of(lags_s),
            phases,
            1000 * clock.spread_s,
            1000 * way.spread_s,
        )


def _phase(
    screen: Screen,
    server: SoundServer,
    recorded: Recording,
    process: subprocess.Popen[bytes],
    random: Random,
    seconds: float,
    rate_hz: float,
    busy: bool,
    keys: Sequence[str],
    shown: Callable[[str], None],
) -> _Played:
    beside = " beside a busy process" if busy else ""
    load = os.getloadavg()
    recorded.wait_for_silence(SILENCE_S, DECAY_PATIENCE_S)
    with contextlib.ExitStack() as stack:
        if busy:
            stack.enter_context(child([sys.executable, "-c", "while True: pass"], os.environ))
        shown(f"single plucks{beside}")
        singles_s = []
        for _ in range(SINGLES):
            time.sleep(QUIET_S + random.uniform(0, 0.1))  # at random offsets from the device's blocks
            singles_s.append(hands.tap(screen, random.choice(keys)))
            time.sleep(RINGS_S)
            hands.tap(screen, STOP)
        time.sleep(QUIET_S)
        shown(f"{rate_hz:g} plucks a second{beside}")
        holding = Holding()
        for _ in range(HOLDING_LOOKS):
            holding.look(server)
        before_s, before_cpu_s = time.monotonic(), _cpu_s(process)
        keys_s = hands.play(screen, random, hands.steady(random, rate_hz, seconds), keys)
        cores = (_cpu_s(process) - before_cpu_s) / (time.monotonic() - before_s)
        time.sleep(analysis.SOUNDS_S)
    return _Played(busy, load, singles_s, holding.held_s, keys_s, cores)


def _cpu_s(process: subprocess.Popen[bytes]) -> float:
    """Processor time of a process and all that it has started."""
    parent = psutil.Process(process.pid)
    total = 0.0
    for one in (parent, *parent.children(recursive=True)):
        with contextlib.suppress(psutil.NoSuchProcess):
            times: Any = one.cpu_times()
            total += times.user + times.system
    return total


def _idle(recorded: Recording, process: subprocess.Popen[bytes]) -> tuple[float | None, float | None]:
    """See `PlayBenchmark`; None where the program does not fall silent."""
    if not recorded.wait_for_silence(SILENCE_S, DECAY_PATIENCE_S):
        return None, None
    before_s, before_cpu_s, before_window_s = time.monotonic(), _cpu_s(process), _window_cpu_s(process)
    time.sleep(IDLE_S)
    lasted_s = time.monotonic() - before_s
    return (_cpu_s(process) - before_cpu_s) / lasted_s, (_window_cpu_s(process) - before_window_s) / lasted_s


def _window_cpu_s(process: subprocess.Popen[bytes]) -> float:
    """Processor time of a process's first thread, which is the window's."""
    return sum(
        each.user_time + each.system_time for each in psutil.Process(process.pid).threads() if each.id == process.pid
    )


def _judged(played: _Played, sound: np.ndarray, clock: CardClock, way: Transit, control: Recording) -> Phase:
    keys = [clock.frame(key_s) for key_s in played.singles_s]
    onsets = [analysis.onset(sound[:, 0], key, RATE_HZ) for key in keys]
    latencies_s = [
        clock.time_s(place) - key_s
        for place, key_s in zip(onsets, played.singles_s, strict=True)
        if place is not None
    ]
    device_s = None if played.held_s is None else way.at(played.held_s)
    latency, beyond = Spread.of(latencies_s), None
    if device_s is not None:
        beyond = Spread.of([latency_s - device_s for latency_s in latencies_s])
    begin = clock.frame(played.keys_s[0]) - RATE_HZ // 10
    part = sound[begin : clock.frame(played.keys_s[-1]) + RATE_HZ]
    keys = [clock.frame(key_s) - begin for key_s in played.keys_s]
    usual = round(np.median(latencies_s) * RATE_HZ) if latencies_s else 0
    found = analysis.faults(part, keys, usual, RATE_HZ)
    control_ms = holes_ms(control, played.keys_s[0], played.keys_s[-1] + analysis.SOUNDS_S)

    def since_s(frame: int) -> float:
        return round((frame - keys[0]) / RATE_HZ, 4)

    return Phase(
        played.busy,
        played.load,
        len(onsets),
        onsets.count(None),
        latency,
        beyond,
        None if device_s is None else 1000 * device_s,
        len(keys),
        played.keys_s[-1] - played.keys_s[0],
        len(found.holes),
        sum(hole.frames for hole in found.holes) * 1000 / RATE_HZ,
        max((hole.frames for hole in found.holes), default=0) * 1000 / RATE_HZ,
        len(found.fades),
        len(found.untimely),
        len(found.clicks),
        tuple(since_s(hole.start) for hole in found.holes),
        tuple(since_s(fade.start) for fade in found.fades),
        tuple(since_s(click) for click in found.clicks),
        float(np.abs(part).max()),
        played.cpu_cores,
        len(control_ms),
        sum(control_ms),
        max(control_ms, default=0.0),
    )
