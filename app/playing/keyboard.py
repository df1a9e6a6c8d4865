"""The computer's keyboard as a musical one: keys are pitches as on a piano, or one row plucks at ten places.

Keys are known by where they are: the row begins right of Caps lock, whatever is printed on it. No widget here.
"""

from __future__ import annotations

import sys
from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from engine.bounds import LARGEST_AMPLITUDE_MM, POSITION_RANGE
from engine.kernels import velocities
from engine.pluck import Pluck

if TYPE_CHECKING:
    from engine.presets import PresetInfo  # and NumPy with it, which settings are read without

PLACES = 10
ANYWHERE = (0.05, 0.95)  # positions of the lowest and the highest key, for a model without trained ones
ANY_AMPLITUDE_MM = (0.5, 10.0)
SOFTEST_MM = 0.05
LARGEST_VELOCITY = 127
LOWEST_PLACE, HIGHEST_PLACE = 36, 96  # keys of a keyboard of 61: places from one end of the reach to the other
VELOCITY_STEP = 16
DIGITS = 4  # after the point, for file names and recipes have them

# A piano of eighteen keys: white ones in the row from A on, black ones above from C on, and letters beside it.
_WHITE = (0, 2, 4, 5, 7, 9, 11, 12, 14, 16, 17)
_BLACK = {1: 1, 2: 3, 4: 6, 5: 8, 6: 10, 8: 13, 9: 15}  # place in the row above -> semitones
# By native codes of the first key of each row, of X11 (and of Wayland through Qt) and Windows; else by letters.
_PIANO_CODES = {  # platform -> native code -> semitones above the C of the key A
    platform: {row + n: s for n, s in enumerate(_WHITE)} | {upper + n: s for n, s in _BLACK.items()}
    for platform, row, upper in (("linux", 38, 24), ("win32", 0x1E, 0x10))
}
_PIANO_LETTERS = dict(zip("ASDFGHJKL;'", _WHITE, strict=True)) | {"QWERTYUIOP"[n]: s for n, s in _BLACK.items()}
LOWEST_C = 48  # the MIDI key that A plays at octave 0
OCTAVE_STEPS = {"Z": -1, "X": 1}
LOWEST_OCTAVE, HIGHEST_OCTAVE = -4, 4
MOST_OF_BEST = 0.8  # of the keys that sound in the best octave: an estimate


@dataclass(frozen=True)
class PluckRange:
    """The positions of the lowest and the highest key's plucks, and the amplitudes of velocities 1 and 127."""

    position: tuple[float, float] = ANYWHERE
    amplitude_mm: tuple[float, float] = ANY_AMPLITUDE_MM

    @classmethod
    def of(cls, info: PresetInfo | None) -> PluckRange:
        """The range that a preset was trained on, so that every key sounds as learned."""
        if info is None:
            return cls()
        low, high = info.trained_range.position or ANYWHERE
        if info.trained_range.peak_m is None:  # keys from soft to hard, as far as the string bears
            low_mm, high_mm = ANY_AMPLITUDE_MM[0], min(ANY_AMPLITUDE_MM[1], info.hardest_mm(Pluck()))
        else:
            low_mm, high_mm = info.trained_amplitudes_mm(Pluck())
        return cls(
            (max(low, POSITION_RANGE[0]), min(high, POSITION_RANGE[1])),
            (max(low_mm, SOFTEST_MM), min(high_mm, LARGEST_AMPLITUDE_MM)),
        )

    def pluck(self, key: int, velocity: int, pluck: Pluck) -> Pluck:
        """The pluck of a key of a single string: `pluck` at the key's place, as hard as its velocity."""
        place = self.place((key - LOWEST_PLACE) / (HIGHEST_PLACE - LOWEST_PLACE))
        return replace(pluck, position=place, amplitude_mm=self.amplitude_of(velocity))

    @property
    def row(self) -> tuple[float, ...]:
        """The pluck positions, in lengths of the string, of the computer's ten keys from A on."""
        return tuple(self.place(number / (PLACES - 1)) for number in range(PLACES))

    def turned(self, press: KeyPress, amplitude_mm: float) -> float | None:
        """The amplitude after a key that changes it, as `turn` does a velocity; None for another key."""
        step = turn(press, 0, self.velocity_of(amplitude_mm))
        return None if step is None or press.letter.upper() in OCTAVE_STEPS else self.amplitude_of(step[1])

    def place(self, share: float) -> float:
        """The pluck position, in lengths of the string, at a share 0 … 1 of the way along the keys."""
        low, high = self.position
        return _round_within(low + min(max(share, 0.0), 1.0) * (high - low), low, high)

    def amplitude_of(self, velocity: int) -> float:
        """Velocity 1 … 127 to an amplitude in mm: equal steps in dB."""
        low, high = self.amplitude_mm
        return _round_within(velocities.between(low, high, velocities.share(velocity, 0.0)), low, high)

    def velocity_of(self, amplitude_mm: float) -> int:
        """The velocity, 1 … 127, whose amplitude is nearest."""
        low, high = self.amplitude_mm
        return velocities.velocity(low, high, amplitude_mm, 0.0) if high > low else LARGEST_VELOCITY


@dataclass(frozen=True)
class KeyPress:
    """A key: the letter or digit on it, and its native code (0: the platform gives none)."""

    letter: str
    code: int = 0


def semitone_of(press: KeyPress, platform: str = sys.platform) -> int | None:
    """Semitones above the C that the key A plays; None for a key that is not of the piano."""
    codes = _PIANO_CODES.get(platform)
    if codes and press.code:
        return codes.get(press.code)
    return _PIANO_LETTERS.get(press.letter.upper()) if press.letter else None


def letters_of(octave: int) -> dict[int, str]:
    """MIDI key -> what is printed on the computer's key that plays it."""
    return {LOWEST_C + 12 * octave + semitone: letter for letter, semitone in _PIANO_LETTERS.items()}


def octave_near(octave: int, keys: Collection[int]) -> int:
    """The octave nearest to `octave` where nearly as many of the computer's keys sound as in the best one.

    Args:
        keys: of MIDI, which sound; some instruments have fewer than the computer.
    """
    counts = {other: len(letters_of(other).keys() & set(keys)) for other in range(LOWEST_OCTAVE, HIGHEST_OCTAVE + 1)}
    enough = MOST_OF_BEST * max(counts.values())
    return min((other for other in counts if counts[other] >= enough), key=lambda other: abs(other - octave))


def octaves_of(low: int, high: int) -> tuple[int, int]:
    """The octaves of the computer's keys, as in `letters_of`, that hold the MIDI keys `low` and `high`."""
    lowest, highest = (min(max((key - LOWEST_C) // 12, LOWEST_OCTAVE), HIGHEST_OCTAVE) for key in (low, high))
    return lowest, highest


def turn(press: KeyPress, octave: int, velocity: int) -> tuple[int, int] | None:
    """Octave and velocity after a key that changes them. The keys are Z and X, 1 … 9, C and V; None for another."""
    letter = press.letter.upper()
    if letter in OCTAVE_STEPS:
        return min(max(octave + OCTAVE_STEPS[letter], LOWEST_OCTAVE), HIGHEST_OCTAVE), velocity
    if letter and letter in "123456789":
        return octave, round(1 + (int(letter) - 1) / 8 * (LARGEST_VELOCITY - 1))
    step = {"C": -VELOCITY_STEP, "V": VELOCITY_STEP}.get(letter)
    return None if step is None else (octave, min(max(velocity + step, 1), LARGEST_VELOCITY))


def place_of(press: KeyPress, platform: str = sys.platform) -> int | None:
    """The place 0 … 9 along the row of white keys; None for a key that is not of it."""
    semitone = semitone_of(press, platform)
    return _WHITE.index(semitone) if semitone in _WHITE[:PLACES] else None


def _round_within(value: float, low: float, high: float) -> float:
    return min(max(round(value, DIGITS), low), high)
