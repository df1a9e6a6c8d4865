"""The keys of a patch before anybody plays them: each one's string, its modes, and the gain that makes it as loud."""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass, replace

import numpy as np

from app.instrument.effects import Response, body_response
from app.instrument.loudness import HIGHEST_PEAK_DB, gain_of, peak_db
from app.instrument.strings import KeyString, Strings
from app.patches.drums import Drums
from app.patches.patch import Patch
from engine.kernels.playing_layout import HIGHEST_SIGMA, REFERENCE_VELOCITY
from engine.pluck import LARGEST_AMPLITUDE_MM, Pluck
from engine.presets import PresetInfo
from engine.resonators.base import Resonator
from engine.resonators.losses import Losses
from engine.resonators.polarised import Polarisations, layout, partials_of
from engine.resonators.string import StringParameters
from engine.voices import Ear

LOOKED_AT = (0, 0.25, 0.5, 0.75, 1)  # of the range: whose peaks are known


@dataclass(frozen=True)
class LoudKey:
    string: KeyString
    resonator: Resonator
    gain: float


class LoudKeys:
    """Of one patch, heard at `ear`, played by a preset. A soloed mode is as loud as it is in the whole note.

    What all keys share is computed when it is made, in up to 40 ms: the body's response, and how far peaks are too
    high. Each key takes half a millisecond more.

    Args:
        near: keys of nearly the same patch, of which both are taken instead, in no time.
    """

    def __init__(self, patch: Patch, ear: Ear, preset: PresetInfo, near: LoudKeys | None = None) -> None:
        """Raises ValueError: the tuning is impossible, or the patch has drums."""
        if isinstance(patch.strings, Drums):
            raise ValueError(f"{patch.name} has drums, and no strings; choose an instrument of strings")
        self.patch, self.ear = patch, ear
        self._whole, self._preset = replace(ear, solo=0), preset
        self.strings = Strings(patch)
        self._release_s = patch.pluck.release_s(REFERENCE_VELOCITY)
        self.polarisations, self.recorded = polarisations_of(patch, preset), preset.recorded
        self._response: Response | None = body_response(patch) if near is None else near._response
        self._over_db: float = self._peaks_over_db() if near is None else near._over_db

    def of_key(self, key: int, string: int | None = None) -> LoudKey | None:
        """None for a key that is silent. `string`: on which of a set it is played, as in `Strings.of_key`.

        Raises:
            ValueError: the key has no possible string.
        """
        found = self._alone(key, string)
        level = float(10 ** ((self.patch.level_db - self._over_db) / 20))
        return None if found is None else replace(found, gain=found.gain * level)

    def string_of(self, key: int, string: int | None = None) -> KeyString | None:
        """As `of_key`, the string alone, which takes no time."""
        found = self.strings.of_key(key, string)
        if found is not None and any(
            not found.parameters.decay_rate(mode) < found.parameters.undamped_frequency(mode)
            for mode in (1, found.modes)  # then of all between: see `engine.bounds.check_motion`
        ):
            raise ValueError(f"key {key} of {self.patch.name}: a mode is overdamped; lower the damping")
        return found

    def _peaks_over_db(self) -> float:
        """By how much the peaks of some keys are too high."""
        low, high = self.patch.range
        peaks_db = []
        for key in {low + round(share * (high - low)) for share in LOOKED_AT}:
            with contextlib.suppress(ValueError):  # reported when it is struck
                if (found := self._alone(key)) is not None:
                    pluck = self._pluck(found.string)
                    peak = peak_db(found.resonator, pluck, self._whole, self._response, self._release_s)
                    peaks_db.append(peak + 20 * math.log10(found.gain))
        return max(0.0, max(peaks_db, default=HIGHEST_PEAK_DB) - HIGHEST_PEAK_DB)

    def _alone(self, key: int, number: int | None = None) -> LoudKey | None:
        """With the gain that makes it as loud as the others."""
        string = self.strings.of_key(key, number)
        if string is None:
            return None
        resonator = resonator_of(string, self.patch, self._preset)
        heard = self._whole, self._response, self._release_s
        return LoudKey(string, resonator, gain_of(resonator, self._pluck(string), *heard))

    def _pluck(self, string: KeyString) -> Pluck:
        """Of which loudness and peak are taken."""
        return on_string(string, self.patch.pluck.pluck(REFERENCE_VELOCITY))


def polarisations_of(patch: Patch, preset: PresetInfo) -> Polarisations | None:
    """Those of a patch; None: its strings move in one direction, or as a recording says."""
    chosen = patch.polarisations
    return None if chosen is None or preset.recorded is not None else Polarisations(**chosen.model_dump())


def resonator_of(string: KeyString, patch: Patch, preset: PresetInfo) -> Resonator:
    """The modes of a key's string, as the patch says that it moves and decays."""
    moving = polarisations_of(patch, preset)
    if moving is None:
        found = preset.resonator_of(string.parameters, preset.modes_of(string.modes))
    else:
        found = moving.resonator(
            string.parameters,
            string.modes,
            losses=patch.knobs.decay,
            tension_modulated=preset.tension_modulated,
            grid_points=preset.grid_points,
        )
    return _with_losses(found, string.parameters, patch, preset)


def retuned(resonator: Resonator, string: StringParameters, patch: Patch, preset: PresetInfo) -> Resonator:
    """A resonator of `resonator_of` with the frequencies, decays and coupling of another string; same shapes."""
    moving = polarisations_of(patch, preset)
    if moving is None:
        return _with_losses(preset.retuned(resonator, string), string, patch, preset)
    return _with_losses(moving.retuned(resonator, string, patch.knobs.decay), string, patch, preset)


def _with_losses(resonator: Resonator, string: StringParameters, patch: Patch, preset: PresetInfo) -> Resonator:
    if patch.losses is None or preset.recorded is not None:
        return resonator
    modes, paired = resonator.modes, patch.polarisations is not None
    partial = layout(partials_of(modes))[0] if paired else np.arange(modes)
    rates = Losses(**patch.losses.model_dump()).rates(
        string, int(partial[-1]) + 1, patch.knobs.decay, patch.knobs.brightness_decay
    )
    sigma = np.minimum(resonator.sigma + rates[partial], HIGHEST_SIGMA * resonator.omega)
    return replace(resonator, sigma=sigma)


def on_string(string: KeyString, pluck: Pluck) -> Pluck:
    """A pluck of the whole string, on the string that a key leaves of it."""
    return replace(pluck, amplitude_mm=min(pluck.amplitude_mm * string.shortened, LARGEST_AMPLITUDE_MM))
