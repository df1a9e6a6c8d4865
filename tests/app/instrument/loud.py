"""The gains of keys by Python, as `engine.kernels.playing.gains` computes them for the player."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from app.instrument.string_keys import StringKeys, on_string, polarisations_of
from app.instrument.strings import KeyString, has_octave
from app.patches.patch import Patch
from engine.excitation import blow_factor, release_factor
from engine.kernels import constants as of
from engine.levels import FULL_SCALE_M, FULL_SCALE_M_S
from engine.presets import PresetInfo
from engine.resonators.base import Array, Resonator
from engine.resonators.losses import loss_rates
from engine.resonators.polarised import layout, partials_of, polarised_resonator
from engine.values.ear import Ear
from engine.values.string import StringParameters
from engine.voices.ear import weights_of

_NO_BODY = np.zeros(0)


@dataclass(frozen=True)
class LoudKey:
    string: KeyString
    resonator: Resonator
    gain: float


class LoudKeys(StringKeys):
    """A soloed mode is as loud as it is in the whole note."""

    def __init__(self, patch: Patch, ear: Ear, preset: PresetInfo) -> None:
        super().__init__(patch, ear, preset)
        self._full_ear, self._preset = replace(ear, solo=0), preset

    def of_key(self, key: int, string: int | None = None) -> LoudKey | None:
        """As `string_of`."""
        found = self.strings.of_key(key, string)
        if found is None:
            return None
        resonator = resonator_of(found, self.patch, self._preset)
        level = float(10 ** (self.patch.level_db / 20)) / self.patch.course.strings
        sound = self._sound(found, resonator, string)
        return LoudKey(found, resonator, self._gain(sound) * self._limit * level)

    @cached_property
    def _limit(self) -> float:
        """The factor that keeps all keys below the highest peak."""
        from engine.kernels import loudness  # Numba only when it is needed

        highest, (low, high) = 0.0, self.patch.range
        for number in range(loudness.LOOKED_AT):
            with contextlib.suppress(ValueError):  # reported when it is struck
                key = self.strings.of_key(loudness.looked_at(low, high, number))
                if key is not None:
                    sound = self._sound(key, resonator_of(key, self.patch, self._preset))
                    swings, modes = self._swings, len(sound) // of.SOUND_ROWS
                    gain, body = self._gain(sound), self._heard_through
                    highest = max(highest, gain * loudness.peak(sound, modes, swings, *body, highest / gain))
        return float(loudness.limit(highest))

    @property
    def _swings(self) -> bool:
        """Whether its modes set out as sines do."""
        return (self.ear.pickup == "velocity") != self.patch.pluck.is_blow

    @property
    def _heard_through(self) -> tuple[Array, float]:
        """The body's curves, and how much of it is heard."""
        return (_NO_BODY, 0.0) if self.body is None else (self.body, self.patch.body.mix)

    def _gain(self, sound: Array) -> float:
        from engine.kernels import loudness

        modes = len(sound) // of.SOUND_ROWS
        return float(loudness.gain(sound, modes, len(self.ear.points), *self._heard_through))

    def _sound(self, string: KeyString, resonator: Resonator, number: int | None = None) -> Array:
        """What keys are equally loud by, as `engine.kernels.loudness` reads it.

        Args:
            number: on which string of a set the key is played, as in `of_key`.
        """
        patch = self.patch
        pluck = on_string(string, patch.pluck.pluck(of.REFERENCE_VELOCITY))
        displacement_m = pluck.displacement(resonator.points)
        amplitudes = resonator.to_modes(displacement_m)
        if patch.pluck.is_blow:
            amplitudes = amplitudes * blow_factor(resonator.omega, displacement_m / (pluck.amplitude_mm / 1000))
        if release_s := patch.pluck.release_s(of.REFERENCE_VELOCITY):
            amplitudes = amplitudes * release_factor(resonator.omega, release_s)
        weights = (
            resonator.shapes @ weights_of(self._full_ear, resonator.points, resonator.force_weights) / FULL_SCALE_M
        )
        if self.ear.pickup == "velocity":
            half = np.sqrt(resonator.stretch) * (patch.pickup.aperture_mm / 2000)
            weights = weights * np.sinc(half / np.pi)[:, None]
            weights = weights * resonator.omega[:, None] * (FULL_SCALE_M / FULL_SCALE_M_S)
        sound = np.zeros((of.SOUND_ROWS, resonator.modes))
        sound[of.SOUND_OMEGA], sound[of.SOUND_SIGMA] = resonator.omega, self._first_decay(string, resonator, number)
        heard = weights * amplitudes[:, None]
        sound[of.SOUND_LEFT : of.SOUND_LEFT + heard.shape[1]] = heard.T
        return sound.ravel()

    def _first_decay(self, string: KeyString, resonator: Resonator, number: int | None) -> Array:
        """σ of the modes (modes,) while strings on one bridge are in phase, as they are at first."""
        patch, course, moving = self.patch, self.patch.course, self.polarisations
        if moving is None or course.strings == 1 or course.bridge == 0 or has_octave(patch, string.key, number):
            return resonator.sigma
        both = np.array([moving.conductance_s_kg, moving.second_conductance_s_kg])
        pull = patch.knobs.decay * string.parameters.tension_n / string.parameters.length_m
        shared = (course.strings - 1) * course.bridge * pull * both[layout(string.modes)[1]]
        return np.minimum(resonator.sigma + shared, of.HIGHEST_SIGMA * resonator.omega)


def resonator_of(string: KeyString, patch: Patch, preset: PresetInfo) -> Resonator:
    """The modes of a key's string, as the patch says that it moves and decays."""
    moving = polarisations_of(patch, preset)
    if moving is None:
        found = preset.resonator_of(string.parameters, preset.modes_of(string.modes))
    else:
        found = polarised_resonator(
            moving,
            string.parameters,
            string.modes,
            losses=patch.knobs.decay,
            tension_modulated=preset.tension_modulated,
            grid_points=preset.grid_points,
        )
    return _with_losses(found, string.parameters, patch, preset)


def _with_losses(resonator: Resonator, string: StringParameters, patch: Patch, preset: PresetInfo) -> Resonator:
    if patch.losses is None or preset.recorded is not None:
        return resonator
    modes, paired = resonator.modes, patch.polarisations is not None
    partial = layout(partials_of(modes))[0] if paired else np.arange(modes)
    rates = loss_rates(patch.losses, string, int(partial[-1]) + 1, patch.knobs.decay, patch.knobs.brightness_decay)
    sigma = np.minimum(resonator.sigma + rates[partial], of.HIGHEST_SIGMA * resonator.omega)
    return replace(resonator, sigma=sigma)
