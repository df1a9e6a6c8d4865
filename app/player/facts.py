"""A key's string in figures, in string makers' units; the way from such a figure back to its knob; and its warnings.

Warnings name the parts of a note outside the training of the model that plays it, also after a knob was turned.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from app.instruments.drums import PlayedDrum
from app.instruments.instrument import Instrument
from app.player.events import NoteOn
from app.player.strings import KeyString, Strings, decay_rates, on_string
from app.shared.key_names import note_name
from engine.parameters import OF_INSTRUMENTS
from engine.pluck import Pluck
from engine.presets import PresetInfo, outside_training
from engine.presets.of_string import info_of_string
from engine.resonators.family import BRIGHT_HZ, inharmonicity
from engine.resonators.losses import loss_rate
from engine.values.string import StringParameters

HALVINGS = 40  # of a knob's range, until it stands at a wanted figure
SLOWEST = 1e-9  # decay rate in 1/s, shown for a string without damping


@dataclass(frozen=True)
class MeasuredFact:
    """A figure that a knob of the string changes, measured on a string.

    Attributes:
        of: the figure of a string of an instrument.
        falls: whether it falls while the knob rises.
    """

    of: Callable[[StringParameters, Instrument], float]
    falls: bool = False


def bright_mode(string: StringParameters) -> int:
    """The mode near BRIGHT_HZ; the first of a string that is higher."""
    return max(1, round(BRIGHT_HZ * math.tau / string.undamped_frequency(1)))


def t60_s(string: StringParameters, mode: int, instrument: Instrument) -> float:
    """The time in which a mode falls by 60 dB, by the string's own losses."""
    rate = string.decay_rate(mode)
    if instrument.losses is not None:
        knobs = instrument.knobs
        rate += loss_rate(instrument.losses, string, mode, knobs.decay, knobs.brightness_decay)
    return math.log(1000) / max(rate, SLOWEST)


def by_two_numbers(instrument: Instrument, string: StringParameters) -> StringParameters:
    """The string with losses by d₁ and d₃ alone, whose decay rates are right at the first partial and near BRIGHT_HZ.

    The string itself where the instrument has no losses by mode.
    """
    if instrument.losses is None:
        return string
    bright = max(2, bright_mode(string))
    rates = decay_rates(instrument, string, bright)
    rising = float(rates[-1] - rates[0]) / (bright**2 - 1)
    twice_mass, eta2 = 2 * string.mass_per_length_kg_m, (math.pi / string.length_m) ** 2
    d1, d3 = twice_mass * (float(rates[0]) - rising), twice_mass * rising / eta2
    return replace(string, damping_d1_kg_m_s=max(d1, 0.0), damping_d3_kg_m_s=max(d3, 0.0))


FIGURES: Mapping[str, MeasuredFact] = {  # by the field of the instrument
    "knobs.tension": MeasuredFact(lambda string, _: string.tension_n),
    "knobs.length": MeasuredFact(lambda string, _: 1000 * string.length_m),
    "knobs.gauge": MeasuredFact(lambda string, _: 2000 * math.sqrt(string.area_m2 / math.pi)),
    "knobs.density": MeasuredFact(lambda string, _: string.density_kg_m3),
    "knobs.modulus": MeasuredFact(lambda string, _: string.youngs_modulus_pa / 1e9),
    "knobs.stiffness": MeasuredFact(lambda string, _: inharmonicity(string)),
    "knobs.decay": MeasuredFact(lambda string, instrument: t60_s(string, 1, instrument), falls=True),
    "knobs.brightness_decay": MeasuredFact(
        lambda string, instrument: t60_s(string, bright_mode(string), instrument), falls=True
    ),
}


def facts_of(string: KeyString) -> dict[str, str]:
    """The facts of a key's string that no knob shows: values with their units, by name."""
    parameters = string.parameters
    return {
        "key": note_name(string.key),
        "pitch": f"{string.pitch_hz:.1f} Hz",
        "mass": reported(1000 * parameters.mass_per_length_kg_m, "g/m"),
        "stress": reported(parameters.tension_n / parameters.area_m2 / 1e6, "MPa"),
    }


def facts_of_drum(played: PlayedDrum) -> dict[str, str]:
    """A drum in figures: values with their units, by name."""
    drum = played.drum
    size = reported(100 * drum.length_m, "cm")
    if drum.shape != "circle":
        size = f"{reported(100 * drum.length_m, '')} × {reported(100 * drum.width_m, 'cm')}"
    tension = reported(drum.tension_n_m / 1000, "kN/m") if drum.tension_n_m else "stiff, without tension"
    return {"drum": played.name, "key": note_name(played.note), "size": size, "tension": tension}


def figures_of(string: StringParameters, instrument: Instrument) -> dict[str, str]:
    """The figures of an instrument's string with their units, by field."""
    units = {field: OF_INSTRUMENTS[field].figure_unit or "" for field in FIGURES}
    return {field: reported(figure.of(string, instrument), units[field]) for field, figure in FIGURES.items()}


def reported(figure: float, unit: str) -> str:
    """Three digits and the unit: "70.3 N"."""
    if figure == 0:
        text = "0"
    elif 1e-3 <= figure < 1e6:
        text = f"{figure:.{max(0, 2 - math.floor(math.log10(figure)))}f}"
    else:
        text = f"{figure:.1e}"
    return f"{text} {unit}".rstrip()


def knob_for(instrument: Instrument, key: tuple[int, int | None], field: str, figure_value: float) -> float:
    """Find the knob value where a figure of a key's string is as wanted, or as near as it goes.

    Args:
        key: and on which string of the set it is played, as in `Strings.of_key`.
        field: one of FIGURES.
        figure_value: in the parameter's `figure_unit`.

    Raises:
        ValueError: the key is silent.
    """
    figure, name = FIGURES[field], field.removeprefix("knobs.")
    low, high = OF_INSTRUMENTS[field].limits
    for _ in range(HALVINGS):
        middle = math.sqrt(low * high)
        trial = instrument.model_copy(update={"knobs": instrument.knobs.model_copy(update={name: middle})})
        try:
            key_string = Strings(trial).of_key(*key)
        except ValueError:  # an impossible string: go towards 1, where the string is possible
            above = middle > 1
        else:
            if key_string is None:
                raise ValueError(f"key {key[0]} of {instrument.name} is silent; choose another")
            above = (figure.of(key_string.parameters, trial) > figure_value) != figure.falls
        low, high = (low, middle) if above else (middle, high)
    return math.sqrt(low * high)


def outside_of_key(info: PresetInfo, instrument: Instrument, event: NoteOn, string: int | None = None) -> list[str]:
    """The warnings as of `outside_of_string`, for a key's sound; empty for a key without a possible string.

    Wheels and slides are left out.

    Args:
        info: of the preset that plays it.
        event: the struck key and its velocity.
        string: on which of a set it is played, as of `Strings.of_key`.
    """
    try:
        key_string = Strings(instrument).of_key(event.key, string)
    except ValueError:
        key_string = None
    if key_string is None:
        return []
    return outside_of_string(
        info,
        by_two_numbers(instrument, key_string.parameters),
        on_string(key_string, instrument.pluck.pluck(event.velocity)),
    )


def outside_of_string(info: PresetInfo, string: StringParameters, pluck: Pluck) -> list[str]:
    """The differences of a string and its pluck from a preset's training, in plain words; empty where none."""
    if info.family is not None:
        with contextlib.suppress(ValueError):  # it cannot play that one; its own string is judged
            info = info_of_string(info, string)
    return outside_training(info, pluck)
