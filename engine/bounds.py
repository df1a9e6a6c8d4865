"""The bounds on whatever a file asks for: the one place for them, looked at before anything is built.

Presets, settings and plans come from strangers. A few bytes of them can ask for any amount of memory or time, so each
number has a bound here. The bounds lie far beyond every string and model that anybody would train on one computer.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping
from typing import Any

# Files
LARGEST_PRESET_BYTES = 64 * 2**20
LARGEST_HEADER_BYTES = 2**20  # of safetensors: names, shapes and metadata
LARGEST_TEXT_BYTES = 2**20  # of JSON
LARGEST_TOML_BYTES = 2**16
MOST_JSON_ENTRIES = 50_000  # of all lists and tables together: a check may report an error for each
MOST_DOTS = 16  # of a key of TOML: its parser keeps every beginning of it
LARGEST_IMPULSE_BYTES = 64 * 2**20  # of an impulse response in a sound file
DEEPEST_NESTING = 32
LONGEST_STRING = 10_000  # characters of one value
MOST_ENTRIES = 1_000  # of one list
LARGEST_INTEGER = 2**63 - 1

# Models: field of a configuration -> least and most. A field that is not here takes OTHER_SIZES.
SIZES: Mapping[str, tuple[int, int]] = {
    "grid_points": (1, 10_001),
    "state_size": (1, 4_096),
    "rank": (1, 4_096),
    "width": (1, 1_024),
    "depth": (1, 32),
    "layers": (0, 64),
    "lags": (1, 64),
    "node_spacing": (1, 1_000_000),
    "modes": (1, 65_536),
    "degree": (0, 32),
    "hippo_blocks": (1, 2_048),
}
OTHER_SIZES = (-65_536, 65_536)
MOST_LAYERS_OF_WIDTHS = 16
LARGEST_WIDTH = 8_192

# Strings: parameter -> least and most, in the unit of its name
STRING: Mapping[str, tuple[float, float]] = {
    "length_m": (0.01, 100.0),
    "area_m2": (1e-10, 1e-2),
    "second_moment_m4": (0.0, 1e-6),
    "density_kg_m3": (1.0, 1e5),
    "youngs_modulus_pa": (0.0, 1e13),
    "damping_d1_kg_m_s": (0.0, 1e3),
    "damping_d3_kg_m_s": (0.0, 1e3),
    "tension_n": (1e-3, 1e6),
}

# Two polarisations: likewise
POLARISATIONS: Mapping[str, tuple[float, float]] = {
    "angle_deg": (0.0, 80.0),
    "second_heard": (0.0, 1.0),
    "second_cents": (0.0, 20.0),
    "conductance_s_kg": (0.0, 0.5),
    "second_conductance_s_kg": (0.0, 0.5),
}

LOSSES: Mapping[str, tuple[float, float]] = {"air": (0.0, 20.0), "friction": (0.0, 0.1), "bending": (0.0, 1.0)}

# Drums: likewise
DRUM: Mapping[str, tuple[float, float]] = {
    "length_m": (0.01, 3.0),
    "width_m": (0.005, 3.0),
    "thickness_m": (1e-5, 0.02),
    "density_kg_m3": (1.0, 1e5),
    "youngs_modulus_pa": (1e5, 1e13),
    "poisson": (0.01, 0.5),
    "tension_n_m": (0.0, 1e6),
    "damping_d1_kg_m2_s": (0.0, 1e4),
    "damping_d3_kg_s": (0.0, 1e3),
    "uneven": (0.0, 0.05),
    "air_kg_m3": (0.0, 2.0),
    "cavity_m3": (0.0, 10.0),
    "shell_m": (0.0, 2.0),
}
MALLET: Mapping[str, tuple[float, float]] = {
    "mass_kg": (1e-4, 5.0),
    "radius_m": (0.0, 0.2),
    "contact_s": (1e-5, 0.05),
}
STRIKE_SPEED_M_S = (0.0, 30.0)
MOST_SURFACE_MODES = 20_000  # that are looked at before the lowest are chosen

# Motion
HIGHEST_RATE_HZ = 1_000_000
MOST_FRAMES = 10**9  # of a horizon
MOST_MATRIX_NUMBERS = 2_000_000  # modes times grid points: 16 MB a matrix of shapes
MOST_NUMBERS_A_SECOND = 100_000_000  # grid points times rate
MOST_SUBSTEPS = 1_024  # of the truth in a sample
MOST_FLOWS = 250_000  # modes times kinds of sub-steps: 64 MB of the truth's tables
SUBSTEPS_IN_A_PERIOD = 36  # of the highest mode; see `default_substeps`

# Impulse responses
LONGEST_IMPULSE_S = 3.0
IMPULSE_RATE_HZ = (8_000, 384_000)
MOST_IMPULSE_CHANNELS = 2

# Effects
BODY_SIZE = (0.5, 2.0)  # in lengths of its model
ROOM_T60_S = (0.2, 3.0)
AMP_DRIVE_DB = (0.0, 36.0)  # at its end, aliases of 5 kHz at full scale are 80 dB below the tone
AMP_TONE_DB = (-12.0, 12.0)

# Work
MOST_RUNS = 2_000  # of a plan
MOST_WORKERS = 1_024  # processes, and threads of one of them
MOST_SEEDS = 100  # that are trained together
MOST_EPOCHS = 1_000_000
MOST_RETRIES = 100  # of a run that fails
LARGEST_SEED = 2**63 - 1
MOST_TRAJECTORIES = 1_000_000  # of a data set
LARGEST_DATASET_BYTES = 64 * 2**30


def check(name: str, value: float, limits: tuple[float, float], unit: str = "") -> None:
    """Raise ValueError, naming the field and its range, where a value is out of it."""
    low, high = limits
    if not low <= value <= high:
        reported = f" {unit}" if unit else ""
        shown = f"{value:.10g}" if isinstance(value, float) else brief(value)
        raise ValueError(f"{name} must lie in {low:.10g} … {high:.10g}{reported}, not {shown}")


def check_all(value: Any, limits: Mapping[str, tuple[float, float]], of: str = "") -> None:
    """Raise ValueError where `check` does, for the fields of a dataclass that have limits.

    None passes where it is the default. `of` stands before the field's name in messages.
    """
    for name, low_high in limits.items():
        number = getattr(value, name)
        if number is None and any(
            field.name == name and field.default is None for field in dataclasses.fields(value)
        ):
            continue
        if number is None or isinstance(number, bool):
            raise ValueError(f"{of}{name} must be a number, not {number}")
        check(f"{of}{name}", number, low_high)


def check_choice(name: str, value: object, known: Collection[str]) -> None:
    """Raise ValueError, naming the field and what there is, where a value is none of those that are known."""
    if value not in known:
        raise ValueError(f"{name} {brief(value)} is not one of {', '.join(known)}")


def brief(value: object) -> str:
    """A value in a message: never longer than a few words."""
    if isinstance(value, int) and abs(value) > LARGEST_INTEGER:
        return f"a whole number of {value.bit_length()} bits"
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."


# A pluck: place and width in lengths, peak
POSITION_RANGE = (0.02, 0.98)
WIDTH_RANGE = (0.02, 1.0)
LARGEST_AMPLITUDE_MM = 20.0
AMPLITUDE_MM_RANGE = (0.0, LARGEST_AMPLITUDE_MM)
PLUCK: Mapping[str, tuple[float, float]] = {
    "position": POSITION_RANGE,
    "width": WIDTH_RANGE,
    "amplitude_mm": AMPLITUDE_MM_RANGE,
}
