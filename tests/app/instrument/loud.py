"""The gains of keys by Python, as `engine.kernels.playing.gains` computes them for the player."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from app.instrument.string_keys import StringKeys, on_string, polarisations_of
from app.instrument.strings import KeyString
from app.patches.patch import Patch, StringSet
from engine.excitation import blow_factor
from engine.kernels import constants as of
from engine.kernels.pulses import spectrum
from engine.kernels.strings import chosen
from engine.kernels.velocities import contact_s, share
from engine.levels import FULL_SCALE_M, FULL_SCALE_M_S
from engine.presets import PresetInfo
from engine.resonators.base import Array, Resonator
from engine.resonators.losses import Losses
from engine.voices import Ear
from tests.engine.polarised import layout, polarised

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
        hard = share(of.REFERENCE_VELOCITY, patch.pluck.curve)
        release_s = contact_s(patch.pluck.release_ms, patch.pluck.release_hard_ms, hard)
        amplitudes = amplitudes * spectrum(resonator.omega * release_s / (2 * np.pi))
        weights = resonator.shapes @ self._full_ear.weights(resonator.points, resonator.force_weights) / FULL_SCALE_M
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
        if moving is None or course.strings == 1 or course.bridge == 0 or _has_octave(patch, string.key, number):
            return resonator.sigma
        both = np.array([moving.conductance_s_kg, moving.second_conductance_s_kg])
        pull = patch.knobs.decay * string.parameters.tension_n / string.parameters.length_m
        shared = (course.strings - 1) * course.bridge * pull * both[layout(string.modes)[1]]
        return np.minimum(resonator.sigma + shared, of.HIGHEST_SIGMA * resonator.omega)


def _has_octave(patch: Patch, key: int, number: int | None) -> bool:
    """Whether the course of a key has an octave string, on a string of a set or on the one that it chooses."""
    if patch.course.octaves == 0 or not isinstance(patch.strings, StringSet):
        return False
    count = len(patch.strings.strings)
    string = chosen(patch.strings.strings[::-1], count, key) if number is None else number
    return string >= count - patch.course.octaves


def resonator_of(string: KeyString, patch: Patch, preset: PresetInfo) -> Resonator:
    """The modes of a key's string, as the patch says that it moves and decays."""
    moving, knobs = polarisations_of(patch, preset), patch.knobs
    by_mode = None if patch.losses is None or preset.recorded is not None else patch.losses
    if moving is not None:
        losses = (0.0, 0.0, 0.0)
        if by_mode is not None:
            inside = knobs.brightness_decay
            losses = knobs.decay * by_mode.air, inside * by_mode.friction, inside * by_mode.bending
        points, modulated = preset.grid_points, preset.tension_modulated
        return polarised(
            moving,
            string.parameters,
            string.modes,
            decay=knobs.decay,
            losses=losses,
            tension_modulated=modulated,
            grid_points=points,
        )
    modes = min(string.modes * (1 if preset.recorded is None else 2), preset.grid_points - 2)
    found = replace(preset, string=string.parameters, modes=modes).resonator
    if by_mode is None:
        return found
    rates = Losses(**by_mode.model_dump()).rates(string.parameters, found.modes, knobs.decay, knobs.brightness_decay)
    return replace(found, sigma=np.minimum(found.sigma + rates, of.HIGHEST_SIGMA * found.omega))
