"""The keys of an instrument of drums before anybody plays them: modes, and what blow and ear make of them.

What `StringKeys` is for strings; the compiled player computes gains.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from app.instruments.drums import Drums, PlayedDrum
from app.instruments.instrument import Instrument
from app.instruments.tuning import Tuning
from app.player.effects import body_curves
from engine.kernels import constants as of
from engine.kernels import drum_modes as kernel
from engine.kernels import velocities
from engine.kernels.records import DRUM, DRUM_ROWS
from engine.resonators.base import Array
from engine.resonators.drum import DrumModes, modes_of, numbers_of, tune
from engine.resonators.surface import tools
from engine.strike import Strike
from engine.values.drum import DrumParameters
from engine.values.ear import Ear

NEAREST_RIM = 0.98  # of half a drum: at the rim itself nothing moves


@dataclass(frozen=True, eq=False)
class DrumKey:
    """The drum of a key.

    Attributes:
        key: of MIDI.
        played: the drum with its mallet, place and speeds, as they are for this key.
        modes: with the instrument's knobs, tuned to the key.
        points: where it is heard, as in `Ear.points`.
    """

    key: int
    played: PlayedDrum
    modes: DrumModes
    points: tuple[float, ...]

    def struck(self, place: tuple[float, float]) -> Array:
        """The speeds (modes,) that 1 N s of its mallet gives at a place, in half-lengths from the centre.

        A place beyond the rim is taken as the nearest one within.
        """
        place = on_the_drum(self.played, place)
        return self.modes.struck(place, self.played.mallet.radius_m)

    def strike(self, velocity: float, curve: float = 0.0) -> Strike:
        """The blow of a velocity in 1 … 127."""
        played = self.played
        speed = velocities.between(played.softest_m_s, played.hardest_m_s, velocities.share(velocity, curve))
        return Strike(played.place, speed, played.mallet)

    def drop_cents(self, velocity: float, curve: float = 0.0) -> float:
        """The fall of the pitch of the first mode after a blow of a velocity in 1 … 127, in cents."""
        speeds = self.strike(velocity, curve).speeds(self.modes)
        resonator = self.modes.resonator(np.zeros((1, 2)))
        rise = float(resonator.relative_tension_rise(speeds / self.modes.omega)) / 2  # ΔT/T₀ over the first swing
        return 600 * math.log2(1 + rise)


def on_the_drum(played: PlayedDrum, place: tuple[float, float]) -> tuple[float, float]:
    """The nearest place within the rim."""
    x, y = place
    away = math.hypot(x, y) if played.drum.shape == "circle" else max(abs(x), abs(y))
    return (x * NEAREST_RIM / away, y * NEAREST_RIM / away) if away > NEAREST_RIM else place


class DrumKeys:
    """The keys of an instrument of drums, heard at `ear`; see `StringKeys`. Modes of a drum are remembered."""

    polarisations = None  # drums have none; read by `table_of`

    def __init__(self, instrument: Instrument, ear: Ear, near: DrumKeys | None = None) -> None:
        """Raise ValueError: the tuning or a drum is impossible.

        Args:
            near: keys of nearly the same instrument, of which the body's curves are taken instead, in no time.
        """
        assert isinstance(instrument.strings, Drums)
        self.instrument = instrument
        self.ear = ear
        self.drums = instrument.strings
        self._tuning = Tuning(instrument.tuning)
        self.body: Array | None = body_curves(instrument) if near is None else near.body
        self._known: dict[int, DrumKey | None] = {}  # by key; None: silent

    def of_key(self, key: int, string: int | None = None) -> DrumKey | None:
        """The drum of a key, remembered; None for a silent key. Raises ValueError: the key has no possible drum."""
        if key not in self._known:
            drum_and_ratio = self.tuned_to(key)
            self._known[key] = None if drum_and_ratio is None else self._drum_key(key, *drum_and_ratio)
        return self._known[key]

    def tuned_to(self, key: int) -> tuple[PlayedDrum, float] | None:
        """The drum that a key plays, with its mallet's speeds there, and the ratio of its tuning; None: silent."""
        low, high = self.instrument.range
        played = self.drums.of_key(key)
        if played is None or not low <= key <= high or not self._tuning.mapped(key):
            return None
        ratio = 1.0 if self.drums.keys == "pads" else self._tuning.hz(key) / self._tuning.hz(played.note)
        # a slack head is struck more softly, so that its tension rises no more
        softer = min(1.0, ratio if played.drum.tension_n_m == 0 else ratio**2)
        speeds = {name: getattr(played, name) * softer for name in ("softest_m_s", "hardest_m_s")}
        return played.model_copy(update=speeds), ratio

    def _drum_key(self, key: int, played: PlayedDrum, ratio: float) -> DrumKey:
        """The drum of a key, with the instrument's knobs, raised in pitch by a ratio. Raises ValueError."""
        knobs, drum = self.instrument.knobs, played.drum
        d1, d3 = drum.damping_d1_kg_m2_s * knobs.decay, drum.damping_d3_kg_s * knobs.brightness_decay
        modulus_pa = drum.youngs_modulus_pa * knobs.modulus
        try:
            undamped = replace(drum, damping_d1_kg_m2_s=0.0, damping_d3_kg_s=0.0, youngs_modulus_pa=modulus_pa)
            modes = tuned(undamped, ratio, self.drums.highest_hz).damped(d1, d3)  # a knob of decay takes no time
        except ValueError as error:
            raise ValueError(f"key {key} of {self.instrument.name}, {played.name}: {error}") from error
        return DrumKey(key, played, modes, self.ear.points)


@lru_cache(maxsize=256)
def tuned(drum: DrumParameters, ratio: float, highest_hz: float) -> DrumModes:
    """The modes of a drum whose pitch is raised by a ratio; see `engine.resonators.drum.tune`.

    Raises:
        ValueError: it is out of its bounds then, or has no mode.
    """
    return modes_of(tune(drum, ratio, highest_hz), highest_hz, of.MOST_DRUM_MODES)


def block_of(drum_key: DrumKey) -> Array:
    """The drum of a key as the kernels read it: the record `records.DRUM`, then DRUM_ROWS rows of its modes.

    It is an array of float64 (slots,).
    """
    modes = len(drum_key.modes)
    block = np.zeros(DRUM.itemsize // 8 + DRUM_ROWS * modes)
    drum = struck_drum(drum_key.played, drum_key.modes.drum)
    work = tools()
    kernel.write(drum, drum_key.modes.rows, np.array(drum_key.points), work, block.ctypes.data, modes)
    return block


def struck_drum(played: PlayedDrum, drum: DrumParameters) -> Array:
    """The numbers of a drum and of its blow, (21,), in the order of `engine.kernels.drum_modes`."""
    mallet, place = played.mallet, on_the_drum(played, played.place)
    blow = *place, mallet.mass_kg, mallet.radius_m, mallet.contact_s, played.softest_m_s, played.hardest_m_s
    return np.concatenate([numbers_of(drum), blow])
