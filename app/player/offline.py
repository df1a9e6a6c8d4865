"""Events to samples, without a device: the same player, voices and limiter as in the window."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from app.instruments.instrument import Instrument
from app.player.compiled import InstrumentPlayer
from app.player.effects import channels_of, effects_of
from app.player.events import ControlChange, Event, InstrumentTurned, NoteOff, NoteOn, TimedEvent, moves_effects
from app.shared.vocabulary import DIFFERENCE
from engine.kernels.constants import AHEAD, QUANTUM
from engine.kernels.midi import MOD_WHEEL
from engine.presets import Preset
from engine.voices import Mixer

BLOCK_FRAMES = 4_096
LONGEST_TAIL_S = 60.0
SILENT_DB = -80.0  # re full scale: it ends with the last block whose peak is above; 20 dB SPL where that is 100
SYMPATHY_S = 5.0  # for which strings may ring that are not played
MOST_RINGING = 96  # where more strings ring, the oldest fade out


class OfflinePlayer:
    """A player and a mixer without a device.

    Args:
        gains: by source, the factor of each that is heard; two of them are a difference, without body and room.
        limited: through the limiter.
        varied: whether plucks vary from stroke to stroke; those of a difference do not.
        dry: without amplifier, body and room.

    Attributes:
        tail_s: how long effects and sympathetic strings may ring on.
    """

    def __init__(
        self,
        instrument: Instrument,
        preset: Preset,
        rate_hz: int,
        gains: Mapping[str, float],
        limited: bool,
        varied: bool,
        dry: bool,
    ) -> None:
        self.mixer = Mixer(rate_hz, limited=limited)
        compared = len(gains) > 1
        self.player = InstrumentPlayer(
            instrument, preset, rate_hz, gains, most_notes=MOST_RINGING, varied=varied and not compared
        )
        self.mixer.set_player(self.player.compiled)
        self._dry = compared or dry  # effects are left out
        self.tail_s = 0.0
        self._set_effects()

    def handle(self, event: Event, frame: int) -> None:
        """Play an event at a frame of the mixer, and change the effects where it moves them."""
        self.player.handle(event, frame)
        if moves_effects(event, self.player.instrument):
            self._set_effects()

    def _set_effects(self) -> None:
        """Set the effects as knobs and wheel stand; `tail_s` becomes the longest of all so far."""
        instrument = self.player.heard_through
        effects = None if self._dry else effects_of(instrument)
        self.mixer.set_effects(effects)
        if effects is not None:
            self.tail_s = max(self.tail_s, effects.tail_s(self.mixer.rate_hz))
        if instrument.sympathy_s_kg > 0:
            self.tail_s = max(self.tail_s, SYMPATHY_S)


def render_events(
    instrument: Instrument,
    preset: Preset,
    timed: Sequence[TimedEvent],
    rate_hz: int,
    source: str = "model",
    seconds: float | None = None,
    limited: bool = True,
    difference_gain_db: float = 0.0,
    varied: bool = True,
    dry: bool = False,
) -> Iterator[NDArray[np.float32]]:
    """The sound of an instrument that plays events, in blocks (frames, channels), ±1 being full scale. Deterministic.

    A note begins at its very frame; all else counts within a quantum of 64 frames after its own.

    Args:
        source: "model", "truth", or "difference": model minus truth with its gain, without body and room.
        seconds: its length; None: until all has fallen below SILENT_DB, a minute after the last note or release at
            most, whatever controllers follow.
        limited: through the limiter, as it is heard; without it, samples may pass full scale.
        varied: whether plucks vary from stroke to stroke, as the instrument says; in a difference they never do.
        dry: without amplifier, body and room; the gains of the keys stay. A difference is always so.

    Raises:
        ValueError: a key has no possible string, or there is no such `source`.
    """
    stage = OfflinePlayer(instrument, preset, rate_hz, _gains(source, difference_gain_db), limited, varied, dry)
    channels, delay = channels_played(instrument, timed), AHEAD if limited else 0
    done, events = 0, sorted(timed, key=lambda timed_event: timed_event.time_s)
    sounding = [place for place, entry in enumerate(events) if isinstance(entry.event, NoteOn | NoteOff)]
    tail = sounding[-1] + 1 if sounding else 0  # number of events up to the last note or release

    def blocks_until(frame: int) -> Iterator[NDArray[np.float32]]:  # sound up to a frame, less the limiter's delay
        nonlocal done
        while done < frame:
            block = stage.mixer.render(min(BLOCK_FRAMES, frame - done))
            done += len(block)
            if done > delay:
                yield block[max(0, delay - done + len(block)) :, :channels]

    # sound up to a frame, with these events on the way
    def play_until(frame: int, few: Sequence[TimedEvent]) -> Iterator[NDArray[np.float32]]:
        for timed_event in few:
            at = round(timed_event.time_s * rate_hz)
            yield from blocks_until(at // QUANTUM * QUANTUM)
            stage.handle(timed_event.event, at)
        yield from blocks_until(frame)

    if seconds is not None:
        end = round(seconds * rate_hz) + delay
        yield from play_until(end, [timed_event for timed_event in events if timed_event.time_s < seconds])
        return
    yield from play_until(0, events[:tail])
    left = deque(events[tail:])  # as a pedal that is lifted: what rings follows them, and they keep nothing ringing
    last = done + round(LONGEST_TAIL_S * rate_hz)
    quiet = 10 ** (SILENT_DB / 20)
    quiet_s = 0.0  # until all effects have died away as well
    waiting: list[NDArray[np.float32]] = []  # silence, which ends the file unless a sound follows
    while done < last and quiet_s <= stage.tail_s:
        before = done
        end = min(last, done + BLOCK_FRAMES)
        now = []
        while left and round(left[0].time_s * rate_hz) < end:
            now.append(left.popleft())
        blocks = list(play_until(end, now))
        loudest = max((float(np.abs(block).max(initial=0.0)) for block in blocks), default=0.0)
        waiting += blocks
        if loudest >= quiet:
            yield from waiting
            waiting = []
        quiet_s = quiet_s + (done - before) / rate_hz if loudest < quiet or not stage.mixer.active else 0.0
    yield from waiting[:1]


def channels_played(instrument: Instrument, timed: Iterable[TimedEvent]) -> int:
    """The channels that `render_events` gives: 2 where the instrument, or what it is turned to, sounds in two."""
    events = [timed_event.event for timed_event in timed]
    later_instruments = (event.instrument for event in events if isinstance(event, InstrumentTurned))
    wheeled = any(isinstance(event, ControlChange) and event.number == MOD_WHEEL for event in events)
    return max(channels_of(version, wheeled) for version in (instrument, *later_instruments))


def _gains(source: str, difference_gain_db: float) -> dict[str, float]:
    """The factor of each source that is heard."""
    if source == DIFFERENCE:
        gain = float(10 ** (difference_gain_db / 20))
        return {"model": gain, "truth": -gain}
    if source not in ("model", "truth"):
        raise ValueError(f"source must be model, truth or {DIFFERENCE}, not {source!r}")
    return {source: 1.0}


def render_note(
    instrument: Instrument,
    preset: Preset,
    key: int,
    velocity: int,
    held_s: float,
    seconds: float,
    rate_hz: int,
    source: str = "model",
    advanced: Callable[[float], None] = lambda seconds: None,
) -> NDArray[np.float32]:
    """Render a key held for `held_s`, (frames, channels), `seconds` long, without a limiter and without variation.

    Args:
        advanced: is called with the seconds rendered so far; may raise, to end it.

    Raises:
        ValueError: the key has no string, or an impossible one, or the sound is not finite.
    """
    timed = [TimedEvent(0.0, NoteOn(key, velocity))]
    if held_s < seconds:
        timed.append(TimedEvent(held_s, NoteOff(key)))
    blocks: list[NDArray[np.float32]] = []
    for block in render_events(instrument, preset, timed, rate_hz, source, seconds, limited=False, varied=False):
        blocks.append(block)
        advanced(sum(map(len, blocks)) / rate_hz)
    sound = np.concatenate(blocks)
    if not math.isfinite(float(np.abs(sound).max())):
        raise ValueError(f"key {key} at velocity {velocity}: its sound is not finite")
    return sound
