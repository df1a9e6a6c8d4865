"""SoundFont 2: all samples and the tables of one instrument in one RIFF file.

Source: SoundFont Technical Specification 2.01 (E-mu, 1998); section numbers stand beside what they ask for.
"""

from __future__ import annotations

import math
import struct
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from app.audio.sound_file import open_sound
from app.export.sampled.levels import by_key, headroom_db, velocity_levels
from app.export.sampled.plan import SampledPlan, Zone
from app.export.sampled.sample import StoredSample
from app.export.wav import quantised
from app.instruments.instrument import Instrument
from app.shared.version import PROGRAM, program_version
from app.shared.worker import Progress
from engine.plain_text import one_line

ZEROS_BEHIND = 46  # frames after each sample (6.1)
RATE_RANGE_HZ = (400, 50_000)  # of a sample (7.10)
LARGEST_BYTES = 2**32 - 2**20  # a RIFF chunk's size has 32 bits; room for the tables
RELEASE_SPAN_DB = 100.0  # what the volume envelope falls in its release time (8.1.2, releaseVolEnv)
TIMECENTS_RANGE = (-12_000, 8_000)
HARD_PAN = 500  # per mille to either side

# Generators (8.1.2)
FILTER_CUTOFF = 8
PAN = 17
RELEASE_VOL_ENV = 38
INSTRUMENT = 41
KEY_RANGE = 43
VEL_RANGE = 44
ATTENUATION = 48
SAMPLE_ID = 53
EXCLUSIVE_CLASS = 57
# Default modulators that are switched off, as (source, destination, amount's source) (8.4.1, 8.4.2): velocity to
# attenuation, which is not the instrument's; velocity to the filter, in the forms of 2.01 and of 2.04.
SWITCHED_OFF = ((0x0502, ATTENUATION, 0), (0x0102, FILTER_CUTOFF, 0x0D02), (0x0102, FILTER_CUTOFF, 0))
MOST_RAISED_DB = 6.0  # of a layer above the hardest: a bit of resolution
FALLING_VELOCITY = 0x0102  # 1 - velocity / 128, linear (8.2)
# Kinds of samples (7.10)
MONO = 1
RIGHT = 2
LEFT = 4

Generator = tuple[int, int]


@dataclass(frozen=True)
class _Channel:
    """A channel of a zone's sample, as a sample of its own."""

    zone: Zone
    name: str
    start: int  # in frames of the smpl chunk
    frames: int
    kind: int  # MONO, LEFT or RIGHT
    link: int  # the number of the other side's sample; 0 for mono
    pan: int  # per mille, negative to the left


def check_sf2(plan: SampledPlan) -> None:
    """Raise ValueError where a plan does not fit into one SoundFont; the message names the remedy."""
    low, high = RATE_RANGE_HZ
    if not low <= plan.rate_hz <= high:
        raise ValueError(f"a SoundFont's rate must lie in {low} … {high} Hz, not {plan.rate_hz}; lower it")
    # No table outgrows its 16-bit index: 128 keys of 32 layers in stereo are 8,192 zones of 5 rows at most.
    if plan.largest_bytes > LARGEST_BYTES:
        raise ValueError(
            f"these samples may take {plan.largest_bytes / 2**30:.1f} GiB, and a SoundFont holds 4; "
            "take fewer keys, layers or seconds, or SFZ"
        )


def write_sf2(
    file: BinaryIO,
    plan: SampledPlan,
    samples: Mapping[Zone, StoredSample],
    folder: Path,
    progress: Progress = lambda *_: None,
) -> float:
    """Write the whole file; the stored samples are read one after the other.

    Returns:
        By how much the whole was raised, in dB: the loudest sample is at the full level of 16 bits.

    Raises:
        Cancelled: `progress`, called before each sample, raised it; the file is not whole.
        OSError, UnreadableSound: the file cannot be written, or a sample not read.
    """
    channels = _channels(samples)
    attenuations_cb = _attenuations_cb(plan.instrument, samples)
    tables = _tables(plan, channels, attenuations_cb)
    size = 2 * sum(channel.frames + ZEROS_BEHIND for channel in channels)  # bytes of all samples
    info = _list(b"INFO", _information(plan))
    body = 4 + len(info) + (8 + 4 + 8 + size) + len(tables)
    file.write(b"RIFF" + struct.pack("<I", body) + b"sfbk" + info)
    file.write(b"LIST" + struct.pack("<I", 4 + 8 + size) + b"sdta" + b"smpl" + struct.pack("<I", size))
    headrooms_db = headroom_db(plan.instrument, samples)
    levels_db = {  # by how much each stored sample is raised, before `gain_db`
        # its hardest velocity's attenuation is made up for
        zone: attenuations_cb[zone] / 10 * (1 - zone.velocities[1] / 128) + headrooms_db[zone] - stored.gain_db
        for zone, stored in samples.items()
    }
    gain_db = -max(levels_db.values())
    for zone in samples:
        progress(1.0, "writing the SoundFont")
        with open_sound(folder / plan.file_name(zone)) as stored:
            sound = stored.read(dtype="float64", always_2d=True)
        steps, _ = quantised(sound * 10 ** ((levels_db[zone] + gain_db) / 20), "16")
        silence = bytes(2 * ZEROS_BEHIND)
        for column in steps.T:
            file.write((column.astype(np.int32) >> 16).astype("<i2").tobytes() + silence)
    file.write(tables)
    return gain_db


def _attenuations_cb(instrument: Instrument, samples: Mapping[Zone, StoredSample]) -> dict[Zone, int]:
    """The attenuation by zone, in cB, that a velocity of 0 would have against one of 128.

    So the level continues within a layer as it does from layer to layer. A soft layer has to be raised for it; the
    attenuation is less where that layer would become much louder than the hardest.
    """
    attenuations_cb = {}
    for layers, stored in by_key(samples):
        levels_db = velocity_levels(instrument, layers, stored)
        for zone in layers:
            hardest = zone.velocities[1]
            below = max(1, zone.velocities[0] - 1)  # the velocity of the layer before
            step = (levels_db[hardest] - levels_db[below]) / max(1, hardest - below)
            most = (levels_db[-1] - levels_db[hardest] + MOST_RAISED_DB) / (128 - hardest)
            attenuations_cb[zone] = round(10 * 128 * max(0.0, min(step, most)))
    return attenuations_cb


def release_timecents(instrument: Instrument) -> int:
    """The release of the volume envelope: 60 dB in the damping time; of strings that ring on, the longest."""
    if instrument.damping.let_ring:
        return TIMECENTS_RANGE[1]
    seconds = instrument.damping.release_t60_s * RELEASE_SPAN_DB / 60
    low, high = TIMECENTS_RANGE
    return max(low, min(high, round(1200 * math.log2(seconds))))


def _channels(samples: Mapping[Zone, StoredSample]) -> list[_Channel]:
    """The channels of all samples, one or two each, with their first frames."""
    channels: list[_Channel] = []
    start = 0
    for zone, stored in samples.items():
        here = len(channels)
        sides = [("", MONO, 0, 0)]
        if stored.channels == 2:
            sides = [("_L", LEFT, here + 1, -HARD_PAN), ("_R", RIGHT, here, HARD_PAN)]
        for suffix, kind, link, pan in sides:
            channels.append(_Channel(zone, zone.stem + suffix, start, stored.frames, kind, link, pan))
            start += stored.frames + ZEROS_BEHIND
    return channels


def _information(plan: SampledPlan) -> bytes:
    """The chunks of information, of which version, engine and name are compulsory (5)."""
    made_by = f"{PROGRAM} {program_version()}"
    lines = [one_line(plan.instrument.description)] if plan.instrument.description else []
    if plan.every > 1:
        lines.append(f"A sample for every {plan.every} keys; those between are transposed.")
    return b"".join(
        [
            _chunk(b"ifil", struct.pack("<HH", 2, 1)),
            _chunk(b"isng", _text("EMU8000")),
            _chunk(b"INAM", _text(plan.instrument.name)),
            _chunk(b"ICMT", _text(" ".join(lines))) if lines else b"",
            _chunk(b"ISFT", _text(made_by)),
        ]
    )


def _tables(plan: SampledPlan, channels: Sequence[_Channel], attenuations_cb: Mapping[Zone, int]) -> bytes:
    """The nine tables (7.1); each ends with a row of its own that closes it."""
    instrument = plan.instrument
    name = _name(instrument.name)
    release = release_timecents(instrument) & 0xFFFF
    zones: list[list[Generator]] = [[(RELEASE_VOL_ENV, release)]]  # the global zone, for all others (7.7)
    for number, channel in enumerate(channels):
        # key range first, velocity range next, the sample last (8.1.2)
        zone = [(KEY_RANGE, _span(channel.zone.keys)), (VEL_RANGE, _span(channel.zone.velocities))]
        if channel.pan:
            zone.append((PAN, channel.pan & 0xFFFF))
        if instrument.damping.let_ring and channel.zone.keys[0] == channel.zone.keys[1] > 0:
            zone.append((EXCLUSIVE_CLASS, channel.zone.key))  # else a key's tails would pile up
        zones.append([*zone, (SAMPLE_ID, number)])
    modulators = [struct.pack("<HHhHH", source, to, 0, by, 0) for source, to, by in SWITCHED_OFF]
    bags = [struct.pack("<HH", 0, 0)]
    generators = [struct.pack("<HH", *generator) for generator in zones[0]]
    for channel, zone in zip(channels, zones[1:], strict=True):
        bags.append(struct.pack("<HH", len(generators), len(modulators)))
        generators += [struct.pack("<HH", *generator) for generator in zone]
        amount_cb = attenuations_cb[channel.zone]
        modulators.append(struct.pack("<HHhHH", FALLING_VELOCITY, ATTENUATION, amount_cb, 0, 0))
    bags.append(struct.pack("<HH", len(generators), len(modulators)))
    return _list(
        b"pdta",
        b"".join(
            [
                _table(b"phdr", [_preset(name, 0), _preset(b"EOP", 1)]),
                _table(b"pbag", [struct.pack("<HH", 0, 0), struct.pack("<HH", 1, 0)]),
                _table(b"pmod", [bytes(10)]),
                _table(b"pgen", [struct.pack("<HH", INSTRUMENT, 0), bytes(4)]),
                _table(b"inst", [struct.pack("<20sH", name, 0), struct.pack("<20sH", b"EOI", len(zones))]),
                _table(b"ibag", bags),
                _table(b"imod", [*modulators, bytes(10)]),
                _table(b"igen", [*generators, bytes(4)]),
                _table(b"shdr", [*(_header(plan, channel) for channel in channels), struct.pack("<20s26x", b"EOS")]),
            ]
        ),
    )


def _preset(name: bytes, bag: int) -> bytes:
    """The row of a preset in bank 0, program 0 (7.2); `bag`: the number of its first zone."""
    return struct.pack("<20sHHHIII", name, 0, 0, bag, 0, 0, 0)


def _header(plan: SampledPlan, channel: _Channel) -> bytes:
    """The header of a sample: place, in frames, and key (7.10); its loop, not played, has to lie within it."""
    end = channel.start + channel.frames
    places = (channel.start, end, channel.start + 8, end - 8)
    return struct.pack(
        "<20sIIIIIBbHH", _name(channel.name), *places, plan.rate_hz, channel.zone.key, 0, channel.link, channel.kind
    )


def _span(ends: tuple[int, int]) -> int:
    return ends[0] | ends[1] << 8


def _ascii(text: str) -> bytes:
    """Encode a text in ASCII: accents are left out, each letter of other scripts becomes an underscore."""
    plain = (c for c in unicodedata.normalize("NFKD", one_line(text)) if not unicodedata.combining(c))
    return "".join(c if c.isascii() else "_" for c in plain).encode("ascii")


def _name(text: str) -> bytes:
    """Encode a name: at most 19 characters and the zero behind them."""
    return _ascii(text)[:19]


def _text(text: str) -> bytes:
    """Encode a text with one or two zeros behind, to an even length (5)."""
    data = _ascii(text)[:254]
    return data + bytes(2 - len(data) % 2)


def _chunk(name: bytes, data: bytes) -> bytes:
    return name + struct.pack("<I", len(data)) + data


def _list(kind: bytes, data: bytes) -> bytes:
    return _chunk(b"LIST", kind + data)


def _table(name: bytes, rows: Iterable[bytes]) -> bytes:
    return _chunk(name, b"".join(rows))
