"""The string of each key, and how a bend, a slide or a damper changes it.

Pitch is that of the first partial of a quiet pluck, √(ω₁² - σ₁²)/2π. Fretting changes the length alone, a bend the
tension alone; both are solved for the pitch in closed form, so that it is exact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from app.patches.patch import Fretted, Knobs, Patch, StringSet
from app.patches.tuning import Tuning
from engine.resonators.string import StringParameters

HIGHEST_HZ = 20_000.0  # of modes: those above are inaudible
MOST_MODES = 99  # the shipped model's grid holds no more
HIGHEST_FRET = 24
MOST_SLACKENED = 5  # keys that a guitar's string may be tuned below the set's


@dataclass(frozen=True)
class KeyString:
    """The string that a key plays, before bends, slides and dampers.

    Attributes:
        pitch_hz: frequency of the first partial of a quiet pluck.
        modes: how many it sounds with.
        shortened: its length as a share of the whole string's. Amplitudes are reduced by it, so that the tension
            rises as much as on the whole string.
    """

    key: int
    parameters: StringParameters
    pitch_hz: float
    modes: int
    shortened: float = 1.0


class Strings:
    """The strings of a patch, by key."""

    def __init__(self, patch: Patch) -> None:
        """Raises ValueError: the tuning is impossible."""
        self._patch = patch
        self._tuning = Tuning(patch.tuning)

    def of_key(self, key: int, string: int | None = None) -> KeyString | None:
        """The string of a key; None for a key beyond the patch's range, or one that its tuning leaves out.

        Args:
            string: on which of a set the key is played, counted from the highest, 0; None, or one that the set does
                not have or that would have to be slackened too far: the one that the key itself chooses.

        Raises:
            ValueError: no string has that pitch; the message names the key and what is impossible.
        """
        low, high = self._patch.range
        if not (low <= key <= high and self._tuning.mapped(key)):
            return None
        pitch_hz = self._tuning.hz(key)
        try:
            own = self._own(key, string)
            parameters = fretted(own, pitch_hz)
            modes = min(parameters.modes_below(HIGHEST_HZ), MOST_MODES)
            if modes < 1:
                raise ValueError(f"it would have no partial below {HIGHEST_HZ:g} Hz; choose a lower key")
        except ValueError as error:
            raise ValueError(f"key {key} of {self._patch.name}, {pitch_hz:.4g} Hz: {error}") from error
        return KeyString(key, parameters, pitch_hz, modes, parameters.length_m / own.length_m)

    def _own(self, key: int, number: int | None) -> StringParameters:
        """The whole string on which a key is played, with the patch's knobs."""
        strings = self._patch.strings
        if isinstance(strings, Fretted):
            return turned(strings.string.parameters, self._patch.knobs)
        ordered = strings.strings[::-1]
        if number is None or number >= len(ordered) or key < ordered[number].note - MOST_SLACKENED:
            number = chosen_string(strings, key)
        chosen = ordered[number]
        own = turned(chosen.string.parameters, self._patch.knobs)
        if key >= chosen.note:
            return own
        return bent(own, self._tuning.hz(key) / self._tuning.hz(chosen.note))  # slackened


def chosen_string(strings: StringSet, key: int) -> int:
    """Which string of a set, from the highest, 0, a key chooses: the highest at or below it, else the lowest."""
    ordered = strings.strings[::-1]
    return next((number for number, string in enumerate(ordered) if string.note <= key), len(ordered) - 1)


def fretting(strings: StringSet, key: int) -> list[int]:
    """The strings of a set on which a key can be fretted, counted from the highest, 0."""
    ordered = enumerate(strings.strings[::-1])
    return [number for number, string in ordered if string.note <= key <= string.note + HIGHEST_FRET]


def turned(string: StringParameters, knobs: Knobs) -> StringParameters:
    """The string with a patch's multipliers: pitch and decay rates stay, except for the parts of bending and d₃.

    The tension follows the mass and the square of the length, the damping the mass.
    """
    area = knobs.gauge**2
    mass = area * knobs.density
    return replace(
        string,
        length_m=string.length_m * knobs.length * math.sqrt(knobs.tension),
        area_m2=string.area_m2 * area,
        second_moment_m4=string.second_moment_m4 * knobs.stiffness * knobs.gauge**4,
        density_kg_m3=string.density_kg_m3 * knobs.density,
        youngs_modulus_pa=string.youngs_modulus_pa * knobs.modulus,
        damping_d1_kg_m_s=string.damping_d1_kg_m_s * knobs.decay * mass,
        damping_d3_kg_m_s=string.damping_d3_kg_m_s * knobs.brightness_decay * mass,
        tension_n=string.tension_n * mass * knobs.tension * knobs.length**2,
    )


def pitch_hz_of(string: StringParameters) -> float:
    """The frequency of the first partial of a quiet pluck; 0 where it does not oscillate."""
    return math.sqrt(max(0.0, string.undamped_frequency(1) ** 2 - string.decay_rate(1) ** 2)) / (2 * math.pi)


def fretted(string: StringParameters, pitch_hz: float) -> StringParameters:
    """The string with the length that gives the pitch.

    Raises:
        ValueError: that length is out of bounds.
    """
    mass, bending = string.mass_per_length_kg_m, string.youngs_modulus_pa * string.second_moment_m4
    sigma = string.decay_rate(1)
    for _ in range(4):  # σ₁ depends on the length, a little
        load = mass * ((2 * math.pi * pitch_hz) ** 2 + sigma**2)
        # EIη⁴ + T₀η² = ρAω², without the difference of near numbers
        squared = 2 * load / (string.tension_n + math.sqrt(string.tension_n**2 + 4 * bending * load))
        sigma = (string.damping_d1_kg_m_s + string.damping_d3_kg_m_s * squared) / (2 * mass)
    return replace(string, length_m=math.pi / math.sqrt(squared))


def bent(string: StringParameters, ratio: float) -> StringParameters:
    """The string with the tension that raises its pitch by a ratio.

    Raises:
        ValueError: there is none: stiffness alone is higher, or it is out of bounds.
    """
    if ratio == 1:
        return string
    eta, mass = math.pi / string.length_m, string.mass_per_length_kg_m
    sigma, wanted = string.decay_rate(1), ratio * 2 * math.pi * pitch_hz_of(string)
    bending = string.youngs_modulus_pa * string.second_moment_m4
    tension = (mass * (wanted**2 + sigma**2) - bending * eta**4) / eta**2
    if not tension > 0:
        raise ValueError(f"no tension lowers it by a factor of {ratio:.3g}; bend less")
    return replace(string, tension_n=tension)


def slid(string: StringParameters, ratio: float) -> StringParameters:
    """The string with the length that raises its pitch by a ratio, as by a slide. Raises ValueError as `fretted`."""
    return string if ratio == 1 else fretted(string, ratio * pitch_hz_of(string))


def damped(string: StringParameters, t60_s: float) -> StringParameters:
    """The string with a damper: each partial decays by 60 dB more in `t60_s`. Raises ValueError: out of bounds."""
    added = 2 * string.mass_per_length_kg_m * math.log(1000) / t60_s
    return replace(string, damping_d1_kg_m_s=string.damping_d1_kg_m_s + added)
