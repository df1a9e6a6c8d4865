"""The keys of a patch of drums before anybody plays them: modes, and what a blow and an ear make of them.

What `StringKeys` is for strings; the compiled player computes gains.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from app.instrument.effects import body_curves
from app.patches.drums import Drums, PlayedDrum
from app.patches.patch import VELOCITIES, Patch
from app.patches.tuning import Tuning
from engine.kernels import playing_layout as of
from engine.resonators.base import Array
from engine.resonators.drum import DrumModes, DrumParameters
from engine.resonators.surface import Circle
from engine.strike import FULL_SCALE_PA, Strike
from engine.voices import Ear

TUNINGS = 6  # rounds of a secant method
NEAR = 1e-4  # of a frequency, where it ends
LOW_MODES_HZ, LOW_MODES = 3.0, 6  # among which its pitch is: below so many times the lowest, without air
J01 = 2.404825557695773  # the first zero of J₀
NEAREST_RIM = 0.98  # of half a drum: at the rim itself nothing moves


@dataclass(frozen=True, eq=False)
class DrumKey:
    """The drum of a key.

    Attributes:
        modes: with the patch's knobs, tuned to the key.
        heard: weights of amplitudes in m, of full scale, (points, modes).
    """

    key: int
    played: PlayedDrum
    modes: DrumModes
    heard: Array

    def struck(self, place: tuple[float, float]) -> Array:
        """The speeds (modes,) that 1 N s of its mallet gives at a place, in half-lengths from the centre.

        A place beyond the rim is taken as the nearest one within.
        """
        place = on_the_drum(self.played, place)
        return np.ascontiguousarray(self.modes.struck(place, self.played.mallet.mallet.radius_m))

    def strike(self, velocity: float, curve: float = 0.0) -> Strike:
        """The blow of a velocity in 1 … 127."""
        low, high = VELOCITIES
        share = min(1.0, max(0.0, (velocity - low) / (high - low))) ** (4**-curve)
        played = self.played
        speed = played.softest_m_s * (played.hardest_m_s / played.softest_m_s) ** share
        return Strike(played.place, speed, played.mallet.mallet)

    @property
    def pitch_hz(self) -> float:
        """Of its first mode, at rest."""
        return float(math.sqrt(self.modes.omega[0] ** 2 - self.modes.sigma[0] ** 2) / math.tau)

    def rise(self, velocity: float, curve: float = 0.0) -> float:
        """ΔT/T₀ of a blow, averaged over the first swing: half of what all of it as displacement would give."""
        speeds = self.strike(velocity, curve).speeds(self.modes)
        resonator = self.modes.resonator(np.zeros((1, 2)))
        return float(resonator.relative_tension_rise(speeds / self.modes.omega)) / 2

    def drop_cents(self, velocity: float, curve: float = 0.0) -> float:
        """By how much the pitch of the first mode falls after a blow."""
        return 600 * math.log2(1 + self.rise(velocity, curve))


def on_the_drum(played: PlayedDrum, place: tuple[float, float]) -> tuple[float, float]:
    """The nearest place within the rim."""
    x, y = place
    away = math.hypot(x, y) if played.drum.shape == "circle" else max(abs(x), abs(y))
    return (x * NEAREST_RIM / away, y * NEAREST_RIM / away) if away > NEAREST_RIM else place


class DrumKeys:
    """Of one patch of drums, heard at `ear`; see `StringKeys`. Modes of a drum are remembered."""

    polarisations = None

    def __init__(self, patch: Patch, ear: Ear, near: DrumKeys | None = None) -> None:
        """Raises ValueError: the tuning is impossible, or a drum."""
        assert isinstance(patch.strings, Drums)
        self.patch, self.ear, self.drums = patch, ear, patch.strings
        self._tuning = Tuning(patch.tuning)
        self.body: Array | None = body_curves(patch) if near is None else near.body
        self._known: dict[int, DrumKey | None] = {}

    def of_key(self, key: int, string: int | None = None) -> DrumKey | None:
        """None for a key that is silent; remembered. Raises ValueError: the key has no possible drum."""
        if key not in self._known:
            self._known[key] = self._of_key(key)
        return self._known[key]

    def tuned_to(self, key: int) -> tuple[PlayedDrum, float] | None:
        """The drum that a key plays, with its mallet's speeds there, and by what ratio it is tuned; None: silent."""
        low, high = self.patch.range
        played = self.drums.of_key(key)
        if played is None or not low <= key <= high or not self._tuning.mapped(key):
            return None
        ratio = 1.0 if self.drums.keys == "pads" else self._tuning.hz(key) / self._tuning.hz(played.note)
        # a slack head is struck more softly, so that its tension rises no more
        softer = min(1.0, ratio if played.drum.tension_n_m == 0 else ratio**2)
        speeds = {name: getattr(played, name) * softer for name in ("softest_m_s", "hardest_m_s")}
        return played.model_copy(update=speeds), ratio

    def _of_key(self, key: int) -> DrumKey | None:
        found = self.tuned_to(key)
        if found is None:
            return None
        played, ratio = found
        try:
            modes = self._modes(played, ratio)
        except ValueError as error:
            raise ValueError(f"key {key} of {self.patch.name}, {played.name}: {error}") from error
        directions = [(2 * point - 1, 0.0) for point in self.ear.points]
        heard = np.stack([modes.radiated(direction) for direction in directions]) / FULL_SCALE_PA
        return DrumKey(key, played, modes, heard)

    def _modes(self, played: PlayedDrum, ratio: float) -> DrumModes:
        knobs, drum = self.patch.knobs, played.drum.parameters
        drum = replace(
            drum,
            damping_d1_kg_m2_s=drum.damping_d1_kg_m2_s * knobs.decay,
            damping_d3_kg_s=drum.damping_d3_kg_s * knobs.brightness_decay,
            youngs_modulus_pa=drum.youngs_modulus_pa * knobs.modulus,
        )
        undamped = replace(drum, damping_d1_kg_m2_s=0.0, damping_d3_kg_s=0.0)  # a knob of decay takes no time
        return tuned(undamped, ratio, self.drums.highest_hz).damped(drum.damping_d1_kg_m2_s, drum.damping_d3_kg_s)

    @property
    def curve(self) -> float:
        return self.patch.pluck.curve


@lru_cache(maxsize=256)
def tuned(drum: DrumParameters, ratio: float, highest_hz: float) -> DrumModes:
    """The modes of a drum whose pitch is raised by a ratio: a membrane's by its tension, a plate's by its size.

    Raises:
        ValueError: it is out of its bounds then, or has no mode.
    """
    if ratio == 1.0:
        return drum.modes(highest_hz, of.MOST_DRUM_MODES)
    if drum.tension_n_m == 0.0:
        size = 1 / math.sqrt(ratio)
        return replace(drum, length_m=drum.length_m * size, width_m=drum.width_m * size).modes(
            highest_hz, of.MOST_DRUM_MODES
        )
    wanted = ratio * _principal(drum)
    factor = ratio**2
    for _ in range(TUNINGS):
        changed = replace(drum, tension_n_m=drum.tension_n_m * factor)
        off = wanted / _principal(changed)
        if abs(off - 1) < NEAR:
            break
        factor *= off**2
    return replace(drum, tension_n_m=drum.tension_n_m * factor).modes(highest_hz, of.MOST_DRUM_MODES)


def _principal(drum: DrumParameters) -> float:
    """ω of the mode that gives a drum its pitch: over a kettle (1,1), for (0,1) dies away at once; else the first."""
    across = (
        2 * J01 / drum.length_m
        if drum.shape == "circle"
        else math.hypot(math.pi / drum.length_m, math.pi / drum.width_m)
    )
    in_vacuo_hz = across * math.sqrt((drum.tension_n_m + drum.bending_nm * across**2) / drum.mass_kg_m2) / math.tau
    modes = drum.modes(LOW_MODES_HZ * in_vacuo_hz, LOW_MODES)
    place = int(np.argmax(modes.surface.m == 1)) if drum.cavity_m3 and isinstance(modes.surface, Circle) else 0
    return float(modes.omega[place])


def block_of(found: DrumKey) -> Array:
    """The drum of a key as the kernels read it: see `playing_layout`."""
    resonator, mallet = found.modes.resonator(np.zeros((1, 2))), found.played.mallet.mallet
    n = resonator.modes
    block = np.zeros(of.DRUM_HEADER + of.DRUM_ROWS * n)
    block.view(np.int64)[of.DRUM_MODES] = n
    block[of.DRUM_MALLET_KG], block[of.DRUM_CONTACT_S] = mallet.mass_kg, mallet.contact_s
    block[of.DRUM_MASS_KG] = found.modes.mass_kg
    block[of.DRUM_SOFTEST_M_S], block[of.DRUM_HARDEST_M_S] = found.played.softest_m_s, found.played.hardest_m_s
    struck = found.struck(found.played.place)
    rows = [resonator.omega**2, resonator.sigma, resonator.coupling, resonator.stretch, struck]
    for row, values in enumerate([*rows, *found.heard]):
        first = of.DRUM_HEADER + row * n
        block[first : first + n] = values
    return block
