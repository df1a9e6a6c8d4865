"""A piece of music, as the app renders it and as events of a host."""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from app.instruments.instrument import Instrument
from app.instruments.library import SHIPPED as INSTRUMENTS
from app.instruments.library import read_instrument
from app.player.events import Bend, ControlChange, NoteOff, NoteOn, TimedEvent
from app.player.offline import render_events
from engine.presets import SHIPPED, Preset, load_preset
from tests.app.export.plugin.host import Event, Instance, midi, note_off, note_on
from tests.engine.resonators.test_recorded import recorded

NAMES = (
    "concert_harp",  # rings on; other strings ring with it
    "damped_harp",
    "classical_guitar",  # body and room
    "electric_bass",  # magnetic pick-up
    "jazz_guitar",  # magnetic pick-up and body
    "fretless_bass",  # a channel for each string
    "sitar",  # open strings ring with it
    "cimbalom",
    "timpani",  # drums
    "twelve_string_guitar",  # courses, of octaves too
    "thin_bars",  # drums that are bars
    "learned",  # from a recording
    "member_channels",  # MPE
)
MOVED, DRUMS = "classical_guitar", ("timpani", "thin_bars")
TURNED = ("classical_guitar", "electric_bass", "concert_harp", "jazz_guitar", "learned", *DRUMS)  # their parameters
LEARNED, MEMBERS = "learned", "member_channels"
LONG = os.environ.get("LEARNED_STRINGS_FUZZ") == "long"  # by `run.py test --fuzz`
SECONDS = 1.6
EQUAL_DB = -140.0


def instrument_of(name: str) -> Instrument:
    if name == LEARNED:
        return read_instrument(INSTRUMENTS / "falling_nylon.json").model_copy(update={"name": "Learned"})
    if name == MEMBERS:
        guitar = read_instrument(INSTRUMENTS / "classical_guitar.json")
        return guitar.model_copy(update={"name": "Member channels", "mode": "mpe", "bend_semitones": 12.0})
    return read_instrument(INSTRUMENTS / f"{name}.json")


def preset_of(name: str) -> Preset:
    preset = load_preset(SHIPPED / f"{instrument_of(name).preset}.safetensors")
    if name != LEARNED:
        return preset
    own = replace(recorded(), smooth_hz=(200.0, 1e3, 5e3), smooth_ratio=(1.5, 2.5, 0.8), pitch_hz=196.0)
    return replace(preset, info=replace(preset.info, recorded=own))


def piece(instrument: Instrument) -> list[tuple[float, NoteOn | NoteOff | Bend | ControlChange]]:
    low = max(instrument.range[0], min(52, instrument.range[1] - 20))
    half = 4096 / 8191  # as 14 bits have it
    return [
        (0.0, NoteOn(low, 100)),
        (0.013, NoteOn(low + 4, 80)),
        (0.1, NoteOn(low + 7, 120)),
        (0.3, Bend(half)),
        (0.45, NoteOn(low, 60)),
        (0.5, Bend(0.0)),
        (0.55, ControlChange(64, 127)),
        (0.6, NoteOn(low + 12, 127)),
        (0.65, NoteOff(low + 12)),
        (0.7, NoteOff(low)),
        (1.0, ControlChange(64, 0)),
        (1.1, NoteOff(low + 4)),
    ]


def midi_bytes(event: NoteOn | NoteOff | Bend | ControlChange) -> tuple[int, int, int]:
    """The message of an event."""
    if isinstance(event, NoteOn):
        return 0x90 | event.channel, event.key, event.velocity
    if isinstance(event, NoteOff):
        return 0x80 | event.channel, event.key, 0
    if isinstance(event, Bend):
        wheel = 8192 + round(event.value * (8191 if event.value > 0 else 8192))
        return 0xE0 | event.channel, wheel & 127, wheel >> 7
    return 0xB0 | event.channel, event.number, event.value


def to_host(event: NoteOn | NoteOff | Bend | ControlChange, frame: int) -> Event:
    if isinstance(event, NoteOn):
        return note_on(frame, event.key, event.velocity, event.channel)
    if isinstance(event, NoteOff):
        return note_off(frame, event.key, event.channel)
    return midi(frame, *midi_bytes(event))


def played(
    instance: Instance,
    instrument: Instrument,
    rate_hz: int,
    block: int = 512,
    more: tuple[Event, ...] = (),
    before: tuple[Event, ...] = (),
) -> NDArray[np.float32]:
    """The piece, without the latency; other events after and before it."""
    own = [to_host(event, round(time_s * rate_hz)) for time_s, event in piece(instrument)]
    events = [*before, *own, *more]
    latency = instance.latency
    return instance.render(round(SECONDS * rate_hz) + latency, events, block)[latency:]


def rendered(
    instrument: Instrument,
    rate_hz: int,
    source: str = "model",
    gain_db: float = 0.0,
    more: tuple[TimedEvent, ...] = (),
    before: tuple[TimedEvent, ...] = (),
) -> NDArray[np.float32]:
    preset = preset_of(LEARNED if instrument.name == "Learned" else "concert_harp")
    timed = [*before, *(TimedEvent(time_s, event) for time_s, event in piece(instrument)), *more]
    sound = render_events(instrument, preset, timed, rate_hz, source, SECONDS, difference_gain_db=gain_db)
    return np.broadcast_to(np.concatenate(list(sound)), (round(SECONDS * rate_hz), 2))


def difference_db(sound: NDArray[np.float32], other: NDArray[np.float32]) -> float:
    """The largest difference compared with the peak. One step of single precision is none: up to −139 dB."""
    assert len(sound) == len(other)
    peak = float(np.abs(other).max())
    assert peak > 0.01
    step = np.spacing(np.maximum(np.abs(sound), np.abs(other), dtype=np.float32))
    beyond = np.maximum(np.abs(sound - other) - step, 0.0)
    return 20 * float(np.log10(max(float(beyond.max()), 1e-30) / peak))
