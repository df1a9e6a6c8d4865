"""The plan of the samples of an instrument: which keys, at which velocities, for how long, and what that takes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from app.instruments.instrument import VELOCITIES, Instrument
from app.instruments.tuning import Tuning
from app.player.effects import channels_of
from engine import bounds

SampleFormat = Literal["flac", "wav"]
SampleBits = Literal["16", "24"]
SampledSource = Literal["model", "truth"]
FORMATS: tuple[SampleFormat, ...] = get_args(SampleFormat)
SAMPLE_BITS: tuple[SampleBits, ...] = get_args(SampleBits)

MOST_LAYERS = 32
WIDEST_STEP = 12  # keys from one sample to the next
SECONDS_RANGE = (0.1, 60.0)
SAMPLED_RATE_RANGE_HZ = (8_000, 192_000)
RANGES = {
    "every": (1, WIDEST_STEP),
    "layers": (1, MOST_LAYERS),
    "seconds": SECONDS_RANGE,
    "rate_hz": SAMPLED_RATE_RANGE_HZ,
}


@dataclass(frozen=True)
class Zone:
    """A sample: the key and velocity that it is rendered at, and those it sounds for (both ends count)."""

    key: int
    velocity: int
    keys: tuple[int, int]
    velocities: tuple[int, int]

    @property
    def stem(self) -> str:
        """The name of its file without suffix: from numbers alone, so that no name becomes part of a path."""
        return f"key{self.key:03d}_vel{self.velocity:03d}"


@dataclass(frozen=True)
class SampledPlan:
    """The plan of what is rendered.

    Attributes:
        keys: the lowest and the highest MIDI key; None: all of the instrument's range.
        every: one of so many keys is sampled; the others transpose its samples. 1 transposes none.
        layers: velocity layers, of equal widths; each is rendered at the velocity whose pitch glide is nearest to the
            middle of all that it sounds for.
        seconds: the longest sample. One that is silent sooner ends there; one that still rings is faded out.

    Raises:
        ValueError: a value is out of its range; the message names it.
    """

    instrument: Instrument
    keys: tuple[int, int] | None = None
    every: int = 1
    layers: int = 4
    seconds: float = 8.0
    rate_hz: int = 48_000
    format: SampleFormat = "flac"
    bits: SampleBits = "24"
    source: SampledSource = "model"

    def __post_init__(self) -> None:
        bounds.check_choice("format", self.format, FORMATS)
        bounds.check_choice("bits", self.bits, SAMPLE_BITS)
        bounds.check_all(self, RANGES)
        (low, high), (lowest, highest) = self.key_range, self.instrument.range
        if not lowest <= low <= high <= highest:
            raise ValueError(
                f"keys must be a range within the instrument's own, {lowest}-{highest}, not {low}-{high}"
            )
        if self.every > 1 and (self.instrument.tuning.scale or self.instrument.tuning.keymap):
            raise ValueError(
                "every must be 1: transposed by semitones, samples would leave the instrument's own tuning; "
                "sample every key, or remove the scale"
            )
        if not self.zones:
            raise ValueError("keys: the instrument's tuning leaves all of them out; choose others")

    @property
    def key_range(self) -> tuple[int, int]:
        return self.keys or self.instrument.range

    @cached_property
    def zones(self) -> tuple[Zone, ...]:
        """The zones by key, then by velocity. Keys that the tuning leaves out are silent, and have none."""
        return tuple(self._zone(keys, velocities) for keys in self._key_spans() for velocities in self._layers())

    @property
    def pitch_error_cents(self) -> float:
        """The largest error of the pitch at which a note starts: a sample has the glide of one velocity."""
        return max(float(self._glide_errors_cents(zone)[zone.velocity - zone.velocities[0]]) for zone in self.zones)

    @property
    def channels(self) -> int:
        return channels_of(self.instrument)

    @property
    def largest_bytes(self) -> int:
        """The size of all samples if each lasted `seconds` and none were compressed."""
        frames = round(self.seconds * self.rate_hz)
        return len(self.zones) * frames * self.channels * int(self.bits) // 8

    def file_name(self, zone: Zone) -> str:
        return f"{zone.stem}.{self.format}"

    def _zone(self, keys: tuple[int, int], velocities: tuple[int, int]) -> Zone:
        """The zone of such keys and velocities. It is rendered at the hardest of equally good velocities."""
        hardest = Zone(keys[0] + (keys[1] - keys[0]) // 2, velocities[1], keys, velocities)
        errors = self._glide_errors_cents(hardest)
        return replace(hardest, velocity=velocities[1] - int(errors[::-1].argmin()))

    def _glide_errors_cents(self, zone: Zone) -> NDArray[np.float64]:
        """The largest error of the glides of all notes of a zone, by velocity that it may be rendered at.

        Zeros where the string of its key is impossible, as rendering it then reports.
        """
        (low, high), (softest, hardest) = zone.keys, zone.velocities
        glides = self._glides_cents[:, softest : hardest + 1]
        notes, rendered = glides[low : high + 1], glides[zone.key]
        notes = notes[np.isfinite(notes)]
        if not np.isfinite(rendered).all():
            return np.zeros(len(rendered))
        return np.maximum(notes.max() - rendered, rendered - notes.min())

    @cached_property
    def _glides_cents(self) -> NDArray[np.float64]:
        """Pitch glides by key and velocity, (128, 128) in cents; a row of NaN for a key without a string."""
        from app.player.glide import glides_cents  # brings torch

        return glides_cents(self.instrument)

    def _key_spans(self) -> list[tuple[int, int]]:
        """The lowest and the highest key of each sample, from low to high; the tuning may leave keys out."""
        low, high = self.key_range
        spans = [(first, min(first + self.every - 1, high)) for first in range(low, high + 1, self.every)]
        if self.every > 1:  # of an equal tuning, which has all keys
            return spans
        tuning = Tuning(self.instrument.tuning)
        return [span for span in spans if tuning.mapped(span[0])]

    def _layers(self) -> list[tuple[int, int]]:
        """The softest and the hardest velocity of each layer, from soft to hard."""
        most = VELOCITIES[1]
        return [(1 + n * most // self.layers, (n + 1) * most // self.layers) for n in range(self.layers)]
