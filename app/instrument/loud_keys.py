"""The keys of a patch before anybody plays them: each one's string, its modes, and the gain that makes it as loud."""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass, replace
from functools import cached_property

from app.instrument.effects import body_response
from app.instrument.loudness import HIGHEST_PEAK_DB, REFERENCE_VELOCITY, gain_of, peak_db
from app.instrument.strings import KeyString, Strings
from app.patches.patch import Patch
from engine.pluck import LARGEST_AMPLITUDE_MM, Pluck
from engine.resonators.base import Resonator
from engine.voices import Ear

LOOKED_AT = (0, 0.25, 0.5, 0.75, 1)  # of the range: whose peaks are known


@dataclass(frozen=True)
class LoudKey:
    string: KeyString
    resonator: Resonator
    gain: float


class LoudKeys:
    """Of one patch, heard at `ear`, on a model's grid. A soloed mode is as loud as it is in the whole note."""

    def __init__(self, patch: Patch, ear: Ear, grid_points: int) -> None:
        """Raises ValueError: the tuning is impossible."""
        self._patch, self._ear, self._grid_points = patch, replace(ear, solo=0), grid_points
        self._strings, self._response = Strings(patch), body_response(patch)

    def of_key(self, key: int, string: int | None = None) -> LoudKey | None:
        """None for a key that is silent. `string`: on which of a set it is played, as in `Strings.of_key`.

        Raises:
            ValueError: the key has no possible string.
        """
        found = self._alone(key, string)
        return None if found is None else replace(found, gain=found.gain * self._level)

    @cached_property
    def _level(self) -> float:
        """One factor for all keys: the patch's level, less what the peaks of some of them are too high."""
        low, high = self._patch.range
        peaks_db = []
        for key in {low + round(share * (high - low)) for share in LOOKED_AT}:
            with contextlib.suppress(ValueError):  # told when it is struck
                if (found := self._alone(key)) is not None:
                    pluck = self._pluck(found.string)
                    peak = peak_db(found.resonator, pluck, self._ear, self._response)
                    peaks_db.append(peak + 20 * math.log10(found.gain))
        over_db = max(0.0, max(peaks_db, default=HIGHEST_PEAK_DB) - HIGHEST_PEAK_DB)
        return float(10 ** ((self._patch.level_db - over_db) / 20))

    def _alone(self, key: int, number: int | None = None) -> LoudKey | None:
        """With the gain that makes it as loud as the others."""
        string = self._strings.of_key(key, number)
        if string is None:
            return None
        modes = min(string.modes, self._grid_points - 2)
        resonator = string.parameters.resonator(modes, grid_points=self._grid_points)
        return LoudKey(string, resonator, gain_of(resonator, self._pluck(string), self._ear, self._response))

    def _pluck(self, string: KeyString) -> Pluck:
        """Of which loudness and peak are taken."""
        return on_string(string, self._patch.pluck.pluck(REFERENCE_VELOCITY))


def on_string(string: KeyString, pluck: Pluck) -> Pluck:
    """A pluck of the whole string, on the string that a key leaves of it."""
    return replace(pluck, amplitude_mm=min(pluck.amplitude_mm * string.shortened, LARGEST_AMPLITUDE_MM))
