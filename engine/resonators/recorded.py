"""A string learned from a recording: what its partials add to the string's law, and the recorded note itself.

The law (`StringParameters`) gives pitch, stiffness and damping by two numbers. A recorded string departs from it.
Its damping over frequency has a shape of its own. Each partial lies some cents from the law, and decays faster or
slower than its neighbours. It moves in two directions across its length, with two frequencies and decays each.

The damping over frequency belongs to string and instrument and is carried to every key. What single partials add
belongs to the note, through the resonances of the instrument at their frequencies. It fades with the distance of a
key in pitch.

Each partial has two modes of one shape, of the first and of the second polarisation. They share the tension.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from engine import bounds
from engine.kernels.recorded import correct, split
from engine.resonators.base import Array, Resonator
from engine.resonators.string import resonator_of
from engine.values.string import StringParameters

if TYPE_CHECKING:
    from engine.kernels.recorded import Additions

MOST_CENTS = 60.0  # of a partial from the law, or of the second polarisation from the first
RATIOS = (0.05, 20.0)  # of decays
ATTACK_PEAK = 32_767  # full scale of a recorded attack's samples
LONGEST_ATTACK_S = 0.2
OF_PARTIALS = ("cents", "ratio", "second_cents", "second_ratio", "second_share")


@dataclass(frozen=True)
class RecordedNote:
    """The note as it was recorded: Re Σ a exp(s τ(t)), summed over poles s = -σ + iω, t in s after `begins`.

    Poles of partials glide with the string, in the time τ; free poles, which belong to none, have t in its place.

    Attributes:
        frames, onset, begins: of the recording, in its frames; what comes before the onset is silent.
        glide_s, glide: dτ/dt = 1 + Σ glide exp(-t/glide_s).
        hz, decay, real, imaginary: of each pole: ω/2π, σ in 1/s, a.
        partial: its number; 0: free.
    """

    rate_hz: int
    frames: int
    onset: int
    begins: int
    glide_s: tuple[float, ...]
    glide: tuple[float, ...]
    hz: tuple[float, ...]
    decay: tuple[float, ...]
    real: tuple[float, ...]
    imaginary: tuple[float, ...]
    partial: tuple[int, ...]

    def __post_init__(self) -> None:
        bounds.check("rate_hz", self.rate_hz, (1, bounds.HIGHEST_RATE_HZ), "Hz")
        bounds.check("frames", self.frames, (1, 60 * self.rate_hz))
        if not 0 <= self.onset <= self.begins <= self.frames:
            raise ValueError("onset and begins must lie in the recording, in this order")
        if len({len(getattr(self, name)) for name in ("hz", "decay", "real", "imaginary", "partial")}) != 1:
            raise ValueError("hz, decay, real, imaginary and partial must be of one length")
        if len(self.glide) != len(self.glide_s) or any(time <= 0 for time in self.glide_s):
            raise ValueError("glide and glide_s must be of one length, times above 0")
        if any(decay < 0 for decay in self.decay):
            raise ValueError("decay must not be below 0")

    def tau(self, t: Array) -> Array:
        """The times τ in s, in which the string does not glide, at times t (frames,) in s after `begins`."""
        tau = t.copy()
        for time, share in zip(self.glide_s, self.glide, strict=True):
            tau -= share * time * np.expm1(-t / time)
        return tau

    def sound(self, rate_hz: int | None = None) -> Array:
        """The samples (frames,) of the whole recording, ±1 being full scale, float64.

        Args:
            rate_hz: None: the recording's.
        """
        rate = rate_hz or self.rate_hz
        count = round(self.frames * rate / self.rate_hz)
        first = math.ceil(self.onset * rate / self.rate_hz)
        total = np.zeros(count)
        # poles are known from `begins` on; between the onset and there they rise evenly
        t = (np.arange(first, count) / rate) - self.begins / self.rate_hz
        rise_s = max((self.begins - self.onset) / self.rate_hz, 1 / rate)
        fade = np.clip(1 + t / rise_s, 0.0, 1.0)
        held = np.maximum(t, -rise_s)
        tau = self.tau(held)
        for hz, decay, real, imaginary, partial in zip(
            self.hz, self.decay, self.real, self.imaginary, self.partial, strict=True
        ):
            if 2 * hz >= rate:
                continue
            time = tau if partial else held
            s = complex(-decay, 2 * math.pi * hz)
            total[first:] += (complex(real, imaginary) * np.exp(s * time)).real
        total[first:] *= fade
        return total


@dataclass(frozen=True)
class RecordedAttack:
    """The attack of a recording without the modes' part, as it drives the body.

    Attributes:
        rows: samples, of a full scale of `ATTACK_PEAK`: at most 1000 in a row, as lists in files are bounded.
    """

    rate_hz: int
    rows: tuple[tuple[int, ...], ...]

    def __post_init__(self) -> None:
        bounds.check("rate_hz", self.rate_hz, (1_000, 48_000), "Hz")
        samples = [sample for row in self.rows for sample in row]
        bounds.check("samples of an attack", len(samples), (1, LONGEST_ATTACK_S * self.rate_hz))
        if not any(samples):
            raise ValueError("an attack must not be silent")
        for sample in samples:
            bounds.check("sample", sample, (-ATTACK_PEAK, ATTACK_PEAK))

    @staticmethod
    def of(samples: Array, rate_hz: int) -> RecordedAttack:
        """The attack from samples (frames,) of any level."""
        whole = np.rint(samples / np.abs(samples).max() * ATTACK_PEAK).astype(int).tolist()
        most = bounds.MOST_ENTRIES
        return RecordedAttack(rate_hz, tuple(tuple(whole[at : at + most]) for at in range(0, len(whole), most)))

    @property
    def samples(self) -> Array:
        """The samples with an energy of 1 s of full scale squared, (frames,)."""
        samples = np.array([value for row in self.rows for value in row], float)
        return np.asarray(samples / math.sqrt(float(samples @ samples) / self.rate_hz))


@dataclass(frozen=True)
class RecordedString:
    """The additions of a recording to a string's law.

    Attributes:
        pitch_hz: of the recorded note.
        smooth_hz, smooth_ratio: decay over that of the law at frequencies, carried to all keys.
        cents, ratio: of each partial of the note, beside the law and beside the smooth decay.
        second_cents, second_ratio: of the second polarisation, the higher one, beside the first.
        second_share: of the amplitude that the second polarisation has.
        note: the recorded note itself.
        attack: of the note, which instruments may play as the noise of a stroke; None: there is none.
        digest: SHA-256 of the recording's file.
        assumed: what the recording cannot give, in words.
        settings: of the fit.
        errors: against the recording, and other figures of the report.
    """

    pitch_hz: float
    smooth_hz: tuple[float, ...]
    smooth_ratio: tuple[float, ...]
    cents: tuple[float, ...]
    ratio: tuple[float, ...]
    second_cents: tuple[float, ...]
    second_ratio: tuple[float, ...]
    second_share: tuple[float, ...]
    note: RecordedNote
    file: str
    digest: str
    attack: RecordedAttack | None = None
    assumed: tuple[str, ...] = ()
    settings: dict[str, Any] = field(default_factory=dict)
    errors: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        bounds.check("pitch_hz", self.pitch_hz, (1.0, 20_000.0), "Hz")
        if len(self.smooth_hz) != len(self.smooth_ratio) or not self.smooth_hz:
            raise ValueError("smooth_hz and smooth_ratio must be of one length, above 0")
        if any(low >= high for low, high in pairwise(self.smooth_hz)):
            raise ValueError("smooth_hz must rise")
        if len({len(getattr(self, name)) for name in OF_PARTIALS}) != 1 or not self.cents:
            raise ValueError(f"{', '.join(OF_PARTIALS)} must be of one length, above 0")
        for name, least in (("cents", -MOST_CENTS), ("second_cents", 0.0)):
            for value in getattr(self, name):
                bounds.check(name, value, (least, MOST_CENTS), "cents")
        for name in ("smooth_ratio", "ratio", "second_ratio"):
            for value in getattr(self, name):
                bounds.check(name, value, RATIOS)
        for value in self.second_share:
            bounds.check("second_share", value, (0.0, 1.0))

    def resonator(
        self, string: StringParameters, modes: int, *, tension_modulated: bool = True, grid_points: int = 101
    ) -> Resonator:
        """The modes of a string of any pitch: two for each partial, the first `modes` of them by frequency.

        Raises:
            ValueError: the grid does not hold so many modes.
        """
        partials = (modes + 1) // 2
        law = resonator_of(string, partials, tension_modulated=tension_modulated, grid_points=grid_points)
        partial, shares = np.arange(modes) // 2, [1.0] * modes  # each mode's partial, from 0, and part of a pluck
        squares_and_sigma = np.concatenate([law.omega[partial] ** 2, law.sigma[partial]]).tolist()
        pitch_hz, *parts = self.additions
        additions: Any = pitch_hz, *(part.tolist() for part in parts)  # lists are faster, number by number
        correct(additions, string.row, modes, squares_and_sigma)  # in place
        split(additions, string.row, modes, shares)  # in place
        rows = np.array(squares_and_sigma)
        return Resonator(
            omega=np.sqrt(rows[:modes]),
            sigma=rows[modes:],
            coupling=law.coupling[partial],
            stretch=law.stretch[partial],
            tension_rise=law.tension_rise,
            shapes=law.shapes[partial],
            analysis=law.inverse[:, partial] * shares,
            mirror=None if law.mirror is None else law.mirror[partial],
        )

    @property
    def additions(self) -> Additions:
        """The same as the laws of `engine.kernels.recorded` take it.

        Returns:
            pitch in Hz; what each row fades to with the distance in pitch, (5,); logarithms of `smooth_hz` and of
            `smooth_ratio`, (points,) each; rows (5, partials) in the order of `OF_PARTIALS`.
        """
        rows = np.array([getattr(self, name) for name in OF_PARTIALS], float)
        rest = np.median(rows, axis=1)
        rest[:2] = 0.0, 1.0  # cents and ratio, if the note has no such frequency; the others fade to its median
        return self.pitch_hz, rest, np.log(self.smooth_hz), np.log(self.smooth_ratio), rows
