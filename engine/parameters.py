"""The table of an instrument's parameters: each one's identity, range, unit, words and use, declared once.

Fields of instruments, knobs, MIDI controllers, the modulation wheel, macros, undo, plug-ins and kernels read it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import KW_ONLY, dataclass
from typing import Any, Literal

from engine.bounds import (
    AMP_DRIVE_DB,
    AMP_TONE_DB,
    BODY_SIZE,
    LARGEST_AMPLITUDE_MM,
    POSITION_RANGE,
    ROOM_T60_S,
    WIDTH_RANGE,
)

Modulation = Literal["none", "learn", "macro", "wheel"]  # each includes those before it
_ORDER: tuple[Modulation, ...] = ("none", "learn", "macro", "wheel")
PITCH = "PITCH"
STRING = "STRING"
DECAY = "DECAY"
PLUCK = "PLUCK"
PICKUP = "PICK-UP"
BODY = "BODY"
NOISE = "NOISE"
TECHNIQUE = "TECHNIQUE"


@dataclass(frozen=True)
class Taper:
    """The way in which a value moves and reads.

    Attributes:
        step: of an arrow key or a wheel notch, in the value's unit. A ratio above 1 where it is logarithmic; a share
            of the way where it is curved.
        text: format, with the unit.
        curve: how many times as fast the value rises at the end of its range as at the start; 1: evenly.
    """

    step: float
    text: str = "{:.2f}"
    logarithmic: bool = False
    curve: float = 1.0


TIMES = Taper(1.03, "× {:.2f}", True)
MM, SECONDS = Taper(1.1, "{:.2f} mm", True), Taper(1.1, "{:.2f} s", True)
DECIBELS = Taper(0.5, "{:+.1f} dB")
CONTACT = Taper(0.02, "{:.2f} ms", curve=400.0)
MUTED = Taper(0.02, "{:.1%}", curve=40.0)  # by each tenth of the way the T60 of a guitar's string shrinks by a third
PLACE = Taper(0.01)
WIDTH = Taper(1.05, "{:.3f}", True)
PERCENT = Taper(0.02, "{:.0%}")
COUNT = Taper(1, "{:.0f}")
CONCERT_PITCH = Taper(2 ** (1 / 1200), "{:.1f} Hz", True)
CENTS = Taper(1, "{:.0f} cents")
CURVE = Taper(0.05, "{:+.2f}")
HERTZ = Taper(1.05, "{:.1f} Hz", True)


@dataclass(frozen=True)
class Parameter:
    """A number that a player can change.

    The unit is in the format of `taper`.

    Attributes:
        id: its path, in an instrument ("knobs.tension") or in the session's choices ("volume_db"); files hold it.
        label: on a knob.
        limits: the lowest and the highest value.
        group: title of the knobs that it stands with; "": none.
        modulation: what may change it besides its knob: a learned controller, also macros, also the modulation wheel,
            which may where it has an end.
        name: in a sentence or a list; empty: the label.
        wheel: its value at the modulation wheel's end; None: `wheel_factor` times its own value.
        figure_unit: unit of the physical figure that its knob shows, see `app.player.facts`; None: none.
        whole: whether it is an integer, as one with words.
        words: for the integers from its lowest on; empty: they are shown as numbers.
        played: its number among the values that kernels play, a new one's is the next; None: it is none of them.
        drums: whether drums follow it, too, where kernels play it.
        tip: a sentence about it.

    Raises:
        ValueError: the default, or the wheel's end, is outside the limits.
    """

    id: str
    label: str
    limits: tuple[float, float]
    default: float
    taper: Taper
    group: str = ""
    modulation: Modulation = "none"
    name: str = ""
    _: KW_ONLY
    wheel: float | None = None
    wheel_factor: float = 1.0
    figure_unit: str | None = None
    whole: bool = False
    words: tuple[str, ...] = ()
    played: int | None = None
    drums: bool = False
    tip: str = ""

    def __post_init__(self) -> None:
        for what, value in (("default", self.default), ("wheel", self.wheel)):
            if value is not None and value != self.clamped(value):
                raise ValueError(f"{self.id}: {what} {value:g} is not within {self.limits[0]:g} … {self.limits[1]:g}")
        object.__setattr__(self, "name", self.name or self.label)
        object.__setattr__(self, "whole", self.whole or bool(self.words))
        if self.wheel is not None or self.wheel_factor != 1.0:
            object.__setattr__(self, "modulation", "wheel")

    @property
    def curve(self) -> float:
        """The curve of its taper; a logarithmic one is curved by the ratio of its limits."""
        return self.limits[1] / self.limits[0] if self.taper.logarithmic else self.taper.curve

    def share(self, value: float) -> float:
        """The share of the way along the range, 0 … 1, at which a knob shows the value."""
        (low, high), curve = self.limits, self.curve
        part = (value - low) / (high - low)
        return part if curve == 1.0 else math.log1p(part * (curve - 1)) / math.log(curve)

    def value(self, share: float) -> float:
        """The value at a share of the way, which is limited to 0 … 1: the inverse of `share`."""
        low, high = self.limits
        curve = self.curve
        share = min(max(share, 0.0), 1.0)
        part = share if curve == 1.0 else (curve**share - 1) / (curve - 1)
        return self.clamped(low + part * (high - low))

    def stepped(self, value: float, steps: float) -> float:
        """The value moved by so many steps, within the range."""
        step = self.taper.step
        if self.taper.logarithmic:
            return self.clamped(value * step**steps)
        if self.taper.curve != 1.0:
            return self.value(self.share(value) + step * steps)
        return self.clamped(value + step * steps)

    def clamped(self, value: float) -> float:
        return min(max(value, self.limits[0]), self.limits[1])

    def shown(self, value: float) -> str:
        """The value with its unit."""
        if self.words:
            return self.words[round(self.clamped(value) - self.limits[0])]
        return self.taper.text.format(value)

    @property
    def typed_unit(self) -> str:
        """The unit of a typed number: as `unit`, and "%" where a share is shown so."""
        return "%" if "%}" in self.taper.text else self.unit

    @property
    def prefix(self) -> str:
        """The beginning of `shown`: "×", or ""."""
        return self.taper.text.partition("{")[0].strip()

    @property
    def unit(self) -> str:
        """The unit at the end of `shown`; "" for a bare number."""
        return self.taper.text.rpartition("}")[2].strip()

    def allows(self, modulation: Modulation) -> bool:
        """Return True if this kind of modulation may change it."""
        return _ORDER.index(self.modulation) >= _ORDER.index(modulation)


_PLACE_TIP = "0 and 1 are the ends of the string, 0.5 its middle"


def _knob(part: str, label: str, limits: tuple[float, float], unit: str, name: str = "", **others: Any) -> Parameter:
    """A multiplier of the string, which the wheel multiplies at its end; `unit`: of its figure."""
    group, id = DECAY if part in ("decay", "brightness_decay") else STRING, f"knobs.{part}"
    others.setdefault("wheel_factor", 4.0)
    return Parameter(id, label, limits, 1.0, TIMES, group, name=name, figure_unit=unit, **others)


def _width(part: str, label: str, default: float, velocity: str, **others: Any) -> Parameter:
    """A width of plucks in lengths of the string; `velocity`: which of them it is for, "low" or "high"."""
    id, name = f"pluck.{part}", f"width ({velocity} velocity)"
    return Parameter(id, label, WIDTH_RANGE, default, WIDTH, PLUCK, name=name, wheel=0.02, **others)


def by_id(rows: Iterable[Parameter]) -> Mapping[str, Parameter]:
    """The table of these rows, by their ids."""
    return {row.id: row for row in rows}


MULTIPLIER = (0.05, 20.0)
PULL_MM = (0.001, LARGEST_AMPLITUDE_MM)
STROKES = "down", "up", "both"
OFF_DB = -60.0  # no noise at all
NOISE_DB = (OFF_DB, 6.0)
LISTEN = 0.37  # no low mode is still there
_OF_INSTRUMENTS = (
    Parameter("tuning.a4_hz", "A4", (220, 880), 440, CONCERT_PITCH, PITCH, name="pitch of A4", tip="Pitch of A4"),
    Parameter(
        "tuning.transpose",
        "transpose",
        (-48, 48),
        0,
        Taper(1, "{:+.0f}"),
        PITCH,
        name="transposition",
        whole=True,
        tip="Transposition, in keys",
    ),
    _knob(
        "tension",
        "tension",
        (0.0625, 16.0),
        "N",
        played=6,
        tip="Tension; the pitch stays, so that the length follows. Tight strings glide less at hard plucks",
    ),
    _knob(
        "length",
        "length",
        (0.25, 4.0),
        "mm",
        "string length",
        wheel_factor=2.0,
        played=7,
        tip="Length of the string; the pitch stays, so that the tension follows: longer is tighter",
    ),
    _knob(
        "gauge",
        "gauge",
        (0.25, 4.0),
        "mm",
        played=5,
        tip="Thickness (diameter) at the same length: thick strings are heavier, tighter and stiffer",
    ),
    _knob(
        "density",
        "density",
        MULTIPLIER,
        "kg/m³",
        played=4,
        tip="Mass of the material at the same length: gut is light and slack, steel heavy and tight",
    ),
    _knob(
        "modulus",
        "modulus",
        MULTIPLIER,
        "GPa",
        played=3,
        drums=True,
        tip="Stiffness of the material (Young's modulus): how much a hard pluck glides in pitch",
    ),
    _knob(
        "stiffness",
        "stiffness",
        MULTIPLIER,
        "",
        played=0,
        tip=(
            "Bending stiffness: more is more metallic. The figure is the inharmonicity B: partial n of f lies at "
            "n f √(1 + B n²)"
        ),
    ),
    _knob(
        "decay",
        "decay",
        MULTIPLIER,
        "s",
        played=1,
        drums=True,
        tip="Damping of all partials: right is shorter. The figure is the T60 of the first",
    ),
    _knob(
        "brightness_decay",
        "HF loss",
        MULTIPLIER,
        "s",
        played=2,
        drums=True,
        tip="Damping of high partials: right is darker. The figure is the T60 of the partial near 3 kHz",
    ),
    Parameter(
        "damping.release_t60_s",
        "release",
        (0.01, 60),
        0.3,
        SECONDS,
        DECAY,
        wheel_factor=10,
        played=16,
        drums=True,
        tip="Time in which a released key falls by 60 dB",
    ),
    Parameter(
        "damping.mute",
        "mute",
        (0, 1),
        0,
        MUTED,
        TECHNIQUE,
        name="palm mute",
        wheel=1.0,
        played=20,
        tip=(
            "Palm mute: a hand on the strings at the bridge, so that high partials stop soon. The larger of knob "
            "and MIDI's soft pedal (controller 67) counts"
        ),
    ),
    Parameter(
        "pluck.position",
        "position",
        POSITION_RANGE,
        0.2,
        PLACE,
        PLUCK,
        name="pluck position",
        wheel=0.5,
        played=8,
        tip=f"Where it is plucked: nearer an end is brighter; {_PLACE_TIP}",
    ),
    _width(
        "width",
        "soft width",
        0.12,
        "low",
        played=9,
        tip="Width of the softest pluck, in lengths of the string: wide is mellow",
    ),
    _width(
        "width_hard",
        "hard width",
        0.06,
        "high",
        played=10,
        tip="Width of the hardest pluck, in lengths of the string: narrow is bright",
    ),
    Parameter(
        "pluck.softest_mm",
        "softest",
        PULL_MM,
        0.1,
        MM,
        PLUCK,
        "macro",
        "softest amplitude",
        played=11,
        tip="How far the softest key pulls the string",
    ),
    Parameter(
        "pluck.hardest_mm",
        "hardest",
        PULL_MM,
        3.0,
        MM,
        PLUCK,
        name="hardest amplitude",
        wheel_factor=2,
        played=12,
        tip="How far the hardest key pulls the string",
    ),
    Parameter(
        "pluck.curve",
        "curve",
        (-1, 1),
        0,
        CURVE,
        PLUCK,
        name="velocity curve",
        wheel=1.0,
        played=15,
        drums=True,
        tip="Velocity curve: above 0 middle velocities are louder, below 0 softer",
    ),
    Parameter(
        "pluck.release_ms",
        "soft contact",
        (0, 20),
        0,
        CONTACT,
        PLUCK,
        "macro",
        "contact (low velocity)",
        played=13,
        tip=(
            "Time in which the softest pluck releases the string, or the softest hammer touches it: longer is "
            "mellower. 0: at once"
        ),
    ),
    Parameter(
        "pluck.release_hard_ms",
        "hard contact",
        (0, 20),
        0,
        CONTACT,
        PLUCK,
        "macro",
        "contact (high velocity)",
        played=14,
        tip="The same of the hardest pluck or hammer",
    ),
    Parameter(
        "javari.gap_um",
        "javari",
        (0, 200),
        5,
        Taper(0.02, "{:.1f} µm", curve=100.0),
        "",
        "macro",
        played=27,
        tip=(
            "Javari: from the string at rest to the edge of its bridge, which makes it buzz. Nearer buzzes more "
            "and sooner"
        ),
    ),
    Parameter(
        "noise.onset_db",
        "stroke",
        NOISE_DB,
        OFF_DB,
        DECIBELS,
        NOISE,
        "macro",
        "stroke noise",
        played=18,
        drums=True,
        tip="Noise of what plucks or strikes: its energy, compared with a note's. The lowest is off",
    ),
    Parameter(
        "noise.release_db",
        "release",
        NOISE_DB,
        OFF_DB,
        DECIBELS,
        NOISE,
        "macro",
        "release noise",
        played=19,
        tip="Noise of the damper or finger that ends a note. The lowest is off",
    ),
    Parameter(
        "technique.harmonic",
        "harmonic",
        (1, 5),
        1,
        COUNT,
        TECHNIQUE,
        wheel=2,
        whole=True,
        played=21,
        tip=(
            "Harmonics: a finger touches the string at 1/n of its length as it is plucked, so that partial n is "
            "the lowest. 1: it does not"
        ),
    ),
    Parameter(
        "technique.strum_ms",
        "strum",
        (0, 60),
        0,
        Taper(1, "{:.0f} ms"),
        TECHNIQUE,
        wheel=40,
        played=22,
        tip="Strum: time from one string of a chord to the next. 0: all at once",
    ),
    Parameter(
        "technique.strokes",
        "strokes",
        (0, 2),
        0,
        COUNT,
        TECHNIQUE,
        "macro",
        "strokes of strums",
        words=STROKES,
        played=23,
        tip="Strokes of strums: from low to high (down), from high to low (up), or by turns (both)",
    ),
    Parameter(
        "technique.tremolo_hz",
        "tremolo",
        (0, 16),
        0,
        Taper(0.5, "{:.1f} Hz"),
        TECHNIQUE,
        wheel=12,
        played=24,
        tip="Tremolo: how often a key that is held plucks its string. 0: once",
    ),
    Parameter(
        "technique.vibrato_cents",
        "vibrato",
        (0, 100),
        0,
        CENTS,
        TECHNIQUE,
        name="vibrato depth",
        wheel=35,
        played=25,
        tip="Vibrato: how far the pitch goes up and down. 0: none",
    ),
    Parameter(
        "technique.vibrato_hz",
        "rate",
        (0.5, 12),
        5.5,
        HERTZ,
        TECHNIQUE,
        name="vibrato rate",
        wheel=7,
        played=26,
        tip="How often a vibrato goes up and down in a second",
    ),
    Parameter(
        "pickup.points.0",
        "place",
        (0, 1),
        LISTEN,
        PLACE,
        PICKUP,
        "macro",
        "listening point",
        played=29,
        drums=True,
        tip=f"Where the string is heard; {_PLACE_TIP}",
    ),
    Parameter(
        "pickup.points.1",
        "right",
        (0, 1),
        1 - LISTEN,
        PLACE,
        PICKUP,
        "macro",
        "right listening point",
        played=30,
        drums=True,
        tip="Where the right channel hears the string; an instrument in mono has none",
    ),
    Parameter(
        "amp.drive_db",
        "drive",
        AMP_DRIVE_DB,
        0.0,
        Taper(1, "{:.0f} dB"),
        BODY,
        "macro",
        "amplifier drive",
        tip="Drive of the amplifier before the body, which may be its cabinet; 0 dB: there is none",
    ),
    Parameter(
        "amp.tone_db",
        "amp tone",
        AMP_TONE_DB,
        0.0,
        Taper(0.5, "{:+.1f} dB"),
        BODY,
        "macro",
        "amplifier tone",
        tip="Tone of the amplifier: above 0 brighter, below darker, about 700 Hz",
    ),
    Parameter(
        "body.mix",
        "mix",
        (0, 1),
        0.5,
        PERCENT,
        BODY,
        name="body mix",
        wheel=1.0,
        played=28,
        tip="Mix of the body: 0 % the strings alone, 100 % the body alone",
    ),
    Parameter(
        "body.size",
        "size",
        BODY_SIZE,
        1.0,
        TIMES,
        BODY,
        name="body size",
        wheel_factor=2,
        tip="Size of the body: a larger one resonates lower",
    ),
    Parameter(
        "room.mix",
        "room",
        (0, 1),
        0.0,
        PERCENT,
        BODY,
        wheel=1.0,
        tip="Mix of the room: 0 % without it, 100 % its reverberation alone",
    ),
    Parameter(
        "room.t60_s",
        "time",
        ROOM_T60_S,
        1.2,
        SECONDS,
        BODY,
        name="reverberation time",
        wheel_factor=3,
        tip="Time in which the room's reverberation falls by 60 dB",
    ),
    Parameter(
        "bend_semitones",
        "bend range",
        (0, 48),
        2,
        Taper(1, "{:g} semitones"),
        played=17,
        tip="How far the pitch wheel bends when it is turned all the way",
    ),
    Parameter(
        "level_db", "level", (-60, 24), 0, DECIBELS, BODY, "macro", tip="Level of the instrument; saved with it"
    ),
)
OF_INSTRUMENTS = by_id(_OF_INSTRUMENTS)
# Kernels keep the values of a part together: multipliers of strings, plucks, all others, then body and pick-up
_ORDER_OF_PARTS: Mapping[str, int] = {"knobs": 0, "pluck": 1, "body": 3, "pickup": 4}


def _played(rows: Iterable[Parameter]) -> tuple[str, ...]:
    """The ids of the parameters that kernels play, in the order of their values."""
    places = {}
    for row in rows:
        if row.played is not None:
            places[row.id] = _ORDER_OF_PARTS.get(row.id.partition(".")[0], 2), row.played
    return tuple(sorted(places, key=places.__getitem__))


PLAYED = _played(OF_INSTRUMENTS.values())
