"""The string of each key, and how a bend, a slide or a damper changes it, by `engine.kernels.strings`.

Pitch is that of the first partial of a quiet pluck, √(ω₁² - σ₁²)/2π. Fretting changes the length alone, a bend the
tension alone; both are solved for the pitch in closed form, so that it is exact.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from app.patches.drums import Drums
from app.patches.patch import Fretted, Knobs, Patch, StringSet
from app.patches.tuning import Tuning
from engine.kernels import constants as of
from engine.kernels.constants import HIGHEST_HZ, MOST_MODES, MOST_SLACKENED
from engine.resonators.losses import Losses
from engine.resonators.string import StringParameters

STRING = tuple(field.name for field in fields(StringParameters))
KNOBS = tuple(id.removeprefix("knobs.") for id in of.PLAYED[: of.KNOBS])


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
        pitch_hz = self.pitch_hz(key)
        if pitch_hz is None:
            return None
        if isinstance(self._patch.strings, Drums):
            raise ValueError(
                f"key {key} of {self._patch.name} is a drum, and no string; choose an instrument of strings"
            )
        try:
            own = self._own(key, string)
            parameters = fretted(own, pitch_hz)
            modes = min(parameters.modes_below(HIGHEST_HZ), MOST_MODES)
            if modes < 1:
                raise ValueError(f"it would have no partial below {HIGHEST_HZ:g} Hz; choose a lower key")
        except ValueError as error:
            raise ValueError(f"key {key} of {self._patch.name}, {pitch_hz:.4g} Hz: {error}") from error
        return KeyString(key, parameters, pitch_hz, modes, parameters.length_m / own.length_m)

    def pitch_hz(self, key: int) -> float | None:
        """The pitch of a key; None as in `of_key`."""
        low, high = self._patch.range
        if isinstance(self._patch.strings, Drums) and self._patch.strings.of_key(key) is None:
            return None
        return self._tuning.hz(key) if low <= key <= high and self._tuning.mapped(key) else None

    def open_hz(self, note: int) -> float:
        """The pitch of an open string, which the range does not limit."""
        return self._tuning.hz(note)

    def _own(self, key: int, number: int | None) -> StringParameters:
        """The whole string on which a key is played, with the patch's knobs."""
        strings = self._patch.strings
        assert not isinstance(strings, Drums)
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
    """The string that a key chooses, from the highest, 0: the highest at or below the key, else the lowest."""
    ordered = strings.strings[::-1]
    return next((number for number, string in enumerate(ordered) if string.note <= key), len(ordered) - 1)


def has_octave(patch: Patch, key: int, number: int | None) -> bool:
    """Return True if the course of a key has an octave string.

    Args:
        number: on which string of a set it is played, from the highest, 0; None: on the one that it chooses.
    """
    if patch.course.octaves == 0 or not isinstance(patch.strings, StringSet):
        return False
    chosen = chosen_string(patch.strings, key) if number is None else number
    return chosen >= len(patch.strings.strings) - patch.course.octaves


def turned(string: StringParameters, knobs: Knobs) -> StringParameters:
    """The string with a patch's multipliers: pitch and decay rates stay, except for the parts of bending and d₃.

    The tension follows the mass and the square of the length, the damping the mass.
    """
    from engine.kernels import strings as kernel  # Numba only when it is needed

    kernel.turned(_row(string), np.array([getattr(knobs, name) for name in KNOBS]), out := np.empty(len(STRING)))
    return StringParameters(*out.tolist())


def pitch_hz_of(string: StringParameters) -> float:
    """The frequency of the first partial of a quiet pluck; 0 where it does not oscillate."""
    from engine.kernels import strings as kernel

    return float(kernel.pitch_hz(_row(string)))


def fretted(string: StringParameters, pitch_hz: float) -> StringParameters:
    """The string with the length that gives the pitch.

    Raises:
        ValueError: that length is out of bounds.
    """
    from engine.kernels import strings as kernel

    return replace(string, length_m=float(kernel.fretted(_row(string), pitch_hz)))


def bent(string: StringParameters, ratio: float) -> StringParameters:
    """The string with the tension that raises its pitch by a ratio.

    Raises:
        ValueError: there is none: stiffness alone is higher, or it is out of bounds.
    """
    from engine.kernels import strings as kernel

    tension = float(kernel.bent(_row(string), ratio))
    if not tension > 0:
        raise ValueError(f"no tension lowers it by a factor of {ratio:.3g}; bend less")
    return replace(string, tension_n=tension)


def slid(string: StringParameters, ratio: float) -> StringParameters:
    """The string with the length that raises its pitch by a ratio, as by a slide. Raises ValueError as `fretted`."""
    from engine.kernels import strings as kernel

    return replace(string, length_m=float(kernel.slid(_row(string), ratio)))


def damped(string: StringParameters, t60_s: float) -> StringParameters:
    """The string with a damper: each partial decays by 60 dB more in `t60_s`. Raises ValueError: out of bounds."""
    from engine.kernels import strings as kernel

    return replace(string, damping_d1_kg_m_s=float(kernel.damped(_row(string), t60_s)))


def _row(string: StringParameters) -> NDArray[np.float64]:
    """The row of a string as the kernels take it."""
    return np.array([getattr(string, name) for name in STRING])


def decay_rates(patch: Patch, string: StringParameters, modes: int) -> NDArray[np.float64]:
    """The decay rates σ of the modes of a patch's string in 1/s, (modes,).

    They follow from its own losses: d₁, d₃, and those by mode.
    """
    rates, knobs = string.decay_rates(modes), patch.knobs
    if patch.losses is not None:
        by_mode = Losses(**patch.losses.model_dump())
        rates = rates + by_mode.rates(string, modes, knobs.decay, knobs.brightness_decay)
    return rates
