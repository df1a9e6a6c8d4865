"""A test piece, played by MIDI and by the computer's keys in the running app, recorded and judged.

The patch is played without its body and room, whose tails would hide the damping of strings. Its strings move in one
direction, are released at once, each alike, and none rings in sympathy: what is judged has no beats of its own.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Literal

import numpy as np

from app.audio.choices import Buffer, SoundChoice
from app.instrument.events import NoteOff, NoteOn, TimedEvent
from app.patches.patch import Body, Noise, Patch
from app.playing.midi import MidiChoices
from app.session.choices import Choices
from app.window.settings import Settings
from engine.values.effects import Room
from tests.bench.machine import Machine
from tests.bench.play import analysis, hands, program, score
from tests.bench.play.calibration import Holding, Transit, click_through, transit
from tests.bench.play.children import SOUND_AND_SCREEN, need_programs
from tests.bench.play.control import holes_ms, steady_tone
from tests.bench.play.hands import Hand, KeyHand, MidiHand
from tests.bench.play.judgement import Judgement, judge, notes_of
from tests.bench.play.midi import Cable, cable
from tests.bench.play.recording import CardClock, Recording, recording
from tests.bench.play.screen import private_screen
from tests.bench.play.sound_server import RATE_HZ, SoundServer, sound_server
from tests.bench.play.spread import Spread

By = Literal["midi", "keys", "both"]
SILENCE_S, DECAY_PATIENCE_S = 0.5, 30.0
HOLDING_LOOKS = 20
PATIENCE_S = 20.0


@dataclass(frozen=True)
class Heard:
    """The result for the piece as played by "midi" or "keys".

    Attributes:
        lost: messages that the MIDI cable lost; `cable_ms`: its own latency, the median. None for keys.
        singles: single notes; `unheard` of them had no sound.
        latency_ms: of these, from the message or key until the sound is in the recording.
        beyond_device_ms: the same less `device_ms`, the share of the device's buffer.
        control_holes: of a steady tone that another process plays meanwhile in the same way.
    """

    by: str
    load_before: float
    lost: int | None
    cable_ms: float | None
    singles: int
    unheard: int
    latency_ms: Spread | None
    beyond_device_ms: Spread | None
    device_ms: float | None
    judgement: Judgement
    control_holes: int
    control_holes_ms: float


@dataclass(frozen=True)
class NotesBenchmark:
    """The whole measurement; uncertainties as in `measure.PlayBenchmark`."""

    machine: Machine
    seed: int
    patch: str
    buffer: Buffer
    heard: tuple[Heard, ...]
    clock_uncertainty_ms: float
    device_uncertainty_ms: float


@dataclass(frozen=True)
class _Played:
    """What was played by MIDI or keys, by the name of the part, with times by `time.monotonic`."""

    by: str
    load: float
    held_s: float | None
    parts: dict[str, list[TimedEvent]]
    until_s: float

    @property
    def began_s(self) -> float:
        return notes_of(self.parts)[0].pressed_s


def measure(by: By, buffer: Buffer, seed: int, patch: Patch, report: Callable[..., None]) -> NotesBenchmark:
    """Play the piece by MIDI, keys or both, and judge the recording.

    Raises:
        Missing: a program, a library or a MIDI port is not there.
        RuntimeError: the app did not open, or no sound of it was recorded.
    """
    need_programs(*SOUND_AND_SCREEN, *(() if by == "keys" else ("jackd",)))
    pluck = patch.pluck.model_copy(update={"variation": 0.0, "release_ms": 0.0, "release_hard_ms": 0.0})
    plain = {"pluck": pluck, "polarisations": None, "sympathy_s_kg": 0.0, "noise": Noise()}
    dry = Patch.model_validate({**dict(patch), "body": Body(), "room": Room(), **plain})
    piece = score.parts(Random(seed), *dry.range)
    kinds = ("midi", "keys") if by == "both" else (by,)
    whole_s = 40 + len(kinds) * sum(part.seconds + SILENCE_S for part in piece)
    began_s = time.monotonic()

    def tell(text: str) -> None:
        report(min((time.monotonic() - began_s) / whole_s, 0.99), text)

    with contextlib.ExitStack() as stack:
        stack.enter_context(program.ended_politely())
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="notes")))
        tell("sound card, screen and MIDI")
        line = None if by == "keys" else stack.enter_context(cable(folder))
        server = stack.enter_context(sound_server(folder))
        screen = stack.enter_context(private_screen())
        recorded = stack.enter_context(recording(server, folder / "recording"))
        time.sleep(0.5)
        tell("clicks")
        clicks = click_through(server)
        tell("start")
        settings = Settings(
            choices=Choices(instrument=dry),
            sound=SoundChoice(rate_hz=RATE_HZ, buffer=buffer),
            midi=MidiChoices(port=line.name if line else ""),
        )
        control = stack.enter_context(steady_tone(server, folder, buffer))
        started_s = time.monotonic()
        environment = line.environment if line else {}
        process = stack.enter_context(program.app(folder, settings, server, screen, environment))
        program.open_window(screen, process)
        program.try_keys(screen, recorded, process, started_s)
        found = []
        for kind in kinds:
            recorded.wait_for_silence(SILENCE_S, DECAY_PATIENCE_S)
            hand: Hand = KeyHand(screen) if line is None or kind == "keys" else MidiHand(line)
            if kind == "midi":
                _try_midi(hand, recorded, folder)
            found.append(_play(kind, hand, piece, server, recorded, tell))
        time.sleep(0.5)
        tell("analysis")
        clock, way = recorded.clock(), transit(clicks, recorded)
        sound = recorded.sound()
        heard = tuple(_judged(each, dry, sound, clock, way, control, line) for each in found)
        return NotesBenchmark(
            Machine.here(), seed, patch.name, buffer, heard, 1000 * clock.spread_s, 1000 * way.spread_s
        )


def _try_midi(hand: Hand, recorded: Recording, folder: Path) -> None:
    since_s = time.monotonic()
    hand.do(NoteOn(60, score.MIDDLE))
    heard = recorded.wait_for_sound(since_s, PATIENCE_S)
    hand.do(NoteOff(60))
    if not heard:
        said = (folder / "app.log").read_text(errors="replace").strip().splitlines()[-1:]
        raise RuntimeError(f"the app sounds by keys, and by no MIDI message ({said})")
    recorded.wait_for_silence(SILENCE_S, DECAY_PATIENCE_S)


def _play(
    by: str,
    hand: Hand,
    piece: Sequence[score.Part],
    server: SoundServer,
    recorded: Recording,
    tell: Callable[[str], None],
) -> _Played:
    load = os.getloadavg()[0]
    holding, played = Holding(), {}
    for part in piece:
        if part.turns and not hand.turns:
            continue
        tell(f"{part.name} by {by}")
        recorded.wait_for_silence(SILENCE_S, DECAY_PATIENCE_S)
        played[part.name] = hands.perform(hand, part.events, part.seconds)
    for _ in range(HOLDING_LOOKS):
        holding.look(server)
    return _Played(by, load, holding.held_s, played, time.monotonic())


def _judged(
    played: _Played,
    patch: Patch,
    recorded: np.ndarray,
    clock: CardClock,
    way: Transit,
    control: Recording,
    line: Cable | None,
) -> Heard:
    begin = clock.frame(played.began_s) - RATE_HZ // 2
    sound = recorded[begin : clock.frame(played.until_s)]
    singles = score.sounded(played.parts["singles"])
    onsets = [analysis.onset(recorded[:, 0], clock.frame(note.pressed_s), RATE_HZ) for note in singles]
    latencies_s = [
        clock.time_s(place) - note.pressed_s for place, note in zip(onsets, singles, strict=True) if place is not None
    ]
    if not latencies_s:
        raise RuntimeError(f"no note by {played.by} was heard")
    usual_s = float(np.median(latencies_s))
    device_s = None if played.held_s is None else way.at(played.held_s)

    def at(time_s: float) -> float:
        """When in `sound`, in s, an event of that time is heard."""
        return (clock.frame(time_s + usual_s) - begin) / RATE_HZ

    control_ms = holes_ms(control, played.began_s, played.until_s)
    return Heard(
        played.by,
        played.load,
        line.lost if line and played.by == "midi" else None,
        1000 * float(np.median(line.transits_s)) if line and played.by == "midi" and line.transits_s else None,
        len(singles),
        onsets.count(None),
        Spread.of(latencies_s),
        None if device_s is None else Spread.of([latency_s - device_s for latency_s in latencies_s]),
        None if device_s is None else 1000 * device_s,
        judge(played.parts, patch, sound, at),
        len(control_ms),
        sum(control_ms),
    )
