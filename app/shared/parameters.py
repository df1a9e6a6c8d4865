"""The table of parameters: each one's identity, range, unit, words and use, declared once.

Knobs, MIDI controllers, the modulation wheel, macros, undo, fields of instruments and of the choices read it. It
needs no engine but the ranges of a pluck, an amplifier, a body and a room.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import KW_ONLY, dataclass, field
from typing import Literal

from app.shared.typed_number import typed_number
from app.shared.vocabulary import DIFFERENCE_GAIN_RANGE_DB
from engine.bounds import (
    AMP_DRIVE_DB,
    AMP_TONE_DB,
    BODY_SIZE,
    LARGEST_AMPLITUDE_MM,
    POSITION_RANGE,
    ROOM_T60_S,
    WIDTH_RANGE,
)
from engine.pluck import DEFAULT_LISTEN

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
SPEED, HERTZ = Taper(1.25, "× {:.3f}", True), Taper(1.05, "{:.1f} Hz", True)


@dataclass(frozen=True)
class Parameter:
    """A number that a player can change.

    The unit is in the format of `taper`.

    Attributes:
        id: its path, in an instrument ("knobs.tension") or in the session's choices ("volume_db"); files hold it.
        label: on a knob.
        limits: the lowest and the highest value.
        group: title of the knobs that it stands with; "": none.
        modulation: what may change it besides its knob: a learned controller, also macros, also the modulation wheel.
        name: in a sentence or a list; empty: the label.
        wheel: its value at the modulation wheel's end; None: `wheel_factor` times its own value.
        figure_unit: unit of the physical figure that its knob shows, see `app.player.facts`; None: none.
        whole: whether it is an integer, as one with words.
        words: for the integers from its lowest on; empty: they are shown as numbers.

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
    tip: str = field(init=False, default="")

    def __post_init__(self) -> None:
        for what, value in (("default", self.default), ("wheel", self.wheel)):
            if value is not None and value != self.clamped(value):
                raise ValueError(f"{self.id}: {what} {value:g} is not within {self.limits[0]:g} … {self.limits[1]:g}")
        object.__setattr__(self, "name", self.name or self.label)
        object.__setattr__(self, "whole", self.whole or bool(self.words))
        object.__setattr__(self, "tip", TIPS.get(self.id, ""))

    @property
    def curve(self) -> float:
        """The curve of its taper; a logarithmic one is curved by the ratio of its limits."""
        return self.limits[1] / self.limits[0] if self.taper.logarithmic else self.taper.curve

    def share(self, value: float) -> float:
        """The share of a value along the range, 0 … 1."""
        (low, high), curve = self.limits, self.curve
        part = (value - low) / (high - low)
        return part if curve == 1.0 else math.log1p(part * (curve - 1)) / math.log(curve)

    def value(self, share: float) -> float:
        """The inverse of `share`, which is limited to 0 … 1."""
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

    def typed(self, text: str) -> float | None:
        """The value that a typed text means, in or out of the range; None: it means none."""
        if text.strip().casefold() in self.words:
            return self.limits[0] + self.words.index(text.strip().casefold())
        number = typed_number(text, self.typed_unit, self.prefix)
        if number is None or (self.whole and not number.is_integer()):
            return None
        return number / 100 if self.typed_unit == "%" else number

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
TIPS = {
    "tuning.a4_hz": "Pitch of A4",
    "tuning.transpose": "Transposition, in keys",
    "knobs.tension": "Tension; the pitch stays, so that the length follows. Tight strings glide less at hard plucks",
    "knobs.length": "Length of the string; the pitch stays, so that the tension follows: longer is tighter",
    "knobs.gauge": "Thickness (diameter) at the same length: thick strings are heavier, tighter and stiffer",
    "knobs.density": "Mass of the material at the same length: gut is light and slack, steel heavy and tight",
    "knobs.modulus": "Stiffness of the material (Young's modulus): how much a hard pluck glides in pitch",
    "knobs.stiffness": "Bending stiffness: more is more metallic. The figure is the inharmonicity B: "
    "partial n of f lies at n f √(1 + B n²)",
    "knobs.decay": "Damping of all partials: right is shorter. The figure is the T60 of the first",
    "knobs.brightness_decay": "Damping of high partials: right is darker. The figure is the T60 of the partial "
    "near 3 kHz",
    "damping.release_t60_s": "Time in which a released key falls by 60 dB",
    "damping.mute": "Palm mute: a hand on the strings at the bridge, so that high partials stop soon. "
    "The larger of knob and MIDI's soft pedal (controller 67) counts",
    "pluck.position": f"Where it is plucked: nearer an end is brighter; {_PLACE_TIP}",
    "pluck.width": "Width of the softest pluck, in lengths of the string: wide is mellow",
    "pluck.width_hard": "Width of the hardest pluck, in lengths of the string: narrow is bright",
    "pluck.softest_mm": "How far the softest key pulls the string",
    "pluck.hardest_mm": "How far the hardest key pulls the string",
    "pluck.curve": "Velocity curve: above 0 middle velocities are louder, below 0 softer",
    "pluck.release_ms": "Time in which the softest pluck releases the string, or the softest hammer touches it: "
    "longer is mellower. 0: at once",
    "pluck.release_hard_ms": "The same of the hardest pluck or hammer",
    "technique.harmonic": "Harmonics: a finger touches the string at 1/n of its length as it is plucked, so that "
    "partial n is the lowest. 1: it does not",
    "technique.strum_ms": "Strum: time from one string of a chord to the next. 0: all at once",
    "technique.strokes": "Strokes of strums: from low to high (down), from high to low (up), or by turns (both)",
    "technique.tremolo_hz": "Tremolo: how often a key that is held plucks its string. 0: once",
    "technique.vibrato_cents": "Vibrato: how far the pitch goes up and down. 0: none",
    "technique.vibrato_hz": "How often a vibrato goes up and down in a second",
    "javari.gap_um": "Javari: from the string at rest to the edge of its bridge, which makes it buzz. "
    "Nearer buzzes more and sooner",
    "noise.onset_db": "Noise of what plucks or strikes: its energy, compared with a note's. The lowest is off",
    "noise.release_db": "Noise of the damper or finger that ends a note. The lowest is off",
    "pickup.points.0": f"Where the string is heard; {_PLACE_TIP}",
    "pickup.points.1": "Where the right channel hears the string; an instrument in mono has none",
    "body.size": "Size of the body: a larger one resonates lower",
    "body.mix": "Mix of the body: 0 % the strings alone, 100 % the body alone",
    "amp.drive_db": "Drive of the amplifier before the body, which may be its cabinet; 0 dB: there is none",
    "amp.tone_db": "Tone of the amplifier: above 0 brighter, below darker, about 700 Hz",
    "room.t60_s": "Time in which the room's reverberation falls by 60 dB",
    "room.mix": "Mix of the room: 0 % without it, 100 % its reverberation alone",
    "bend_semitones": "How far the pitch wheel bends when it is turned all the way",
    "level_db": "Level of the instrument; saved with it",
    "position": "Pluck position; 0 and 1 are the ends of the string",
    "amplitude_mm": "Peak displacement of the pluck",
    "width": "Width of the pluck as a share of the string's length",
    "listen": "Listening point on the string",
    "listen_right": "Listening point of the right channel in stereo; the left is at “listen”",
    "seconds": "Length of a rendered pluck",
    "speed": "Slow motion of the string view, as under a stroboscope; the sound is not slowed",
    "difference_gain_db": "Gain of the difference between model and truth",
    "volume_db": "Playback volume; exported files are not affected",
}


def _knob(
    part: str, label: str, limits: tuple[float, float], unit: str, name: str = "", wheel_factor: float = 4.0
) -> Parameter:
    """A multiplier of the string, which the wheel multiplies at its end; `unit`: of its figure."""
    group, id = DECAY if part in ("decay", "brightness_decay") else STRING, f"knobs.{part}"
    return Parameter(id, label, limits, 1.0, TIMES, group, "wheel", name, wheel_factor=wheel_factor, figure_unit=unit)


def _width(part: str, label: str, default: float, velocity: str) -> Parameter:
    id, name = f"pluck.{part}", f"width ({velocity} velocity)"
    return Parameter(id, label, WIDTH_RANGE, default, WIDTH, PLUCK, "wheel", name, wheel=0.02)


MULTIPLIER = (0.05, 20.0)
AMPLITUDE_MM = (0.001, LARGEST_AMPLITUDE_MM)
STROKES = "down", "up", "both"
NOISE_DB = (-60.0, 6.0)  # the lowest is off
_OF_INSTRUMENTS = (
    Parameter("tuning.a4_hz", "A4", (220, 880), 440, CONCERT_PITCH, PITCH, name="pitch of A4"),
    Parameter(
        "tuning.transpose", "transpose", (-48, 48), 0, Taper(1, "{:+.0f}"), PITCH, name="transposition", whole=True
    ),
    _knob("tension", "tension", (0.0625, 16.0), "N"),  # over which the length goes through its own range
    _knob("length", "length", (0.25, 4.0), "mm", "string length", 2.0),
    _knob("gauge", "gauge", (0.25, 4.0), "mm"),
    _knob("density", "density", MULTIPLIER, "kg/m³"),
    _knob("modulus", "modulus", MULTIPLIER, "GPa"),
    _knob("stiffness", "stiffness", MULTIPLIER, ""),
    _knob("decay", "decay", MULTIPLIER, "s"),
    _knob("brightness_decay", "HF loss", MULTIPLIER, "s"),
    Parameter("damping.release_t60_s", "release", (0.01, 60), 0.3, SECONDS, DECAY, "wheel", wheel_factor=10),
    Parameter("damping.mute", "mute", (0, 1), 0, MUTED, TECHNIQUE, "wheel", "palm mute", wheel=1.0),
    Parameter("pluck.position", "position", POSITION_RANGE, 0.2, PLACE, PLUCK, "wheel", "pluck position", wheel=0.5),
    _width("width", "soft width", 0.12, "low"),
    _width("width_hard", "hard width", 0.06, "high"),
    Parameter("pluck.softest_mm", "softest", AMPLITUDE_MM, 0.1, MM, PLUCK, "macro", "softest amplitude"),
    Parameter(
        "pluck.hardest_mm", "hardest", AMPLITUDE_MM, 3.0, MM, PLUCK, "wheel", "hardest amplitude", wheel_factor=2
    ),
    Parameter(
        "pluck.curve", "curve", (-1, 1), 0, Taper(0.05, "{:+.2f}"), PLUCK, "wheel", "velocity curve", wheel=1.0
    ),
    Parameter("pluck.release_ms", "soft contact", (0, 20), 0, CONTACT, PLUCK, "macro", "contact (low velocity)"),
    Parameter(
        "pluck.release_hard_ms", "hard contact", (0, 20), 0, CONTACT, PLUCK, "macro", "contact (high velocity)"
    ),
    Parameter("javari.gap_um", "javari", (0, 200), 5, Taper(0.02, "{:.1f} µm", curve=100.0), "", "macro"),
    Parameter("noise.onset_db", "stroke", NOISE_DB, NOISE_DB[0], DECIBELS, NOISE, "macro", "stroke noise"),
    Parameter("noise.release_db", "release", NOISE_DB, NOISE_DB[0], DECIBELS, NOISE, "macro", "release noise"),
    Parameter("technique.harmonic", "harmonic", (1, 5), 1, COUNT, TECHNIQUE, "wheel", wheel=2, whole=True),
    Parameter("technique.strum_ms", "strum", (0, 60), 0, Taper(1, "{:.0f} ms"), TECHNIQUE, "wheel", wheel=40),
    Parameter(
        "technique.strokes", "strokes", (0, 2), 0, COUNT, TECHNIQUE, "macro", "strokes of strums", words=STROKES
    ),
    Parameter("technique.tremolo_hz", "tremolo", (0, 16), 0, Taper(0.5, "{:.1f} Hz"), TECHNIQUE, "wheel", wheel=12),
    Parameter(
        "technique.vibrato_cents", "vibrato", (0, 100), 0, CENTS, TECHNIQUE, "wheel", "vibrato depth", wheel=35
    ),
    Parameter("technique.vibrato_hz", "rate", (0.5, 12), 5.5, HERTZ, TECHNIQUE, "wheel", "vibrato rate", wheel=7),
    Parameter("pickup.points.0", "place", (0, 1), DEFAULT_LISTEN, PLACE, PICKUP, "macro", "listening point"),
    Parameter(
        "pickup.points.1", "right", (0, 1), 1 - DEFAULT_LISTEN, PLACE, PICKUP, "macro", "right listening point"
    ),
    Parameter("amp.drive_db", "drive", AMP_DRIVE_DB, 0, Taper(1, "{:.0f} dB"), BODY, "macro", "amplifier drive"),
    Parameter("amp.tone_db", "amp tone", AMP_TONE_DB, 0, Taper(0.5, "{:+.1f} dB"), BODY, "macro", "amplifier tone"),
    Parameter("body.mix", "mix", (0, 1), 0.5, PERCENT, BODY, "wheel", "body mix", wheel=1.0),
    Parameter("body.size", "size", BODY_SIZE, 1.0, TIMES, BODY, "wheel", "body size", wheel_factor=2),
    Parameter("room.mix", "room", (0, 1), 0, PERCENT, BODY, "wheel", wheel=1.0),
    Parameter("room.t60_s", "time", ROOM_T60_S, 1.2, SECONDS, BODY, "wheel", "reverberation time", wheel_factor=3),
    Parameter("bend_semitones", "bend range", (0, 48), 2, Taper(1, "{:g} semitones")),
    Parameter("level_db", "level", (-60, 24), 0, DECIBELS, BODY, "macro"),
)
_OF_CHOICES = (
    Parameter("position", "position", POSITION_RANGE, 0.35, PLACE, modulation="learn", name="pluck position"),
    Parameter(
        "amplitude_mm", "amplitude", (0, LARGEST_AMPLITUDE_MM), 4.0, Taper(0.25, "{:.2f} mm"), modulation="learn"
    ),
    Parameter("width", "width", WIDTH_RANGE, 0.06, WIDTH, modulation="learn", name="pluck width"),
    Parameter("listen", "listen", (0, 1), DEFAULT_LISTEN, PLACE, modulation="learn", name="listening point"),
    Parameter(
        "listen_right", "right", (0, 1), 1 - DEFAULT_LISTEN, PLACE, modulation="learn", name="right listening point"
    ),
    Parameter("seconds", "duration", (0.5, 12), 4.0, Taper(0.5, "{:.1f} s"), modulation="learn"),
    # 1 is real time; a thousandth shows one period of a low string in seconds
    Parameter("speed", "slow-mo", (0.001, 1), 0.004, SPEED, modulation="learn", name="slow motion"),
    Parameter("volume_db", "volume", (-60, 12), 6.0, Taper(1, "{:+.0f} dB"), modulation="learn"),
    Parameter("difference_gain_db", "difference", DIFFERENCE_GAIN_RANGE_DB, 20.0, Taper(10, "{:+.0f} dB")),
)
OF_INSTRUMENTS: Mapping[str, Parameter] = {parameter.id: parameter for parameter in _OF_INSTRUMENTS}
OF_CHOICES: Mapping[str, Parameter] = {parameter.id: parameter for parameter in _OF_CHOICES}
MOST_MACROS = 8  # of an instrument
MACROS: Mapping[str, Parameter] = {
    id: Parameter(id, label, (0, 1), 0.5, PERCENT, modulation="learn")
    for id, label in ((f"macros.{number}", f"macro {number + 1}") for number in range(MOST_MACROS))
}
LEARNABLE: Mapping[str, Parameter] = {  # what a MIDI controller can be assigned to
    id: parameter for id, parameter in {**OF_CHOICES, **MACROS, **OF_INSTRUMENTS}.items() if parameter.allows("learn")
}


def modulated_by(modulation: Modulation) -> Iterator[Parameter]:
    """The parameters of instruments that this kind of modulation may change, in the table's order."""
    return (parameter for parameter in OF_INSTRUMENTS.values() if parameter.allows(modulation))


def in_group(group: str) -> tuple[Parameter, ...]:
    """The parameters of instruments whose knobs stand together."""
    return tuple(parameter for parameter in OF_INSTRUMENTS.values() if parameter.group == group)
