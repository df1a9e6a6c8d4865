"""An instrument: everything that it is, as one checked and immutable value.

Lengths, areas and tensions are those of physics, in SI units; places on the string are in its lengths, from 0 to 1.
All values are checked against bounds here. The pitch of keys is in `tuning`, the files of instruments in `library`.
"""

from __future__ import annotations

import contextlib
import itertools
from dataclasses import replace
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import AfterValidator, Field, model_validator

from app.instruments.drums import Drums
from app.instruments.fields import (
    LONGEST_NAME,
    Flag,
    Key,
    Name,
    Reference,
    Rows,
    Share,
    String,
    Text,
    filled,
    parameter,
    ranged,
)
from app.instruments.tuning import TuningChoice
from app.shared.parameters import MOST_MACROS, modulated_by
from app.shared.value import Value
from engine import bounds
from engine.contact import Exciter
from engine.kernels import velocities
from engine.parameters import OF_INSTRUMENTS
from engine.pluck import DEFAULT_LISTEN, Pluck, Shape
from engine.schema import explained
from engine.values.ear import Ear
from engine.values.ear import Pickup as PickupKind
from engine.values.effects import Amp, Room
from engine.values.string import Losses, Polarisations

Category = Literal["guitar", "bass", "harp", "keys", "world", "drums", "experimental"]
CATEGORIES: tuple[Category, ...] = get_args(Category)
Mode = Literal["poly", "guitar", "mpe"]
ASSIGNABLE = tuple(knob.id for knob in modulated_by("macro"))  # what macros may turn
WHEEL = tuple(knob.id for knob in modulated_by("wheel"))  # what the modulation wheel may turn

MOST_STRINGS = 128
MOST_TARGETS = 8
VELOCITIES = (1, 127)


class Fretted(Value):
    """A string that is shortened for each key to the length of its pitch."""

    kind: Literal["fretted"] = "fretted"
    string: String


class OpenString(Value):
    """A string of a set, and the MIDI key of its whole length."""

    note: Key
    string: String


class StringSet(Value):
    """Strings by rising open note. A key shortens the highest at or below it; below all, it slackens the lowest."""

    kind: Literal["set"] = "set"
    strings: Annotated[tuple[OpenString, ...], Field(min_length=1, max_length=MOST_STRINGS)]

    @model_validator(mode="after")
    def _rise(self) -> Self:
        notes = [string.note for string in self.strings]
        if any(low >= high for low, high in itertools.pairwise(notes)):
            raise ValueError("strings must be listed by rising note, each note once; put them in order")
        return self


class Knobs(Rows, part="knobs"):
    """Multipliers of the strings' own values; 1 leaves them as they are.

    The tuning says which pitch a key has. At one pitch and one mass the tension goes with the square of the length,
    f = √(T₀/ρA) / 2ℓ for a flexible string. So `tension` and `length` each change the other, and both multiply.
    A heavier string (`density`, `gauge`) is tighter at the length that it has.

    Attributes:
        stiffness: of the second moment of area alone.
        decay, brightness_decay: of d₁ and d₃.
        gauge: of the radius: the area grows with its square, the second moment with its fourth power.
    """


class PluckChoices(Rows, part="pluck"):
    """The pluck of a string by a key. Widths are as in `engine.pluck.Pluck`; a triangle has none.

    Attributes:
        width, width_hard: of the softest and of the hardest pluck; between them a step of velocity is a ratio.
        softest_mm, hardest_mm: amplitudes of velocity 1 and 127; between them a step of velocity is a step in dB.
        curve: 0 is even; towards 1 the middle velocities are louder, towards -1 softer.
        stops: whether what plucks a string that rings stops it first, as a finger or a plectrum does. Otherwise the
            pluck is added to the motion, as under a hammer.
        strikes: whether a hammer strikes the string, as wide as the shape, for the time of `release_ms`, by
            `engine.excitation.blow_factor`. `softest_mm` and `hardest_mm` are heights of the wave that it sends out.
            Triangles, rounded or not, are no hammers: they pluck.
        release_ms, release_hard_ms: time in which the softest and the hardest pluck release the string; between
            them a step of velocity is a ratio. Slower is mellower. Either 0: at once.
        variation: spread of place, force, width, angle and release from stroke to stroke. Comparisons of model
            and truth leave it out.
    """

    shape: Shape = "triangular"
    position: float = parameter("pluck.position")
    width: float = parameter("pluck.width")
    width_hard: float = parameter("pluck.width_hard")
    softest_mm: float = parameter("pluck.softest_mm")
    hardest_mm: float = parameter("pluck.hardest_mm")
    curve: float = parameter("pluck.curve")
    stops: Flag = True
    strikes: Flag = False
    release_ms: float = parameter("pluck.release_ms")
    release_hard_ms: float = parameter("pluck.release_hard_ms")
    variation: Share = 0.0

    @model_validator(mode="after")
    def _softest_is_softer(self) -> Self:
        if self.softest_mm > self.hardest_mm:
            raise ValueError("softest_mm must not be above hardest_mm; lower it")
        return self

    def pluck(self, velocity: float) -> Pluck:
        """The pluck of a velocity in 1 … 127, which need not be an integer; others count as the nearest."""
        share = velocities.share(velocity, self.curve)
        return Pluck(shape=self.shape).nearest(  # a power of a ratio may miss its end
            position=self.position,
            amplitude_mm=velocities.between(self.softest_mm, self.hardest_mm, share),
            width=velocities.between(self.width, self.width_hard, share),
        )

    def velocity_of(self, amplitude_mm: float) -> int:
        """The velocity, 1 … 127, whose pluck is nearest in amplitude."""
        return velocities.velocity(self.softest_mm, self.hardest_mm, amplitude_mm, self.curve)

    @property
    def is_blow(self) -> bool:
        """Return True if a hammer strikes: strings then begin with speeds in place of displacements."""
        return self.strikes and self.shape in ("gaussian", "raised_cosine")


class Pickup(Value):
    """The place where the string is heard, as displacement, velocity or force at the bridge.

    Attributes:
        points: one, or left and right, in lengths of the string.
        aperture_mm: of a magnetic pick-up, the length of string over which it averages.
        flux_mm: of a magnetic pick-up, the displacement for an e-fold growth of its flux: a curve, by
            `engine.kernels.voice`. 0: it grows evenly, without distortion.
    """

    points: Annotated[tuple[Share, ...], Field(min_length=1, max_length=2)] = (DEFAULT_LISTEN,)
    kind: PickupKind = "displacement"
    aperture_mm: Annotated[float, ranged(0, 80)] = 0.0
    flux_mm: Annotated[float, ranged(0, 100)] = 0.0

    @model_validator(mode="after")
    def _curves_gently(self) -> Self:
        if 0 < self.flux_mm < 1:
            raise ValueError("flux_mm must be 0 or at least 1; raise it")
        return self

    @property
    def ear(self) -> Ear:
        """The ear as the engine takes it, with all modes."""
        return Ear(self.points, self.kind)


class Course(Value):
    """Strings of a key that sound together, each with its own voice.

    Attributes:
        strings: how many they are.
        octaves: of a set of strings, how many of the lowest have an octave string as their second.
        cents: between strings of a course. It varies from key to key by half at most.
        apart_ms: from the stroke of one string to that of the next.
        bridge: share of the loss at the bridge, by `polarisations`, that unisons have in common, 0 … 1.
    """

    strings: Annotated[int, Field(ge=1, le=3)] = 1
    octaves: Annotated[int, Field(ge=0, le=8)] = 0
    cents: Annotated[float, ranged(0, 50)] = 0.0
    apart_ms: Annotated[float, ranged(0, 50)] = 0.0
    bridge: Annotated[float, ranged(0, 1)] = 0.0


class Javari(Rows, part="javari"):
    """The edge of a wide bridge, which the string meets from above, by `engine.kernels.javari`; first polarisation.

    Attributes:
        distance_mm: of the edge from the string's end; 0: there is none.
        gap_um: from the string at rest to the edge.
        stiffness_n_m, loss_s_m: of the edge.
    """

    distance_mm: Annotated[float, ranged(0, 50)] = 0.0
    gap_um: float = parameter("javari.gap_um")
    stiffness_n_m: Annotated[float, ranged(1e3, 1e6)] = 3e4
    loss_s_m: Annotated[float, ranged(0, 10)] = 0.2


class Noise(Rows, part="noise"):
    """Noise of what touches strings, by `engine.contact`; comparisons of model and truth leave it out.

    Attributes:
        kind: what plucks or strikes, as a finger.
        onset_db, release_db: energy of the noise of a stroke at velocity 100 and of a release, in dB re the first
            0.4 s of a note. The lowest value is off.
    """

    kind: Exciter = "finger"
    onset_db: float = parameter("noise.onset_db")
    release_db: float = parameter("noise.release_db")


class Damping(Rows, part="damping"):
    """The effect of releasing a key: none (`let_ring`), or all partials decay by 60 dB in `release_t60_s`.

    Attributes:
        mute: how far a hand at the bridge mutes the strings, 0 … 1.
    """

    release_t60_s: float = parameter("damping.release_t60_s")
    mute: float = parameter("damping.mute")
    let_ring: Flag = False


class Technique(Rows, part="technique"):
    """The technique that keys are played with. MIDI's footswitches 80, 81 and 82 switch on what is off here.

    A chord, for strums, is what begins within 30 ms.
    """


class BodyChoice(Rows, part="body"):
    """The body of the instrument: the name of an impulse response ("": none), mix and size (1: as it is)."""

    name: Reference = ""
    mix: float = parameter("body.mix")
    size: float = parameter("body.size")


class MacroTarget(Value):
    """A field that a macro changes, by its path, as "knobs.tension", and its values at macro positions 0 and 1."""

    field: str
    low: Annotated[float, ranged(-1e6, 1e6)]
    high: Annotated[float, ranged(-1e6, 1e6)]


class Macro(Value):
    """A knob that changes several fields; `value` is its position."""

    name: Annotated[str, Field(max_length=24), AfterValidator(filled)]
    value: Share = 0.5
    targets: Annotated[tuple[MacroTarget, ...], Field(min_length=1, max_length=MOST_TARGETS)]

    def nearest(self, instrument: Instrument) -> float:
        """The position, 0 … 1, that fits an instrument's values best: the mean over its targets."""
        places = [
            min(1.0, max(0.0, (instrument.value(target.field) - target.low) / (target.high - target.low)))
            for target in self.targets
            if target.high != target.low
        ]
        return sum(places) / len(places) if places else self.value


class Instrument(Value):
    """An instrument: strings or drums, the model that plays them, pluck, pick-up, knobs, body and room.

    Attributes:
        preset: the model that plays it, by the name of a preset of many strings; never a path.
        range: the lowest and the highest key that sound.
        losses: None: strings decay by d₁ and d₃ alone, and through the bridge.
        sympathy_s_kg: conductance of the bridge through which strings at rest ring with those that are played. 0:
            none do. They are the strings of all keys where strings are let ring, else the open strings of a set.
        polarisations: None: strings move in one direction alone, and lose nothing at a bridge.
        mode: "poly": a string for each key; "guitar": a string for each MIDI channel; "mpe": a channel for each note.
        bend_by: whether the pitch wheel changes the tension, as a bent string, or the length, as a slide.
        mod_wheel: one of WHEEL, or "none".
        level_db: gain of its sound.
        macros: their values do nothing until a macro is turned (`turned`), which sets the fields of its targets.
    """

    version: Literal[1] = 1
    name: Name
    category: Category
    description: Text = ""
    author: Text = ""
    preset: Name = "studio_any_string"
    strings: Annotated[Fretted | StringSet | Drums, Field(discriminator="kind")]
    knobs: Knobs = Knobs()
    range: tuple[Key, Key] = (28, 88)
    pluck: PluckChoices = PluckChoices()
    pickup: Pickup = Pickup()
    course: Course = Course()
    javari: Javari = Javari()
    polarisations: Polarisations | None = None
    losses: Losses | None = None
    sympathy_s_kg: Annotated[float, ranged(0, 0.5)] = 0.0
    noise: Noise = Noise()
    damping: Damping = Damping()
    technique: Technique = Technique()
    mode: Mode = "poly"
    bend_semitones: float = parameter("bend_semitones")
    bend_by: Literal["tension", "length"] = "tension"
    mod_wheel: str = "none"
    tuning: TuningChoice = TuningChoice()
    amp: Amp = Amp()
    body: BodyChoice = BodyChoice()
    room: Room = Room()
    level_db: float = parameter("level_db")
    macros: Annotated[tuple[Macro, ...], Field(max_length=MOST_MACROS)] = ()

    def _check_strings(self) -> None:
        """Raise ValueError: bridge edge or course do not fit the strings, or drums, or each other."""
        has_edge = self.javari.distance_mm > 0
        if has_edge and isinstance(self.strings, Drums):
            raise ValueError("javari.distance_mm: drums have no strings; leave it out")
        if has_edge and self.course.bridge > 0:
            both = "strings with course.bridge above 0 have no edge; set one of both to 0"
            raise ValueError(f"javari.distance_mm: {both}")
        if isinstance(self.strings, Drums) and self.course.strings > 1:
            raise ValueError("course: drums have no strings; leave it out")
        count = len(self.strings.strings) if isinstance(self.strings, StringSet) else 0
        if self.course.octaves > count:
            raise ValueError(f"course.octaves: {self.course.octaves} is above the number of open strings, {count}")

    @model_validator(mode="after")
    def _parts_fit(self) -> Self:
        """Raise ValueError: see the checks; also the range is reversed, or the wheel turns what it cannot."""
        self._check_strings()
        low, high = self.range
        if low > high:
            raise ValueError(f"range: the lowest key {low} is above the highest, {high}; exchange them")
        if self.mod_wheel not in ("none", *WHEEL):
            fault = f"{bounds.brief(self.mod_wheel)} is no field that the wheel can turn"
            raise ValueError(f"mod_wheel: {fault}; try none, {', '.join(WHEEL)}")
        self._check_macros()
        return self

    def _check_macros(self, part: str = "") -> None:
        """Raise ValueError if macros turn what they cannot, or too far; `part`: look at what they turn of this alone.

        Which values are allowed depends on others of the same part.
        """
        for number, macro in enumerate(self.macros):
            for target in macro.targets:
                if part not in ("", target.field.partition(".")[0]):
                    continue
                where = f"macros.{number}: target {target.field[:LONGEST_NAME]}"
                self._check_assignable(where, target.field)
                for value in (target.low, target.high):
                    try:
                        self._replacement(target.field, value)
                    except ValueError as error:
                        raise ValueError(f"{where}: {explained(error)}") from error

    def has(self, field: str) -> bool:
        """Return True if it has a parameter by this id; instruments in mono lack the second point."""
        return field in OF_INSTRUMENTS and (field != "pickup.points.1" or len(self.pickup.points) > 1)

    def value(self, field: str) -> float:
        """The value of a parameter. Raises ValueError: there is none by this id, or the instrument lacks it."""
        if not self.has(field):
            fault = f"{bounds.brief(field)} is no parameter of this instrument"
            raise ValueError(f"field: {fault}; try {', '.join(OF_INSTRUMENTS)}")
        value: Any = self
        for part in field.split("."):
            value = value[int(part)] if isinstance(value, tuple) else getattr(value, part)
        return float(value)

    def with_value(self, field: str, value: float) -> Instrument:
        """A copy with one of ASSIGNABLE changed. Raises ValueError: an unknown field, or a value out of bounds."""
        return self.with_values({field: value})

    def with_values(self, values: dict[str, float]) -> Instrument:
        """The instrument with several of ASSIGNABLE changed, in order. Raises ValueError as `with_value` does."""
        instrument = self
        for field, value in values.items():
            self._check_assignable("field", field)
            part, replacement = instrument._replacement(field, value)
            instrument = instrument.model_copy(update={part: replacement})
            instrument._check_strings()
            instrument._check_macros(part)
        return instrument

    def with_knob(self, field: str, value: float) -> Instrument:
        """Set a value as `with_value`; macros that turn this field follow it."""
        instrument = self.with_value(field, value)
        macros = list(instrument.macros)
        for number, macro in enumerate(macros):
            if any(target.field == field for target in macro.targets):
                macros[number] = macro.model_copy(update={"value": macro.nearest(instrument)})
        return instrument.model_copy(update={"macros": tuple(macros)})

    def turned(self, macro: int, value: float) -> Instrument:
        """The instrument with a macro (by number, from 0) turned to `value`, 0 … 1, and its targets' fields set.

        A target stays where the others forbid its value: the softest pluck does not pass the hardest.
        """
        share = min(1.0, max(0.0, value))
        macros = list(self.macros)
        macros[macro] = macros[macro].model_copy(update={"value": share})
        instrument = self.model_copy(update={"macros": tuple(macros)})
        for target in macros[macro].targets:
            with contextlib.suppress(ValueError):
                instrument = instrument.with_value(target.field, target.low + share * (target.high - target.low))
        return instrument

    def _check_assignable(self, where: str, field: str) -> None:
        if field not in ASSIGNABLE or not self.has(field):
            fault = f"{bounds.brief(field)} is no field that can be turned"
            raise ValueError(f"{where}: {fault}; try {', '.join(ASSIGNABLE)}")

    def _replacement(self, field: str, value: float) -> tuple[str, Any]:
        """The name of the instrument's own field that changes, and its new and checked value."""
        name, *inner = field.split(".")
        if not inner:  # the level, which is the instrument's own
            bounds.check(name, value, OF_INSTRUMENTS[name].limits, "dB")
            return name, value
        section: Any = getattr(self, name)
        if not isinstance(section, Value):
            return name, replace(section, **{inner[0]: float(value)})
        changed: Any = value
        if len(inner) == 2:
            entries = list(getattr(section, inner[0]))
            entries[int(inner[1])] = value
            changed = tuple(entries)
        return name, type(section).model_validate({**dict(section), inner[0]: changed})
