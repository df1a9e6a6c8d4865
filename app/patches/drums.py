"""Drums of a patch: membranes and plates, each struck by its mallet at its place."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal, Self

from pydantic import Field, model_validator

from app.patches.fields import Key, Name, Value, ranged
from engine import bounds

if TYPE_CHECKING:
    from engine.resonators.drum import DrumParameters
    from engine.strike import Mallet

MOST_DRUMS = 32
HIGHEST_HZ = 6_000.0  # of a drum's modes, where the patch does not say
Side = Annotated[float, ranged(-1, 1)]


class PhysicalDrum(Value):
    """The parameters of `DrumParameters`; this class does not need the engine to be loaded."""

    shape: Literal["circle", "rectangle", "bar"]
    length_m: Annotated[float, ranged(*bounds.DRUM["length_m"])]
    width_m: Annotated[float, ranged(*bounds.DRUM["width_m"])]
    thickness_m: Annotated[float, ranged(*bounds.DRUM["thickness_m"])]
    density_kg_m3: Annotated[float, ranged(*bounds.DRUM["density_kg_m3"])]
    youngs_modulus_pa: Annotated[float, ranged(*bounds.DRUM["youngs_modulus_pa"])]
    poisson: Annotated[float, ranged(*bounds.DRUM["poisson"])]
    tension_n_m: Annotated[float, ranged(*bounds.DRUM["tension_n_m"])]
    damping_d1_kg_m2_s: Annotated[float, ranged(*bounds.DRUM["damping_d1_kg_m2_s"])]
    damping_d3_kg_s: Annotated[float, ranged(*bounds.DRUM["damping_d3_kg_s"])]
    uneven: Annotated[float, ranged(*bounds.DRUM["uneven"])] = 0.0
    air_kg_m3: Annotated[float, ranged(*bounds.DRUM["air_kg_m3"])] = 0.0
    cavity_m3: Annotated[float, ranged(*bounds.DRUM["cavity_m3"])] = 0.0
    shell_m: Annotated[float, ranged(*bounds.DRUM["shell_m"])] = 0.0

    @property
    def parameters(self) -> DrumParameters:
        """The same for the engine, which this loads. Raises ValueError: they do not go together."""
        from engine.resonators.drum import DrumParameters  # brings NumPy and SciPy

        return DrumParameters(**self.model_dump())

    @model_validator(mode="after")
    def _sides_fit(self) -> Self:
        longer, shorter = max(self.length_m, self.width_m), min(self.length_m, self.width_m)
        if self.shape == "circle" and longer > 1.2 * shorter:
            raise ValueError("length_m and width_m of a circle are its two diameters; make them alike")
        if self.thickness_m > (self.length_m if self.shape == "bar" else shorter) / 10:
            raise ValueError("thickness_m must be below a tenth of the sides; choose a thinner one")
        if self.shell_m and (self.cavity_m3 or not self.air_kg_m3):
            raise ValueError("shell_m is of an open shell in air; set cavity_m3 to 0 and air_kg_m3, or shell_m to 0")
        return self


class PhysicalMallet(Value):
    """The mallet of a drum, as `Mallet`."""

    mass_kg: Annotated[float, ranged(*bounds.MALLET["mass_kg"])] = 0.015
    radius_m: Annotated[float, ranged(*bounds.MALLET["radius_m"])] = 0.005
    contact_s: Annotated[float, ranged(*bounds.MALLET["contact_s"])] = 0.004

    @property
    def mallet(self) -> Mallet:
        """The same for the engine, which this loads."""
        from engine.strike import Mallet

        return Mallet(**self.model_dump())


class PlayedDrum(Value):
    """A drum and how it is struck.

    Attributes:
        note: of the MIDI key that plays it as it is.
        place: where it is struck, from the centre in half-lengths.
        softest_m_s, hardest_m_s: speeds of velocity 1 and 127; between them a step of velocity is a ratio.
    """

    note: Key
    name: Name
    drum: PhysicalDrum
    mallet: PhysicalMallet = PhysicalMallet()
    place: tuple[Side, Side] = (0.3, 0.1)
    softest_m_s: Annotated[float, ranged(0.001, 30)] = 0.2
    hardest_m_s: Annotated[float, ranged(0.001, 30)] = 8.0

    @model_validator(mode="after")
    def _on_the_drum(self) -> Self:
        x, y = self.place
        if (x * x + y * y if self.drum.shape == "circle" else max(x * x, y * y)) >= 1:
            raise ValueError("place is not on the drum; choose one nearer the centre")
        if self.softest_m_s > self.hardest_m_s:
            raise ValueError("softest_m_s must not be above hardest_m_s; lower it")
        return self


class Drums(Value):
    """Drums by rising note.

    Attributes:
        keys: "pads": a drum for its own key each; "pitch": a key plays the drum at or below it (below all, the
            lowest), tuned to the key: a membrane by its tension, a plate by its size.
        highest_hz: of the modes that sound.
    """

    kind: Literal["drums"] = "drums"
    drums: Annotated[tuple[PlayedDrum, ...], Field(min_length=1, max_length=MOST_DRUMS)]
    keys: Literal["pads", "pitch"] = "pads"
    highest_hz: Annotated[float, ranged(500, 20_000)] = HIGHEST_HZ

    @model_validator(mode="after")
    def _rise(self) -> Self:
        notes = [drum.note for drum in self.drums]
        if notes != sorted(set(notes)):
            raise ValueError("drums must be listed by rising note, each note once; put them in order")
        return self

    def of_key(self, key: int) -> PlayedDrum | None:
        """The drum that a key plays; None: it has none."""
        if self.keys == "pads":
            return next((drum for drum in self.drums if drum.note == key), None)
        return next((drum for drum in reversed(self.drums) if drum.note <= key), self.drums[0])
