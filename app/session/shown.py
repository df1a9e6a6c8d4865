"""The sources in the slots A and B in plots of a sound, with the words of legends and axes."""

from __future__ import annotations

from dataclasses import dataclass, replace

from app.presets.library import Library
from app.session.choices import Choices
from app.session.monitor import Monitor
from app.session.slots import source_title
from app.shared.vocabulary import DIFFERENCE
from engine.levels import FULL_SCALE_M, FULL_SCALE_M_S, FULL_SCALE_N, FULL_SCALE_PA

LEGEND_FIELDS = {*Monitor.model_fields, "ear"}  # of `Choices`: what legends depend on
_UNITS = {"displacement": "m", "velocity": "m/s", "bridge": "N", "pressure": "Pa"}  # of a pick-up's signal
_PREFIXES = ((1.0, ""), (1e3, "m"), (1e6, "µ"), (1e9, "n"))  # factor from the SI unit, name


@dataclass(frozen=True)
class ShownSource:
    """A source that is drawn.

    Attributes:
        source: as in `Choices.a`.
        slots: the letters of the slots that hold it; empty where none does.
        title: its name for people; of another preset its title.
        heard: whether it is the one that sounds now.
        gain_db: the stated gain of the difference, with which it is heard and drawn. The gain that matches levels is
            not drawn and not in it.
    """

    source: str
    slots: str
    title: str
    heard: bool = False
    gain_db: float = 0.0

    @property
    def remark(self) -> str:
        """The remark behind the title in a legend: the gain, and whether it is heard."""
        gain = f" {self.gain_db:+.0f} dB" if self.gain_db else ""
        return f"{gain}{' · heard' if self.heard else ''}"

    def heading(self, unit: str) -> str:
        """The heading of its values in a file."""
        return f"{self.slots} {self.title}{replace(self, heard=False).remark} ({unit})"

    @property
    def gain(self) -> float:
        """The gain as a factor of the signal."""
        return float(10 ** (self.gain_db / 20))


DEFAULT_SOURCES = (ShownSource("model", "A", "model", heard=True), ShownSource("truth", "B", "truth"))


def shown_sources(choices: Choices, library: Library) -> tuple[ShownSource, ...]:
    """The source in slot A and the one in slot B; one alone where both hold the same."""
    a, b = choices.source_of("a"), choices.source_of("b")
    slots = {a: "A B"} if a == b else {a: "A", b: "B"}
    gains_db = {DIFFERENCE: choices.difference_gain_db}
    return tuple(
        ShownSource(
            source, letters, source_title(source, library), source == choices.source_heard, gains_db.get(source, 0.0)
        )
        for source, letters in slots.items()
    )


def part_words(choices: Choices) -> str:
    """The drawn part of the sound: the soloed mode, and in stereo the left side; "" for all of it."""
    parts = (f"mode {choices.solo}" if choices.solo else "", "left" if choices.stereo else "")
    return ", ".join(part for part in parts if part)


def level_words(pickup: str) -> str:
    """The label of levels: the displacement, velocity, force or pressure that 0 dB stands for."""
    full_scales = {
        "displacement": f"{1000 * FULL_SCALE_M:g} mm",
        "velocity": f"{FULL_SCALE_M_S:g} m/s",
        "bridge": f"{FULL_SCALE_N:g} N",
        "pressure": f"{FULL_SCALE_PA:g} Pa",
    }
    return f"dB re {full_scales[pickup]}"


def readable_unit(peak: float, pickup: str) -> tuple[float, str]:
    """Factor and name of a unit in which `peak`, in m, m/s, N or Pa, has few digits.

    A displacement has mm at most.
    """
    prefixes = _PREFIXES[1:] if pickup == "displacement" else _PREFIXES
    factor, prefix = next((pair for pair in prefixes if peak * pair[0] >= 0.1), prefixes[-1] if peak else prefixes[0])
    return factor, prefix + unit_of(pickup)


def unit_of(pickup: str) -> str:
    """The unit of a pick-up's signal."""
    return _UNITS[pickup]
