"""Instruments of a bank of plug-ins, and music for them: as the app renders it, and as hosts play it."""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from app.instruments.instrument import Instrument
from app.instruments.library import SHIPPED as INSTRUMENTS
from app.instruments.library import read_instrument
from app.player.events import Bend, ControlChange, Event, NoteOff, NoteOn, TimedEvent
from app.player.offline import render_events
from engine.presets import SHIPPED, Preset, load_preset
from tests.app.export.plugin.abi import Events, Playing, Sound
from tests.engine.resonators.test_recorded import recorded

Timed = Sequence[tuple[float, Event]]
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
    "others",  # a shell, a kettle, a rectangle in air, of many modes, and a modulus that becomes impossible
)
MOVED, DRUMS = "classical_guitar", ("timpani", "thin_bars")
TURNED = ("classical_guitar", "electric_bass", "concert_harp", "jazz_guitar", "learned", *DRUMS)  # their parameters
LEARNED, MEMBERS, OTHERS = "learned", "member_channels", "others"
LONG = os.environ.get("LEARNED_STRINGS_FUZZ") == "long"  # by `run.py test --fuzz`
RATE_HZ, SECONDS = 48_000, 1.6
EQUAL_DB = -140.0


def instrument_of(name: str) -> Instrument:
    if name == OTHERS:
        return read_instrument(Path(__file__).with_name("others.json"))
    shipped = {LEARNED: "falling_nylon", MEMBERS: "classical_guitar"}.get(name, name)
    instrument = read_instrument(INSTRUMENTS / f"{shipped}.json")
    changes: dict[str, object] = {} if shipped == name else {"name": name.capitalize().replace("_", " ")}
    if name == MEMBERS:
        changes |= {"mode": "mpe", "bend_semitones": 12.0}
    return instrument.model_copy(update=changes)


def preset_of(name: str) -> Preset:
    preset = load_preset(SHIPPED / f"{instrument_of(name).preset}.safetensors")
    if name != LEARNED:
        return preset
    own = replace(recorded(), smooth_hz=(200.0, 1e3, 5e3), smooth_ratio=(1.5, 2.5, 0.8), pitch_hz=196.0)
    return replace(preset, info=replace(preset.info, recorded=own))


SLIDE, SUSTAIN = 74, 64
MEMBERS_PLAY: Timed = (
    (0.0, ControlChange(SLIDE, 20, 1)),
    (0.0, ControlChange(SLIDE, 110, 2)),
    (0.01, NoteOn(52, 100, 1)),
    (0.02, NoteOn(59, 90, 2)),
    (0.05, NoteOn(59, 110, 3)),  # the same key in another channel, without a slide
    (0.1, Bend(512 / 8191, 1)),  # three semitones of a member's 48
    (0.2, Bend(-0.03125, 2)),
    (0.25, ControlChange(SLIDE, 64, 2)),  # for its next note
    (0.3, NoteOff(59, 2)),
    (0.35, Bend(2048 / 8191, 0)),  # the master's wheel, for all
    (0.4, NoteOn(64, 100, 2)),
    (0.45, ControlChange(SUSTAIN, 127, 0)),
    (0.5, NoteOff(52, 1)),
    (0.6, Bend(0.0, 0)),
    (0.65, ControlChange(SUSTAIN, 0, 0)),
)


def lowest(instrument: Instrument) -> int:
    return max(instrument.range[0], min(52, instrument.range[1] - 20))


def piece(instrument: Instrument) -> Timed:
    if instrument.mode == "mpe":
        return MEMBERS_PLAY
    low = lowest(instrument)
    whole: Timed = (
        (0.0, NoteOn(low, 100)),
        (0.013, NoteOn(low + 4, 80)),
        (0.1, NoteOn(low + 7, 120)),
        (0.3, Bend(4096 / 8191)),  # as 14 bits have it
        (0.45, NoteOn(low, 60)),
        (0.5, Bend(0.0)),
        (0.55, ControlChange(SUSTAIN, 127)),
        (0.6, NoteOn(low + 12, 127)),
        (0.65, NoteOff(low + 12)),
        (0.7, NoteOff(low)),
        (1.0, ControlChange(SUSTAIN, 0)),
        (1.1, NoteOff(low + 4)),
    )
    # beyond the bounds of a modulus a key is silent in a plug-in, and refused in the app
    impossible = instrument.name == "Others" and instrument.value("knobs.modulus") > 1
    return [each for each in whole if not (impossible and each[1] == NoteOn(62, 127))]


def midi_bytes(event: Event) -> bytes:
    if isinstance(event, NoteOn):
        return bytes((0x90 | event.channel, event.key, event.velocity))
    if isinstance(event, NoteOff):
        return bytes((0x80 | event.channel, event.key, 0))
    if isinstance(event, Bend):
        wheel = 8192 + round(event.value * (8191 if event.value > 0 else 8192))
        return bytes((0xE0 | event.channel, wheel & 127, wheel >> 7))
    return bytes((0xB0 | event.channel, event.number, event.value))


def active(library: Any, name: str, rate_hz: int = RATE_HZ) -> Any:
    instance = library.create_named(instrument_of(name).name)
    instance.activate(rate_hz)
    return instance


def played(
    instance: Playing,
    events: Timed,
    rate_hz: int = RATE_HZ,
    block: int = 512,
    more: Events = (),
    seconds: float = SECONDS,
) -> Sound:
    """Music in a host of any format, without the latency, with other events of the format."""
    messages = [(round(time_s * rate_hz), midi_bytes(event)) for time_s, event in events]
    latency = instance.latency
    return instance.render(round(seconds * rate_hz) + latency, [*messages, *more], block)[latency:]


def rendered(
    instrument: Instrument,
    events: Timed | None = None,
    rate_hz: int = RATE_HZ,
    source: str = "model",
    seconds: float = SECONDS,
) -> Sound:
    """Music in the app; a piece of its own where none is given."""
    preset = preset_of(LEARNED if instrument.name == "Learned" else "concert_harp")
    timed = [TimedEvent(*each) for each in (piece(instrument) if events is None else events)]
    sound = np.concatenate(list(render_events(instrument, preset, timed, rate_hz, source, seconds)))
    return np.broadcast_to(sound, (len(sound), 2))


def difference_db(sound: Sound, other: Sound) -> float:
    """The largest difference compared with the peak. One step of single precision is none: up to −139 dB."""
    assert len(sound) == len(other)
    peak = float(np.abs(other).max())
    assert peak > 0.01
    step = np.spacing(np.maximum(np.abs(sound), np.abs(other), dtype=np.float32))
    beyond = np.maximum(np.abs(sound - other) - step, 0.0)
    return 20 * float(np.log10(max(float(beyond.max()), 1e-30) / peak))
