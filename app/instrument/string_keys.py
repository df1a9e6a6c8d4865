"""The keys of an instrument of strings before anybody plays them: each one's string, and their common values."""

from __future__ import annotations

from dataclasses import replace

from app.instrument.effects import body_curves
from app.instrument.strings import KeyString, Strings
from app.patches.drums import Drums
from app.patches.patch import Patch
from engine.bounds import LARGEST_AMPLITUDE_MM
from engine.kernels.strings import overdamped
from engine.pluck import Pluck
from engine.presets import PresetInfo
from engine.resonators.base import Array
from engine.values.ear import Ear
from engine.values.string import Polarisations


class StringKeys:
    """The keys of a patch, heard at `ear`, played by a preset. The compiled player computes their gains.

    Args:
        near: keys of nearly the same patch, of which the body's curves are taken instead, in no time.
    """

    def __init__(self, patch: Patch, ear: Ear, preset: PresetInfo, near: StringKeys | None = None) -> None:
        """Raise ValueError: the tuning is impossible, or the patch has drums."""
        if isinstance(patch.strings, Drums):
            raise ValueError(f"{patch.name} has drums, and no strings; choose an instrument of strings")
        self.patch, self.ear = patch, ear
        self.strings = Strings(patch)
        self.polarisations, self.recorded = polarisations_of(patch, preset), preset.recorded
        self.body: Array | None = body_curves(patch) if near is None else near.body

    def of_key(self, key: int, string: int | None = None) -> KeyString | None:
        """The string of a key; None for a silent key.

        `string`: on which of a set it is played, as in `Strings.of_key`.

        Raises:
            ValueError: the key has no possible string.
        """
        key_string = self.strings.of_key(key, string)
        if key_string is None:
            return None
        if self.recorded is not None and self.ear.pickup == "bridge":
            raise ValueError(f"{self.patch.name}: a string learned from a recording has no force at a bridge")
        if overdamped(key_string.parameters.row, key_string.modes):
            raise ValueError(f"key {key} of {self.patch.name}: a mode is overdamped; lower the damping")
        return key_string


def polarisations_of(patch: Patch, preset: PresetInfo) -> Polarisations | None:
    """The polarisations of a patch. None: its strings move in one direction, or as a recording says."""
    polarisations = patch.polarisations
    return None if polarisations is None or preset.recorded is not None else polarisations


def on_string(string: KeyString, pluck: Pluck) -> Pluck:
    """A pluck of the whole string, on the string that a key leaves of it."""
    return replace(pluck, amplitude_mm=min(pluck.amplitude_mm * string.shortened, LARGEST_AMPLITUDE_MM))
